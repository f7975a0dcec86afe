"""What comes before and after an FFT of the columns of an array."""

from __future__ import annotations

import numpy as np


def columns(array: np.ndarray, first: int, count: int, length: int) -> np.ndarray:
    """Columns first ... first + count - 1 of an array as rows complex128 (count, length): kernels/transposition.cl.

    Rows of the array beyond `length` are added to the first ones; where there are fewer, zeros follow.
    """
    out = np.zeros((count, length), np.complex128)
    for row, values in enumerate(array):
        out[:, row % length] += values[first : first + count]
    return out


def lay(spectra: np.ndarray, weights: np.ndarray, origin: int, sign: int) -> np.ndarray:
    """Rows of spectra as columns: (n, count), row i times weights[i] at bin origin + sign i, modulo their length."""
    bins = (origin + sign * np.arange(len(weights))) % spectra.shape[1]
    return weights[:, None] * spectra[:, bins].T
