"""Farooq 2009: errors in print, each with its effect on the numbers."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...arrays.array_factor import diverse_factor
from ...base.constants import SPEED_OF_LIGHT
from ...figures import html
from ..paper import Section
from ._aperture import THIN
from ._lab import Lab, decibels, system
from ._pattern import F0, SHAPE, SPACING, STEPS, TIME, directions

SIZES = (0.12, 12.0)  # m, section 5.4, of 9 and 900 elements


def section(lab: Lab) -> Section:
    """Equations that miss a sign or a subscript, figures with the wrong time, a length with the wrong exponent."""
    out = Section("errata", "Errors in print")
    words = (
        "Figure 3.7: the beam at (30, -60) deg belongs to retarded time -250 us. At +250 us equations 3.53 and 3.54, "
        "and the exact field, have (-30, 60). Figures 3.8 and 3.9 have it right.",
        "Equations 3.39 and 3.40 look at the corner (N, P), where steps of opposite signs cancel; along the edges they "
        "do not. Equation 3.40 gives twice what 3.59 has, since the steps along y meet the elements along z as well.",
        "Figure 3.14: within 45 deg the closed form differs by up to 0.60 of the peak power, which is "
        "significant; equation 3.60 itself has 3.5 times the phase that 3.40 allows.",
        "Equations 4.1 and 4.30: in the denominators dk_y and dk_z, and kappa_z and kappa_y, have changed places. At "
        "r' = 0 numerator and denominator no longer vanish together, and the factor has poles.",
        "Equation 4.27 leaves out the phase n^2 dk d sin(azimuth), whose linear part moves the peak to "
        "f0 + (N - 1) df: 8.8 to 9.0 % more at the imaging systems.",
        "Equations 5.9 to 5.14: the minus in front mirrors the aperture, and 1 + kappa^2 should be 1 - kappa^2, with a "
        "minus in the denominator: theta = atan{[(Yc - Ry) + g (1 - ky^2)]/[(Xc - Rx) - g kx ky]}, g = d f0/df.",
        "Equation 5.15 uses the offset c dt of a two-way path as a range; half of it is right. The printed lengths, "
        "445, 502 and 574 m, follow with the full offset.",
        "Section 5.4: lambda_c/2 is 0.0144 m, not 0.14 m; the sizes printed beside it, 0.12 and 12 m, go with 0.0144.",
        "Figure 5.5: with -2 MHz from f0 = 10 GHz the centre frequency is 9.55 GHz, as section 5.3.1 says, and 430 m "
        "resolve 0.182 m, not 0.167.",
        "Equation 5.36 expects nulls of 0.143 and 0.125 m for apertures with a gap: they are closer to the peak, with "
        "side lobes of -7.8 and -5.1 dB.",
        "Abstract: a 33 % longer aperture saves 25 % of the time, and 4.5 dB is 20 log10 of the 1 MHz case's length, "
        "or of the 2 MHz case's nulls.",
    )
    out.parts.append(html.listed(words))
    case = system(45, 20e6)
    item = "half a wave of the centre frequency"
    out.number(
        item, "section 5.4", 0.14, case.step, 1e-3, "m", ".4f", "a zero is missing: 0.014 m", cause="error in print"
    )
    sizes = [n * system(n, s).step for n, s in ((9, 100e6), (900, 1e6))]
    out.states(
        "size of 9 and 900 elements", "section 5.4", "0.12 and 12 m", f"{sizes[0]:.2f} and {sizes[1]:.1f} m",
        all(abs(a / b - 1) < 0.1 for a, b in zip(sizes, SIZES, strict=True)), "with 0.0144 m", sizes,
        rule="within 10 %",
    )  # fmt: skip
    _poles(out)
    _mirror(out, lab)
    return out


def _poles(out: Section) -> None:
    """Equation 4.1 over all directions, as printed and corrected."""
    angles = np.arange(-84.63, 85.0, 1.0)  # deg; none of them on a pole
    elevation, azimuth = np.meshgrid(np.radians(angles), np.radians(angles), indexing="ij")
    u = directions(azimuth, elevation)
    given: dict[str, Any] = {"shape": SHAPE, "spacing": SPACING, "frequency_step": STEPS, "retarded": -TIME}
    right = np.abs(diverse_factor(F0, cosines=(u[..., 1], u[..., 2]), **given)) / 81
    phase = [2 * np.pi * (STEPS[i] * -TIME + F0 * SPACING[i] * u[..., 1 + i] / SPEED_OF_LIGHT) for i in (0, 1)]
    swapped = 2 * np.pi * (STEPS[1] * -TIME + F0 * SPACING[1] * u[..., 1] / SPEED_OF_LIGHT)  # kappa_y for kappa_z
    tops = [np.sin(9 * p / 2) for p in phase]
    printed = np.abs(tops[0] / np.sin(phase[0] / 2) * tops[1] / np.sin(swapped / 2)) / 81
    worst = float(np.nanmax(printed))
    item = "largest array factor, over N P"
    source = "equations 3.46 and 4.1"
    measured = f"poles as printed, {worst:.0f} on a grid of 1 deg; {right.max():.3f} mended"
    why = "a denominator has kappa_y instead of kappa_z"
    out.states(item, source, "1", measured, worst < 1.01, why, worst, rule="at most 1.01", cause="error in print")
    for what, level in (("corrected", right), ("as printed, limited to 1", np.minimum(printed, 1.0))):
        caption = f"Equation 4.1 {what}, t' = -250 us."
        out.picture(
            decibels(level, -80), (-85.1, 84.9), (-85.1, 84.9), "azimuth, deg", "elevation, deg", caption, floor_db=-40
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
    item = "places along the track, N 45, 20 MHz"
    expected = "an aperture moved in the negative direction"
    measured = f"as printed mirrored, up to {off[0]:.0f} m off; mended the same to {1e3 * off[1]:.1g} mm"
    why = "the figures show it right: they were not made with the minus"
    rule = "within 1 m of the mapped positions"
    out.states(item, "equation 5.14", expected, measured, off[0] < 1.0, why, off, rule=rule, cause="error in print")
    curves = [("actual", actual[:, 1]), ("as printed", printed), ("corrected", mended)]
    y_name = "position backprojected from, m"
    caption = "Equation 5.14 as printed and corrected, N 45, 20 MHz."
    out.plot(
        [(name, actual[::THIN, 1], y[::THIN]) for name, y in curves], "actual position, m", y_name, caption, dots=True
    )
