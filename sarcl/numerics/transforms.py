"""FFTs of the rows or columns of arrays that are on a device; the transforms become columns of another array there.

Kernels: kernels/transposition.cl, before and after an FFT of rows.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ..opencl.device import Device
from ..opencl.fft_batches import Batches
from ..opencl.launch_numbers import launch_numbers

if TYPE_CHECKING:
    from ..opencl.device import Buffer


ACROSS = 8  # work-items of a group along each axis, as in kernels/transposition.cl


class Transforms:
    """FFTs of one length, not normalised, of arrays complex64 on a device that makes them itself (fft.on_device).

    most    rows or columns at a time: `rows` or `columns`, then `lay`
    nbytes  on the device
    """

    def __init__(self, device: Device, length: int, count: int, nbytes: float = float("inf")) -> None:
        """count  rows or columns of the arrays;  nbytes  for `most` of them, which is 1 at least"""
        self.device, self.length = device, length
        self._batches = Batches(device, length, np.complex64, nbytes)
        self.most = min(count, self._batches.most)
        self.nbytes = self._batches.nbytes(count)
        self._count, self._work = count, None
        self._rows, self._columns, self._lay = (
            device.kernel("transposition.cl", name) for name in ("rows", "columns", "lay")
        )

    def rows(self, array: Buffer, first: int, count: int) -> None:
        """Transform rows first ... first + count - 1 of a buffer (..., length)."""
        self.device.run(self._rows, (self.length, count), None, array, first, self._reserved())
        self._batches.transform()

    def columns(self, array: Buffer, shape: tuple[int, int], first: int, count: int) -> None:
        """Transform columns of a buffer of `shape`, padded with zeros, or folded, to the length.

        Longer columns are added up at the same remainders by the length.
        """
        size = _whole(self.length), _whole(count)
        work = self._reserved()
        self.device.run(
            self._columns, size, (ACROSS, ACROSS),
            launch_numbers(
                "transposition.cl", "columns", n_rows=shape[0], stride=shape[1], first=first, length=self.length,
                count=count,
            ),
            array, work, steps=-(-shape[0] // self.length),
        )  # fmt: skip
        self._batches.transform()

    def lay(
        self, out: object, stride: int, first: int, count: int, weights: tuple[Buffer, int], origin: int = 0,
        sign: int = 1,
    ) -> None:  # fmt: skip
        """The last `count` transforms as columns, from `first` on, of a buffer (n, stride), the array itself perhaps.

        weights  buffer of n factors, float32, and n: of bin origin + sign i in row i
        With sign -1 the transforms have exp(+j ...).
        """
        factors, n = weights
        self.device.run(
            self._lay, (_whole(count), _whole(n)), (ACROSS, ACROSS),
            launch_numbers(
                "transposition.cl", "lay", length=self.length, origin=origin, sign=sign, n=n, count=count,
                stride=stride, first=first,
            ),
            self._work, factors, out,
        )  # fmt: skip

    def _reserved(self) -> Any:
        """The buffer of the rows that are transformed."""
        self._batches.reserve(self._count)
        self._work = next(self._batches.of(1))[2]
        return self._work


def _whole(n: int) -> int:
    return -(-n // ACROSS) * ACROSS
