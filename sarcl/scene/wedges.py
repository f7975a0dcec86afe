"""Edges between facets: where two of them meet at an angle, and the borders of sheets."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from ..base.boxes import box
from ..base.vectors import cross, dot, unit
from .triangles import normals

SAME = 1e-6  # of the scene's size: corners nearer to each other are one, and to a side lie on it


@dataclass(frozen=True, eq=False)
class Wedges:
    """Straight edges at which n wedges end: convex ones, of facets that reflect outwards, and borders of sheets.

    ends    m (n, 2, 3), of each edge
    inward  unit vectors in face 1, from the edge and at right angles to it (n, 3)
    normal  unit normals of face 1, into the space outside (n, 3)
    number  the angle outside in units of pi, more than 1, 2 at borders (n,)
    faces   numbers of the facets of face 1 and face 2, the same at borders (n, 2)
    """

    ends: np.ndarray
    inward: np.ndarray
    normal: np.ndarray
    number: np.ndarray
    faces: np.ndarray

    def __len__(self) -> int:
        return len(self.ends)

    def chosen(self, rows: np.ndarray) -> Wedges:
        """Some of them."""
        return Wedges(*(getattr(self, name)[rows] for name in self.__dataclass_fields__))


@dataclass(frozen=True, eq=False)
class Sides:
    """Sides of facets, or parts of them.

    ends    numbers of their corners, the smaller first (n, 2);  facet  their facets (n,)
    """

    ends: np.ndarray
    facet: np.ndarray

    @property
    def keys(self) -> np.ndarray:
        """A number for each, the same for those between the same corners, int64 (n,)."""
        return self.ends[:, 0] * (self.ends.max(initial=0) + 1) + self.ends[:, 1]

    @property
    def shared(self) -> np.ndarray:
        """By how many facets each is shared (n,)."""
        _, which, count = np.unique(self.keys, return_inverse=True, return_counts=True)
        return np.asarray(count[which])


def wedges(triangles: np.ndarray, two_sided: np.ndarray, crease: float) -> Wedges:
    """The wedges of facets with an area.

    triangles  m (k, 3, 3);  two_sided  (k,), as in Scene
    crease     rad: facets whose normals differ by less are parts of one smooth surface

    A side may end on another facet's side: both are cut there. Where several facets share a side, the widest angle
    between them is the space outside, if it exceeds pi and the facets reflect into it.
    """
    if not len(triangles):
        return Wedges(np.zeros((0, 2, 3)), np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0), np.zeros((0, 2), np.int64))
    corner, number = merged(triangles)
    sides = cut_sides(corner, number)
    lo, hi = corner[sides.ends[:, 0]], corner[sides.ends[:, 1]]
    along, normal = unit(hi - lo), normals(triangles)[sides.facet]
    middle = triangles[sides.facet].mean(axis=1) - lo
    inward = unit(middle - dot(middle, along)[:, None] * along)
    _, first, group = np.unique(sides.keys, return_index=True, return_inverse=True)
    axis = inward[first[group]]
    into = cross(along, inward)  # from a face into the angle that follows it
    outwards = np.sign(dot(into, normal))
    # of two faces in one place, the one that reflects into an angle stands next to it
    angle = (np.arctan2(dot(inward, cross(along, axis)), dot(inward, axis)) + SAME * outwards) % (2 * np.pi)
    order = np.lexsort((angle, group))
    begins = np.flatnonzero(np.diff(group[order], prepend=-1))
    after = np.roll(np.arange(len(order)), -1)
    after[np.append(begins[1:], len(order)) - 1] = begins  # the last face of a side is followed by its first
    i, j = order, order[after]
    gap = angle[j] - angle[i] + 2 * np.pi * (after <= np.arange(len(order)))
    is_outside = [two_sided[sides.facet[row]] | (sign * outwards[row] > 0) for row, sign in ((i, 1), (j, -1))]
    kept = (gap > np.pi + crease) & ((i == j) | is_outside[0] & is_outside[1])
    i, j, gap = i[kept], j[kept], gap[kept]
    return Wedges(
        np.stack([lo[i], hi[i]], axis=1),
        inward[i],
        into[i],
        np.minimum(gap / np.pi, 2),
        np.stack([sides.facet[i], sides.facet[j]], 1),
    )


def merged(triangles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Corners, m (n, 3), and the numbers of each facet's (k, 3): one for those that are nearer than SAME."""
    corner, number = np.unique(triangles.reshape(-1, 3), axis=0, return_inverse=True)
    near = cKDTree(corner).query_pairs(reach(triangles), output_type="ndarray")
    ones = np.ones(len(near), bool)
    _, label = connected_components(coo_array((ones, (near[:, 0], near[:, 1])), shape=(len(corner), len(corner))))
    label = label.astype(np.int64)
    _, first = np.unique(label, return_index=True)
    return corner[first], label[number.ravel()].reshape(-1, 3)


def reach(triangles: np.ndarray) -> float:
    """Distance, m, below which corners are one."""
    return float(SAME * np.ptp(box(triangles.reshape(-1, 3)), axis=0).max())


def cut_sides(corner: np.ndarray, number: np.ndarray) -> Sides:
    """The sides of facets, those of one facet alone cut where corners of others lie on them."""
    ends = np.stack([number, np.roll(number, -1, axis=1)], axis=-1).reshape(-1, 2)
    facet = np.repeat(np.arange(len(number)), 3)
    real = ends[:, 0] != ends[:, 1]
    sides = Sides(np.sort(ends[real], axis=1), facet[real])
    alone = np.flatnonzero(sides.shared == 1)
    if not len(alone):
        return sides
    a, b = (corner[sides.ends[alone, i]] for i in range(2))
    length, near_by = np.linalg.norm(b - a, axis=1), SAME * float(np.ptp(corner, axis=0).max())
    # corners of sides that are shared may lie on others too: a small box that stands on a large one
    tree = cKDTree(corner)
    pieces, facets = list[list[int]](), list[int]()
    for side, start, way, n, near in zip(
        alone.tolist(), a, b - a, length.tolist(), tree.query_ball_point((a + b) / 2, length / 2), strict=True
    ):
        inside = np.setdiff1d(np.array(near, np.int64), sides.ends[side])
        at = (corner[inside] - start) @ way / n**2
        away = np.linalg.norm(corner[inside] - start - at[:, None] * way, axis=1)
        on = (away < near_by) & (at * n > near_by) & (at * n < n - near_by)
        stops = [sides.ends[side, 0], *inside[on][np.argsort(at[on])].tolist(), sides.ends[side, 1]]
        pieces += [sorted(pair) for pair in pairwise(stops)]
        facets += [sides.facet[side]] * (len(stops) - 1)
    others = np.setdiff1d(np.arange(len(sides.facet)), alone)
    return Sides(np.concatenate([sides.ends[others], np.array(pieces)]), np.concatenate([sides.facet[others], facets]))


def joined(triangles: np.ndarray, to: np.ndarray) -> np.ndarray:
    """Which facets (k,) have a corner in common with some of those that `to` (k,) marks, which are among them."""
    if not to.any():
        return to
    corner = np.unique(triangles[to].reshape(-1, 3), axis=0)
    least = reach(triangles)
    low, high = box(corner) + np.array([[-least], [least]])
    near = np.flatnonzero((((triangles >= low) & (triangles <= high)).all(axis=2)).any(axis=1) & ~to)
    away, _ = cKDTree(corner).query(triangles[near].reshape(-1, 3), distance_upper_bound=least)
    out = to.copy()
    out[near] = np.isfinite(away).reshape(-1, 3).any(axis=1)
    return out
