"""Conductors that cut cells (Dey and Mittra): free lengths of edges and free areas of faces, as lists.

The surface comes as intervals: on every line of the grid, where the line is inside the body. A formula gives them for a
sphere, rays for a mesh. All arrays are those of a box around the body.

Fields with free areas A of faces and free lengths l of edges are stable where s^2 times the largest eigenvalue of
A^-1 C^T l C is below 4, s = c dt/dx and C the curl, whose entries are +-1. By Gershgorin's theorem it is below the
largest sum of any row, whatever positive weights d the faces are given. Face f is therefore stable with

    A_f >= s^2/4 sum over its edges i of l_i sum over the faces g at edge i of d_g/d_f

Weights d = A^-1/2 enlarge few areas, and these little. They are at most (12/STABLE - 1)/3: whole faces, whose weight is
1, are then stable beside faces of any weight, because 4 s^2/4 (1 + 3 d) STABLE is at most 1 for s^2 = 1/12.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..lattice import COURANT, Lattice
from ..target import Target, resting_rows

MARGIN = 2  # cells of a box beyond the cells that a body cuts
STABLE = 1.02  # least areas over those at the limit: rounding of fields in float32 needs a little
HEAVIEST = (1 / COURANT**2 / STABLE - 1) / 3


@dataclass(frozen=True, eq=False)
class Intervals:
    """Where grid lines along one axis are inside a body.

    lines       node numbers of the lines along the two axes after this one, int (n, 2); a line may occur several times
    start, end  nodes, real numbers along the axis (n,), start < end; intervals of a line do not overlap
    """

    lines: np.ndarray
    start: np.ndarray
    end: np.ndarray


@dataclass(frozen=True, eq=False)
class FaceAreas:
    """Shares of faces across one axis that a body covers (n,); their places in one component of the grid, sorted."""

    places: np.ndarray
    covered: np.ndarray

    def free(self, at: np.ndarray, otherwise: np.ndarray) -> np.ndarray:
        """The share of faces at places `at` (n,) that is outside; `otherwise` (n,) where a face is not listed."""
        if not len(self.places):
            return otherwise
        found = np.minimum(np.searchsorted(self.places, at), len(self.places) - 1)
        return np.where(self.places[found] == at, 1 - self.covered[found], otherwise)


@dataclass(frozen=True, eq=False)
class Box:
    """The part of a grid near a body: arrays of this shape, whose cell (0, 0, 0) is cell `low` of the grid."""

    low: np.ndarray
    shape: tuple[int, int, int]

    @classmethod
    def around(cls, lattice: Lattice, intervals: Sequence[Intervals]) -> Box:
        """Holds cells that intervals along x, y and z touch, and MARGIN more on each side, as far as the grid goes."""
        ends = [
            np.roll(np.column_stack([np.floor(end), part.lines]), axis, axis=1)
            for axis, part in enumerate(intervals)
            for end in (part.start, part.end)
        ]
        places = np.concatenate(ends).astype(int) if any(map(len, ends)) else np.zeros((1, 3), int)
        last = np.array(lattice.shape)
        low = np.clip(places.min(axis=0) - MARGIN, 0, last - 1)
        nx, ny, nz = np.clip(places.max(axis=0) + MARGIN + 1, low + 1, last) - low
        return cls(low, (int(nx), int(ny), int(nz)))

    def crossing(self, axis: int, part: Intervals) -> Intervals:
        """The intervals along an axis whose lines pass through the box: those of bodies beside it are left out."""
        across = [(axis + m) % 3 for m in (1, 2)]
        node = part.lines - self.low[across]
        within = ((node >= 0) & (node < np.array(self.shape)[across])).all(axis=1)
        return Intervals(part.lines[within], part.start[within], part.end[within])

    def in_grid(self, lattice: Lattice, at: np.ndarray, component: int) -> np.ndarray:
        """Places in the grid of cells `at` (n,), numbers of a raveled array of the box, in the same order."""
        node = np.unravel_index(at, self.shape)
        within = np.ravel_multi_index([n + first for n, first in zip(node, self.low, strict=True)], lattice.shape)
        return np.asarray(within + component * np.prod(lattice.shape))


def conductor(
    lattice: Lattice,
    intervals: tuple[Intervals, Intervals, Intervals],
    areas: tuple[FaceAreas, FaceAreas, FaceAreas] | None = None,
    staircase: bool = False,
) -> Target:
    """The lists of a perfect conductor, from its intervals along x, y and z.

    areas      of faces across x, y and z; those of other faces are made from their edges
    staircase  an edge conducts where both its ends are inside, and no edge or face is cut: for comparison
    """
    box = Box.around(lattice, intervals)
    inside, free = edge_lengths(box, intervals)
    if staircase:
        free = np.stack([~(inside & _next(inside, a, False)) for a in range(3)]).astype(np.float32)
    near = np.zeros(free.shape, bool)  # edges beside a face whose field is not zero
    cut, weight = [], np.ones(free.shape, np.float32)
    for a in range(3):
        b, c = (a + 1) % 3, (a + 2) % 3
        live = _any_of_four(free[b] > 0, free[c] > 0, a, True)
        for direction, along in ((c, b), (b, c)):
            near[direction] |= live | _before(live, along)
        touched = _any_of_four(free[b] < 1, free[c] < 1, a, False) | _any_of_four(inside, inside, a, False)
        at = np.flatnonzero(live & touched)
        corners, lengths = _around(inside, free, a, at)
        area = free_area(corners, lengths)
        if areas is not None:
            area = areas[a].free(box.in_grid(lattice, at, 0), area)
        some = ((lengths < 1) & (lengths > 0)).any(axis=0) | (area < 1)
        cut.append((at[some], lengths[:, some], area[some]))
        weight[a][~live] = 0
        weight[a].flat[at[some]] = weights(area[some])
    faces, quotients = [np.zeros(0, np.int64)], [np.zeros((4, 0))]
    for a, (at, lengths, area) in enumerate([] if staircase else cut):
        faces.append(box.in_grid(lattice, at, a))
        quotients.append(lengths / np.maximum(area, least_areas(weight, a, at, lengths)))
    edges = [box.in_grid(lattice, np.flatnonzero((free[a] == 0) & near[a]), a) for a in range(3)]
    at, resting = np.concatenate(edges), resting_rows(inside, box.low)
    return Target(at, np.zeros((2, len(at))), np.concatenate(faces), np.concatenate(quotients, axis=1), resting)


def _span(box: Box, axis: int, part: Intervals, first: np.ndarray, last: np.ndarray) -> np.ndarray:
    """Which cells of a box are from `first` to `last` (n,) along the lines of intervals: bool (*shape)."""
    n = box.shape[axis]
    change = np.zeros((n + 1, *(box.shape[(axis + m) % 3] for m in (1, 2))), np.int8)
    across = [part.lines[:, m] - box.low[(axis + 1 + m) % 3] for m in (0, 1)]
    first, last = np.clip(first - box.low[axis], 0, n), np.clip(last + 1 - box.low[axis], 0, n)
    some = first < last
    for at, step in ((first, 1), (last, -1)):
        np.add.at(change, (at[some], *(place[some] for place in across)), np.int8(step))
    np.cumsum(change, axis=0, out=change)
    return np.asarray(np.moveaxis(change[:-1] > 0, (0, 1, 2), [(axis + m) % 3 for m in range(3)]))


def edge_lengths(box: Box, intervals: Sequence[Intervals]) -> tuple[np.ndarray, np.ndarray]:
    """Which nodes are inside, bool (*shape), and the share of each edge that is free, float32 (3, *shape).

    An edge whose two ends are inside has none: a gap that is shorter than a cell is closed.
    """
    inside = nodes_inside(box, intervals[0])
    free = np.stack([free_lengths(box, axis, part) for axis, part in enumerate(intervals)])
    for axis in range(3):
        free[axis][inside & _next(inside, axis, False)] = 0
    return inside, free


def free_lengths(box: Box, axis: int, part: Intervals) -> np.ndarray:
    """Share of each edge along an axis that is outside the body, float32 (*shape)."""
    part = box.crossing(axis, part)
    first, last = np.floor(part.start).astype(int), np.floor(part.end).astype(int)
    free = np.ones(box.shape, np.float32)
    ends = np.stack([first, np.where(first == last, -1, last)], axis=1)
    within = (ends >= box.low[axis]) & (ends < box.low[axis] + box.shape[axis])
    which, _ = np.nonzero(within)
    along = ends[within]
    covered = np.clip(part.end[which] - along, 0, 1) - np.clip(part.start[which] - along, 0, 1)
    place = np.roll(np.column_stack([along, part.lines[which]]), axis, axis=1) - box.low
    np.subtract.at(free, tuple(place.T), covered.astype(np.float32))
    free[_span(box, axis, part, first + 1, last - 1)] = 0
    free[free < 1e-6] = 0  # rounding
    return free


def nodes_inside(box: Box, part: Intervals) -> np.ndarray:
    """Which nodes are inside the body, by its intervals along x: bool (*shape)."""
    part = box.crossing(0, part)
    return _span(box, 0, part, np.ceil(part.start).astype(int), np.floor(part.end).astype(int))


def _next(values: np.ndarray, axis: int, beyond: float | bool) -> np.ndarray:
    """values[i + 1] along an axis; `beyond` after the last."""
    out = np.full_like(values, beyond)
    to, source = [slice(None)] * 3, [slice(None)] * 3
    to[axis], source[axis] = slice(None, -1), slice(1, None)
    out[tuple(to)] = values[tuple(source)]
    return out


def _before(values: np.ndarray, axis: int) -> np.ndarray:
    """values[i - 1] along an axis; False before the first."""
    return np.flip(_next(np.flip(values, axis), axis, False), axis)


def _any_of_four(of_b: np.ndarray, of_c: np.ndarray, axis: int, beyond: bool) -> np.ndarray:
    """Where one of the four edges of a face across an axis is True; its edges along b and c, the axes after, are given.

    Of nodes, given twice, those at three corners of the face; `beyond` is the value of edges beyond the box.
    """
    b, c = (axis + 1) % 3, (axis + 2) % 3
    return np.asarray(of_b | _next(of_b, c, beyond) | of_c | _next(of_c, b, beyond))


def _around(inside: np.ndarray, free: np.ndarray, axis: int, at: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Corners 0, b, c, bc of faces `at` (n,) across an axis that are inside, and free lengths of their edges c(+b), c,
    b(+c), b: (4, n) each."""
    b, c = (axis + 1) % 3, (axis + 2) % 3
    node = np.stack(np.unravel_index(at, inside.shape))

    def moved(values: np.ndarray, steps: Sequence[int], beyond: float) -> np.ndarray:
        place = node.copy()
        for along in steps:
            place[along] += 1
        is_inside = (place < np.array(inside.shape)[:, None]).all(axis=0)
        return np.asarray(np.where(is_inside, values[tuple(np.where(is_inside, place, 0))], values.dtype.type(beyond)))

    corners = np.stack([moved(inside, steps, 0) for steps in ((), (b,), (c,), (b, c))])
    edges = ((free[c], (b,)), (free[c], ()), (free[b], (c,)), (free[b], ()))
    return corners, np.stack([moved(values, steps, 1) for values, steps in edges])


