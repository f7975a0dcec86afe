"""Range profiles made on a device from samples that were uploaded, and samples from profiles that were spread there.

Kernels: kernels/range_profiles.cl, before and after an FFT of rows.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ..base import float_pairs
from ..opencl import fft
from ..opencl.device import Device
from ..opencl.fft_batches import Batches
from ..opencl.launch_numbers import launch_numbers
from . import range_profiles
from .interpolation import Interpolator
from .weighted_samples import bound_of_held

if TYPE_CHECKING:
    from ..opencl.device import Buffer


SINGLE = {"REAL64": 0, "FROM64": 0}  # macros of the kernels


def possible(device: Device, length: int, dtype: type[np.complexfloating]) -> bool:
    """Whether profiles of this length and type are made on this device: where its FFT is."""
    return fft.on_device(device, length, dtype)


class DeviceProfiles:
    """Range profiles on a device where that is `possible`; range_profiles.from_samples makes the same on the host.

    length, pad, dtype  of a profile, as `from_samples` takes them
    Kernels and buffers are made with the first block, and kept.
    """

    def __init__(
        self,
        device: Device,
        sample_weight: np.ndarray,
        length: int,
        pad: int,
        dtype: type[np.complexfloating] = np.complex64,
    ) -> None:
        """sample_weight  (n_samples,): weights of the samples, with a `correction` among them"""
        self.device, self.length, self.pad, self.dtype = device, length, pad, dtype
        self.n_samples, self.stride = len(sample_weight), length + 2 * pad
        self._double = dtype == np.complex128
        self._largest = float(np.abs(sample_weight).max())
        self._sample_weight = sample_weight
        self._across: Buffer | None = None
        self._made: Any = None
        self._batches = Batches(device, length, dtype)

    def nbytes(self, rows: int) -> float:
        """Bytes on the device for the profiles of so many rows, and for the samples of two such blocks."""
        return float(rows * self._row_bytes + min(rows, self._batches.most) * self._batches.row_bytes)

    def rows_in(self, nbytes: float) -> int:
        """Rows whose `nbytes` are this at most."""
        work, most = self._batches.row_bytes, self._batches.most
        rows = nbytes / (self._row_bytes + work)
        if rows > most:
            rows = (nbytes - most * work) / self._row_bytes
        return int(rows)

    def holds(self, samples: np.ndarray, row_weight: np.ndarray, largest: float | None = None) -> bool:
        """Whether the device can sum samples (n, n_samples), finite, with weights (n,): by their types and sizes.

        largest  modulus that no sample times its `sample_weight` exceeds, where one is known
        A bound, several orders of magnitude below what the host can sum: what fails it, the host must do.
        """
        weights = float(np.abs(row_weight).max()), self._largest
        return bound_of_held(self.device, samples, weights, self.n_samples, self.dtype, largest) is not None

    def weights(self, row_weight: np.ndarray) -> np.ndarray:
        """Weights of rows (n,) as `make` takes them in a buffer."""
        return row_weight.astype(np.float64) if self._double else float_pairs.wide(row_weight)

    def make(self, samples: Buffer, kind: np.dtype[Any], row_weight: Buffer, rows: int) -> Buffer:
        """Enqueue the profiles (rows, length + 2 pad) of a block: their buffer, which the next block overwrites.

        samples     buffer (rows, n_samples) of `kind`, complex64 or complex128;  row_weight  buffer of `weights`
        """
        device = self.device
        macros = {"REAL64": int(self._double), "FROM64": int(kind == np.complex128)}
        weigh, pad = (device.kernel("range_profiles.cl", name, **macros) for name in ("weigh", "pad"))
        if self._across is None:
            self._across = device.copied(self.weights(self._sample_weight))
        if self._batches.reserve(rows):
            self._made = None  # frees the smaller buffer first
            self._made = device.empty(np.dtype(self.dtype).itemsize * rows * self.stride)
        for first, count, work in self._batches.of(rows):
            device.run(
                weigh, (self.length, count), None,
                samples, self.n_samples, self._across, row_weight, rows, first, work,
            )  # fmt: skip
            self._batches.transform()
            device.run(pad, (self.stride, count), None, work, self.length, self.pad, first, self._made)
        return self._made

    @property
    def _row_bytes(self) -> float:
        return float(np.dtype(self.dtype).itemsize) * self.stride + 2 * 16.0 * self.n_samples


class SpreadSamples:
    """Samples complex64 of profiles that were spread on a device: the adjoint of `DeviceProfiles`.

    Where the device transforms rows, the samples alone are downloaded; on a CPU range_profiles.to_samples makes them.
    """

    def __init__(self, device: Device, n_samples: int, interpolator: Interpolator, length: int) -> None:
        self.device, self.n_samples, self.interpolator, self.length = device, n_samples, interpolator, length
        self.pad = range_profiles.padding(interpolator)
        self._batches = Batches(device, length, np.complex64) if possible(device, length, np.complex64) else None
        self._correction: Buffer | None = None
        self._out: Buffer | None = None

    @property
    def row_bytes(self) -> float:
        """Bytes on the device per row, beside the profiles themselves, at most."""
        return self._batches.row_bytes + 8.0 * self.n_samples if self._batches else 0.0

    def of(self, sums: Buffer, parts: int, rows: int, planes: int = 3) -> np.ndarray:
        """Samples (rows, n_samples) of a buffer (parts, rows, planes, length + 2 padding), complex64.

        A profile is the sum of all parts, and of the last two planes of each: a total and its rest.
        """
        device = self.device
        if self._batches is None:
            stride = self.length + 2 * self.pad
            profiles = device.download(sums, np.empty((parts, rows, planes, stride), np.complex64))
            total = profiles[:, :, -2:].sum(axis=(0, 2), dtype=np.complex128).astype(np.complex64)
            return range_profiles.to_samples(device, total, self.n_samples, self.interpolator)
        fold, cut = (device.kernel("range_profiles.cl", name, **SINGLE) for name in ("fold", "cut"))
        if self._correction is None:
            correction = range_profiles.correction(self.interpolator, self.n_samples, self.length)
            self._correction = device.copied(correction.astype(np.float32))
        if self._batches.reserve(rows):
            self._out = None
            self._out = device.empty(8 * rows * self.n_samples)
        for first, count, work in self._batches.of(rows):
            numbers = launch_numbers(
                "range_profiles.cl", "fold", parts=parts, n_rows=rows, planes=planes, padding=self.pad, first=first
            )
            device.run(fold, (self.length, count), None, numbers, sums, work)
            self._batches.transform()
            device.run(cut, (self.n_samples, count), None, work, self.length, self._correction, first, self._out)
        return device.download(self._out, np.empty((rows, self.n_samples), np.complex64))
