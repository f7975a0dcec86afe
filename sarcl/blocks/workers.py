"""The workers that compute blocks of bands: one device, or several that take their shares."""

from __future__ import annotations

import logging
import queue
import threading
from collections.abc import Callable, Generator, Sequence
from typing import NamedTuple, Protocol

import numpy as np

from ..base.stage_timer import Clock
from ..opencl.device_list import DeviceInfo
from ..opencl.failures import DeviceFailed
from ._shares import Shares, Worker
from .bands import Bands, Engine, FlatArray, Run, Tally
from .block_job import BlockJob

log = logging.getLogger(__name__)

FinishedBlock = tuple[int, int, FlatArray, Tally]  # a run of bands, where its values are, and its tally
OutputFor = Callable[[int, int], FlatArray]  # destination of the values of a run: the flat array or a BandBuffer


class Work(NamedTuple):
    """Bands to be computed in blocks.

    todo         runs of bands
    most         units of work of a block at most, about;  unit  blocks begin at multiples of so many bands if possible
    output_for   called as output_for(first, last): the destination of a run
    on_progress  called from the caller's thread with the number of contributions done so far
    """

    todo: list[Run]
    most: float
    unit: int
    output_for: OutputFor
    clock: Clock
    on_progress: Callable[[int], None]


class WorkerPool(Protocol):
    """Workers that compute the bands of one job.

    size   number of blocks that are computed at once
    names  names of the devices
    least  units of work per block below which a unit costs noticeably more
    most   units of work per block above which its values need too much memory
    """

    size: int
    names: list[str]
    least: float
    most: float

    def compute(self, work: Work) -> Generator[FinishedBlock, None, None]:
        """Compute the bands in blocks; yields each block when it is finished, in any order."""
        ...


def cut(bands: Bands, todo: list[Run], most: float, ends: set[int], unit: int = 1) -> list[Run]:
    """The bands of `todo` in blocks of equal size, of about `most` units of work; none extends across one of `ends`.

    Blocks begin at multiples of `unit` bands, except where `todo` or `ends` begin a block elsewhere.
    """
    blocks = []
    for start, stop in todo:
        n = min(stop - start, max(1, int(np.ceil(bands.count(start, stop) / max(most, 1)))))
        even = {(start + (stop - start) * i // n) // unit * unit for i in range(1, n)}
        first = start
        for last in sorted({e for e in even | ends if start < e < stop} | {stop}):
            blocks.append((first, last))
            first = last
    return blocks


class LocalWorkers:
    """Engines of this process, each on its own device: see WorkerPool."""

    def __init__(
        self, job: BlockJob, engines: Sequence[Engine], budgets: list[float], names: list[str], rates: list[float]
    ) -> None:
        """rates  speeds of the devices, relative to one another, as far as they are known before the work"""
        self.job, self.engines, self.budgets, self.names = job, engines, budgets, names
        self.size, self.rates = len(engines), rates
        self.least = max(float(engine.least) for engine in engines)
        self.most = min(float(engine.most) for engine in engines)

    def compute(self, work: Work) -> Generator[FinishedBlock, None, None]:
        """See WorkerPool."""
        each = zip(self.engines, self.budgets, strict=True)
        ends = [{last for _, last in engine.blocks(budget)} for engine, budget in each]
        bands = self.job.bands
        if self.size > 1:
            least = [engine.least for engine in self.engines]
            devices = [Worker(*each) for each in zip(ends, least, self.rates, strict=True)]
            shares = Shares(bands, work.todo, devices, most=work.most, unit=work.unit)
            yield from self._together(shares, work)
            return
        before = 0
        work.on_progress(0)
        for run in cut(bands, work.todo, work.most, ends[0], work.unit):
            block, before = self._one(0, run, work, before)
            work.on_progress(before)
            yield block

    def _one(self, k: int, run: Run, work: Work, before: int) -> tuple[FinishedBlock, int]:
        """One block, computed by engine k, and the number of contributions done after it."""
        flat, units, passes = work.output_for(*run), self.job.bands.count(*run), self.job.passes

        def passes_done(n: float) -> None:
            work.on_progress(before + int(min(n, passes) * units))

        tally = self.engines[k].fill(*run, flat, self.budgets[k], work.clock, passes_done)
        return (*run, flat, tally), before + passes * units

    def _together(self, shares: Shares, work: Work) -> Generator[FinishedBlock, None, None]:
        """One thread per device; the caller's thread reports progress and yields finished blocks."""
        finished: queue.SimpleQueue[FinishedBlock | BaseException] = queue.SimpleQueue()
        stop = threading.Event()
        alive = set(range(self.size))
        pairs = [0] * self.size  # contributions; each thread writes its own

        def run(k: int) -> None:
            def own_progress(done: int) -> None:
                if stop.is_set():
                    raise _Stop
                pairs[k] = done
                shares.made(k, done / self.job.passes)

            own, block = work._replace(clock=Clock(), on_progress=own_progress), None
            try:
                while not stop.is_set():
                    block, before = shares.take(k), pairs[k]
                    if block is None:
                        return
                    done, pairs[k] = self._one(k, block, own, pairs[k])
                    finished.put(done)
            except _Stop:
                pass
            except DeviceFailed as exc:
                assert block is not None
                alive.discard(k)
                if not alive:
                    finished.put(exc)
                    return
                pairs[k] = before
                log.warning("%s; the other devices go on without it", exc)
                shares.give_back(k, block)
            except BaseException as exc:
                finished.put(exc)

        def started(k: int) -> threading.Thread:
            thread = threading.Thread(target=run, args=(k,), daemon=True)
            thread.start()
            return thread

        work.on_progress(0)
        threads = {k: started(k) for k in range(self.size)}
        try:
            count = self.job.bands.count
            running = sum(count(*run) for run in work.todo)
            while running:
                try:
                    done = finished.get(timeout=0.1)
                except queue.Empty:
                    work.on_progress(sum(pairs))
                    if shares.lost and not any(thread.is_alive() for thread in threads.values()):
                        threads = {k: started(k) for k in alive}  # a block came back after they had ended
                    continue
                if isinstance(done, BaseException):
                    raise done
                running -= count(done[0], done[1])
                work.clock.lap(self.job.stage)
                work.on_progress(sum(pairs))
                yield done
        finally:
            stop.set()
            for thread in threads.values():
                thread.join()


def rates_of(infos: Sequence[DeviceInfo]) -> list[float]:
    """Speeds of devices relative to one another, from their trials; equal where all are of one kind and driver."""
    kinds = {(info.platform, info.name, info.kind, info.units) for info in infos}
    return [info.rate if len(kinds) > 1 else 1.0 for info in infos]


def speedup(infos: Sequence[DeviceInfo]) -> float:
    """How many times as fast as the first all devices are together; drivers of the same CPU share its cores."""
    rates = rates_of(infos)
    cpu = [rate for info, rate in zip(infos, rates, strict=True) if info.kind == "cpu"]
    return (sum(rates) - sum(cpu) + max(cpu, default=0.0)) / rates[0] if rates[0] > 0 else 1.0


class _Stop(Exception):
    """Raised in a thread where another has failed, or where the caller has stopped the run."""
