"""Occlusion of facet samples: every ray against every facet, every range line against every grid line."""

from __future__ import annotations

import numpy as np

from ..base.vectors import unit

CENTROID = np.array([[1 / 3, 1 / 3]])


def sample(triangles: np.ndarray, viewpoint: np.ndarray, places: np.ndarray, lift: float) -> np.ndarray:
    """Points (k, n, 3) at barycentric coordinates (n, 2) of facets, m (k, 3, 3), lifted by `lift`, m, along the normal,
    to the side that a viewpoint, m (3,), looks at."""
    a = triangles[:, 0]
    normal = _facing(triangles, viewpoint)[0]
    u, v = np.asarray(places).T[:, None, :, None]
    return (a + lift * normal)[:, None] + u * (triangles[:, 1] - a)[:, None] + v * (triangles[:, 2] - a)[:, None]


def _facing(triangles: np.ndarray, viewpoint: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Unit normals (k, 3) to the side that a viewpoint looks at, and the sine of its elevation over it."""
    a = triangles[:, 0]
    normal = unit(np.cross(triangles[:, 1] - a, triangles[:, 2] - a))
    above = np.einsum("ij,ij->i", normal, unit(viewpoint - a))
    side = np.where(above < 0, -1.0, 1.0)
    return normal * side[:, None], above * side


def hidden(
    triangles: np.ndarray, viewpoint: np.ndarray, places: np.ndarray = CENTROID, lift: float = 1e-6
) -> np.ndarray:
    """True (k, n) where a facet, m (k, 3, 3), crosses the line from a sample to `viewpoint`, m (3,); False where the
    viewpoint lies in the facet's plane.

    Source: Moeller and Trumbore 1997.
    """
    a = triangles[:, 0]
    b, c = triangles[:, 1] - a, triangles[:, 2] - a
    points = sample(triangles, viewpoint, places, lift)
    out = np.zeros(points.shape[:2], bool)
    for i in np.ndindex(out.shape):
        ray = viewpoint - points[i]
        p = np.cross(ray, c)
        det = np.einsum("ij,ij->i", b, p)
        with np.errstate(divide="ignore", invalid="ignore"):
            s = points[i] - a
            u = np.einsum("ij,ij->i", s, p) / det
            q = np.cross(s, b)
            v = (q @ ray) / det
            t = np.einsum("ij,ij->i", c, q) / det
            out[i] = ((u >= 0) & (v >= 0) & (u + v <= 1) & (t > 0) & (t <= 1)).any()
    return out & (_facing(triangles, viewpoint)[1] > 1e-6)[:, None]
