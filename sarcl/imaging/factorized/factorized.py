"""Factorised backprojection: pulses are decimated on smaller and smaller tiles, then focused on the smallest.

Relative to the centre of a small tile, the ranges of its pixels change slowly from pulse to pulse, so that fewer pulses
represent them (kernels/merge_subapertures.cl). Cost grows as N^2 log N for N pulses of N samples and N x N pixels.
Source: McCorkle and Rofheart 1996 (quadtree); docs/theory/accuracy.md.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from ...base import float_pairs
from ...base.constants import SPEED_OF_LIGHT
from ...base.stage_timer import Clock
from ...opencl.device import Device
from ...opencl.launch_numbers import launch_numbers
from ..direct.direct import Direct
from ..direct.tile_kernels import TilesOnDevice, kernel_of
from ..engine import Engine, RowProfiles, Skipped
from ..focusing_task import FocusingTask
from ..tiling.tiling import FlatImage, Roots, Tiling
from ..tiling.tree import Tree
from ._memory import MemoryPlan
from ._tile_coverage import TileCoverage, coverage_of, same_coverage, without
from .plan import GUARD, FactorPlan, Level, moving_cost

if TYPE_CHECKING:
    from ...opencl.device import Buffer

MERGE = "merge_subapertures.cl"
SPAN = 32  # vectors of a profile per work-item on CPUs; 1 on GPUs, where neighbouring work-items then read one line


@dataclass(frozen=True, eq=False)
class _Descent:
    """A tree of tiles on the device: sums of pixels, and for each level the centres of the tiles and their parents."""

    tree: Tree
    image: Buffer
    centers: list[Buffer]
    parents: list[Buffer | None]
    ready: TilesOnDevice


class Factorized(Engine):
    """The loops over levels on one device; see engine.Engine."""

    dtype = np.complex64

    def __init__(self, device: Device, task: FocusingTask, plan: FactorPlan, tiling: Tiling) -> None:
        self.device, self.plan, self.tiling = device, plan, tiling
        self.whole = self.task = task
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
            made = plan.between if i else plan.first
            macros = {
                "BISTATIC": int(bistatic),
                "SPAN": self._span,
                "WRAP": plan.length if task.wrap and not i else 0,
                "TAPS": made.taps,
                "TERMS": made.terms,
                "FROM_CENTRE": int(i == 0),
                "FILTER_TAPS": level.decimation.filter.shape[1],
            }
            self.merges.append(
                (
                    device.kernel(MERGE, "shifts", **macros),
                    device.kernel(MERGE, "merge", **macros),
                )
            )
        self.leaves = kernel_of(device, plan.leaf, tiling, bistatic=bistatic, wrap=False, local=True, beam=False)
        self.tables = [device.upload(made.table) for made in (plan.first, plan.between)]
        self.filters = [device.upload(v.decimation.filter) for v in plan.levels]
        self.blocks_of = [device.upload(v.decimation.blocks) for v in plan.levels]
        # kept pulses of each level in the layout of the kernels, about the scene's centre
        self.kept = []
        for v in plan.levels:
            antennas = v.decimation.kept
            packed = antennas.packed(tiling.center, plan.length, 0, len(antennas), self.lanes)
            self.kept.append((device.upload(packed), packed.shape[2], len(antennas)))
        self.strides = [self._stride(v) for v in plan.levels]
        # a root inside the range window still needs guard samples beyond the window for interpolation
        root = plan.levels[0]
        sigma = 2 * float(task.raw.frequency_step.min()) * plan.length / SPEED_OF_LIGHT
        pad = root.reach - (0 if task.wrap else int(root.radius * sigma)) + 2 * GUARD
        self.profiles = RowProfiles(device, self.task, plan.first, plan.length, pad)
        self.least_pixels = 1000.0 * plan.length
        self.memory = MemoryPlan(
            plan, tiling, task.raw.n_rows, self.strides, self.profiles, self.kept[-1][1],
            self.leaves.components, device.info.max_alloc, device.is_cpu,
        )  # fmt: skip

    def _stride(self, level: Level) -> int:
        """Complex samples of a profile of this level, rounded up to whole vectors."""
        whole = max(self.lanes // 2, 1)
        return -(-(2 * level.reach + 1) // whole) * whole

    def blocks(self, nbytes: float) -> list[tuple[int, int]]:
        """Runs of bands to be made with nbytes on the device; see `MemoryPlan.blocks`."""
        return self.memory.blocks(nbytes)

    def repeated(self, nbytes: float) -> float:
        """See engine.Engine: the range profiles of all rows for each part, and merging into the roots that are cut."""
        root = self.plan.levels[0]
        moved = moving_cost(2 * root.reach, self.plan.first.taps, root.decimation.filter.shape[1])
        passes, roots = self.memory.passes(nbytes)
        whole = self.tiling.n_roots(0, self.tiling.n_bands, self.plan.factors[0])
        return (passes - 1) * self.profiles.cost + max(roots - whole, 0) * self.task.raw.n_rows * moved

    def working(self, nbytes: float) -> float:
        """See engine.Engine."""
        return min(self.memory.working(nbytes), nbytes)

    def fill(
        self, first: int, last: int, flat: FlatImage, budget: float, clock: Clock, on_progress: Callable[[float], None]
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
        image = device.zeros(16 * leaves.n_tiles * self.tiling.per_tile)
        down = _Descent(tree, image, [device.upload(float_pairs.wide(c.T)) for c in tree.centers],
                        [None, *(device.upload(p) for p in tree.parents)], self.leaves.ready(leaves, 0))  # fmt: skip
        count = np.array([[reason in self.whole.skips] for reason in ("range window", "beam")])
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
            gathered = device.zeros(8 * (high - low) * self.kept[0][2] * self.strides[0])

            def rows_done(rows: float, low: int = low, high: int = high) -> None:
                on_progress((low * n_rows + (high - low) * rows / 2) / n_roots)

            self._gather(down, low, high, coverage.left_out, gathered, budget, clock, rows_done)
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
        tree, task = down.tree, self.whole
        if rows is not None:
            raw, antennas, weight = self.task.raw[rows], self.antennas.picked(rows), self.task.row_weight[rows]
            task = replace(self.task, raw=raw, antennas=antennas, row_weight=weight)
        picked = np.concatenate([np.arange(*tree.leaves_of(root)) for root in roots])
        engine = Direct(self.device, task, self.plan.edge, self.tiling)
        some = tree.leaves.picked(picked)
        image, missed = engine.add_up(some, budget, clock, lambda rows: None)
        copy = self.device.kernel("assemble_image.cl", "move")
        where = self.device.upload(picked.astype(np.int32))
        per_tile = self.tiling.per_tile
        self.device.run(
            copy, (per_tile, len(picked)), None,
            image, np.uint64(len(picked) * per_tile), where, down.image, np.uint64(tree.leaves.n_tiles * per_tile),
        )  # fmt: skip
        self.device.finish()
        return picked, missed

    def _gather(
        self, down: _Descent, low: int, high: int, left_out: list[np.ndarray | None], out: Buffer, budget: float,
        clock: Clock, on_progress: Callable[[float], None],
    ) -> None:  # fmt: skip
        """First level: add the profiles of all pulses to the kept pulses of roots low ... high - 1.

        left_out  for each root: rows that are not merged into it (n_rows,) bool, or None
        """
        device, plan, task = self.device, self.plan, self.task
        level, raw = plan.levels[0], task.raw
        stride = self.profiles.stride
        shifts, merge = self.merges[0]
        roots, centers = len(down.tree.centers[0]), down.centers[0]
        nowhere = device.upload(np.zeros(roots, np.int32))
        blocks, n_shift = level.decimation.blocks, 2 + 2 * plan.first.taps
        rows = self.memory.rows(budget)
        with self.profiles.pipeline as pipeline:
            for start in range(0, raw.n_rows, rows):
                stop = min(start + rows, raw.n_rows)
                pipeline.new_block()
                source = self.profiles.upload(start, stop)
                packed = task.antennas.packed(self.tiling.center, plan.length, start, stop, self.lanes)
                pulse, n, used = pipeline.upload(packed), packed.shape[2], stop - start
                clock.lap("profiles")
                # blocks of pulses between the same kept pulses, cut at the ends of this block of rows
                begin, end = np.maximum(blocks[:, 0], start), np.minimum(blocks[:, 0] + blocks[:, 1], stop)
                cut = np.stack([begin - start, end - begin, blocks[:, 2], begin - blocks[:, 0]], axis=1)[end > begin]
                step = max(1, int(min(budget / 8 / pipeline.held, device.info.max_alloc) / (4 * n_shift * used)))
                records = device.empty(4 * n_shift * used * min(step, high - low))
                in_use = []  # on a CPU a buffer is memory of the host: it must exist until the kernel has read it
                for tile, count, without_rows in same_coverage(left_out, low, high, step):
                    seen = cut if without_rows is None else without(cut, without_rows[start:stop])
                    if len(seen) == 0:
                        continue
                    cut_buffer = device.upload(seen.astype(np.int32))
                    in_use.append(cut_buffer)
                    device.run(
                        shifts, (n // self.lanes, count), None,
                        launch_numbers(
                            MERGE, "shifts", n_parents=roots, n=n, n_used=used, n_tiles=roots, first=tile,
                            reach=level.reach, samples=self.strides[0], stride=stride, origin=stride // 2,
                        ),
                        pulse, centers, centers, nowhere, self.tables[0], records,
                    )  # fmt: skip
                    device.run(
                        merge, (self._spans(0), count), None,
                        launch_numbers(
                            MERGE, "merge", stride=stride, origin=stride // 2, first_parent=0, n_used=used,
                            n_blocks=len(seen), reach=level.reach, first=tile, out_first=low, n_kept=self.kept[0][2],
                            out_stride=self.strides[0],
                        ),
                        source, nowhere, records, cut_buffer, self.filters[0], out, steps=used,
                    )  # fmt: skip
                pipeline.step(partial(on_progress, stop))
                clock.lap("backproject")
        clock.lap("backproject")

    def _spans(self, level: int) -> int:
        return -(-2 * self.strides[level] // (self._span * (8 if self.lanes > 1 else 2)))

    def _descend(
        self, down: _Descent, level: int, low: int, high: int, source: Buffer, first: int, within: float
    ) -> None:
        """From the profiles of tiles low ... high - 1 of a level to their pixels, through all levels below.

        source, first  profiles of the level, of which the first is that of tile `first`

        within  bytes per level below at a time
        """
        device, plan, tree = self.device, self.plan, down.tree
        pulse, n, used = self.kept[level]
        if level == len(plan.levels) - 1:
            stride = self.strides[level]
            for begin, end in _runs(low, high, within / self.memory.constants):
                self.leaves.add(
                    down.ready, begin, end, self.kept[level], source, stride, plan.levels[level].reach,
                    (begin - first) * used * stride, down.image,
                )  # fmt: skip
                if end < high:
                    device.finish()
            return
        shifts, merge = self.merges[level + 1]
        below, parents = plan.levels[level + 1], down.parents[level + 1]
        n_kept, stride = self.kept[level + 1][2], self.strides[level + 1]
        above = {"stride": self.strides[level], "origin": plan.levels[level].reach}  # of the profiles read
        children = tree.children[level]
        whole = int(children[low]), int(children[high])
        for begin, end in _runs(*whole, within / self.memory.tile_bytes(level + 1)):
            made = device.zeros(8 * (end - begin) * n_kept * stride)
            records = device.empty(4 * (2 + 2 * plan.between.taps) * used * (end - begin))
            device.run(
                shifts, (n // self.lanes, end - begin), None,
                launch_numbers(
                    MERGE, "shifts", n_parents=len(tree.centers[level]), n=n, n_used=used,
                    n_tiles=len(tree.centers[level + 1]), first=begin, reach=below.reach, samples=stride, **above,
                ),
                pulse, down.centers[level], down.centers[level + 1], parents, self.tables[1], records,
            )  # fmt: skip
            device.run(
                merge, (self._spans(level + 1), end - begin), None,
                launch_numbers(
                    MERGE, "merge", first_parent=first, n_used=used, n_blocks=len(below.decimation.blocks),
                    reach=below.reach, first=begin, out_first=begin, n_kept=n_kept, out_stride=stride, **above,
                ),
                source, parents, records, self.blocks_of[level + 1], self.filters[level + 1], made, steps=used,
            )  # fmt: skip
            self._descend(down, level + 1, begin, end, made, begin, within)
            if (begin, end) != whole:
                device.finish()


def _runs(low: int, high: int, most: float) -> Iterator[tuple[int, int]]:
    """low ... high - 1 in runs of `most`, of one at least."""
    step = max(1, int(min(most, high - low)))
    for begin in range(low, high, step):
        yield begin, min(begin + step, high)
