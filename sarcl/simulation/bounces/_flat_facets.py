"""Fewer facets for the same waves: flat parts of a mesh, and bodies of which only the lit side shades.

A beam is what a convex facet lights of the next one: triangles that tile a convex polygon reflect the field of one
facet. A part that is convex as it is becomes one polygon, others grow over shared edges while they stay convex.
"""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import ConvexHull

from ...base.vectors import cross, distinct, dot, unit
from ...scattering.physical_optics import normals_and_areas
from ._polygons import Polygons, folded, joined

FLAT = 1e-9  # of the diagonal: corners nearer to a plane or a line lie in it, whatever the distance given
ROUNDING, KEPT = 1e-9, 1e-4  # relative, of areas: as they are computed, and by which they may change
LONGEST = 1 / 8  # of the diagonal: longer polygons are halved, since the shadows of many others cut them into parts
FEW = 32  # polygons that are not halved
MOST_CORNERS = 6  # of a polygon: all are stored with as many corners as the largest one


def joined_facets(
    triangles: np.ndarray, groups: np.ndarray, diagonal: float, distance: float = 0.0
) -> tuple[Polygons, np.ndarray]:
    """Triangles, m (k, 3, 3), joined to convex polygons; and the first triangle of each (n,), rising.

    groups    (k,) int: triangles of different groups are not joined
    distance  m, of a corner from the plane and the outline of what it is joined to, at most
    """
    flat = max(FLAT * diagonal, distance)
    edge, back = _flat_edges(triangles, groups, flat)
    size = len(triangles)
    links = coo_array((np.ones(len(edge), bool), (edge // 3, back // 3)), shape=(size, size))
    part = connected_components(links, directed=False)[1]
    corners: dict[int, np.ndarray] = {}  # of the polygon whose first triangle this is
    is_joined = np.zeros(size, bool)
    order = np.argsort(part, kind="stable")
    for members in np.split(order, np.flatnonzero(np.diff(part[order])) + 1):
        if len(members) > 2 and (outline := _outline(triangles[members], flat)) is not None:
            corners[int(members[0])], is_joined[members] = outline, True
    rest = ~is_joined[edge // 3]
    corners |= _grown(triangles, is_joined, edge[rest], back[rest], flat)
    first = np.array(sorted(corners), np.int64)
    count = np.array([len(corners[f]) for f in first.tolist()], np.int64)
    size = max(3, int(count.max(initial=3)))
    padded = [corners[f][np.where(np.arange(size) < len(corners[f]), np.arange(size), 0)] for f in first.tolist()]
    return Polygons(np.reshape(padded, (-1, size, 3)), count), first


def _flat_edges(triangles: np.ndarray, groups: np.ndarray, flat: float) -> tuple[np.ndarray, np.ndarray]:
    """Edges between triangles of one group and plane, each once, (n,), (n,) as of `_shared_edges`: the longest first,
    since halves of rectangles meet there, and those of one direction together, which makes rows of a grid."""
    edge, back = _shared_edges(triangles)
    is_first = edge < back
    edge, back = edge[is_first], back[is_first]
    own, other = edge // 3, back // 3
    normal = normals_and_areas(triangles)[0]
    across = triangles[other, (back + 2) % 3] - triangles[own, (edge + 2) % 3]
    is_flat = (np.abs(dot(across, normal[own])) <= flat) & (groups[own] == groups[other])
    edge, back = (numbers[is_flat & (dot(normal[own], normal[other]) > 0)] for numbers in (edge, back))
    along = triangles[edge // 3, (edge + 1) % 3] - triangles[edge // 3, edge % 3]
    length = np.linalg.norm(along, axis=1)
    direction = along / length[:, None]
    lead = np.take_along_axis(direction, np.abs(direction).round(6).argmax(axis=1)[:, None], axis=1)
    keys = *(direction * np.sign(lead)).round(6).T, -(length / max(length.max(initial=0.0), 1e-300)).round(6)
    order = np.lexsort(keys)
    return edge[order], back[order]


def _outline(triangles: np.ndarray, flat: float) -> np.ndarray | None:
    """Corners of the convex polygon that triangles of one plane, m (k, 3, 3), fill, m (n, 3); None where they fill
    none of few corners, to the distance `flat`, m."""
    area = normals_and_areas(triangles)[1]
    places = triangles.reshape(-1, 3)
    x, y, normal = _frame(triangles)
    height = (places - places[0]) @ normal
    if np.ptp(height) > 2 * flat:
        return None
    plane = (places - places[0]) @ np.stack([x, y], axis=1)
    hull = ConvexHull(plane)
    corners = hull.vertices  # counterclockwise
    while len(corners) > 3:
        away = _turns(plane[corners])
        least = int(away.argmin())
        if away[least] > flat:
            break
        corners = np.delete(corners, least)
    if len(corners) > MOST_CORNERS or not _fills(plane[corners], float(area.sum()), flat):
        return None
    if np.ptp(height) <= ROUNDING * np.ptp(plane, axis=0).max():
        return np.asarray(places[corners])
    middle = (height.max() + height.min()) / 2
    return np.asarray(places[corners] - (height[corners] - middle)[:, None] * normal)


def _frame(triangles: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Two unit vectors across the mean normal of triangles, m (k, 3, 3), and this, right-handed."""
    spokes = triangles[:, 1:] - triangles[:, :1]
    normal = unit(cross(spokes[:, 0], spokes[:, 1]).sum(axis=0))
    along = spokes[0, 0]
    x = unit(along - (along @ normal) * normal)
    return x, cross(normal, x), normal


def _turns(ring: np.ndarray) -> np.ndarray:
    """Distances, m (n,), of corners of a polygon, m (n, 2), from the line between their neighbours."""
    before, after = np.roll(ring, 1, axis=0), np.roll(ring, -1, axis=0)
    along, away = after - before, ring - before
    size = np.maximum(np.hypot(*along.T), 1e-300)
    return np.asarray(np.abs(along[:, 0] * away[:, 1] - along[:, 1] * away[:, 0]) / size)


def _fills(ring: np.ndarray, area: float, flat: float) -> bool:
    """Whether the polygon with corners m (n, 2) has an area, m^2, as far as its outline is known to `flat`, m."""
    after = np.roll(ring, -1, axis=0)
    own = float((ring[:, 0] * after[:, 1] - ring[:, 1] * after[:, 0]).sum()) / 2
    length = float(np.hypot(*(after - ring).T).sum())
    return abs(own - area) <= max(ROUNDING * area, min(flat * length, KEPT * area))


def _grown(
    triangles: np.ndarray, is_joined: np.ndarray, edges: np.ndarray, backs: np.ndarray, flat: float
) -> dict[int, np.ndarray]:
    """Corners of convex polygons that other triangles, m (k, 3, 3), are joined to over edges in this order, m (n, 3),
    by their first triangle."""
    places, corner = np.unique(triangles.reshape(-1, 3), axis=0, return_inverse=True)
    number = corner.reshape(-1, 3).tolist()
    normal, area = normals_and_areas(triangles)
    rings = {k: number[k] for k in np.flatnonzero(~is_joined).tolist()}  # with corners at which they do not turn
    turning = {k: set(ring) for k, ring in rings.items()}
    root = list(range(len(triangles)))
    members = {k: [k] for k in rings}

    def root_of(k: int) -> int:
        while root[k] != k:
            root[k] = root[root[k]]
            k = root[k]
        return k

    def turn(before: int, at: int, after: int, k: int) -> float:
        """Distance, m, by which a polygon turns left at a corner; negative: right."""
        a, b = places[at] - places[before], places[after] - places[at]
        size = float(np.sqrt(max(a @ a, b @ b)))
        return float(normal[k] @ np.cross(a, b)) / size

    def fits(parts: list[int], ring: list[int]) -> bool:
        """Whether all corners of triangles lie in one plane, and the polygon of a ring has their area."""
        x, y, n = _frame(triangles[parts])
        height = (triangles[parts].reshape(-1, 3) - places[ring[0]]) @ n
        plane = (places[ring] - places[ring[0]]) @ np.stack([x, y], axis=1)
        return bool(np.ptp(height) <= 2 * flat) and _fills(plane, float(area[parts].sum()), flat)

    pairs, is_growing = list(zip(edges.tolist(), backs.tolist(), strict=True)), True
    while is_growing:
        is_growing, open_pairs = False, []
        for edge, back in pairs:
            own, other = root_of(edge // 3), root_of(back // 3)
            if own == other:
                continue
            open_pairs.append((edge, back))
            begin, end = number[edge // 3][edge % 3], number[edge // 3][(edge + 1) % 3]
            a, b = _from(rings[own], end), _from(rings[other], begin)  # from end to begin, and back
            if a[-1] != begin or b[-1] != end:
                continue
            path = {begin, end}
            while len(a) > 2 and len(b) > 2 and a[1] == b[-2]:
                a, b = a[1:], b[:-1]
                path.add(a[0])
            while len(a) > 2 and len(b) > 2 and a[-2] == b[1]:
                a, b = a[:-1], b[1:]
                path.add(b[0])
            turns = turn(a[-2], a[-1], b[1], own), turn(b[-2], b[-1], a[1], own)
            corners = (turning[own] | turning[other]) - path
            corners |= {at for at, by in zip((a[-1], b[-1]), turns, strict=True) if by > flat}
            if min(turns) < -flat or len(corners) > MOST_CORNERS:
                continue
            if not fits(members[own] + members[other], [at for at in a[:-1] + b[:-1] if at in corners]):
                continue
            first, second = min(own, other), max(own, other)
            members[first] += members.pop(second)
            root[second], rings[first], turning[first] = first, a[:-1] + b[:-1], corners
            del rings[second], turning[second]
            is_growing = True
        pairs = open_pairs
    return {k: places[[at for at in ring if at in turning[k]]] for k, ring in rings.items()}


def tiles(polygons: Polygons, first: np.ndarray, diagonal: float) -> tuple[Polygons, np.ndarray]:
    """Polygons of many, halved until none is long; and `first` of each (n,)."""
    if len(polygons) <= FEW:
        return polygons, first
    parts: list[Polygons] = []
    numbers: list[np.ndarray] = []
    while len(polygons):
        corners = polygons.corners.swapaxes(1, 2)
        extent = folded(np.maximum, corners) - folded(np.minimum, corners)
        is_long = folded(np.maximum, extent) > LONGEST * diagonal
        if not is_long.any() and not parts:
            return polygons, first
        parts.append(polygons[~is_long])
        numbers.append(first[~is_long])
        polygons, first, axis = polygons[is_long], first[is_long], extent[is_long].argmax(axis=1)
        places = polygons.corners[np.arange(len(first)), :, axis]
        height = places - (places.max(axis=1) + places.min(axis=1))[:, None] / 2
        polygons, first = joined([polygons.clipped(height), polygons.clipped(-height)]), np.tile(first, 2)
    return joined(parts), np.concatenate(numbers)


def _from(ring: list[int], place: int) -> list[int]:
    start = ring.index(place)
    return ring[start:] + ring[:start]


def closed(triangles: np.ndarray) -> np.ndarray:
    """True (k,) for triangles, m (k, 3, 3), of bodies with a closed surface turned outwards: each edge is that of one
    other triangle, which runs through it the other way."""
    edge, back = _shared_edges(triangles)
    number, size = np.bincount(edge, minlength=3 * len(triangles)), len(triangles)
    links = coo_array((np.ones(len(edge), bool), (edge // 3, back // 3)), shape=(size, size))
    n_bodies, body = connected_components(links, directed=False)
    spokes = triangles - triangles.reshape(-1, 3).mean(axis=0)
    volume = np.bincount(body, dot(spokes[:, 0], cross(spokes[:, 1], spokes[:, 2])), n_bodies)
    n_open = np.bincount(body, (number.reshape(-1, 3) != 1).any(axis=1), n_bodies)
    return np.asarray(((n_open == 0) & (volume > 0))[body])


def _shared_edges(triangles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Edges 3 i + j, from corner j of triangle i to the next one, and those that run the other way between the same
    places (n,), (n,), where there is one of each."""
    places, corner = distinct(triangles.reshape(-1, 3))
    corner = corner.reshape(-1, 3)
    begin, end = corner.ravel(), np.roll(corner, -1, axis=1).ravel()
    code, back = begin * len(places) + end, end * len(places) + begin
    order = np.argsort(code, kind="stable")
    rising = code[order]
    first = np.searchsorted(rising, back)
    is_single = [np.searchsorted(rising, key, "right") == np.searchsorted(rising, key) + 1 for key in (code, back)]
    edge = np.flatnonzero(is_single[0] & is_single[1])
    return edge, order[first[edge]]
