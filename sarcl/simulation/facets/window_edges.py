"""The parts of facets at the edges of a range window, summed in float64 on the host.

A facet counts by its part inside the window. Where facets are added up, each piece is in or out by its centroid, which
is a staircase in place of the window's edge, and another one for every size of pieces. What that leaves out is added
here for coherent facets: the integral over the part of each piece between near and far, less that over the whole piece
where its centroid is inside. Pieces of the random surface are its cells, and stay in or out by their centroids.

    d(rho) = d_0 - (u_t + u_r).rho/2,   near <= d <= far

d is the half path about the reference range, linear over a piece as its phase is: the window ends along a line of
constant phase. With phi = (u_t + u_r).rho at the corners, phi_0 <= phi_1 <= phi_2, the part with phi >= t is the corner
at phi_2 with the phases (phi_2, t, t) and the share (phi_2 - t)^2/((phi_2 - phi_0) (phi_2 - phi_1)) of the area where
t >= phi_1, and else the whole less such a corner at phi_0. Corners are triangles, of which lit parts are computed too.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from ...base.constants import SPEED_OF_LIGHT
from ...base.morton import morton_order
from ...base.stage_timer import Clock
from ...base.vectors import unit
from ...numerics.polynomials import chebyshev, lagrange
from ...scattering.facets import FacetSet, Light
from ...scattering.physical_optics import triangle_mean
from ...scene.triangles import centroids
from ..spreading import ChannelView, Counts
from .exact_facets import facet_samples

TOGETHER = 64  # neighbouring pieces that one distance leaves out
LEAST_SHARE = 1e-12  # of a facet's area: smaller corners are left out
FEWEST_NODES, NODES_PER_RADIAN = 12, 1.3  # of the band; radians to its edge from its middle, at the farthest corner


class WindowEdges:
    """Coherent facets of one channel at one receiver, corrected where the edges of its range window cross them."""

    def __init__(self, facets: FacetSet, view: ChannelView) -> None:
        """facets  as the channel's pulses see them"""
        self.facets, self.view = facets, view
        rows = np.flatnonzero(~facets.is_incoherent)
        self._rows = rows[morton_order(centroids(facets.triangles[rows]))]  # neighbours follow one another
        triangles = facets.triangles[self._rows]
        self._places = centroids(triangles)
        self._reach = np.sqrt(((triangles - self._places[:, None]) ** 2).sum(axis=2).max(axis=1))
        self._starts = np.arange(0, len(self._rows), TOGETHER)
        counts = np.diff(np.append(self._starts, len(self._rows)))
        self._middles = np.add.reduceat(self._places, self._starts) / counts[:, None]
        apart = np.linalg.norm(self._places - np.repeat(self._middles, counts, axis=0), axis=1)
        self._radii = np.maximum.reduceat(apart + self._reach, self._starts)

    def add(
        self, samples: np.ndarray, pulses: Sequence[int], clock: Clock, on_progress: Callable[[int], object]
    ) -> Counts:
        """Add to samples (n_pulses, n_polarizations, n_samples) of consecutive `pulses` of the antennas. No pair of
        facet and pulse counts twice; those whose centroids lie outside the window contribute after all."""
        view, counts = self.view, Counts()
        for row, p in enumerate(pulses):
            for limit, numbers in self._at_edges(p):
                samples[row] += self._at_edge(p, limit, numbers, view.frequencies).astype(np.complex64)
                delta = self._half_paths(self._places[numbers], p)
                outside = (delta < view.antennas.near[p]) | (delta > view.antennas.far[p])
                counts += Counts(0, -int(outside.sum()), crossed=len(numbers))
        clock.lap("echo")
        return counts

    def _at_edges(self, pulse: int) -> Iterator[tuple[float, np.ndarray]]:
        """Each edge of the window, m about the reference range, and the numbers of the facets that it crosses; those
        across both edges belong to the near one."""
        near, far = float(self.view.antennas.near[pulse]), float(self.view.antennas.far[pulse])
        at_near, at_far = self._across(pulse, near), self._across(pulse, far)
        for limit, numbers in ((near, at_near), (far, np.setdiff1d(at_far, at_near, assume_unique=True))):
            if len(numbers):
                yield limit, numbers

    def _across(self, pulse: int, limit: float) -> np.ndarray:
        """Numbers of the coherent facets that an edge of the window, m about the reference range, may cross."""
        groups = np.flatnonzero(np.abs(self._half_paths(self._middles, pulse) - limit) <= self._radii)
        if not len(groups):
            return groups
        numbers = (self._starts[groups, None] + np.arange(TOGETHER)).ravel()
        numbers = numbers[numbers < len(self._rows)]
        return np.asarray(
            numbers[np.abs(self._half_paths(self._places[numbers], pulse) - limit) < self._reach[numbers]]
        )

    def _half_paths(self, places: np.ndarray, pulse: int) -> np.ndarray:
        """Half paths over places, m (n, 3), about the reference range of a pulse."""
        antennas = self.view.antennas
        paths = sum(np.linalg.norm(places - end[pulse], axis=1) for end in (antennas.tx, antennas.rx))
        return np.asarray(paths / 2 - antennas.reference_range[pulse])

    def _at_edge(self, pulse: int, limit: float, numbers: np.ndarray, frequencies: np.ndarray) -> np.ndarray:
        """What the facets of these numbers lack at an edge of the window (n_polarizations, n).

        All lie at the edge: about its delay, few frequencies of the band tell of all."""
        view, antennas, rows = self.view, self.view.antennas, self._rows[numbers]
        low, high = float(frequencies.min()), float(frequencies.max())
        beyond = np.abs(self._half_paths(self._places[numbers], pulse) - limit) + self._reach[numbers]
        radians = 2 * np.pi * (high - low) * float(beyond.max()) / SPEED_OF_LIGHT
        n = FEWEST_NODES + int(NODES_PER_RADIAN * radians)
        nodes = frequencies if n >= len(frequencies) else chebyshev((low + high) / 2, high - low, n)
        at_edge = replace(antennas, reference_range=antennas.reference_range + limit)
        light = self._light(pulse, numbers, 2 * np.pi * nodes / SPEED_OF_LIGHT)
        values, _ = facet_samples(
            self.facets.picked(rows),
            replace(view, antennas=at_edge, frequencies=nodes),
            pulse,
            np.ones(len(rows), bool),
            light,
        )
        if nodes is not frequencies:
            values = values @ lagrange(nodes, frequencies)
        turn = (np.longdouble(2 * limit / SPEED_OF_LIGHT) * frequencies) % 1
        return np.asarray(values * np.exp(-2j * np.pi * turn.astype(np.float64)))

    def _light(self, pulse: int, numbers: np.ndarray, waves: np.ndarray) -> Light:
        """The parts of these facets inside the window, less what counts of each by its centroid."""
        antennas, facets, rows = self.view.antennas, self.facets, self._rows[numbers]
        corners = facets.triangles[rows] - self._places[numbers][:, None]
        both = sum(unit(end[pulse] - self._places[numbers]) for end in (antennas.tx, antennas.rx))
        order = np.argsort(np.einsum("kij,kj->ki", corners, both), axis=1)
        corners = np.take_along_axis(corners, order[:, :, None], axis=1)
        phases = np.einsum("kij,kj->ki", corners, both)
        mean = triangle_mean(waves * (phases[:, 1:2] - phases[:, :1]), waves * (phases[:, 2:] - phases[:, :1]))
        lit = partial(self._seen_past_others, pulse, rows, corners + self._places[numbers][:, None], waves)
        mean = lit(mean, np.arange(len(rows)), None)
        delta = self._half_paths(self._places[numbers], pulse)
        last, first = 2 * (delta - antennas.far[pulse]), 2 * (delta - antennas.near[pulse])
        part = -1.0 * ((last <= 0) & (first >= 0))[:, None] * mean
        for limit, sign in ((last, 1), (first, -1)):
            corner = _Corners.beyond(phases, limit)
            inside = np.flatnonzero(corner.share > LEAST_SHARE)
            above = np.where(corner.is_upper[:, None], 0, mean)
            means = lit(corner.means(inside, waves), inside, corner)
            above[inside] += np.where(corner.is_upper[inside], 1, -1)[:, None] * corner.share[inside, None] * means
            part += sign * above
        return Light(np.arange(len(rows)), np.zeros((1, len(rows))), part[None])

    def _seen_past_others(
        self,
        pulse: int,
        rows: np.ndarray,
        triangles: np.ndarray,
        waves: np.ndarray,
        means: np.ndarray,
        numbers: np.ndarray,
        corner: _Corners | None,
    ) -> np.ndarray:
        """Means over facets `numbers` of those that lie at an edge, or over a corner of each, of what antennas see past
        other facets."""
        facets, antennas = self.facets, self.view.antennas
        if facets.lit_rows is None or facets.lit_parts is None:
            return means
        partly = np.flatnonzero(facets.lit_rows[rows[numbers]] >= 0)
        if len(partly):
            which, ends = numbers[partly], [end[pulse] for end in antennas.ends]
            parts = triangles[which] if corner is None else corner.triangles(triangles, which)
            middles = centroids(parts) - centroids(triangles[which])
            both = sum(unit(end[pulse] - centroids(triangles[which])) for end in (antennas.tx, antennas.rx))
            turn = np.exp(1j * waves * (middles * both).sum(axis=1)[:, None])
            means[partly] = turn * facets.lit_parts.of_triangles(
                pulse, facets.lit_rows[rows[which]], parts, ends, waves
            )
        return means


