"""What lies in the way of beams: shadows of all legs on the last facet, as the beams and the receiver see it."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ...base.vectors import cross, dot, unit
from ._beams import LEAST_AREA, TURNED_AWAY, Beams, Surfaces, faces, first, halved, in_blocks, mirrored
from ._facet_tree import Cones
from ._polygons import PAIRS_AT_ONCE, Polygons, Shadows, folded, joined, less_shadows

EDGE_ON = 1e-6  # sine below which an antenna that is edge-on to a facet casts no shadows on it
DIRECTIONS = 6  # across a leg, in which the outlines of beams and of what may lie in their way are compared


def lit(surfaces: Surfaces, beams: Beams, turn: float) -> tuple[Polygons, np.ndarray]:
    """What shadows of all legs leave of beams: convex polygons, and the beam of each, in rising order.

    turn  rad: directions to two of the antennas' positions differ by no more
    """
    rows = np.arange(len(beams))  # beams of which something is lit on the legs so far
    pieces, of = beams.polygons, rows
    for leg, end, image, start in _legs(surfaces, beams):
        lit_beams = beams[rows]
        chain, shapes = _between(surfaces, lit_beams, leg, end[rows], image[rows], start[rows], turn)
        place = np.searchsorted(rows, of)
        pieces, place = _less(surfaces, lit_beams, pieces, place, lit_beams.apex, chain, shapes)
        of = rows[place]
        rows = np.unique(of)
    return pieces, of


def sides_seen(surfaces: Surfaces, antennas: np.ndarray, turn: float) -> np.ndarray:
    """Whether antennas, m (n, 3), may see facets on the side behind their normal and on that in front (k, 2)."""
    out = np.zeros((len(surfaces.areas), 2), bool)
    facets = np.flatnonzero(surfaces.mirrors)

    def lit_of(block: slice) -> Beams:
        beams = first(surfaces, antennas, facets[block])
        return beams[np.unique(lit(surfaces, beams, turn)[1])]

    for beams in halved(len(facets), lit_of):
        facet = beams.chains[:, 0]
        out[facet, surfaces.side(facet, beams.normals[:, 0])] = True
    for place in antennas:  # edge-on, where physical optics fades out
        sine = dot(surfaces.normals, unit(place - surfaces.centers))
        out[np.abs(sine) <= TURNED_AWAY] = True
    return out


def seen(
    surfaces: Surfaces, beams: Beams, pieces: Polygons, of: np.ndarray, rx: np.ndarray, turn: float
) -> tuple[Polygons, np.ndarray]:
    """What receivers, m (k, 3), see of pieces of beams `of` (n,): as `lit`."""
    if not len(beams):
        return pieces, of
    rows = np.flatnonzero(faces(surfaces, beams.last, beams.normals[beams.chain, -1], rx)[of])
    pieces, of = pieces[rows], of[rows]
    start = Polygons(rx[:, None], np.ones(len(rx), np.int64))
    chain, shapes = _between(surfaces, beams, beams.order, beams.polygons, rx, start, turn, receives=True)
    sine = dot(beams.normals[beams.chain, -1], unit(rx - surfaces.centers[beams.last]))
    return _less(surfaces, beams, pieces, of, rx, chain, shapes, sine > EDGE_ON)


def _less(
    surfaces: Surfaces,
    beams: Beams,
    pieces: Polygons,
    of: np.ndarray,
    apex: np.ndarray,
    chain: np.ndarray,
    shapes: Polygons,
    casts: np.ndarray | None = None,
) -> tuple[Polygons, np.ndarray]:
    """Pieces less the shadows of shapes, each in the way of all beams of a chain (n,); casts  of which beams (k,)."""
    least = LEAST_AREA * surfaces.areas[beams.last]
    has_pieces = np.bincount(of, minlength=len(beams)) > 0
    if casts is not None:
        has_pieces &= casts
    shadows = []
    number = np.diff(np.append(beams.first_of, len(beams)))[chain]
    for pairs in in_blocks(number):
        row, place = beams.rows_of(chain[pairs])
        is_shaded = has_pieces[row]
        row, place = row[is_shaded], place[is_shaded] + pairs.start
        shadows.append(Shadows.falling_on(beams.polygons, apex, row, shapes[place], least, surfaces.snap))
    if not shadows:
        return pieces, of
    return less_shadows(pieces, of, Shadows.joined(shadows), least, surfaces.snap)


def _legs(surfaces: Surfaces, beams: Beams) -> Iterator[tuple[int, Polygons, np.ndarray, Polygons]]:
    """Legs of the beams from the last to the first: number, polygons on the facet where each ends, the antenna's image
    from which it comes, m (k, 3), and polygons where it begins."""
    corners, image, m = beams.polygons.corners, beams.apex, beams.order
    ends = [(beams.polygons, image)]
    for leg in range(m - 1, 0, -1):
        normal, point = beams.normals[beams.chain, leg - 1], surfaces.centers[beams.chains[beams.chain, leg - 1]]
        corners, image = mirrored(corners, normal, point), mirrored(image, normal, point)
        away = corners - image[:, None]
        rise = (away * normal[:, None]).sum(axis=-1)
        part = dot(point - image, normal)[:, None] / np.where(rise == 0, 1, rise)
        ends.append((Polygons(image[:, None] + part[..., None] * away, beams.polygons.count), image))
    starts = [end for end, _ in ends[1:]] + [Polygons(ends[-1][1][:, None], np.ones(len(beams), np.int64))]
    for leg, (end, image), start in zip(range(m, 0, -1), ends, starts, strict=True):
        yield leg, end, image, start


def _between(
    surfaces: Surfaces,
    beams: Beams,
    leg: int,
    end: Polygons,
    image: np.ndarray,
    start: Polygons,
    turn: float,
    *,
    receives: bool = False,
) -> tuple[np.ndarray, Polygons]:
    """What may lie in the way of a leg of the beams of each chain: numbers of chains (n,), and polygons, mirrored to
    where they shade the last facet. receives  the leg is that to a receiver."""
    if not len(beams):
        return np.zeros(0, np.int64), Polygons(np.zeros((0, 3, 3)), np.zeros(0, np.int64))
    center, radius = beams.bounds(end)
    toward = image[beams.first_of] - center
    length = np.maximum.reduceat(np.linalg.norm(end.center - start.center, axis=1), beams.first_of)
    length = length + radius + beams.bounds(start)[1]
    cones = Cones(center, unit(toward), radius, np.full(len(radius), np.tan(min(2 * turn, 1.5))), length)
    facets = beams.chains[:, leg - 1 : leg] if leg == 1 or receives else beams.chains[:, leg - 2 : leg]

    def of(shading: Surfaces, chain: np.ndarray, occluder: np.ndarray) -> tuple[np.ndarray, Polygons]:
        rows = np.flatnonzero(_overlap(beams, end, cones, shading.corners, chain, occluder, surfaces.snap))
        chain, occluder = chain[rows], occluder[rows]
        sine = dot(shading.normals[occluder], unit(image[beams.first_of[chain]] - shading.centers[occluder]))
        rows = np.flatnonzero((sine > -2 * turn - EDGE_ON) | ~shading.closed[occluder])
        chain, shapes = chain[rows], shading.polygons[occluder[rows]]
        for number in range(leg, leg - facets.shape[1], -1):  # in front of the facets where the leg ends and begins
            normal, point = beams.normals[chain, number - 1], surfaces.centers[beams.chains[chain, number - 1]]
            height = shapes.heights(normal, point, surfaces.on_plane)
            rows = np.flatnonzero(height.max(axis=1, initial=-np.inf) > 0)
            chain, shapes = chain[rows], shapes[rows].clipped(height[rows])
        for number in range(leg, beams.order):
            normal, point = beams.normals[chain, number - 1], surfaces.centers[beams.chains[chain, number - 1]]
            shapes = Polygons(mirrored(shapes.corners, normal, point), shapes.count)
        return chain, shapes

    chain, occluder = surfaces.tree.within(cones)
    is_between = (occluder[:, None] != facets[chain]).all(axis=1)
    chain, shapes = of(surfaces, chain[is_between], occluder[is_between])
    ground = surfaces.ground
    if ground is None:
        return chain, shapes
    ends = [end] if ground.overlooked and facets.shape[1] == 1 else [end, start]
    rows = np.flatnonzero(ground.may_shade(np.concatenate([beams.boxes(part) for part in ends], axis=1)))
    if not len(rows):
        return chain, shapes
    which, occluder = ground.surfaces.tree.within(cones.part(rows))
    shaded, others = of(ground.surfaces, rows[which], occluder)
    return np.concatenate([chain, shaded]), joined([shapes, others])


def _overlap(
    beams: Beams, end: Polygons, cones: Cones, corners: np.ndarray, chain: np.ndarray, facet: np.ndarray, snap: float
) -> np.ndarray:
    """Whether facets (n,) with corners, m (k, 3, 3), may shade the polygons at the end of a leg of all beams of chains
    (n,), as seen along the axes of cones about these: their outlines are compared in a few directions across the axis.

    A line from a point p of a polygon to an antenna at a goes through (1 - s) p + s a, 0 < s < 1, which is no farther
    from the axis than p, but for the angle between the axis and the way to a.
    """
    first = np.eye(3)[np.abs(cones.axis).argmin(axis=1)]
    x = unit(cross(cones.axis, first))
    y = cross(cones.axis, x)
    angle = np.arange(DIRECTIONS) * np.pi / DIRECTIONS
    frame = np.concatenate(
        [np.cos(angle)[:, None] * x[:, None] + np.sin(angle)[:, None] * y[:, None], cones.axis[:, None]], axis=1
    )

    def extent(places: np.ndarray, of: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        along = np.matmul(frame[of], (places - cones.center[of, None]).swapaxes(1, 2))
        return folded(np.minimum, along), folded(np.maximum, along)

    low, high = extent(end.corners, beams.chain)
    low = np.minimum(np.minimum.reduceat(low, beams.first_of), 0.0)
    high = np.maximum(np.maximum.reduceat(high, beams.first_of), 0.0)
    out = np.zeros(len(chain), bool)
    for begin in range(0, len(chain), PAIRS_AT_ONCE):
        rows = slice(begin, begin + PAIRS_AT_ONCE)
        of = chain[rows]
        least, most = extent(corners[facet[rows]], of)
        slack = cones.widening[of] * np.maximum(most[:, -1] + cones.radius[of], 0) + snap
        is_apart = (least > high[of] + slack[:, None]) | (most < low[of] - slack[:, None])
        out[rows] = ~folded(np.logical_or, is_apart[:, :-1])
    return out
