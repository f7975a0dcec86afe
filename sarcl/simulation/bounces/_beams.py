"""Beams that flat facets reflect: followed from facet to facet as convex polygons, less what lies in their way.

A flat facet reflects the wave of a transmitter T as the wave of its mirror image. After facets 1 ... m - 1 it comes
from T' = M_(m-1) ... M_1 T, and lights of facet m what lines from T' through the polygon on facet m - 1 meet. What lies
in the way of an earlier leg is mirrored too, so that all shadows on facet m fall from T' (docs/theory/bounces.md).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TypeVar

import numpy as np

from ...base.boxes import box
from ...base.constants import EDGE_ON
from ...base.vectors import dot, unit
from ...scene.terrain import Heights, is_overlooked, stand_above
from ._facet_tree import MOST_PAIRS, Cones, FacetTree
from ._polygons import Polygons, TooManyAtOnce, apart, folded, joined

ON_PLANE = 1e-6  # of the scene's diagonal: corners nearer to a plane lie in it, as for shadows (visibility/lit_parts)
SNAP = 1e-11  # of the diagonal: rounding of clipped corners
LEAST_AREA = 1e-10  # of a facet: smaller polygons are rounding
GRAZING = 1e-9  # sine of the angle between a facet and a ray, below which nothing is reflected
TURNED_AWAY = (
    2 * EDGE_ON
)  # sine below which a facet is turned away from a receiver: there physical optics has faded out
MOST_ANGLE = 1.55  # rad, of a cone: wider ones hold everything in front
MOST_LEGS = 5_000  # that are compared with the ground below them before its facets are looked at
ROWS_AT_ONCE = 200_000  # pairs of a beam and a facet that are looked at together
Value = TypeVar("Value")


@dataclass(frozen=True, eq=False)
class Ground:
    """A complete terrain that only casts shadows, and not on the legs that run above all of it.

    triangles  m (n, 3, 3), about `origin`, m (3,), and  heights  not about it
    overlooked  lines of sight from all antennas to the scene climb more steeply than it
    """

    triangles: np.ndarray
    heights: Heights
    origin: np.ndarray
    overlooked: bool = False

    @cached_property
    def surfaces(self) -> Surfaces:
        """Its facets."""
        flags = np.zeros((3, len(self.triangles)), bool)
        return Surfaces(Polygons.of(self.triangles), *flags)

    def may_shade(self, corners: np.ndarray) -> np.ndarray:
        """Whether it may shade legs between places, m (k, n, 3): (k,)."""
        if len(corners) > MOST_LEGS:
            return np.ones(len(corners), bool)
        return ~stand_above(self.heights, corners + self.origin)


@dataclass(frozen=True, eq=False)
class Surfaces:
    """Facets that reflect, convex and about the scene's centre; those not in `mirrors` only cast shadows.

    two_sided, mirrors  (k,) bool;  closed  (k,) bool: those of closed bodies, whose shadows are those of the facets
    that face the light;  most_pairs  of a beam and a facet that are looked at together;  ground  besides
    """

    polygons: Polygons
    two_sided: np.ndarray
    mirrors: np.ndarray
    closed: np.ndarray
    most_pairs: int = MOST_PAIRS
    ground: Ground | None = None

    @property
    def corners(self) -> np.ndarray:
        """Corners of the facets, some twice, m (k, n, 3)."""
        return self.polygons.corners

    @cached_property
    def normals(self) -> np.ndarray:
        """Unit normals (k, 3)."""
        return unit(self.polygons.twice_areas)

    @cached_property
    def areas(self) -> np.ndarray:
        """Areas, m^2 (k,)."""
        return self.polygons.area

    @cached_property
    def centers(self) -> np.ndarray:
        """Centroids, m (k, 3)."""
        return self.polygons.center

    @cached_property
    def diagonal(self) -> float:
        """Diagonal of the box of all facets, m."""
        parts = [self.corners] if self.ground is None else [self.corners, self.ground.triangles]
        low, high = box(np.concatenate([box(part.reshape(-1, 3)) for part in parts]))
        return float(np.linalg.norm(high - low))

    @cached_property
    def tree(self) -> FacetTree:
        """All facets by place."""
        return FacetTree(self.corners, self.most_pairs)

    @property
    def on_plane(self) -> float:
        """Height, m, up to which corners lie in a plane."""
        return ON_PLANE * self.diagonal

    @property
    def snap(self) -> float:
        """Rounding of corners, m."""
        return SNAP * self.diagonal

    def seen_from(self, antennas: np.ndarray) -> Surfaces:
        """These facets for antennas, m (n, 3): bodies that may hold one of them shade from within, as open ones do;
        others are dark within, whether their facets have two sides or one."""
        corners = self.corners[self.closed].reshape(-1, 3)
        low, high = corners.min(axis=0, initial=np.inf), corners.max(axis=0, initial=-np.inf)
        within, ground = ((antennas >= low) & (antennas <= high)).all(axis=1).any(), self.ground
        if ground is not None:
            bounds = box(self.corners.reshape(-1, 3)) + ground.origin
            ends = [antennas + ground.origin]
            ground = replace(ground, overlooked=is_overlooked(ground.heights, bounds, ends))
        if within:
            return replace(self, closed=np.zeros_like(self.closed), ground=ground)
        return replace(self, two_sided=self.two_sided & ~self.closed, ground=ground)

    def side(self, facets: np.ndarray, normal: np.ndarray) -> np.ndarray:
        """1 (n,) where facets (n,) reflect on the side of their own normal, else 0; normal  on that side (n, 3)."""
        return (dot(normal, self.normals[facets]) > 0).astype(np.int64)

    def facing(self, facets: np.ndarray, places: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Unit normals (n, 3) of facets (n,) on the sides of places, m (n, 3); and whether these sides reflect (n,)."""
        normal = self.normals[facets]
        sine = dot(normal, unit(places - self.centers[facets]))
        reflects = (np.abs(sine) > GRAZING) & ((sine > 0) | self.two_sided[facets]) & self.mirrors[facets]
        return normal * np.where(sine < 0, -1.0, 1.0)[:, None], reflects


