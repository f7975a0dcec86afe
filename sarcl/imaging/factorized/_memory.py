"""How much a factorised run makes at a time: profiles of tiles, level by level, and pixels within so many bytes."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from ...base import text
from ..tile_tree import Tree
from ..tiling import Part, Tiling
from .plan import FactorPlan

ROWS = 256  # rows a block of the first level
AT_ONCE = 16e6  # bytes of profiles below the first level at a time on a CPU: they stay in its caches
PIXEL_BYTES = 24  # a pixel: its sums, and its value where it is fetched


@dataclass(frozen=True, eq=False)
class MemoryPlan:
    """The sizes that a plan's pieces have on one device.

    strides        complex samples of a tile's profile, by level; source_stride of a row's own
    last_nodes     nodes of the last level, as padded for the device; components: floats of a (leaf, node) record
    max_alloc      bytes of the largest buffer
    """

    plan: FactorPlan
    tiling: Tiling
    n_rows: int
    strides: list[int]
    source_stride: int
    last_nodes: int
    components: int
    max_alloc: float
    is_cpu: bool

    def blocks(self, nbytes: float) -> list[tuple[int, int]]:
        """Runs of bands, whole tiles of the first level, whose profiles there and pixels fit in half of nbytes.

        A run of such tiles that is alone may be larger: `Factorized.fill` makes it in parts. MemoryError where nbytes
        is too little for one tile.
        """
        tiling = self.tiling
        high, least = tiling.root_bands(self.plan.factors[0]), self._least()
        if nbytes < least:
            raise MemoryError(
                f"max_bytes is {text.size_text(nbytes)} but the range profiles of 16 rows, and a tile of "
                f"{self.plan.levels[0].side} pixels a side with its profiles, need {text.size_text(least)}; give "
                f"max_bytes={least * 1.01:.2e} or more, or method='direct'"
            )
        blocks, first = [], 0
        while first < tiling.n_bands:
            last = min(first + high, tiling.n_bands)
            while last < tiling.n_bands and self._fits(first, min(last + high, tiling.n_bands), nbytes):
                last = min(last + high, tiling.n_bands)
            blocks.append((first, last))
            first = last
        return blocks

    def working(self, nbytes: float) -> float:
        """Bytes that `Factorized.fill` takes for the first block, about, when it is given nbytes."""
        first, last = self.blocks(nbytes)[0]
        tops, pixels = self.tiling.part_size(next(self.parts(first, last, nbytes)), self.plan.factors[0])
        rows = min(self.rows(nbytes), self.n_rows)
        return self.n_bytes(tops, pixels) + 8.0 * self.source_stride * rows + 2 * min(AT_ONCE, nbytes / 8)

    def rows(self, nbytes: float) -> int:
        """Rows a block of the first level."""
        return max(16, min(ROWS, int(nbytes / 16 // (8 * self.source_stride)) // 16 * 16))

    def n_bytes(self, tops: int, pixels: int) -> float:
        """Of the first level's profiles, and pixels."""
        each = PIXEL_BYTES + self.tiling.offset_bytes
        return float(tops) * self.plan.levels[0].n_bytes(self.strides[0]) + float(each) * pixels

    def _fits(self, first: int, last: int, nbytes: float) -> bool:
        """These bands can be made in one."""
        tops, pixels = self.tiling.n_roots(first, last, self.plan.factors[0]), self.tiling.pixels(first, last)
        largest = max(self.n_bytes(tops, 0), 16.0 * pixels)
        return self.n_bytes(tops, pixels) <= nbytes / 2 and largest <= self.max_alloc

    def most(self, nbytes: float, bands: int = 0) -> int:
        """Tiles of the first level at a time, cut to so many bands of a plane; 0 where not even one fits."""
        factor = self.plan.factors[0]
        pixels = self.tiling.root_leaves(factor, bands or factor) * self.tiling.per_tile
        alloc = self.max_alloc / max(self.n_bytes(1, 0), 16.0 * pixels)
        return int(min(nbytes / 2 / self.n_bytes(1, pixels), alloc))

    def _least(self) -> float:
        """The least bytes that do: for 16 rows, and for a tile of the first level, of a plane cut to one band."""
        pixels = self.tiling.root_leaves(self.plan.factors[0], 1) * self.tiling.per_tile
        return max(8.0 * 16 * 8 * self.source_stride, 2 * self.n_bytes(1, pixels))

    def parts(self, first: int, last: int, nbytes: float) -> Iterator[Part]:
        """Bands first ... last - 1 in parts that fit: runs of roots, or one of them cut."""

        def most(bands: int) -> int:
            return self.most(nbytes, bands)

        whole = self._fits(first, last, nbytes)
        return self.tiling.parts((first, last), self.plan.factors[0], most, whole)

    def at_once(self, tree: Tree, budget: float) -> tuple[int, float, float]:
        """How the levels below the first are made: so many tiles of the first at a time, each of so many bytes.

        Between these two: the bytes a level may take at a time within one such tile; no limit where it fits whole.
        """
        each, profiles = 0.0, 0.0
        for i in range(1, len(tree.centers)):
            made = len(tree.centers[i]) / len(tree.centers[0])
            profiles += made * self.plan.levels[i].n_bytes(self.strides[i])
            each += made * self.tile_bytes(i)
        each += tree.leaves.n_tiles / len(tree.centers[0]) * self.constants
        most = min((AT_ONCE if self.is_cpu else budget / 8) / max(profiles, 1.0), budget / 8 / each)
        return max(1, int(most)), np.inf if each <= budget / 8 else budget / 8 / len(tree.centers), each

    def tile_bytes(self, level: int) -> float:
        """Of a tile of a lower level: its profiles, and how those above it are moved to it."""
        records = 4 * (2 + 2 * self.plan.between.taps) * len(self.plan.levels[level - 1].decimation.nodes)
        return float(self.plan.levels[level].n_bytes(self.strides[level]) + records)

    @property
    def constants(self) -> float:
        """Bytes of what a leaf shares with its nodes."""
        return 4.0 * self.components * self.last_nodes
