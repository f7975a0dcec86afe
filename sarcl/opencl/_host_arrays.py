"""Buffers of CPU devices in the memory of host arrays, which stays until the kernels that read it have ended.

A driver keeps a buffer until then, but not the memory of the array that the buffer shares. A kernel that still runs
when Python drops both reads memory that somebody else may have, and PoCL's heap breaks.
"""

from __future__ import annotations

import functools
from collections import deque
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    import pyopencl


class HostArrays:
    """Arrays of dropped buffers of one queue, and how many commands were enqueued and have ended there."""

    def __init__(self) -> None:
        self.enqueued = self.ended = 0
        self._waiting: deque[tuple[int, np.ndarray]] = deque()

    def shared(self, context: pyopencl.Context, array: np.ndarray, writable: bool = False) -> pyopencl.Buffer:
        """A buffer in the memory of `array`, read-only where not `writable`."""
        return _buffer_class()(context, array, self, writable)

    def dropped(self, array: np.ndarray) -> None:
        """Keep an array while anything that was enqueued runs."""
        if self.enqueued > self.ended:
            self._waiting.append((self.enqueued, array))

    def finished(self, enqueued: int) -> None:
        """The first so many commands have ended: let go of arrays that later ones do not read."""
        self.ended = max(self.ended, enqueued)
        while self._waiting:
            waiting = self._waiting.popleft()
            if waiting[0] > self.ended:
                self._waiting.appendleft(waiting)
                return


@functools.cache
def _buffer_class() -> type:
    import pyopencl

    class SharedBuffer(pyopencl.Buffer):
        """A buffer in the memory of an array; HostArrays hears when Python drops it."""

        def __init__(self, context: pyopencl.Context, array: np.ndarray, arrays: HostArrays, writable: bool) -> None:
            access = pyopencl.mem_flags.READ_WRITE if writable else pyopencl.mem_flags.READ_ONLY
            super().__init__(context, access | pyopencl.mem_flags.USE_HOST_PTR, hostbuf=array)
            self.array, self.arrays = array, arrays

        def __del__(self) -> None:
            if hasattr(self, "arrays"):  # else the driver refused the buffer
                self.arrays.dropped(self.array)

    return SharedBuffer
