"""Polygons of mesh files that fans about their first corners, which trimesh takes, do not cover."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

FLAT = 1e-9  # of a polygon's area: a triangle of a fan that is turned by less is a line
CONCAVE = "is concave or crosses itself, and its triangles are not in the file; export it as triangles"


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
