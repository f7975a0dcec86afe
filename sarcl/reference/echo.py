"""The echo equation, term by term."""

from __future__ import annotations

import numpy as np

from ..base.constants import SPEED_OF_LIGHT
from .geometry import half_path


def echo(
    points: np.ndarray,
    amplitudes: np.ndarray,
    frequencies: np.ndarray,
    tx: np.ndarray,
    rx: np.ndarray,
    reference_range: float,
) -> np.ndarray:
    """sum_k a_k exp(-j 2 pi f (tau_k - tau_ref)) at frequencies (n,), one antenna pair, m (3,): complex128 (n,)."""
    delay = 2 / np.longdouble(SPEED_OF_LIGHT) * half_path(tx, rx, points, reference_range)
    out = np.zeros(len(frequencies), np.complex128)
    for n, f in enumerate(frequencies):
        cycles = ((np.longdouble(f) * delay) % 1).astype(np.float64)
        out[n] = (amplitudes * np.exp(-2j * np.pi * cycles)).sum()
    return out
