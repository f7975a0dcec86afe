"""Amplitudes of points and facets as functions of the aspect from which a straight track sees them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...model.antenna_pattern import two_way_gain
from ...model.radar import spreading
from ...scattering.antenna_weights import AntennaWeights
from ...scattering.facets import FacetSet
from ...scattering.scatterers import Points
from ...scene.triangles import areas, centroids
from ._beam_edges import BeamEdges, beam_edges, continued_weights
from ._straight_track import StraightTrack

AT_ONCE = 50_000  # facets per block: their geometry stays in a cache


@dataclass(frozen=True, eq=False)
class Shares:
    """Illuminated shares of facets, by pulse: constant (k,), but for those at `changing` (n,), which have `values`
    (n, m) at the pulses `knots` (m,) and change linearly in between."""

    constant: np.ndarray
    changing: np.ndarray
    knots: np.ndarray
    values: np.ndarray

    def at(self, some: np.ndarray, pulses: np.ndarray) -> np.ndarray:
        """Shares of facets `some` (n,) at pulses (n,), which need not be whole numbers."""
        out = self.constant[some]
        place = np.searchsorted(self.changing, some)
        place[place == len(self.changing)] = 0
        which = np.flatnonzero(self.changing[place] == some) if len(self.changing) else np.zeros(0, np.int64)
        if len(which):
            row, pulse = place[which], np.clip(pulses[which], self.knots[0], self.knots[-1])
            after = np.clip(np.searchsorted(self.knots, pulse, side="right"), 1, len(self.knots) - 1)
            before = self.knots[after - 1]
            part = (pulse - before) / (self.knots[after] - before)
            out[which] = self.values[row, after - 1] * (1 - part) + self.values[row, after] * part
        return out


def shares_of(facets: FacetSet, n_pulses: int) -> Shares:
    """Illuminated shares of facets along a track."""
    spans = list(facets.spans(n_pulses))
    first = spans[0].level
    changes = np.zeros(len(facets), bool)
    for span in spans:
        changes |= (span.level != first) | (span.later != first)
    changing = np.flatnonzero(changes)
    knots, values = [], []
    for span in spans:
        for pulse, share in ((span.first, span.level), (span.stop - 1e-6, span.later)):
            knots.append(float(pulse))
            values.append(share[changing] / 255)
    return Shares(first / 255, changing, np.array(knots), np.stack(values, axis=1))


class ScattererAmplitudes:
    """Amplitudes of points or facets, weights of antennas included, seen from places on a straight track.

    azimuth, slant_range  m (n,);  size  (n,), by which scatterers are drawn as samples
    kinds                 of facets (n,): 1 those without a coherent part, 0 the others; None: points
    edges                 hard edges of the beam, beyond which the amplitudes are continued; None: it has none
    """

    def __init__(
        self, part: Points | FacetSet, weights: AntennaWeights, track: StraightTrack, polarizations: Sequence[str],
        vertical: np.ndarray, hard: float | None = None,
    ) -> None:  # fmt: skip
        """hard  tolerance to which hard edges of the beam are followed; None: amplitudes fall to 0 there"""
        self.part, self.weights, self.track = part, weights, track
        self.polarizations, self.vertical = tuple(polarizations), vertical
        self.shares: Shares | None = None
        self.kinds: np.ndarray | None = None
        if isinstance(part, Points):
            self.positions, self.size = part.positions, np.abs(part.amplitudes) ** 2
            self.keeps = np.array([name[0] == name[1] for name in polarizations], np.float64)
        else:
            self.positions, self.size = centroids(part.triangles), areas(part.triangles)
            self.kinds = part.is_incoherent.astype(np.int64)
            if part.illumination is not None and not part.illumination.full[part.kept].all():
                self.shares = shares_of(part, track.n_pulses)
        self.azimuth, self.slant_range = track.coordinates(self.positions)
        self.edges: BeamEdges | None = None
        if hard is not None:
            self.weights = continued_weights(weights, hard)
            edges = beam_edges(weights, self.weights, track, self.positions)
            self.edges = edges and edges.along(self.azimuth, self.slant_range, track.length)

    def __len__(self) -> int:
        return len(self.positions)

    def sines(self, place: float | np.ndarray, some: slice | np.ndarray = slice(None)) -> np.ndarray:
        """Sines of the aspect from a place on the track, m from the first pulse, (n,)."""
        lag = place - self.azimuth[some]
        return np.asarray(lag / np.hypot(lag, self.slant_range[some]))

    def __call__(self, some: np.ndarray, sine: float | np.ndarray, frequency: float) -> np.ndarray:
        """Amplitudes of scatterers `some` (n,) seen at sines (one for all, or (n,)), at one frequency, Hz: complex128
        (n, n_polarizations)."""
        out = np.empty((len(some), len(self.polarizations)), np.complex128)
        for start in range(0, len(some), AT_ONCE):
            part = slice(start, start + AT_ONCE)
            out[part] = self._block(some[part], sine if np.ndim(sine) == 0 else np.asarray(sine)[part], frequency)
        return out

    def _block(self, some: np.ndarray, sine: float | np.ndarray, frequency: float) -> np.ndarray:
        azimuth, slant_range = self.azimuth[some], self.slant_range[some]
        antennas = self.track.antennas(azimuth, slant_range, sine)
        if isinstance(self.part, Points):
            made = self.part.amplitudes[some][:, None] * self.keeps
        else:
            picked = self.part.picked(some)
            made = picked.amplitudes(antennas, antennas, np.array([frequency]), self.polarizations, self.vertical)[0]
            if self.shares is not None:
                pulses = (antennas - self.track.start) @ self.track.along / self.track.spacing
                made *= self.shares.at(some, pulses)[:, None]
        return np.asarray(made * self._weights(self.positions[some], antennas, frequency)[:, None])

    def _weights(self, points: np.ndarray, antennas: np.ndarray, frequency: float) -> np.ndarray:
        """As AntennaWeights.weights, for points each seen from a place of its own."""
        out, weights = np.ones(len(points), np.complex128), self.weights
        if weights.pair is not None and weights.axes is not None:
            axes = weights.axes[0][0], weights.axes[1][0]
            out *= two_way_gain(weights.pair, axes, antennas, antennas, points, frequency)
        if weights.radar is not None:
            away = np.linalg.norm(points - antennas, axis=1)
            out *= weights.range**2 * spreading(away, away)
        return out
