"""Pulse nodes: pulses at which facet amplitudes are computed, with Lagrange cubics between them.

docs/theory/facets.md derives the error; it is measured on samples, and held by tests.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from ..base.constants import SPEED_OF_LIGHT
from ..base.vectors import unit
from ..numerics.polynomials import lagrange
from ..scene.triangles import areas, centroids, edges
from ._direction_error import drawn_near_vertical, steep_pulses
from ._facet_sampling import drawn
from ._frequency_nodes import typical_power
from .antenna_weights import AntennaWeights
from .facets import FacetSet
from .rough_pieces import RoughFacets

ORDER = 4  # nodes that a cubic goes through
SPACINGS = (64, 32, 16, 8, 4)  # pulses between nodes that are tried
FACETS, WINDOWS = 200, 6  # samples: facets, and intervals between nodes along the track
STEEP_WINDOWS = 32  # such intervals where facets pass below an antenna, each at another pulse
# Pairs of facet and pulse below which estimating the error costs more than the nodes save
WORTH = 2e7
MOST_TURN = 1.0  # rad between nodes, of the phase from a facet's corner to its centre: no specular flash lies between
SAFETY = 2.0  # the error is estimated from samples


Sample = tuple[FacetSet, np.ndarray]  # facets, and the number that each represents (k,)


@dataclass(frozen=True, eq=False)
class PulseNodes:
    """Pulses at which amplitudes are computed, rising (n,), and the spacing between them; 1: every pulse.

    error  relative, of amplitudes interpolated between them
    """

    pulses: np.ndarray
    spacing: int
    error: float

    @property
    def order(self) -> int:
        """Nodes from which the amplitude of one pulse is interpolated."""
        return 1 if self.spacing == 1 else ORDER

    def of(self, start: int, stop: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Nodes of the pulses start ... stop - 1; per pulse the indices in them of its (first, nearest) node, int32
        (n, 2), and the Lagrange factors of its nodes, float32 (n, order)."""
        rows = np.arange(start, stop)
        if self.spacing == 1:
            here = rows - start
            return rows, np.stack([here, here], axis=1).astype(np.int32), np.ones((len(rows), 1), np.float32)
        first = np.clip(np.searchsorted(self.pulses, rows, side="right") - ORDER // 2, 0, len(self.pulses) - ORDER)
        low, high = int(first.min()), int(first.max()) + ORDER
        near = self.pulses[first[:, None] + np.arange(ORDER)]
        nearest = first + np.abs(near - rows[:, None]).argmin(axis=1)
        both = np.stack([first - low, nearest - low], axis=1).astype(np.int32)
        return self.pulses[low:high], both, lagrange(near.T, rows).T.astype(np.float32, order="C")


def every(n_pulses: int) -> PulseNodes:
    """A node at each pulse."""
    return PulseNodes(np.arange(n_pulses), 1, 0.0)


def spaced(n_pulses: int, spacing: int, error: float = 0.0) -> PulseNodes:
    """A node at every `spacing`-th pulse, and at the last."""
    return PulseNodes(np.append(np.arange(0, n_pulses - 1, spacing), n_pulses - 1), spacing, error)


def plan_pulse_nodes(
    part: FacetSet,
    weights: AntennaWeights,
    polarizations: Sequence[str],
    vertical: np.ndarray,
    frequency: float,
    tolerance: float,
    worth: float = WORTH,
) -> PulseNodes:
    """The widest nodes whose error is at most `tolerance`, relative to facets at random phases.

    frequency  the highest, Hz;  worth  pairs of facet and pulse, from which on nodes are looked for
    For mirrors the spacing is also limited by MOST_TURN, whatever the samples say.
    """
    n_pulses = len(weights.geometry)
    if len(part) * n_pulses < worth or n_pulses < least_pulses(min(SPACINGS)):
        return every(n_pulses)
    sample, share = sample_of(part, np.random.default_rng(0))
    geometry = weights.geometry
    steep = steep_pulses(geometry, part.bounds, vertical)

    def sampled(pulse: int) -> Sample:
        """H and V of facets near the vertical through an antenna turn fastest: other facets at every pulse."""
        if not steep:
            return sample, share
        near, represents = drawn_near_vertical(part.triangles, (geometry.tx[pulse], geometry.rx[pulse]), vertical)
        return part.picked(near), represents

    corner = float(np.maximum.reduce(edges(part.triangles)).max()) * 2 / 3 if part.is_mirror else 0.0
    for spacing in SPACINGS:
        if n_pulses < least_pulses(spacing):
            continue
        turn = 2 * np.pi * frequency / SPEED_OF_LIGHT * corner * _turning(weights, centroids(sample.triangles), spacing)
        if turn > MOST_TURN:
            continue
        error = _error(sampled, steep, weights, polarizations, vertical, frequency, spaced(n_pulses, spacing))
        if SAFETY * error <= tolerance:
            return spaced(n_pulses, spacing, SAFETY * error)
    return every(n_pulses)


def sample_of(part: FacetSet, random: np.random.Generator) -> Sample:
    """Up to FACETS of a set, and the number that each represents."""
    if isinstance(part, RoughFacets):
        return part.drawn(FACETS, random)
    some, represents = drawn(areas(part.triangles), FACETS, random)
    return part.picked(some), represents


def least_pulses(spacing: int) -> int:
    """Pulses that are enough for a cubic."""
    return (ORDER - 1) * spacing + 1


def _turning(weights: AntennaWeights, places: np.ndarray, spacing: int) -> float:
    """Largest rotation of u_t + u_r over `spacing` pulses, rad, seen from the places' middle and from their nearest."""
    most = 0.0
    for place in (places.mean(axis=0), places[np.argmin(np.linalg.norm(places - weights.geometry.tx[0], axis=1))]):
        look = unit(weights.geometry.tx - place) + unit(weights.geometry.rx - place)
        most = max(most, float(np.linalg.norm(look[spacing:] - look[:-spacing], axis=1).max()))
    return most


def _error(
    sampled: Callable[[int], Sample],
    steep: Sequence[int],
    weights: AntennaWeights,
    polarizations: Sequence[str],
    vertical: np.ndarray,
    frequency: float,
    nodes: PulseNodes,
) -> float:
    """Relative error of amplitudes a quarter, a half and three quarters on from some of the nodes.

    sampled  facets that are sampled from a pulse on, and the number that each represents (k,)
    steep    pulses that are sampled whatever the others
    """
    last = len(weights.geometry) - 1 - nodes.spacing
    wrong = right = 0.0
    starts = np.append(
        np.linspace(0, last, STEEP_WINDOWS if steep else WINDOWS), np.minimum(np.array(steep, int), last)
    )
    for start in np.unique(starts.astype(int) // nodes.spacing * nodes.spacing).tolist():
        part, share = sampled(start)
        made: dict[int, np.ndarray] = {}
        for step in (1, 2, 3):
            pulse = start + max(1, step * nodes.spacing // 4)
            needed, which, factors = nodes.of(pulse, pulse + 1)
            near = needed[which[0, 0] :][:ORDER].tolist()
            for one in {*near, pulse} - made.keys():
                made[one] = amplitudes_at(part, weights, one, polarizations, vertical, frequency)
            guess = sum(factor * made[one] for factor, one in zip(factors[0].astype(float).tolist(), near, strict=True))
            wrong += float(share @ (np.abs(guess - made[pulse]) ** 2).sum(axis=1))
            right += typical_power(share * (np.abs(made[pulse]) ** 2).sum(axis=1))
    return float(np.sqrt(wrong / right)) if right else 0.0


def amplitudes_at(
    part: FacetSet,
    weights: AntennaWeights,
    pulse: int,
    polarizations: Sequence[str],
    vertical: np.ndarray,
    frequency: float,
) -> np.ndarray:
    """Amplitudes at a pulse, weights of the antennas included, complex128 (k, n_polarizations)."""
    ends = weights.geometry.tx[pulse], weights.geometry.rx[pulse]
    sent = part.amplitudes(*ends, np.array([frequency]), polarizations, vertical)[0]
    return np.asarray(sent * weights.weights(centroids(part.triangles), pulse, frequency)[:, None])
