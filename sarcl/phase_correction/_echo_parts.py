"""Parts of the echoes for cross-validation: near and far places, and the phase that sharpens contributions most.

Echoes of constant delay are left out: leaks from transmitter to receiver, reflections from the vehicle itself.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..base.constants import SPEED_OF_LIGHT
from ..model.lazy_rows import RowsOnDemand
from ..model.phase_history import PhaseHistory
from . import _bright_points, _phase_gradient
from ._aperture_view import WINDOW, ApertureView
from ._bright_points import phasor
from ._search import ENOUGH, GROWTH

ROWS = 256  # rows per array operation: bounds the memory
# shares of the energy, times the number of pulses, below which nothing is taken out: that of noise is 1
LEAST = 4.0
PASSES = 3  # passes of the estimate from given places
# of the power of the brightest place: side lobes in range, of a Hamming window over the band, are below (-43 dB)
SIDE_LOBES = 1e-4
BETWEEN = 2.0  # range cells of half the band behind the border of near and far places, which neither uses


def near_and_far(
    view: ApertureView, places: np.ndarray, values: list[np.ndarray], phase: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Two sets of places, bool (k,) each, at different ranges, of sharpness as equal as can be.

    Places between the sets belong to neither. Where they are all the targets that one of them has, the sets are those
    of which the fainter is as sharp as can be; where these lack a target too, both are empty.
    """
    middle = view.n // 2 * view.channels
    cells = _bright_points.delay(view.raw, middle, places) * view.raw.bandwidth[0]

    def sharpness(removed: np.ndarray) -> np.ndarray:
        return sum(abs(_phase_gradient.turned(v, removed).sum(axis=0)) ** 4 for v in values)

    level = np.maximum(sharpness(phase), sharpness(0 * phase))
    level = level.reshape(view.channels, -1).sum(axis=0)
    order = np.argsort(cells)
    ranges, total = cells[order], np.concatenate([[0.0], np.cumsum(level[order], dtype=np.float64)])
    beyond = np.searchsorted(ranges, ranges + BETWEEN, side="right")
    bright = level >= SIDE_LOBES**2 * level.max()
    for first in (np.arange(1, len(order) + 1), beyond):  # of the places behind each border, in order of range
        border = ranges[int(np.minimum(total[1:], total[-1] - total[first]).argmax())]
        sets = cells <= border, cells > border + BETWEEN
        if all((picked & bright).any() for picked in sets):
            return sets
    return np.zeros(len(cells), bool), np.zeros(len(cells), bool)


def phase_of(view: ApertureView, v: np.ndarray) -> np.ndarray:
    """The phase (n,), from a start without any, that sharpens the contributions v (n, k) to bright points most."""
    if view.is_narrow:
        return _narrow_phase(v)
    first, last = view.narrow_pulses
    phase = np.zeros(view.n)
    brightest = np.argsort(-np.abs(v[first:last].sum(axis=0)))[: view.places]
    phase[first:last] = _narrow_phase(v[first:last].take(brightest, axis=1))
    while last - first < view.n:
        step = (last - first) // GROWTH + 1
        low, high = max(0, first - step), min(view.n, last + step)
        start = _phase_gradient.extended(v[low:high], phase[low:high], first - low, last - low)
        phase[low:high] = _phase_gradient.sharpen(v[low:high], start, 0)
        first, last = low, high
    still = _phase_gradient.sharpen(v, np.zeros(view.n), 0)
    return max((phase, still), key=lambda start: _phase_gradient.sharpness(v, start, 0))


def _narrow_phase(v: np.ndarray) -> np.ndarray:
    """`phase_of` over a narrow aperture."""
    n = len(v)
    phase = np.zeros(n)
    for k in range(PASSES):
        blurred = _phase_gradient.turned(v, phase)
        step, gain = _phase_gradient.focused(blurred, blurred, k, WINDOW)
        phase = phase + step
        if n / 4**k <= WINDOW and gain < ENOUGH:
            break
    return phase


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

    def rows(self, rows: slice) -> np.ndarray:
        constant = self.mean[np.arange(rows.start, rows.stop) % len(self.mean)] * _late(self.raw, rows)
        return (np.asarray(self.raw.samples[rows]) - constant).astype(np.complex64)
