"""The setting of the public GPU benchmark: 11 566 pulses along a straight track 770 km away, 8192 x 8192 pixels."""

from __future__ import annotations

import numpy as np

from ..model.phase_history import PhaseHistory

PULSES, SIDE = 11_566, 8192  # of the public benchmark: pulses; samples of each, and pixels a side
CENTER, BANDWIDTH = 9.65e9, 600e6  # Hz
DISTANCE, STEP, SPACING = 770e3, 1.5, 0.25  # m: of the antenna, between pulses, between pixels


def pulses(n: int) -> int:
    """Pulses of an image of n x n pixels: as many per pixel of a side as the benchmark has."""
    return round(PULSES * n / SIDE)


def phase_history(samples: np.ndarray) -> PhaseHistory:
    """Echoes along the track, 53 deg up; samples complex64 (pulses, samples)."""
    n_pulses, n_samples = samples.shape
    along = (np.arange(n_pulses) - n_pulses / 2) * STEP
    tx = np.stack([np.full(n_pulses, 0.6 * DISTANCE), along, np.full(n_pulses, 0.8 * DISTANCE)], axis=1)
    return PhaseHistory(
        samples,
        frequency=CENTER - BANDWIDTH / 2,
        frequency_step=BANDWIDTH / n_samples,
        tx=tx,
        reference_range=np.linalg.norm(tx, axis=1),
    )
