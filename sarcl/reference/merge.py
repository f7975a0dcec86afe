"""Profiles about a tile's centre, and their decimation, term by term."""

from __future__ import annotations

import numpy as np

from ..base.constants import SPEED_OF_LIGHT
from ..model.phase_history import PhaseHistory
from .geometry import half_path


def merge(
    raw: PhaseHistory, center: np.ndarray, offsets: np.ndarray, blocks: np.ndarray, weights: np.ndarray, n_kept: int
) -> np.ndarray:
    """G_v(m) = sum_p W(p - v) g_p(m), g_p the row's profile `offsets` m (m,) beyond the path to center.

    blocks (n, 4): first row, rows, first kept pulse, first row of weights (rows, taps). Returns complex128 (n_kept, m).
    """
    out = np.zeros((n_kept, len(offsets)), np.complex128)
    n = np.arange(raw.n_samples) - raw.n_samples // 2
    for first, count, kept, row in blocks:
        for i in range(count):
            p = first + i
            delta = float(half_path(raw.tx[p], raw.rx[p], center[None], raw.reference_range[p])[0])
            delay = 2 * (delta + offsets) / SPEED_OF_LIGHT
            profile = np.exp(2j * np.pi * raw.frequency_step[p] * np.outer(delay, n)) @ raw.read(p, p + 1)[0]
            carrier = raw.frequency[p] + raw.n_samples // 2 * raw.frequency_step[p]
            moved = profile * np.exp(4j * np.pi * carrier / SPEED_OF_LIGHT * delta)
            out[kept : kept + weights.shape[1]] += weights[row + i][:, None] * moved
    return out
