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

import numpy as np

from ...base import host_memory
from ...base.stage_timer import Clock
from ...numerics import range_profiles
from ._along_track import ImageRows, Spectra
from ._bins import Bins
from ._focus_on_device import focus_on_device
from ._host_rows import ARRAYS, Job, referenced

PIECE = 64  # rows that are made at a time, for the cache


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
