"""Division of the bands of a result among devices: each takes what it can make until all end together."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Sequence
from typing import NamedTuple

from .bands import Bands, Run

SURE = 0.75  # part of its share that a device of known speed takes at a time: the rest corrects the division
UNSURE = 0.25  # the same for one whose speed was measured with another kernel
WORTH = 0.25  # part of an engine's `least` that must be left over after UNSURE to be divided again
LITTLE = 0.05  # part of its share by which a device may take more, to end at a whole band


class Worker(NamedTuple):
    """A device: bands that its blocks may not cross, Engine.least, and its speed relative to the others'.

    Equal speeds are taken for certain.
    """

    ends: set[int]
    least: float
    rate: float


class Shares:
    """Bands that several devices take one block after the other, each block as large as the device's speed asks for.

    A block repeats some of the work, such as the range profiles of all rows, so that blocks are few: a device that is
    free takes its share of what is left, or most of it where the rest is worth a block of its own. Shares are such
    that all devices end at the same time, at the speeds that they have shown so far. A device whose
    share is less than half the smallest block takes no more.
    """

    def __init__(
        self,
        bands: Bands,
        todo: list[Run],
        devices: Sequence[Worker],
        *,
        most: float,
        unit: int,
        now: Callable[[], float] = time.monotonic,
    ) -> None:
        """most  units of work of a block, at most;  unit  blocks begin at multiples of so many bands if possible"""
        self.bands, self.most, self.unit, self.devices = bands, most, unit, devices
        rates = [device.rate for device in devices]
        self._left, self._rates, self._now = list(todo), rates, now
        self._alike = min(rates) == max(rates)
        self._taken, self._done, self._busy = ([0.0] * len(rates) for _ in range(3))  # units of work, the same, s
        self._began: list[float | None] = [None] * len(rates)
        self._active = [True] * len(rates)
        self.lost: set[int] = set()  # devices that have failed
        self._lock = threading.Lock()

    def take(self, k: int) -> Run | None:
        """The next block of device k, which has made all of those before; None: there is nothing more for it."""
        with self._lock:
            self._stop(k)
            part = self._part(k) if self._left else 0.0
            block = self._block(k, part) if part > 0 else None
            if block is None:
                self._active[k] = False
                return None
            self._taken[k] += self.bands.count(*block)
            self._began[k] = self._now()
            return block

    def give_back(self, k: int, block: Run) -> None:
        """Device k has failed in this block and takes no more: the others make it."""
        with self._lock:
            self._began[k], self._active[k] = None, False
            self._left.insert(0, block)
            others = [j for j in range(len(self._active)) if j != k]
            for j in others:  # also those that had no more to do
                self._active[j] = True
            self.lost.add(k)
            for j in self.lost:
                self._active[j] = False

    def made(self, k: int, units: float) -> None:
        """Device k has done so many units of work, or an equal part of the work on more."""
        with self._lock:
            self._done[k] = max(self._done[k], units)

    def _stop(self, k: int) -> None:
        began = self._began[k]
        if began is not None:
            self._busy[k] += self._now() - began
            self._done[k], self._began[k] = self._taken[k], None

    def _speeds(self) -> list[float]:
        """Units of work per second of each device: as shown, or in proportion to those that have shown theirs."""
        shown: list[float | None] = []
        for done, busy, began in zip(self._done, self._busy, self._began, strict=True):
            seconds = busy + (0.0 if began is None else self._now() - began)
            shown.append(done / seconds if done > 0 and seconds > 0 else None)
        scales = [v / rate for v, rate in zip(shown, self._rates, strict=True) if v is not None]
        scale = sum(scales) / len(scales) if scales else 1.0
        return [rate * scale if v is None else v for v, rate in zip(shown, self._rates, strict=True)]

    def _part(self, k: int) -> float:
        """Units of work that device k should take now."""
        remainder, speeds = float(sum(self.bands.count(*run) for run in self._left)), self._speeds()
        # seconds from now at which each device is free, and when all end if they share what is left
        active = [j for j in range(len(speeds)) if self._active[j]]
        free = {j: (self._taken[j] - self._done[j]) / speeds[j] if j != k else 0.0 for j in active}
        work = speed = 0.0
        end = float("inf")
        for j in sorted(free, key=free.__getitem__):
            if free[j] >= end:
                break
            work, speed = work + speeds[j] * free[j], speed + speeds[j]
            end = (remainder + work) / speed
        share = min(speeds[k] * end, remainder)
        sure = self._alike or self._done[k] > 0
        rest = share * (1 - (SURE if sure else UNSURE))
        worth = self.devices[k].least if sure else WORTH * self.devices[k].least
        return share - rest if rest >= worth and len(free) > 1 else share

    def _block(self, k: int, units: float) -> Run | None:
        """About so many units of work from the first band that is left; None where that is less than half a block."""
        first, stop = self._left[0]
        stop = min([e for e in self.devices[k].ends if e > first] + [stop])
        size, count = min(units, self.most), self.bands.count
        last = stop
        if count(first, stop) > size:
            low, high = first, stop  # the last band with which the block has `size` units at most
            while high - low > 1:
                middle = (low + high) // 2
                low, high = (middle, high) if count(first, middle) <= size else (low, middle)
            below = max(low // self.unit * self.unit, first)
            above = min((below // self.unit + 1) * self.unit, stop)
            over = count(first, above) - size
            # a little more than the share, so that no few bands are left over, whose profiles would cost more
            fits = units <= self.most and (over <= LITTLE * size or over <= size - count(first, below))
            last = above if fits or below == first else below
        others = any(active for j, active in enumerate(self._active) if j != k)
        if others and units < count(first, last) / 2:
            return None
        self._left[0] = last, self._left[0][1]
        if self._left[0][0] == self._left[0][1]:
            self._left.pop(0)
        return first, last
