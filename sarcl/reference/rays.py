"""The first facet on a ray, and whether any facet lies between two points: every ray against every facet."""

from __future__ import annotations

import numpy as np

from ..base.vectors import unit
from ..scene.triangles import edges


def nearest(
    triangles: np.ndarray, origins: np.ndarray, directions: np.ndarray, *, least: float = 0.0, margin: float = 0.0
) -> tuple[np.ndarray, np.ndarray]:
    """The facet (n,), of m (k, 3, 3), that each ray meets first, and the distance, m (n,); -1 and inf for none.

    origins  m (n, 3);  directions  of any length (n, 3);  least  m: nearer facets are not met
    margin   m, by which every edge of a facet is moved outwards, or inwards where it is negative
    """
    facet, distance = np.full(len(origins), -1), np.full(len(origins), np.inf)
    for i, (origin, direction) in enumerate(zip(origins, unit(directions), strict=True)):
        t = _crossings(triangles, origin, direction, margin)
        t[t <= least] = np.inf
        if t.min() < np.inf:
            facet[i], distance[i] = t.argmin(), t.min()
    return facet, distance


def any_hit(
    triangles: np.ndarray, origins: np.ndarray, ends: np.ndarray, *, least: float = 0.0, margin: float = 0.0
) -> np.ndarray:
    """True (n,) where a facet, m (k, 3, 3), lies between two points, m (n, 3) each, and not within `least`, m, of one.

    margin  as `nearest` takes it
    """
    out = np.zeros(len(origins), bool)
    for i, (origin, end) in enumerate(zip(origins, ends, strict=True)):
        length = np.linalg.norm(end - origin)
        if length > 0:
            t = _crossings(triangles, origin, (end - origin) / length, margin)
            out[i] = ((t > least) & (t < length - least)).any()
    return out


def _crossings(triangles: np.ndarray, origin: np.ndarray, direction: np.ndarray, margin: float) -> np.ndarray:
    """Distance, m (k,), at which a ray along a unit vector meets each facet, m (k, 3, 3); inf where it does not.

    Source: Moeller and Trumbore 1997. A facet without area, or edge-on to the ray, is not met.
    """
    a = triangles[:, 0]
    b, c = triangles[:, 1] - a, triangles[:, 2] - a
    p, s = np.cross(direction, c), origin - a
    q = np.cross(s, b)
    det = np.einsum("ij,ij->i", b, p)
    with np.errstate(divide="ignore", invalid="ignore"):
        u, v, t = np.einsum("ij,ij->i", s, p) / det, q @ direction / det, np.einsum("ij,ij->i", c, q) / det
        # a barycentric coordinate grows by the length of its edge over twice the area, per metre from that edge
        ab, bc, ca = -margin * edges(triangles) / np.linalg.norm(np.cross(b, c), axis=1)
        inside = (u >= ca) & (v >= ab) & (1 - u - v >= bc)
    return np.where(inside & np.isfinite(t), t, np.inf)
