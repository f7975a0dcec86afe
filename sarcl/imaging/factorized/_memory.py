"""Blocks of factorised backprojection within a memory limit: profiles of tiles, level by level, and pixels."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from ...base import text
from ..engine import RowProfiles
from ..tiling.tiling import Part, Tiling, Tree
from .plan import FactorPlan

ROWS = 256  # rows per block of the first level
AT_ONCE = 16e6  # bytes of profiles below the first level at a time on a CPU, so that they stay in its caches
PIXEL_BYTES = 24  # bytes per pixel: its compensated sum, and its value in the download


@dataclass(frozen=True, eq=False)
class MemoryPlan:
    """Sizes of what a plan keeps on one device, and the blocks that fit.

    strides        complex samples of the profile of a tile, for each level
    profiles       of the rows
    last_kept      kept pulses of the last level, with padding
    components     floats of a (leaf, kept pulse) record
    max_alloc      bytes of the largest buffer
    """

    plan: FactorPlan
    tiling: Tiling
    n_rows: int
    strides: list[int]
    profiles: RowProfiles
    last_kept: int
    components: int
    max_alloc: float
    is_cpu: bool

    def blocks(self, nbytes: float) -> list[tuple[int, int]]:
        """Runs of bands, of whole roots, whose profiles at the roots and pixels fit in half of nbytes.

        A single line of roots may be larger: `Factorized.fill` makes it in parts. MemoryError where nbytes is too small
        for one root.
        """
        tiling = self.tiling
        high, least = tiling.root_bands(self.plan.factors[0]), self._least()
        if nbytes < least:
            raise MemoryError(
                f"max_bytes is {text.size_text(nbytes)} but the range profiles of 16 rows, and a tile of "
                f"{self.plan.levels[0].side} pixels per side with its profiles, need {text.size_text(least)}; give "
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
        """Estimated bytes that `Factorized.fill` takes for the first block when it is given nbytes."""
        first, last = self.blocks(nbytes)[0]
        roots, pixels = self.tiling.part_size(next(self.parts(first, last, nbytes)), self.plan.factors[0])
        rows = min(self.rows(nbytes), self.n_rows)
        return self.n_bytes(roots, pixels) + self.profiles.nbytes(rows) + 2 * min(AT_ONCE, nbytes / 8)

    def passes(self, nbytes: float) -> tuple[int, int]:
        """Number of parts of all blocks, and of the roots of these parts together."""
        parts = [part for run in self.blocks(nbytes) for part in self.parts(*run, nbytes)]
        return len(parts), sum(self.tiling.part_size(part, self.plan.factors[0])[0] for part in parts)

    def rows(self, nbytes: float) -> int:
        """Rows per block of the first level."""
        return max(16, min(ROWS, self.profiles.rows_in(nbytes / 16) // 16 * 16))

    def n_bytes(self, roots: int, pixels: int) -> float:
        """Bytes of the profiles of so many roots, and of so many pixels."""
        each = PIXEL_BYTES + self.tiling.offset_bytes
        return float(roots) * self.plan.levels[0].n_bytes(self.strides[0]) + float(each) * pixels

    def _fits(self, first: int, last: int, nbytes: float) -> bool:
        """Whether bands first ... last - 1 fit in half of nbytes."""
        roots, pixels = self.tiling.n_roots(first, last, self.plan.factors[0]), self.tiling.pixels(first, last)
        largest = max(self.n_bytes(roots, 0), 16.0 * pixels)
        return self.n_bytes(roots, pixels) <= nbytes / 2 and largest <= self.max_alloc

    def most(self, nbytes: float, bands: int = 0) -> int:
        """Number of roots at a time, cut to so many bands of a plane; 0 where not even one fits."""
        factor = self.plan.factors[0]
        pixels = self.tiling.root_leaves(factor, bands or factor) * self.tiling.per_tile
        alloc = self.max_alloc / max(self.n_bytes(1, 0), 16.0 * pixels)
        return int(min(nbytes / 2 / self.n_bytes(1, pixels), alloc))

    def _least(self) -> float:
        """The smallest number of bytes: for 16 rows, and for one root, of a plane cut to one band."""
        pixels = self.tiling.root_leaves(self.plan.factors[0], 1) * self.tiling.per_tile
        return max(8.0 * self.profiles.nbytes(16), 2 * self.n_bytes(1, pixels))

    def parts(self, first: int, last: int, nbytes: float) -> Iterator[Part]:
        """Bands first ... last - 1 in parts that fit: runs of roots, or one of them cut."""

        def most(bands: int) -> int:
            return self.most(nbytes, bands)

        do_all_fit = self._fits(first, last, nbytes)
        return self.tiling.parts((first, last), self.plan.factors[0], most, do_all_fit)

    def at_once(self, tree: Tree, budget: float) -> tuple[int, float, float]:
        """Division of the levels below the first: number of roots at a time; bytes per level at a time within one root,
        inf where a whole root fits; and bytes per root.
        """
        each, profiles = 0.0, 0.0
        for i in range(1, len(tree.centers)):
            tiles_per_root = len(tree.centers[i]) / len(tree.centers[0])
            profiles += tiles_per_root * self.plan.levels[i].n_bytes(self.strides[i])
            each += tiles_per_root * self.tile_bytes(i)
        each += tree.leaves.n_tiles / len(tree.centers[0]) * self.constants
        most = min((AT_ONCE if self.is_cpu else budget / 8) / max(profiles, 1.0), budget / 8 / each)
        return max(1, int(most)), np.inf if each <= budget / 8 else budget / 8 / len(tree.centers), each

    def tile_bytes(self, level: int) -> float:
        """Bytes per tile of a lower level: its profiles, and the records for moving profiles from the level above."""
        records = 4 * (4 + self.plan.between.taps) * len(self.plan.levels[level - 1].decimation.kept)
        return float(self.plan.levels[level].n_bytes(self.strides[level]) + records)

    @property
    def constants(self) -> float:
        """Bytes of the constants per leaf, for all kept pulses."""
        return 4.0 * self.components * self.last_kept
