"""Vectors in space."""

from __future__ import annotations

import numpy as np


def unit(vectors: np.ndarray) -> np.ndarray:
    """Unit vectors (..., n) along vectors (..., n), none of them of length 0."""
    return np.asarray(vectors / np.linalg.norm(vectors, axis=-1, keepdims=True))
