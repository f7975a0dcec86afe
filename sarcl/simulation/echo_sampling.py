"""Rows of echoes: positions of the antennas, range window, frequencies of the samples."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..base.boxes import corners
from ..base.constants import SPEED_OF_LIGHT
from ..base.validation import finite, instance
from ..model.trajectory import Trajectory
from ..model.waveform import Waveform
from ..numerics.pulse_geometry import half_path
from ..scene.scene import Scene

LEAST_SAMPLES = 64  # in the default range window, so that a single point has a profile, too


def receiver_positions(track: Trajectory, receiver: Trajectory | None) -> np.ndarray:
    """Receiver positions (n_pulses, 3)."""
    if receiver is None:
        return track.positions
    instance("receiver", receiver, Trajectory)
    if len(receiver) != len(track):
        raise ValueError(f"receiver has {len(receiver)} positions but track has {len(track)}; give one per pulse")
    return receiver.positions


def window(
    scene: Scene, waveform: Waveform, tx: np.ndarray, rx: np.ndarray, reference_range: np.ndarray, asked: Any
) -> tuple[float, float]:
    """The range gate (near, far) about the reference, m: as asked, or that which holds the scene's box plus 10 %."""
    if asked is not None:
        pair = np.asarray(asked, np.float64)
        if pair.shape != (2,):
            raise ValueError(f"range_window is {asked!r}; give (near, far) in metres about the reference")
        finite("range_window", pair)
        if not pair[0] < pair[1]:
            raise ValueError(f"range_window ({pair[0]:g}, {pair[1]:g}) is empty; near must be less than far")
        return float(pair[0]), float(pair[1])
    low, high = scene.bounds
    # distance is convex: the farthest point of a box is a corner, the nearest is the antenna clipped to the box
    farthest = half_path(tx, rx, corners(scene.bounds)[:, None]).max(axis=0) - reference_range
    clipped = [np.linalg.norm(e - np.clip(e, low, high), axis=1) for e in (tx, rx)]
    nearest = (clipped[0] + clipped[1]) / 2 - reference_range
    least = LEAST_SAMPLES * SPEED_OF_LIGHT / (4 * waveform.bandwidth)
    half = max(1.1 * float(farthest.max()), -1.1 * float(nearest.min()), least)
    return -half, half


def sampling(waveform: Waveform, near: float, far: float, compressed: bool) -> tuple[float, float, int]:
    """Frequency of sample 0, step, and number: f_n = fc - B/2 + (n + 1/2) df with n_samples df = B."""
    period = 4 * max(abs(near), abs(far)) / SPEED_OF_LIGHT
    if not compressed:
        period += waveform.duration  # so that pulses at the window's ends do not wrap
    n_samples = max(1, int(np.ceil(period * waveform.bandwidth * (1 - 1e-12))))
    step = waveform.bandwidth / n_samples
    return waveform.center - waveform.bandwidth / 2 + step / 2, step, n_samples
