"""Scatterers in cubic cells: an octree along the Morton curve, of which only cells that hold scatterers exist."""

from __future__ import annotations

import functools
import itertools
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ...base.boxes import box
from ...base.morton import DEPTH, morton_codes, order_of_codes
from ...numerics.pulse_geometry import PulseGeometry

WINDOW_DEPTHS = (3, 6)  # depths of cells that are looked for in the range window, coarse ones first
DEEPEST = 12  # depth of the smallest cells: beyond it cells of a million points hold one each
SAMPLE = 2**14  # scatterers from which the numbers of cells are estimated: cells of twenty share some hundred pairs
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


@dataclass(frozen=True, eq=False)
class PlaceSample:
    """Places of some scatterers, drawn at random: m (k, 3), of n in all, whose box is `bounds`, m (2, 3)."""

    n: int
    places: np.ndarray
    bounds: np.ndarray

    @classmethod
    def of(cls, positions: np.ndarray) -> PlaceSample:
        """Of scatterers at positions, m (n, 3)."""
        return cls(len(positions), positions[drawn_numbers(len(positions))], box(positions))


def drawn_numbers(n: int) -> np.ndarray:
    """Up to SAMPLE of the numbers 0 ... n - 1, drawn at random."""
    return np.random.default_rng(0).choice(n, min(SAMPLE, n), replace=False, shuffle=False)


class ScattererCells:
    """Points along the Morton curve of the cube that holds them, and their cells of any depth.

    order      of the points as they were given;  positions  m (n, 3), in that order, about `center`, m (3,)
    bounds     m (2, 3);  sample  some of the points
    Points are sorted when their order is first needed: whether cells pay follows from the sample.
    """

    def __init__(self, positions: np.ndarray | Callable[[], np.ndarray], sample: PlaceSample | None = None) -> None:
        """positions  m (n, 3);  sample  of them, where that is known before they are"""
        self._given = positions if callable(positions) else lambda: positions
        self.sample = PlaceSample.of(self._given()) if sample is None else sample
        self.bounds = self.sample.bounds
        self.center = self.bounds.mean(axis=0)

    def __len__(self) -> int:
        return self.sample.n

    @functools.cached_property
    def _sorted(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Codes, order and positions about the centre, along the curve."""
        positions = self._given()
        codes = morton_codes(positions)[0]
        order = order_of_codes(codes)
        return codes[order], order, np.take(positions, order, axis=0) - self.center

    @property
    def order(self) -> np.ndarray:
        """See the class."""
        return self._sorted[1]

    @property
    def positions(self) -> np.ndarray:
        """See the class."""
        return self._sorted[2]

    def first(self, depth: int) -> np.ndarray:
        """First point of each cell of a depth, and the number of points."""
        return _first(self._sorted[0], depth)

    @functools.cached_property
    def numbers(self) -> list[float]:
        """About the numbers of cells of each depth that hold points.

        Cells that the sample misses are counted from those that hold one and two of it (Chao 1984), and of these the
        ones that all points reach by equation 9 of Colwell et al. 2012 (Journal of Plant Ecology 5, 3).
        """
        codes, numbers = np.sort(morton_codes(self.sample.places, self.bounds)[0]), []
        for depth in range(DEEPEST + 1):
            counts = np.diff(_first(codes, depth))
            once, twice = np.sum(counts == 1), np.sum(counts == 2)
            missed = once * (once - 1) / (2 * (twice + 1))
            share = once / max(len(codes) * missed + once, 1)  # of the missed cells, that one more point reaches
            numbers.append(len(counts) + missed * (1 - (1 - share) ** (len(self) - len(codes))))
        return np.maximum.accumulate(numbers).tolist()

    @functools.cached_property
    def typical_radii(self) -> list[float]:
        """About the radii, m, of cells of each depth: half the diagonal of a square, or of a cube where cells fill a
        volume."""
        is_flat = [True, *(n < PLANAR * fewer for fewer, n in itertools.pairwise(self.numbers))]
        edge = float(np.ptp(self.bounds, axis=0).max() or 1.0)
        return [edge / 2 ** (depth + 1) * (2 if flat else 3) ** 0.5 for depth, flat in enumerate(is_flat)]

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
    if antennas.holds(cells.bounds):
        return np.ones(len(cells), bool)
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


def _first(codes: np.ndarray, depth: int) -> np.ndarray:
    """First of sorted codes in each cell of a depth, and their number."""
    cell = codes >> np.uint64(3 * (DEPTH - depth))
    return np.concatenate([[0], np.flatnonzero(cell[1:] != cell[:-1]) + 1, [len(codes)]])
