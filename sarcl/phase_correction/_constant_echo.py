"""Echoes without those of constant delay: leaks from transmitter to receiver, reflections from the vehicle itself."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..base.constants import SPEED_OF_LIGHT
from ..model.lazy_rows import RowsOnDemand
from ..model.phase_history import PhaseHistory
from ._bright_points import phasor

ROWS = 256  # rows per array operation: bounds the memory
# shares of the energy, times the number of pulses, below which nothing is taken out: that of noise is 1
LEAST = 4.0


def without_constant_echo(raw: PhaseHistory, channels: int) -> PhaseHistory | None:
    """The rows without the mean over the pulses of the echo at each delay, of each channel; None where it is faint.

    raw  `channels` rows per pulse, one after another. Where pulses differ in frequency there is no mean: None
    """
    if np.ptp(raw.frequency) or np.ptp(raw.frequency_step):
        return None
    mean = np.zeros((channels, raw.n_samples), np.complex128)
    energy = 0.0
    for start in range(0, raw.n_rows, ROWS):
        rows = slice(start, min(start + ROWS, raw.n_rows))
        samples = raw.read(rows.start, rows.stop)
        energy += float((np.abs(samples).astype(np.float64) ** 2).sum())
        np.add.at(mean, np.arange(raw.n_rows)[rows] % channels, samples * _late(raw, rows).conj())
    mean /= raw.n_rows // channels
    if (np.abs(mean) ** 2).sum() * raw.n_rows / channels * (raw.n_rows // channels) < LEAST * energy:
        return None
    return replace(raw, samples=_Less(raw, mean))


def _late(raw: PhaseHistory, rows: slice) -> np.ndarray:
    """exp(+j 2 pi f tau_ref): turns samples of an echo of constant delay into those of a constant reference range."""
    frequency = raw.frequency[0] + raw.frequency_step[0] * np.arange(raw.n_samples)
    reference, same = np.unique(raw.reference_range[rows], return_inverse=True)
    return phasor(np.outer(2 * reference / SPEED_OF_LIGHT, frequency))[same.ravel()]


class _Less(RowsOnDemand):
    """Samples of rows minus those of their channel's constant echo, `mean` (channels, n_samples)."""

    def __init__(self, raw: PhaseHistory, mean: np.ndarray) -> None:
        self.raw, self.mean = raw, mean
        self.shape, self.dtype = raw.samples.shape, np.dtype(np.complex64)

    def rows(self, some: slice) -> np.ndarray:
        constant = self.mean[np.arange(some.start, some.stop) % len(self.mean)] * _late(self.raw, some)
        return (np.asarray(self.raw.samples[some]) - constant).astype(np.complex64)
