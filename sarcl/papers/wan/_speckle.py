"""Wan et al. 2004, section 6.1: amplitudes and phases of rough ground (figure 3)."""

from __future__ import annotations

import numpy as np

from ...scene.material import Material
from ..far_radar import ground, speckle
from ..lab import SIGNIFICANT, Lab, histogram, rayleigh, tested
from ..paper import Section
from ._radar import l_band

ROUGHNESS, EPS = 0.15, 3.0  # m (no unit is printed), section 6.1
SIDES = (0.5, 0.75)  # m, of the squares of two facets: 227 and 101 facets per resolution cell
CELLS = {True: 40, False: 96}
CHANCE = 1.63  # over the root of the number of pixels: exceeded by chance once in 100 (Kolmogorov and Smirnov)
FINITE = 0.01  # difference of distribution functions that a finite number of facets per cell may cause


def section(lab: Lab) -> Section:
    """Figure 3."""
    out = Section.of("wan", "speckle")
    n = CELLS[lab.quick]
    radar = l_band(round(1.3 * n))
    ends = [(-n * null / 2, n * null / 2) for null in radar.null]
    curves, phases, statistics = [], [], []
    for side in SIDES:
        cells = [round(n * null / side) for null in radar.null]
        scene = ground(ends[0], ends[1], cells, material=Material(eps_r=EPS), point_roughness=ROUGHNESS)
        raw = radar.echo(scene, shadows=False, seed=1, device=lab.device)
        pixels = radar.focus(raw, radar.grid((n, n)), device=lab.device)[2:-2, 2:-2].ravel()
        statistics.append(speckle(pixels))
        facets = round(2 * np.prod(cells) / n**2)
        curves.append(
            (f"{facets} facets per cell", *histogram(np.abs(pixels / np.sqrt((np.abs(pixels) ** 2).mean())), 3.0))
        )
        levels, density = histogram(np.angle(pixels) + np.pi, 2 * np.pi, 16)
        phases.append((f"{facets} facets per cell", levels - np.pi, density))
    many, few = statistics
    most = FINITE + CHANCE / np.sqrt(len(pixels))
    out.states("amplitudes", many.difference, many.difference < most, most=most, finite=FINITE)
    out.states("phases", many.uniform, many.uniform > SIGNIFICANT, verdict=tested(many.uniform))
    out.keep(contrast=many.contrast, contrast_of_few=few.contrast, difference_of_few=few.difference)
    levels = curves[0][1]
    out.plot("Amplitudes of the image's resolution cells", [*curves, ("Rayleigh", levels, rayleigh(levels))])
    out.plot(
        "Phases of the image's resolution cells",
        [*phases, ("uniform", phases[0][1], np.full(16, 1 / (2 * np.pi)))],
        limits=(None, (0, 1 / np.pi)),  # from no density to twice the uniform one
    )
    (many_facets, *_), (few_facets, *_) = curves
    out.say(few=few, many=many, few_facets=few_facets, many_facets=many_facets)
    return out
