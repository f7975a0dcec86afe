"""Image grids in tiles, the tiles in bands: the units in which an image is made. One class for each kind of grid."""

from __future__ import annotations

import copy
import itertools
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from ..base import float_pairs
from ..model.image_grid import ImageGrid
from ..numerics.tiles import Tiles, tile_points
from ..opencl.device import Device
from .tile_tree import Tree

Run = tuple[int, int]  # bands first ... last - 1
Orders = Sequence[np.ndarray | None]  # for each band: cell of the band that each point of its tiles is; None: a plane


class Part(NamedTuple):
    """What the factorised method makes at a time of bands first ... last - 1.

    low, high  of a plane: leaves low ... high - 1 across; of listed points: roots low ... high - 1 of these bands
    """

    first: int
    last: int
    low: int
    high: int


@dataclass(frozen=True, eq=False)
class Roots:
    """Roots of trees, in the order of the grid.

    centers  m about the scene's centre (n, 3)
    line     (n,): neighbouring roots may share rows that are added directly if they have the same number
    """

    centers: np.ndarray
    line: np.ndarray


@dataclass(frozen=True, eq=False)
class Section:
    """A Part with its tree.

    roots   all roots of the bands, the same object for the sections of the same bands
    which   numbers of the tree's roots among these
    sizes   (n leaves,): pixels of each leaf, without padding and empty cells
    orders  see Orders
    """

    part: Part
    tree: Tree
    roots: Roots
    which: np.ndarray
    sizes: np.ndarray
    orders: Orders


def tiling_of(grid: ImageGrid, side: int) -> Tiling:
    """The tiling of a grid in tiles of side x side pixels: by the class for its kind of grid."""
    return (PlaneTiling if grid.is_plane else PointTiling)(grid, side)


