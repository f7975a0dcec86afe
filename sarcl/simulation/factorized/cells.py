"""Scatterers in cubic cells: an octree along the Morton curve, of which only cells that hold scatterers exist."""

from __future__ import annotations

import functools
from dataclasses import dataclass

import numpy as np

from ...base.boxes import box
from ...base.morton import DEPTH, morton_codes, order_of_codes
from ...numerics.pulse_geometry import PulseGeometry

WINDOW_DEPTHS = (0, 3, 6)  # depths of cells that are looked for in the range window, coarse ones first
PLANAR = 5.6  # ratio of the numbers of cells at two depths, 4 on a plane and 8 in a volume, below which they are flat


@dataclass(frozen=True, eq=False)
class CellLevel:
    """The cells of one depth, in Morton order.

    first      first point of each cell, and the number of points (n + 1,)
    low, high  corners of the boxes of their points, m about the middle of all points (n, 3)
    radii      m (n,), of the points of a cell about its centre
    """

    first: np.ndarray
    low: np.ndarray
    high: np.ndarray
    radii: np.ndarray

    def __len__(self) -> int:
        return len(self.radii)

    @functools.cached_property
    def centers(self) -> np.ndarray:
        """Centres of the boxes, m (n, 3)."""
        return np.asarray((self.low + self.high) / 2)

    @property
    def radius(self) -> float:
        """The largest radius, m."""
        return float(self.radii.max())

    def children_in(self, smaller: CellLevel) -> np.ndarray:
        """First cell of a deeper level in each of these, and the number of those cells: int32 (n + 1,)."""
        return np.searchsorted(smaller.first, self.first).astype(np.int32)

    def parents_of(self, smaller: CellLevel) -> np.ndarray:
        """Cell of this level that each cell of a deeper level lies in: int32."""
        return (np.searchsorted(self.first, smaller.first[:-1], side="right") - 1).astype(np.int32)


class ScattererCells:
    """Points along the Morton curve of the cube that holds them, and their cells of any depth.

    order      of the points as they were given;  positions  m (n, 3), in that order, about `center`, m (3,)
    bounds     m (2, 3)
    """

    def __init__(self, positions: np.ndarray) -> None:
        self.bounds = box(positions)
        self.center = self.bounds.mean(axis=0)
        codes, extent = morton_codes(positions)
        self.order = order_of_codes(codes)
        self._codes, self._extent = codes[self.order], extent
        self.positions = np.take(positions, self.order, axis=0)
        self.positions -= self.center

    def __len__(self) -> int:
        return len(self.order)

    def edge(self, depth: int) -> float:
        """Edge of the cells of a depth, m."""
        return self._extent / 2**depth

    @functools.cache  # noqa: B019  a table of small arrays, which lives as long as the points
    def first(self, depth: int) -> np.ndarray:
        """First point of each cell of a depth, and the number of points."""
        cell = self._codes >> np.uint64(3 * (DEPTH - depth))
        return np.concatenate([[0], np.flatnonzero(cell[1:] != cell[:-1]) + 1, [len(self)]])

    @functools.cache  # noqa: B019  a table of numbers, which lives as long as the points
    def typical_radius(self, depth: int) -> float:
        """About the radius, m, of cells of a depth: half the diagonal of a square, or of a cube where cells fill a
        volume."""
        growth = (len(self.first(depth)) - 1) / max(len(self.first(depth - 1)) - 1, 1) if depth else 1.0
        return float(self.edge(depth) / 2 * np.sqrt(2 if growth < PLANAR else 3))

    def level(self, depth: int) -> CellLevel:
        """The cells of a depth."""
        first = self.first(depth)
        low, high = (f.reduceat(self.positions, first[:-1], axis=0) for f in (np.minimum, np.maximum))
        centers = (low + high) / 2
        counts, squares = np.diff(first), np.zeros(len(self))
        for axis in range(3):
            local = self.positions[:, axis] - np.repeat(centers[:, axis], counts)
            squares += local * local
        return CellLevel(first, low, high, np.sqrt(np.maximum.reduceat(squares, first[:-1])))

    def joined(self, depth: int, smaller: CellLevel) -> CellLevel:
        """The cells of a depth, from those of a deeper one: their radius is a bound."""
        first = self.first(depth)
        begin = np.searchsorted(smaller.first, first[:-1])
        low, high = np.minimum.reduceat(smaller.low, begin), np.maximum.reduceat(smaller.high, begin)
        apart = smaller.centers - np.repeat((low + high) / 2, np.diff([*begin, len(smaller)]), axis=0)
        radii = np.maximum.reduceat(np.sqrt(np.einsum("ij,ij->i", apart, apart)) + smaller.radii, begin)
        return CellLevel(first, low, high, radii)


def scatterers_in_window(cells: ScattererCells, antennas: PulseGeometry) -> np.ndarray:
    """Whether scatterers, in the order of the cells, lie in all range windows, judged by cells: bool (n,)."""
    inside = np.zeros(len(cells), bool)
    undecided = np.zeros(1, int)  # first scatterers of cells of the depth before that may be inside or not
    for depth, before in zip(WINDOW_DEPTHS, (0, *WINDOW_DEPTHS), strict=False):
        first, larger = cells.first(depth), cells.first(before)
        parents = larger[np.searchsorted(larger, first[:-1], side="right") - 1]
        candidates = np.flatnonzero(np.isin(parents, undecided))
        crossing = []
        for begin, end in zip(first[candidates].tolist(), first[candidates + 1].tolist(), strict=True):
            low, high = box(cells.positions[begin:end])
            margin = antennas.depth((low + high) / 2 + cells.center)
            radius = float(np.linalg.norm(high - low)) / 2 * (1 + 1e-9)
            if margin.min() >= radius:
                inside[begin:end] = True
            elif margin.max() >= -radius:
                crossing.append(begin)
        undecided = np.array(crossing, int)
    return inside
