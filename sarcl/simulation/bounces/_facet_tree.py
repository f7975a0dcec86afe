"""Facets that lie in cones and cylinders: spheres about neighbours, level by level."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ...base.morton import morton_order
from ._polygons import TooManyAtOnce, folded

BRANCHES = 8  # spheres that the sphere above them holds
AT_ONCE = 20_000  # cones that are looked at together
MOST_PAIRS = 20_000_000  # pairs of a beam and a facet that are looked at together
FEWEST = 2  # cones, of both sides of a facet, of which no number of pairs is too many
PAIR_BYTES = 700.0  # that each of them takes meanwhile, as measured of random facets, with what is cut of it


@dataclass(frozen=True, eq=False)
class Cones:
    """Cones about axes that begin at `center`, m (k, 3), along unit vectors `axis` (k, 3).

    radius  m (k,) about the centre;  widening  by which the radius grows per length of the axis (k,)
    reach   m (k,): lengths of the axes
    """

    center: np.ndarray
    axis: np.ndarray
    radius: np.ndarray
    widening: np.ndarray
    reach: np.ndarray

    def part(self, rows: np.ndarray) -> Cones:
        """Cones `rows` (n,)."""
        return Cones(self.center[rows], self.axis[rows], self.radius[rows], self.widening[rows], self.reach[rows])

    def meet(self, which: np.ndarray, place: np.ndarray, size: np.ndarray) -> np.ndarray:
        """Whether cones `which` (n,) come near spheres about places, m (n, 3), of radii `size`, m (n,)."""
        step = place - self.center[which]
        along = np.einsum("ij,ij->i", step, self.axis[which])
        across = np.einsum("ij,ij->i", step, step) - along**2
        radius = self.radius[which]
        width = radius + size + self.widening[which] * np.maximum(along + size + radius, 0)
        return np.asarray((across <= width**2) & (along > -size - radius) & (along < size + self.reach[which]))


class FacetTree:
    """Triangles, m (k, 3, 3), that are looked up by cones."""

    def __init__(self, triangles: np.ndarray, most_pairs: int = MOST_PAIRS) -> None:
        self._most_pairs = most_pairs
        self._order = morton_order(triangles.mean(axis=1)) if len(triangles) else np.zeros(0, np.int64)
        self._triangles = triangles[self._order]

    @cached_property
    def _levels(self) -> list[tuple[np.ndarray, np.ndarray]]:
        """Centres and radii of the spheres of each level, from the triangles up."""
        corners = self._triangles.swapaxes(1, 2)
        center = (folded(np.minimum, corners) + folded(np.maximum, corners)) / 2
        away = np.sqrt(folded(np.add, (self._triangles - center[:, None]) ** 2))
        levels = [(center, folded(np.maximum, away))]
        while len(levels[-1][0]) > BRANCHES:
            center, radius = levels[-1]
            starts = np.arange(0, len(center), BRANCHES)
            low, high = np.minimum.reduceat(center, starts), np.maximum.reduceat(center, starts)
            middle = (low + high) / 2
            away = np.linalg.norm(center - np.repeat(middle, BRANCHES, axis=0)[: len(center)], axis=1) + radius
            levels.append((middle, np.maximum.reduceat(away, starts)))
        return levels

    def within(self, cones: Cones) -> tuple[np.ndarray, np.ndarray]:
        """Pairs of a cone and a triangle that may lie in it (n,), (n,), in the order of the cones; TooManyAtOnce
        for too many of more than two cones."""
        pairs, number = [], 0
        for first in range(0, len(cones.radius), AT_ONCE):
            pairs.append(self._pairs_within(cones, first))
            number += len(pairs[-1][0])
            if number > self._most_pairs and len(cones.radius) > FEWEST:
                raise TooManyAtOnce
        if not pairs:
            return np.zeros(0, np.int64), np.zeros(0, np.int64)
        which, facet = (np.concatenate(parts) for parts in zip(*pairs, strict=True))
        return which, self._order[facet]

    def _pairs_within(self, cones: Cones, first: int) -> tuple[np.ndarray, np.ndarray]:
        number = min(AT_ONCE, len(cones.radius) - first)
        top = len(self._levels[-1][0])
        which, node = np.repeat(np.arange(first, first + number), top), np.tile(np.arange(top), number)
        for depth in range(len(self._levels) - 1, -1, -1):
            center, radius = self._levels[depth]
            is_near = cones.meet(which, center[node], radius[node])
            which, node = which[is_near], node[is_near]
            if len(which) > self._most_pairs and len(cones.radius) > FEWEST:
                raise TooManyAtOnce
            if depth:
                below = len(self._levels[depth - 1][0])
                which = np.repeat(which, BRANCHES)
                node = (node[:, None] * BRANCHES + np.arange(BRANCHES)).ravel()
                which, node = which[node < below], node[node < below]
        return which, node
