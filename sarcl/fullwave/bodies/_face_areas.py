"""How much of each face of a grid closed meshes cover: exactly, from the sections of the meshes with its planes.

A facet that crosses a plane of the grid leaves a segment in it, with the body on its left. The winding number at a
point is the sum of the segments that pass before it, along one axis of the plane, each with its sign; its integral over
a face is that of the pieces of segments in the face, and of those in faces before it (as font rasterisers do it). A
plane that holds corners is moved aside by e, smaller than every number, both ways: the larger share holds, because a
face that lies in the surface belongs to the body.
"""

from __future__ import annotations

import numpy as np

from ..lattice import Lattice
from ._closed_mesh import ClosedMesh
from .cut_cells import FaceAreas


def face_areas(lattice: Lattice, mesh: ClosedMesh, axis: int) -> FaceAreas:
    """Shares of all faces across an axis through which the surface of one body passes."""
    sides = (0, 1) if (mesh.corners[:, :, axis] % mesh.unit == 0).any() else (0,)
    parts = [_covered(lattice, *_segments(mesh, axis, side), axis) for side in sides]
    places, covered = (np.concatenate(part) for part in zip(*parts, strict=True))
    order = np.lexsort((-covered, places))
    first = np.flatnonzero(np.diff(places[order], prepend=-1))
    return FaceAreas(places[order][first], covered[order][first])


def _segments(mesh: ClosedMesh, axis: int, side: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Where facets cross planes: numbers of the planes (n,) and bodies (n,), and both ends in nodes (n, 2, 2).

    side  0: a plane lies just below its own height;  1: just above
    """
    height = mesh.corners[:, :, axis] - side  # whole numbers: e is a half
    low, high = height.min(axis=1) // mesh.unit + 1, height.max(axis=1) // mesh.unit
    count = np.maximum(high - low + 1, 0)
    facet = np.repeat(np.arange(len(count)), count)
    plane = np.arange(len(facet)) - np.repeat(np.cumsum(count) - count, count) + low[facet]
    corner = mesh.corners[facet]
    above = height[facet] >= (plane * mesh.unit)[:, None]
    rises, falls = (
        np.argmax(change, axis=1) for change in (~above & np.roll(above, -1, 1), above & ~np.roll(above, -1, 1))
    )
    row, ends = np.arange(len(facet)), []
    across = np.stack([corner[:, :, (axis + m) % 3] for m in (1, 2)], axis=2)
    for first in (falls, rises):  # with the body on the left
        after = (first + 1) % 3
        bottom, top = corner[row, first, axis], corner[row, after, axis]
        share = ((plane * mesh.unit - bottom) / (top - bottom))[:, None]
        ends.append((across[row, first] * (1 - share) + across[row, after] * share) / mesh.unit)
    return plane, mesh.body[facet], np.stack(ends, axis=1)


def _pieces(ends: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Segments (n, 2, 2) cut at the lines of the grid: numbers of the segments, both ends of the pieces (m, 2)."""
    which, at = [np.arange(len(ends))] * 2, [np.zeros(len(ends)), np.ones(len(ends))]
    for along in range(2):
        start, way = ends[:, 0, along], ends[:, 1, along] - ends[:, 0, along]
        low, high = np.sort(ends[:, :, along], axis=1).T
        first = np.floor(low).astype(int) + 1
        count = np.maximum(np.ceil(high).astype(int) - first, 0)
        segment = np.repeat(np.arange(len(ends)), count)
        line = np.arange(len(segment)) - np.repeat(np.cumsum(count) - count, count) + first[segment]
        which.append(segment)
        at.append(np.clip((line - start[segment]) / way[segment], 0, 1))
    segment, share = np.concatenate(which), np.concatenate(at)
    order = np.lexsort((share, segment))
    segment, share = segment[order], share[order]
    held = np.flatnonzero(segment[1:] == segment[:-1])
    segment = segment[held]
    place = [ends[segment, 0] + (ends[segment, 1] - ends[segment, 0]) * share[held + m][:, None] for m in (0, 1)]
    return segment, place[0], place[1]


def _covered(
    lattice: Lattice, plane: np.ndarray, body: np.ndarray, ends: np.ndarray, axis: int
) -> tuple[np.ndarray, np.ndarray]:
    """Places of faces through which one body's surface passes, and the shares of them that are inside."""
    segment, start, end = _pieces(ends)
    middle, rise = (start + end) / 2, (end - start)[:, 0]
    cell = np.floor(middle).astype(int)
    nodes = [plane[segment], cell[:, 0], cell[:, 1]]
    shape = [lattice.shape[(axis + m) % 3] for m in range(3)]
    face = np.ravel_multi_index(nodes, shape)  # rows of faces along the last axis
    own = rise * (1 - (middle - cell)[:, 1])
    all_, total = _integrals(face, face // shape[2], rise, own)
    n_faces = int(np.prod(shape))
    both, single = _integrals(face + body[segment] * n_faces, (face + body[segment] * n_faces) // shape[2], rise, own)
    of_face, n_bodies = np.unique(both % n_faces, return_counts=True)
    alone = np.isin(both % n_faces, of_face[n_bodies == 1])
    face, single = both[alone] % n_faces, single[alone]
    others = np.rint(total[np.searchsorted(all_, face)] - single)  # winding number of the other bodies
    covered = np.abs(single) * (others + np.sign(single) > 0) + (1 - np.abs(single)) * (others > 0)
    place = np.unravel_index(face, shape)
    at = np.ravel_multi_index([place[(m - axis) % 3] for m in range(3)], lattice.shape)
    return at, np.clip(covered, 0, 1)


def _integrals(face: np.ndarray, row: np.ndarray, rise: np.ndarray, own: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Numbers of the faces, sorted, and the integral of the winding number over each, from pieces (n,)."""
    places, number = np.unique(face, return_inverse=True)
    rises, owns = (np.bincount(number, weights=part, minlength=len(places)) for part in (rise, own))
    rows = row[np.unique(face, return_index=True)[1]]
    before = np.cumsum(rises) - rises
    first = np.flatnonzero(np.diff(rows, prepend=-1))
    before -= np.repeat(before[first], np.diff(np.append(first, len(rows))))
    return places, before + owns
