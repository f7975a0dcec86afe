"""Samples times weights, turned to other reference ranges."""

from __future__ import annotations

import numpy as np


def turned(
    samples: np.ndarray, row_weight: np.ndarray, sample_weight: np.ndarray, first: np.ndarray, step: np.ndarray
) -> np.ndarray:
    """Samples (n, n_samples) times both weights and exp(+j 2 pi (first + k step)), k their number: complex128.

    first, step   cycles (n,), longdouble where they are many: kernels/weighted_samples.cl
    """
    cycles = first[:, None].astype(np.longdouble) + step[:, None].astype(np.longdouble) * np.arange(samples.shape[1])
    turn = np.exp(2j * np.pi * (cycles - np.rint(cycles)).astype(np.float64))
    return samples.astype(np.complex128) * np.outer(row_weight, sample_weight) * turn
