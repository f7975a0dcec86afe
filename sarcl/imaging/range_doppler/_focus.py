"""The work of a range-Doppler image: azimuth FFT, secondary range compression, migration, azimuth compression.

    X(q, n)   azimuth FFT of the rows, Doppler bin q and frequency n
    I(q, r)   sum_n X(q, n) H(q, n) exp(+j (4 pi/c) [r sqrt(f_n^2 - b^2) - r_0 f_n]),   b = c f_q/(2 v(r))
    I(u, r)   inverse azimuth FFT of I(q, r)

H has the amplitude of the stationary phase and the taper of the Doppler band. The square root is taken as its value
and slope at the centre frequency, exactly for every column (azimuth compression and migration), and the rest, between
some slant ranges (secondary range compression). Transforms along the track are FFTs, or sums over the bins themselves:
a few rows within a Fresnel zone have few Doppler bins, which only an FFT of very many samples resolves.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import numpy as np

from ...base import host_memory
from ...base.stage_timer import Clock
from ...numerics import range_profiles
from ...opencl import fft
from ._bins import Bins
from ._focus_on_device import focus_on_device
from ._host_rows import ARRAYS, Budget, Job, referenced
from ._plan import FocusPlan

PIECE = 64  # rows that are made, and columns that are transformed, at a time, for the cache
TERMS = 1024  # terms of a sum in complex64, before it is added to a total in complex128


def focus(job: Job, clock: Clock, on_progress: Callable[[float], None]) -> np.ndarray:
    """The image complex64 (times, ranges), from the rows times weights of samples and of rows.

    MemoryError where neither memory nor temporary files hold the rows, their spectra or the compressed bins.
    """
    device, plan, budget = job.device, job.plan, job.budget
    if not device.is_cpu and not plan.far_fewer(job.raw.n_rows):
        image = focus_on_device(job, clock, on_progress)
        if image is not None:
            return image
    rows = _rows(job)
    clock.lap("samples")
    spectra = Spectra(plan, rows, budget)
    del rows
    clock.lap("fft")
    on_progress(0.3)
    bins = Bins(device, plan, job.raw, job.track)
    compressed = ImageRows(plan, budget)
    at_once = bins.at_once(budget.device)
    for start in range(0, len(plan.bins), at_once):
        numbers = plan.bins[start : start + at_once]
        for columns, values in bins.compressed(spectra.at(numbers), numbers):
            compressed.add(numbers, columns, values)
        clock.lap("migration")
        on_progress(0.3 + 0.5 * (start + len(numbers)) / len(plan.bins))
    del spectra
    image = compressed.rows(bins.level(plan.ranges))
    clock.lap("fft")
    on_progress(1.0)
    return image


def _rows(job: Job) -> np.ndarray:
    """The rows, weighted, all with the reference range plan.center: complex64 (n_rows, n_samples)."""
    n_rows = job.raw.n_rows
    rows = host_memory.zeros((n_rows, job.raw.n_samples), job.budget.host / ARRAYS, "rows of samples")
    largest = 0.0
    for start in range(0, n_rows, PIECE):
        rows[start : start + PIECE], modulus = referenced(job, start, min(start + PIECE, n_rows))
        largest = max(largest, modulus)
    range_profiles.check_digits(largest)
    return rows


class Spectra:
    """FFT of the rows along the track, at the plan's Doppler bins.

    rows  complex64 (n_rows, n_samples), all with the reference range plan.center
    MemoryError where neither memory nor temporary files hold the spectra.
    """

    def __init__(self, plan: FocusPlan, rows: np.ndarray, budget: Budget) -> None:
        self.plan, self._rows = plan, rows
        self._spectra: np.ndarray | None = None
        if not plan.sums_pay(len(rows), plan.length):
            self._spectra = _spectra(plan, rows, budget)
            del self._rows

    def at(self, numbers: np.ndarray) -> np.ndarray:
        """Spectra complex64 (n, n_samples) of Doppler bins (n,)."""
        if self._spectra is not None:
            return np.asarray(self._spectra[numbers % self.plan.length])
        places = np.arange(len(self._rows))
        return sums(self._rows, places, numbers, self.plan.length, -1).astype(np.complex64)


class ImageRows:
    """Rows of an image, of which Doppler bins are added one after the other."""

    def __init__(self, plan: FocusPlan, budget: Budget) -> None:
        self.plan, self._budget = plan, budget
        self._period = plan.length * plan.finer
        shape = len(plan.times), len(plan.ranges)
        self._by_sums = plan.sums_pay(shape[0], self._period)
        if self._by_sums:
            self._totals = np.zeros(shape, np.complex128)
        else:
            self._totals = host_memory.zeros(
                (self._period, shape[1]), budget.host / ARRAYS, "Doppler bins of the columns"
            )

    def add(self, numbers: np.ndarray, columns: slice, values: np.ndarray) -> None:
        """Add values complex64 (n, n_columns) of Doppler bins (n,) in some columns."""
        period = self._period
        if self._by_sums:
            self._totals[:, columns] += sums(values, numbers, np.arange(len(self._totals)), period, 1)
            return
        for a, b in _pieces(numbers, period):
            self._totals[numbers[a] % period : numbers[a] % period + b - a, columns] += values[a:b]

    def rows(self, level: np.ndarray) -> np.ndarray:
        """The image complex64 (times, ranges), times a level of each column."""
        level = level.astype(np.complex64)
        if self._by_sums:
            return (self._totals * level).astype(np.complex64)
        n_times, n_ranges = len(self.plan.times), len(self.plan.ranges)
        image = np.empty((n_times, n_ranges), np.complex64)
        width = _columns(self._totals, self._budget)
        for start in range(0, n_ranges, width):
            columns = slice(start, start + width)
            profiles = fft.rows(None, np.ascontiguousarray(self._totals[:, columns].T), inverse=True)
            image[:, columns] = profiles[:, :n_times].T * level[columns]
        return image


def sums(values: np.ndarray, places: np.ndarray, wanted: np.ndarray, period: int, sign: int) -> np.ndarray:
    """sum_i values[i] exp(sign j 2 pi places[i] wanted[k]/period), complex128 (len(wanted), n_columns).

    places, wanted  whole numbers
    """
    total = np.zeros((len(wanted), values.shape[1]), np.complex128)
    for start in range(0, len(places), TERMS):
        terms = slice(start, start + TERMS)
        cycles = np.outer(wanted, places[terms]) % period / period
        total += np.exp(sign * 2j * np.pi * cycles).astype(np.complex64) @ values[terms]
    return total


def _spectra(plan: FocusPlan, rows: np.ndarray, budget: Budget) -> np.ndarray:
    """FFT of the rows, complex64 (length, n_samples).

    A track longer than the FFT is folded: the plan's length keeps what is folded out of the pixels' Doppler band.
    """
    n_rows, n_samples = rows.shape
    out = host_memory.zeros((plan.length, n_samples), budget.host / ARRAYS, "spectra along the track")
    width = _columns(out, budget)
    for start in range(0, n_samples, width):
        columns = slice(start, start + width)
        part = np.zeros((len(rows[0, columns]), plan.length), np.complex64)
        for first in range(0, n_rows, plan.length):
            piece = rows[first : first + plan.length, columns].T
            part[:, : piece.shape[1]] += piece
        out[:, columns] = fft.rows(None, part).T
    return out


def _columns(array: np.ndarray, budget: Budget) -> int:
    """Columns that are transformed at a time: few for the cache, more where each pass reads a file again."""
    return max(PIECE, int(budget.host / (32 * len(array)))) if isinstance(array, np.memmap) else PIECE


def _pieces(numbers: np.ndarray, period: int) -> list[tuple[int, int]]:
    """Runs of consecutive Doppler bins that do not cross a multiple of the period."""
    breaks = np.flatnonzero(numbers % period == 0)
    edges = np.unique(np.concatenate([[0], breaks, [len(numbers)]]))
    return [(int(a), int(b)) for a, b in pairwise(edges)]
