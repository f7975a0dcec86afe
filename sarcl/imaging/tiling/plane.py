"""The tiling of planes: rows of square tiles."""

from __future__ import annotations

import copy
import itertools
from collections.abc import Callable, Iterable, Iterator, Sequence

import numpy as np

from ...base import float_pairs, host_memory
from ...blocks.bands import FlatArray, Run
from ...model.image_grid import ImageGrid
from ...numerics.tiles import Tiles
from ...opencl.device import Buffer, Device
from ...opencl.launch_numbers import launch_numbers
from .tiling import Orders, Part, Roots, Section, Tiling, Tree


def _power_of_two(n: int) -> int:
    """The smallest power of two that is at least n."""
    return 1 << max(0, n - 1).bit_length()


def outline(plane: ImageGrid) -> np.ndarray:
    """Centre, corners and middles of the edges of a plane, m (9, 3)."""
    rows, columns = plane.shape
    i, j = np.meshgrid([0, rows // 2, rows - 1], [0, columns // 2, columns - 1], indexing="ij")
    return plane.at(i.ravel(), j.ravel())


class PlaneTiling(Tiling):
    """A plane in rows of tiles: square ones, but no higher or wider than a narrow grid needs. A band is one row of
    tiles, `across` of them, each of high x wide pixels.
    """

    in_rows, offset_bytes, leaf_sides = True, 0, (32, 16)

    def __init__(self, grid: ImageGrid, side: int) -> None:
        super().__init__(grid, side)
        assert grid.spacing is not None and grid.x_axis is not None and grid.y_axis is not None
        self.axes, self.pixel = np.stack([grid.x_axis, grid.y_axis]), float(np.hypot(*grid.spacing))
        rows, columns = grid.shape
        self.row_shape = (columns,)
        high = min(side, _power_of_two(rows))
        wide = min(side * side // high, max(side, _power_of_two(columns)))
        self._cut(side * side // wide, wide)
        down, right = (np.arange(n) - (n - 1) / 2 for n in (self.high, self.wide))
        y = down[:, None, None] * grid.spacing[0] * grid.y_axis
        offsets = (y + right[:, None] * grid.spacing[1] * grid.x_axis).reshape(-1, 3)
        self._offsets = float_pairs.wide(offsets.T).reshape(6, -1)
        self.radius = float(np.linalg.norm(offsets, axis=1).max())

    def _cut(self, high: int, wide: int) -> None:
        rows, columns = self.grid.shape
        self.high, self.wide, self.n_bands, self.across = high, wide, -(-rows // high), -(-columns // wide)

    def extent(self, first: int, last: int) -> slice:
        return slice(first * self.high, min(last * self.high, self.grid.shape[0]))

    def pixels(self, first: int, last: int) -> int:
        return (last - first) * self.across * self.per_tile

    def blocks(self, most: int) -> list[Run]:
        step = max(1, most // self.pixels(0, 1))
        return [(a, min(a + step, self.n_bands)) for a in range(0, self.n_bands, step)]

    def band(self, index: int) -> tuple[Tiles, np.ndarray | None]:
        return self.bands(index, index + 1)[0], None

    def bands(self, first: int, last: int) -> tuple[Tiles, Orders]:
        rows = np.arange(first, last) * self.high + self._reference(self.high)
        columns = np.arange(self.across) * self.wide + self._reference(self.wide)
        references = self.grid.at(rows[:, None], columns).reshape(-1, 3) - self.center
        radius = np.full(len(references), self.radius)
        return Tiles(self.per_tile, references, radius, self._offsets, shared=True), (None,) * len(rows)

    def _reference(self, pixels: int) -> float:
        """Place of a tile's reference along a side of so many pixels."""
        return (pixels - 1) / 2

    def tile_sizes(self, first: int, last: int) -> np.ndarray:
        rows, columns = self.grid.shape
        high = np.minimum(np.arange(first + 1, last + 1) * self.high, rows) - np.arange(first, last) * self.high
        wide = np.minimum(np.arange(1, self.across + 1) * self.wide, columns) - np.arange(self.across) * self.wide
        return np.outer(high, wide).ravel()

    def positions(self, first: int, last: int, orders: Orders) -> np.ndarray:
        rows, columns = self.grid.shape  # tiles that reach beyond the grid repeat its last row and column
        i = np.minimum(np.arange(first * self.high, last * self.high), rows - 1)
        j = np.minimum(np.arange(self.across * self.wide), columns - 1)
        positions = self.grid.at(i[:, None], j).reshape(last - first, self.high, self.across, self.wide, 3)
        return positions.transpose(0, 2, 1, 3, 4).reshape(-1, self.per_tile, 3)

    def place(self, values: np.ndarray, run: Run, start: int, orders: Orders, flat: FlatArray) -> None:
        n_bands, columns, rows = run[1] - run[0], self.grid.shape[1], self.extent(*run)
        across = len(values) // self.per_tile // n_bands
        first_column, right = start * self.wide, min((start + across) * self.wide, columns)
        tiled = values.reshape(n_bands, across, self.high, self.wide).transpose(0, 2, 1, 3)
        block = tiled.reshape(n_bands * self.high, across * self.wide)
        flat[rows, first_column:right] = block[: rows.stop - rows.start, : right - first_column]

    def place_sums(
        self, device: Device, sums: Buffer, run: Run, tiles: tuple[int, int], orders: Orders, flat: FlatArray
    ) -> None:
        if tiles == (0, (run[1] - run[0]) * self.across):
            self._write(device, sums, run, None, flat)
        else:
            super().place_sums(device, sums, run, tiles, orders, flat)

    def _write(
        self, device: Device, sums: Buffer, run: Run, slot: np.ndarray | None, flat: FlatArray, left: int = 0
    ) -> None:
        """Write the rows of a run of bands to the flat image, from compensated sums (4, pixels) on the device.

        slot  (tiles,) int: number of each of the sums' tiles among the bands', row by row; None: in that order
        left  first of the columns
        """
        rows, columns, n_tiles = self.extent(*run), self.grid.shape[1], (run[1] - run[0]) * self.across
        height = rows.stop - rows.start
        tile_of_slot = np.empty(n_tiles, np.int32)
        tile_of_slot[np.arange(n_tiles) if slot is None else slot] = np.arange(n_tiles, dtype=np.int32)
        out: np.ndarray | None = None
        if isinstance(flat, np.ndarray) and flat.dtype == np.complex64 and flat.flags.c_contiguous:
            if flat.shape[1] == columns:
                out = flat[rows]
        if out is None:
            device.release(sums.size, host_memory.LEAST_WRITTEN)
        values = np.empty((height, columns), np.complex64) if out is None else out
        image, slots = device.output(values), device.upload(tile_of_slot)
        numbers = {"pixels": n_tiles * self.per_tile, "across": self.across, "high": self.high, "wide": self.wide}
        launch = launch_numbers("assemble_image.cl", "untile", **numbers, columns=columns)
        untile = device.kernel("assemble_image.cl", "untile")
        device.run(untile, (columns, height), None, launch, sums, slots, image)
        device.download(image, values)
        if out is None:
            flat[rows, left : left + columns] = values

    def outline(self) -> np.ndarray:
        return outline(self.grid)

    def tree(self, first: int, last: int, factors: Sequence[int]) -> Tree:
        """See Tiling. Tiles are cut from the whole grid, so that they do not depend on which bands are asked for."""
        down, right = (a.ravel() for a in np.meshgrid(np.arange(first, last), np.arange(self.across), indexing="ij"))
        cells = [down // factor * (self.across + 1) + right // factor for factor in factors]
        order, starts = np.lexsort(cells[::-1]), []
        is_first = np.arange(len(order)) == 0  # of the leaves of a tile
        for cell in cells:
            is_first[1:] |= np.diff(cell[order]) != 0
            starts.append(np.append(np.flatnonzero(is_first), len(order)))
        leaves = self.bands(first, last)[0].picked(order)
        corners = [(factor, order[at[:-1]]) for factor, at in zip(factors[:-1], starts, strict=False)]
        centers = [self._center_of(down[at] // factor, right[at] // factor, factor) for factor, at in corners]
        children = [np.searchsorted(below, at) for at, below in itertools.pairwise(starts)]
        return Tree((*centers, leaves.references), tuple(children), leaves, order)

    def _center_of(self, down: np.ndarray, right: np.ndarray, factor: int) -> np.ndarray:
        """Centres, m about the scene's centre (n, 3), of tiles of `factor` leaves per side."""
        rows, columns = (down * factor + factor / 2) * self.high, (right * factor + factor / 2) * self.wide
        return self.grid.at(rows, columns) - self.center

    def parts(self, run: Run, factor: int, most: Callable[[int], int], whole: bool) -> Iterator[Part]:
        """See Tiling. The profiles of a root that is cut are the same whichever of its bands are made from them."""
        first, last = run
        if whole:
            yield Part(first, last, 0, self.across)
            return
        while first < last:
            end = min((first // factor + 1) * factor, last)
            bands = end - first
            while bands > 1 and not most(bands):
                bands = -(-bands // 2)
            width = factor * max(1, most(bands))
            for a in range(first, end, bands):
                for left in range(0, self.across, width):
                    yield Part(a, min(a + bands, end), left, min(left + width, self.across))
            first = end

    def sections(self, parts: Iterable[Part], factors: Sequence[int]) -> Iterator[Section]:
        factor, lines, roots = factors[0], (0, 0), Roots(np.empty((0, 3)), np.empty(0))
        wide = -(-self.across // factor)
        for part in parts:
            before, lines = lines, (part.first // factor, -(-part.last // factor))
            if lines != before:
                roots = self._roots(*lines, factor)
            columns = self._columns(part)
            tree = columns.tree(part.first, part.last, factors)
            down, over = np.arange(lines[1] - lines[0]), np.arange(part.low // factor, -(-part.high // factor))
            which = (down[:, None] * wide + over).ravel()
            yield Section(part, tree, roots, which, columns.tile_sizes(part.first, part.last)[tree.slot], ())

    def _roots(self, low: int, high: int, factor: int) -> Roots:
        """Roots of lines low ... high - 1."""
        wide = -(-self.across // factor)
        down, right = (a.ravel() for a in np.meshgrid(np.arange(low, high), np.arange(wide), indexing="ij"))
        centers = self._center_of(down, right, factor) if factor > 1 else self.bands(low, high)[0].references
        return Roots(centers, down)

    def _columns(self, part: Part) -> PlaneTiling:
        """The leaves of a part across; the first is the first of a root."""
        if (part.low, part.high) == (0, self.across):
            return self
        columns = copy.copy(self)
        columns.across = part.high - part.low
        columns.grid = self.grid.columns(part.low * self.wide, min(part.high * self.wide, self.grid.shape[1]))
        return columns

    def place_section(self, device: Device, sums: Buffer, section: Section, flat: FlatArray) -> None:
        part = section.part
        self._columns(part)._write(device, sums, part[:2], section.tree.slot, flat, part.low * self.wide)

    def n_roots(self, first: int, last: int, factor: int) -> int:
        return self._lines(first, last, factor) * -(-self.across // factor)

    def _lines(self, first: int, last: int, factor: int) -> int:
        """Lines of roots that bands first ... last - 1 have a part in."""
        return -(-last // factor) - first // factor

    def part_size(self, part: Part, factor: int) -> tuple[int, int]:
        bands, wide = part.last - part.first, part.high - part.low
        return self._lines(*part[:2], factor) * -(-wide // factor), bands * wide * self.per_tile

    def root_bands(self, factor: int) -> int:
        return factor

    def root_leaves(self, factor: int, bands: int) -> int:
        return min(factor, self.across) * bands

    def leaf_radius(self, side: int) -> float:
        return side / 2 * self.pixel

    def level_radii(self, factors: Sequence[int]) -> list[float]:
        return [self.radius * factor for factor in factors]

    def child_distance(self, radius: float, below: float) -> float:
        return radius - below * (1 - 2 / self.side)

    @property
    def longest_side(self) -> int:
        return max(self.grid.shape)


class LineTiling(PlaneTiling):
    """Square tiles of a plane about one of their pixels, (side/2, side/2), so that offsets are whole pixels."""

    def __init__(self, grid: ImageGrid, side: int) -> None:
        super().__init__(grid, side)
        self._cut(side, side)
        self.radius, self._offsets = side / 2 * self.pixel, np.zeros((6, 0), np.float32)

    def _reference(self, pixels: int) -> float:
        return pixels // 2
