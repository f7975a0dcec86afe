"""Profiles about a tile's centre, their decimation, and its adjoint, term by term."""

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


def expand(
    profiles: np.ndarray,
    offsets: np.ndarray,
    raw: PhaseHistory,
    center: np.ndarray,
    kept: np.ndarray,
    weights: np.ndarray,
) -> np.ndarray:
    """s_p(f) = sum_v W(p - v) sum_m G_v(m) exp(-j 2 pi (f_c tau + (f - f_c)(tau + 2 offset_m/c))), tau of center.

    profiles (n_kept, m): G at `offsets` m (m,) beyond the path to center, without the carrier of these offsets
    kept (n_rows, taps): pulses v around each row, and weights (n_rows, taps): W
    raw  gives antennas, reference ranges and frequencies. Returns samples, complex128 (n_rows, n_samples): the adjoint
    of `merge`.
    """
    out = np.empty((raw.n_rows, raw.n_samples), np.complex128)
    n = np.arange(raw.n_samples) - raw.n_samples // 2
    wavenumber = -4j * np.pi / SPEED_OF_LIGHT  # times a frequency
    for step in np.unique(raw.frequency_step):  # exp(-j 2 pi (f - f_c) 2 offset/c) is that of all rows with this step
        rows = np.flatnonzero(raw.frequency_step == step)
        interpolated = np.stack([weights[p] @ profiles[kept[p]] for p in rows])
        out[rows] = interpolated @ np.exp(wavenumber * step * np.outer(offsets, n))
        for p in rows:
            delta = float(half_path(raw.tx[p], raw.rx[p], center[None], raw.reference_range[p])[0])
            out[p] *= np.exp(wavenumber * delta * (raw.frequency[p] + (raw.n_samples // 2 + n) * step))
    return out
