"""Interpolation of one profile by a short kernel."""

from __future__ import annotations

import numpy as np

from ..numerics.interpolation import Interpolator


def interpolate(row: np.ndarray, positions: np.ndarray, kernel: Interpolator) -> np.ndarray:
    """sum_k w_k(z) row[j + k] at positions t (n,) in samples, j + (taps - 1)/2 + z = t, |z| <= 1/2: complex128 (n,)."""
    s = np.asarray(positions, np.float64) - (kernel.taps - 1) / 2
    j = np.rint(s).astype(int)
    return (kernel.weights(s - j) * row[j[:, None] + np.arange(kernel.taps)]).sum(axis=1)
