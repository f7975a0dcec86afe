"""Samples that were uploaded, times weights and turned to other reference ranges on a device.

Kernels: kernels/weighted_samples.cl.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ..base import float_pairs
from ..opencl.device import Buffer, Device
from ..opencl.pipeline import SLOTS, Pipeline
from .range_profiles import LARGEST

# An FFT of any length convolves with a chirp, whose sums are larger than those of the samples by length^1.5 at most.
SPARE = 1e10
# Largest weights of rows and of samples are 0, or lie between one over this and this: pairs of float32 hold them.
WEIGHTS = 1e18
FAINT = 1e-25  # largest modulus of weighted samples below which the host looks whether complex64 loses digits of them
PARTS = 32  # sums per row of `energy`, as in kernels/weighted_samples.cl


def bound_of_held(
    device: Device,
    samples: np.ndarray,
    weights: tuple[float, float],
    n: int,
    dtype: type[np.complexfloating],
    largest: float | None = None,
) -> float | None:
    """A modulus that no finite sample times its weights exceeds; None where a device may not sum n of them in `dtype`.

    weights  largest of rows and of samples
    largest  modulus that no sample times its weight exceeds, the weight of its row apart, where one is known
    The limit is several orders of magnitude below what the host can sum: what exceeds it, the host must do.
    """
    if samples.dtype == np.complex128:
        if not device.info.fp64:
            return None
    elif samples.dtype != np.complex64:
        return None
    if not all(w == 0 or 1 / WEIGHTS <= w <= WEIGHTS for w in weights):
        return None
    if largest is None:
        parts = np.ascontiguousarray(samples).view(samples.real.dtype)
        # no modulus exceeds the largest part by more than sqrt(2)
        largest = 1.5 * weights[1] * max(float(parts.max()), -float(parts.min()))
    bound = largest * weights[0]
    return bound if bound * n <= LARGEST[dtype] / SPARE else None


class WeightedSamples:
    """Weighted samples complex64 on a device; their sums there, of all rows, are what it holds (`holds`).

    n_terms  samples that are summed in all
    """

    def __init__(self, device: Device, sample_weight: np.ndarray, n_rows: int, dtype: np.dtype[Any]) -> None:
        """sample_weight  (n_samples,);  dtype  of the samples"""
        self.device, self.n_samples, self.n_terms = device, len(sample_weight), n_rows * len(sample_weight)
        self._largest = float(np.abs(sample_weight).max())
        # of the samples, in memory for each of the blocks that are being uploaded, and of what is known of a row
        self.row_bytes = SLOTS * (dtype.itemsize * self.n_samples + 24.0)
        self._across = device.copied(float_pairs.wide(sample_weight))
        self._energies = device.kernel("weighted_samples.cl", "energies", FROM64=0)
        self._n_rows, self._scales = n_rows, np.zeros(n_rows)
        self._sums: Buffer | None = None

    def bound(self, samples: np.ndarray, row_weight: np.ndarray) -> float | None:
        """A modulus that no weighted sample of rows (n, n_samples) with weights (n,) exceeds; None: the host's rows.

        Those that the device may not sum, by their types and sizes, and faint ones: the host refuses samples whose
        digits complex64 does not hold (`check_digits`).
        """
        weights = float(np.abs(row_weight).max()), self._largest
        bound = bound_of_held(self.device, samples, weights, self.n_terms, np.complex64)
        return None if bound is not None and 0 < bound < FAINT else bound

    def make(
        self,
        pipeline: Pipeline,
        samples: np.ndarray,
        row_weight: np.ndarray,
        cycles: tuple[np.ndarray, np.ndarray],
        out: Buffer,
        first: int,
    ) -> None:
        """Upload samples (n, n_samples), and enqueue their weighting to rows `first` ... of a buffer (..., n_samples).

        cycles  of each row's first sample, and from one sample to the next, less whole ones, float64 (n,)
        """
        kernel = self.device.kernel("weighted_samples.cl", "weigh_and_turn", FROM64=int(samples.dtype == np.complex128))
        along = np.concatenate([float_pairs.wide(values) for values in (row_weight, *cycles)])
        self.device.run(
            kernel, (self.n_samples, len(samples)), None,
            pipeline.upload(np.ascontiguousarray(samples)), self._across, pipeline.upload(along), len(samples), first,
            out,
        )  # fmt: skip

    def add_energy(self, weighted: object, first: int, rows: slice, largest: float) -> None:
        """Enqueue the sums of squares of rows of a buffer of `make`, from row `first` on.

        rows  their numbers among all;  largest  a modulus that none exceeds
        """
        if self._sums is None:
            self._sums = self.device.zeros(4 * PARTS * self._n_rows)
        scale = 2.0 ** -np.clip(np.ceil(np.log2(largest)), -100, 100) if largest > 0 else 1.0
        self._scales[rows] = scale
        count = rows.stop - rows.start
        self.device.run(
            self._energies, (PARTS, count), None, weighted, self.n_samples, first, np.float32(scale), rows.start,
            self._sums, steps=-(-self.n_samples // PARTS),
        )  # fmt: skip

    def energy(self) -> float:
        """The sum of squares of the rows that were added, each counted once."""
        if self._sums is None:
            return 0.0
        sums = self.device.download(self._sums, np.empty((self._n_rows, PARTS), np.float32)).sum(axis=1, dtype=float)
        used_rows = self._scales > 0
        return float((sums[used_rows] / self._scales[used_rows] ** 2).sum())
