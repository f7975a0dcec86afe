"""One tiling of a grid, in bands of tiles: the units in which an image is made."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from ..base import float_pairs
from ..model.image_grid import ImageGrid
from ..numerics.tiles import Tiles, tile_points
from ..opencl.device import Device


def _power_of_two(n: int) -> int:
    """The smallest power of two that is at least n."""
    return 1 << max(0, n - 1).bit_length()


class GridTiling:
    """One global tiling of an image grid, in bands of tiles that make up consecutive rows (or points).

    Fixed by the grid and the side alone, so that results do not depend on how many bands are done at once. Empty
    cells are in no tile, and their pixels 0; `grid` has other positions in them.
    """

    LISTED_BAND = 2**18  # points a band of a grid without rows

    def __init__(self, grid: ImageGrid, side: int) -> None:
        self.grid, self.side, self.empty = grid.filled(), side, grid.empty
        self.per_tile = side * side
        self.center = grid.bounds.mean(axis=0)
        if grid.is_plane:
            rows, columns = grid.shape
            # square tiles, but no higher or wider than a strip needs
            self.high = min(side, _power_of_two(rows))
            self.wide = min(side * side // self.high, max(side, _power_of_two(columns)))
            self.high = side * side // self.wide
            self.n_bands = -(-rows // self.high)
            self.across = -(-columns // self.wide)
            down, right = (np.arange(n) - (n - 1) / 2 for n in (self.high, self.wide))
            assert grid.spacing is not None and grid.x_axis is not None and grid.y_axis is not None
            y = down[:, None, None] * grid.spacing[0] * grid.y_axis
            offsets = (y + right[:, None] * grid.spacing[1] * grid.x_axis).reshape(-1, 3)
            self._offsets = float_pairs.wide(offsets.T).reshape(6, -1)
            self._radius = float(np.linalg.norm(offsets, axis=1).max())
        else:
            self.n_bands = -(-grid.size // self.LISTED_BAND)
            self._full = [self._cells(b) for b in range(self.n_bands)]
            self._radius = max(float(self.band(b)[0].radius.max()) for b in range(self.n_bands))

    @property
    def radius(self) -> float:
        """Radius of the largest tile, m."""
        return self._radius

    def pixels(self, first: int, last: int) -> int:
        """Pixels, padding included, of bands first ... last - 1."""
        if self.grid.is_plane:
            return (last - first) * self.across * self.per_tile
        return sum(self._padded(b) for b in range(first, last))

    def _size(self, band: int) -> int:
        """Cells of a band of listed points, empty ones too."""
        return min(self.LISTED_BAND, self.grid.size - band * self.LISTED_BAND)

    def _empty_in(self, band: int) -> np.ndarray | None:
        """Which cells of a band of listed points are empty, (n,) bool; None: none is in the grid."""
        start = band * self.LISTED_BAND
        return None if self.empty is None else self.empty.ravel()[start : start + self.LISTED_BAND]

    def _cells(self, band: int) -> int:
        """Cells of a band of listed points that are not empty."""
        empty = self._empty_in(band)
        return self._size(band) if empty is None else int((~empty).sum())

    def _padded(self, band: int) -> int:
        return -(-max(self._full[band], 1) // self.per_tile) * self.per_tile

    def band(self, index: int) -> tuple[Tiles, np.ndarray | None]:
        """Tiles of one band, and for listed points their order within it."""
        if self.grid.listed is not None:
            at = slice(index * self.LISTED_BAND, (index + 1) * self.LISTED_BAND)
            points, empty = self.grid.listed.reshape(-1, 3)[at], self._empty_in(index)
            if empty is None:
                return tile_points(points, self.center, self.per_tile)
            # a band without a point keeps a tile, of one cell whose pixel is thrown away
            cells = np.flatnonzero(~empty) if self._full[index] else np.zeros(1, np.int64)
            tiles, order = tile_points(points[cells], self.center, self.per_tile)
            return tiles, cells[order]
        columns = np.arange(self.across) * self.wide + (self.wide - 1) / 2
        row = index * self.high + (self.high - 1) / 2
        references = self.grid.at(np.full(self.across, row), columns) - self.center
        radius = np.full(self.across, self._radius)
        return Tiles(self.per_tile, references, radius, self._offsets, shared=True), None

    def bands(self, first: int, last: int) -> tuple[Tiles, list[np.ndarray | None]]:
        """Tiles of bands first ... last - 1 in one."""
        parts = [self.band(b) for b in range(first, last)]
        tiles = [t for t, _ in parts]
        offsets = tiles[0].offsets if tiles[0].shared else np.concatenate([t.offsets for t in tiles], axis=1)
        joined = Tiles(
            self.per_tile,
            np.concatenate([t.references for t in tiles]),
            np.concatenate([t.radius for t in tiles]),
            offsets,
            tiles[0].shared,
        )
        return joined, [order for _, order in parts]

    def download(self, device: Device, totals: Any, first: int, last: int, slot: np.ndarray | None) -> np.ndarray:
        """Rows of a plane, complex64, of bands first ... last - 1, from compensated sums (4, pixels) on the device.

        slot  (tiles,) int: where each of the sums' tiles stands among the bands', row by row; None: in that order
        """
        rows, columns = self.grid.shape
        height, n_tiles = min(last * self.high, rows) - first * self.high, (last - first) * self.across
        where = np.empty(n_tiles, np.int32)
        where[np.arange(n_tiles) if slot is None else slot] = np.arange(n_tiles, dtype=np.int32)
        made, slots = device.empty(8 * height * columns), device.upload(where)
        device.run(
            device.kernel("assemble_image.cl", "untile"), (columns, height), None,
            totals, np.uint64(n_tiles * self.per_tile), slots, self.across, self.high, self.wide, columns, made,
        )  # fmt: skip
        return device.download(made, np.empty((height, columns), np.complex64))

    def place(self, values: np.ndarray, first: int, last: int, orders: list[np.ndarray | None], out: Any) -> None:
        """Write tile-ordered values (n,) of bands first ... last - 1 to their pixels in `out`."""
        for at, block in self._untiled(values, first, last, orders):
            out[at] = block

    def _untiled(
        self, values: np.ndarray, first: int, last: int, orders: list[np.ndarray | None]
    ) -> Iterator[tuple[Any, np.ndarray]]:
        if self.grid.is_plane:
            rows, columns = self.grid.shape
            high, wide = self.high, self.wide
            tiled = values.reshape(last - first, self.across, high, wide).transpose(0, 2, 1, 3)
            whole = tiled.reshape((last - first) * high, self.across * wide)
            stop = min(last * high, rows)
            yield slice(first * high, stop), whole[: stop - first * high, :columns]
            return
        start = 0
        for band, order in zip(range(first, last), orders, strict=True):
            assert order is not None
            n, empty = self._size(band), self._empty_in(band)
            block = np.empty(n, values.dtype)
            block[order] = values[start : start + len(order)]
            if empty is not None:
                block[empty] = 0
            start += len(order)
            yield slice(band * self.LISTED_BAND, band * self.LISTED_BAND + n), block

    def tile_sizes(self, first: int, last: int) -> np.ndarray:
        """Real pixels (without padding and empty cells) of every tile of bands first ... last - 1."""
        if self.grid.is_plane:
            rows, columns = self.grid.shape
            high = np.minimum(np.arange(first + 1, last + 1) * self.high, rows) - np.arange(first, last) * self.high
            wide = np.minimum(np.arange(1, self.across + 1) * self.wide, columns) - np.arange(self.across) * self.wide
            return np.outer(high, wide).ravel()
        sizes = []
        for b in range(first, last):
            full = np.full(self._padded(b) // self.per_tile, self.per_tile)
            full[-1] -= self._padded(b) - self._full[b]
            sizes.append(full)
        return np.concatenate(sizes)


Run = tuple[int, int]  # bands first ... last - 1


def row_shape(grid: ImageGrid) -> tuple[int, ...]:
    """Shape of one entry of ImageOutput.flat: a row of a plane, or one listed point."""
    return tuple(grid.shape[1:]) if grid.is_plane else ()


def extent(tiling: GridTiling, first: int, last: int) -> slice:
    """Where bands first ... last - 1 lie in ImageOutput.flat."""
    step, end = (tiling.high, tiling.grid.shape[0]) if tiling.grid.is_plane else (tiling.LISTED_BAND, tiling.grid.size)
    return slice(first * step, min(last * step, end))


def count(tiling: GridTiling, first: int, last: int) -> int:
    """Real pixels, without padding, of bands first ... last - 1."""
    at = extent(tiling, first, last)
    return int((at.stop - at.start) * np.prod(row_shape(tiling.grid), dtype=np.int64))


def place_tiles(tiling: GridTiling, values: np.ndarray, band: int, start: int, stop: int, flat: Any) -> None:
    """Write tile-ordered values (n,) of tiles start ... stop - 1 of one band of a plane to their pixels in `flat`."""
    rows, columns = extent(tiling, band, band + 1), tiling.grid.shape[1]
    left, right = start * tiling.wide, min(stop * tiling.wide, columns)
    block = values.reshape(stop - start, tiling.high, tiling.wide).transpose(1, 0, 2).reshape(tiling.high, -1)
    flat[rows, left:right] = block[: rows.stop - rows.start, : right - left]
