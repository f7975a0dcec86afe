"""Direct backprojection in float64, for tolerances that complex64 cannot meet."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np

from ...base import text
from ...base.constants import SPEED_OF_LIGHT
from ...base.float_pairs import exact_sum
from ...base.stage_timer import Clock
from ...blocks.bands import FlatArray
from ...model.phase_history import PhaseHistory
from ...numerics.double_double import exact_product, quotient
from ...numerics.pulse_geometry import PulseGeometry
from ...opencl.device import Device
from ...opencl.device_list import devices
from ...opencl.launch_numbers import launch_numbers
from ..antenna_beam import GainsFloat64
from ..engine import DirectEngine, RowProfiles, Skipped
from ..focusing_task import FocusingTask
from ..pixel_taper import WEIGHT_BUFFERS, TaperOnDevice
from ..tiling.tiling import Tiling, download_sums
from .plan import CHUNK, Float64Plan

N_CONST = 16  # numbers per pair of tile and pulse: N_CONST of kernels/geometry_float64.clh
PIXEL_BYTES = 56  # bytes per pixel: position, sum, and the compensation of the sum


class DirectFloat64(DirectEngine):
    """The loops over blocks of rows and tiles; see engine.Engine. ValueError on a device without float64."""

    dtype = np.complex128
    least = np.inf

    def __init__(
        self, device: Device, task: FocusingTask, plan: Float64Plan, tiling: Tiling, gain: bool = False
    ) -> None:
        """gain  True: it makes sums of squared gains of the antenna and the rows' weights, instead of an image."""
        if not device.info.fp64:
            raise ValueError(_no_float64(device))
        self.device, self.task, self.plan, self.tiling = device, task, plan, tiling
        self.lanes = device.info.vector_width
        geometry = {"BISTATIC": int(not task.antennas.is_monostatic), "BEAM": int(task.antennas.beam is not None)}
        self.constants = device.kernel("tile_constants_float64.cl", "tile_constants", **geometry)
        self.taper = weights_on(device, task, gain)
        macros = {**geometry, **plan.macros(task.wrap), **self.taper.macros}
        self.kernel = device.kernel("backproject_float64.cl", "backproject", **macros)
        self.group = device.max_group(self.kernel)
        self.table = device.upload(plan.interpolator.table)
        self.profiles = RowProfiles(device, task, plan.interpolator, plan.length, dtype=np.complex128)

    def tiles_at_once(self, nbytes: float) -> int:
        """See DirectEngine: positions and totals take half of nbytes at most, and range profiles the rest."""
        least = 2 * self.profiles.nbytes(1)
        if nbytes < least:
            raise MemoryError(
                f"max_bytes is {text.size_text(nbytes)} but the range profile of one row needs half of "
                f"{text.size_text(least)}; give max_bytes={least:.2g} or more"
            )
        return max(
            1,
            int(
                min(nbytes / 2, self.device.info.max_alloc)
                / ((PIXEL_BYTES + self.taper.pixel_bytes) * self.tiling.per_tile)
            ),
        )

    def fill(
        self, first: int, last: int, flat: FlatArray, budget: float, clock: Clock, on_progress: Callable[[float], None]
    ) -> Skipped:
        """Focus bands first ... last - 1 into `flat`; see engine.Engine."""
        raw, tiling, middle = self.task.raw, self.tiling, self.task.raw.n_rows // 2
        orders = tiling.bands(first, last)[1]
        positions, lanes = by_range(tiling.positions(first, last, orders), raw.tx[middle], raw.rx[middle])
        values, missed = np.empty(positions.shape[:2], np.complex128), np.empty((2, len(positions)), np.int64)
        # as few runs of tiles as fit in memory: every one reads all rows again
        runs = -(-len(positions) // self.tiles_at_once(budget))
        for i in range(runs):
            run = slice(i * len(positions) // runs, (i + 1) * len(positions) // runs)

            def part(rows_done: float, i: int = i) -> None:
                on_progress((i * raw.n_rows + rows_done) / runs)

            sums, missed[:, run] = self._tiles(positions[run], budget, clock, part)
            np.put_along_axis(values[run], lanes[run], sums, axis=1)
        tiling.place(values.ravel(), (first, last), 0, orders, flat)
        clock.lap("write")
        return Skipped.of_tiles(missed, tiling.tile_sizes(first, last))

    def _tiles(
        self, positions: np.ndarray, budget: float, clock: Clock, on_progress: Callable[[float], None]
    ) -> tuple[np.ndarray, np.ndarray]:
        """Pixels (n_tiles, per_tile) at positions, m (n_tiles, per_tile, 3), and rows left out of each (2, n_tiles)."""
        device, raw, plan, n_tiles = self.device, self.task.raw, self.plan, len(positions)
        # on a CPU few rows at a time, so that the samples that neighbouring tiles read stay in its caches
        fit = min(self.profiles.most_rows(2 * CHUNK, 64 * CHUNK), self.profiles.rows_in(budget / 4))
        rows = fit // CHUNK * CHUNK or max(1, fit)
        references = (positions.min(axis=1) + positions.max(axis=1)) / 2
        radius = np.linalg.norm(positions - references[:, None], axis=-1).max(axis=-1)
        pixels = positions.shape[0] * positions.shape[1]
        image, missed = device.zeros(32 * pixels), device.zeros(8 * n_tiles)
        pixels_at = device.upload(positions.reshape(-1, 3).T)
        apertures = self.taper.apertures(positions)
        tile, reach = device.upload(references.T), device.upload(radius)
        profiles = {"stride": self.profiles.stride, "origin": self.profiles.stride // 2}
        skips = {"skip": self.task.skip_flags, "wrap": plan.length if self.task.wrap else 0}
        clock.lap("prepare")
        with self.profiles.pipeline as pipeline:
            for start in range(0, raw.n_rows, rows):
                stop = min(start + rows, raw.n_rows)
                pipeline.new_block()
                block = self.profiles.upload(start, stop)
                pulse_host = packed(raw, self.task.antennas, plan.length, start, stop, self.lanes)
                pulse, n = pipeline.upload(pulse_host), pulse_host.shape[1]
                weights = self.taper.arguments(apertures, start, stop) or WEIGHT_BUFFERS * (self.table,)
                clock.lap("profiles")
                at_once = min(budget / 4 / pipeline.held, device.info.max_alloc)
                step = max(1, min(n_tiles, int(at_once / (8 * N_CONST * n))))
                constants = device.empty(8 * N_CONST * n * step)
                for first in range(0, n_tiles, step):
                    size = (n // self.lanes, min(step, n_tiles - first))
                    tiles = {"n": n, "n_tiles": n_tiles, "first": first}
                    launch = launch_numbers("tile_constants_float64.cl", "tile_constants", **tiles, **skips)
                    device.run(self.constants, size, None, launch, pulse, tile, reach, constants)
                    size = (positions.shape[1] // self.lanes, size[1])
                    group = (size[0], 1) if size[0] <= self.group else None
                    launch = launch_numbers(
                        "backproject_float64.cl", "backproject", **tiles, **profiles, n_used=stop - start, pixels=pixels
                    )
                    buffers = block, self.table, pulse, constants, tile, pixels_at, image, missed
                    device.run(self.kernel, size, group, launch, *buffers, *weights, block, steps=stop - start)
                pipeline.step(partial(on_progress, stop))
                clock.lap("backproject")
        clock.lap("backproject")
        values = download_sums(device, image, pixels, np.float64).reshape(positions.shape[:2])
        return values, device.download(missed, np.empty((2, n_tiles), np.int32)).astype(np.int64)


def weights_on(device: Device, task: FocusingTask, gain: bool = False) -> GainsFloat64 | TaperOnDevice:
    """Buffers of the weights that rows have in each pixel: gains of an antenna, a taper, or none."""
    return TaperOnDevice(device, task, np.float64) if task.antenna is None else GainsFloat64(device, task, gain)


def _no_float64(device: Device) -> str:
    return f"tolerances below 1e-6 need float64, which {device.info.name!r} lacks; its best is 1e-6: {remedy()}"


def remedy() -> str:
    """Remedy on a device without float64."""
    able = [f"{i.index}: {i.name}" for i in devices() if i.works and i.fp64]
    return f"choose device= one of {'; '.join(able)}" if able else "no device here has float64"


def by_range(positions: np.ndarray, tx: np.ndarray, rx: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Points (n_tiles, per_tile, 3) of each tile sorted by their path from tx to rx, and that order.

    Lanes of a vector, and work-items of a group, then read nearly the same samples, for all rows of similar direction.
    """
    path = sum(np.sqrt(((positions - end) ** 2).sum(axis=-1)) for end in (tx, rx))
    order = np.argsort(path, axis=1, kind="stable")
    return np.take_along_axis(positions, order[..., None], axis=1), order


def packed(raw: PhaseHistory, antennas: PulseGeometry, length: int, start: int, stop: int, lanes: int) -> np.ndarray:
    """Array per pulse (components, n) of rows start ... stop - 1 for profiles of `length` samples, in the order of
    kernels/geometry_float64.clh.

    n is rounded up to whole vectors of `lanes` by repeating the last row. Positions and reference ranges are float64
    as given, so exact; what is derived from frequencies comes in pairs: kappa = 2 fc/c with fc the frequency of
    sample n_samples//2, sigma = 2 df length/c, limit = c/(4 df).
    """
    n = -(-(stop - start) // lanes) * lanes
    rows = np.minimum(np.arange(start, start + n), stop - 1)
    step = raw.frequency_step[rows]
    hi, lo = exact_product(float(raw.n_samples // 2), step)
    carrier, low = exact_sum(raw.frequency[rows], hi)
    kappa = quotient(exact_sum(carrier, low + lo), SPEED_OF_LIGHT / 2)
    sigma = quotient(exact_product(float(length), step), SPEED_OF_LIGHT / 2)
    limit = quotient((np.full(n, SPEED_OF_LIGHT / 4), np.zeros(n)), step)
    components = [*raw.tx[rows].T, raw.reference_range[rows], *kappa, *sigma, *limit]
    if not antennas.is_monostatic:
        components += list(antennas.rx[rows].T)
    if antennas.beam is not None:
        half = np.full(n, antennas.beam_angle / 2)
        components += [*antennas.beam[rows].T, np.cos(half), np.sin(half)]
    return np.stack(components)
