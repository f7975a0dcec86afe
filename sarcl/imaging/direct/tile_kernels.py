"""The kernels that add a block of pulses to tiles of pixels, with their buffers on the device.

Both serve the direct method, where each pulse has one range profile, and the factorised method (`local`), where every
tile has profiles of its own, relative to its reference point.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import partial
from typing import NamedTuple

import numpy as np

from ...base import float_pairs
from ...numerics.plan import Plan
from ...numerics.tile_constants import TileConstants
from ...numerics.tiles import Tiles
from ...opencl.device import Buffer, Device
from ...opencl.group_sizes import first_allowed
from ...opencl.launch_numbers import launch_numbers
from ..pixel_taper import WEIGHT_BUFFERS
from ..tiling.plane import LineTiling
from ..tiling.tiling import Tiling
from . import _shared_line_plan, line_plan
from ._line_curvature import steps
from ._shared_line_plan import ENTRY, SharedLinePlan
from .line_plan import LinePlan

CHUNK = 64  # rows added in float32 before the compensated total; blocks of rows are multiples of it
REGISTERS = 128  # of work-items that sum slopes too: two groups of 256 on a multiprocessor of NVIDIA
AT_ONCE = 2  # work-groups of lines that a multiprocessor works on at a time
VECTORS = 4  # vectors of pixels per work-item of the per-pixel kernel


class Pulses(NamedTuple):
    """Pulses on the device: the packed array, its length with padding, and the number of pulses."""

    buffer: Buffer
    n: int
    n_used: int


class Profiles(NamedTuple):
    """Range profiles on the device: samples of one with its padding, the place of delay 0, and the first sample."""

    buffer: Buffer
    stride: int
    origin: int
    offset: int = 0


class Block(NamedTuple):
    """Pulses that are added to tiles, with their range profiles.

    weights  buffers of the pulses' weights in the pixels: `TaperOnDevice.arguments`, `AntennaOnDevice.arguments`
    second   where the receiving antenna's pattern begins, as AntennaOnDevice has it
    """

    pulses: Pulses
    profiles: Profiles
    weights: tuple[Buffer | None, ...] = ()
    second: int = 0


@dataclass(frozen=True)
class KernelForm:
    """Cases that kernels are built for: transmitter and receiver apart, profiles that repeat, or of each tile, a beam.

    weights  of pulses in the pixels: macros of kernels/pixel_weights.clh
    """

    bistatic: bool
    wrap: bool
    local: bool
    beam: bool
    weights: Mapping[str, int] = field(default_factory=lambda: {"WEIGHT": 0})


class GatherKernel:
    """Per-pixel backprojection of any tiles: kernels/backproject.cl."""

    chunk, least_rows = CHUNK, 1

    def __init__(self, device: Device, plan: Plan, tiling: Tiling, form: KernelForm) -> None:
        self.device, self.beam = device, form.beam
        self.lanes = device.info.vector_width
        macros = {**plan.macros(form.bistatic, form.wrap), "LOCAL": int(form.local), "VECTORS": VECTORS, "CHUNK": CHUNK}
        macros |= {"BEAM": int(form.beam), "NATIVE": int(plan.native), **form.weights}
        if macros.get("WEIGHT") == 3:  # it reads no profile
            macros |= {"TAPS": 2, "TERMS": 1}
        self.components = plan.components(form.bistatic, form.beam)
        self.constants = TileConstants(
            device, plan, bistatic=form.bistatic, wrap=form.wrap, local=form.local, beam=form.beam
        )
        self.kernel = device.kernel("backproject.cl", "backproject", **macros)
        self.group = device.max_group(self.kernel)
        self.table = device.upload(plan.interpolator.table)
        self.magic = float_pairs.magic(plan.steps[1]) if plan.range_mode == 3 else 0.0

    def ready(self, tiles: Tiles, skip: int) -> TilesOnDevice:
        """Upload tiles; skip: SKIP_WINDOW and SKIP_BEAM of kernels/geometry.clh."""
        device = self.device
        parts = [float_pairs.wide(tiles.references.T), tiles.radius.astype(np.float32), tiles.offsets]
        return TilesOnDevice(device, tiles, skip, [device.upload(p) for p in parts], self.beam)

    def add(self, on: TilesOnDevice, low: int, high: int, block: Block, image: Buffer) -> None:
        """Add a block of pulses to tiles low ... high - 1 of `image` (4, pixels)."""
        tiles = on.tiles
        centers, radius, offsets = on.buffers
        pulses = block.pulses
        constants = self.constants.compute(
            pulses.buffer, pulses.n, centers, radius, (low, high), tiles.n_tiles, on.skip
        )
        items = tiles.per_tile // self.lanes // VECTORS
        assert self.lanes > 1 or items % 16 == 0, "NEIGHBOURS of kernels/backproject.cl have pixels together"
        numbers = on.numbers(low, block) | {
            "n_offsets": tiles.offsets.shape[1],
            "offset_step": 0 if tiles.shared else tiles.per_tile // self.lanes,
            "local_offset": block.profiles.offset,
            "magic": self.magic,
            "second": block.second,
        }
        # on CPUs an item is a group: PoCL builds the kernel again for each size of groups
        of_tile = 1 if self.device.is_cpu else items
        size, group = (items, high - low), (of_tile, 1) if of_tile <= self.group else None
        launch = launch_numbers("backproject.cl", "backproject", **numbers)
        tables = block.profiles.buffer, self.table, pulses.buffer, constants, centers, offsets
        weights = block.weights or WEIGHT_BUFFERS * (self.table,)
        self.device.run(self.kernel, size, group, launch, *tables, image, on.missed, *weights, steps=pulses.n_used)


class _Lines:
    """Base class of the kernels by lines of pixels: tiles on the device, and the records of their pulses."""

    def __init__(self, device: Device, plan: LinePlan, tiling: LineTiling, form: KernelForm, **records: int) -> None:
        if form.weights["WEIGHT"]:
            raise RuntimeError("lines of pixels share the weights of their pulses; please report this")
        self.device, self.tiling, self.beam, self.local = device, tiling, form.beam, form.local
        geometry = {"BISTATIC": int(form.bistatic), "BEAM": int(form.beam)}
        self.macros = plan.macros(form.bistatic, form.wrap) | geometry
        # LOCAL alone: the program of TileConstants, with the same macros
        records |= {"LOCAL": int(form.local), "RANGE": 0}
        self.records = device.kernel("tile_constants.cl", "line_constants", **geometry, **records)
        self.wrap, self.fine = plan.length if form.wrap else 0, plan.fine
        assert tiling.grid.spacing is not None
        self.steps = dict(zip(("step_y", "step_x"), tiling.grid.spacing, strict=True))
        self.axes = device.upload(float_pairs.wide(steps(tiling.grid)))
        self.limits = plan.limits

    def ready(self, tiles: Tiles, skip: int) -> TilesOnDevice:
        """Upload tiles; skip: SKIP_WINDOW and SKIP_BEAM of kernels/geometry.clh."""
        centers = self.device.upload(float_pairs.wide(tiles.references.T))
        return TilesOnDevice(self.device, tiles, skip, [centers], self.beam)

    def constants(self, on: TilesOnDevice, low: int, high: int, pulses: Pulses, floats: int) -> Buffer:
        """Records (tiles, n, floats) of pulses at tiles low ... high - 1, on the device."""
        records = self.device.empty(4 * floats * pulses.n * (high - low))
        numbers = {"n": pulses.n, "n_tiles": on.tiles.n_tiles, "first": low, "skip": on.skip}
        numbers |= {"wrap": self.wrap, "fine": self.fine}
        launch = launch_numbers("tile_constants.cl", "line_constants", **numbers, radius=self.tiling.radius)
        size = (pulses.n // self.device.info.vector_width, high - low)
        self.device.run(self.records, size, None, launch, pulses.buffer, on.buffers[0], self.axes, records)
        return records


class LineKernel(_Lines):
    """Backprojection of square tiles of a plane, line by line: kernels/backproject_lines.cl."""

    def __init__(self, device: Device, plan: LinePlan, tiling: LineTiling, form: KernelForm) -> None:
        super().__init__(device, plan, tiling, form)
        self.components = line_plan.components(form.beam)
        # the pulses of a group share one curvature, so blocks of rows are whole groups
        self.chunk = self.least_rows = plan.group
        self.kernel = device.kernel("backproject_lines.cl", "backproject_lines", **self.macros)
        self.table, self.weights = device.upload(plan.interpolator.table), device.upload(plan.line.table)

    def add(self, on: TilesOnDevice, low: int, high: int, block: Block, image: Buffer) -> None:
        """Add a block of pulses to tiles low ... high - 1 of `image` (4, pixels)."""
        constants = self.constants(on, low, high, block.pulses, self.components)
        numbers = on.numbers(low, block) | {"local_offset": block.profiles.offset, **self.steps, **self.limits}
        numbers |= {"group_size": self.least_rows, "own_profiles": self.local}
        launch = launch_numbers("backproject_lines.cl", "backproject_lines", **numbers)
        buffers = block.profiles.buffer, self.table, self.weights, constants, image, on.missed
        self.device.run(self.kernel, (high - low,), (1,), launch, *buffers, steps=block.pulses.n_used)


class SharedLineKernel(_Lines):
    """Square tiles of a plane by lines that a work-group shares: kernels/backproject_shared_lines.cl."""

    chunk = _shared_line_plan.CHUNK

    def __init__(self, device: Device, plan: SharedLinePlan, tiling: LineTiling, form: KernelForm) -> None:
        super().__init__(device, plan, tiling, form, SHARED=1)
        self.plan, self.least_rows, self.n_line = plan, plan.group, line_plan.components(form.beam) + 8
        self.components = self.n_line + ENTRY + 1  # and a pulse's share of its group's record
        self.schedule = device.kernel("schedule_pulses.cl", "schedule_pulses", **self.macros)
        bound = REGISTERS if plan.slopes and device.bounds_registers else 0
        macros = self.macros | {"REGISTERS": bound}
        built = partial(device.kernel, "backproject_shared_lines.cl", "backproject_shared_lines", **macros)
        # the sums of pixels are the same with fewer items
        sizes = [plan.items >> n for n in range((plan.items // plan.least_items).bit_length())]
        self.items, (self.kernel,) = first_allowed(device, sizes, lambda items: (built(ITEMS=items),))
        self.add_parts = device.kernel("assemble_image.cl", "add_parts")
        interpolators = (plan.interpolator, plan.line, plan.slopes or plan.line)
        self.tables = [np.ravel(one.table) for one in interpolators]  # structs of the kernel's arguments

    def add(self, on: TilesOnDevice, low: int, high: int, block: Block, image: Buffer) -> None:
        """Add a block of pulses to tiles low ... high - 1 of `image` (4, pixels)."""
        device, pulses, items = self.device, block.pulses, self.items
        groups = -(-pulses.n_used // self.plan.group)
        constants = self.constants(on, low, high, pulses, self.n_line)
        schedule = device.empty(4 * (4 + ENTRY * self.plan.group) * groups * (high - low))
        numbers = {"n": pulses.n, "n_used": pulses.n_used, **self.steps, **self.limits}
        launch = launch_numbers("schedule_pulses.cl", "schedule_pulses", **numbers)
        device.run(self.schedule, (groups, high - low), None, launch, constants, schedule)
        each = self._groups_at_once(groups, on.tiles.n_tiles)
        parts = -(-groups // each)
        sums = image if parts == 1 else device.zeros(parts * image.size)
        numbers = on.numbers(low, block) | self.steps | {"groups": each}
        launch = launch_numbers("backproject_shared_lines.cl", "backproject_shared_lines", **numbers)
        buffers = *self.tables, block.profiles.buffer, constants, schedule, sums, on.missed
        size, group = (items, high - low, parts), (items, 1, 1)
        device.run(self.kernel, size, group, launch, *buffers, steps=pulses.n_used / parts)
        if parts > 1:
            device.run(self.add_parts, (image.size // 16,), None, sums, parts, image)

    def _groups_at_once(self, groups: int, tiles: int) -> int:
        """Groups of pulses that a work-group adds up: all of them, or a part where an image has too few tiles to occupy
        the device. The sums of parts are added one after another: images have the same bits in every run."""
        parts = min(groups, -(-AT_ONCE * self.device.info.units // tiles))
        return -(-groups // parts)


class TilesOnDevice:
    """Tiles on the device, with the buffers of a kernel, and two counts per tile: the pulses whose range window misses
    the tile, and those whose beam does."""

    def __init__(self, device: Device, tiles: Tiles, skip: int, buffers: list[Buffer], beam: bool) -> None:
        self.device, self.tiles, self.skip, self.buffers, self.beam = device, tiles, int(skip), buffers, beam
        self.counts = 1 + beam
        self.missed = device.zeros(4 * self.counts * tiles.n_tiles)

    def numbers(self, low: int, block: Block) -> dict[str, float]:
        """Numbers that all kernels need to add a block of pulses to tiles from `low` on."""
        (_, n, n_used), profiles, tiles = block.pulses, block.profiles, self.tiles
        pixels = tiles.n_tiles * tiles.per_tile
        numbers: dict[str, float] = {"stride": profiles.stride, "origin": profiles.origin, "n": n, "n_used": n_used}
        return numbers | {"first": low, "n_tiles": tiles.n_tiles, "pixels": pixels}

    def skipped(self) -> np.ndarray:
        """Numbers of pulses left out of every tile, (2, n_tiles) int64: by their range window, and by their beam."""
        counts = self.device.download(self.missed, np.empty((self.counts, self.tiles.n_tiles), np.int32))
        return np.stack([counts[0], counts[-1] if self.beam else np.zeros_like(counts[0])]).astype(np.int64)


def kernel_of(
    device: Device, plan: Plan | LinePlan, tiling: Tiling, form: KernelForm
) -> GatherKernel | LineKernel | SharedLineKernel:
    """The kernel for a plan."""
    if isinstance(plan, LinePlan):
        assert isinstance(tiling, LineTiling)
        if isinstance(plan, SharedLinePlan):
            return SharedLineKernel(device, plan, tiling, form)
        return LineKernel(device, plan, tiling, form)
    return GatherKernel(device, plan, tiling, form)
