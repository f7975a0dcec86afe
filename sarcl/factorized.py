"""Factorised backprojection: pulses are thinned out on smaller and smaller tiles, then focused on the smallest.

About the centre of a small tile, what its pixels see changes slowly from pulse to pulse, so fewer pulses carry it
(kernels/merge.cl). Cost grows as N^2 log N for N pulses of N samples and N x N pixels. Source: McCorkle and Rofheart
1996 (quadtree); docs/accuracy.md.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from . import cl, profiles
from .check import SPEED_OF_LIGHT
from .direct import Direct
from .factor_plan import GUARD, FactorPlan, Level, leaf_antennas
from .geometry import Tiles
from .passes import Placed, pass_of
from .planning import Clock
from .sight import Sight, alike, look, without
from .task import Task, tally
from .tiling import GridTiling
from .tree import Tree, tree_of

ROWS = 256  # rows a block of the first level
AT_ONCE = 16e6  # bytes of profiles below the first level at a time on a CPU: they stay in its caches
SPAN = 32  # vectors of a profile a work-item


@dataclass(frozen=True, eq=False)
class _Descent:
    """A tree of tiles on the device: sums of pixels, and per level the tiles' centres and which tile they lie in."""

    tree: Tree
    image: Any
    centers: list[Any]
    parents: list[Any]
    ready: Placed


