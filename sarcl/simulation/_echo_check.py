"""What echoes err: random samples recomputed exactly."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ..base.constants import SPEED_OF_LIGHT
from ..numerics.pulse_geometry import PulseGeometry
from ..scattering.antenna_weights import AntennaWeights
from ..scattering.facets import Facets
from ..scattering.scatterers import Points


def measure_error(
    points: Points | None, facets: Facets | None, antennas: PulseGeometry, frequencies: np.ndarray,
    spectrum: np.ndarray, samples: Any, polarizations: Sequence[str], vertical: np.ndarray, beam: AntennaWeights,
) -> float:  # fmt: skip
    """Relative error of 256 random samples (16 random pulses, 16 frequencies each) against the exact sum; of 16 where
    there are more than 20 000 facets, of 4 where there are more than 2 million.

    Relative to the larger of their norm and the norm they would have if scatterers added with random phases. Facets as
    they were cut, each by its centroid's plane wave at every frequency.
    """
    random = np.random.default_rng(0)
    wrong = right = random_phases = 0.0
    draws = how_many(facets)
    for p in random.integers(0, len(samples), draws):
        n = random.integers(0, len(frequencies), draws)
        wanted, power = np.zeros((len(polarizations), draws), np.complex128), np.zeros((len(polarizations), draws))
        for part in (points, facets):
            if part is not None:
                values, powers = exact_samples(part, antennas, int(p), frequencies[n], polarizations, vertical, beam)
                wanted, power = wanted + values, power + powers
        wanted *= spectrum[n]
        wrong += float((np.abs(samples[p][:, n] - wanted) ** 2).sum())
        right += float((np.abs(wanted) ** 2).sum())
        random_phases += float((power * np.abs(spectrum[n]) ** 2).sum())
    return float(np.sqrt(wrong / max(right, random_phases))) if wrong else 0.0


def how_many(facets: Facets | None) -> int:
    """Rows that are looked at, and samples of each."""
    n = 0 if facets is None else len(facets)
    return 16 if n <= 20_000 else 4 if n <= 2_000_000 else 2


def exact_samples(
    part: Points | Facets,
    antennas: PulseGeometry,
    p: int,
    frequencies: np.ndarray,
    polarizations: Sequence[str],
    vertical: np.ndarray,
    beam: AntennaWeights,
) -> tuple[np.ndarray, np.ndarray]:
    """Samples (n_polarizations, n) of pulse p at frequencies, Hz, and the power they have at random phases."""
    from ..reference.echo import echo as exact
    from ..reference.geometry import half_path
    from ..scene.triangles import centroids

    tx, rx = antennas.tx[p], antennas.rx[p]
    places = part.positions if isinstance(part, Points) else centroids(part.triangles)
    away = np.linalg.norm(places - tx, axis=1), np.linalg.norm(places - rx, axis=1)
    delta = (away[0] + away[1]) / 2 - antennas.reference_range[p]
    inside = (delta >= antennas.near[p]) & (delta <= antennas.far[p])
    values = np.zeros((len(polarizations), len(frequencies)), np.complex128)
    powers = np.zeros(values.shape)
    if isinstance(part, Points):
        place = (tx, rx, float(antennas.reference_range[p]))
        same = [i for i, name in enumerate(polarizations) if name[0] == name[1]]
        for j, f in enumerate(frequencies.tolist()):
            a = part.amplitudes * inside * beam.weights(places, p, f)
            values[same, j], powers[same, j] = (
                exact(places, a, frequencies[j : j + 1], *place)[0],
                (np.abs(a) ** 2).sum(),
            )
        return values, powers
    weight = inside * part.share_at(p)
    delay = 2 / np.longdouble(SPEED_OF_LIGHT) * half_path(tx, rx, places, float(antennas.reference_range[p]))
    sent = part.amplitudes(tx, rx, frequencies, polarizations, vertical)
    for j, f in enumerate(frequencies.tolist()):
        wave = np.exp(-2j * np.pi * ((np.longdouble(f) * delay) % 1).astype(np.float64))
        a = sent[j] * (weight * beam.weights(places, p, f))[:, None]
        values[:, j], powers[:, j] = wave @ a, (np.abs(a) ** 2).sum(axis=0)
    return values, powers
