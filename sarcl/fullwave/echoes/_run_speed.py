"""Speed of a device with full-wave runs, measured on a small grid."""

from __future__ import annotations

import functools
import time
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...opencl.device import Device
from ..fields import PERIODS, Fields
from ..lattice import Lattice
from ..runs import ABSORBER
from ..target import Target

CELLS = 96  # of the small grid, per side
LISTED, FREQUENCIES = 40_000, 32  # edges in its list, frequencies of their sums
BLOCK = 8  # steps at a time, as in a run
REPEATS = 3  # timings, of which the fastest counts: the first builds the kernels


@dataclass(frozen=True)
class RunSpeed:
    """cells  updated per second, with absorbing layers;  sums  of residuals: edges x frequencies x steps per second"""

    cells: float
    sums: float


@functools.lru_cache(maxsize=16)
def run_speed(device: Device) -> RunSpeed:
    """The speed of a device, measured once per process: some tenths of a second."""
    grid = Lattice(0.01, (CELLS, CELLS, CELLS), np.zeros(3))
    fields = Fields(device, grid, Target.nothing(), absorber=ABSORBER)
    step = _seconds(device, lambda: fields.advance(BLOCK)) / BLOCK
    at = np.linspace(0, 3 * CELLS**3 - 1, LISTED).astype(np.int64)
    fields = Fields(device, grid, Target(at, np.zeros((2, LISTED)), at[:0], np.zeros((4, 0))))
    phase = device.copied(np.zeros((BLOCK, FREQUENCIES, 2), np.float32))
    sums = device.zeros(8 * FREQUENCIES * fields.edges.count)
    summed = _seconds(device, lambda: fields.transform(fields.edges, phase, sums, BLOCK, FREQUENCIES))
    summed /= BLOCK * PERIODS[0]  # the residuals are sampled once in several steps
    return RunSpeed(CELLS**3 / step, LISTED * FREQUENCIES / summed)


def _seconds(device: Device, work: Any) -> float:
    best = np.inf
    for _ in range(REPEATS):
        start = time.perf_counter()
        work()
        device.finish()
        best = min(best, time.perf_counter() - start)
    return best
