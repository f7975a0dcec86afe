"""Errors of facet amplitudes that are interpolated over the band between few frequencies, from samples of facets.

docs/theory/facets.md derives it; tests/scattering/test_facet_engine.py holds it against facets at random phases.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..base.rows import spread_over
from ..numerics.polynomials import chebyshev
from ..numerics.pulse_geometry import PulseGeometry
from ..scene.scene import Scene
from ..scene.triangles import areas, centroids, edges
from ._facet_sampling import drawn, facets_at
from .antenna_weights import MOST_NODES
from .facets import POLARIZATIONS, FacetSet

FACETS, PULSES, FREQUENCIES = 96, 4, 24
SAFETY = 2.0  # the errors are estimated from samples
BRIGHTEST = 0.1  # of sampled facets, left out of the reference power: 96 samples estimate the brightest tenth badly


def over_band(
    scene: Scene, mirror: np.ndarray, edge: float, finest: float, antennas: PulseGeometry, polarizations: Sequence[str],
    vertical: np.ndarray, center: float, bandwidth: float,
) -> dict[int, list[float]]:  # fmt: skip
    """Relative errors of interpolating amplitudes over f^power between n = 1, 2, ... Chebyshev nodes: {power: [n]} for
    the powers 1 and 0; [0] is not used.

    Facets are cut to edge, m, those that are no mirrors (k,) to finest. The error is that of the worst of four pulses,
    in L2 over up to 96 facets: twice the sum of the Chebyshev coefficients from the n-th on. Mirrors are looked at
    apart: the pieces of a specular one add up in phase, and so do their errors, however many rough facets there are.
    """
    out = {power: [np.inf] + [0.0] * MOST_NODES for power in (1, 0)}
    for which in (mirror, ~mirror):
        if which.any():
            part = _sample(scene, mirror, edge, finest, which)
            for pulses in (PULSES, 16 * PULSES):  # more pulses where these see nothing
                found = _errors(part, antennas, pulses, polarizations, vertical, center, bandwidth)
                if found is not None:
                    out = {power: np.maximum(errors, found[power]).tolist() for power, errors in out.items()}
                    break
    return out


def crossed(
    scene: Scene, mirror: np.ndarray, edge: float, finest: float, antennas: PulseGeometry, polarizations: Sequence[str],
    vertical: np.ndarray, frequency: float,
) -> float:  # fmt: skip
    """Amplitudes in all polarisations over those in `polarizations`, root mean square over sampled facets and pulses,
    where only cross-polarised ones are asked for; else 1. Large where little or nothing is sent back in these: rounding
    in float32 is that of the fields in all of them."""
    if any(name[0] == name[1] for name in polarizations):
        return 1.0
    part, asked, whole = _sample(scene, mirror, edge, finest, np.ones(len(mirror), bool)), 0.0, 0.0
    some = [POLARIZATIONS.index(name) for name in polarizations]
    for pulse in spread_over(len(antennas.tx), 16 * PULSES):
        ends = antennas.tx[pulse], antennas.rx[pulse]
        made = part.amplitudes(*ends, np.array([frequency]), POLARIZATIONS, vertical)
        power = (np.abs(made) ** 2).sum(axis=(0, 1))
        asked, whole = asked + float(power[some].sum()), whole + float(power.sum())
    if not whole:
        return 1.0
    return float(np.sqrt(whole / asked)) if asked else float("inf")


def _errors(
    part: FacetSet, antennas: PulseGeometry, n_pulses: int, polarizations: Sequence[str], vertical: np.ndarray,
    center: float, bandwidth: float,
) -> dict[int, list[float]] | None:  # fmt: skip
    """The same for n_pulses pulses along the track; None where none of them sees a facet."""
    band = chebyshev(center, bandwidth, FREQUENCIES)
    transform = 2 / FREQUENCIES * np.cos(np.outer(np.arange(FREQUENCIES), np.arccos(chebyshev(0, 2, FREQUENCIES))))
    out = {power: [np.inf] + [0.0] * MOST_NODES for power in (1, 0)}
    seen = False
    for pulse in spread_over(len(antennas.tx), n_pulses):
        ends = antennas.tx[pulse], antennas.rx[pulse]
        made = part.amplitudes(*ends, band, polarizations, vertical)
        for power, errors in out.items():
            shaped = made / (band / center)[:, None, None] ** power
            tails = np.cumsum(np.abs(np.tensordot(transform, shaped, 1))[::-1], axis=0)[::-1]
            level = typical_power((np.abs(shaped) ** 2).mean(axis=0).sum(axis=1))
            if level:
                seen = True
                for n in range(1, MOST_NODES + 1):
                    wrong = float(((2 * tails[n]) ** 2).sum())
                    errors[n] = max(errors[n], SAFETY * float(np.sqrt(wrong / level)))
    return out if seen else None


def typical_power(powers: np.ndarray) -> float:
    """Sum of powers (k,) without the brightest tenth."""
    return float(np.sort(powers)[: len(powers) - int(BRIGHTEST * len(powers))].sum())


def _sample(scene: Scene, mirror: np.ndarray, edge: float, finest: float, which: np.ndarray) -> FacetSet:
    """Facets, of those `which` (k,), each shrunk to the size of its pieces after cutting, somewhere on it.

    All count alike: large facets, which are drawn more often, are cut into more pieces.
    """
    random = np.random.default_rng(0)
    some = np.flatnonzero(which)
    some = some[drawn(areas(scene.triangles[some]), FACETS, random)[0]]
    triangles = scene.triangles[some]
    shrink = np.minimum(1.0, np.where(mirror[some], edge, finest) / np.maximum.reduce(edges(triangles)))
    middle = centroids(triangles)[:, None]
    inner = random.dirichlet((1.0, 1.0, 1.0), len(some))
    moved = np.einsum("ni,nij->nj", inner, triangles)[:, None] - middle
    # anywhere where it stays inside the facet
    triangles = middle + (1 - shrink)[:, None, None] * moved + shrink[:, None, None] * (triangles - middle)
    return facets_at(scene, some, triangles)
