"""Points cut into tiles for the kernels: each tile's reference point and the points' offsets from it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..base import float_pairs
from ..base.morton import morton_order

BLOCK = 2**15  # points that are put into tiles together


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

    @property
    def positions(self) -> np.ndarray:
        """Positions of all points about the scene's centre, m (n_tiles, per_tile, 3), float64."""
        high, low = self.offsets.astype(np.float64).reshape(2, 3, -1, self.per_tile)
        return np.asarray(self.references[:, None] + np.moveaxis(high + low, 0, -1))

    def radii_in_parts(self, n: int) -> np.ndarray:
        """Radii, m, of tiles of n points, of which each tile here would make several."""
        step, squares = max(BLOCK // n, 1) * n, []
        for first in range(0, self.offsets.shape[1], step):
            high, low = self.offsets[:, first : first + step].astype(np.float64).reshape(2, 3, -1, n)
            local = high + low
            from_middle = local - ((local.min(axis=2) + local.max(axis=2)) / 2)[:, :, None]
            squares.append(np.einsum("ijk,ijk->jk", from_middle, from_middle).max(axis=1))
        return np.sqrt(np.concatenate(squares))

    def picked(self, tiles: np.ndarray) -> Tiles:
        """These tiles only."""
        return Tiles(self.per_tile, self.references[tiles], self.radius[tiles], self.tile_offsets(tiles), self.shared)

    def tile_offsets(self, tiles: np.ndarray) -> np.ndarray:
        """Offsets of these tiles only, (6, n_points)."""
        if self.shared:
            return self.offsets
        return self.offsets.reshape(6, -1, self.per_tile)[:, tiles].reshape(6, -1)


def tile_points(
    positions: np.ndarray, center: np.ndarray, per_tile: int, order: np.ndarray | None = None
) -> tuple[Tiles, np.ndarray]:
    """Tiles of points, m (n, 3), near one another along a space-filling curve, and the order of the points.

    The order has whole tiles; the last point fills up the last tile. Give `order` where it is known.
    """
    order = morton_order(positions) if order is None else order
    n_tiles = -(-len(order) // per_tile)
    order = np.concatenate([order, np.repeat(order[-1:], n_tiles * per_tile - len(order))])
    references, radius = np.empty((n_tiles, 3)), np.empty(n_tiles)
    packed = np.empty((6, len(order)), np.float32)
    step = max(BLOCK // per_tile, 1)
    for first in range(0, n_tiles, step):  # so few at a time stay in the processor's cache
        block = slice(first, min(first + step, n_tiles))
        points = slice(block.start * per_tile, block.stop * per_tile)
        # coordinate by coordinate: reductions along an axis of three, or across one, are slow
        local = (positions[order[points]].T - center[:, None]).reshape(3, -1, per_tile)
        middle = (local.min(axis=2) + local.max(axis=2)) / 2
        local -= middle[:, :, None]
        references[block], radius[block] = middle.T, np.sqrt((local**2).sum(axis=0).max(axis=1))
        packed[:, points] = float_pairs.wide(local.reshape(3, -1)).reshape(6, -1)
    return Tiles(per_tile, references, radius, packed, shared=False), order