@dataclass(frozen=True, eq=False)
class Beams:
    """Beams of one order: polygons on the last of m facets, at some pulses.

    chain   number of the sequence of facets that reflect (k,), rising;  pulse  number of the antenna positions (k,)
    chains  sequences of facets (c, m), and  normals  on the sides that reflect (c, m, 3)
    apex    the transmitter's image in all facets but the last, m (k, 3)
    """

    chain: np.ndarray
    pulse: np.ndarray
    chains: np.ndarray
    normals: np.ndarray
    apex: np.ndarray
    polygons: Polygons

    def __len__(self) -> int:
        return len(self.pulse)

    def __getitem__(self, rows: np.ndarray) -> Beams:
        """Beams `rows` (n,), in rising order."""
        old_chain, chain = np.unique(self.chain[rows], return_inverse=True)
        chains, normals = self.chains[old_chain], self.normals[old_chain]
        return Beams(chain, self.pulse[rows], chains, normals, self.apex[rows], self.polygons[rows])

    def of_chains(self, chains: slice) -> Beams:
        """The beams of consecutive chains."""
        ends = np.append(self.first_of, len(self))[[chains.start, chains.stop]]
        return self if ends[1] - ends[0] == len(self) else self[np.arange(*ends)]

    @property
    def order(self) -> int:
        """Number of facets m."""
        return int(self.chains.shape[1])

    @property
    def last(self) -> np.ndarray:
        """The last facet of each beam (k,)."""
        return self.chains[self.chain, -1]

    @cached_property
    def first_of(self) -> np.ndarray:
        """The first beam of each chain (c,)."""
        return np.searchsorted(self.chain, np.arange(len(self.chains)))

    def boxes(self, polygons: Polygons) -> np.ndarray:
        """Corners, the least and the greatest, m (c, 2, 3), of boxes about polygons (k) of all beams of each chain."""
        corners = polygons.corners.swapaxes(1, 2)
        low = np.minimum.reduceat(folded(np.minimum, corners), self.first_of)
        return np.stack([low, np.maximum.reduceat(folded(np.maximum, corners), self.first_of)], axis=1)

    def bounds(self, polygons: Polygons) -> tuple[np.ndarray, np.ndarray]:
        """Centres, m (c, 3), and radii, m (c,), of spheres about polygons (k) of all beams of each chain."""
        if not len(self):
            return np.zeros((0, 3)), np.zeros(0)
        low, high = self.boxes(polygons).swapaxes(0, 1)
        return (low + high) / 2, np.linalg.norm(high - low, axis=1) / 2

    def rows_of(self, chain: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Beams of each of the chains in a list (n,), one chain after the other, and places in that list."""
        number = np.diff(np.append(self.first_of, len(self)))[chain]
        place = np.repeat(np.arange(len(chain)), number)
        within = np.arange(len(place)) - np.repeat(np.cumsum(number) - number, number)
        return self.first_of[chain[place]] + within, place


def mirrored(places: np.ndarray, normal: np.ndarray, point: np.ndarray) -> np.ndarray:
    """Images of places, m (k, ..., 3), in planes through points, m (k, 3), with unit normals (k, 3)."""
    shape = len(normal), *(1,) * (places.ndim - 2), 3
    normal, point = normal.reshape(shape), point.reshape(shape)
    return np.asarray(places - 2 * ((places - point) * normal).sum(axis=-1, keepdims=True) * normal)


def first_facets(surfaces: Surfaces, tx: np.ndarray, turn: float) -> tuple[np.ndarray, int]:
    """Facets from which waves of transmitters, m (n, 3), may reach others, and in how many ways.

    turn  rad: directions from a facet to two of the transmitters, or receivers, differ by no more
    """
    facets, middle = np.flatnonzero(surfaces.mirrors), tx[len(tx) // 2]
    sine = dot(surfaces.normals[facets], unit(middle - surfaces.centers[facets]))
    facets = facets[(sine > -turn) | surfaces.two_sided[facets]]

    def reached_from(block: slice) -> tuple[np.ndarray, int]:
        members = facets[block]
        image = mirrored(
            np.repeat(middle[None], len(members), axis=0), surfaces.normals[members], surfaces.centers[members]
        )
        which = _reached(surfaces, members, *surfaces.polygons[members].spheres, image, turn)[0]
        return members[np.unique(which)], len(which)

    parts = list(halved(len(facets), reached_from))
    return np.concatenate([part for part, _ in parts]), sum(number for _, number in parts)


def halved(number: int, function: Callable[[slice], Value]) -> Iterator[Value]:
    """Values of a function for all of `number` places, for a half of these where there are too many pairs at once."""
    blocks = [slice(0, number)]
    while blocks:
        block = blocks.pop()
        try:
            value = function(block)
        except TooManyAtOnce:
            middle = (block.start + block.stop) // 2
            if middle == block.start:
                raise
            blocks += [slice(middle, block.stop), slice(block.start, middle)]
        else:
            yield value


def first(surfaces: Surfaces, tx: np.ndarray, facets: np.ndarray) -> Beams:
    """Beams from transmitters, m (n, 3), to whole facets, of those that they see from a side that reflects."""
    facet, pulse = np.repeat(facets, len(tx)), np.tile(np.arange(len(tx)), len(facets))
    normal, reflects = surfaces.facing(facet, tx[pulse])
    side = dot(normal, surfaces.normals[facet]) > 0
    rows = np.flatnonzero(reflects)
    facet, pulse, normal = facet[rows], pulse[rows], normal[rows]
    none = np.zeros((len(rows), 0), np.int64), np.zeros((len(rows), 0, 3))
    return _sorted(2 * facet + side[rows], *none, pulse, facet, normal, tx[pulse], surfaces.polygons[facet])


def reached(surfaces: Surfaces, beams: Beams, turn: float) -> tuple[np.ndarray, np.ndarray]:
    """Pairs (p,), (p,) of a chain of beams and a facet that these may reach next; turn  as of `first_facets`."""
    last, normal = beams.chains[:, -1], beams.normals[:, -1]
    image = mirrored(beams.apex[beams.first_of], normal, surfaces.centers[last])
    chain, facet = _reached(surfaces, last, *beams.bounds(beams.polygons), image, 2 * turn)
    height = dot3(surfaces.corners[facet] - surfaces.centers[last[chain], None], normal[chain])
    is_in_front = height.max(axis=1, initial=-np.inf) > surfaces.on_plane
    return chain[is_in_front], facet[is_in_front]


def _reached(
    surfaces: Surfaces, last: np.ndarray, center: np.ndarray, radius: np.ndarray, image: np.ndarray, turn: float
) -> tuple[np.ndarray, np.ndarray]:
    """Pairs of a sphere on facet `last` (c,) and a facet in the cone from an image, m (c, 3), that may face it."""
    which, facet = surfaces.tree.within(_cones(center, radius, image, turn))
    is_mirror = (facet != last[which]) & surfaces.mirrors[facet]
    which, facet = which[is_mirror], facet[is_mirror]
    may_face = np.ones(len(which), bool)
    for own, other in ((last[which], facet), (facet, last[which])):  # a corner of one is in front of the other
        height = dot3(surfaces.corners[other] - surfaces.centers[own, None], surfaces.normals[own])
        height = np.where(surfaces.two_sided[own, None], np.abs(height), height)
        may_face &= folded(np.maximum, height) > surfaces.on_plane
    return which[may_face], facet[may_face]


def dot3(corners: np.ndarray, axis: np.ndarray) -> np.ndarray:
    """Products (k, n) of corners (k, n, 3) with one vector each (k, 3)."""
    return np.asarray(np.matmul(corners, axis[:, :, None])[..., 0])


def extended(
    surfaces: Surfaces,
    beams: Beams,
    chain: np.ndarray,
    facet: np.ndarray,
    rx: np.ndarray | None = None,
    sides: np.ndarray | None = None,
) -> tuple[Beams, int]:
    """The beams after one facet more, without shadows, for pairs (p,) of a chain and a facet; and how many pairs of a
    beam and a facet were looked at. rx  receivers, m (n_pulses, 3): only beams on facets that face them
    sides  (k, 2): only beams on these sides of facets, behind and in front
    """
    image = mirrored(beams.apex, beams.normals[beams.chain, -1], surfaces.centers[beams.last])
    planes = beams.polygons.edge_planes(image)
    n_pairs, parts = 0, []
    number = np.diff(np.append(beams.first_of, len(beams)))[chain]
    for pairs in in_blocks(number):
        row, place = beams.rows_of(chain[pairs])
        place += pairs.start
        n_pairs += len(row)
        target = facet[place]
        normal, reflects = surfaces.facing(target, image[row])
        if rx is not None:
            reflects &= faces(surfaces, target, normal, rx[beams.pulse[row]])
        if sides is not None:
            reflects &= sides[target, surfaces.side(target, normal)]
        reflects &= ~apart(surfaces.corners[target], planes[row], beams.polygons.corners[row])
        rows = np.flatnonzero(reflects)
        row, place, target, normal = row[rows], place[rows], target[rows], normal[rows]
        polygons, last = surfaces.polygons[target], beams.last[row]
        side = beams.normals[beams.chain[row], -1]
        polygons = polygons.clipped(polygons.heights(side, surfaces.centers[last], surfaces.on_plane))
        polygons = polygons.seen_through(planes[row], beams.polygons.corners[row], surfaces.snap)
        rows = np.flatnonzero(polygons.area > LEAST_AREA * surfaces.areas[target])
        key = 2 * place[rows] + (dot(normal[rows], surfaces.normals[target[rows]]) > 0)
        parts.append((key, row[rows], target[rows], normal[rows], polygons[rows]))
    if not parts:
        return beams[np.zeros(0, np.int64)], n_pairs
    key, row, target, normal = (np.concatenate([part[i] for part in parts]) for i in range(4))
    old = beams.chain[row]
    polygons = joined([part[4] for part in parts])
    return _sorted(
        key, beams.chains[old], beams.normals[old], beams.pulse[row], target, normal, image[row], polygons
    ), n_pairs


def faces(surfaces: Surfaces, facets: np.ndarray, normal: np.ndarray, rx: np.ndarray) -> np.ndarray:
    """Whether receivers, m (n, 3), may see facets (n,) on the sides of normals (n, 3), edge-on too."""
    return np.asarray(dot(normal, unit(rx - surfaces.centers[facets])) > -TURNED_AWAY)


def in_blocks(number: np.ndarray, most: int = ROWS_AT_ONCE) -> list[slice]:
    """Slices of a list whose entries take `number` rows each (n,), of about `most` rows."""
    if not len(number):
        return []
    block = (np.cumsum(number) - number) // most
    starts = np.flatnonzero(np.append(True, block[1:] != block[:-1])).tolist()
    return [slice(*ends) for ends in zip(starts, [*starts[1:], len(number)], strict=True)]


def _sorted(
    key: np.ndarray,
    chains: np.ndarray,
    normals: np.ndarray,
    pulse: np.ndarray,
    facet: np.ndarray,
    normal: np.ndarray,
    apex: np.ndarray,
    polygons: Polygons,
) -> Beams:
    """Beams with one facet more than `chains` (k, m), in the order of keys (k,), one for each new chain."""
    order = np.argsort(key, kind="stable")
    _, begin, chain = np.unique(key[order], return_index=True, return_inverse=True)
    one = order[begin]
    return Beams(
        chain,
        pulse[order],
        np.concatenate([chains[one], facet[one, None]], axis=1),
        np.concatenate([normals[one], normal[one, None]], axis=1),
        apex[order],
        polygons[order],
    )


def _cones(center: np.ndarray, radius: np.ndarray, image: np.ndarray, turn: float) -> Cones:
    """Cones that hold all lines through spheres from images, m (c, 3), that turn by up to `turn`, rad, beyond these."""
    away = center - image
    distance = np.linalg.norm(away, axis=1)
    sine = np.minimum(radius / distance, 1 - 1e-9)
    widening = np.tan(np.minimum(np.arcsin(sine) + turn, MOST_ANGLE))
    first = np.maximum(radius, distance * np.tan(np.minimum(np.arcsin(sine), MOST_ANGLE)))
    return Cones(center, away / distance[:, None], first, widening, np.full(len(radius), np.inf))
