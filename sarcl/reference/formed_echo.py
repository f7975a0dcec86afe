"""Waveform forming, term by term: kernels/current_sums.cl."""

from __future__ import annotations

import numpy as np


def longer(antenna: np.ndarray, offset: np.ndarray) -> np.ndarray:
    """|a - y| - |a| of antennas a (P, 3) and cells y (n, 3), m, from the centre: (P, n)."""
    away = np.linalg.norm(antenna, axis=1)[:, None]
    return np.asarray(np.linalg.norm(antenna[:, None] - offset, axis=2) - away)


def current_sums(
    offset: np.ndarray, current: np.ndarray, travel: np.ndarray, sent: np.ndarray, received: np.ndarray,
    tx: np.ndarray, rx: np.ndarray,
) -> np.ndarray:  # fmt: skip
    """Sums over cells of their currents with the phases of the paths from the transmitter and to the receiver.

    offset, current  cells from the centre, m (n, 3), and their currents (F, n) under a wave along `travel` (3,)
    sent, received   wavenumbers, rad/m (F,) and (P, F);  tx, rx  antennas from the centre, m (P, 3)
    The sums are complex128 (P, F). Source: docs/theory/waveform_forming.md.
    """
    out, there, back = np.empty(received.shape, complex), longer(tx, offset) - offset @ travel, longer(rx, offset)
    for f, values in enumerate(current):
        out[:, f] = np.exp(-1j * (sent[f] * there + received[:, f, None] * back)) @ values.astype(complex)
    return out
