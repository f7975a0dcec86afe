"""Launches of kernels on GPUs, cut into parts of about 0.2 s: the watchdogs of desktops end longer ones.

A kernel's first launch is small and timed; each of the next may be larger, until it takes as long as it may. Parts
begin at an offset of the global size along one axis, so that get_global_id counts on: work-items do not see that they
are cut.
"""

from __future__ import annotations

import functools
import math
import re
import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import pyopencl


LASTS = 0.2  # s of a part
FIRST = 2.0**20  # steps of the first part of a kernel: milliseconds on a slow GPU
GROWTH = 8.0  # most times as many steps as in the largest part that was timed
SHORT = 0.05  # of LASTS: a launch that takes less, and has been timed, is not timed again
ALONG = 256  # parts along the first axis are multiples of so many work-items, where the driver chooses the groups

WARP = 32  # work-items of a group that a GPU works on together

Enqueue = Callable[[tuple[int, ...], tuple[int, ...] | None], Any]


def fixed_axes(text: str) -> frozenset[int]:
    """Axes along which kernels of this source must not be cut: those whose size, or number of a group, they ask for."""
    return frozenset(int(n) for n in re.findall(r"\bget_(?:global_size|num_groups|group_id)\((\d)\)", text))


def in_groups(size: tuple[int, ...], group: tuple[int, ...] | None, fixed: frozenset[int]) -> list[tuple[int, int]]:
    """(first, count) of the work-items along the first axis that are launched together: all, or all but the last ones.

    Groups that the driver chooses divide a launch: of a prime number of work-items each would be a group of its own,
    and its loads would lie apart. So where no divisor fills a warp, whole groups come first.
    """
    end = size[0] % ALONG
    if group or 0 in fixed or size[0] < ALONG or _divisor(size[0]) >= WARP:
        end = 0
    return [(0, size[0] - end), (size[0] - end, end)][: 1 + (end > 0)]


@functools.lru_cache(maxsize=1024)
def _divisor(n: int) -> int:
    """The largest divisor of n up to ALONG."""
    return next(d for d in range(ALONG, 0, -1) if n % d == 0)


@dataclass
class _Known:
    """What is known of a kernel: its steps per second, the steps of its largest timed part, and parts to be timed."""

    rate: float = 0.0
    largest: float = 0.0
    running: deque[tuple[Any, float, float]] = field(default_factory=deque)  # event, steps, s at which it was enqueued

    def most(self) -> float:
        """Steps of the next part, at most."""
        return min(LASTS * self.rate, GROWTH * self.largest) if self.rate else FIRST

    def is_short(self, steps: float) -> bool:
        """Whether a part of so many steps is known to be short."""
        return steps <= self.largest and steps < SHORT * LASTS * self.rate

    def look(self, wait: bool) -> None:
        """Time the parts that have ended; wait: all of them."""
        while self.running and (wait or self.running[0][0].command_execution_status <= 0):
            event, steps, enqueued = self.running.popleft()
            event.wait()
            seconds = max(lasted(event, enqueued), 1e-9)
            if seconds >= SHORT * LASTS or steps >= self.largest:  # a small part says little of a large one
                self.rate, self.largest = steps / seconds, max(self.largest, steps)


class Launches:
    """The launches on one device's queue."""

    def __init__(self) -> None:
        self._known: dict[Any, _Known] = {}

    def launch(
        self, kernel: pyopencl.Kernel, size: tuple[int, ...], group: tuple[int, ...] | None, fixed: frozenset[int],
        steps: float, enqueue: Enqueue, flush: Callable[[], object],
    ) -> None:  # fmt: skip
        """Enqueue a kernel in as many parts as are needed.

        fixed  axes along which it must not be cut;  steps  of a loop in each work-item, about
        enqueue(size, offset) enqueues a part and returns its event; flush lets the device begin
        """
        known = self._known.setdefault(kernel, _Known())
        total = steps * math.prod(size)
        if known.is_short(total):
            enqueue(size, None)
            return
        axis, unit = _axis(size, group, fixed)
        each, at = total / size[axis], 0
        while at < size[axis]:
            known.look(wait=False)
            growing = not known.rate or GROWTH * known.largest < LASTS * known.rate
            if growing and known.running and each * (size[axis] - at) > known.most():
                known.look(wait=True)
            n = min(max(unit, int(known.most() / each) // unit * unit), size[axis] - at)
            part = (*size[:axis], n, *size[axis + 1 :])
            offset = (*(0 for _ in size[:axis]), at, *(0 for _ in size[axis + 1 :])) if n < size[axis] else None
            known.running.append((enqueue(part, offset), each * n, time.perf_counter()))
            flush()
            at += n


def _axis(size: tuple[int, ...], group: tuple[int, ...] | None, fixed: frozenset[int]) -> tuple[int, int]:
    """The axis with most groups that may be cut, and the work-items of a group along it; all where none may be cut."""
    units = [group[i] if group else (ALONG if i == 0 else 1) for i in range(len(size))]
    free = [i for i in range(len(size)) if i not in fixed]
    if not free:
        return 0, size[0]
    axis = max(free, key=lambda i: (size[i] // units[i], i))
    return axis, units[axis]


def lasted(event: pyopencl.Event, enqueued: float) -> float:
    """Duration, s, of a part that has ended: as the driver says, else the time since it was enqueued."""
    import pyopencl

    try:
        return float(event.profile.end - event.profile.start) * 1e-9
    except pyopencl.Error:
        return time.perf_counter() - enqueued
