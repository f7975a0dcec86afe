"""Tiles within tiles: from the tiles that first gather sub-apertures down to the leaves that hold pixels."""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np

from ...numerics.tiles import Tiles
from ..tiling import GridTiling


@dataclass(frozen=True, eq=False)
class Tree:
    """Tiles of every level, the children of a tile being consecutive in the level below.

    centers   per level: m about the scene's centre (n, 3)
    children  per level but the last: first child of each tile, and one more (n + 1,)
    leaves    Tiles of the last level, in its order
    slot      (n leaves,): where a leaf stands among the tiles of its bands
    """

    centers: tuple[np.ndarray, ...]
    children: tuple[np.ndarray, ...]
    leaves: Tiles
    slot: np.ndarray

    @property
    def parents(self) -> list[np.ndarray]:
        """Per level but the first: the tile above each tile, int32 (n,)."""
        return [np.repeat(np.arange(len(c) - 1, dtype=np.int32), np.diff(c)) for c in self.children]

    def leaves_of(self, top: int) -> tuple[int, int]:
        """First leaf of a tile of the first level, and one beyond its last."""
        low, high = top, top + 1
        for children in self.children:
            low, high = int(children[low]), int(children[high])
        return low, high


def tree_of(tiling: GridTiling, first: int, last: int, factors: tuple[int, ...]) -> Tree:
    """Tree over bands first ... last - 1; `factors`: leaves a side in a tile of each level, the last 1."""
    return (plane_tree if tiling.grid.is_plane else point_tree)(tiling, first, last, factors)


def plane_tree(tiling: GridTiling, first: int, last: int, factors: tuple[int, ...]) -> Tree:
    """Tree over bands first ... last - 1 of a plane; `factors`: leaves a side in a tile of each level, the last 1.

    Tiles are cut from the whole grid, so that they do not depend on which bands are asked for.
    """
    grid = tiling.grid
    down, right = (a.ravel() for a in np.meshgrid(np.arange(first, last), np.arange(tiling.across), indexing="ij"))
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
        rows = (down[order][at] // factor * factor + factor / 2) * tiling.high
        columns = (right[order][at] // factor * factor + factor / 2) * tiling.wide
        centers.append(grid.at(rows, columns) - tiling.center)
        starts = np.append(at, len(order))
        if level < len(factors) - 1:
            children.append(np.searchsorted(starts_below, starts))
        starts_below = starts
    tiles, _ = tiling.bands(first, last)
    centers[0] = tiles.references[order]
    leaves = Tiles(tiles.per_tile, centers[0], tiles.radius[order], tiles.offsets, tiles.shared)
    return Tree(tuple(centers[::-1]), tuple(children[::-1]), leaves, order)


def point_tree(tiling: GridTiling, first: int, last: int, factors: tuple[int, ...]) -> Tree:
    """Tree over bands of listed points, whose tiles follow a space-filling curve; `factors` as of `plane_tree`."""
    parts = [tiling.band(b)[0] for b in range(first, last)]
    counts = np.array([t.n_tiles for t in parts])
    tiles, _ = tiling.bands(first, last)
    edge = np.concatenate([[0], np.cumsum(counts)])
    starts = [
        np.unique(
            np.concatenate([[*(edge[i] + np.arange(0, n, factor**2)), edge[i + 1]] for i, n in enumerate(counts)])
        )
        for factor in factors
    ]
    centers = []
    for begin in starts:
        low = np.minimum.reduceat(tiles.references, begin[:-1])
        high = np.maximum.reduceat(tiles.references, begin[:-1])
        centers.append((low + high) / 2)
    children = [np.searchsorted(below, above) for above, below in itertools.pairwise(starts)]
    return Tree(tuple(centers), tuple(children), tiles, np.arange(tiles.n_tiles))


def spread_of(tree: Tree, radius: np.ndarray) -> list[float]:
    """Largest distance of a point from its tile's centre, m, level by level; radius (n leaves,) of the leaves."""
    out, reach = [float(radius.max())], radius
    for level in range(len(tree.children) - 1, -1, -1):
        starts = tree.children[level]
        parent = np.repeat(np.arange(len(starts) - 1), np.diff(starts))
        distance = np.linalg.norm(tree.centers[level + 1] - tree.centers[level][parent], axis=1) + reach
        reach = np.maximum.reduceat(distance, starts[:-1])
        out.append(float(reach.max()))
    return out[::-1]
