"""The last steps of a nonuniform FFT: from a grid of wavenumbers on a device to the image, there or on the host.

Both transform the grid along its rows as bands of them are added, keep the columns of the image, transform along the
columns, and divide by the transform of the interpolation kernel.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ..opencl import fft
from ..opencl.device import Buffer, Device
from .transforms import Transforms

WORK = 1 / 6  # largest share of a budget for the rows, or columns, that are transformed at a time


class OnHost:
    """Bands of the grid are downloaded; scipy.fft and NumPy make the image."""

    nbytes = 0.0
    whole = False

    def __init__(self, device: Device, length: tuple[int, int], flat: list[np.ndarray]) -> None:
        """flat  factors of the rows and of the columns of the image, one over the kernel's transform"""
        self.device, self.length, self.flat = device, length, [f.astype(np.float32) for f in flat]
        self._half: np.ndarray | None = None  # columns of the image, rows of the grid

    def across(self, tile: int) -> float:
        """Bytes on the device for a row of tiles of the grid."""
        return 8.0 * self.length[1] * tile

    def add(self, grid: Buffer, first: int, rows: int) -> None:
        """Rows first ... of the grid, in a buffer (rows, length[1])."""
        if self._half is None:
            self._half = np.empty((len(self.flat[1]), self.length[0]), np.complex64)
        band = self.device.download(grid, np.empty((rows, self.length[1]), np.complex64))
        _transposed(fft.rows(None, band, inverse=True), self._half[:, first : first + rows])

    def image(self) -> np.ndarray:
        """The image complex64, after all rows of the grid."""
        assert self._half is not None
        image = np.empty((len(self.flat[0]), len(self.flat[1])), np.complex64)
        _transposed(fft.rows(None, self._half, inverse=True), image)
        image *= self.flat[0][:, None]
        image *= self.flat[1]
        return image


class OnDevice:
    """The device transforms. Where it holds all (`whole`), nothing but the image is downloaded.

    Else its columns before the second transform go through the memory of the host.
    nbytes  on the device, beside bands of the grid: what is transformed at a time, whose programs keep what they take,
            and the columns where they stay
    """

    def __init__(
        self, device: Device, length: tuple[int, int], flat: list[np.ndarray], work: float, whole: bool
    ) -> None:
        """work  bytes, at most, for the rows that are transformed at a time, and once more for where they come from"""
        self.device, self.length, self.flat, self.whole = device, length, flat, whole
        self.shape = len(flat[0]), len(flat[1])
        self._work = work
        self._grid: Buffer | None = None
        along, across = (Transforms(device, m, m, work).nbytes for m in length)
        self.nbytes = along + across + (8.0 * self.shape[1] * length[0] if whole else 0.0)
        self._flat = [device.copied(f.astype(np.float32)) for f in flat]
        self._transforms: Any = None
        self._half: Any = None

    @staticmethod
    def possible(device: Device, length: tuple[int, int], work: float) -> bool:
        """Whether the device transforms, and `work` bytes hold a row."""
        longest = max(length)
        row = 8.0 * longest + fft.temporary_bytes(longest, np.complex64)
        return fft.on_device(device, longest, np.complex64) and row <= work

    def across(self, tile: int) -> float:
        """Bytes on the device for a row of tiles of the grid, and for its part of the columns that are downloaded."""
        return 8.0 * tile * (self.length[1] + (0 if self.whole else self.shape[1]))

    def add(self, grid: Buffer, first: int, rows: int) -> None:
        """Rows first ... of the grid, in a buffer (rows, length[1]) that is kept where all stays on the device."""
        device, columns = self.device, self.shape[1]
        if self._transforms is None:
            self._transforms = Transforms(device, self.length[1], self.length[0], self._work)
            size = (columns, self.length[0])
            self._half = device.empty(8 * columns * self.length[0]) if self.whole else np.empty(size, np.complex64)
        band, stride, start = self._half, self.length[0], first
        if self.whole:
            self._grid = grid
        else:
            band, stride, start = device.empty(8 * columns * rows), rows, 0
        transforms = self._transforms
        for row in range(0, rows, transforms.most):
            count = min(transforms.most, rows - row)
            transforms.rows(grid, row, count)
            transforms.lay(band, stride, start + row, count, (self._flat[1], columns), columns // 2, -1)
        if not self.whole:
            self._half[:, first : first + rows] = device.download(band, np.empty((columns, rows), np.complex64))

    def image(self) -> np.ndarray:
        """The image complex64, after all rows of the grid."""
        device, (rows, columns) = self.device, self.shape
        self._transforms = None  # frees its buffer
        transforms = Transforms(device, self.length[0], columns, self._work)
        weights = (self._flat[0], rows)
        image = np.empty(self.shape, np.complex64)
        if self.whole:
            for first in range(0, columns, transforms.most):
                count = min(transforms.most, columns - first)
                transforms.rows(self._half, first, count)
                transforms.lay(self._grid, columns, first, count, weights, rows // 2, -1)
            return device.download(self._grid, image)
        for first in range(0, columns, transforms.most):
            part = self._half[first : first + transforms.most]
            transforms.rows(device.upload(part), 0, len(part))
            out = device.empty(8 * rows * len(part))
            transforms.lay(out, len(part), 0, len(part), weights, rows // 2, -1)
            image[:, first : first + len(part)] = device.download(out, np.empty((rows, len(part)), np.complex64))
        return image


def _transposed(wave: np.ndarray, out: np.ndarray) -> None:
    """Transpose columns -n//2 ... of a spectrum (m, ...) into `out` (n, m), a few rows at a time for the cache."""
    low = len(out) // 2
    for start in range(0, len(wave), 32):
        part = slice(start, start + 32)
        out[:low, part] = wave[part, wave.shape[1] - low :].T
        out[low:, part] = wave[part, : len(out) - low].T
