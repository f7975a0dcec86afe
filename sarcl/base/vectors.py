"""Vectors in space."""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

Floats: TypeAlias = NDArray[np.float64]


def unit(vectors: np.ndarray) -> np.ndarray:
    """Unit vectors (..., n) along vectors (..., n), none of them of length 0."""
    return np.asarray(vectors / np.linalg.norm(vectors, axis=-1, keepdims=True))


def dot(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Scalar products (n,) of the rows of a and of b, both (n, m)."""
    return np.asarray(np.einsum("ij,ij->i", a, b))


def cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Vector products (..., 3), with the bits of np.cross, which takes four times as long for hundreds of vectors."""
    (ax, ay, az), (bx, by, bz) = ((v[..., 0], v[..., 1], v[..., 2]) for v in (a, b))
    x = ay * bz - az * by
    out = np.empty((*x.shape, 3), x.dtype)
    out[..., 0], out[..., 1], out[..., 2] = x, az * bx - ax * bz, ax * by - ay * bx
    return out


def distinct(places: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Different ones of places (n, 3) in rising order, and the number of each place among them (n,): np.unique over
    rows, in a fifth of its time."""
    order = np.lexsort(places.T[::-1])
    rising = places[order]
    is_new = np.append(True, (rising[1:] != rising[:-1]).any(axis=1))[: len(places)]
    number = np.empty(len(places), np.int64)
    number[order] = np.cumsum(is_new) - 1
    return rising[is_new], number


def rising(numbers: np.ndarray) -> np.ndarray:
    """Different ones of integers (n,), rising: np.unique hashes them, which takes ten times as long."""
    numbers = np.sort(numbers)
    return numbers[np.append(True, numbers[1:] != numbers[:-1])[: len(numbers)]]
