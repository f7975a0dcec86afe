"""What a viewpoint can see of a scene's facets."""

from __future__ import annotations

from typing import Any

import numpy as np

from . import cl
from .scene import box, centroids, edges

# A facet hides what lies deeper by more than this share of the hidden facet's own size: coplanar and touching
# neighbours, and sheets modelled twice, do not hide one another.
BIAS = 0.01


def visible(triangles: np.ndarray, viewpoint: np.ndarray, *, device: Any = None) -> np.ndarray:
    """True (k,) for facets, m (k, 3, 3), whose centroid nothing hides from `viewpoint`, m (3,).

    Every facet hides what is behind it, from both sides. ValueError when the viewpoint is not in front of all
    facets (the projection would fold over).
    """
    if len(triangles) == 0:
        return np.ones(0, bool)
    # perspective moves centroids: they are projected themselves
    corners, centers = project(triangles, viewpoint, centroids(triangles))
    order, start, member, ray_cell = _bin(corners, centers)
    corners, centers = corners[order], centers[order]
    rays, facets = _rays(corners, centers), _facets(corners)
    opened = cl.open_device(device)
    kernel = opened.kernel("shadow.cl", "hidden")
    out = opened.empty(4 * len(triangles))
    buffers = [opened.upload(a) for a in (rays.astype(np.float32), ray_cell, facets, start, member)]
    opened.run(kernel, (len(triangles),), None, *buffers, len(triangles), out)
    seen = np.empty(len(triangles), bool)
    seen[order] = opened.download(out, np.empty(len(triangles), np.int32)) == 0
    return seen


def project(triangles: np.ndarray, viewpoint: np.ndarray, centers: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Corners, m (k, 3, 3), and centroids, m (k, 3), seen from `viewpoint`: (xi, eta, zeta), m, of both."""
    corners = triangles.reshape(-1, 3)
    sight = box(corners).mean(axis=0) - viewpoint
    distance = float(np.linalg.norm(sight))
    ahead = sight / distance if distance else sight
    aside = np.cross(ahead, np.eye(3)[np.argmin(np.abs(ahead))])
    aside /= np.linalg.norm(aside) or 1.0
    axes = np.stack([aside, np.cross(ahead, aside), ahead])

    def seen(points: np.ndarray) -> np.ndarray:
        # one matrix product for all points: products with (k, 3, 3) are ten times slower
        x, y, depth = axes @ (points - viewpoint).T
        if not depth.min() > 1e-6 * distance:
            raise ValueError(
                "an antenna at mid-aperture stands among or beside the facets, where one projection cannot tell what "
                "hides what; pass shadows=False or move the track away from the scene"
            )
        scale = distance / depth
        # zeta = R0 - R0^2/depth without cancellation
        return np.stack([x * scale, y * scale, (depth - distance) * scale], axis=-1)

    return seen(corners).reshape(-1, 3, 3), seen(centers)


def _rays(corners: np.ndarray, centers: np.ndarray) -> np.ndarray:
    """Projected centroid and depth allowance of every facet: (4, k)."""
    size = np.maximum.reduce(edges(corners))
    # float32 resolves places to 1e-7 of the scene
    floor = 4e-7 * float(np.abs(corners).max())
    return np.concatenate([centers.T, np.maximum(BIAS * size, floor)[None]])


def _facets(projected: np.ndarray) -> np.ndarray:
    """Corner 0, barycentric gradients and depth gradient of every facet: (k, 9) float32; edge-on ones hide nothing."""
    a, b, c = projected[:, 0], projected[:, 1] - projected[:, 0], projected[:, 2] - projected[:, 0]
    twice_area = b[:, 0] * c[:, 1] - b[:, 1] * c[:, 0]
    edge_on = np.abs(twice_area) < 1e-9 * np.maximum((b**2).sum(axis=1), (c**2).sum(axis=1))
    inverse = 1 / np.where(edge_on, 1.0, twice_area)
    b1 = np.stack([c[:, 1], -c[:, 0]]) * inverse
    b2 = np.stack([-b[:, 1], b[:, 0]]) * inverse
    slope = b[:, 2] * b1 + c[:, 2] * b2
    out = np.concatenate([a.T, b1, b2, slope]).astype(np.float32)
    # no point has both coordinates >= 0 where both gradients vanish and corner 0 is infinitely deep
    out[2:3, edge_on] = np.inf
    out[3:, edge_on] = 0
    return np.ascontiguousarray(out.T)


def _bin(projected: np.ndarray, centers: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Facets by the square cells of the (xi, eta) plane they touch.

    Returns the order of facets by their centroid's cell, and in that numbering: start (cells + 1,), member, and the
    cell of each ray.
    """
    # slices, not axis=1: reductions over three corners are ten times slower
    a, b, c = (projected[:, i, :2] for i in range(3))
    low, high = np.minimum(np.minimum(a, b), c), np.maximum(np.maximum(a, b), c)
    origin = box(low)[0]
    extent = (box(high)[1] - origin).max()
    typical = float(np.quantile(np.maximum(*(high - low).T), 0.9))
    side = max(2 * typical, float(extent) / 2048, np.finfo(np.float64).tiny)
    while True:
        first = ((low - origin) / side).astype(np.int64)
        last = ((high - origin) / side).astype(np.int64)
        count = last - first + 1
        each = count[:, 0] * count[:, 1]
        # A few large facets among many small ones would fill the memory with entries: wider cells have fewer.
        if each.sum() <= 2**22 + 16 * len(each):
            break
        side *= 2
    across = int(last[:, 0].max()) + 1
    cells = across * (int(last[:, 1].max()) + 1)
    facet = np.repeat(np.arange(len(each)), each)
    within = np.arange(len(facet)) - np.repeat(np.cumsum(each) - each, each)
    column = first[facet, 0] + within % count[facet, 0]
    row = first[facet, 1] + within // count[facet, 0]
    cell = row * across + column
    start = np.zeros(cells + 1, np.int32)
    start[1:] = np.cumsum(np.bincount(cell, minlength=cells))
    at = ((centers[:, :2] - origin) / side).astype(np.int64)
    ray_cell = (at[:, 1] * across + at[:, 0]).astype(np.int32)
    order = np.argsort(ray_cell, kind="stable")
    number = np.empty(len(order), np.int32)
    number[order] = np.arange(len(order))
    return order, start, number[facet[np.argsort(cell, kind="stable")]], ray_cell[order]
