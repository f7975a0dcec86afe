"""The work of a range-Doppler image: azimuth FFT, secondary range compression, migration, azimuth compression.

    X(q, n)   azimuth FFT of the rows, Doppler bin q and frequency n
    I(q, r)   sum_n X(q, n) H(q, n) exp(+j (4 pi/c) [r sqrt(f_n^2 - b^2) - r_0 f_n]),   b = c f_q/(2 v(r))
    I(u, r)   inverse azimuth FFT of I(q, r)

H has the amplitude of the stationary phase and the taper of the Doppler band. The square root is taken as its value
and slope at the centre frequency, exactly for every column (azimuth compression and migration), and the rest, between
some slant ranges (secondary range compression).
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import numpy as np

from ...base import host_memory
from ...base.stage_timer import Clock
from ...model.phase_history import PhaseHistory
from ...numerics import range_profiles
from ...opencl import fft
from ...opencl.device import Device
from ._bins import Bins
from ._focus_on_device import focus_on_device
from ._host_rows import ARRAYS, Budget, referenced
from ._plan import FocusPlan
from ._track import Track

PIECE = 64  # rows that are transposed at a time, for the cache


def focus(
    device: Device, plan: FocusPlan, raw: PhaseHistory, track: Track, weights: tuple[np.ndarray, np.ndarray],
    budget: Budget, clock: Clock, on_progress: Callable[[float], None],
) -> np.ndarray:  # fmt: skip
    """The image complex64 (times, ranges), from the rows times weights of samples and of rows.

    MemoryError where neither memory nor temporary files hold the rows, their spectra or the compressed bins.
    """
    if not device.is_cpu:
        made = focus_on_device(device, plan, raw, track, weights, budget, clock, on_progress)
        if made is not None:
            return made
    spectra = _azimuth_spectra(plan, raw, weights, budget, clock)
    on_progress(0.3)
    bins = Bins(device, plan, raw, track)
    n_times, n_ranges = len(plan.times), len(plan.ranges)
    period = plan.length * plan.finer
    folded = host_memory.zeros((period, n_ranges), budget.host / ARRAYS, "Doppler bins of the columns")
    at_once = bins.at_once(budget.device)
    for start in range(0, len(plan.bins), at_once):
        numbers = plan.bins[start : start + at_once]
        chosen = spectra[numbers % plan.length]
        for columns, made in bins.compressed(chosen, numbers):
            for a, b in _pieces(numbers, period):
                folded[numbers[a] % period : numbers[a] % period + b - a, columns] += made[a:b]
        clock.lap("migration")
        on_progress(0.3 + 0.5 * (start + len(numbers)) / len(plan.bins))
    del spectra
    image = np.empty((n_times, n_ranges), np.complex64)
    level = bins.level(plan.ranges).astype(np.complex64)
    width = _columns(folded, budget)
    for start in range(0, n_ranges, width):
        columns = slice(start, start + width)
        made = fft.rows(None, np.ascontiguousarray(folded[:, columns].T), inverse=True)
        image[:, columns] = made[:, :n_times].T * level[columns]
    clock.lap("fft")
    on_progress(1.0)
    return image


def _columns(held: np.ndarray, budget: Budget) -> int:
    """Columns that are transformed at a time: few for the cache, more where each pass reads a file again."""
    return max(PIECE, int(budget.host / (32 * len(held)))) if isinstance(held, np.memmap) else PIECE


def _pieces(numbers: np.ndarray, period: int) -> list[tuple[int, int]]:
    """Runs of consecutive Doppler bins that do not cross a multiple of the period."""
    breaks = np.flatnonzero(numbers % period == 0)
    edges = np.unique(np.concatenate([[0], breaks, [len(numbers)]]))
    return [(int(a), int(b)) for a, b in pairwise(edges)]


def _azimuth_spectra(
    plan: FocusPlan, raw: PhaseHistory, weights: tuple[np.ndarray, np.ndarray], budget: Budget,
    clock: Clock,
) -> np.ndarray:  # fmt: skip
    """FFT of the rows along the track, all with the reference range plan.center: complex64 (length, n_samples).

    A track longer than the FFT is folded: the plan's length keeps what is folded out of the pixels' Doppler band.
    """
    rows = host_memory.zeros((raw.n_rows, raw.n_samples), budget.host / ARRAYS, "rows of samples")
    largest = 0.0
    for start in range(0, raw.n_rows, PIECE):
        made, here = referenced(raw, start, min(start + PIECE, raw.n_rows), plan.center, weights)
        rows[start : start + PIECE] = made
        largest = max(largest, here)
    range_profiles.check_digits(largest)
    clock.lap("samples")
    out = host_memory.zeros((plan.length, raw.n_samples), budget.host / ARRAYS, "spectra along the track")
    width = _columns(out, budget)
    for start in range(0, raw.n_samples, width):
        columns = slice(start, start + width)
        part = np.zeros((len(rows[0, columns]), plan.length), np.complex64)
        for first in range(0, raw.n_rows, plan.length):
            piece = rows[first : first + plan.length, columns].T
            part[:, : piece.shape[1]] += piece
        out[:, columns] = fft.rows(None, part).T
    clock.lap("fft")
    return out
