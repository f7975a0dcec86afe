"""The tiling of listed points: tiles along a space-filling curve, in bands of the list."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable, Iterator, Sequence
from weakref import WeakKeyDictionary

import numpy as np

from ...base.morton import morton_order
from ...blocks.bands import FlatArray, Run
from ...model.image_grid import ImageGrid
from ...numerics.tiles import Tiles, tile_points
from ...opencl.device import Buffer, Device
from .tiling import Orders, Part, Roots, Section, Tiling, Tree

LISTED = 2**18  # points of a band, the unit in which an image is made and its tiles are kept
KEPT = 2**25  # points of a grid whose order is kept, in 4 bytes each


class _Curve:
    """Orders and radii that the tilings of one grid share.

    orders  {band: order of its cells that are not empty, int32, along a space-filling curve}
    radii   {side: the largest radius of a tile, m}
    """

    def __init__(self) -> None:
        self.orders: dict[int, np.ndarray] = {}
        self.radii: dict[int, float] = {}

    def order(self, band: int, points: np.ndarray) -> np.ndarray:
        """The order of the points (n, 3) of a band."""
        order = self.orders.get(band)
        if order is None:
            order = morton_order(points).astype(np.int32)
            if sum(map(len, [*self.orders.values()])) + len(order) <= KEPT:
                self.orders[band] = order
        return order


_curves: WeakKeyDictionary[ImageGrid, dict[int, _Curve]] = WeakKeyDictionary()  # by the points of a band


class PointTiling(Tiling):
    """Listed points in tiles along a space-filling curve. A band is `listed` points in the order of the list."""

    row_shape, in_rows, offset_bytes, leaf_sides = (), False, 24, (16,)

    def __init__(self, grid: ImageGrid, side: int, listed: int = LISTED) -> None:
        super().__init__(grid, side)
        self.listed = listed
        self.empty = None if grid.empty is None else grid.empty.ravel()
        self.n_bands = -(-grid.size // listed)
        self._full = [self._cells(b) for b in range(self.n_bands)]
        self._curve = _curves.setdefault(grid, {}).setdefault(listed, _Curve())
        if side not in self._curve.radii:
            self._curve.radii[side] = max(float(self.band(b)[0].radius.max()) for b in range(self.n_bands))
        self.radius = self._curve.radii[side]

    def extent(self, first: int, last: int) -> slice:
        return slice(first * self.listed, min(last * self.listed, self.grid.size))

    def pixels(self, first: int, last: int) -> int:
        return sum(self._padded(b) for b in range(first, last))

    def _empty_in(self, band: int) -> np.ndarray | None:
        """Mask of the empty cells of a band, (n,) bool; None: no cell of the grid is."""
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
            return tile_points(points, self.center, self.per_tile, self._curve.order(index, points))
        # a band without a point keeps a tile, of one cell whose pixel is set to 0
        cells = np.flatnonzero(~empty) if self._full[index] else np.zeros(1, np.int64)
        points = points[cells]
        tiles, order = tile_points(points, self.center, self.per_tile, self._curve.order(index, points))
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

    def place(self, values: np.ndarray, run: Run, start: int, orders: Orders, flat: FlatArray) -> None:
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
        for run, parts_of_run in itertools.groupby(parts, lambda part: part[:2]):
            tiles, orders = self.bands(*run)
            tree, sizes = self._tree(tiles, run, factors), self.tile_sizes(*run)
            line = np.repeat(range(*run), [self.n_roots(b, b + 1, factors[0]) for b in range(*run)])
            roots = Roots(tree.centers[0], line)
            for part in parts_of_run:
                below = tree.part(part.low, part.high)
                yield Section(part, below, roots, np.arange(part.low, part.high), sizes[below.slot], orders)

    def place_section(self, device: Device, sums: Buffer, section: Section, flat: FlatArray) -> None:
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
