"""Positions between the points of a listed grid of rows and columns, and the indices of positions."""

from __future__ import annotations

import numpy as np

STEPS = 30  # most iterations of Gauss and Newton: a smooth grid needs five
NEAR = 1e-9  # pixels, of a step: a smaller one ends the search


def at(listed: np.ndarray, row: np.ndarray, column: np.ndarray) -> np.ndarray:
    """Positions, m (..., 3), at fractional indices (...) of points (rows, columns, 3): Lagrange's cubics along both
    axes, also a little beyond the ends."""
    row, column = np.broadcast_arrays(np.asarray(row, np.float64), np.asarray(column, np.float64))
    (i, a), (j, b) = (_weights(x.ravel(), n) for x, n in ((row, listed.shape[0]), (column, listed.shape[1])))
    near = listed[i[:, :, None], j[:, None, :]]  # (n, taps, taps, 3)
    return np.einsum("na,nb,nabx->nx", a, b, near).reshape(*row.shape, 3)


def _weights(x: np.ndarray, n: int) -> tuple[np.ndarray, np.ndarray]:
    """Indices and weights (len(x), taps) of up to four neighbours of fractional indices."""
    taps = min(4, n)
    first = np.clip(np.floor(x).astype(np.int64) - taps // 2 + 1, 0, n - taps)
    z = x - first
    weights = np.ones((len(x), taps))
    for k in range(taps):
        for m in range(taps):
            if m != k:
                weights[:, k] *= (z - m) / (k - m)
    return first[:, None] + np.arange(taps), weights


def index(listed: np.ndarray, position: np.ndarray) -> np.ndarray:
    """Fractional (row, column) (..., 2) of the points nearest to positions, m (..., 3), on a smooth listed grid.

    A position outside the grid gets an index outside: its accuracy falls with the distance.
    """
    x = np.asarray(position, np.float64).reshape(-1, 3)
    last = np.array(listed.shape[:2]) - 1
    if (last < 1).any():
        raise ValueError(f"a grid of {listed.shape[:2]} has no surface; it needs two rows and two columns at least")
    indices = np.broadcast_to(last / 2, (len(x), 2)).copy()
    for _ in range(STEPS):
        inside = np.clip(indices, 0, last)
        points = at(listed, inside[:, 0], inside[:, 1])
        ahead = np.minimum(inside + 0.5, last)
        behind = ahead - 0.5
        slopes = np.stack(
            [
                2 * (at(listed, ahead[:, 0], inside[:, 1]) - at(listed, behind[:, 0], inside[:, 1])),
                2 * (at(listed, inside[:, 0], ahead[:, 1]) - at(listed, inside[:, 0], behind[:, 1])),
            ],
            axis=-1,
        )  # (n, 3, 2)
        new_indices = inside + np.einsum("nij,nj->ni", np.linalg.pinv(slopes), x - points)
        step = float(np.abs(new_indices - indices).max(initial=0.0))
        indices = new_indices
        if step < NEAR:
            break
    return indices.reshape(*np.shape(position)[:-1], 2)
