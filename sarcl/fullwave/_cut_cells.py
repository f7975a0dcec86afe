"""Conductors that cut cells (Dey and Mittra): free lengths of edges and free areas of faces, as lists.

The surface comes as intervals: on every line of the grid, where the line is inside the body. A formula gives them for a
sphere, rays for a mesh.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .lattice import COURANT, Lattice
from .target import Target

# Smallest free area of a face, per length of its longest free edge, both relative to a whole cell. Stable from
# COURANT^2 on; smaller areas are enlarged.
LEAST_AREA = 1.2 * COURANT**2


@dataclass(frozen=True, eq=False)
class Intervals:
    """Where grid lines along one axis are inside a body.

    lines       node numbers of the lines along the two axes after this one, int (n, 2); a line may occur several times
    start, end  nodes, real numbers along the axis (n,), start < end; intervals of a line do not overlap
    """

    lines: np.ndarray
    start: np.ndarray
    end: np.ndarray


def conductor(lattice: Lattice, intervals: tuple[Intervals, Intervals, Intervals], staircase: bool = False) -> Target:
    """The lists of a perfect conductor, from its intervals along x, y and z.

    staircase  an edge conducts where both its ends are inside, and no edge or face is cut: for comparison
    """
    inside = nodes_inside(lattice, intervals[0])
    free = np.stack([_free_lengths(lattice, axis, part) for axis, part in enumerate(intervals)])
    for a in range(3):
        within = inside & _next(inside, a, False)
        if staircase:
            free[a] = 1
        free[a][within] = 0  # a gap that is shorter than a cell is closed
    faces, weights = [], []
    near = np.zeros(free.shape, bool)  # edges beside a face whose field is not zero
    for a in range(3):
        b, c = (a + 1) % 3, (a + 2) % 3
        lengths = np.stack([_next(free[c], b, 1), free[c], _next(free[b], c, 1), free[b]])
        area = np.ones(lattice.shape) if staircase else _free_area(inside, free, a)
        longest = lengths.max(axis=0)
        live = longest > 0
        for direction, along in ((c, b), (b, c)):
            near[direction] |= live | _before(live, along)
        cut = live & ((lengths < 1) & (lengths > 0)).any(axis=0) | live & (area < 1)
        area = np.maximum(area, LEAST_AREA * longest)
        at = np.flatnonzero(cut)
        faces.append(at + a * cut.size)
        weights.append(lengths.reshape(4, -1)[:, at] / area.flat[at])
    edges = np.flatnonzero((free == 0) & near)
    return Target(edges, np.zeros((2, len(edges))), np.concatenate(faces), np.concatenate(weights, axis=1))


def _crossed(lattice: Lattice, axis: int, part: Intervals) -> tuple[np.ndarray, np.ndarray, tuple[np.ndarray, ...]]:
    """Pairs of an interval and an edge of the grid that it touches: interval, edge's number along the axis, place."""
    first = np.maximum(np.floor(part.start).astype(int), 0)
    last = np.minimum(np.floor(part.end).astype(int), lattice.shape[axis] - 1)
    count = np.maximum(last - first + 1, 0)
    which = np.repeat(np.arange(len(count)), count)
    along = np.arange(len(which)) - np.repeat(np.cumsum(count) - count, count) + first[which]
    place = [along, part.lines[which, 0], part.lines[which, 1]]
    return which, along, tuple(place[(n - axis) % 3] for n in range(3))


def _free_lengths(lattice: Lattice, axis: int, part: Intervals) -> np.ndarray:
    """Share of each edge along an axis that is outside the body, float32 (*shape)."""
    which, along, place = _crossed(lattice, axis, part)
    covered = np.clip(part.end[which] - along, 0, 1) - np.clip(part.start[which] - along, 0, 1)
    free = np.ones(lattice.shape, np.float32)
    np.subtract.at(free, place, covered.astype(np.float32))
    free[free < 1e-6] = 0  # rounding
    return free


def nodes_inside(lattice: Lattice, part: Intervals) -> np.ndarray:
    """Which nodes are inside the body, by its intervals along x: bool (*shape)."""
    which, along, place = _crossed(lattice, 0, part)
    inside = np.zeros(lattice.shape, bool)
    held = along >= part.start[which]
    inside[tuple(n[held] for n in place)] = True
    return inside


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


def _free_area(inside: np.ndarray, free: np.ndarray, axis: int) -> np.ndarray:
    """Share of each face across an axis that is outside the body, (*shape), by straight lines between cut edges."""
    b, c = (axis + 1) % 3, (axis + 2) % 3
    corner = [inside, _next(inside, b, False), _next(inside, c, False)]
    corner.append(_next(corner[1], c, False))  # corners 0, b, c, bc
    along_b = [free[b], free[b], _next(free[b], c, 1), _next(free[b], c, 1)]  # the edge along b that meets each corner
    along_c = [free[c], _next(free[c], b, 1), free[c], _next(free[c], b, 1)]
    n = sum(held.astype(np.int8) for held in corner)
    outside = sum(np.where(held, 0, lb * lc / 2) for held, lb, lc in zip(corner, along_b, along_c, strict=True))
    covered = sum(
        np.where(held, (1 - lb) * (1 - lc) / 2, 0) for held, lb, lc in zip(corner, along_b, along_c, strict=True)
    )
    across_b = (along_b[0] + along_b[2]) / 2  # both corners on one side of b inside: a trapezoid
    across_c = (along_c[0] + along_c[1]) / 2
    two = np.where(corner[0] == corner[1], across_c, np.where(corner[0] == corner[2], across_b, 1 - covered))
    return np.asarray(np.select([n == 0, n == 1, n == 2, n == 3], [1.0, 1 - covered, two, outside], 0.0))
