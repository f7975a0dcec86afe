"""What an image will take before any work is done: method, time, memory, error."""

from __future__ import annotations

import functools
import time
from dataclasses import dataclass
from typing import Any

import numpy as np

from . import cl, energy, planning
from .check import choice, instance, number
from .grid import ImageGrid
from .methods import METHODS, Choice, choose
from .phase_history import PhaseHistory
from .planning import Clock
from .task import Task, make_task

PROBE = 0.03  # s a probe of a device takes at least


@dataclass(frozen=True, eq=False)
class Forecast:
    """What `backproject` would do with the same options.

    method           "direct" or "factorized"; plan: the details, as in a report
    seconds          about, on this device as fast as it is now
    bytes            of memory, about: pixels in memory and blocks on the device
    predicted_error  bound of the relative error
    cheaper          (predicted error, seconds) of the next cheaper plan, or None where there is none
    """

    method: str
    plan: dict[str, Any]
    seconds: float
    bytes: float
    predicted_error: float
    cheaper: tuple[float, float] | None

    def __str__(self) -> str:
        text = f"{self.method}: about {_duration(self.seconds)}, {cl.size_text(self.bytes)}"
        text += f", error below {self.predicted_error:.1e}"
        if self.cheaper:
            text += f" (next cheaper plan: {self.cheaper[0]:.1e} in {_duration(self.cheaper[1])})"
        return text


def plan(
    raw: PhaseHistory,
    grid: ImageGrid,
    *,
    tolerance: float = 1e-3,
    method: str = "auto",
    window: Any = None,
    weights: Any = None,
    beam: Any = None,
    wrap: bool = False,
    skip: Any = True,
    max_bytes: float | None = None,
    device: Any = None,
) -> Forecast:
    """How `backproject(raw, grid, ...)` would make the image with these options: a Forecast, before any work.

    Samples are hardly read: a few rows, to see how much of their energy lies on the grid. Time is scaled from a short
    run of the device's kernel. ValueError where `backproject` would raise one.
    """
    instance("raw", raw, PhaseHistory)
    instance("grid", grid, ImageGrid)
    choice("method", method, METHODS)
    tolerance = number("tolerance", tolerance, above=0)
    task = make_task(raw, grid, window, weights, wrap, skip, beam)
    opened = cl.open_device(device)
    budget = min(planning.budget(opened, max_bytes), opened.info.memory)
    lanes = opened.info.vector_width > 1
    chosen = choose(task, method, tolerance, lanes, opened.info.fp64)
    seen = task.raw.n_rows * (grid.size if task.grid.empty is None else grid.size - int(task.grid.empty.sum()))
    unit = seen * energy.share(task) / _speed(opened)  # seconds of the pairs that are not skipped, at cost 1
    return Forecast(
        chosen.method,
        chosen.plan.describe(chosen.method),
        unit * chosen.cost,
        _bytes(task, chosen, opened, budget),
        chosen.predicted_error,
        _cheaper(task, method, tolerance, lanes, opened.info.fp64, chosen, unit),
    )


def _cheaper(
    task: Task, method: str, tolerance: float, lanes: bool, float64: bool, chosen: Choice, unit: float
) -> tuple[float, float] | None:
    """The plan of the smallest error that costs noticeably less."""
    for factor in (2, 3, 10, 30):
        if tolerance * factor < 1:
            other = choose(task, method, tolerance * factor, lanes, float64)
            if other.cost < 0.95 * chosen.cost:
                return other.predicted_error, unit * other.cost
    return None


def _bytes(task: Task, chosen: Choice, device: cl.Device, budget: float) -> float:
    """Pixels of the whole image, and what the device holds at a time."""
    pixels = task.grid.size * np.dtype(chosen.dtype).itemsize
    first, last = chosen.on(device, task).blocks(budget)[0]
    working = 24.0 * chosen.tiling.pixels(first, last) + 8.0 * chosen.plan.length * 256
    levels = getattr(chosen.plan, "levels", ())
    if levels:
        tiles = chosen.tiling.pixels(first, last) / levels[0].side ** 2
        working += tiles * levels[0].n_bytes(2 * levels[0].reach + 8)
    return pixels + min(working, budget)


@functools.lru_cache(maxsize=16)
def _speed(device: cl.Device) -> float:
    """Contributions a second of the gathering kernel with the hat and ranges in float32: the unit of plans' costs."""
    from . import direct

    n = 256
    track = np.stack([np.full(n, -7e3), np.linspace(-50, 50, n), np.full(n, 7e3)], axis=1)
    samples = np.ones((n, 256), np.complex64)
    raw = PhaseHistory(
        samples, frequency=9.5e9, frequency_step=1e6, tx=track, reference_range=np.linalg.norm(track, axis=1)
    )
    side = 128
    while True:
        task = make_task(raw, ImageGrid.plane(shape=(side, side), spacing=0.3), None, None, False, True)
        made, tiling = direct.make_plan(task, 0.1, lanes=False)
        engine, out = direct.Direct(device, task, made, tiling), np.empty((side, side), np.complex64)
        clock = Clock()
        engine.fill(0, tiling.n_bands, out, 2**28, clock, lambda rows: None)  # builds, warms up
        clock, start = Clock(), time.perf_counter()
        engine.fill(0, tiling.n_bands, out, 2**28, clock, lambda rows: None)
        if time.perf_counter() - start > PROBE or side >= 4096:
            return task.pairs * made.cost / clock.seconds["backproject"]
        side *= 2


def _duration(seconds: float) -> str:
    """Seconds as text a person reads."""
    if seconds < 120:
        return f"{seconds:.2g} s"
    return f"{seconds / 60:.0f} min" if seconds < 7200 else f"{seconds / 3600:.1f} h"
