"""Wan et al. 2004: errors in print, each with its effect on the numbers."""

from __future__ import annotations

import numpy as np

from ...base.constants import SPEED_OF_LIGHT
from ...scattering.physical_optics import normals_and_areas
from ...scene.scene import Scene
from ..lab import Lab
from ..paper import Section
from ._radar import l_band

TILT = np.radians(20)
FARTHER = 0.02  # m


def section(lab: Lab) -> Section:
    """Formulas whose terms are wrong, and one trend that contradicts Fresnel's equations."""
    out = Section.of("wan", "errata")
    out.list()
    out.say()
    high = np.tan(TILT)
    square = np.array([[[0, 0, 0], [1, 0, high], [0, 1, 0]], [[1, 0, high], [1, 1, high], [0, 1, 0]]])
    area = float(normals_and_areas(square)[1].sum())
    out.number("area of a facet of 1 m x 1 m on the ground, alpha 70 deg", area, expected=float(1 / np.cos(TILT)))
    radar = l_band(4)
    options = {"reference": (0, 0, 0), "range_window": (-20.0, 20.0), "device": lab.device}
    near, farther = (np.asarray(radar.echo(Scene.points([-r * radar.up]), **options).samples) for r in (0.0, FARTHER))
    middle = near.shape[1] // 2
    wave = SPEED_OF_LIGHT / radar.center
    out.number(
        "phase of an echo from 0.02 m farther, L band",
        float(np.angle(farther[2, middle] / near[2, middle])),
        expected=-2 * np.pi * FARTHER / wave,
    )
    return out
