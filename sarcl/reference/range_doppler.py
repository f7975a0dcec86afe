"""Reading of a range profile along the migration; the image itself is `backproject` with shares."""

from __future__ import annotations

import numpy as np

from ..numerics.interpolation import Interpolator
from .interp import interpolate


def straighten(row: np.ndarray, positions: np.ndarray, cycles: np.ndarray, kernel: Interpolator) -> np.ndarray:
    """Values at positions (n,), in samples of a profile `row`, times exp(+j 2 pi cycles): kernels/range_doppler.cl."""
    return interpolate(row, positions, kernel) * np.exp(2j * np.pi * cycles)
