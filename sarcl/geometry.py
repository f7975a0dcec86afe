"""Antennas and tiles of points as kernels/geometry.clh wants them: extended precision here, float32 pairs there."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from . import cl
from .check import SPEED_OF_LIGHT
from .grid import ImageGrid
from .scene import box


@dataclass(frozen=True, eq=False)
class Antennas:
    """Antenna positions, m (n, 3), of n rows, and what they mean at the scene's centre.

    rx is None where it equals tx. reference_range m, frequency (of zero phase slope) and frequency_step Hz,
    near and far (range window about the reference, m): each (n,). wrap: profiles repeat instead.
    """

    tx: np.ndarray
    rx: np.ndarray | None
    reference_range: np.ndarray
    frequency: np.ndarray
    frequency_step: np.ndarray
    near: np.ndarray
    far: np.ndarray
    wrap: bool = False

    def distance(self, bounds: np.ndarray) -> float:
        """Smallest distance of any antenna from a box (2, 3), m; 0 inside it."""
        ends = [self.tx] if self.rx is None else [self.tx, self.rx]
        return min(float(np.linalg.norm(e - np.clip(e, *bounds), axis=1).min()) for e in ends)

    def packed(self, center: np.ndarray, length: int, start: int, stop: int, lanes: int) -> np.ndarray:
        """Per-pulse array (2, components, n) float32 of rows start ... stop - 1 for profiles of `length` samples.

        n is rounded up to whole vectors of `lanes` by repeating the last row. Lengths are taken in extended
        precision, so that only their small difference from the reference is ever rounded.
        """
        n = -(-(stop - start) // lanes) * lanes
        rows = np.minimum(np.arange(start, start + n), stop - 1)
        c = center.astype(np.longdouble)
        tx = self.tx[rows].astype(np.longdouble) - c
        tx_length = np.sqrt((tx**2).sum(axis=1))
        rx, rx_length = tx, tx_length
        if self.rx is not None:
            rx = self.rx[rows].astype(np.longdouble) - c
            rx_length = np.sqrt((rx**2).sum(axis=1))
        delta = (tx_length + rx_length) / 2 - self.reference_range[rows]  # longdouble, perhaps thousands of kilometres
        kappa = np.longdouble(2) * self.frequency[rows] / SPEED_OF_LIGHT
        sigma = np.longdouble(2) * self.frequency_step[rows] * length / SPEED_OF_LIGHT
        place = delta * sigma
        if self.wrap:
            place = place - length * np.rint(place / length)
        # a centre this far outside the window has no place in a profile; the window test is in metres
        place = np.clip(place, -(2.0**30), 2.0**30)
        turn = delta * kappa - np.rint(delta * kappa)
        near, far = self.near[rows] - delta, self.far[rows] - delta
        components = [*tx.T, tx_length, turn, place, kappa, sigma, near, far]
        if self.rx is not None:
            components += [*rx.T, rx_length]
        return cl.wide(np.stack(components))


@dataclass(frozen=True, eq=False)
class Tiles:
    """Points in tiles of `per_tile`, each about its own reference, so that float32 carries them.

    references  m about the scene's centre (n_tiles, 3), float64
    radius      m (n_tiles,): distance of the farthest point of the tile
    offsets     m, hi then lo parts (6, n_points) float32; one tile's points when `shared`
    shared      every tile has the same offsets
    """

    per_tile: int
    references: np.ndarray
    radius: np.ndarray
    offsets: np.ndarray
    shared: bool

    @property
    def n_tiles(self) -> int:
        return len(self.references)


def tile_points(
    positions: np.ndarray, center: np.ndarray, per_tile: int, order: np.ndarray | None = None
) -> tuple[Tiles, np.ndarray]:
    """Tiles of points, m (n, 3), near one another along a space-filling curve, and the order of the points.

    The order has whole tiles; the last point fills up the last tile. Give `order` where it is known.
    """
    order = morton_order(positions) if order is None else order
    n_tiles = -(-len(order) // per_tile)
    order = np.concatenate([order, np.repeat(order[-1:], n_tiles * per_tile - len(order))])
    local = (positions[order] - center).reshape(n_tiles, per_tile, 3)
    references = (local.min(axis=1) + local.max(axis=1)) / 2
    offsets = local - references[:, None]
    radius = np.sqrt((offsets**2).sum(axis=-1).max(axis=1))
    packed = cl.wide(offsets.reshape(-1, 3).T).reshape(6, -1)
    return Tiles(per_tile, references, radius, packed, shared=False), order


def morton_order(positions: np.ndarray) -> np.ndarray:
    """Order of points (n, 3) along the Z curve of the cube that holds them (1024 cells a side and more)."""
    low, high = box(positions)
    extent = float((high - low).max()) or 1.0
    cell = ((positions - low) * ((2**20 - 1) / extent)).astype(np.uint64)
    code = np.zeros(len(positions), np.uint64)
    for axis in range(3):
        x = cell[:, axis]
        for shift, mask in (
            (32, 0x1F00000000FFFF),
            (16, 0x1F0000FF0000FF),
            (8, 0x100F00F00F00F00F),
            (4, 0x10C30C30C30C30C3),
            (2, 0x1249249249249249),
        ):
            x = (x | (x << np.uint64(shift))) & np.uint64(mask)
        code |= x << np.uint64(axis)
    return np.argsort(code, kind="stable")


def _power_of_two(n: int) -> int:
    """The smallest power of two that is at least n."""
    return 1 << max(0, n - 1).bit_length()


class GridTiling:
    """One global tiling of an image grid, in bands of tiles that make up consecutive rows (or points).

    Fixed by the grid and the side alone, so that results do not depend on how many bands are done at once.
    """

    LISTED_BAND = 2**18  # points a band of a grid without rows

    def __init__(self, grid: ImageGrid, side: int) -> None:
        self.grid, self.side = grid, side
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
            self._offsets = cl.wide(offsets.T).reshape(6, -1)
            self._radius = float(np.linalg.norm(offsets, axis=1).max())
        else:
            self.n_bands = -(-grid.size // self.LISTED_BAND)
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

    def _padded(self, band: int) -> int:
        n = min(self.LISTED_BAND, self.grid.size - band * self.LISTED_BAND)
        return -(-n // self.per_tile) * self.per_tile

    def band(self, index: int) -> tuple[Tiles, np.ndarray | None]:
        """Tiles of one band, and for listed points their order within it."""
        if self.grid.listed is not None:
            at = slice(index * self.LISTED_BAND, (index + 1) * self.LISTED_BAND)
            return tile_points(self.grid.listed.reshape(-1, 3)[at], self.center, self.per_tile)
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
            n = min(self.LISTED_BAND, self.grid.size - band * self.LISTED_BAND)
            block = np.empty(n, values.dtype)
            block[order] = values[start : start + len(order)]
            start += len(order)
            yield slice(band * self.LISTED_BAND, band * self.LISTED_BAND + n), block

    def tile_sizes(self, first: int, last: int) -> np.ndarray:
        """Real pixels (without padding) of every tile of bands first ... last - 1."""
        if self.grid.is_plane:
            rows, columns = self.grid.shape
            high = np.minimum(np.arange(first + 1, last + 1) * self.high, rows) - np.arange(first, last) * self.high
            wide = np.minimum(np.arange(1, self.across + 1) * self.wide, columns) - np.arange(self.across) * self.wide
            return np.outer(high, wide).ravel()
        sizes = []
        for b in range(first, last):
            n = min(self.LISTED_BAND, self.grid.size - b * self.LISTED_BAND)
            full = np.full(self._padded(b) // self.per_tile, self.per_tile)
            full[-1] -= self._padded(b) - n
            sizes.append(full)
        return np.concatenate(sizes)
