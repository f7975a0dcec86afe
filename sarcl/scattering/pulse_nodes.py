"""How many pulses share what facets send back: knots, whose amplitudes are computed, and Lagrange's cubics between.

docs/theory/facets.md says what that errs: it is measured on samples, and held by tests.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..base.constants import SPEED_OF_LIGHT
from ..base.vectors import unit
from ..numerics.polynomials import lagrange
from ..scene.triangles import centroids, edges
from ._frequency_nodes import typical_power
from .antenna_weights import AntennaWeights
from .facets import Facets

ORDER = 4  # knots a cubic goes through
SPACINGS = (64, 32, 16, 8, 4)  # pulses between knots that are tried
FACETS, WINDOWS = 200, 6  # looked at, and where along the track
WORTH = 2e7  # pairs of facet and pulse: below, looking would cost more than it saves
MOST_TURN = 1.0  # rad between knots, of the phase from a facet's corner to its centre: no flash falls between
SAFETY = 2.0  # these are samples


@dataclass(frozen=True, eq=False)
class Knots:
    """Pulses that amplitudes are computed at, rising (n,), and how far apart they lie; 1: all of them.

    error  relative, of what lies between
    """

    pulses: np.ndarray
    spacing: int
    error: float

    @property
    def order(self) -> int:
        """Knots that a pulse's amplitude is made from."""
        return 1 if self.spacing == 1 else ORDER

    def of(self, start: int, stop: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """For pulses start ... stop - 1: the knots they need, and which of these (first, nearest), int32 (n, 2), with
        what shares, float32 (n, order)."""
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


def every(n_pulses: int) -> Knots:
    """Each pulse its own."""
    return Knots(np.arange(n_pulses), 1, 0.0)


def spaced(n_pulses: int, spacing: int, error: float = 0.0) -> Knots:
    """Every `spacing`-th pulse, and the last."""
    return Knots(np.append(np.arange(0, n_pulses - 1, spacing), n_pulses - 1), spacing, error)


def plan_knots(
    part: Facets,
    beam: AntennaWeights,
    polarizations: Sequence[str],
    vertical: np.ndarray,
    frequency: float,
    tolerance: float,
) -> Knots:
    """The widest knots that err by no more than `tolerance`, relative to facets at random phases.

    frequency  the highest, Hz. Mirrors are kept from flashing between knots whatever the samples say.
    """
    n_pulses = len(beam.geometry)
    if len(part) * n_pulses < WORTH:
        return every(n_pulses)
    some = np.random.default_rng(0).permutation(len(part))[:FACETS]
    sample = part.picked(some)
    corner = float(np.maximum.reduce(edges(part.triangles)).max()) * 2 / 3 if part.is_mirror else 0.0
    for spacing in SPACINGS:
        if n_pulses < 4 * spacing + 1:
            continue
        turn = 2 * np.pi * frequency / SPEED_OF_LIGHT * corner * _turning(beam, centroids(sample.triangles), spacing)
        if turn > MOST_TURN:
            continue
        error = _between(sample, beam, polarizations, vertical, frequency, spaced(n_pulses, spacing))
        if SAFETY * error <= tolerance:
            return spaced(n_pulses, spacing, SAFETY * error)
    return every(n_pulses)


def _turning(beam: AntennaWeights, places: np.ndarray, spacing: int) -> float:
    """How much u_t + u_r turns over so many pulses at most, rad, as places' middle and farthest ends see it."""
    most = 0.0
    for place in (places.mean(axis=0), places[np.argmin(np.linalg.norm(places - beam.geometry.tx[0], axis=1))]):
        look = unit(beam.geometry.tx - place) + unit(beam.geometry.rx - place)
        most = max(most, float(np.linalg.norm(look[spacing:] - look[:-spacing], axis=1).max()))
    return most


def _between(
    part: Facets,
    beam: AntennaWeights,
    polarizations: Sequence[str],
    vertical: np.ndarray,
    frequency: float,
    knots: Knots,
) -> float:
    """Relative error of amplitudes a quarter, a half and three quarters on from knots here and there."""
    n_pulses, places = len(beam.geometry), centroids(part.triangles)
    wrong = right = 0.0
    made: dict[int, np.ndarray] = {}

    def at(pulse: int) -> np.ndarray:
        if pulse not in made:
            ends = beam.geometry.tx[pulse], beam.geometry.rx[pulse]
            sent = part.amplitudes(*ends, np.array([frequency]), polarizations, vertical)[0]
            made[pulse] = sent * beam.weights(places, pulse, frequency)[:, None]
        return made[pulse]

    starts = np.unique(
        np.linspace(0, n_pulses - 1 - knots.spacing, WINDOWS).astype(int) // knots.spacing * knots.spacing
    )
    for start in starts.tolist():
        for step in (1, 2, 3):
            pulse = start + max(1, step * knots.spacing // 4)
            needed, which, shares = knots.of(pulse, pulse + 1)
            guess = sum(
                share * at(int(needed[which[0, 0] + q])) for q, share in enumerate(shares[0].astype(float).tolist())
            )
            wrong += float((np.abs(guess - at(pulse)) ** 2).sum())
            right += typical_power((np.abs(at(pulse)) ** 2).sum(axis=1))
    return float(np.sqrt(wrong / right)) if right else 0.0
