"""Where grid lines are inside bodies whose surfaces are closed meshes.

Every line of the grid is cut with every facet that it passes, in whole numbers (`_closed_mesh`). A line that meets an
edge or a corner exactly is moved aside by (e, e^2) along the two axes across it, e > 0 and smaller than every number
(symbolic perturbation, Edelsbrunner and Muecke 1990): each facet is then hit or missed, never touched, and both facets
at an edge agree. Along a line, a facet that is entered adds 1 to the winding number and one that is left takes 1 away.
The edges of the mesh cancel, so that the sum is 0 after the last facet of every line: no line can be inconsistent.

A body is where the winding number is above 0, so that bodies may overlap, touch, and have cavities. A line that lies
in the surface belongs to the body: where edges or corners are met exactly, the intervals are the union over all four
signs of (e, e^2).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from ..lattice import Lattice
from ._closed_mesh import ClosedMesh, closed_mesh
from ._face_areas import face_areas
from ._thin_parts import ThinParts
from .cut_cells import Box, FaceAreas, Intervals, nodes_inside

CANDIDATES = 2**20  # pairs of a facet and a line per array operation: bounds the memory
TIE = 2  # whole numbers: shorter intervals and gaps are rounding
SIGNS = ((1, 1), (1, -1), (-1, 1), (-1, -1))  # of e and e^2


@dataclass(frozen=True, eq=False)
class MeshLines:
    """What the lines of a grid see of closed meshes.

    intervals  along x, y and z, for `cut_cells.conductor`
    areas      of faces across x, y and z, exactly, for the same
    volume     m^3, by the lines along each axis (3,): lengths inside times the area of a cell; a line in the surface
               counts as the mean of its four neighbours
    gap        width, m, of gaps between parallel facets that are narrower than a cell; None: there are none
    strips     nodes of sheets in place of narrow parts that are thinner than a cell, int (n, 3)
    strip_area m^2, of those parts
    """

    intervals: tuple[Intervals, Intervals, Intervals]
    areas: tuple[FaceAreas, FaceAreas, FaceAreas]
    volume: np.ndarray
    gap: float | None
    strips: np.ndarray
    strip_area: float


@dataclass(frozen=True, eq=False)
class _Crossings:
    """Where lines along one axis cross facets, line by line.

    facet  number (n,);  at  along the axis, whole numbers (n,);  turn  +1 where the line enters, -1 where it leaves
    line   number of the line, 4 times, plus the sign of (e, e^2);  exact  lines that met an edge or a corner
    """

    facet: np.ndarray
    line: np.ndarray
    at: np.ndarray
    turn: np.ndarray
    exact: np.ndarray


@dataclass(frozen=True, eq=False)
class _Spans:
    """Stretches of lines, in whole numbers, and the winding number on them."""

    line: np.ndarray
    start: np.ndarray
    end: np.ndarray
    winding: np.ndarray


def mesh_lines(lattice: Lattice, triangles: np.ndarray, reach: float = 0.0) -> MeshLines:
    """Intervals of grid lines inside closed bodies of facets, corners in m (k, 3, 3), as of a Scene or a trimesh.

    reach  widest strip thinner than a cell that may become a sheet, cells; at least `_thin_parts.RIM`
    ValueError: the mesh is open, is wound inwards, intersects itself, has parts thinner than a cell, or leaves the
    grid. Separate bodies may intersect each other.
    """
    mesh = closed_mesh(lattice, triangles)
    intervals, volume, thin = [], [], ThinParts(lattice, mesh, reach)
    for axis in range(3):
        found = _crossings(lattice, mesh, axis)
        whole = _wound(found.line, found.at, found.turn)
        _check_outwards(lattice, mesh, axis, whole)
        _check_single(lattice, mesh, axis, found)
        inside = whole.winding > 0
        weight = np.where(np.isin(whole.line[inside] // 4, found.exact), 0.25, 1.0)
        volume.append((weight * (whole.end - whole.start)[inside]).sum() / mesh.unit * lattice.cell**3)
        line, start, end = _union(mesh, whole.line[inside] // 4, whole.start[inside], whole.end[inside])
        nodes = np.stack(np.divmod(line, lattice.shape[(axis + 2) % 3]), axis=1)
        intervals.append(Intervals(nodes, start / mesh.unit, end / mesh.unit))
        thin.add(found.facet, _points(lattice, mesh, axis, found.line // 4, found.at))
        empty = -(-start // mesh.unit) > end // mesh.unit  # no node lies in these
        entered, left = (_facet_at(mesh, found, line, at) for at in (start, end))
        first, last = (_points(lattice, mesh, axis, line, at) for at in (start, end))
        thin.add_pairs(entered, left, axis, first, last, empty)
        # gaps between two stretches of a line: a line that is not normal to a gap is longer in it, up to sqrt(3) times
        # on one axis at least
        gap = np.flatnonzero((line[1:] == line[:-1]) & (start[1:] - end[:-1] < 2 * mesh.unit))
        left, entered = (_facet_at(mesh, found, line[gap], at) for at in (end[gap], start[gap + 1]))
        thin.add_gaps(left, entered, axis, (start[gap + 1] - end[gap]) / mesh.unit)
    x, y, z = intervals
    box = Box.around(lattice, intervals)
    thin.check(nodes_inside(box, x), box.low)
    across_x, across_y, across_z = (face_areas(lattice, mesh, axis) for axis in range(3))
    return MeshLines((x, y, z), (across_x, across_y, across_z), np.array(volume), thin.gap, *thin.strips)


def _crossings(lattice: Lattice, mesh: ClosedMesh, axis: int) -> _Crossings:
    """All crossings of lines along an axis."""
    b, c = (axis + 1) % 3, (axis + 2) % 3
    across, along = mesh.corners[:, :, [b, c]], mesh.corners[:, :, axis]
    facets, lines, ats, turns, touched = [], [], [], [], []
    for facet, line in _candidates(across, mesh.unit):
        corner = across[facet]
        to, way = corner - line[:, None] * mesh.unit, np.roll(corner, -1, axis=1) - corner
        # twice the area of the line's point with each edge: above 0 on the left of it
        side = way[..., 1] * to[..., 0] - way[..., 0] * to[..., 1]
        area = side.sum(axis=1)
        turn = np.sign(area)
        kept = (side * turn[:, None] >= 0).all(axis=1) & (turn != 0)
        facet, line, way, side, area, turn = (v[kept] for v in (facet, line, way, side, area, turn))
        # weights of corners 1 and 2: the areas at the edges opposite them, 2 and 0; equal heights are not rounded
        height = along[facet]
        rise = (height[:, 1:] - height[:, :1]) * (side[:, [2, 0]] / area[:, None])
        at = height[:, 0] + np.rint(rise.sum(axis=1)).astype(np.int64)
        number = line[:, 0] * lattice.shape[c] + line[:, 1]
        touches = (side == 0).any(axis=1)
        touched.append(number[touches])
        for sector, (first, second) in enumerate(SIGNS):
            moved = np.where(way[..., 1] != 0, -first * np.sign(way[..., 1]), second * np.sign(way[..., 0]))
            hit = (np.where(side != 0, np.sign(side), moved) == turn[:, None]).all(axis=1)
            facets.append(facet[hit])
            lines.append(4 * number[hit] + sector)
            ats.append(at[hit])
            turns.append(-turn[hit])
    exact = np.unique(np.concatenate(touched))
    facet, line, at, turn = (np.concatenate(part) for part in (facets, lines, ats, turns))
    used = (line % 4 == 0) | np.isin(line // 4, exact)  # all signs are alike on other lines
    return _Crossings(facet[used], line[used], at[used], turn[used], exact)


def _candidates(across: np.ndarray, unit: int) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Facets (n,) and the node numbers (n, 2) of lines within their boxes, in parts."""
    low, high = -(-across.min(axis=1) // unit), across.max(axis=1) // unit
    size = np.maximum(high - low + 1, 0)
    count = size.prod(axis=1)
    some = np.flatnonzero(count)
    part = np.cumsum(count[some]) // CANDIDATES
    for chosen in np.split(some, np.flatnonzero(np.diff(part)) + 1):
        facet = np.repeat(chosen, count[chosen])
        number = np.arange(len(facet)) - np.repeat(np.cumsum(count[chosen]) - count[chosen], count[chosen])
        yield facet, low[facet] + np.stack(np.divmod(number, size[facet, 1]), axis=1)


def _wound(line: np.ndarray, at: np.ndarray, turn: np.ndarray) -> _Spans:
    """Stretches between crossings, without those that are rounding; what is entered comes before what is left."""
    order = np.lexsort((-turn, at, line))
    line, at = line[order], at[order]
    winding = np.cumsum(turn[order])  # 0 after the last crossing of every line
    span = np.flatnonzero((line[1:] == line[:-1]) & (at[1:] - at[:-1] > TIE)) if len(line) else np.zeros(0, int)
    return _Spans(line[span], at[span], at[span + 1], winding[span])


def _union(
    mesh: ClosedMesh, line: np.ndarray, start: np.ndarray, end: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The union of stretches of each line, in whole numbers: line, start, end."""
    order = np.lexsort((start, line))
    line, start, end = line[order], start[order], end[order] + TIE  # gaps of rounding close
    reach = _one_after_another(mesh, line)
    furthest = np.maximum.accumulate(reach + end)
    first = np.flatnonzero(np.append(True, (reach + start)[1:] > furthest[:-1])[: len(line)])
    last = np.append(first[1:], len(line))[: len(first)] - 1
    return line[first], start[first], furthest[last] - reach[last] - TIE


def _one_after_another(mesh: ClosedMesh, line: np.ndarray) -> np.ndarray:
    """Where each line begins if all are laid on one number line, each beyond the one before."""
    return line * (int(mesh.corners.max()) + 2 * TIE + 1)


def _facet_at(mesh: ClosedMesh, found: _Crossings, line: np.ndarray, at: np.ndarray) -> np.ndarray:
    """The facet that each line crosses at a place (n,)."""
    key = _one_after_another(mesh, found.line // 4) + found.at
    order = np.argsort(key)
    return found.facet[order[np.searchsorted(key[order], _one_after_another(mesh, line) + at)]]


def _check_outwards(lattice: Lattice, mesh: ClosedMesh, axis: int, whole: _Spans) -> None:
    if (wrong := whole.winding < 0).any():
        raise ValueError(
            f"triangles are wound inwards on {_lines(lattice, mesh, axis, whole, wrong)}; wanted counter-clockwise "
            "corners seen from outside: load the mesh with Scene.from_mesh(..., repair=True), or reverse the corners; "
            "where it is wound outwards already, it intersects itself: unite its parts in a program for meshes"
        )


def _check_single(lattice: Lattice, mesh: ClosedMesh, axis: int, found: _Crossings) -> None:
    """Each body alone winds 0 or 1 times about a point, or 0 and -1 times where it is the wall of a cavity."""
    n_lines = 4 * lattice.shape[(axis + 1) % 3] * lattice.shape[(axis + 2) % 3]
    body = mesh.body[found.facet]
    own = _wound(found.line + body * n_lines, found.at, found.turn)
    least, most = np.zeros((2, int(mesh.body.max()) + 1), np.int64)
    np.minimum.at(least, own.line // n_lines, own.winding)
    np.maximum.at(most, own.line // n_lines, own.winding)
    bad = most - least > 1
    wrong = bad[own.line // n_lines] & ((own.winding > 1) | (own.winding < 0))
    if wrong.any():
        line = _Spans(own.line % n_lines, own.start, own.end, own.winding)
        raise ValueError(
            f"triangles intersect themselves in {int(bad.sum())} of {len(bad)} bodies, on "
            f"{_lines(lattice, mesh, axis, line, wrong)}; wanted surfaces that do not pass through themselves (bodies "
            "that share no edge may intersect): unite the parts in a program for meshes"
        )


def _lines(lattice: Lattice, mesh: ClosedMesh, axis: int, spans: _Spans, wrong: np.ndarray) -> str:
    """How many lines are wrong, and a place on one."""
    number, all_ = (len(np.unique(line // 4)) for line in (spans.line[wrong], spans.line))
    middle = (spans.start + spans.end)[wrong][:1] // 2
    place = _points(lattice, mesh, axis, spans.line[wrong][:1] // 4, middle)[0] * lattice.cell + lattice.origin
    return f"{number} of {all_} grid lines along {'xyz'[axis]}, one at {np.array2string(place, precision=4)} m"


def _points(lattice: Lattice, mesh: ClosedMesh, axis: int, line: np.ndarray, at: np.ndarray) -> np.ndarray:
    """Places `at`, whole numbers, on lines along an axis, in nodes (n, 3)."""
    across = np.divmod(line, lattice.shape[(axis + 2) % 3])
    return np.roll(np.stack([at / mesh.unit, *across], axis=1), axis, axis=1)
