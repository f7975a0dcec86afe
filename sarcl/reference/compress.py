"""The matched filter, sample by sample."""

from __future__ import annotations

import numpy as np


def compress(samples: np.ndarray, pulse: np.ndarray) -> np.ndarray:
    """samples (n_rows, n) times the conjugate of the pulse's spectrum (n,): complex128 (n_rows, n)."""
    out = np.zeros(samples.shape, np.complex128)
    for p in range(len(samples)):
        for n in range(samples.shape[1]):
            out[p, n] = samples[p, n] * np.conj(pulse[n])
    return out
