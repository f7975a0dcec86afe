"""Occlusion of facet samples: every ray against every facet, every range line against every grid line."""

from __future__ import annotations

import numpy as np

from ..base.vectors import unit

CENTROID = np.array([[1 / 3, 1 / 3]])


def sample(
    triangles: np.ndarray, viewpoint: np.ndarray, places: np.ndarray, lift: float, other: np.ndarray | None = None
) -> np.ndarray:
    """Points (k, n, 3) at barycentric coordinates (n, 2) of facets, m (k, 3, 3), lifted by `lift`, m, along the normal,
    to the side that a viewpoint and the `other`, m (3,), look at.
    """
    a = triangles[:, 0]
    normal = _facing(triangles, viewpoint, other)[0]
    u, v = np.asarray(places).T[:, None, :, None]
    return (a + lift * normal)[:, None] + u * (triangles[:, 1] - a)[:, None] + v * (triangles[:, 2] - a)[:, None]


def _facing(triangles: np.ndarray, viewpoint: np.ndarray, other: np.ndarray | None) -> tuple[np.ndarray, np.ndarray]:
    """Unit normals (k, 3) to the side that two viewpoints look at, and the first one's sine of elevation over it."""
    a = triangles[:, 0]
    normal = unit(np.cross(triangles[:, 1] - a, triangles[:, 2] - a))
    ends = (viewpoint, viewpoint if other is None else other)
    above, two = (np.einsum("ij,ij->i", normal, unit(end - a)) for end in ends)
    side = np.where(above + two < 0, -1.0, 1.0)
    return normal * side[:, None], above * side


def hidden(
    triangles: np.ndarray, viewpoint: np.ndarray, places: np.ndarray = CENTROID, lift: float = 1e-6,
    other: np.ndarray | None = None,
) -> np.ndarray:  # fmt: skip
    """True (k, n) where a facet, m (k, 3, 3), crosses the line from a sample to `viewpoint`, m (3,); other: see sample.
    False where the viewpoint is behind the side that both look at.

    Source: Moeller and Trumbore 1997.
    """
    a = triangles[:, 0]
    b, c = triangles[:, 1] - a, triangles[:, 2] - a
    points = sample(triangles, viewpoint, places, lift, other)
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
    return out & (_facing(triangles, viewpoint, other)[1] > 1e-6)[:, None]


def overshadowed(
    grid: tuple[np.ndarray, np.ndarray, np.ndarray], points: np.ndarray, viewpoint: np.ndarray
) -> np.ndarray:
    """True (n,) where a terrain, (x, y, z), m, rises above the line from points, m (n, 3), to `viewpoint`, m (3,).

    Looked at wherever the line crosses an edge of the terrain's triangles.
    """
    x, y, z = grid
    out = np.zeros(len(points), bool)
    for i, point in enumerate(points):
        way = viewpoint - point
        with np.errstate(divide="ignore", invalid="ignore"):
            t = np.concatenate([(x - point[0]) / way[0], (y - point[1]) / way[1], [0.0, 1.0]])
        t = np.sort(t[(t >= 0) & (t <= 1)])
        middle = point + ((t[1:] + t[:-1]) / 2)[:, None] * way
        inside = (middle[:, 0] > x[0]) & (middle[:, 0] < x[-1]) & (middle[:, 1] > y[0]) & (middle[:, 1] < y[-1])
        start, end, middle = t[:-1][inside], t[1:][inside], middle[inside]
        c, r = np.searchsorted(x, middle[:, 0]) - 1, np.searchsorted(y, middle[:, 1]) - 1
        wide, high = x[c + 1] - x[c], y[r + 1] - y[r]

        def above(t: np.ndarray, c: np.ndarray = c, r: np.ndarray = r, point: np.ndarray = point) -> np.ndarray:
            """Terrain less line, on the cell's upper or lower triangle."""
            u, v = (point[0] + t * way[0] - x[c]) / wide, (point[1] + t * way[1] - y[r]) / high  # noqa: B023
            ground = z[r, c] + np.where(
                u >= v,
                u * (z[r, c + 1] - z[r, c]) + v * (z[r + 1, c + 1] - z[r, c + 1]),
                v * (z[r + 1, c] - z[r, c]) + u * (z[r + 1, c + 1] - z[r + 1, c]),
            )
            return ground - (point[2] + t * way[2])  # noqa: B023

        slope = way[0] / wide - way[1] / high
        with np.errstate(divide="ignore", invalid="ignore"):
            diagonal = ((point[1] - y[r]) / high - (point[0] - x[c]) / wide) / slope
        diagonal = np.where((diagonal > start) & (diagonal < end), diagonal, start)
        out[i] = any((above(at) > 0).any() for at in (start, diagonal, end))
    return out