class Factorized:
    """The loops over levels on one device; see task.Engine."""

    dtype = np.complex64

    def __init__(self, device: cl.Device, task: Task, plan: FactorPlan, tiling: GridTiling) -> None:
        self.device, self.plan, self.tiling = device, plan, tiling
        self.whole = self.task = task
        if (plan.order != np.arange(len(plan.order))).any():
            raw, antennas, order = task.raw[plan.order], task.antennas, plan.order
            self.task = replace(task, raw=raw, row_weight=task.row_weight[order], antennas=antennas.picked(order))
        # which tiles a beam lights is found out here: the kernels never see one
        self.antennas = self.task.antennas
        self.task = replace(self.task, antennas=replace(self.antennas, beam=None))
        self.lanes = device.info.vector_width
        bistatic = task.antennas.rx is not None
        self.merges = []
        for i, level in enumerate(plan.levels):
            made = plan.between if i else plan.first
            macros = {
                "BISTATIC": int(bistatic),
                "SPAN": SPAN,
                "WRAP": plan.length if task.wrap and not i else 0,
                "TAPS": made.taps,
                "TERMS": made.table.shape[-1],
                "FROM_CENTRE": int(i == 0),
                "NODES": level.thinning.filter.shape[1],
            }
            self.merges.append(
                (device.kernel("merge.cl", "shifts", **macros), device.kernel("merge.cl", "merge", **macros))
            )
        self.leaves = pass_of(device, plan.leaf, tiling, bistatic=bistatic, wrap=False, local=True, beam=False)
        self.tables = [device.upload(made.table) for made in (plan.first, plan.between)]
        self.filters = [device.upload(v.thinning.filter) for v in plan.levels]
        self.blocks_of = [device.upload(v.thinning.blocks) for v in plan.levels]
        self.sample_weight = task.sample_weight * profiles.correction(plan.first, task.raw.n_samples, plan.length)
        # nodes of each level as the kernels want them, about the scene's centre
        self.nodes = []
        for v in plan.levels:
            antennas = leaf_antennas(v.thinning.nodes)
            packed = antennas.packed(tiling.center, plan.length, 0, len(antennas.tx), self.lanes)
            self.nodes.append((device.upload(packed), packed.shape[2], len(antennas.tx)))
        self.strides = [self._stride(v) for v in plan.levels]

    def _stride(self, level: Level) -> int:
        """Complex samples of a profile of this level: whole vectors."""
        whole = max(self.lanes // 2, 1)
        return -(-(2 * level.reach + 1) // whole) * whole

    def blocks(self, nbytes: float) -> list[tuple[int, int]]:
        """Runs of bands, whole tiles of the first level, whose profiles there fit in half of nbytes."""
        tiling, level = self.tiling, self.plan.levels[0]
        high = self.plan.factors[0] if tiling.grid.is_plane else 1
        least = 8 * (self.plan.length + 4 * GUARD) * 16
        if least > nbytes / 8:
            raise MemoryError(
                f"max_bytes is {cl.size_text(nbytes)} but 16 rows' range profiles need {cl.size_text(least)}, an "
                f"eighth of it at most; give max_bytes={8 * least:.2g} or more"
            )
        blocks, first = [], 0
        while first < tiling.n_bands:
            last = min(first + high, tiling.n_bands)
            while last < tiling.n_bands and self._bytes(level, first, min(last + high, tiling.n_bands)) <= nbytes / 2:
                last = min(last + high, tiling.n_bands)
            blocks.append((first, last))
            first = last
        return blocks

    @property
    def least_pixels(self) -> int:
        """Making a row's profile anew for every block costs as much as this many pixels, ten times over."""
        return 1000 * self.plan.length

    def _bytes(self, level: Level, first: int, last: int) -> float:
        """Of the first level's profiles and the pixels of these bands, about."""
        tiles = self.tiling.pixels(first, last) / self.tiling.per_tile / self.plan.factors[0] ** 2
        return tiles * level.n_bytes(self.strides[0]) + 24 * self.tiling.pixels(first, last)

    def fill(self, first: int, last: int, flat: Any, budget: float, clock: Clock, tick: Callable[[float], None]) -> int:
        """Focus bands first ... last - 1 into `flat`; see task.Engine."""
        device, tiling = self.device, self.tiling
        tree = tree_of(tiling, first, last, self.plan.factors)
        leaves = tree.leaves
        image = device.zeros(16 * leaves.n_tiles * tiling.per_tile)
        down = _Descent(tree, image, [device.upload(cl.wide(c.T)) for c in tree.centers],
                        [None, *(device.upload(p) for p in tree.parents)], self.leaves.ready(leaves, 0))  # fmt: skip
        sight = self._look(tree, first, last)
        count = np.array([[reason in self.whole.skips] for reason in ("range window", "beam")])
        missed = sight.missed * count
        clock.lap("prepare")
        # directly first: the sums are put in place, and what is merged is added to them
        for tops, rows in sight.directly:
            picked, skipped = self._add_directly(down, tops, rows, budget, clock)
            missed[:, picked] += skipped
        for low, high in self._batches(sight.merged, budget):
            gathered = device.zeros(8 * (high - low) * self.nodes[0][2] * self.strides[0])
            self._gather(down, low, high, sight.left_out, gathered, budget, clock, tick)
            step = self._at_once(tree, budget)
            for top in range(low, high, step):
                self._descend(down, 0, top, min(top + step, high), gathered, low)
            device.finish()
            clock.lap("backproject")
        tick(self.task.raw.n_rows)
        sizes = tiling.tile_sizes(first, last)
        if tiling.grid.is_plane:
            made = tiling.download(device, image, first, last, tree.slot)
            flat[first * tiling.high : first * tiling.high + len(made)] = made
        else:
            sums = device.download(image, np.empty((4, leaves.n_tiles * tiling.per_tile), np.float32))
            values = ((sums[0] + sums[2]) + 1j * (sums[1] + sums[3])).astype(np.complex64)
            tiling.place(values, first, last, tiling.bands(first, last)[1], flat)
        clock.lap("write")
        return tally(missed, sizes[tree.slot])

    def _look(self, tree: Tree, first: int, last: int) -> Sight:
        """How rows see the largest tiles of bands first ... last - 1."""
        tiling, plan = self.tiling, self.plan
        if tiling.grid.is_plane:
            line_of = (first + tree.slot // tiling.across) // plan.factors[0]
        else:
            bands = range(first, last)
            line_of = np.repeat(bands, [tiling.pixels(b, b + 1) // tiling.per_tile for b in bands])
        first_leaf = np.array([tree.leaves_of(top)[0] for top in range(len(tree.centers[0]))])
        # merging costs the same for any number of rows
        least = self.task.raw.n_rows * plan.cost / plan.edge.cost
        return look(self.antennas, tree, tiling, plan.levels[0].radius, line_of[first_leaf], least)

    def _batches(self, whole: np.ndarray, budget: float) -> Iterator[tuple[int, int]]:
        """Runs of whole tiles whose profiles fit in half the budget."""
        most = max(1, int(budget / 2 // self.plan.levels[0].n_bytes(self.strides[0])))
        edges = np.flatnonzero(np.diff(np.concatenate([[False], whole, [False]])))
        for begin, end in edges.reshape(-1, 2):
            for low in range(begin, end, most):
                yield low, min(low + most, int(end))

    def _at_once(self, tree: Tree, budget: float) -> int:
        """Largest tiles whose profiles below the first level are made at a time."""
        below = sum(
            len(c) / len(tree.centers[0]) * v.n_bytes(n)
            for c, v, n in zip(tree.centers[1:], self.plan.levels[1:], self.strides[1:], strict=True)
        )
        return max(1, int(min(AT_ONCE if self.device.is_cpu else budget / 8, budget / 8) // max(below, 1)))

    def _add_directly(
        self, down: _Descent, tops: np.ndarray, rows: np.ndarray | None, budget: float, clock: Clock
    ) -> tuple[np.ndarray, np.ndarray]:
        """Leaves of these largest tiles get what rows (indices; None: all) add to them, directly, and nothing else.

        Returns the leaves, and rows skipped in each (2, n).
        """
        tree, task = down.tree, self.whole
        if rows is not None:
            raw, antennas, weight = self.task.raw[rows], self.antennas.picked(rows), self.task.row_weight[rows]
            task = replace(self.task, raw=raw, antennas=antennas, row_weight=weight)
        picked = np.concatenate([np.arange(*tree.leaves_of(top)) for top in tops])
        engine = Direct(self.device, task, self.plan.edge, self.tiling)
        some = Tiles(
            self.tiling.per_tile, tree.leaves.references[picked], tree.leaves.radius[picked],
            tree.leaves.tile_offsets(picked), tree.leaves.shared,
        )  # fmt: skip
        image, missed = engine.add_up(some, budget, clock, lambda rows: None)
        copy = self.device.kernel("untile.cl", "move")
        where = self.device.upload(picked.astype(np.int32))
        per_tile = self.tiling.per_tile
        self.device.run(
            copy, (per_tile, len(picked)), None,
            image, np.uint64(len(picked) * per_tile), where, down.image, np.uint64(tree.leaves.n_tiles * per_tile),
        )  # fmt: skip
        self.device.finish()
        return picked, missed

    def _gather(
        self, down: _Descent, low: int, high: int, left_out: list[np.ndarray | None], out: Any, budget: float,
        clock: Clock, tick: Callable[[float], None],
    ) -> None:  # fmt: skip
        """First level: profiles of all pulses become those of nodes about the largest tiles low ... high - 1.

        left_out  by tile: rows that have no part in it (n_rows,) bool, or None
        """
        device, plan, task = self.device, self.plan, self.task
        level, raw = plan.levels[0], task.raw
        sigma = 2 * float(raw.frequency_step.min()) * plan.length / SPEED_OF_LIGHT
        # a tile that lies in the window may reach beyond it with what its profiles have to spare
        spare = level.reach - (0 if task.wrap else int(level.radius * sigma))
        pad = min(spare + 2 * GUARD, plan.length)
        stride = plan.length + 2 * pad
        shifts, merge = self.merges[0]
        tops, centers = len(down.tree.centers[0]), down.centers[0]
        nowhere = device.upload(np.zeros(tops, np.int32))
        blocks, n_shift = level.thinning.blocks, 2 + 2 * plan.first.taps
        rows = min(ROWS, int(budget / 8 // (8 * stride)) // 16 * 16)
        for start in range(0, raw.n_rows, rows):
            stop = min(start + rows, raw.n_rows)
            weights = task.row_weight[start:stop, None] * self.sample_weight
            source = device.upload(
                profiles.from_samples(device, raw.read(start, stop), weights, plan.first, plan.length, pad)
            )
            packed = task.antennas.packed(self.tiling.center, plan.length, start, stop, self.lanes)
            pulse, n, used = device.upload(packed), packed.shape[2], stop - start
            clock.lap("profiles")
            # blocks of pulses that share their nodes, cut where this block of rows begins and ends
            begin, end = np.maximum(blocks[:, 0], start), np.minimum(blocks[:, 0] + blocks[:, 1], stop)
            cut = np.stack([begin - start, end - begin, blocks[:, 2], begin - blocks[:, 0]], axis=1)[end > begin]
            step = max(1, int(min(budget / 8, device.info.max_alloc) / (4 * n_shift * used)))
            records = device.empty(4 * n_shift * used * min(step, high - low))
            kept = []  # a buffer on a CPU is the host's memory: it must last until it has been used
            for tile, count, without_rows in alike(left_out, low, high, step):
                seen = cut if without_rows is None else without(cut, without_rows[start:stop])
                if len(seen) == 0:
                    continue
                cut_buffer = device.upload(seen.astype(np.int32))
                kept.append(cut_buffer)
                device.run(
                    shifts, (n // self.lanes, count), None,
                    pulse, centers, tops, centers, nowhere, self.tables[0], n, used, tops, tile, level.reach,
                    self.strides[0], stride, stride // 2, records,
                )  # fmt: skip
                device.run(
                    merge, (self._spans(0), count), None,
                    source, stride, stride // 2, 0, nowhere, records, used, cut_buffer, len(seen), self.filters[0],
                    level.reach, tile, low, self.nodes[0][2], self.strides[0], out,
                )  # fmt: skip
            device.finish()
            clock.lap("backproject")
            tick(0.5 * stop)

    def _spans(self, level: int) -> int:
        return -(-2 * self.strides[level] // (SPAN * (8 if self.lanes > 1 else 2)))

    def _descend(self, down: _Descent, level: int, low: int, high: int, source: Any, first: int) -> None:
        """Tiles low ... high - 1 of a level, whose profiles begin with tile `first` in `source`, and all below them."""
        device, plan, tree = self.device, self.plan, down.tree
        pulse, n, used = self.nodes[level]
        if level == len(plan.levels) - 1:
            stride = self.strides[level]
            offset = (low - first) * used * stride
            self.leaves.add(
                down.ready, low, high, self.nodes[level], source, stride, plan.levels[level].reach, offset, down.image
            )
            return
        begin, end = int(tree.children[level][low]), int(tree.children[level][high])
        shifts, merge = self.merges[level + 1]
        below, parents = plan.levels[level + 1], down.parents[level + 1]
        nodes, stride = self.nodes[level + 1][2], self.strides[level + 1]
        made = device.zeros(8 * (end - begin) * nodes * stride)
        records = device.empty(4 * (2 + 2 * plan.between.taps) * used * (end - begin))
        device.run(
            shifts, (n // self.lanes, end - begin), None,
            pulse, down.centers[level], len(tree.centers[level]), down.centers[level + 1], parents, self.tables[1],
            n, used, len(tree.centers[level + 1]), begin, below.reach, stride, self.strides[level],
            plan.levels[level].reach, records,
        )  # fmt: skip
        device.run(
            merge, (self._spans(level + 1), end - begin), None,
            source, self.strides[level], plan.levels[level].reach, first, parents, records, used,
            self.blocks_of[level + 1], len(below.thinning.blocks), self.filters[level + 1], below.reach, begin, begin,
            nodes, stride, made,
        )  # fmt: skip
        self._descend(down, level + 1, begin, end, made, begin)
