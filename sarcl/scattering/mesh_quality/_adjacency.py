"""Which facets share edges, and the fewest triangles that make up the same surface."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...base import boxes
from ...base.vectors import cross, dot
from ...scene.triangles import areas, solid

SAME_PLACE = 1e-8  # of a mesh's size: corners closer than this are the same
PLANE = 1e-12  # 1 - cosine of the largest tilt between two facets of one plane, 1.4e-6 rad
GAIN = 0.7  # of the corners: where more of them must stay, all facets stay as they are


@dataclass(frozen=True, eq=False)
class MeshAdjacency:
    """Facets (k,) that meet at edges; an edge is numbered 3 facet + i, from corner i to i + 1.

    corner      (k, 3): a number that corners in the same place share, below `places`
    one, other  (n,): edges that exactly two facets share, as the one's and as the other's
    against     (n,): both pass it in the same direction, wound against each other
    tilt        (n,): cosine between their normals, as if they were wound alike
    normal      unit (k, 3), 0 without area;  twice  twice the area, m^2 (k,)
    """

    corner: np.ndarray
    places: int
    one: np.ndarray
    other: np.ndarray
    against: np.ndarray
    tilt: np.ndarray
    normal: np.ndarray
    twice: np.ndarray


def adjacency_of(triangles: np.ndarray) -> MeshAdjacency:
    """Adjacency of triangles, m (k, 3, 3). Edges of one facet alone, or of more than two, join none."""
    corner, places = _welded(triangles)
    normal = cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    twice = np.sqrt(dot(normal, normal))
    normal /= np.where(twice > 0, twice, 1)[:, None]
    start, end = corner.ravel(), np.roll(corner, -1, axis=1).ravel()
    key = np.minimum(start, end) * np.int64(places) + np.maximum(start, end)
    order = np.argsort(key)
    key = key[order]
    first = np.flatnonzero(np.concatenate([[True], key[1:] != key[:-1]]))
    first = first[np.diff(first, append=len(key)) == 2]
    one, other = order[first], order[first + 1]
    against = start[one] == start[other]
    tilt = dot(np.take(normal, one // 3, axis=0), np.take(normal, other // 3, axis=0))
    tilt[against] *= -1
    return MeshAdjacency(corner, places, one, other, against, tilt, normal, twice)


def components(n: int, a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """The number of the component each of n nodes is in (n,), a and b linked; numbered in the order of the nodes.

    Links join the roots of trees, the larger number to the smaller; then every node goes to its root.
    """
    root = np.arange(n)
    while len(a):
        low = np.minimum(root[a], root[b])
        for ends in (a, b):
            np.minimum.at(root, root[ends], low)
        while not np.array_equal(nearer := root[root], root):
            root = nearer
        apart = root[a] != root[b]
        a, b = a[apart], b[apart]
    return np.asarray(np.unique(root, return_inverse=True)[1])


def uncut(triangles: np.ndarray, j: MeshAdjacency, kind: np.ndarray) -> tuple[np.ndarray, np.ndarray] | None:
    """The same surface with flat parts in as few triangles as their outlines need, and for each of these one of the
    facets that it replaces (n,).

    j     of the triangles, m (k, 3, 3);  kind  (k,): facets of different kinds stay apart
    Corners inside a plane, or on the straight line two planes meet in, go; outlines that are not convex stay as they
    are. None where little is to be gained.
    """
    flat = (j.tilt > 1 - PLANE) & ~j.against & (kind[j.one // 3] == kind[j.other // 3])
    start, end = j.corner.ravel(), np.roll(j.corner, -1, axis=1).ravel()
    bent = np.bincount(np.concatenate([a[j.one[~flat]] for a in (start, end)]), minlength=j.places)
    keep = (bent != 0) & (bent != 2)
    alone = np.ones(len(start), bool)
    alone[j.one] = alone[j.other] = False
    keep[start[alone]] = keep[end[alone]] = True
    if keep.mean() > GAIN:
        return None
    k = len(triangles)
    plane = components(k, j.one[flat] // 3, j.other[flat] // 3)
    n = int(plane.max()) + 1
    key = np.unique((plane[:, None] * np.int64(j.places) + j.corner)[keep[j.corner]])
    its, place = key // j.places, key % j.places
    where = np.empty((j.places, 3))
    where[j.corner.ravel()] = triangles.reshape(-1, 3)
    stands = np.empty(n, np.int64)
    stands[plane[::-1]] = np.arange(k)[::-1]  # the first facet of each plane
    normal, points = j.normal[stands[its]], where[place]
    count = np.bincount(its, minlength=n)
    middle = np.stack([np.bincount(its, p, n) for p in points.T], axis=1) / np.maximum(count, 1)[:, None]
    across = triangles[stands, 1] - triangles[stands, 0]
    away = points - middle[its]
    turned = dot(away, cross(normal, across[its]))
    order = np.lexsort((np.arctan2(turned, dot(away, across[its])), its))
    points, its = points[order], its[order]
    first = np.cumsum(count) - count
    fan = np.flatnonzero((its[1:-1] == its[2:]) & (its[:-2] == its[2:])) + 1 if len(its) > 2 else np.zeros(0, np.int64)
    fan_triangles = np.stack([points[first[its[fan]]], points[fan], points[fan + 1]], axis=1)
    before, after = np.bincount(plane, j.twice, n), np.bincount(its[fan], 2 * areas(fan_triangles), n)
    good = np.abs(after - before) <= 1e-6 * before
    whole = good[its[fan]] & solid(fan_triangles)
    rest = np.flatnonzero(~good[plane])
    return np.concatenate([fan_triangles[whole], triangles[rest]]), np.concatenate([stands[its[fan]][whole], rest])


def _welded(triangles: np.ndarray) -> tuple[np.ndarray, int]:
    """A number for each corner that corners in the same place share (k, 3), and how many there are."""
    points = triangles.reshape(-1, 3)
    low, high = boxes.box(points)
    size = float((high - low).max()) or 1.0
    key = np.zeros(len(points), np.uint64)  # a hash: three places would not fit
    for axis, odd in enumerate((0x9E3779B97F4A7C15, 0xC2B2AE3D27D4EB4F, 0x165667B19E3779F9)):
        key ^= np.rint((points[:, axis] - low[axis]) / (SAME_PLACE * size)).astype(np.uint64) * np.uint64(odd)
    order = np.argsort(key)
    ordered = key[order]
    number = np.empty(len(key), np.int64)
    number[order] = np.cumsum(np.concatenate([[False], ordered[1:] != ordered[:-1]]))
    return number.reshape(-1, 3), int(number.max(initial=-1)) + 1