@dataclass(frozen=True, eq=False)
class _Corners:
    """Corners of triangles on one side of a line of constant phase phi, m: of those above it, where more than one
    corner of the triangle lies below, and else of those below.

    phases  of the tips and of the line (n, 2);  share  of the areas (n,);  is_upper  (n,) bool
    number  of the tip among the corners of the triangle, 0 or 2;  along  parts of its two edges (n, 2)
    """

    phases: np.ndarray
    share: np.ndarray
    is_upper: np.ndarray
    number: np.ndarray
    along: np.ndarray

    @classmethod
    def beyond(cls, phases: np.ndarray, limit: np.ndarray) -> _Corners:
        """phases  of the triangles' corners, rising (n, 3);  limit  m (n,)"""
        low, middle, high = phases.T
        at = np.clip(limit, low, high)
        is_upper = at >= middle
        tip = np.where(is_upper, high, low)
        spans = np.stack([middle - tip, np.where(is_upper, low, high) - tip], axis=1)
        along = np.where(spans != 0, (at - tip)[:, None] / np.where(spans != 0, spans, 1), 0.0)
        return cls(np.stack([tip, at], axis=1), along.prod(axis=1), is_upper, np.where(is_upper, 2, 0), along)

    def means(self, numbers: np.ndarray, waves: np.ndarray) -> np.ndarray:
        """Means of exp(j k phi) over corners `numbers`: complex128 (n, m);  waves  k, rad/m (m,)"""
        tip, at = self.phases[numbers].T
        turn = waves * (at - tip)[:, None]
        return np.asarray(np.exp(1j * waves * ((tip + 2 * at) / 3)[:, None]) * triangle_mean(turn, turn))

    def triangles(self, triangles: np.ndarray, numbers: np.ndarray) -> np.ndarray:
        """The corners of triangles `numbers`, m (n, 3, 3), of all triangles, their own corners by rising phase."""
        rows, tips = np.arange(len(numbers)), self.number[numbers]
        corners = triangles[numbers]
        tip, ends = corners[rows, tips], np.stack([corners[:, 1], corners[rows, 2 - tips]], axis=1)
        return np.concatenate(
            [tip[:, None], tip[:, None] + self.along[numbers][:, :, None] * (ends - tip[:, None])], axis=1
        )
