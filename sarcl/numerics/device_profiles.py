"""Range profiles made on a device, from samples that were uploaded: kernels/range_profiles.cl and an FFT of rows."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..base import float_pairs
from ..opencl import fft
from ..opencl.device import Device
from .range_profiles import LARGEST

AT_ONCE = 2**22  # samples of rows that are transformed at a time: enough to fill a GPU
# An FFT of any length convolves with a chirp, whose sums are larger than those of the profile by length^1.5 at most.
SPARE = 1e10
WEIGHTS = 1e18  # largest weights of rows and of samples lie between one over this and this: pairs of float32 hold them


def possible(device: Device, length: int, dtype: type[np.complexfloating]) -> bool:
    """Whether profiles of this length and type are made on this device: where its FFT is."""
    return fft.on_device(device, length, dtype)


class DeviceProfiles:
    """Range profiles on a device where that is `possible`; range_profiles.from_samples makes the same on the host.

    length, pad, dtype  of a profile, as `from_samples` takes them
    Kernels and buffers are made with the first block, and kept.
    """

    def __init__(
        self, device: Device, sample_weight: np.ndarray, length: int, pad: int,
        dtype: type[np.complexfloating] = np.complex64,
    ) -> None:  # fmt: skip
        """sample_weight  (n_samples,): weights of the samples, with a `correction` among them"""
        self.device, self.length, self.pad, self.dtype = device, length, pad, dtype
        self.n_samples, self.stride = len(sample_weight), length + 2 * pad
        self._double = dtype == np.complex128
        self._largest = float(np.abs(sample_weight).max())
        self._across: Any = None
        self._sample_weight = sample_weight
        self._work: Any = None
        self._made: Any = None
        self._rows = 0

    def nbytes(self, rows: int) -> float:
        """Bytes on the device for the profiles of so many rows, and for the samples of two such blocks."""
        return float(rows * self._row_bytes + min(rows, self._at_once) * self._work_bytes)

    def rows_in(self, nbytes: float) -> int:
        """Rows whose `nbytes` are this at most."""
        rows = nbytes / (self._row_bytes + self._work_bytes)
        if rows > self._at_once:
            rows = (nbytes - self._at_once * self._work_bytes) / self._row_bytes
        return int(rows)

    def holds(self, samples: np.ndarray, row_weight: np.ndarray) -> bool:
        """Whether the device can sum samples (n, n_samples), finite, with weights (n,): by their types and sizes.

        A bound, several orders of magnitude below what the host can sum: what fails it, the host must do.
        """
        if samples.dtype == np.complex128:
            if not self.device.info.fp64:
                return False
        elif samples.dtype != np.complex64:
            return False
        along = float(np.abs(row_weight).max())
        if not all(1 / WEIGHTS <= w <= WEIGHTS for w in (along, self._largest)):
            return False
        parts = np.ascontiguousarray(samples).view(samples.real.dtype)
        largest = max(float(parts.max()), -float(parts.min()))
        return 1.5 * largest * along * self._largest * self.n_samples <= LARGEST[self.dtype] / SPARE

    def weights(self, row_weight: np.ndarray) -> np.ndarray:
        """Weights of rows (n,) as `make` takes them in a buffer."""
        return row_weight.astype(np.float64) if self._double else float_pairs.wide(row_weight)

    def make(self, samples: Any, kind: np.dtype[Any], row_weight: Any, rows: int) -> Any:
        """Enqueue the profiles (rows, length + 2 pad) of a block: their buffer, which the next block overwrites.

        samples     buffer (rows, n_samples) of `kind`, complex64 or complex128;  row_weight  buffer of `weights`
        """
        device = self.device
        macros = {"REAL64": int(self._double), "FROM64": int(kind == np.complex128)}
        weigh, pad = (device.kernel("range_profiles.cl", name, **macros) for name in ("weigh", "pad"))
        self._reserve(rows)
        batch = min(self._at_once, self._rows)
        for first in range(0, rows, batch):
            # the plan of the FFT is for whole batches: rows left over in the last one are transformed and not used
            count = min(batch, rows - first)
            device.run(
                weigh, (self.length, count), None,
                samples, self.n_samples, self._across, row_weight, rows, first, self._work,
            )  # fmt: skip
            fft.in_place(device, self._work, (batch, self.length), self.dtype)
            device.run(pad, (self.stride, count), None, self._work, self.length, self.pad, first, self._made)
        return self._made

    def _reserve(self, rows: int) -> None:
        """Buffers for blocks of so many rows."""
        if self._across is None:
            self._across = self.device.copied(self.weights(self._sample_weight))
        if rows > self._rows:
            size = np.dtype(self.dtype).itemsize
            self._made = self._work = None  # frees the smaller buffers first
            self._work = self.device.zeros(size * min(rows, self._at_once) * self.length)
            self._made = self.device.empty(size * rows * self.stride)
            self._rows = rows

    @property
    def _at_once(self) -> int:
        return max(1, AT_ONCE // self.length)

    @property
    def _row_bytes(self) -> float:
        return float(np.dtype(self.dtype).itemsize) * self.stride + 2 * 16.0 * self.n_samples

    @property
    def _work_bytes(self) -> float:
        return float(np.dtype(self.dtype).itemsize) * self.length + fft.temporary_bytes(self.length, self.dtype)
