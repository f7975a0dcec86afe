"""Bounding boxes of points and their corners."""

from __future__ import annotations

import numpy as np


def box(points: np.ndarray) -> np.ndarray:
    """Lower and upper corner of the box that holds points (n, d): (2, d)."""
    # column by column: a reduction along the long axis of (n, 3) is several times slower
    return np.stack([[c.min() for c in points.T], [c.max() for c in points.T]])


def corners(bounds: np.ndarray) -> np.ndarray:
    """Corners of the box between a lower and an upper one (2, 3): (8, 3)."""
    return np.stack(np.meshgrid(*bounds.T, indexing="ij"), axis=-1).reshape(-1, 3)
