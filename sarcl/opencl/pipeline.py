"""Blocks of work on a device: while it computes one, the host reads the next and uploads it."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

from ..base.threads import copy
from .device import Device

if TYPE_CHECKING:
    import pyopencl

    from .device import Buffer


AHEAD = 1  # steps that may still run when `Pipeline.step` returns, on a device other than a CPU
SLOTS = AHEAD + 1  # blocks whose uploads are in memory


class Pipeline:
    """The steps of a computation in blocks, on one device; each block has one step or more.

    On a CPU device a step ends before the next begins: both would compete for the same cores, and buffers share the
    host's memory. On others the host is one step ahead. Its uploads go through page-locked memory and a queue of their
    own; the device's queue waits for them, the host does not.

    As a context manager: when the block of `with` ends, in whatever way, nothing runs on the device any more, so that
    arrays and buffers may be freed. A pipeline may be used again; it keeps its buffers.
    """

    def __init__(self, device: Device) -> None:
        self.device = device
        self._running: deque[tuple[Any, Callable[[], object]]] = deque()  # steps: an event at the end, and what follows
        self._slots: list[list[_Staged]] = [[] for _ in range(SLOTS)]
        self._turn = self._used = 0
        self._uploads: pyopencl.CommandQueue | None = None

    @property
    def held(self) -> int:
        """Steps whose buffers are in memory at a time."""
        return 1 if self.device.is_cpu else AHEAD + 1

    def __enter__(self) -> Pipeline:
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        try:
            if self._uploads is not None:
                self._uploads.finish()
            self.device.finish()
            while self._running and kind is None:
                self._end_oldest()
        finally:
            self._running.clear()

    def new_block(self) -> None:
        """The uploads from here on belong to the next block; those of the block before the last one may be replaced."""
        self._turn, self._used = (self._turn + 1) % SLOTS, 0

    def upload(self, array: np.ndarray) -> Buffer:
        """A buffer with the contents of `array`, for kernels of this block.

        On CPUs it shares the array's memory, which must live until the end of the step; on others the array may change
        once this returns.
        """
        if self.device.is_cpu:
            return self.device.upload(array)
        if self._uploads is None:
            self._uploads = self.device.another_queue()
        slot = self._slots[self._turn]
        if self._used == len(slot):
            slot.append(_Staged(self.device, self._uploads, array.nbytes))
        elif slot[self._used].nbytes < array.nbytes:
            slot[self._used] = _Staged(self.device, self._uploads, array.nbytes)
        self._used += 1
        return slot[self._used - 1].copied(array)

    def step(self, then: Callable[[], object] = lambda: None) -> None:
        """The kernels of a step are enqueued: let the device run them, and wait for those of the step before.

        then  called once the kernels of this step have ended: by this call, by one of a later step, or at the end
        """
        if self.device.is_cpu:
            self.device.finish()
            then()
            return
        self._running.append((self.device.mark(), then))
        while len(self._running) > AHEAD:
            self._end_oldest()

    def _end_oldest(self) -> None:
        event, then = self._running.popleft()
        self.device.wait(event)
        then()


class _Staged:
    """Page-locked memory of the host, and a buffer of the device that is filled from it."""

    def __init__(self, device: Device, queue: pyopencl.CommandQueue, nbytes: int) -> None:
        self.device, self.queue, self.nbytes = device, queue, nbytes
        self.buffer, self.host = device.empty(nbytes), device.page_locked(queue, nbytes)
        self._copy: pyopencl.Event | None = None

    def copied(self, array: np.ndarray) -> Buffer:
        """The buffer, which is being filled with `array`: what is enqueued on the device from here on waits for it."""
        staged = self.host[: array.nbytes]
        copy(array, staged.view(array.dtype).reshape(array.shape))
        self._copy = self.device.write_behind(self.queue, self.buffer, staged)
        return self.buffer

    def __del__(self) -> None:
        if hasattr(self, "host"):  # else the driver refused the memory
            self._copy = None  # waits for it
            self.device.give_back(self.host)
