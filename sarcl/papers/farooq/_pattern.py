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
    out = Section.of("farooq", "patterns")
    plain = AntennaArray.planar(SHAPE, spacing=SPACING)
    diverse = AntennaArray.planar(SHAPE, spacing=SPACING, frequency_step=STEPS)
    elevation, azimuth = np.meshgrid(np.radians(ANGLES), np.radians(ANGLES), indexing="ij")
    sky = FAR * directions(azimuth, elevation)

    def look(array: AntennaArray, retarded: float) -> tuple[np.ndarray, tuple[float, float]]:
        power = np.abs(beam(array, F0, times=FAR / SPEED_OF_LIGHT + retarded, positions=sky, device=lab.device)) / 81
        row, column = np.unravel_index(int(power.argmax()), power.shape)
        return power, (float(ANGLES[row]), float(ANGLES[column]))

    out.say()
    still, at = look(plain, 0.0)
    out.states("CFA: beam", at, at == (0, 0))
    out.draw(_sky(still, "One carrier (figure 3.3)."))
    for plane, figure, elevated in (("azimuth", "3.5", False), ("elevation", "3.4", True)):
        angle = np.radians(ANGLES)
        u = directions(0 * angle, angle) if elevated else directions(angle, 0.0)
        near, far = (
            np.abs(beam(plain, F0, times=r / SPEED_OF_LIGHT, positions=r * u, device=lab.device)) / 81
            for r in (1e3, 1e5)
        )
        off = float(np.abs(near - far).max())
        out.words = {"plane": plane, "figure": figure}
        out.states("CFA: change with range, 1 to 100 km, along {plane}", off, off < 1e-2)
        curves = [("1 km", ANGLES, decibels(near, -60)), ("100 km", ANGLES, decibels(far, -60))]
        out.plot("One carrier, cut along a plane", curves)
    start, _ = look(diverse, 0.0)
    off = float(np.abs(start - still).max())
    out.states("FDA at t' = 0", off, off < 1e-2)
    out.draw(_sky(start, "Diverse carriers at t' = 0 (figure 3.6)."))
    for sign in (1, -1):
        power, at = look(diverse, sign * TIME)
        holds = at == (30, -60)
        why = {"why": "the beam of figure 3.7"} if holds else {}
        out.states("FDA: beam (elevation, azimuth) at t' = {us:+d} us", at, holds, us=sign * 250, **why)
        out.draw(_sky(power, f"Diverse carriers at t' = {sign * 250:+d} us (figure 3.7)."))
    _over_range(out, diverse, lab)
    return out


def _over_range(out: Section, array: AntennaArray, lab: Lab) -> None:
    """Figures 3.8 and 3.9: principal planes at t = 0, over range."""
    ranges, angle = np.arange(2e3, 302e3, 2e3), np.radians(ANGLES)
    for name, figure, sign, u in (
        ("elevation", "3.8", 1, directions(0 * angle, angle)),
        ("azimuth", "3.9", -1, directions(angle, 0.0)),
    ):
        power = np.abs(beam(array, F0, times=0.0, positions=ranges[:, None, None] * u, device=lab.device)) / 81
        peak = float(ANGLES[int(power[24].argmax())])  # 50 km out
        out.words = {"name": name, "figure": figure, "direction": "positive" if sign > 0 else "negative"}
        out.states("FDA: {name} of the beam at t = 0, 50 km out", peak, np.sign(peak) == sign)
        ends = (0.0, 302.0), (-85.5, 85.5)
        out.picture("Diverse carriers over range", decibels(power.T, -60), *ends, floor_db=-40)


def errors(lab: Lab) -> Section:
    """Figures 3.10 to 3.14."""
    out = Section.of("farooq", "closed form")
    out.say()
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
            F0,
            shape=SHAPE,
            spacing=SPACING,
            frequency_step=(step, 0),
            cosines=(np.sin(azimuth), 0.0),
            retarded=t[:, None],
        )
        exact, approximate = (closed.power_pattern(f, 81) for f in (field, factor))
        apart = np.abs(exact - approximate).max(axis=0)
        curves.append((f"{step / 1e6:g} MHz", degrees, apart))
        worst, where = float(apart.max()), abs(float(degrees[apart.argmax()]))
        text = f"{worst:.3f} ({10 * np.log10(worst):.2f} dB) at +-{where:.0f} deg"
        if name == "A":
            out.states("largest error of the power pattern, 30 MHz", worst, worst < 0.05, measured=text)
        else:
            out.number("largest error of the power pattern, 150 MHz", 10 * np.log10(worst), text=text)
            at20 = float(apart[np.isclose(degrees, 20)][0])
            at45 = float(apart[np.isclose(degrees, 45)][0])
            out.states("error inside +-45 deg, 150 MHz", at20, at20 < 0.1, at_45=at45)
        figures = ("3.10", "3.11") if name == "A" else ("3.12", "3.13")
        for what, power, figure in zip(("Exact", "Closed-form"), (exact, approximate), figures, strict=True):
            out.words = {"what": what, "mhz": step / 1e6, "figure": figure}
            db = np.maximum(10 * np.log10(np.maximum(power, 1e-9)), -60).T
            out.picture("Power pattern", db, (0.0, 1e9 / step), (-90.0, 90.0), floor_db=-20)
        out.keep(**{f"error, {step / 1e6:g} MHz": {"deg": degrees[::4], "error": apart[::4]}})
    bound = closed.quadratic_phase(shape=SHAPE, spacing=(0.015, 0.015), frequency_step=(30e6, 0), cosines=(1, 0))
    out.number("quadratic phase of scenario A", bound, expected=np.pi / 4)
    steep = closed.quadratic_phase(
        shape=SHAPE, spacing=(0.015, 0.015), frequency_step=(150e6, 0), cosines=(np.sin(np.pi / 4), 0)
    )
    out.number("quadratic phase of scenario B at 45 deg", steep / (np.pi / 4))
    out.plot("Difference of the patterns", curves)
    return out


def _sky(power: np.ndarray, caption: str) -> html.Block:
    edge = (-85.5, 85.5)
    return html.picture(decibels(power, -60), edge, edge, "azimuth, deg", "elevation, deg", caption, floor_db=-30)
