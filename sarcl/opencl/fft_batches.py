"""Rows that a device transforms some at a time, all in one buffer."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from . import fft
from .device import Device


class Batches:
    """Rows of a block that are transformed at a time, in one buffer.

    most       rows at a time;  row_bytes  of the buffer, and of what the FFT takes beside it, per row
    All transforms are of whole batches, because each number of rows would need an FFT program of its own: of the last
    batch some rows are not used.
    """

    def __init__(
        self, device: Device, length: int, dtype: type[np.complexfloating], nbytes: float = float("inf")
    ) -> None:
        """nbytes  for the buffer and the FFT; one row is transformed at a time where they are too few for more"""
        self.device, self.length, self.dtype = device, length, dtype
        self.row_bytes = float(np.dtype(dtype).itemsize) * length + fft.temporary_bytes(length, dtype)
        self.most = max(1, int(min(fft.rows_at_once(device, length), nbytes / self.row_bytes)))
        self._rows = 0
        self._work: Any = None

    def nbytes(self, rows: int) -> float:
        """Bytes on the device for blocks of so many rows."""
        return self.row_bytes * min(rows, self.most)

    def reserve(self, rows: int) -> bool:
        """Make room for blocks of so many rows; whether there was less before."""
        if rows <= self._rows:
            return False
        self._work = None
        self._work = self.device.zeros(np.dtype(self.dtype).itemsize * min(rows, self.most) * self.length)
        self._rows = rows
        return True

    def of(self, rows: int) -> Iterator[tuple[int, int, Any]]:
        """(first row, number of rows, buffer) of each batch of a block."""
        for first in range(0, rows, self.most):
            yield first, min(self.most, rows - first), self._work

    def transform(self) -> None:
        """Enqueue the FFT of all rows of the buffer."""
        fft.in_place(self.device, self._work, (min(self._rows, self.most), self.length), self.dtype)
