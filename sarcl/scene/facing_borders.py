"""Borders of flat faces that face each other, between which waves run along the face."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from ..base.vectors import cross, dot, unit
from .triangles import normals
from .wedges import Wedges, cut_sides, merged, reach

FLAT = 1e-6  # rad, between normals of facets of one face, and between edges of one border
MOST_ANGLE = 0.5  # rad, between two borders: rays between neighbours of a corner end there at once
BLOCK = 2**20  # pairs of sides and corners that are looked at together


@dataclass(frozen=True, eq=False)
class FacingBorders:
    """Straight borders of convex flat faces, made of edges, and pairs of them.

    start, end  m (b, 3), along t = inward x normal
    inward      unit vectors in the face, at right angles to the border (b, 3);  normal  of the face, outwards (b, 3)
    number      the angle outside of the wedge behind, in units of pi (b,)
    edge        numbers of the wedges that borders are made of, border by border, from start to end (q,)
    border      the border of each (q,);  is_turned  where the wedge runs from end to start (q,)
    pairs       numbers of borders that face each other (n, 2)
    """

    start: np.ndarray
    end: np.ndarray
    inward: np.ndarray
    normal: np.ndarray
    number: np.ndarray
    edge: np.ndarray
    border: np.ndarray
    is_turned: np.ndarray
    pairs: np.ndarray

    def __len__(self) -> int:
        return len(self.pairs)

    def __iter__(self) -> Iterator[tuple[np.ndarray, tuple[np.ndarray, np.ndarray, np.ndarray, float, float]]]:
        """Of each pair the ends of both borders, m (2, 2, 3), and inward of both, normal, number of both."""
        for i, j in self.pairs.tolist():
            ends = np.array([[self.start[i], self.end[i]], [self.start[j], self.end[j]]])
            numbers = float(self.number[i]), float(self.number[j])
            yield ends, (self.inward[i], self.inward[j], self.normal[i], *numbers)


@dataclass(frozen=True, eq=False)
class _FaceSides:
    """Sides of faces at wedges: the face, the wedge (s,), ends m (s, 2, 3) along t, and as in FacingBorders."""

    face: np.ndarray
    edge: np.ndarray
    ends: np.ndarray
    inward: np.ndarray
    normal: np.ndarray
    number: np.ndarray
    is_turned: np.ndarray

    @classmethod
    def of(cls, wedges: Wedges, faces: np.ndarray, along: np.ndarray) -> _FaceSides:
        """faces  of each facet, -1 for none (k,);  along  the normal of the face that each facet lies in (k, 3)"""
        angle, n = np.pi * wedges.number[:, None], len(wedges)
        other = np.cos(angle) * wedges.inward + np.sin(angle) * wedges.normal
        out_of_other = np.sin(angle) * wedges.inward - np.cos(angle) * wedges.normal
        normal, facet = np.concatenate([wedges.normal, out_of_other]), wedges.faces.T.ravel()
        sides = cls(
            2 * faces[facet] + (dot(normal, along[facet]) > 0),
            np.tile(np.arange(n), 2),
            np.concatenate([wedges.ends, wedges.ends[:, ::-1]]),
            np.concatenate([wedges.inward, other]),
            normal,
            np.tile(wedges.number, 2),
            np.repeat([False, True], n),
        )
        return sides.chosen(np.flatnonzero(sides.face >= 0))

    def chosen(self, rows: np.ndarray) -> _FaceSides:
        return _FaceSides(*(getattr(self, name)[rows] for name in self.__dataclass_fields__))

    @cached_property
    def along(self) -> np.ndarray:
        """Where each side begins and ends along its own t, m (s, 2)."""
        return np.asarray(np.einsum("sij,sj->si", self.ends, cross(self.inward, self.normal)))


def facing_borders(triangles: np.ndarray, wedges: Wedges) -> FacingBorders:
    """Pairs of borders of the flat convex faces that facets with an area make up: at most MOST_ANGLE from parallel,
    with no corner in common.

    triangles  m (k, 3, 3), whose wedges are given
    """
    least = reach(triangles) if len(triangles) else 0.0
    faces, along = _flat_faces(triangles, least)
    sides = _FaceSides.of(wedges, faces, along)
    # sides of one border stand in a row: by face, direction in the face, and place along it
    _, first, which = np.unique(sides.face, return_index=True, return_inverse=True)
    axis = sides.inward[first[which]]
    turn = np.arctan2(dot(cross(axis, sides.inward), sides.normal), dot(axis, sides.inward))
    turn = np.where(turn > np.pi - FLAT, turn - 2 * np.pi, turn)
    rank = np.lexsort((turn, sides.face))
    bend = (np.diff(sides.face[rank], prepend=-1) != 0) | (np.diff(turn[rank], prepend=0.0) > FLAT)
    direction = np.empty(len(rank), np.int64)
    direction[rank] = np.cumsum(bend)
    sides = sides.chosen(order := np.lexsort((sides.along[:, 0], direction)))
    direction = direction[order]
    begins = np.ones(len(order), bool)
    begins[1:] = np.diff(direction) != 0
    begins[1:] |= np.linalg.norm(sides.ends[1:, 0] - sides.ends[:-1, 1], axis=1) > 2 * least
    begins[1:] |= np.abs(np.diff(sides.number)) > FLAT
    border, first = np.cumsum(begins) - 1, np.flatnonzero(begins)
    last = np.append(first[1:], len(order)) - 1
    start, end = sides.ends[first[: len(last)], 0], sides.ends[last[: len(first)], 1]
    one = sides.chosen(first)
    pairs = _facing(one.face, start, end, one.inward, least)
    return FacingBorders(start, end, one.inward, one.normal, one.number, sides.edge, border, sides.is_turned, pairs)


def _facing(face: np.ndarray, start: np.ndarray, end: np.ndarray, inward: np.ndarray, least: float) -> np.ndarray:
    """Pairs (n, 2) of borders of one face that face each other."""
    i, j = _together(face)
    i, j = i[i < j], j[i < j]
    turned = -dot(inward[i], inward[j])
    mean = unit(inward[i] - inward[j] + 1e-30)
    apart = np.linalg.norm([start[i] - end[j], end[i] - start[j]], axis=2).min(axis=0)
    ahead = dot((start[j] + end[j] - start[i] - end[i]) / 2, mean)
    kept = (turned > np.cos(MOST_ANGLE)) & (apart > 2 * least) & (ahead > 2 * least)
    return np.stack([i[kept], j[kept]], axis=1)


def _together(group: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Pairs of members i, j of the same group, those of numbers (n,) in rising order."""
    _, first, count = np.unique(group, return_index=True, return_counts=True)
    size = np.repeat(count, count)
    i = np.repeat(np.arange(len(group)), size)
    place = np.arange(len(i)) - np.repeat(np.cumsum(size) - size, size)
    return i, np.repeat(np.repeat(first, count), size) + place


