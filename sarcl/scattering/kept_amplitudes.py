"""Error of amplitudes that are known at some antenna positions of a track, and interpolated between them with phases.

Factorised echoes interpolate a cell's profiles between the antenna positions that are kept there. The filter is made
for phases; amplitudes that change from one kept position to the next add an error of their own, measured on samples:

    error^2 = mean_k,p |sum_v W(p - v) (a_k(v) - a_k(p)) exp(j phi_k(v))|^2 / mean_k,p |a_k(p)|^2

phi is the phase of a scatterer at the edge of the cell, about its centre, v kept positions, and W the filter.

source    docs/theory/factorized_echo.md
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from ..base.boxes import box, corners
from ..base.constants import SPEED_OF_LIGHT
from ..base.rows import spread_over
from ..base.vectors import unit
from ..numerics.pulse_geometry import half_path
from ..numerics.subapertures import Decimation
from ..scene.triangles import centroids, edges
from ._direction_error import steep_pulses
from ._facet_sampling import drawn
from ._frequency_nodes import typical_power
from .antenna_weights import AntennaWeights
from .facets import FacetSet
from .pulse_nodes import MOST_TURN, SAFETY, amplitudes_at, sample_of

POINTS = 1000  # points that are sampled: their gains are computed faster than amplitudes of facets
BLOCKS = 9  # intervals between kept positions that are sampled along the track, its first and last among them

# complex128 (k, n) of the sampled scatterers, as antennas with these weights see them at one position
Amplitudes = Callable[[AntennaWeights, int], np.ndarray]


@dataclass(frozen=True, eq=False)
class AmplitudeSamples:
    """Scatterers that are sampled.

    places  m (k, 3);  share  number of scatterers that each represents (k,);  amplitudes  of them
    weights  of antennas at every pulse;  frequency  the highest, Hz
    bounds  m (2, 3), box of all scatterers
    corner  m, largest distance of a mirror's corner from its centre; 0: none reflects as a mirror
    """

    places: np.ndarray
    share: np.ndarray
    amplitudes: Amplitudes
    weights: AntennaWeights
    frequency: float
    bounds: np.ndarray
    corner: float = 0.0

    @classmethod
    def of_points(
        cls, positions: np.ndarray, amplitudes: np.ndarray, weights: AntennaWeights, frequency: float
    ) -> AmplitudeSamples:
        """Of points at positions, m (n, 3), with amplitudes (n,)."""
        sample, share = drawn(np.abs(amplitudes) ** 2, POINTS, np.random.default_rng(0))
        places, own = positions[sample], amplitudes[sample, None]

        def seen(by: AntennaWeights, i: int) -> np.ndarray:
            return np.asarray(own * by.weights(places, i, frequency)[:, None])

        return cls(places, share, seen, weights, frequency, box(positions))

    @classmethod
    def of_facets(
        cls,
        facets: FacetSet,
        weights: AntennaWeights,
        polarizations: Sequence[str],
        vertical: np.ndarray,
        frequency: float,
    ) -> AmplitudeSamples:
        """Of facets."""
        part, share = sample_of(facets, np.random.default_rng(0))
        corner = float(np.maximum.reduce(edges(facets.triangles)).max()) * 2 / 3 if facets.is_mirror else 0.0

        def seen(by: AntennaWeights, i: int) -> np.ndarray:
            return amplitudes_at(part, by, i, polarizations, vertical, frequency)

        return cls(centroids(part.triangles), share, seen, weights, frequency, facets.bounds, corner)

    def change(self, source: AntennaWeights, decimation: Decimation, radius: float) -> float:
        """Error of amplitudes at the positions of `source`, interpolated between those that a decimation keeps.

        radius  m, of cells. Infinite where a mirror turns so far between two kept positions that a flash may lie there,
        or where a table of gains may end among the scatterers.
        """
        kept = source.decimated(decimation)
        if self.corner and self._turn(kept) > MOST_TURN:
            return np.inf
        if not self._in_tables(source) or not self._in_tables(kept):
            return np.inf
        directions = unit(np.random.default_rng(0).standard_normal(self.places.shape))
        centers = self.places - radius * directions
        taps = decimation.filter.shape[1]
        at_kept: dict[int, tuple[np.ndarray, np.ndarray]] = {}
        wrong = right = 0.0
        for first, count, before, row in decimation.blocks[spread_over(len(decimation.blocks), BLOCKS)].tolist():
            near = range(before, before + taps)
            for v in near:
                if v not in at_kept:
                    at_kept[v] = self.amplitudes(kept, v), self._phasors(kept, v, centers)
            for step in sorted({count // 4, count // 2, 3 * count // 4}):
                exact = self.amplitudes(source, first + step)
                error = np.zeros(exact.shape, np.complex128)
                for v, weight in zip(near, decimation.filter[row + step].tolist(), strict=True):
                    amplitudes, phasors = at_kept[v]
                    error += weight * (amplitudes - exact) * phasors[:, None]
                wrong += float(self.share @ (np.abs(error) ** 2).sum(axis=1))
                right += typical_power(self.share * (np.abs(exact) ** 2).sum(axis=1))
        return SAFETY * float(np.sqrt(wrong / right)) if right else 0.0

    def _phasors(self, kept: AntennaWeights, v: int, centers: np.ndarray) -> np.ndarray:
        """exp(j phi) at a kept position, complex128 (k,)."""
        ends = kept.geometry.tx[v], kept.geometry.rx[v]
        path = half_path(*ends, self.places) - half_path(*ends, centers)
        return np.asarray(np.exp(4j * np.pi * self.frequency / SPEED_OF_LIGHT * path))

    def _in_tables(self, by: AntennaWeights) -> bool:
        """Whether all scatterers lie within the tables of gains, beyond which these are 0, at every position."""
        for pattern, ends, axes in zip(by.patterns, (by.geometry.tx, by.geometry.rx), by.axes or (), strict=False):
            if pattern.kind != "table":
                continue
            look = unit(corners(self.bounds) - ends[:, None]) @ axes
            bend = float(np.linalg.norm(np.ptp(look, axis=1), axis=1).max()) ** 2  # of the box's edges, in angles
            azimuth = np.arctan2(look[..., 1], look[..., 0])
            elevation = np.arctan2(look[..., 2], np.hypot(look[..., 0], look[..., 1]))
            ratio = 1.0 if pattern.frequency is None else pattern.frequency / self.frequency
            for angle, table in ((azimuth, pattern.azimuth), (elevation, pattern.elevation)):
                if angle.min() - bend < ratio * table[0] or angle.max() + bend > ratio * table[-1]:
                    return False
        return True

    def _turn(self, kept: AntennaWeights) -> float:
        """Largest change of the phase from a mirror's corner to its centre, rad, from one kept position to the next."""
        place, most = self.places.mean(axis=0), 0.0
        look = unit(kept.geometry.tx - place) + unit(kept.geometry.rx - place)
        for begin, end in kept.geometry.runs:
            change = np.linalg.norm(np.diff(look[begin:end], axis=0), axis=1)
            most = max(most, float(change.max(initial=0.0)))
        return 2 * np.pi * self.frequency / SPEED_OF_LIGHT * self.corner * most


def passes_overhead(facets: FacetSet, weights: AntennaWeights, vertical: np.ndarray) -> bool:
    """Whether some facets lie near the vertical through an antenna, where H and V turn fastest."""
    return bool(len(steep_pulses(weights.geometry, facets.bounds, vertical)))
