"""Backprojection written plainly in NumPy: no tiles, no kernels, float64, one thread; for some of the pulses."""

from __future__ import annotations

import time

import numpy as np

from ..base.constants import SPEED_OF_LIGHT
from ..model.phase_history import PhaseHistory
from . import exact
from ._cases import BenchCase
from ._competitor import Competitor, Reading

PAIRS = 8e6  # pulses x pixels of one run, which takes about a second
FINER = 16  # samples of a range profile per 1/bandwidth


def backproject(raw: PhaseHistory, points: np.ndarray, finer: int = FINER) -> np.ndarray:
    """Image, complex128 (m,), at points, m (m, 3): profiles by FFT, `finer` times oversampled, linear interpolation."""
    n, step = raw.n_samples, raw.frequency_step[0]
    length = finer * n
    middle = raw.frequency[0] + n // 2 * step
    place = (np.arange(length) - length // 2) / (length * step)  # s, delays of the samples of a profile
    image = np.zeros(len(points), np.complex128)
    for row, antenna, ref in zip(raw.read(0, raw.n_rows), raw.tx, raw.reference_range, strict=True):
        spectrum = np.zeros(length, np.complex128)
        spectrum[: n - n // 2], spectrum[length - n // 2 :] = row[n // 2 :], row[: n // 2]
        profile = np.fft.fftshift(np.fft.ifft(spectrum)) * length
        delay = 2 / SPEED_OF_LIGHT * (np.linalg.norm(points - antenna, axis=1) - ref)
        image += np.interp(delay, place, profile) * np.exp(2j * np.pi * middle * delay)
    return image


def competitors(case: BenchCase) -> list[Competitor]:
    """The one competitor. It takes some of the pulses; its seconds are scaled to all n."""
    pulses = case.raw.n_rows
    rows = min(pulses, max(1, round(PAIRS / case.grid.size)))
    raw = case.raw[:rows]
    points = case.grid.at(*np.indices(case.grid.shape)).reshape(-1, 3)

    def run() -> Reading:
        start, busy = time.perf_counter(), time.process_time()
        image = backproject(raw, points).reshape(case.grid.shape)
        seconds, busy = time.perf_counter() - start, time.process_time() - busy
        return Reading(image[case.at[0], case.at[1]], {"call": seconds, "form": seconds, "cpu": busy})

    setting = f"linear, {FINER} x" + (f"; {rows} pulses, seconds times {pulses / rows:.0f}" if rows < pulses else "")
    check = exact.backproject(raw, case.grid.at(*case.at))
    return [Competitor("NumPy", "one thread", "direct", setting, run, check=check, share=rows / pulses)]
