"""Farooq 2009, chapter 3: patterns of planar arrays with one and with diverse carriers; error of the closed form."""

from __future__ import annotations

import numpy as np

from ...arrays import array_factor as closed
from ...arrays.beam import beam
from ...base.constants import SPEED_OF_LIGHT
from ...figures import html
from ...model.antenna_array import AntennaArray
from ..paper import Section
from ._lab import Lab, decibels

F0, SHAPE = 10e9, (9, 9)  # tables 3.1 to 3.3
HALF_WAVE = SPEED_OF_LIGHT / F0 / 2
SPACING = (-HALF_WAVE, -HALF_WAVE)  # elements at -n d, equation 3.1
STEPS, TIME = (1.5e3, -1e3), 250e-6  # table 3.2
FAR = 10e3  # m
ANGLES = np.arange(-85.0, 86.0, 1.0)  # deg


def directions(azimuth: np.ndarray, elevation: np.ndarray | float) -> np.ndarray:
    """Unit vectors (..., 3) of angles, rad."""
    azimuth, level = np.broadcast_arrays(azimuth, np.cos(elevation))
    return np.stack(
        [level * np.cos(azimuth), level * np.sin(azimuth), np.broadcast_to(np.sin(elevation), level.shape)], axis=-1
    )


def patterns(lab: Lab) -> Section:
    """Figures 3.3 to 3.9."""
    out = Section("patterns", "Patterns of 9 x 9 elements (tables 3.1 and 3.2, figures 3.3 to 3.9)")
    plain = AntennaArray.planar(SHAPE, spacing=SPACING)
    diverse = AntennaArray.planar(SHAPE, spacing=SPACING, frequency_step=STEPS)
    elevation, azimuth = np.meshgrid(np.radians(ANGLES), np.radians(ANGLES), indexing="ij")
    sky = FAR * directions(azimuth, elevation)

    def look(array: AntennaArray, retarded: float) -> tuple[np.ndarray, tuple[float, float]]:
        power = np.abs(beam(array, F0, times=FAR / SPEED_OF_LIGHT + retarded, positions=sky, device=lab.device)) / 81
        row, column = np.unravel_index(int(power.argmax()), power.shape)
        return power, (float(ANGLES[row]), float(ANGLES[column]))

    still, at = look(plain, 0.0)
    rule = "that direction, on a grid of 1 deg"
    out.states(
        "CFA: beam", "figure 3.3, equations 3.29, 3.30", "(0, 0) deg", _deg(at), at == (0, 0), value=at, rule=rule
    )
    figures = [_sky(still, "One carrier (figure 3.3).")]
    for plane, figure, elevated in (("azimuth", "3.5", False), ("elevation", "3.4", True)):
        angle = np.radians(ANGLES)
        u = directions(0 * angle, angle) if elevated else directions(angle, 0.0)
        near, far = (
            np.abs(beam(plain, F0, times=r / SPEED_OF_LIGHT, positions=r * u, device=lab.device)) / 81
            for r in (1e3, 1e5)
        )
        off = float(np.abs(near - far).max())
        item = f"CFA: change with range, 1 to 100 km, along {plane}"
        rule = "below 0.01 of the peak"
        out.states(item, f"figure {figure}", "none", f"{off:.1e} of the peak", off < 1e-2, value=off, rule=rule)
        figures.append(html.plot(
            [("1 km", ANGLES, decibels(near, -60)), ("100 km", ANGLES, decibels(far, -60))], f"{plane}, deg", "dB",
            f"One carrier, cut along {plane} at two ranges (figure {figure}).",
        ))  # fmt: skip
    start, _ = look(diverse, 0.0)
    off = float(np.abs(start - still).max())
    measured = f"differs by {off:.1e}"
    rule = "below 0.01 of the peak"
    out.states("FDA at t' = 0", "figure 3.6", "identical to the CFA", measured, off < 1e-2, value=off, rule=rule)
    figures.append(_sky(start, "Diverse carriers at t' = 0 (figure 3.6)."))
    for sign in (1, -1):
        power, at = look(diverse, sign * TIME)
        holds = at == (30, -60)
        out.states(
            f"FDA: beam (elevation, azimuth) at t' = {sign * 250:+d} us", "figure 3.7, printed for +250 us",
            "(30, -60) deg", _deg(at), holds,
            "the beam of figure 3.7" if holds else "equations 3.53 and 3.54 give this too: the figure shows -250 us",
            value=at,
            rule="that direction, on a grid of 1 deg", cause="error in print",
        )  # fmt: skip
        figures.append(_sky(power, f"Diverse carriers at t' = {sign * 250:+d} us (figure 3.7)."))
    _over_range(out, figures, diverse, lab)
    out.say(
        "Exact fields of all 81 elements at 10 km. Element n is at -n d, as in equation 3.1. Figures 3.8 and 3.9 are "
        "taken at t = 0, where t' = -r/c: the field farther out was sent earlier, and there the paper's signs are "
        "right."
    )
    out.draw(*figures)
    return out


