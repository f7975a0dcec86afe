"""Wan et al. 2004: errors in print, each with its effect on the numbers."""

from __future__ import annotations

import numpy as np

from ...base.constants import SPEED_OF_LIGHT
from ...figures import html
from ...scattering.physical_optics import normals_and_areas
from ...scene.scene import Scene
from ..lab import Lab
from ..paper import Section
from ._radar import l_band

TILT = np.radians(20)
FARTHER = 0.02  # m


def section(lab: Lab) -> Section:
    """Formulas whose terms are wrong, and one trend that contradicts Fresnel's equations."""
    out = Section("errata", "Errors in print")
    out.parts.append(html.listed((
        "Section 4: the phase of an echo from the distance r is exp(-j 4 pi r/lambda); printed is 2 pi.",
        "Section 3.2: the phase of a point rho of a facet is exp(-2j k.rho), with k along the propagation; printed is "
        "+2j.",
        "Section 3.2: R_q is damaged, as in the paper that it cites (`sarcl papers saras`).",
        "Section 6.2: the coefficient is said to fall as the permittivity grows. By Fresnel's equations |R| of H "
        "polarisation grows with it, at any angle.",
    )))  # fmt: skip
    out.say(
        "Two points are choices, not errors. sin(alpha) in the area of a facet is the cosine of its tilt, because the "
        "paper measures alpha from the horizontal plane. Section 5.1 (4) averages the facets that share a cell, where "
        "echoes add up; sarcl keeps their power."
    )
    high = np.tan(TILT)
    square = np.array([[[0, 0, 0], [1, 0, high], [0, 1, 0]], [[1, 0, high], [1, 1, high], [0, 1, 0]]])
    area = float(normals_and_areas(square)[1].sum())
    item = "area of a facet of 1 m x 1 m on the ground, alpha 70 deg"
    out.number(item, "section 3.2", float(1 / np.cos(TILT)), area, 1e-6, "m^2", basis="geometry")
    radar = l_band(4)
    options = {"reference": (0, 0, 0), "range_window": (-20.0, 20.0), "device": lab.device}
    near, farther = (np.asarray(radar.echo(Scene.points([-r * radar.up]), **options).samples) for r in (0.0, FARTHER))
    middle = near.shape[1] // 2
    wave = SPEED_OF_LIGHT / radar.center
    out.number(
        "phase of an echo from 0.02 m farther, L band", "section 4", -2 * np.pi * FARTHER / wave,
        float(np.angle(farther[2, middle] / near[2, middle])), 0.02, "rad", why="the path is travelled twice",
        cause="error in print",
    )  # fmt: skip
    return out
