"""Errors of facet amplitudes that are interpolated over the band between few frequencies, from samples of facets.

docs/theory/facets.md derives it; tests/scattering/test_facet_engine.py holds it against facets at random phases.
"""

from __future__ import annotations

import numpy as np

from ..base.rows import spread_over
from ..numerics.polynomials import chebyshev
from ..scene.triangles import areas, centroids, edges
from ._facet_sampling import drawn, facets_at
from .antenna_weights import MOST_NODES
from .facet_kinds import FacetView
from .facets import POLARIZATIONS, FacetSet

FACETS, PULSES, FREQUENCIES = 96, 4, 24
SAFETY = 2.0  # the errors are estimated from samples
BRIGHTEST = 0.1  # of sampled facets, left out of the reference power: 96 samples estimate the brightest tenth badly


class OverBand:
    """Relative errors of interpolating amplitudes over f^power between n = 1, 2, ... Chebyshev nodes.

    The error is that of the worst of four pulses, in L2 over up to 96 facets: twice the sum of the Chebyshev
    coefficients from the n-th on. Mirrors are looked at apart: the pieces of a specular one add up in phase, and so do
    their errors, however many rough facets there are.
    """

    def __init__(self, view: FacetView, finest: float, apart: np.ndarray) -> None:
        """finest  m, edges to which facets are cut that are no mirrors;  apart  those (k,) bool that do not count"""
        self.view, self.finest, rough = view, finest, ~view.mirror & ~apart
        self._rough = self._sampled(finest, rough) if rough.any() else {}

    def errors(self, edge: float) -> dict[int, list[float]]:
        """Errors where mirrors are cut to `edge`, m: {power: [n]} for the powers 1 and 0; [0] is not used."""
        out = {power: [np.inf] + [0.0] * MOST_NODES for power in (1, 0)}
        mirrors = self._sampled(edge, self.view.mirror) if self.view.mirror.any() else {}
        for part in (mirrors, self._rough):
            out |= {power: np.maximum(out[power], errors).tolist() for power, errors in part.items()}
        return out

    def _sampled(self, edge: float, which: np.ndarray) -> dict[int, list[float]]:
        """Errors of facets `which` (k,) cut to an edge, m; {} where no pulse sees any."""
        part = _sample(self.view, edge, self.finest, which)
        for pulses in (PULSES, 16 * PULSES):  # more pulses where these see nothing
            sampled = _errors(part, self.view, pulses)
            if sampled is not None:
                return sampled
        return {}


def cross_polarization_ratio(view: FacetView, edge: float, finest: float) -> float:
    """Amplitudes in all polarisations over those in the ones of the view, root mean square over sampled facets and
    pulses, where these are all cross-polarised; else 1. Large where little or nothing is sent back in these: rounding
    in float32 is that of the fields in all of them."""
    if any(name[0] == name[1] for name in view.polarizations):
        return 1.0
    part, antennas = _sample(view, edge, finest, np.ones(len(view.mirror), bool)), view.antennas
    columns, cross_power, total_power = [POLARIZATIONS.index(name) for name in view.polarizations], 0.0, 0.0
    for pulse in spread_over(len(antennas.tx), 16 * PULSES):
        ends = antennas.tx[pulse], antennas.rx[pulse]
        amplitudes = part.amplitudes(*ends, np.array([view.center]), POLARIZATIONS, view.vertical)
        powers = (np.abs(amplitudes) ** 2).sum(axis=(0, 1))
        cross_power += float(powers[columns].sum())
        total_power += float(powers.sum())
    if not total_power:
        return 1.0
    return float(np.sqrt(total_power / cross_power)) if cross_power else float("inf")


def _errors(part: FacetSet, view: FacetView, n_pulses: int) -> dict[int, list[float]] | None:
    """Errors as `over_band` returns them, for n_pulses pulses along the track; None where none of them sees a facet."""
    band, antennas = chebyshev(view.center, view.bandwidth, FREQUENCIES), view.antennas
    transform = 2 / FREQUENCIES * np.cos(np.outer(np.arange(FREQUENCIES), np.arccos(chebyshev(0, 2, FREQUENCIES))))
    out = {power: [np.inf] + [0.0] * MOST_NODES for power in (1, 0)}
    seen = False
    for pulse in spread_over(len(antennas.tx), n_pulses):
        ends = antennas.tx[pulse], antennas.rx[pulse]
        amplitudes = part.amplitudes(*ends, band, view.polarizations, view.vertical)
        for power, errors in out.items():
            shaped = amplitudes / (band / view.center)[:, None, None] ** power
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


def _sample(view: FacetView, edge: float, finest: float, which: np.ndarray) -> FacetSet:
    """Facets, of those `which` (k,), each shrunk to the size of its pieces after cutting, somewhere on it.

    All count alike: large facets, which are drawn more often, are cut into more pieces.
    """
    scene, random = view.scene, np.random.default_rng(0)
    some = np.flatnonzero(which)
    some = some[drawn(areas(scene.triangles[some]), FACETS, random)[0]]
    triangles = scene.triangles[some]
    shrink = np.minimum(1.0, np.where(view.mirror[some], edge, finest) / np.maximum.reduce(edges(triangles)))
    middle = centroids(triangles)[:, None]
    inner = random.dirichlet((1.0, 1.0, 1.0), len(some))
    moved = np.einsum("ni,nij->nj", inner, triangles)[:, None] - middle
    # anywhere where it stays inside the facet
    triangles = middle + (1 - shrink)[:, None, None] * moved + shrink[:, None, None] * (triangles - middle)
    return facets_at(scene, some, triangles)