def free_area(corner: np.ndarray, lengths: np.ndarray) -> np.ndarray:
    """Share of faces that is outside the body, by straight lines between cut edges; arguments as from `_around`."""
    c_high, c_low, b_high, b_low = lengths
    along_b, along_c = (b_low, b_low, b_high, b_high), (c_low, c_high, c_low, c_high)  # the edges that meet a corner
    n = corner.sum(axis=0)
    outside = sum(np.where(inside, 0, lb * lc / 2) for inside, lb, lc in zip(corner, along_b, along_c, strict=True))
    covered = sum(
        np.where(inside, (1 - lb) * (1 - lc) / 2, 0) for inside, lb, lc in zip(corner, along_b, along_c, strict=True)
    )
    across_b, across_c = (b_low + b_high) / 2, (c_low + c_high) / 2  # two corners inside, side by side: a trapezoid
    two = np.where(corner[0] == corner[1], across_c, np.where(corner[0] == corner[2], across_b, 1 - covered))
    return np.asarray(np.select([n == 0, n == 1, n == 2, n == 3], [1.0, 1 - covered, two, outside], 0.0))


def weights(area: np.ndarray) -> np.ndarray:
    """Weights d of cut faces of free areas (n,), relative to a cell."""
    return np.asarray(np.minimum(np.maximum(area, 1e-6) ** -0.5, HEAVIEST))


def least_areas(weight: np.ndarray, axis: int, at: np.ndarray, lengths: np.ndarray) -> np.ndarray:
    """Least areas of faces `at` (n,) across an axis, whose edges c(+b), c, b(+c), b have free lengths (4, n).

    weight  d of all faces (3, *shape): 1 of whole faces, 0 of faces inside a conductor
    """
    b, c = (axis + 1) % 3, (axis + 2) % 3
    node = np.stack(np.unravel_index(at, weight.shape[1:]))
    last = np.array(weight.shape[1:])[:, None] - 1

    def of(face: int, *steps: tuple[int, int]) -> np.ndarray:
        place = node.copy()
        for along, by in steps:
            place[along] += by
        return np.asarray(weight[(face, *np.clip(place, 0, last))])

    total = np.zeros(len(at))
    edges = (c, (b, 1)), (c, (b, 0)), (b, (c, 1)), (b, (c, 0))
    for length, (direction, to) in zip(lengths, edges, strict=True):
        p, q = (direction + 1) % 3, (direction + 2) % 3
        total += length * (of(p, to) + of(p, to, (q, -1)) + of(q, to) + of(q, to, (p, -1)))
    return np.asarray(STABLE * COURANT**2 / 4 * total / weight[axis].flat[at])
