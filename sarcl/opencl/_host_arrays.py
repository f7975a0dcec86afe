"""Memory of the host that devices use: arrays in buffers of CPU devices, and page-locked memory of others.

The memory of an array that a buffer of a CPU device shares stays until the kernels that read it have ended.

A driver keeps a buffer until then, but not the memory of the array that the buffer shares. A kernel that still runs
when Python drops both reads memory that somebody else may have, and PoCL's heap breaks.
"""

from __future__ import annotations

import functools
import threading
from collections import deque
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from ..base.threads import copy

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


class PageLocked:
    """Page-locked memory, which is used again: to lock pages takes a driver longer than to copy their contents.

    most  bytes that are kept unused
    """

    def __init__(self, most: int) -> None:
        self.most = most
        self._returned: deque[np.ndarray] = deque()  # without a lock: a collection may give memory back within `take`
        self._unused: list[np.ndarray] = []
        self._lock = threading.Lock()

    def take(self, nbytes: int, lock_pages: Callable[[int], np.ndarray]) -> np.ndarray:
        """Memory, uint8, of nbytes or up to twice as many; `lock_pages` gives it where none is unused."""
        with self._lock:
            self._sort_in()
            fitting = [i for i, memory in enumerate(self._unused) if nbytes <= memory.size <= 2 * nbytes]
            if fitting:
                return self._unused.pop(min(fitting, key=lambda i: self._unused[i].size))
        return lock_pages(nbytes)

    def give_back(self, memory: np.ndarray) -> None:
        """Memory of `take` that nothing reads or writes any more; the oldest is freed above `most` bytes."""
        self._returned.append(memory)
        if self._lock.acquire(blocking=False):
            try:
                self._sort_in()
            finally:
                self._lock.release()

    def _sort_in(self) -> None:
        """Have what was given back among what is unused."""
        while self._returned:
            self._unused.append(self._returned.popleft())
        while sum(unused.size for unused in self._unused) > self.most:
            self._unused.pop(0)


def copy_in_pieces(
    fill: Callable[[np.ndarray, int], pyopencl.Event], pieces: Sequence[np.ndarray], out: np.ndarray
) -> None:
    """Copy bytes to `out` (n,) through two pieces of memory of one size: while one is filled, the other is copied.

    fill  called as fill(piece, first) to begin to copy the bytes from `first` on to a piece; returns an event
    """
    size, before = pieces[0].size, list[tuple[Any, np.ndarray, np.ndarray]]()
    for n, first in enumerate(range(0, out.size, size)):
        target = out[first : first + size]
        piece = pieces[n % 2][: target.size]
        before.append((fill(piece, first), piece, target))
        if n:
            _finish_copy(*before.pop(0))
    for last in before:
        _finish_copy(*last)


def _finish_copy(event: pyopencl.Event, piece: np.ndarray, target: np.ndarray) -> None:
    event.wait()
    copy(piece, target)


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
