"""Backprojection as one writes it in NumPy: no tiles, no kernels, float64, one thread; for some of the pulses."""

from __future__ import annotations

import time

import numpy as np

from ..base.constants import SPEED_OF_LIGHT
from ..model.phase_history import PhaseHistory
from . import _exact
from ._cases import Case
from ._contestant import Contestant, Reading

PAIRS = 8e6  # in one run, about a second
FINER = 16  # samples of a profile per 1/B


def backproject(raw: PhaseHistory, points: np.ndarray) -> np.ndarray:
    """Profiles by FFT, 16 times oversampled, read by linear interpolation; complex128 (m,) at points, m (m, 3)."""
    n, step = raw.n_samples, raw.frequency_step[0]
    length = FINER * n
    middle = raw.frequency[0] + n // 2 * step
    place = (np.arange(length) - length // 2) / (length * step)  # s, of the profile's samples
    image = np.zeros(len(points), np.complex128)
    for row, antenna, ref in zip(raw.read(0, raw.n_rows), raw.tx, raw.reference_range, strict=True):
        spectrum = np.zeros(length, np.complex128)
        spectrum[: n - n // 2], spectrum[length - n // 2 :] = row[n // 2 :], row[: n // 2]
        profile = np.fft.fftshift(np.fft.ifft(spectrum)) * length
        delay = 2 / SPEED_OF_LIGHT * (np.linalg.norm(points - antenna, axis=1) - ref)
        image += np.interp(delay, place, profile) * np.exp(2j * np.pi * middle * delay)
    return image


def contestants(case: Case) -> list[Contestant]:
    """The one line; its seconds are those of the pulses it takes, times n over their number."""
    rows = min(case.n, max(1, round(PAIRS / case.grid.size)))
    raw = case.raw[:rows]
    points = case.grid.at(*np.indices(case.grid.shape)).reshape(-1, 3)

    def run() -> Reading:
        start, busy = time.perf_counter(), time.process_time()
        image = backproject(raw, points).reshape(case.grid.shape)
        seconds, busy = time.perf_counter() - start, time.process_time() - busy
        return Reading(image[case.at[0], case.at[1]], {"call": seconds, "form": seconds, "cpu": busy})

    setting = f"linear, {FINER} x" + (f"; {rows} pulses, seconds times {case.n / rows:.0f}" if rows < case.n else "")
    check = _exact.backproject(raw, case.grid.at(*case.at))
    return [Contestant("NumPy", "one thread", "direct", setting, run, check=check, share=rows / case.n)]
