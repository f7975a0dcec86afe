"""Fields of arrays whose elements send a carrier each: kernels/beam.cl in extended precision."""

from __future__ import annotations

import numpy as np

from ..base.constants import SPEED_OF_LIGHT


def field(
    elements: np.ndarray, offsets: np.ndarray, weights: np.ndarray, f0: float, times: np.ndarray, points: np.ndarray
) -> np.ndarray:
    """sum_n w_n exp(+j 2 pi f_n (t - |x - x_n|/c)), f_n = f0 + offset: complex128 times.shape + points.shape[:-1].

    elements (n, 3) m and points (..., 3) m in one frame, offsets (n,) Hz. Whole cycles are removed in longdouble.
    """
    times, points = np.asarray(times, np.longdouble), np.asarray(points, np.longdouble)
    out = np.zeros(times.shape + points.shape[:-1], np.complex128)
    for element, offset, weight in zip(np.asarray(elements, np.longdouble), offsets, weights, strict=True):
        delay = np.sqrt(((points - element) ** 2).sum(axis=-1)) / np.longdouble(SPEED_OF_LIGHT)
        cycles = (np.longdouble(f0) + np.longdouble(offset)) * np.subtract.outer(times, delay)
        out += weight * np.exp(2j * np.pi * (cycles - np.rint(cycles)).astype(np.float64))
    return out
