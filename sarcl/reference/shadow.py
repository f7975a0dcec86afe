"""Which facets something hides, by testing every ray against every facet (Moeller and Trumbore, 1997)."""

from __future__ import annotations

import numpy as np


def hidden(triangles: np.ndarray, viewpoint: np.ndarray, bias: float = 0.01) -> np.ndarray:
    """True (k,) where a facet, m (k, 3, 3), crosses the line from another's centroid to `viewpoint`, m (3,).

    Crossings nearer to the centroid than `bias` of the facet's longest edge do not count.
    """
    a = triangles[:, 0]
    b, c = triangles[:, 1] - a, triangles[:, 2] - a
    out = np.zeros(len(triangles), bool)
    for i, facet in enumerate(triangles):
        origin = facet.mean(axis=0)
        ray = viewpoint - origin
        allowance = bias * np.linalg.norm(facet - np.roll(facet, 1, axis=0), axis=1).max()
        p = np.cross(ray, c)
        det = (b * p).sum(axis=1)
        with np.errstate(divide="ignore", invalid="ignore"):
            s = origin - a
            u = (s * p).sum(axis=1) / det
            q = np.cross(s, b)
            v = (q @ ray) / det
            t = (c * q).sum(axis=1) / det
        crosses = (u >= 0) & (v >= 0) & (u + v <= 1) & (t * np.linalg.norm(ray) > allowance) & (t <= 1)
        crosses[i] = False
        out[i] = crosses.any()
    return out
