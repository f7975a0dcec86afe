"""Forecast of backproject: run time, memory and error of an image before the work; the speed of a device."""

from __future__ import annotations

import copy
import functools
import time
from collections.abc import Callable

import numpy as np

from ..base.errors import ToleranceUnreachable, warn
from ..base.forecast import Forecast
from ..base.stage_timer import Clock
from ..model.image import Image
from ..model.image_grid import ImageGrid
from ..model.phase_history import PhaseHistory
from ..numerics.cost_model import DeviceClass
from ..opencl.choose_device import open_devices
from ..opencl.device import Device
from . import profile_energy
from .backproject_options import BackprojectOptions
from .factorized.plan import FactorPlan, moving_cost
from .focusing_task import FocusingTask, make_task
from .method_choice import MethodChoice
from .unseen_pixels import unseen_pixels

PROBE = 0.03  # s: shortest run of the kernel from which the speed of a device is measured
MOST_BANDS = 2**16  # bands that are divided into blocks; the memory of the first block follows from these


def forecast_of(
    task: FocusingTask, options: BackprojectOptions, chosen: MethodChoice, planning: float, run: Callable[[], Image]
) -> Forecast[Image]:
    """Forecast of `run`, which makes an image by the chosen method; planning  seconds that the choice has taken.

    Time is scaled from a short run of the kernel on each device.
    """
    devices = open_devices(options.device)
    working, repeated = np.sum([_in_blocks(task, chosen, d, options.budget(d)) for d in devices], axis=0)
    rate = rate_of(devices)
    # seconds per pixel, for all rows that see it, at cost 1
    seconds = float(task.raw.n_rows * profile_energy.share(task) / rate)
    besides = planning + float(repeated) / len(devices) / rate
    details = chosen.plan.describe(chosen.method)
    unseen = unseen_pixels(task)
    if unseen:
        details["pixels outside every range window"] = unseen.describe()
        if unseen.warning():
            warn(unseen.warning())
    return Forecast(
        method=chosen.method,
        plan=details,
        seconds=besides + seconds * _work(task, chosen),
        bytes=float(task.grid.size) * np.dtype(chosen.dtype).itemsize + working,
        predicted_error=chosen.predicted_error,
        error_terms=chosen.error_terms,
        search_cheaper=lambda: _cheaper(task, options, devices, chosen, seconds, besides),
        planning=planning,
        run=run,
    )


def _work(task: FocusingTask, chosen: MethodChoice) -> float:
    """Cost per row: the pixels to be computed, padding of tiles included, times the cost of each."""
    tiling, plan, rows = chosen.tiling, chosen.plan, task.raw.n_rows
    pixels = float(tiling.pixels(0, tiling.n_bands))
    if not isinstance(plan, FactorPlan):
        return pixels * chosen.cost
    # the plan assumes tiles that fill the grid exactly
    sources = [rows, *(len(level.decimation.kept) for level in plan.levels)]
    extra = (pixels - task.grid.size) * sources[-1] * plan.leaf.cost
    for level, factor, n in zip(plan.levels, plan.factors, sources, strict=False):
        tiles = float(tiling.n_roots(0, tiling.n_bands, factor))
        moved = moving_cost(2 * level.reach, plan.between.taps, level.decimation.filter.shape[1])
        extra += max(tiles - task.grid.size / level.side**2, 0.0) * n * moved
    return task.grid.size * chosen.cost + extra / rows


def rate_of(devices: list[Device]) -> float:
    """Contributions per second of all devices together; drivers of the same CPU share its cores."""
    return sum(speed(d) for d in devices if not d.is_cpu) + max((speed(d) for d in devices if d.is_cpu), default=0.0)


def _cheaper(
    task: FocusingTask,
    options: BackprojectOptions,
    devices: list[Device],
    chosen: MethodChoice,
    seconds: float,
    besides: float,
) -> tuple[float, float] | None:
    """Predicted error and seconds of the most accurate plan that costs noticeably less.

    seconds  per unit of work;  besides  seconds that do not depend on the plan's work
    """
    for factor in (2, 3, 10, 30):
        if options.tolerance * factor < 1:
            try:
                other = options.choose(task, devices, options.tolerance * factor)
            except ToleranceUnreachable:  # sub-apertures may be possible at the tighter tolerance alone
                continue
            if _work(task, other) < 0.95 * _work(task, chosen):
                return other.predicted_error, besides + seconds * _work(task, other)
    return None


def _in_blocks(task: FocusingTask, chosen: MethodChoice, device: Device, budget: float) -> tuple[float, float]:
    """Bytes on a device at a time, within its budget, and the cost of what is made again for every block."""
    tiling = copy.copy(chosen.tiling)
    tiling.n_bands = min(tiling.n_bands, MOST_BANDS)
    engine = chosen.engine(device, task, chosen.plan, tiling)
    return float(engine.working(budget)), engine.repeated(budget) * chosen.tiling.n_bands / tiling.n_bands


@functools.lru_cache(maxsize=16)
def speed(device: Device) -> float:
    """Contributions per second of the per-pixel kernel with linear interpolation and ranges in float32: the unit of the
    costs of plans."""
    from .direct import direct

    n = 256
    track = np.stack([np.full(n, -7e3), np.linspace(-50, 50, n), np.full(n, 7e3)], axis=1)
    samples = np.ones((n, 256), np.complex64)
    raw = PhaseHistory(
        samples, frequency=9.5e9, frequency_step=1e6, tx=track, reference_range=np.linalg.norm(track, axis=1)
    )
    side = 128
    while True:
        task = make_task(raw, ImageGrid.plane(shape=(side, side), spacing=0.3), None, None, False, True)
        plan, tiling = direct.make_plan(task, 0.1, DeviceClass(lanes=False))
        engine, out = direct.Direct(device, task, plan, tiling), np.empty((side, side), np.complex64)
        clock = Clock()
        engine.fill(0, tiling.n_bands, out, 2**28, clock, lambda rows: None)  # builds the kernels, warms up
        clock, start = Clock(), time.perf_counter()
        engine.fill(0, tiling.n_bands, out, 2**28, clock, lambda rows: None)
        if time.perf_counter() - start > PROBE or side >= 4096:
            return task.pairs * plan.cost / clock.seconds["backproject"]
        side *= 2