class Tiling(ABC):
    """The tiling of a grid, in bands of tiles. A band is some consecutive rows, or points, of the image.

    Fixed by the grid and the side alone, so that results do not depend on how many bands are made at once. Empty
    cells are in no tile, and their pixels are 0; `grid` has other positions in them.

    grid          the grid, empty cells filled
    per_tile      pixels of a tile; side: its square root
    center        m (3,): the scene's centre, the middle of the grid's bounds
    radius        largest distance of a pixel from the reference of its tile, m
    row_shape     shape of one entry of the flat image: a row of a plane; () for a point
    in_rows       the flat image has the axes of the image
    offset_bytes  bytes on the device for the offsets of a pixel, where tiles do not share them
    leaf_sides    sides of leaves to choose from, where leaves are focused pixel by pixel
    axes          unit vectors (2, 3) of the plane that all pixels lie in, or None
    """

    grid: ImageGrid
    n_bands: int
    radius: float
    row_shape: tuple[int, ...]
    in_rows: bool
    offset_bytes: int
    leaf_sides: tuple[int, ...]
    axes: np.ndarray | None = None

    def __init__(self, grid: ImageGrid, side: int) -> None:
        self.grid, self.side, self.per_tile = grid.filled(), side, side * side
        self.center = grid.bounds.mean(axis=0)

    @abstractmethod
    def extent(self, first: int, last: int) -> slice:
        """Where bands first ... last - 1 lie in the flat image (rows of a plane, or points)."""

    @abstractmethod
    def pixels(self, first: int, last: int) -> int:
        """Pixels, padding included, of bands first ... last - 1."""

    @abstractmethod
    def band(self, index: int) -> tuple[Tiles, np.ndarray | None]:
        """Tiles of one band, and their entry of Orders."""

    @abstractmethod
    def tile_sizes(self, first: int, last: int) -> np.ndarray:
        """Pixels, without padding and empty cells, of every tile of bands first ... last - 1."""

    @abstractmethod
    def positions(self, first: int, last: int, orders: Orders) -> np.ndarray:
        """Positions, m (n_tiles, per_tile, 3), of bands first ... last - 1: those of the grid to the bit."""

    @abstractmethod
    def place(self, values: np.ndarray, run: Run, start: int, orders: Orders, flat: Any) -> None:
        """Write values (n,) of tiles from `start` on of a run of bands to their pixels in the flat image.

        The tiles are all of the run, or some of a run of one band.
        """

    @abstractmethod
    def outline(self) -> np.ndarray:
        """Sample points, m (n, 3), of the region of all pixels, at which errors are estimated."""

    @abstractmethod
    def tree(self, first: int, last: int, factors: Sequence[int]) -> Tree:
        """Tree over bands first ... last - 1; `factors`: leaves along a side of a tile of each level, the last 1."""

    @abstractmethod
    def parts(self, run: Run, factor: int, most: Callable[[int], int], whole: bool) -> Iterator[Part]:
        """A run of bands in parts of whole roots, or of roots cut to some bands, of `factor` leaves per side.

        most   called as most(bands): how many roots, cut to so many bands each, can be made at a time; 0: not one
        whole  all can be made at a time
        """

    @abstractmethod
    def sections(self, parts: Iterable[Part], factors: Sequence[int]) -> Iterator[Section]:
        """Parts with their trees; `factors` as of `tree`."""

    @abstractmethod
    def place_section(self, device: Device, sums: Any, section: Section, flat: Any) -> None:
        """Write compensated sums (4, pixels) on the device to the pixels of a section in the flat image."""

    @abstractmethod
    def n_roots(self, first: int, last: int, factor: int) -> int:
        """Roots of `factor` leaves per side in bands first ... last - 1."""

    @abstractmethod
    def part_size(self, part: Part, factor: int) -> tuple[int, int]:
        """Roots and pixels, padding included, of a part; of listed points an upper bound of the pixels."""

    @abstractmethod
    def root_bands(self, factor: int) -> int:
        """Bands that a root of `factor` leaves per side reaches over."""

    @abstractmethod
    def root_leaves(self, factor: int, bands: int) -> int:
        """Leaves of a root of `factor` leaves per side, cut to so many bands, at most."""

    @abstractmethod
    def leaf_radius(self, side: int) -> float:
        """Largest distance of a pixel from the centre of a leaf of that side, m, about."""

    @abstractmethod
    def level_radii(self, factors: Sequence[int]) -> list[float]:
        """Largest distance of a pixel from the centre of its tile, m, for each level; `factors` as of `tree`."""

    @abstractmethod
    def child_distance(self, radius: float, below: float) -> float:
        """Largest distance between the centres of a tile of `radius` and of its children, whose radius is `below`."""

    @property
    @abstractmethod
    def longest_side(self) -> int:
        """Pixels along the longer side of the image, about."""

    def count(self, first: int, last: int) -> int:
        """Pixels of bands first ... last - 1, empty cells included, without padding."""
        at = self.extent(first, last)
        return int((at.stop - at.start) * np.prod(self.row_shape, dtype=np.int64))

    def blocks(self, most: int) -> list[Run]:
        """All bands in runs of `most` pixels, padding included, at most; a band that is alone may be larger."""
        blocks, first = [], 0
        for band in range(self.n_bands):
            if band > first and self.pixels(first, band + 1) > most:
                blocks.append((first, band))
                first = band
        return [*blocks, (first, self.n_bands)]

    def bands(self, first: int, last: int) -> tuple[Tiles, Orders]:
        """Tiles of bands first ... last - 1 in one, and where their points are among the bands' cells."""
        tiles, orders = zip(*(self.band(b) for b in range(first, last)), strict=True)
        offsets = tiles[0].offsets if tiles[0].shared else np.concatenate([t.offsets for t in tiles], axis=1)
        joined = Tiles(
            self.per_tile,
            np.concatenate([t.references for t in tiles]),
            np.concatenate([t.radius for t in tiles]),
            offsets,
            tiles[0].shared,
        )
        return joined, orders

    def place_sums(
        self, device: Device, sums: Any, run: Run, tiles: tuple[int, int], orders: Orders, flat: Any
    ) -> None:
        """Write compensated sums (4, pixels) on the device of tiles start ... stop - 1 of a run, as `place` does."""
        start, stop = tiles
        self.place(download_sums(device, sums, (stop - start) * self.per_tile), run, start, orders, flat)


