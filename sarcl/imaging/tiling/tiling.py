"""Base class of tilings: bands of tiles, and parts and sections of them for factorised backprojection."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np

from ...blocks.bands import FlatArray, Run
from ...model.image_grid import ImageGrid
from ...numerics.tiles import Tiles
from ...opencl.device import Buffer, Device
from ...opencl.launch_numbers import launch_numbers

Orders = Sequence[np.ndarray | None]  # for each band: cell of the band that each point of its tiles is; None: a plane


class Part(NamedTuple):
    """Part of bands first ... last - 1 that the factorised method makes at a time.

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


class Tiling(Protocol):
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
    side: int
    per_tile: int
    center: np.ndarray
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

    def extent(self, first: int, last: int) -> slice:
        """Place of bands first ... last - 1 in the flat image (rows of a plane, or points)."""

    def pixels(self, first: int, last: int) -> int:
        """Pixels, padding included, of bands first ... last - 1."""

    def band(self, index: int) -> tuple[Tiles, np.ndarray | None]:
        """Tiles of one band, and their entry of Orders."""

    def tile_sizes(self, first: int, last: int) -> np.ndarray:
        """Pixels, without padding and empty cells, of every tile of bands first ... last - 1."""

    def positions(self, first: int, last: int, orders: Orders) -> np.ndarray:
        """Positions, m (n_tiles, per_tile, 3), of bands first ... last - 1: those of the grid to the bit."""

    def place(self, values: np.ndarray, run: Run, start: int, orders: Orders, flat: FlatArray) -> None:
        """Write values (n,) of tiles from `start` on of a run of bands to their pixels in the flat image.

        The tiles are all of the run, or some of a run of one band.
        """

    def outline(self) -> np.ndarray:
        """Sample points, m (n, 3), of the region of all pixels, at which errors are estimated."""

    def tree(self, first: int, last: int, factors: Sequence[int]) -> Tree:
        """Tree over bands first ... last - 1; `factors`: leaves along a side of a tile of each level, the last 1."""

    def parts(self, run: Run, factor: int, most: Callable[[int], int], whole: bool) -> Iterator[Part]:
        """A run of bands in parts of whole roots, or of roots cut to some bands, of `factor` leaves per side.

        most   called as most(bands): how many roots, cut to so many bands each, can be made at a time; 0: not one
        whole  all can be made at a time
        """

    def sections(self, parts: Iterable[Part], factors: Sequence[int]) -> Iterator[Section]:
        """Parts with their trees; `factors` as of `tree`."""

    def place_section(self, device: Device, sums: Buffer, section: Section, flat: FlatArray) -> None:
        """Write compensated sums (4, pixels) on the device to the pixels of a section in the flat image."""

    def n_roots(self, first: int, last: int, factor: int) -> int:
        """Roots of `factor` leaves per side in bands first ... last - 1."""

    def part_size(self, part: Part, factor: int) -> tuple[int, int]:
        """Roots and pixels, padding included, of a part; of listed points an upper bound of the pixels."""

    def root_bands(self, factor: int) -> int:
        """Bands that a root of `factor` leaves per side reaches over."""

    def root_leaves(self, factor: int, bands: int) -> int:
        """Leaves of a root of `factor` leaves per side, cut to so many bands, at most."""

    def leaf_radius(self, side: int) -> float:
        """Largest distance of a pixel from the centre of a leaf of that side, m, about."""

    def level_radii(self, factors: Sequence[int]) -> list[float]:
        """Largest distance of a pixel from the centre of its tile, m, for each level; `factors` as of `tree`."""

    def child_distance(self, radius: float, below: float) -> float:
        """Largest distance between the centres of a tile of `radius` and of its children, whose radius is `below`."""

    @property
    def longest_side(self) -> int:
        """Pixels along the longer side of the image, about."""

    def count(self, first: int, last: int) -> int:
        """Pixels of bands first ... last - 1, empty cells included, without padding."""
        extent = self.extent(first, last)
        return int((extent.stop - extent.start) * np.prod(self.row_shape, dtype=np.int64))

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
        self, device: Device, sums: Buffer, run: Run, tiles: tuple[int, int], orders: Orders, flat: FlatArray
    ) -> None:
        """Write compensated sums (4, pixels) on the device of tiles start ... stop - 1 of a run, as `place` does."""
        start, stop = tiles
        n = int(stop - start) * self.per_tile
        self.place(download_sums(device, sums, n), run, start, orders, flat)


def download_sums(device: Device, sums: Buffer, n: int, kind: type[np.floating] = np.float32) -> np.ndarray:
    """Pixels (n,), complex of twice the bytes of `kind`, from compensated sums (4, n) on the device."""
    if kind == np.float32:  # added up there: half of the bytes are downloaded
        pixels, first = device.empty(8 * n), device.upload(np.zeros(1, np.int32))
        untile = device.kernel("assemble_image.cl", "untile")
        numbers = launch_numbers("assemble_image.cl", "untile", pixels=n, across=1, high=1, wide=n, columns=n)
        device.run(untile, (n, 1), None, numbers, sums, first, pixels)
        return device.download(pixels, np.empty(n, np.complex64))
    real, imaginary, real_rest, imaginary_rest = device.download(sums, np.empty((4, n), kind))
    return np.asarray((real + real_rest) + 1j * (imaginary + imaginary_rest))


@dataclass(frozen=True, eq=False)
class Tree:
    """Tiles of every level. The children of a tile are consecutive in the level below.

    centers   for each level: m about the scene's centre (n, 3)
    children  for each level but the last: number of the first child of each tile, and the end of the last (n + 1,)
    leaves    tiles of the last level, in its order
    slot      (n leaves,): number of each leaf among the tiles of its bands
    """

    centers: tuple[np.ndarray, ...]
    children: tuple[np.ndarray, ...]
    leaves: Tiles
    slot: np.ndarray

    @property
    def parents(self) -> list[np.ndarray]:
        """For each level but the first: number of the tile above each tile, int32 (n,)."""
        return [np.repeat(np.arange(len(c) - 1, dtype=np.int32), np.diff(c)) for c in self.children]

    def leaves_of(self, root: int) -> tuple[int, int]:
        """First leaf of a root, and one beyond its last."""
        low, high = root, root + 1
        for children in self.children:
            low, high = int(children[low]), int(children[high])
        return low, high

    def part(self, low: int, high: int) -> Tree:
        """Roots low ... high - 1, and all tiles below them."""
        centers, children = [self.centers[0][low:high]], []
        for below, begins in zip(self.centers[1:], self.children, strict=True):
            children.append(begins[low : high + 1] - begins[low])
            low, high = int(begins[low]), int(begins[high])
            centers.append(below[low:high])
        return Tree(tuple(centers), tuple(children), self.leaves.picked(np.arange(low, high)), self.slot[low:high])

    def radii(self) -> list[float]:
        """Largest distance of a point from the centre of its tile, m, for each level."""
        reach = self.leaves.radius
        out = [float(reach.max())]
        for level in range(len(self.children) - 1, -1, -1):
            starts = self.children[level]
            parent = np.repeat(np.arange(len(starts) - 1), np.diff(starts))
            distance = np.linalg.norm(self.centers[level + 1] - self.centers[level][parent], axis=1) + reach
            reach = np.maximum.reduceat(distance, starts[:-1])
            out.append(float(reach.max()))
        return out[::-1]