def _over_range(out: Section, figures: list[html.Block], array: AntennaArray, lab: Lab) -> None:
    """Figures 3.8 and 3.9: principal planes at t = 0, over range."""
    ranges, angle = np.arange(2e3, 302e3, 2e3), np.radians(ANGLES)
    for name, figure, sign, u in (
        ("elevation", "3.8", 1, directions(0 * angle, angle)),
        ("azimuth", "3.9", -1, directions(angle, 0.0)),
    ):
        power = np.abs(beam(array, F0, times=0.0, positions=ranges[:, None, None] * u, device=lab.device)) / 81
        peak = float(ANGLES[int(power[24].argmax())])  # 50 km out
        item = f"FDA: {name} of the beam at t = 0, 50 km out"
        expected = f"scans toward {'positive' if sign > 0 else 'negative'} {name}"
        rule = "sign of the angle"
        out.states(item, f"figure {figure}", expected, f"{peak:+.0f} deg", np.sign(peak) == sign, value=peak, rule=rule)
        figures.append(html.picture(
            decibels(power.T, -60), (0.0, 302.0), (-85.5, 85.5), "range, km", f"{name}, deg",
            f"Diverse carriers at t = 0 over range (figure {figure}).", floor_db=-40,
        ))  # fmt: skip


def errors(lab: Lab) -> Section:
    """Figures 3.10 to 3.14."""
    out = Section("closed form", "The closed form against the exact pattern (table 3.3, figures 3.10 to 3.14)")
    out.say(
        "Largest difference of the two power patterns over one period in time, relative to the peak power. The closed "
        "form leaves out a phase that grows with the square of the element's number and vanishes at broadside only."
    )
    azimuth = np.radians(np.linspace(-90, 90, 361))
    degrees = np.degrees(azimuth)
    curves = []
    for name, step in (("A", 30e6), ("B", 150e6)):
        array = AntennaArray.planar(SHAPE, spacing=SPACING, frequency_step=(step, 0))
        t = np.linspace(0, 1 / step, 401)
        field = beam(
            array, F0, times=1e7 / SPEED_OF_LIGHT + t, positions=1e7 * directions(azimuth, 0.0), device=lab.device
        )
        factor = closed.diverse_factor(
            F0, shape=SHAPE, spacing=SPACING, frequency_step=(step, 0), cosines=(np.sin(azimuth), 0.0),
            retarded=t[:, None],
        )  # fmt: skip
        exact, approximate = (closed.power_pattern(f, 81) for f in (field, factor))
        apart = np.abs(exact - approximate).max(axis=0)
        curves.append((f"{step / 1e6:g} MHz", degrees, apart))
        worst, where = float(apart.max()), abs(float(degrees[apart.argmax()]))
        text = f"{worst:.3f} ({10 * np.log10(worst):.2f} dB) at +-{where:.0f} deg"
        if name == "A":
            item = "largest error of the power pattern, 30 MHz"
            why = "the figures show the top 3 dB; near +-90 deg the patterns differ by a fifth of the peak"
            rule = "below 0.05 of the peak power"
            expected = "not appreciable"
            out.states(item, "figure 3.11", expected, text, worst < 0.05, why, worst, rule=rule, cause="interpretation")
        else:
            item = "largest error of the power pattern, 150 MHz"
            out.number(item, "figure 3.14", -1.2, 10 * np.log10(worst), 0.06, "dB", ".2f", f"{text}")
            at20 = float(apart[np.isclose(degrees, 20)][0])
            item = "error inside +-45 deg, 150 MHz"
            measured = f"{at20:.2f} at 20 deg, {float(apart[np.isclose(degrees, 45)][0]):.2f} at 45 deg"
            why = "equation 3.60 itself gives 3.5 pi/4 at 45 deg; equation 3.40 allows pi/4"
            rule = "below 0.1 of the peak power at 20 deg"
            expected = "not significant"
            out.states(
                item, "figure 3.14", expected, measured, at20 < 0.1, why, at20, rule=rule, cause="interpretation"
            )
        figures = ("3.10", "3.11") if name == "A" else ("3.12", "3.13")
        out.draw(*(
            html.picture(
                np.maximum(10 * np.log10(np.maximum(p, 1e-9)), -60).T, (0.0, 1e9 / step), (-90.0, 90.0), "t', ns",
                "azimuth, deg", f"{what} power pattern, {step / 1e6:g} MHz (figure {figure}).", floor_db=-20,
            )
            for what, p, figure in zip(("Exact", "Closed-form"), (exact, approximate), figures, strict=True)
        ))  # fmt: skip
        out.keep(**{f"error, {step / 1e6:g} MHz": {"deg": degrees[::4], "error": apart[::4]}})
    bound = closed.quadratic_phase(shape=SHAPE, spacing=(0.015, 0.015), frequency_step=(30e6, 0), cosines=(1, 0))
    out.number("quadratic phase of scenario A", "equation 3.59", np.pi / 4, bound, 0.03, "rad")
    steep = closed.quadratic_phase(
        shape=SHAPE, spacing=(0.015, 0.015), frequency_step=(150e6, 0), cosines=(np.sin(np.pi / 4), 0)
    )
    out.number("quadratic phase of scenario B at 45 deg", "equation 3.60", 3.5, steep / (np.pi / 4), 0.1, "pi/4", ".2f")
    out.plot(curves, "azimuth, deg", "difference", "Difference of the patterns (figure 3.14).")
    return out


def _sky(power: np.ndarray, caption: str) -> html.Block:
    edge = (-85.5, 85.5)
    return html.picture(decibels(power, -60), edge, edge, "azimuth, deg", "elevation, deg", caption, floor_db=-30)


def _deg(at: tuple[float, float]) -> str:
    return f"({at[0]:.0f}, {at[1]:.0f}) deg"
