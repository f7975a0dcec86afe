"""Narrow apertures: those over which the phases of all points near a place are linear in the pulse.

An FFT over the pulses is then the image on a line through the place, which `_phase_gradient` uses.
"""

from __future__ import annotations

import numpy as np

from ..base.constants import SPEED_OF_LIGHT
from ..base.vectors import unit
from ..model.image_grid import ImageGrid
from ..model.phase_history import PhaseHistory
from ..numerics.pulse_geometry import half_path

CELLS = 8  # Doppler cells: distance across range of the points that are looked at
# rad, largest phase over the aperture, besides a line, of a point half a range cell behind a place, which every column
# of contributions holds; and of one CELLS beside it, which is one of many
MOST_BEHIND, MOST_BESIDE = 1.5, 4.0
LEAST_PULSES = 8
PLACES = 16  # places of the grid that are examined
PULSES = 64  # pulses of the aperture that are examined


def narrow_pulses(raw: PhaseHistory, grid: ImageGrid, frequency: float, depth: float) -> tuple[int, int]:
    """The longest narrow sub-aperture about the middle: pulses first ... last - 1.

    raw    a row per pulse, in order of time
    depth  m, half a range cell
    """
    places = grid.sample(PLACES, seed=0)[1].reshape(-1, 3)
    reach = float(np.linalg.norm(np.ptp(grid.bounds, axis=0))) / 2
    first, last = 0, raw.n_rows
    while last - first > LEAST_PULSES:
        beside, behind = _bends(raw, places, (first, last), frequency, depth, reach)
        if beside <= MOST_BESIDE and behind <= MOST_BEHIND:
            break
        step = max(1, (last - first) // PULSES)
        first, last = first + step, last - step
    return first, last


def _bends(
    raw: PhaseHistory, places: np.ndarray, pulses: tuple[int, int], frequency: float, depth: float, reach: float
) -> tuple[float, float]:
    """Largest deviation from a line, rad, of the phase of points CELLS beside places, and of those `depth` behind.

    reach  m, largest distance of a point beside a place
    """
    rows = np.unique(np.linspace(pulses[0], pulses[1] - 1, PULSES).astype(int))
    tx, rx = raw.tx[rows, None], raw.rx[rows, None]
    middle = len(rows) // 2
    look = unit(places - tx) + unit(places - rx)  # (rows, places, 3): twice a unit vector where tx is rx
    turned = look[-1] - look[0]
    angle = np.linalg.norm(turned, axis=-1, keepdims=True)
    ahead = unit(look[middle])
    across = turned - (turned * ahead).sum(axis=-1, keepdims=True) * ahead
    across *= np.minimum(CELLS * SPEED_OF_LIGHT / frequency / np.maximum(angle, 1e-12), reach) / np.maximum(
        np.linalg.norm(across, axis=-1, keepdims=True), 1e-300
    )
    plain = half_path(tx, rx, places)

    def bend(near: np.ndarray) -> float:
        phase = 4 * np.pi * frequency / SPEED_OF_LIGHT * (half_path(tx, rx, near) - plain)
        t = rows - rows.mean()
        phase = phase - phase.mean(axis=0)
        return float(np.abs(phase - np.outer(t, t @ phase) / (t @ t)).max())

    beside = []
    for near in (places + across, places - across):
        later = half_path(tx[middle], rx[middle], near) - plain[middle]
        beside.append(bend(near - later[:, None] * ahead))  # in the same range cell
    return max(beside), bend(places + depth * ahead)
