"""Rows of an array: some of them, spread over all; and groups of them by keys."""

from __future__ import annotations

import numpy as np


def spread_over(n: int, most: int) -> np.ndarray:
    """Up to `most` of the numbers 0 ... n - 1, evenly spaced, the first and the last among them: int (m,)."""
    return np.unique(np.linspace(0, n - 1, min(most, n)).astype(int))


def groups(n: int, *keys: np.ndarray | None) -> np.ndarray:
    """Number of the group of each of n rows, int64 (n,): rows of a group agree in every key, (n,) each, None left out.

    Groups are numbered in the order of the first key, then of the second, and so on.
    """
    out = np.zeros(n, np.int64)
    for key in keys:
        if key is not None:
            out = out * n + np.unique(key, return_inverse=True)[1].ravel()
            out = np.unique(out, return_inverse=True)[1].ravel()
    return out
