"""Pieces of facets, cut at the middles of their longest edges, and what kernels read of them, one after another."""

from __future__ import annotations

import math

import numpy as np

from ..base import counter_rng

Facet = tuple[np.ndarray, np.ndarray, np.ndarray]  # corners, m (3,)
HEIGHTS, REAL, IMAG = 0, 2, 3  # streams of random numbers


def pieces(triangles: np.ndarray, lengths: np.ndarray, limit: float) -> tuple[np.ndarray, np.ndarray]:
    """Triangles (k, 3, 3) cut until no edge is longer than a limit, m: pieces (n, 3, 3), and the triangle of each (n,).

    lengths  m (k, 3), of the edges from each corner on to the next
    The first half of a triangle, with all its pieces, comes before the second.
    """
    out: list[Facet] = []
    counts = []
    for (a, b, c), sides in zip(triangles, lengths.tolist(), strict=True):
        before = len(out)
        _cut((a, b, c), tuple(sides), limit, out)
        counts.append(len(out) - before)
    return np.array(out).reshape(-1, 3, 3), np.repeat(np.arange(len(triangles)), counts)


def _cut(corners: Facet, lengths: tuple[float, float, float], limit: float, out: list[Facet]) -> None:
    """Append the pieces of a triangle, whose edges from corner i to i + 1 have these lengths."""
    if max(lengths) <= limit:
        out.append(corners)
        return
    i = lengths.index(max(lengths))
    a, b, c = (corners[(i + j) % 3] for j in range(3))
    half, b_to_c, c_to_a = lengths[i] / 2, lengths[(i + 1) % 3], lengths[(i + 2) % 3]
    middle = (a + b) / 2
    cut = _length(c - middle)
    _cut((a, middle, c), (half, cut, c_to_a), limit, out)
    _cut((middle, b, c), (half, b_to_c, cut), limit, out)


def _length(vector: np.ndarray) -> float:
    x, y, z = vector.tolist()
    return math.sqrt(x * x + y * y + z * z)


def random_numbers(corners: np.ndarray, seed: int) -> np.ndarray:
    """Complex numbers of unit power of pieces (n, 3, 3): complex128 (n,)."""
    real, imag = (counter_rng.gaussian(_centroids(corners), seed, stream) for stream in (REAL, IMAG))
    return np.asarray((real + 1j * imag) / np.sqrt(2))


def centers(corners: np.ndarray, roughness: np.ndarray, seed: int) -> np.ndarray:
    """Centroids of pieces, m (n, 3, 3), moved along their normals by random heights of rms `roughness`, m (n,)."""
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    height = counter_rng.gaussian(_centroids(corners), seed, HEIGHTS) * roughness
    return np.asarray(_centroids(corners) + height[:, None] * normal / np.linalg.norm(normal, axis=1, keepdims=True))


def _centroids(corners: np.ndarray) -> np.ndarray:
    return np.asarray((corners[:, 0] + corners[:, 1] + corners[:, 2]) / 3)