def _flat_faces(triangles: np.ndarray, least: float) -> tuple[np.ndarray, np.ndarray]:
    """The convex flat face of each facet, -1 for none (k,), and that face's normal, of either sign (k, 3)."""
    k = len(triangles)
    if not k:
        return np.zeros(0, np.int64), np.zeros((0, 3))
    corner, number = merged(triangles)
    sides, normal = cut_sides(corner, number), normals(triangles)
    order = np.argsort(sides.keys, kind="stable")
    begins = np.flatnonzero(np.diff(sides.keys[order], prepend=-1))
    count = np.diff(np.append(begins, len(order)))
    i, j = (sides.facet[order[begins[count == 2] + step]] for step in (0, 1))
    flat = np.linalg.norm(cross(normal[i], normal[j]), axis=1) < FLAT
    ones = np.ones(np.count_nonzero(flat), bool)
    _, label = connected_components(coo_array((ones, (i[flat], j[flat])), shape=(k, k)))
    label = label.astype(np.int64)
    inner = np.zeros(len(begins), bool)
    inner[np.flatnonzero(count == 2)[flat]] = True
    side = order[~np.repeat(inner, count)]
    side = side[np.argsort(label[sides.facet[side]], kind="stable")]
    ends, facet = corner[sides.ends[side]], sides.facet[side]
    along = unit(ends[:, 1] - ends[:, 0])
    into = triangles[facet].mean(axis=1) - ends[:, 0]
    inward = unit(into - dot(into, along)[:, None] * along)
    hollow = np.zeros(k, bool)
    face = label[facet]
    i, j = _together(face)
    for rows in (slice(a, a + BLOCK) for a in range(0, len(i), BLOCK)):
        behind = dot(ends[j[rows], 0] - ends[i[rows], 0], inward[i[rows]]) < -2 * least
        hollow[face[i[rows]][behind]] = True
    _, first = np.unique(label, return_index=True)
    return np.where(hollow[label], -1, label), normal[first[label]]
