"""Quadtree of tiles: from the roots, which gather sub-apertures first, down to the leaves that hold pixels."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...numerics.tiles import Tiles


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
