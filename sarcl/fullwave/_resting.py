"""Cells inside conductors, whose fields stay zero and need no updates."""

from __future__ import annotations

import numpy as np

from .lattice import LANES


def resting_rows(inside: np.ndarray, low: np.ndarray) -> np.ndarray:
    """Rows with cells in which no field ever changes, int (n, 4): plane, row, and the longest stretch of such cells in
    it, as its first cell and the first one after it.

    inside  nodes inside conductors, in a box of the grid whose first node is `low` (3,), bool
    A cell rests where its node and the 26 nodes about it are inside: each of its edges and all faces beside them are
    then in the conductor. Stretches are whole vectors of LANES cells.
    """
    before = int(low[2]) % LANES
    held = np.pad(inside, ((0, 0), (0, 0), (before, -(before + inside.shape[2]) % LANES)))
    for axis in range(3):
        line = np.moveaxis(held, axis, 0)  # a view
        both = line[:-1] & line[1:]
        line[0] = line[-1] = False
        line[1:-1] = both[:-1] & both[1:]
    vectors = np.asarray(held.reshape(*held.shape[:2], -1, LANES).all(axis=3))
    length = np.zeros(vectors.shape, np.int64)  # of the stretch that ends here, vectors
    for v in range(vectors.shape[2]):
        length[..., v] = vectors[..., v] * (1 + (length[..., v - 1] if v else 0))
    plane, row = np.nonzero(length.any(axis=2))
    longest, end = length[plane, row].max(axis=1), length[plane, row].argmax(axis=1) + 1
    cells = low[2] - before + LANES * np.stack([end - longest, end])
    return np.stack([plane + low[0], row + low[1], *cells], axis=1)
