"""How much of the rows' energy the pixels see: errors scale with the first, a tolerance with the second."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from . import fft
from .check import SPEED_OF_LIGHT
from .precise_accuracy import kernel
from .task import Task

ROWS, PIXELS, MOST = 16, 256, 2**18
TAPS, FINER, TERMS = 12, 4.0, 6  # of a kernel that errs by 1e-11


@dataclass(frozen=True)
class Energy:
    """Root mean square of range profiles, relative to that at the pixels themselves.

    near    around the pixels' places: interpolation errs in proportion to it
    whole   over whole profiles: rounding of transforms errs in proportion to it
    """

    near: float
    whole: float


def seen(task: Task) -> Energy:
    """Estimate from up to 16 rows and 256 pixels spread over the grid, exact to 1e-11 of a row's amplitude at a null.

    Energy(1, 1) where no pixel sees anything.
    """
    raw, grid = task.raw, task.grid
    count = min(ROWS, raw.n_rows, max(1, MOST // raw.n_samples))
    rows = np.unique(np.linspace(0, raw.n_rows - 1, count).astype(int))
    _, x = grid.sample(PIXELS, seed=1)
    read = [raw.read(int(r), int(r) + 1)[0] * (task.sample_weight * task.row_weight[r]) for r in rows]
    scale = max(1e-290, *(float(np.abs(samples).max()) for samples in read))  # squares of huge samples overflow
    n = raw.n_samples
    k = np.arange(n) - n // 2
    length = fft.good_length(max(4 * n, 48))
    shaped = 1 / kernel(TAPS, FINER, TERMS).transform(k / length)
    at = near = whole = 0.0
    for row, samples in zip(rows, read, strict=True):
        turns, lit = _delays(task, x, int(row))
        values, close, all_of_it = _read(samples / scale, shaped, length, turns[lit])
        at, near, whole = at + values, near + close, whole + all_of_it * int(lit.sum())
    if whole == 0:
        return Energy(1.0, 1.0)
    floor = 1e-20 * whole  # every pixel of every row at an exact null: no more can be told
    return Energy(float(np.sqrt(near / max(at, floor))), float(np.sqrt(whole / max(at, floor))))


def share(task: Task) -> float:
    """Share of (row, pixel) pairs in the row's range window and beam, estimated from 64 rows and 256 pixels."""
    _, x = task.grid.sample(PIXELS, seed=1)
    rows = np.unique(np.linspace(0, task.raw.n_rows - 1, 64).astype(int))
    return float(np.mean([_delays(task, x, int(row))[1].mean() for row in rows]))


def _delays(task: Task, x: np.ndarray, row: int) -> tuple[np.ndarray, np.ndarray]:
    """Delays of points, m (m, 3), in turns of a row's window, and whether the row sees them."""
    raw = task.raw
    half = sum(np.linalg.norm(x - end[row], axis=1) for end in (raw.tx, raw.rx)) / 2
    turns = 2 * raw.frequency_step[row] / SPEED_OF_LIGHT * (half - raw.reference_range[row])
    lit = np.full(len(x), True) if task.wrap else np.abs(turns) <= 0.5
    if task.antennas.beam is not None:
        lit &= task.antennas.beam_depth(x, row) >= 0
    return turns, lit


def _read(samples: np.ndarray, shaped: np.ndarray, length: int, turns: np.ndarray) -> tuple[float, float, float]:
    """Power of a profile at delays (m,), in turns of the window, added up; around them; and its mean.

    shaped  (n_samples,): what makes up for the kernel's transform
    """
    made, n = kernel(TAPS, FINER, TERMS), len(samples)
    k = np.arange(n) - n // 2
    spectrum = np.zeros(length, np.complex128)
    spectrum[k] = samples * shaped
    profile = np.fft.ifft(spectrum) * length
    spectrum[k] = samples
    power = np.abs(np.fft.ifft(spectrum) * length) ** 2
    place = turns * length - (made.taps - 1) / 2
    first = np.rint(place).astype(np.int64)
    taps = (first[:, None] + np.arange(made.taps)) % length
    values = (made.weights(place - first) * profile[taps]).sum(axis=1)
    # what a kernel reads, and a sample more on each side
    around = (first[:, None] + np.arange(-1, made.taps + 1)) % length
    return float((np.abs(values) ** 2).sum()), float(power[around].mean(axis=1).sum()), float(power.mean())
