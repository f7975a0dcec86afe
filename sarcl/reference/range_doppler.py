"""Secondary range compression, and reading of a range profile along the migration; the image is `backproject`."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ..base.constants import SPEED_OF_LIGHT
from ..numerics.interpolation import Interpolator
from .interp import interpolate


def straighten(row: np.ndarray, positions: np.ndarray, cycles: np.ndarray, kernel: Interpolator) -> np.ndarray:
    """Values at positions (n,), in samples of a profile `row`, times exp(+j 2 pi cycles): kernels/range_doppler.cl."""
    return interpolate(row, positions, kernel) * np.exp(2j * np.pi * cycles)


def compressed(
    spectra: np.ndarray,
    frequencies: np.ndarray,
    bends: np.ndarray,
    distance: float,
    weight: Callable[[np.ndarray], np.ndarray],
) -> np.ndarray:
    """Spectra (bins, n_samples) compressed for a slant range, m, complex128: kernels/compression_filter.cl.

    frequencies  of the samples, Hz (n_samples,);  bends  c q/(2 v) of the bins, Hz (bins,)
    weight       of the Doppler band, at sines of squint angles
    """
    f, b = frequencies.astype(np.longdouble)[None], bends.astype(np.longdouble)[:, None]
    center = f[:, f.shape[1] // 2, None]
    a = np.sqrt(center**2 - b**2)
    cycles = 2 / np.longdouble(SPEED_OF_LIGHT) * distance * (np.sqrt(f**2 - b**2) - a - (f - center) * center / a)
    phase = 2 * np.pi * (cycles - np.rint(cycles)).astype(np.float64)
    level = (f / (f**2 - b**2) ** 0.75).astype(np.float64) * weight((b / f).astype(np.float64))
    return spectra * level * np.exp(1j * phase)
