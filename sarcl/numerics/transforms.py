"""FFTs of the rows or columns of arrays that are on a device; the transforms become columns of another array there.

Kernels: kernels/transposition.cl, before and after an FFT of rows.
"""

from __future__ import annotations

from math import isqrt
from typing import TYPE_CHECKING, Any

import numpy as np

from ..opencl.device import Device
from ..opencl.fft_batches import Batches
from ..opencl.group_sizes import first_allowed
from ..opencl.launch_numbers import launch_numbers

if TYPE_CHECKING:
    from ..opencl.device import Buffer


KERNELS, NAMES = "transposition.cl", ("rows", "columns", "lay")
SIDES = 8, 4, 2, 1  # work-items of a group along each axis, most first


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
        items, (self._rows, self._columns, self._lay) = first_allowed(
            device,
            [side**2 for side in SIDES],
            lambda items: tuple(device.kernel(KERNELS, name, SIDE=isqrt(items)) for name in NAMES),
        )
        self._group = (isqrt(items), isqrt(items))

    def rows(self, array: Buffer, first: int, count: int) -> None:
        """Transform rows first ... first + count - 1 of a buffer (..., length)."""
        self.device.run(self._rows, (self.length, count), None, array, first, self._reserved())
        self._batches.transform()

    def columns(self, array: Buffer, shape: tuple[int, int], first: int, count: int) -> None:
        """Transform columns of a buffer of `shape`, padded with zeros, or folded, to the length.

        Longer columns are added up at the same remainders by the length.
        """
        size = self._whole(self.length, count)
        work = self._reserved()
        self.device.run(
            self._columns, size, self._group,
            launch_numbers(
                KERNELS, "columns", n_rows=shape[0], stride=shape[1], first=first, length=self.length,
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
            self._lay, self._whole(count, n), self._group,
            launch_numbers(
                KERNELS, "lay", length=self.length, origin=origin, sign=sign, n=n, count=count,
                stride=stride, first=first,
            ),
            self._work, factors, out,
        )  # fmt: skip

    def _reserved(self) -> Any:
        """The buffer of the rows that are transformed."""
        self._batches.reserve(self._count)
        self._work = next(self._batches.of(1))[2]
        return self._work

    def _whole(self, columns: int, rows: int) -> tuple[int, int]:
        """Work-items of an array, in whole groups."""
        side = self._group[0]
        return -(-columns // side) * side, -(-rows // side) * side