def download_sums(device: Device, sums: Any, n: int, kind: type[np.floating] = np.float32) -> np.ndarray:
    """Pixels (n,), complex of twice the bytes of `kind`, from compensated sums (4, n) on the device."""
    real, imaginary, real_rest, imaginary_rest = device.download(sums, np.empty((4, n), kind))
    return np.asarray((real + real_rest) + 1j * (imaginary + imaginary_rest))


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
        columns = np.arange(self.across) * self.wide + (self.wide - 1) / 2
        row = index * self.high + (self.high - 1) / 2
        references = self.grid.at(np.full(self.across, row), columns) - self.center
        return Tiles(self.per_tile, references, np.full(self.across, self.radius), self._offsets, shared=True), None

    def tile_sizes(self, first: int, last: int) -> np.ndarray:
        rows, columns = self.grid.shape
        high = np.minimum(np.arange(first + 1, last + 1) * self.high, rows) - np.arange(first, last) * self.high
        wide = np.minimum(np.arange(1, self.across + 1) * self.wide, columns) - np.arange(self.across) * self.wide
        return np.outer(high, wide).ravel()

    def positions(self, first: int, last: int, orders: Orders) -> np.ndarray:
        rows, columns = self.grid.shape  # tiles that reach beyond the grid repeat its last row and column
        i = np.minimum(np.arange(first * self.high, last * self.high), rows - 1)
        j = np.minimum(np.arange(self.across * self.wide), columns - 1)
        made = self.grid.at(i[:, None], j).reshape(last - first, self.high, self.across, self.wide, 3)
        return made.transpose(0, 2, 1, 3, 4).reshape(-1, self.per_tile, 3)

    def place(self, values: np.ndarray, run: Run, start: int, orders: Orders, flat: Any) -> None:
        n_bands, columns, rows = run[1] - run[0], self.grid.shape[1], self.extent(*run)
        across = len(values) // self.per_tile // n_bands
        left, right = start * self.wide, min((start + across) * self.wide, columns)
        tiled = values.reshape(n_bands, across, self.high, self.wide).transpose(0, 2, 1, 3)
        block = tiled.reshape(n_bands * self.high, across * self.wide)
        flat[rows, left:right] = block[: rows.stop - rows.start, : right - left]

    def place_sums(
        self, device: Device, sums: Any, run: Run, tiles: tuple[int, int], orders: Orders, flat: Any
    ) -> None:
        if tiles == (0, (run[1] - run[0]) * self.across):
            flat[self.extent(*run)] = self._download(device, sums, run, None)
        else:
            super().place_sums(device, sums, run, tiles, orders, flat)

    def _download(self, device: Device, sums: Any, run: Run, slot: np.ndarray | None) -> np.ndarray:
        """Rows, complex64, of a run of bands, from compensated sums (4, pixels) on the device.

        slot  (tiles,) int: number of each of the sums' tiles among the bands', row by row; None: in that order
        """
        rows, columns, n_tiles = self.extent(*run), self.grid.shape[1], (run[1] - run[0]) * self.across
        height = rows.stop - rows.start
        where = np.empty(n_tiles, np.int32)
        where[np.arange(n_tiles) if slot is None else slot] = np.arange(n_tiles, dtype=np.int32)
        made, slots = device.empty(8 * height * columns), device.upload(where)
        device.run(
            device.kernel("assemble_image.cl", "untile"), (columns, height), None,
            sums, np.uint64(n_tiles * self.per_tile), slots, self.across, self.high, self.wide, columns, made,
        )  # fmt: skip
        return device.download(made, np.empty((height, columns), np.complex64))

    def outline(self) -> np.ndarray:
        return outline(self.grid)

    def tree(self, first: int, last: int, factors: Sequence[int]) -> Tree:
        """See Tiling. Tiles are cut from the whole grid, so that they do not depend on which bands are asked for."""
        down, right = (a.ravel() for a in np.meshgrid(np.arange(first, last), np.arange(self.across), indexing="ij"))
        keys: list[np.ndarray] = []
        for factor in factors:
            keys += [down // factor, right // factor]
        order = np.lexsort(keys[::-1])
        centers, children = [], []
        starts_below = np.arange(len(order) + 1)
        for level in range(len(factors) - 1, -1, -1):
            factor = factors[level]
            cells = np.stack([k[order] for k in keys[: 2 * level + 2]])
            new = np.ones(len(order), bool)
            new[1:] = (cells[:, 1:] != cells[:, :-1]).any(axis=0)
            at = np.flatnonzero(new)
            centers.append(self._center_of(down[order][at] // factor, right[order][at] // factor, factor))
            starts = np.append(at, len(order))
            if level < len(factors) - 1:
                children.append(np.searchsorted(starts_below, starts))
            starts_below = starts
        leaves = self.bands(first, last)[0].picked(order)
        centers[0] = leaves.references
        return Tree(tuple(centers[::-1]), tuple(children[::-1]), leaves, order)

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
            some = self._columns(part)
            tree = some.tree(part.first, part.last, factors)
            down, over = np.arange(lines[1] - lines[0]), np.arange(part.low // factor, -(-part.high // factor))
            which = (down[:, None] * wide + over).ravel()
            yield Section(part, tree, roots, which, some.tile_sizes(part.first, part.last)[tree.slot], ())

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
        some = copy.copy(self)
        some.across = part.high - part.low
        some.grid = self.grid.columns(part.low * self.wide, min(part.high * self.wide, self.grid.shape[1]))
        return some

    def place_section(self, device: Device, sums: Any, section: Section, flat: Any) -> None:
        part = section.part
        made = self._columns(part)._download(device, sums, part[:2], section.tree.slot)
        flat[self.extent(*part[:2]), part.low * self.wide : part.low * self.wide + made.shape[1]] = made

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


class PointTiling(Tiling):
    """Listed points in tiles along a space-filling curve. A band is LISTED_BAND points in the order of the list."""

    LISTED_BAND = 2**18

    row_shape, in_rows, offset_bytes, leaf_sides = (), False, 24, (16,)

    def __init__(self, grid: ImageGrid, side: int) -> None:
        super().__init__(grid, side)
        self.empty = None if grid.empty is None else grid.empty.ravel()
        self.n_bands = -(-grid.size // self.LISTED_BAND)
        self._full = [self._cells(b) for b in range(self.n_bands)]
        self.radius = max(float(self.band(b)[0].radius.max()) for b in range(self.n_bands))

    def extent(self, first: int, last: int) -> slice:
        return slice(first * self.LISTED_BAND, min(last * self.LISTED_BAND, self.grid.size))

    def pixels(self, first: int, last: int) -> int:
        return sum(self._padded(b) for b in range(first, last))

    def _empty_in(self, band: int) -> np.ndarray | None:
        """Which cells of a band are empty, (n,) bool; None: no cell of the grid is."""
        return None if self.empty is None else self.empty[self.extent(band, band + 1)]

    def _cells(self, band: int) -> int:
        """Cells of a band that are not empty."""
        empty = self._empty_in(band)
        return self.count(band, band + 1) if empty is None else int((~empty).sum())

    def _padded(self, band: int) -> int:
        return -(-max(self._full[band], 1) // self.per_tile) * self.per_tile

    def _points(self, band: int) -> np.ndarray:
        """Positions of the cells of a band, m (n, 3)."""
        return self.grid.positions.reshape(-1, 3)[self.extent(band, band + 1)]

    def band(self, index: int) -> tuple[Tiles, np.ndarray | None]:
        points, empty = self._points(index), self._empty_in(index)
        if empty is None:
            return tile_points(points, self.center, self.per_tile)
        # a band without a point keeps a tile, of one cell whose pixel is set to 0
        cells = np.flatnonzero(~empty) if self._full[index] else np.zeros(1, np.int64)
        tiles, order = tile_points(points[cells], self.center, self.per_tile)
        return tiles, cells[order]

    def tile_sizes(self, first: int, last: int) -> np.ndarray:
        sizes = []
        for b in range(first, last):
            full = np.full(self._padded(b) // self.per_tile, self.per_tile)
            full[-1] -= self._padded(b) - self._full[b]
            sizes.append(full)
        return np.concatenate(sizes)

    def positions(self, first: int, last: int, orders: Orders) -> np.ndarray:
        parts = [self._points(b)[order] for b, order in zip(range(first, last), orders, strict=True)]
        return np.concatenate(parts).reshape(-1, self.per_tile, 3)

    def place(self, values: np.ndarray, run: Run, start: int, orders: Orders, flat: Any) -> None:
        skipped, taken = start * self.per_tile, 0  # values before those given, and those placed
        for band, order in zip(range(*run), orders, strict=True):
            assert order is not None
            cells = order[skipped : skipped + len(values) - taken]
            skipped = max(0, skipped - len(order))
            if len(cells) == 0:
                continue
            pixels, empty = flat[self.extent(band, band + 1)], self._empty_in(band)
            pixels[cells] = values[taken : taken + len(cells)]
            if empty is not None:
                pixels[empty] = 0
            taken += len(cells)

    def outline(self) -> np.ndarray:
        """Middle and four corners of the bounds, m (5, 3)."""
        low, high = self.grid.bounds
        signs = np.array([[0, 0, 0], [1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]])
        return np.asarray((low + high) / 2 + signs * (high - low) / 2)

    def tree(self, first: int, last: int, factors: Sequence[int]) -> Tree:
        return self._tree(self.bands(first, last)[0], (first, last), factors)

    def _tree(self, tiles: Tiles, run: Run, factors: Sequence[int]) -> Tree:
        """Tree over the tiles of a run of bands: tiles of a level are runs of leaves along the curve."""
        edge = np.cumsum([0, *(self._padded(b) // self.per_tile for b in range(*run))])
        starts = [
            np.unique(np.concatenate([[*range(a, b, factor**2), b] for a, b in itertools.pairwise(edge.tolist())]))
            for factor in factors
        ]
        centers = []
        for begin in starts:
            low = np.minimum.reduceat(tiles.references, begin[:-1])
            high = np.maximum.reduceat(tiles.references, begin[:-1])
            centers.append((low + high) / 2)
        children = [np.searchsorted(below, above) for above, below in itertools.pairwise(starts)]
        return Tree(tuple(centers), tuple(children), tiles, np.arange(tiles.n_tiles))

    def parts(self, run: Run, factor: int, most: Callable[[int], int], whole: bool) -> Iterator[Part]:
        roots = self.n_roots(*run, factor)
        step = max(1, most(factor))
        for low in range(0, roots, step):
            yield Part(*run, low, min(low + step, roots))

    def sections(self, parts: Iterable[Part], factors: Sequence[int]) -> Iterator[Section]:
        for run, some in itertools.groupby(parts, lambda part: part[:2]):
            tiles, orders = self.bands(*run)
            tree, sizes = self._tree(tiles, run, factors), self.tile_sizes(*run)
            line = np.repeat(range(*run), [self.n_roots(b, b + 1, factors[0]) for b in range(*run)])
            roots = Roots(tree.centers[0], line)
            for part in some:
                below = tree.part(part.low, part.high)
                yield Section(part, below, roots, np.arange(part.low, part.high), sizes[below.slot], orders)

    def place_section(self, device: Device, sums: Any, section: Section, flat: Any) -> None:
        slot = section.tree.slot
        self.place_sums(device, sums, section.part[:2], (slot[0], slot[-1] + 1), section.orders, flat)

    def n_roots(self, first: int, last: int, factor: int) -> int:
        return sum(-(-self._padded(b) // self.per_tile // factor**2) for b in range(first, last))

    def part_size(self, part: Part, factor: int) -> tuple[int, int]:
        roots = part.high - part.low
        return roots, min(self.pixels(*part[:2]), roots * factor**2 * self.per_tile)

    def root_bands(self, factor: int) -> int:
        return 1

    def root_leaves(self, factor: int, bands: int) -> int:
        return factor**2

    def leaf_radius(self, side: int) -> float:
        return self.radius

    def level_radii(self, factors: Sequence[int]) -> list[float]:
        return self.tree(0, self.n_bands, factors).radii()

    def child_distance(self, radius: float, below: float) -> float:
        return radius

    @property
    def longest_side(self) -> int:
        return int(np.sqrt(self.grid.size))
