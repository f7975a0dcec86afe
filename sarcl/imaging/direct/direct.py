"""Direct backprojection: every (row, pixel) pair that is not skipped."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np

from ...base import text
from ...base.stage_timer import Clock
from ...blocks.bands import FlatArray, pages_in_use
from ...numerics import cost_model
from ...numerics.cost_model import CPU, DeviceClass
from ...numerics.plan import Plan, ProfileSums, cheapest
from ...numerics.tiles import Tiles
from ...opencl.device import Buffer, Device
from ..antenna_beam import AntennaOnDevice
from ..engine import DirectEngine, RowProfiles, Skipped
from ..focusing_task import FocusingTask
from ..pixel_taper import TaperOnDevice
from ..tiling.of_grid import tiling_of
from ..tiling.plane import LineTiling
from ..tiling.tiling import Tiling
from . import _shared_line_plan, line_plan
from .line_plan import LinePlan
from .tile_kernels import CHUNK, Block, KernelForm, Profiles, Pulses, kernel_of

LEAST_COST = 0.9  # cost per contribution below that of every plan pixel by pixel


def make_plan(task: FocusingTask, tolerance: float, devices: DeviceClass = CPU) -> tuple[Plan | LinePlan, Tiling]:
    """The cheapest plan whose predicted error is at most `tolerance`, and the tiling of the grid that it uses.

    devices  those that follow the plan
    ToleranceUnreachable names the best tolerance that can be met.
    """
    grid = task.grid
    by_lines: LinePlan | None = None
    if not task.weighs_pixels and grid.is_plane:  # lines share the weights of their pulses
        if devices.lanes:
            by_lines = line_plan.choose(task, task.antennas, tolerance)
        elif devices.local_memory and task.pairs >= cost_model.SHARING_PAYS:
            by_lines = _shared_line_plan.choose(task, tolerance, devices)
    if by_lines is not None and not task.resolves_beam(LineTiling(grid, by_lines.side).radius):
        by_lines = None
    if by_lines is not None and by_lines.cost < LEAST_COST:
        return by_lines, LineTiling(grid, by_lines.side)
    tilings = {side**2: tiling_of(grid, side) for side in (32, 16, 8)}
    distance, n_samples = task.antennas.distance(grid.bounds), task.raw.n_samples
    plan = cheapest(
        tolerance,
        [(n, tiling.radius) for n, tiling in tilings.items() if n == 64 or task.resolves_beam(tiling.radius)],
        ProfileSums(distance, task.highest, task.bandwidth, n_samples, grid.size, CHUNK),
        least_tolerance=0.0,
        gathering=devices.gathering,
        native_error=devices.native_error if devices.native_pays(tolerance) else None,
    )
    if by_lines is not None and by_lines.cost < plan.cost:
        return by_lines, LineTiling(grid, by_lines.side)
    return plan, tilings[plan.per_tile]


class Direct(DirectEngine):
    """The loops over blocks of rows and tiles on one device; see engine.Engine."""

    dtype = np.complex64

    def __init__(
        self,
        device: Device,
        task: FocusingTask,
        plan: Plan | LinePlan,
        tiling: Tiling,
        gain: bool = False,
        largest: float | None = None,
    ) -> None:
        """gain  True: it makes sums of squared gains of the antenna and the rows' weights, instead of an image

        largest  as RowProfiles takes it
        """
        self.device, self.task, self.plan, self.tiling = device, task, plan, tiling
        self.lanes = device.info.vector_width
        self.taper = TaperOnDevice(device, task, np.float32)
        self.antenna = None if task.antenna is None else AntennaOnDevice(device, task, gain)
        form = KernelForm(
            bistatic=not task.antennas.is_monostatic,
            wrap=task.wrap,
            local=False,
            beam=task.antennas.beam is not None,
            weights=self.antenna.macros if self.antenna else self.taper.macros,
        )
        self.kernels = kernel_of(device, plan, tiling, form)
        self.profiles = RowProfiles(device, task, plan.interpolator, plan.length, largest=largest)
        # per row, making the range profile costs a tenth of adding it to this many pixels: on a CPU, on a GPU, and on a
        # GPU whose profiles the host makes. For GPUs they are inferred from 2e11 pixels/s: none was measured
        each = 400 if device.is_cpu else 3000 if self.profiles.on_device else 50_000
        self.least = float(each * plan.length)

    def _shares(self, nbytes: float) -> tuple[float, float, float]:
        """Bytes for range profiles, pixels and constants of tiles: a quarter, a half and a quarter of nbytes.

        Profiles get more where they need it, half of nbytes at most.
        """
        least, chunk = (self.profiles.nbytes(n) for n in (self.kernels.least_rows, self.kernels.chunk))
        if least > nbytes / 2:
            raise MemoryError(
                f"max_bytes is {text.size_text(nbytes)} but the range profiles of {self.kernels.least_rows} rows, the "
                f"least that are added up at a time, need {text.size_text(least)}, half of it at most; give "
                f"max_bytes={2 * least:.2g} or more"
            )
        rows = max(nbytes / 4, min(chunk, nbytes / 2))
        alloc = float(self.device.info.max_alloc)
        return min(rows, alloc), min((nbytes - rows) * 2 / 3, alloc), min((nbytes - rows) / 3, alloc)

    def tiles_at_once(self, nbytes: float) -> int:
        """See DirectEngine: sums, and offsets where each tile has its own, fit in the share of the pixels."""
        pixel_bytes = 16 + self.tiling.offset_bytes + self.taper.pixel_bytes
        return max(1, int(self._shares(nbytes)[1] / (pixel_bytes * self.tiling.per_tile)))

    def fill(
        self, first: int, last: int, flat: FlatArray, budget: float, clock: Clock, on_progress: Callable[[float], None]
    ) -> Skipped:
        """Focus bands first ... last - 1 into `flat`; see engine.Engine."""
        tiling = self.tiling
        tiles, orders = tiling.bands(first, last)
        most = self.tiles_at_once(budget)
        skipped = Skipped()
        for start in range(0, tiles.n_tiles, most):
            stop = min(start + most, tiles.n_tiles)

            def rows_done(rows: float, start: int = start, stop: int = stop) -> None:
                on_progress((start * self.task.raw.n_rows + (stop - start) * rows) / tiles.n_tiles)

            part = tiles if stop - start == tiles.n_tiles else tiles.picked(np.arange(start, stop))
            with pages_in_use(self.device, flat, tiling.extent(first, last)):
                image, missed = self.add_up(part, budget, clock, rows_done)
            tiling.place_sums(self.device, image, (first, last), (start, stop), orders, flat)
            skipped += Skipped.of_tiles(missed, tiling.tile_sizes(first, last)[start:stop])
        clock.lap("write")
        return skipped

    def add_up(
        self, tiles: Tiles, budget: float, clock: Clock, on_progress: Callable[[float], None]
    ) -> tuple[Buffer, np.ndarray]:
        """Add all rows to these tiles: their sums (4, pixels) on the device, and rows left out of each (2, n_tiles)."""
        device, raw, kernels, stride = self.device, self.task.raw, self.kernels, self.profiles.stride
        for_rows, _, for_constants = self._shares(budget)
        # on a CPU few rows at a time, so that the samples that neighbouring tiles read stay in its caches
        most = min(self.profiles.most_rows(128, 4096), self.profiles.rows_in(for_rows))
        most = max(most, kernels.least_rows)
        rows = most // kernels.chunk * kernels.chunk or most // kernels.least_rows * kernels.least_rows
        nbytes = 16 * tiles.n_tiles * tiles.per_tile
        device.release(nbytes)
        image = device.zeros(nbytes)
        on = kernels.ready(tiles, self.task.skip_flags)
        second = self.antenna.second if self.antenna else 0
        apertures = self.taper.apertures(tiles.positions + self.tiling.center) if self.task.taper is not None else None
        clock.lap("prepare")
        with self.profiles.pipeline as pipeline:
            for start in range(0, raw.n_rows, rows):
                stop = min(start + rows, raw.n_rows)
                pipeline.new_block()
                profiles = Profiles(self.profiles.upload(start, stop), stride, stride // 2)
                packed = self.task.antennas.packed(self.tiling.center, self.plan.length, start, stop, self.lanes)
                pulses = Pulses(pipeline.upload(packed), packed.shape[2], stop - start)
                weights = self.taper.arguments(apertures, start, stop)
                if self.antenna:
                    weights = self.antenna.arguments(start, stop)
                clock.lap("profiles")
                at_once = int(for_constants / (4 * kernels.components * packed.shape[2] * pipeline.held))
                step = max(1, min(tiles.n_tiles, at_once))
                block = Block(pulses, profiles, weights, second)
                for tile in range(0, tiles.n_tiles, step):
                    end = min(tile + step, tiles.n_tiles)
                    kernels.add(on, tile, end, block, image)
                    if end < tiles.n_tiles:  # the constants of these tiles are freed before many more are made
                        pipeline.step()
                pipeline.step(partial(on_progress, stop))
                clock.lap("backproject")
        clock.lap("backproject")
        return image, on.skipped()
