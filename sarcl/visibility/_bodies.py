"""Bodies of a scene: facets that hang together by their corners."""

from __future__ import annotations

import numpy as np

from ..base.boxes import box

SAME = 1e-6  # distance of corners that count as one, over the diagonal of all facets: digits of float32 files


def bodies_of(triangles: np.ndarray) -> np.ndarray:
    """A number for each facet, m (k, 3, 3), int (k,): facets that share corners, or are joined by others that do, have
    the same."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    k, corners = len(triangles), triangles.reshape(-1, 3)
    low, high = box(corners)
    cells = np.rint((corners - low) / max(SAME * float(np.linalg.norm(high - low)), 1e-300)).astype(np.int64)
    corner = np.unique(cells, axis=0, return_inverse=True)[1].ravel()
    facet, n = np.repeat(np.arange(k), 3), k + int(corner.max()) + 1
    graph = coo_array((np.ones(len(facet), np.int8), (facet, k + corner)), shape=(n, n))
    return np.asarray(connected_components(graph, directed=False)[1][:k])
