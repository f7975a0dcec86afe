"""The kernels that add a block of pulses to tiles of pixels, with their buffers on the device.

Both serve the direct method, where each pulse has one range profile, and the factorised method (`local`), where every
tile has profiles of its own, relative to its reference point.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from ...base import float_pairs
from ...numerics.plan import Plan
from ...numerics.tile_constants import TileConstants
from ...numerics.tiles import Tiles
from ...opencl.device import Device
from ...opencl.launch_numbers import launch_numbers
from ..tiling.lines import LineTiling
from ..tiling.tiling import Tiling
from . import _shared_line_plan, line_plan
from ._line_curvature import steps
from ._shared_line_plan import SharedLinePlan
from .line_plan import LinePlan

CHUNK = 64  # rows added in float32 before the compensated total; blocks of rows are multiples of it
ENTRY = 24  # numbers that a pulse takes in the record of its group: N_ENTRY of kernels/line_schedule.clh
NO_WEIGHTS = {"WEIGHT": 0}  # of pulses in the pixels: macros of kernels/pixel_weights.clh
VECTORS = 4  # vectors of pixels per work-item of the per-pixel kernel

# pulses on the device: the packed array, its length with padding, and the number of pulses
Pulses = tuple[Any, int, int]


class GatherKernel:
    """Per-pixel backprojection of any tiles: kernels/backproject.cl."""

    chunk, least_rows = CHUNK, 1

    def __init__(
        self, device: Device, plan: Plan, tiling: Tiling, *, bistatic: bool, wrap: bool, local: bool, beam: bool,
        weights: Mapping[str, int] = NO_WEIGHTS,
    ) -> None:  # fmt: skip
        self.device, self.beam = device, beam
        self.lanes = device.info.vector_width
        macros = {**plan.macros(bistatic, wrap), "LOCAL": int(local), "VECTORS": VECTORS, "CHUNK": CHUNK}
        macros |= {"BEAM": int(beam), "NATIVE": int(plan.native), **weights}
        self.components = plan.components(bistatic, beam)
        self.constants = TileConstants(device, plan, bistatic=bistatic, wrap=wrap, local=local, beam=beam)
        self.kernel = device.kernel("backproject.cl", "backproject", **macros)
        self.group = device.max_group(self.kernel)
        self.table = device.upload(plan.interpolator.table)
        self.magic = float_pairs.magic(plan.steps[1]) if plan.range_mode == 3 else 0.0

    def ready(self, tiles: Tiles, skip: int) -> TilesOnDevice:
        """Upload tiles; skip: SKIP_WINDOW and SKIP_BEAM of kernels/geometry.clh."""
        device = self.device
        parts = [float_pairs.wide(tiles.references.T), tiles.radius.astype(np.float32), tiles.offsets]
        return TilesOnDevice(device, tiles, skip, [device.upload(p) for p in parts], self.beam)

    def add(
        self, on: TilesOnDevice, low: int, high: int, pulses: Pulses, source: Any, stride: int, origin: int,
        offset: int, image: Any, *weights: Any, second: int = 0,
    ) -> None:  # fmt: skip
        """Add a block of pulses to tiles low ... high - 1 of `image` (4, pixels); profiles begin at sample `offset`.

        weights  buffers of the pulses' weights in the pixels: `TaperOnDevice.arguments`, `AntennaOnDevice.arguments`
        second   where the receiving antenna's pattern begins, as AntennaOnDevice has it
        """
        device, (pulse, n, used), tiles = self.device, pulses, on.tiles
        centers, radius, offsets = on.buffers
        constants = self.constants.compute(pulse, n, centers, radius, (low, high), tiles.n_tiles, on.skip)
        items = tiles.per_tile // self.lanes // VECTORS
        assert self.lanes > 1 or items % 16 == 0, "NEIGHBOURS of kernels/backproject.cl have pixels together"
        device.run(
            self.kernel, (items, high - low), (items, 1) if items <= self.group else None,
            launch_numbers(
                "backproject.cl", "backproject", stride=stride, origin=origin, n=n, n_used=used, n_tiles=tiles.n_tiles,
                first=low, n_offsets=tiles.offsets.shape[1],
                offset_step=0 if tiles.shared else tiles.per_tile // self.lanes, pixels=tiles.n_tiles * tiles.per_tile,
                local_offset=offset, magic=self.magic, second=second,
            ),
            source, self.table, pulse, constants, centers, offsets, image, on.missed, *weights, steps=used,
        )  # fmt: skip


class _Lines:
    """What both kernels by lines of pixels share: tiles on the device, and the records of their pulses."""

    def __init__(
        self, device: Device, plan: LinePlan, tiling: LineTiling, *, bistatic: bool, wrap: bool, beam: bool,
        weights: Mapping[str, int], **records: int,
    ) -> None:  # fmt: skip
        if weights["WEIGHT"]:
            raise RuntimeError("lines of pixels share the weights of their pulses; please report this")
        self.device, self.tiling, self.beam = device, tiling, beam
        self.geometry = {"BISTATIC": int(bistatic), "BEAM": int(beam)}
        self.macros = plan.macros(bistatic, wrap, bool(records["LOCAL"])) | self.geometry
        # LOCAL alone: the program of TileConstants, with the same macros
        self.records = device.kernel("tile_constants.cl", "line_constants", **self.geometry, **records, RANGE=0)
        self.wrap, self.fine = plan.length if wrap else 0, plan.fine
        assert tiling.grid.spacing is not None
        self.steps = dict(zip(("step_y", "step_x"), tiling.grid.spacing, strict=True))
        self.axes = device.upload(float_pairs.wide(steps(tiling.grid)))
        self.limits = {name: getattr(plan, name) for name in ("limit_cycles", "limit_position", "limit_step")}

    def ready(self, tiles: Tiles, skip: int) -> TilesOnDevice:
        """Upload tiles; skip: SKIP_WINDOW and SKIP_BEAM of kernels/geometry.clh."""
        return TilesOnDevice(
            self.device, tiles, skip, [self.device.upload(float_pairs.wide(tiles.references.T))], self.beam
        )

    def constants(self, on: TilesOnDevice, low: int, high: int, pulse: Any, n: int, floats: int) -> Any:
        """Records (tiles, n, floats) of pulses at tiles low ... high - 1, on the device."""
        out = self.device.empty(4 * floats * n * (high - low))
        self.device.run(
            self.records, (n // self.device.info.vector_width, high - low), None,
            launch_numbers(
                "tile_constants.cl", "line_constants", n=n, n_tiles=on.tiles.n_tiles, first=low, skip=on.skip,
                wrap=self.wrap, fine=self.fine, radius=self.tiling.radius,
            ),
            pulse, on.buffers[0], self.axes, out,
        )  # fmt: skip
        return out


class LineKernel(_Lines):
    """Backprojection of square tiles of a plane, line by line: kernels/backproject_lines.cl."""

    def __init__(
        self, device: Device, plan: LinePlan, tiling: LineTiling, *, bistatic: bool, wrap: bool, local: bool,
        beam: bool, weights: Mapping[str, int] = NO_WEIGHTS,
    ) -> None:  # fmt: skip
        super().__init__(
            device, plan, tiling, bistatic=bistatic, wrap=wrap, beam=beam, weights=weights, LOCAL=int(local)
        )
        self.components = line_plan.components(beam)
        # the pulses of a group share one curvature, so blocks of rows are whole groups
        self.chunk = self.least_rows = plan.group
        self.kernel = device.kernel("backproject_lines.cl", "backproject_lines", **self.macros)
        self.table, self.weights = device.upload(plan.interpolator.table), device.upload(plan.line.table)

    def add(
        self, on: TilesOnDevice, low: int, high: int, pulses: Pulses, source: Any, stride: int, origin: int,
        offset: int, image: Any, *weights: Any, second: int = 0,
    ) -> None:  # fmt: skip
        """Add a block of pulses to tiles low ... high - 1 of `image` (4, pixels); profiles begin at sample `offset`."""
        (pulse, n, used), tiles = pulses, on.tiles
        constants = self.constants(on, low, high, pulse, n, self.components)
        self.device.run(
            self.kernel, (high - low,), (1,),
            launch_numbers(
                "backproject_lines.cl", "backproject_lines", stride=stride, origin=origin, n=n, n_used=used, first=low,
                n_tiles=tiles.n_tiles, pixels=tiles.n_tiles * tiles.per_tile, local_offset=offset, **self.steps,
                **self.limits,
            ),
            source, self.table, self.weights, constants, image, on.missed, steps=used,
        )  # fmt: skip


class SharedLineKernel(_Lines):
    """Square tiles of a plane by lines that a work-group shares: kernels/backproject_shared_lines.cl."""

    chunk = _shared_line_plan.CHUNK

    def __init__(
        self, device: Device, plan: SharedLinePlan, tiling: LineTiling, *, bistatic: bool, wrap: bool, local: bool,
        beam: bool, weights: Mapping[str, int] = NO_WEIGHTS,
    ) -> None:  # fmt: skip
        super().__init__(
            device, plan, tiling, bistatic=bistatic, wrap=wrap, beam=beam, weights=weights, LOCAL=int(local), SHARED=1
        )
        self.plan, self.least_rows, self.n_line = plan, plan.group, line_plan.components(beam) + 8
        self.components = self.n_line + ENTRY + 1  # and a pulse's share of its group's record
        self.schedule = device.kernel("schedule_pulses.cl", "schedule_pulses", **self.macros)
        self.kernel = device.kernel("backproject_shared_lines.cl", "backproject_shared_lines", **self.macros)
        tables = (plan.interpolator, plan.line, plan.slopes or plan.line)
        self.tables = [np.ravel(made.table) for made in tables]  # structs of the kernel's arguments

    def add(
        self, on: TilesOnDevice, low: int, high: int, pulses: Pulses, source: Any, stride: int, origin: int,
        offset: int, image: Any, *weights: Any, second: int = 0,
    ) -> None:  # fmt: skip
        """Add a block of pulses to tiles low ... high - 1 of `image` (4, pixels)."""
        device, (pulse, n, used), tiles = self.device, pulses, on.tiles
        groups, items = -(-used // self.plan.group), self.plan.items
        constants = self.constants(on, low, high, pulse, n, self.n_line)
        schedule = device.empty(4 * (4 + ENTRY * self.plan.group) * groups * (high - low))
        device.run(
            self.schedule, (groups, high - low), None,
            launch_numbers(
                "schedule_pulses.cl", "schedule_pulses", n=n, n_used=used, **self.steps, **self.limits,
            ),
            constants, schedule,
        )  # fmt: skip
        device.run(
            self.kernel, (items, high - low), (items, 1),
            launch_numbers(
                "backproject_shared_lines.cl", "backproject_shared_lines", stride=stride, origin=origin, n=n,
                n_used=used, first=low, n_tiles=tiles.n_tiles, pixels=tiles.n_tiles * tiles.per_tile, **self.steps,
            ),
            *self.tables, source, constants, schedule, image, on.missed, steps=used,
        )  # fmt: skip


class TilesOnDevice:
    """Tiles on the device, with the buffers of a kernel, and two counts per tile: the pulses whose range window misses
    the tile, and those whose beam does."""

    def __init__(self, device: Device, tiles: Tiles, skip: int, buffers: list[Any], beam: bool) -> None:
        self.device, self.tiles, self.skip, self.buffers, self.beam = device, tiles, int(skip), buffers, beam
        self.counts = 1 + beam
        self.missed = device.zeros(4 * self.counts * tiles.n_tiles)

    def skipped(self) -> np.ndarray:
        """Numbers of pulses left out of every tile, (2, n_tiles) int64: by their range window, and by their beam."""
        counts = self.device.download(self.missed, np.empty((self.counts, self.tiles.n_tiles), np.int32))
        return np.stack([counts[0], counts[-1] if self.beam else np.zeros_like(counts[0])]).astype(np.int64)


def kernel_of(
    device: Device, plan: Plan | LinePlan, tiling: Tiling, **how: Any
) -> GatherKernel | LineKernel | SharedLineKernel:
    """The kernel for a plan; how: bistatic, wrap, local, beam, weights."""
    if isinstance(plan, LinePlan):
        assert isinstance(tiling, LineTiling)
        if isinstance(plan, SharedLinePlan):
            return SharedLineKernel(device, plan, tiling, **how)
        return LineKernel(device, plan, tiling, **how)
    return GatherKernel(device, plan, tiling, **how)
