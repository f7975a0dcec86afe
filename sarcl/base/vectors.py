"""Vectors in space."""

from __future__ import annotations

import numpy as np


def unit(vectors: np.ndarray) -> np.ndarray:
    """Unit vectors (..., n) along vectors (..., n), none of them of length 0."""
    return np.asarray(vectors / np.linalg.norm(vectors, axis=-1, keepdims=True))


def dot(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Scalar products (n,) of the rows of a and of b, both (n, m)."""
    return np.asarray(np.einsum("ij,ij->i", a, b))
