"""Norms of the rows of a task with their weights: the samples are read once, and norms kept with those in memory."""

from __future__ import annotations

from functools import partial
from weakref import WeakKeyDictionary

import numpy as np

from ..base.fingerprint import checksum
from ..base.threads import of_each, threads
from ..model.lazy_rows import is_constant
from ..model.phase_history import PhaseHistory
from .focusing_task import FocusingTask
from .kept_results import kept, per_task

ALL = 2**28  # samples up to which every row is read
IN_CACHE = 2**16  # samples whose squares are made at a time, so that they stay in a cache
OF_THREAD = 2**21  # samples in memory that a thread reads at least: starting it takes as long as reading fewer
TERMS32 = 128  # of sums of squares in float32, which are added up in float64
NORMS32 = 1e-12, 1e15  # norms of rows whose squares float32 holds, less those that do not matter

_kept: WeakKeyDictionary[PhaseHistory, dict[str, np.ndarray]] = WeakKeyDictionary()


@per_task
def row_norms(task: FocusingTask) -> np.ndarray:
    """Norm of the samples of each row with their weights, (n_rows,) float64.

    Of more than 2^28 samples (2 GiB), only every n-th row is read, and its norm is used up to the next one.
    """
    return _without_row_weights(task) * task.row_weight


def largest_sample(task: FocusingTask) -> float | None:
    """A modulus that no sample times its `sample_weight` exceeds, to rounding; None where samples may change.

    It is the largest norm of a row, and so up to sqrt(n_samples) times as large as the largest sample.
    """
    if not is_constant(task.raw.samples):
        return None
    if _every(task.raw) == 1:
        return float(_without_row_weights(task).max())
    part = task.raw.largest_part
    return None if part is None else float(np.sqrt(2) * part * np.abs(task.sample_weight).max())


def _every(raw: PhaseHistory) -> int:
    """Every n-th row is read: n."""
    return -(-raw.n_rows * raw.n_samples // ALL)


@per_task
def _without_row_weights(task: FocusingTask) -> np.ndarray:
    """Norms of rows with the weights of the samples alone, (n_rows,)."""
    if not is_constant(task.raw.samples):
        return _norms(task.raw, task.sample_weight)
    key = checksum(task.sample_weight)
    return kept(_kept.setdefault(task.raw, {}), key, lambda: _norms(task.raw, task.sample_weight))


def _norms(raw: PhaseHistory, sample_weight: np.ndarray) -> np.ndarray:
    """Norms of rows with weights (n_samples,) of their samples, (n_rows,)."""
    every, out = _every(raw), np.empty(raw.n_rows)
    scale, weight = np.abs(sample_weight), None
    if (scale != scale[0]).any():
        weight, scale = np.repeat(scale, 2), np.ones(1)
    step = max(1, min(64, 2**20 // raw.n_samples)) if every == 1 else 1
    starts = range(0, raw.n_rows, step * every)
    # of files one thread reads one row after another
    parts = min(threads(), -(-raw.n_rows * raw.n_samples // OF_THREAD)) if is_constant(raw.samples) else 1
    of_each(partial(_fill_norms, raw, weight, step, every, out), [starts[n::parts] for n in range(parts)])
    return out * scale[0]


def _fill_norms(
    raw: PhaseHistory, weight: np.ndarray | None, step: int, every: int, out: np.ndarray, starts: range
) -> None:
    """Write to `out` the norms of rows from each of `starts` on: of `step` rows, or of one for `every` rows."""
    weights = None
    if weight is not None:
        with np.errstate(over="ignore"):
            weights = weight**2, weight.astype(np.float32)
    at_once = max(1, IN_CACHE // raw.n_samples)
    for start in starts:
        samples = np.ascontiguousarray(raw.read(start, min(start + step, raw.n_rows)))
        norm = np.concatenate([_weighted_norms(samples[at : at + at_once], weights) for at in range(0, step, at_once)])
        out[start : start + step * every] = norm if every == 1 else norm[0]


def _weighted_norms(samples: np.ndarray, weights: tuple[np.ndarray, np.ndarray] | None) -> np.ndarray:
    """Norms of rows (n, n_samples), float64.

    weights  (2 n_samples,) on the squares of real and imaginary parts, float64, and on the parts, float32; None: 1
    """
    real_and_imaginary = samples.view(samples.real.dtype)
    n, width = real_and_imaginary.shape
    if real_and_imaginary.dtype == np.float32 and width >= 8 * TERMS32:  # of fewer terms roundings would be seen
        with np.errstate(over="ignore", invalid="ignore"):
            padded = real_and_imaginary
            if weights is not None or width % TERMS32:
                padded = np.zeros((n, -(-width // TERMS32) * TERMS32), np.float32)
                np.multiply(real_and_imaginary, 1 if weights is None else weights[1], out=padded[:, :width])
            parts = padded.reshape(n, padded.shape[1] // TERMS32, TERMS32)
            norms = np.sqrt(np.einsum("ijk,ijk->ij", parts, parts).sum(axis=1, dtype=np.float64))
        if (norms > NORMS32[0]).all() and (norms < NORMS32[1]).all():
            return np.asarray(norms)
    largest = max(float(real_and_imaginary.max(initial=0.0)), -float(real_and_imaginary.min(initial=0.0)))
    parts = real_and_imaginary.astype(np.float64)
    if 1e-100 < largest < 1e100:
        largest = 1.0
    elif largest:  # squares leave the range of float64
        parts /= largest
    np.square(parts, out=parts)
    # einsum, because BLAS starts its threads for a single row
    power = parts.sum(axis=1) if weights is None else np.einsum("ij,j->i", parts, weights[0])
    return np.asarray(largest * np.sqrt(power))
