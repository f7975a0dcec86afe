"""Farooq 2009: errors in print, each with its effect on the numbers."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...arrays.array_factor import diverse_factor
from ...base.constants import SPEED_OF_LIGHT
from ..paper import Section
from ._aperture import THIN
from ._lab import Lab, decibels, system
from ._pattern import F0, SHAPE, SPACING, STEPS, TIME, directions

SIZES = (0.12, 12.0)  # m, section 5.4, of 9 and 900 elements


def section(lab: Lab) -> Section:
    """Equations that miss a sign or a subscript, figures with the wrong time, a length with the wrong exponent."""
    out = Section.of("farooq", "errata")
    out.list()
    case = system(45, 20e6)
    out.number("half a wave of the centre frequency", case.step)
    sizes = [n * system(n, s).step for n, s in ((9, 100e6), (900, 1e6))]
    out.states(
        "size of 9 and 900 elements", sizes, all(abs(a / b - 1) < 0.1 for a, b in zip(sizes, SIZES, strict=True))
    )
    _poles(out)
    _mirror(out, lab)
    return out


def _poles(out: Section) -> None:
    """Equation 4.1 over all directions, as printed and corrected."""
    angles = np.arange(-84.63, 85.0, 1.0)  # deg; none of them on a pole
    elevation, azimuth = np.meshgrid(np.radians(angles), np.radians(angles), indexing="ij")
    u = directions(azimuth, elevation)
    factor: dict[str, Any] = {"shape": SHAPE, "spacing": SPACING, "frequency_step": STEPS, "retarded": -TIME}
    right = np.abs(diverse_factor(F0, cosines=(u[..., 1], u[..., 2]), **factor)) / 81
    phase = [2 * np.pi * (STEPS[i] * -TIME + F0 * SPACING[i] * u[..., 1 + i] / SPEED_OF_LIGHT) for i in (0, 1)]
    swapped = 2 * np.pi * (STEPS[1] * -TIME + F0 * SPACING[1] * u[..., 1] / SPEED_OF_LIGHT)  # kappa_y for kappa_z
    tops = [np.sin(9 * p / 2) for p in phase]
    printed = np.abs(tops[0] / np.sin(phase[0] / 2) * tops[1] / np.sin(swapped / 2)) / 81
    worst = float(np.nanmax(printed))
    out.states("largest array factor, over N P", worst, worst < 1.01, corrected=right.max())
    for what, level in (("corrected", right), ("as printed, limited to 1", np.minimum(printed, 1.0))):
        out.picture(
            "Equation 4.1", decibels(level, -80), (-85.1, 84.9), (-85.1, 84.9), floor_db=-40, words={"what": what}
        )


def _mirror(out: Section, lab: Lab) -> None:
    """Equation 5.14 as printed and corrected, compared with `map_aperture`."""
    step = 20e6
    case = system(45, step, mirrored=False)
    actual, mapped = lab.collect(case).tx, lab.mapped(case, "apparent").tx
    g = case.step * case.center / step
    towards = -actual
    r = np.linalg.norm(towards, axis=1)
    kx, ky = towards[:, 0] / r, towards[:, 1] / r

    def places(sign: float) -> np.ndarray:
        slope = (towards[:, 1] + g * (1 + sign * ky**2)) / (towards[:, 0] + sign * g * kx * ky)
        return np.asarray(-(r + g * ky) * np.sin(np.arctan(slope)))

    printed, mended = -places(1.0), places(-1.0)
    off = [float(np.abs(y - mapped[:, 1]).max()) for y in (printed, mended)]
    out.states("places along the track, N 45, 20 MHz", off, off[0] < 1.0, mended_mm=1e3 * off[1])
    curves = [("actual", actual[:, 1]), ("as printed", printed), ("corrected", mended)]
    out.plot("Equation 5.14", [(name, actual[::THIN, 1], y[::THIN]) for name, y in curves], dots=True)
