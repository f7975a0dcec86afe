"""Beams of the last order that are left out before their shadows are cut: together they stay below the tolerance.

    |a| <= k/(2 sqrt(pi)) B A w,    B = 2 sqrt(2)

A   area of the beam on its last facet, m^2
w   product of |R_h| >= |R_v|, reflectivity and what roughness leaves, of all facets but the last
B   |n x H| + |E x n| <= sqrt(2 (|1 - R|^2 + |1 + R|^2)) for each polarisation, |R| <= 1
source     docs/theory/bounces.md
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...base.constants import SPEED_OF_LIGHT
from ...base.vectors import dot, unit
from ...scattering.physical_optics import fresnel
from ._amplitudes import Coatings
from ._beams import Beams

AREA_BOUND = 2 * np.sqrt(2)  # B


def bounds(beams: Beams, coatings: Coatings, frequencies: np.ndarray, n_polarizations: int) -> np.ndarray:
    """Bounds on echoes of beams, m (k,), root sum square over the polarisations, at any of the frequencies, Hz."""
    band = float(frequencies.min()), float(frequencies.max())
    wave, highest = (2 * np.pi * f / SPEED_OF_LIGHT for f in band)  # roughness takes least at the lowest frequency
    is_sheet = np.array([m.thickness > 0 for m in coatings.materials])  # of which |R| <= 1
    eps = np.stack([np.where(is_sheet, np.inf, coatings.permittivity(f)) for f in band])
    center, radius = beams.polygons.spheres
    distance = np.linalg.norm(center - beams.apex, axis=1)
    spread = radius / np.maximum(
        distance - radius, 1e-9 * radius
    )  # rad: other rays differ by less from the central one
    chains, normals = beams.chains[beams.chain], beams.normals[beams.chain]
    ray, weight = unit(center - beams.apex), np.ones(len(beams))
    for number in range(beams.order - 2, -1, -1):
        facet, normal = chains[:, number], normals[:, number]
        ray = ray - 2 * dot(ray, normal)[:, None] * normal
        cosine = np.clip(-dot(ray, normal) - spread, 0, 1)
        loss = (2 * wave * coatings.height[facet] * cosine) ** 2 / 2
        weight *= np.abs(fresnel(cosine, eps[:, coatings.material[facet]])[0]).max(axis=0) * np.exp(-loss)
        weight *= coatings.reflectivity[facet]
    factor = highest / (2 * np.sqrt(np.pi)) * AREA_BOUND * np.sqrt(min(n_polarizations, 2))
    return np.asarray(factor * beams.polygons.area * weight)


def strong(bound: np.ndarray, pulse: np.ndarray, budget: np.ndarray) -> np.ndarray:
    """Numbers, rising (n,), of beams at pulses (k,) less the weakest at each, whose bounds, m (k,), add up to at most a
    budget, m (n_pulses,)."""
    order = np.lexsort((bound, pulse))
    total = np.cumsum(bound[order])
    start = np.searchsorted(pulse[order], np.arange(len(budget)))
    total -= np.append(0.0, total)[start][pulse[order]]
    return np.sort(order[total > budget[pulse[order]]])


@dataclass(eq=False)
class Budget:
    """What weak beams may add up to, over all blocks of beams: power only grows from one block to the next, so that the
    bounds of all that are left out stay below `share` of the root of all power.

    share  relative, 0: none is left out
    power  m^2 (n_pulses,), of the echoes so far, of blocks and orders at random phases
    spent  m (n_pulses,): bounds of the beams left out so far
    """

    coatings: Coatings
    frequencies: np.ndarray
    n_polarizations: int
    share: float
    power: np.ndarray
    spent: np.ndarray

    def strong(self, beams: Beams) -> tuple[Beams, np.ndarray]:
        """Beams less the weak ones, and the bounds of these, m (n_pulses,): not spent yet."""
        none = np.zeros(len(self.spent))
        if not self.share or not self.power.any():
            return beams, none
        bound = bounds(beams, self.coatings, self.frequencies, self.n_polarizations)
        rows = strong(bound, beams.pulse, np.maximum(self.share * np.sqrt(self.power) - self.spent, 0))
        weak = np.delete(np.arange(len(beams)), rows)
        return beams[rows], np.bincount(beams.pulse[weak], bound[weak], len(none))
