"""Polygons of mesh files as triangles: trimesh takes fans about the first corner, which leave concave polygons."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

FLAT = 1e-9  # of a polygon's area: a triangle of a fan that is turned by less is a line
MOST_CORNERS = (
    500  # of a concave polygon: the search for its triangles takes a time of the cube of their number at most
)


def fans_fit(corners: np.ndarray) -> np.ndarray:
    """Whether fans about the first corner cover polygons of k corners, (n, k, 3): bool (n,).

    Each triangle of a fan must turn as the polygon does, by Newell's normal: half the sum of p_i x p_(i+1).
    """
    from_first = corners[:, 1:] - corners[:, :1]
    crosses = np.cross(from_first[:, :-1], from_first[:, 1:])  # (n, k - 2, 3): twice the area of each triangle
    normal = crosses.sum(axis=1)
    along = np.einsum("nij,nj->ni", crosses, normal)
    return np.asarray((along >= -FLAT * (normal**2).sum(axis=1, keepdims=True)).all(axis=1))


def wrong_fans(polygons: Sequence[Sequence[int]], vertices: np.ndarray) -> list[int]:
    """Numbers of the polygons, lists of indices into vertices (n, 3), that a fan about their first corner leaves.

    Polygons that name vertices that there are not, or that are not finite, are left to others.
    """
    by_length: dict[int, list[int]] = {}
    for at, polygon in enumerate(polygons):
        if len(polygon) > 3:
            by_length.setdefault(len(polygon), []).append(at)
    found: list[int] = []
    for numbers in by_length.values():
        index = np.array([polygons[at] for at in numbers], np.int64)
        there = np.asarray(((index >= 0) & (index < len(vertices))).all(axis=1))
        with np.errstate(all="ignore"):
            fits = fans_fit(vertices[np.where(there[:, None], index, 0)])
            there &= np.isfinite(vertices[np.where(there[:, None], index, 0)]).all(axis=(1, 2))
        found += np.array(numbers)[there & ~fits].tolist()
    return sorted(found)


def triangles_of(corners: np.ndarray) -> list[tuple[int, int, int]] | None:
    """Triangles of a simple polygon, (k, 3), by cutting off ears (Meisters 1975), as indices of its corners.

    None where there is no ear: the polygon crosses itself, or has more than MOST_CORNERS.
    """
    if len(corners) > MOST_CORNERS:
        return None
    from_first = corners - corners[0]
    normal = np.cross(from_first[:-1], from_first[1:]).sum(axis=0)
    across = int(np.argmax(np.abs(normal)))
    x, y = (from_first[:, (across + step) % 3] for step in (1, 2))
    if normal[across] < 0:
        x, y = y, x
    flat = np.stack([x, y], axis=1)
    least = FLAT * float(np.abs(normal[across]))
    left, made = list(range(len(corners))), []
    at = misses = 0
    while len(left) > 3:
        a, b, c = (left[(at + step) % len(left)] for step in (-1, 0, 1))
        turn = _turn(flat[a], flat[b], flat[c])
        # corners on a straight line are no ears until nothing else is left
        ear = abs(turn) <= least if misses >= len(left) else turn > least
        if ear and (misses >= len(left) or not _holds(flat[[a, b, c]], flat[left])):
            made.append((a, b, c))
            del left[at % len(left)]
            at, misses = at - 1, 0
        elif misses >= 2 * len(left):
            return None
        else:
            at, misses = at + 1, misses + 1
    if _turn(*flat[left]) < -least:
        return None
    return [*made, (left[0], left[1], left[2])]


def _turn(a: np.ndarray, b: np.ndarray, c: np.ndarray) -> float:
    """Twice the area of a triangle in the plane, positive where it turns left."""
    return float((b[0] - a[0]) * (c[1] - b[1]) - (b[1] - a[1]) * (c[0] - b[0]))


def _holds(triangle: np.ndarray, points: np.ndarray) -> bool:
    """Whether one of the points (n, 2) lies in a triangle (3, 2) or on its edges, its corners left out."""
    points = points[~(points[:, None] == triangle).all(axis=2).any(axis=1)]
    a, b = triangle, np.roll(triangle, -1, axis=0)
    side = (b[:, 0] - a[:, 0]) * (points[:, 1, None] - a[:, 1]) - (b[:, 1] - a[:, 1]) * (points[:, 0, None] - a[:, 0])
    return bool((side >= 0).all(axis=1).any())
