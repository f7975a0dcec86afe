"""Factorised backprojection: pulses are decimated on smaller and smaller tiles, then focused on the smallest.

Relative to the centre of a small tile, the ranges of its pixels change slowly from pulse to pulse, so that fewer pulses
represent them (kernels/merge_subapertures.cl). Cost grows as N^2 log N for N pulses of N samples and N x N pixels.
Source: McCorkle and Rofheart 1996 (quadtree); docs/theory/accuracy.md.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from ...base import float_pairs
from ...base.constants import SPEED_OF_LIGHT
from ...base.stage_timer import Clock
from ...blocks.bands import FlatArray, pages_in_use
from ...opencl.device import Buffer, Device
from ...opencl.launch_numbers import launch_numbers
from ..direct.direct import Direct
from ..direct.tile_kernels import Block, KernelForm, Profiles, Pulses, TilesOnDevice, kernel_of
from ..engine import Engine, RowProfiles, Skipped
from ..focusing_task import FocusingTask
from ..row_norms import largest_sample
from ..tiling.tiling import Roots, Tiling, Tree
from ._memory import MemoryPlan
from ._tile_coverage import TileCoverage, coverage_of, same_coverage, without
from .plan import GUARD, FactorPlan, Level, moving_cost

MERGE = "merge_subapertures.cl"
WARP = 32  # work-items that a GPU works on together
SPAN = 32  # vectors of a profile per work-item on CPUs; 1 on GPUs, where neighbouring work-items then read one line


@dataclass(frozen=True, eq=False)
class _Descent:
    """A tree of tiles on the device: sums of pixels, and for each level the centres of the tiles and their parents."""

    tree: Tree
    image: Buffer
    centers: list[Buffer]
    parents: list[Buffer | None]
    ready: TilesOnDevice


@dataclass(frozen=True, eq=False)
class _Tiles:
    """Tiles first ... first + count - 1 of a level that pulses are merged into.

    parents  numbers of the tiles above, of whose profiles those of `first_parent` come first
    blocks   of pulses, between the same kept pulses, and n_blocks, their number
    """

    level: int
    first: int
    count: int
    parents: Buffer
    first_parent: int
    blocks: Buffer
    n_blocks: int


@dataclass(frozen=True, eq=False)
class _Merged:
    """Profiles of tiles at their kept pulses, of which those of tile `first` come first.

    n_zeroed  kept pulses that have numbers before; the others begin at zero
    """

    buffer: Buffer
    first: int
    n_zeroed: int


class Factorized(Engine):
    """The loops over levels on one device; see engine.Engine."""

    dtype = np.complex64

    def __init__(self, device: Device, task: FocusingTask, plan: FactorPlan, tiling: Tiling) -> None:
        self.device, self.plan, self.tiling = device, plan, tiling
        self.every_row = self.task = task
        if (plan.order != np.arange(len(plan.order))).any():
            raw, antennas, order = task.raw[plan.order], task.antennas, plan.order
            self.task = replace(task, raw=raw, row_weight=task.row_weight[order], antennas=antennas.picked(order))
        # coverage_of decides which tiles lie in a beam, so that the kernels need no beam
        self.antennas = self.task.antennas
        self.task = replace(self.task, antennas=replace(self.antennas, beam=None))
        self.lanes = device.info.vector_width
        self._span = SPAN if self.lanes > 1 else 1
        bistatic = not task.antennas.is_monostatic
        self.merges = []
        for i, level in enumerate(plan.levels):
            interpolator = plan.between if i else plan.first
            macros = {
                "BISTATIC": int(bistatic),
                "SPAN": self._span,
                "WRAP": plan.length if task.wrap and not i else 0,
                "TAPS": interpolator.taps,
                "TERMS": interpolator.terms,
                "FROM_CENTRE": int(i == 0),
                "FILTER_TAPS": level.decimation.filter.shape[1],
            }
            self.merges.append([device.kernel(MERGE, name, **macros) for name in ("shifts", "merge")])
        self.leaves = kernel_of(device, plan.leaf, tiling, KernelForm(bistatic, wrap=False, local=True, beam=False))
        self.tables = [device.upload(interpolator.table) for interpolator in (plan.first, plan.between)]
        self.filters = [device.upload(v.decimation.filter) for v in plan.levels]
        self.blocks_of = [device.upload(v.decimation.blocks) for v in plan.levels]
        # kept pulses of each level in the layout of the kernels, about the scene's centre
        self.kept = []
        for v in plan.levels:
            antennas = v.decimation.kept
            packed = antennas.packed(tiling.center, plan.length, 0, len(antennas), self.lanes)
            self.kept.append(Pulses(device.upload(packed), packed.shape[2], len(antennas)))
        self.strides = [self._stride(v) for v in plan.levels]
        self._buffers: dict[tuple[int, int], tuple[int, Buffer]] = {}
        # a root inside the range window still needs guard samples beyond the window for interpolation
        root = plan.levels[0]
        sigma = 2 * float(task.raw.frequency_step.min()) * plan.length / SPEED_OF_LIGHT
        pad = root.reach - (0 if task.wrap else int(root.radius * sigma)) + 2 * GUARD
        self.largest = largest_sample(task)
        self.profiles = RowProfiles(device, self.task, plan.first, plan.length, pad, largest=self.largest)
        self.least = 1000.0 * plan.length
        self.memory = MemoryPlan(
            plan=plan,
            tiling=tiling,
            n_rows=task.raw.n_rows,
            strides=self.strides,
            profiles=self.profiles,
            last_kept=self.kept[-1].n,
            components=self.leaves.components,
            max_alloc=device.info.max_alloc,
            is_cpu=device.is_cpu,
        )

    def _stride(self, level: Level) -> int:
        """Complex samples of a profile of this level, rounded up to whole vectors."""
        pair_lanes = max(self.lanes // 2, 1)
        return -(-(2 * level.reach + 1) // pair_lanes) * pair_lanes

    def blocks(self, nbytes: float) -> list[tuple[int, int]]:
        """Runs of bands to be made with nbytes on the device; see `MemoryPlan.blocks`."""
        return self.memory.blocks(nbytes)

    def repeated(self, nbytes: float) -> float:
        """See engine.Engine: the range profiles of all rows for each part, and merging into the roots that are cut."""
        root = self.plan.levels[0]
        moved = moving_cost(2 * root.reach, self.plan.first.taps, root.decimation.filter.shape[1])
        passes, roots = self.memory.passes(nbytes)
        uncut_roots = self.tiling.n_roots(0, self.tiling.n_bands, self.plan.factors[0])
        return (passes - 1) * self.profiles.cost + max(roots - uncut_roots, 0) * self.task.raw.n_rows * moved

    def working(self, nbytes: float) -> float:
        """See engine.Engine."""
        return min(self.memory.working(nbytes), nbytes)

    def fill(
        self, first: int, last: int, flat: FlatArray, budget: float, clock: Clock, on_progress: Callable[[float], None]
    ) -> Skipped:
        """Focus bands first ... last - 1 into `flat`; see engine.Engine."""
        tiling, n_rows = self.tiling, self.task.raw.n_rows
        skipped, done, of = Skipped(), 0, tiling.pixels(first, last)

        def part_of(pixels: int) -> Callable[[float], None]:
            return lambda rows: on_progress((done * n_rows + rows * pixels) / of)

        roots = coverage = None
        for section in tiling.sections(self.memory.parts(first, last, budget), self.plan.factors):
            if section.roots is not roots:
                roots, coverage = section.roots, self._coverage(section.roots)
            assert coverage is not None
            tree, pixels = section.tree, section.tree.leaves.n_tiles * tiling.per_tile
            with pages_in_use(self.device, flat, tiling.extent(*section.part[:2])):
                image, missed = self._sums(tree, coverage.of(section.which), budget, clock, part_of(pixels))
            tiling.place_section(self.device, image, section, flat)
            skipped += Skipped.of_tiles(missed, section.sizes)
            done += pixels
            clock.lap("write")
        return skipped

    def _sums(
        self, tree: Tree, coverage: TileCoverage, budget: float, clock: Clock, on_progress: Callable[[float], None]
    ) -> tuple[Buffer, np.ndarray]:
        """Sums of the leaves' pixels (4, pixels), on the device, and rows left out of each (2, n leaves)."""
        device, leaves, n_rows = self.device, tree.leaves, self.task.raw.n_rows
        nbytes = 16 * leaves.n_tiles * self.tiling.per_tile
        device.release(nbytes)
        image = device.zeros(nbytes)
        centers = [device.upload(float_pairs.wide(c.T)) for c in tree.centers]
        parents = [None, *(device.upload(p) for p in tree.parents)]
        down = _Descent(tree, image, centers, parents, self.leaves.ready(leaves, 0))
        count = np.array([[reason in self.every_row.skips] for reason in ("range window", "beam")])
        n_roots = len(tree.centers[0])
        each = [b - a for a, b in map(tree.leaves_of, range(n_roots))]
        missed = np.repeat(coverage.missed, each, axis=1) * count
        clock.lap("prepare")
        # rows that are added directly come first: their sums are stored, and merged rows are added to them
        for roots, rows in coverage.directly:
            picked, skipped = self._add_directly(down, roots, rows, budget / 2, clock)
            missed[:, picked] += skipped
        step, within, below = self.memory.at_once(tree, budget)
        edges = np.flatnonzero(np.diff(np.concatenate([[False], coverage.merged, [False]])))
        for low, high in edges.reshape(-1, 2).tolist():
            gathered = device.empty(8 * (high - low) * self.kept[0].n_used * self.strides[0])

            def rows_done(rows: float, low: int = low, high: int = high) -> None:
                on_progress((low * n_rows + (high - low) * rows / 2) / n_roots)

            self._gather(down, (low, high), coverage.left_out, gathered, budget, clock, rows_done)
            queued = 0.0
            for root in range(low, high, step):
                self._descend(down, 0, root, min(root + step, high), gathered, low, within)
                queued += step * below
                if queued > budget / 8:  # queued kernels hold the memory of their profiles
                    device.finish()
                    queued = 0.0
            device.finish()
            clock.lap("backproject")
        on_progress(n_rows)
        return image, missed

    def _coverage(self, roots: Roots) -> TileCoverage:
        """Coverage of roots by all rows."""
        plan = self.plan
        # the cost of merging does not depend on the number of rows that are merged
        least = self.task.raw.n_rows * plan.cost / plan.edge.cost
        return coverage_of(self.antennas, roots, self.tiling.center, plan.levels[0].radius, least)

    def _add_directly(
        self, down: _Descent, roots: np.ndarray, rows: np.ndarray | None, budget: float, clock: Clock
    ) -> tuple[np.ndarray, np.ndarray]:
        """Store in the leaves of these roots the sums of rows (indices; None: all), by the direct method.

        Returns the leaves, and the rows skipped in each (2, n).
        """
        tree, task = down.tree, self.every_row
        if rows is not None:
            raw, antennas, weight = self.task.raw[rows], self.antennas.picked(rows), self.task.row_weight[rows]
            task = replace(self.task, raw=raw, antennas=antennas, row_weight=weight)
        picked = np.concatenate([np.arange(*tree.leaves_of(root)) for root in roots])
        engine = Direct(self.device, task, self.plan.edge, self.tiling, largest=self.largest)
        image, missed = engine.add_up(tree.leaves.picked(picked), budget, clock, lambda rows: None)
        move = self.device.kernel("assemble_image.cl", "move")
        numbers, per_tile = self.device.upload(picked.astype(np.int32)), self.tiling.per_tile
        n_picked, n_pixels = np.uint64(len(picked) * per_tile), np.uint64(tree.leaves.n_tiles * per_tile)
        self.device.run(move, (per_tile, len(picked)), None, image, n_picked, numbers, down.image, n_pixels)
        self.device.finish()
        return picked, missed

    def _gather(
        self,
        down: _Descent,
        roots: tuple[int, int],
        left_out: list[np.ndarray | None],
        gathered: Buffer,
        budget: float,
        clock: Clock,
        on_progress: Callable[[float], None],
    ) -> None:
        """First level: add the profiles of all pulses to the kept pulses of roots (first, last + 1).

        left_out  for each root: rows that are not merged into it (n_rows,) bool, or None
        """
        device, plan, task, (low, high) = self.device, self.plan, self.task, roots
        level, raw = plan.levels[0], task.raw
        nowhere = device.upload(np.zeros(len(down.tree.centers[0]), np.int32))
        blocks, n_shift = level.decimation.blocks, 4 + plan.first.taps
        rows = self.memory.rows(budget)
        with self.profiles.pipeline as pipeline:
            for start in range(0, raw.n_rows, rows):
                stop = min(start + rows, raw.n_rows)
                pipeline.new_block()
                stride = self.profiles.stride
                profiles = Profiles(self.profiles.upload(start, stop), stride, stride // 2)
                packed = task.antennas.packed(self.tiling.center, plan.length, start, stop, self.lanes)
                pulses = Pulses(pipeline.upload(packed), packed.shape[2], stop - start)
                clock.lap("profiles")
                # blocks of pulses between the same kept pulses, cut at the ends of this block of rows
                begin, end = np.maximum(blocks[:, 0], start), np.minimum(blocks[:, 0] + blocks[:, 1], stop)
                cut = np.stack([begin - start, end - begin, blocks[:, 2], begin - blocks[:, 0]], axis=1)[end > begin]
                record_bytes = 4 * n_shift * pulses.n_used
                step = max(1, int(min(budget / 8 / pipeline.held, device.info.max_alloc) / record_bytes))
                records = device.empty(record_bytes * min(step, high - low))
                in_use = []  # on a CPU a buffer is memory of the host: it must exist until the kernel has read it
                for tile, count, without_rows in same_coverage(left_out, low, high, step):
                    seen = cut if without_rows is None else without(cut, without_rows[start:stop])
                    if len(seen) == 0 and start:
                        continue
                    cut_buffer = device.upload(seen.astype(np.int32)) if len(seen) else nowhere
                    in_use.append(cut_buffer)
                    tiles = _Tiles(0, tile, count, nowhere, 0, cut_buffer, len(seen))
                    self._shift(down, tiles, pulses, profiles, records)
                    merged = _Merged(gathered, low, self.kept[0].n_used if start else 0)
                    self._merge(tiles, pulses, profiles, records, merged)
                pipeline.step(partial(on_progress, stop))
                clock.lap("backproject")
        clock.lap("backproject")

    def _shift(self, down: _Descent, tiles: _Tiles, pulses: Pulses, profiles: Profiles, records: Buffer) -> None:
        """Make the records by which `_merge` moves the profiles of the level above to tiles."""
        level, centers, above = tiles.level, down.centers, max(tiles.level - 1, 0)
        numbers = {"n_parents": len(down.tree.centers[above]), "n": pulses.n, "n_used": pulses.n_used}
        numbers |= {"n_tiles": len(down.tree.centers[level]), "first": tiles.first}
        numbers |= {"reach": self.plan.levels[level].reach, "samples": self.strides[level]}
        launch = launch_numbers(MERGE, "shifts", **numbers, stride=profiles.stride, origin=profiles.origin)
        tables, size = self.tables[min(level, 1)], (pulses.n // self.lanes, tiles.count)
        buffers = pulses.buffer, centers[above], centers[level], tiles.parents, tables, records
        self.device.run(self.merges[level][0], size, None, launch, *buffers)

    def _merge(self, tiles: _Tiles, pulses: Pulses, profiles: Profiles, records: Buffer, merged: _Merged) -> None:
        """Add the profiles of the level above to the kept pulses of tiles."""
        level = tiles.level
        numbers = {"stride": profiles.stride, "origin": profiles.origin, "first_parent": tiles.first_parent}
        numbers |= {"n_used": pulses.n_used, "n_blocks": tiles.n_blocks, "reach": self.plan.levels[level].reach}
        numbers |= {"first": tiles.first, "out_first": merged.first, "n_kept": self.kept[level].n_used}
        launch = launch_numbers(MERGE, "merge", **numbers, out_stride=self.strides[level], n_zeroed=merged.n_zeroed)
        size = (self._spans(level), tiles.count)
        buffers = profiles.buffer, tiles.parents, records, tiles.blocks, self.filters[level], merged.buffer
        self.device.run(self.merges[level][1], size, None, launch, *buffers, steps=pulses.n_used)

    def _buffer(self, nbytes: int, level: int, use: int) -> Buffer:
        """A buffer of so many bytes at least, for one use at a level: the same again, whose memory is in the caches."""
        if self._buffers.get((level, use), (0,))[0] < nbytes:
            self._buffers[level, use] = (nbytes, self.device.empty(nbytes))
        return self._buffers[level, use][1]

    def _spans(self, level: int) -> int:
        spans = -(-2 * self.strides[level] // (self._span * (8 if self.lanes > 1 else 2)))
        return -(-spans // WARP) * WARP if self.lanes == 1 and spans > 8 * WARP else spans  # groups are whole warps

    def _descend(
        self, down: _Descent, level: int, low: int, high: int, source: Buffer, first: int, within: float
    ) -> None:
        """From the profiles of tiles low ... high - 1 of a level to their pixels, through all levels below.

        source, first  profiles of the level, of which the first is that of tile `first`

        within  bytes per level below at a time
        """
        device, plan, tree, pulses = self.device, self.plan, down.tree, self.kept[level]
        stride, origin = self.strides[level], plan.levels[level].reach
        if level == len(plan.levels) - 1:
            for begin, end in _runs(low, high, within / self.memory.constants):
                profiles = Profiles(source, stride, origin, (begin - first) * pulses.n_used * stride)
                self.leaves.add(down.ready, begin, end, Block(pulses, profiles), down.image)
                if end < high:
                    device.finish()
            return
        below, parents = level + 1, down.parents[level + 1]
        assert parents is not None
        children = tree.children[level]
        every = int(children[low]), int(children[high])
        for begin, end in _runs(*every, within / self.memory.tile_bytes(below)):
            merged = self._buffer(8 * (end - begin) * self.kept[below].n_used * self.strides[below], below, 0)
            records = self._buffer(4 * (4 + plan.between.taps) * pulses.n_used * (end - begin), below, 1)
            n_blocks = len(plan.levels[below].decimation.blocks)
            tiles = _Tiles(below, begin, end - begin, parents, first, self.blocks_of[below], n_blocks)
            profiles = Profiles(source, stride, origin)
            self._shift(down, tiles, pulses, profiles, records)
            self._merge(tiles, pulses, profiles, records, _Merged(merged, begin, 0))
            self._descend(down, below, begin, end, merged, begin, within)
            if (begin, end) != every:
                device.finish()


def _runs(low: int, high: int, most: float) -> Iterator[tuple[int, int]]:
    """low ... high - 1 in runs of `most`, of one at least."""
    step = max(1, int(min(most, high - low)))
    for begin in range(low, high, step):
        yield begin, min(begin + step, high)
