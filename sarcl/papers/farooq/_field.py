"""Farooq 2009, section 4.4: a pulse whose delay depends on the direction."""

from __future__ import annotations

import numpy as np

from ...arrays import array_factor as closed
from ...arrays.beam import beam
from ...base.constants import SPEED_OF_LIGHT
from ...model.antenna_array import AntennaArray
from ..paper import Section
from ._lab import Lab, decibels
from ._pattern import directions
from ._pulse import F0, FAR, HALF_WAVE, STEP, N

PRINTED = 0.35  # ns, figures 4.11 and 4.12


def delays(lab: Lab) -> Section:
    """Equation 4.27, figures 4.10 to 4.12."""
    out = Section.of("farooq", "delay")
    out.say()
    array = AntennaArray.linear(N, spacing=-HALF_WAVE, frequency_step=STEP)
    t = np.linspace(-0.5e-9, 0.5e-9, 4001)
    curves, exact_curves = [], []
    for degrees in (-45, 0, 45):
        azimuth = np.radians(degrees)
        level = np.abs(closed.waveform(F0, N, spacing=-HALF_WAVE, frequency_step=STEP, azimuth=azimuth, retarded=t))
        positions = FAR * directions(np.array([azimuth]), 0.0)
        times = FAR / SPEED_OF_LIGHT + t
        exact = np.abs(beam(array, F0, times=times, positions=positions, device=lab.device))[:, 0]
        curves.append((f"{degrees} deg", 1e9 * t, level))
        exact_curves.append((f"{degrees} deg", 1e9 * t, exact))
        if degrees:
            delay = 1e9 * t[level.argmax()]
            figure = "4.11" if degrees > 0 else "4.12"
            out.words = {"degrees": degrees, "figure": figure}
            out.number("delay of the peak at {degrees:+d} deg, closed form", delay, expected=PRINTED * np.sign(degrees))
    peak = float(exact_curves[2][2].max())
    bound = closed.quadratic_phase(shape=(N, 1), spacing=(HALF_WAVE, 0), frequency_step=(STEP, 0), cosines=(1, 0))
    out.states("the same in the exact field: a peak at +45 deg", peak, peak > 0.9 * N, n=N, ratio=bound / (np.pi / 4))
    _systems(out, lab)
    out.plot("Closed form in three directions", curves)
    out.plot("The exact field in the same directions", exact_curves)
    return out


def _systems(out: Section, lab: Lab) -> None:
    """Delay and height of the exact peak at the end of the imaging apertures, relative to those of the closed form."""
    azimuth = np.arctan(215 / 5000)
    rows = []
    for n, step in ((45, 20e6), (225, 4e6), (450, 2e6)):
        geometry = {"spacing": -0.015, "frequency_step": step, "azimuth": azimuth}
        plain, predicted = float(closed.peak_delay(F0, **geometry)), float(closed.peak_delay(F0, **geometry, n=n))
        t = predicted + np.linspace(-1, 1, 2001) / (n * step)
        array = AntennaArray.linear(n, spacing=-0.015, frequency_step=step)
        positions = FAR * directions(np.array([azimuth]), 0.0)
        times = FAR / SPEED_OF_LIGHT + t
        modulus = np.abs(beam(array, F0, times=times, positions=positions, device=lab.device))[:, 0]
        delay = float(t[modulus.argmax()])
        offset = SPEED_OF_LIGHT / 2 * (delay - plain)
        longer = delay / plain
        out.words = {"n": n, "mhz": step / 1e6, "ns": 1e9 * delay, "printed_ns": 1e9 * plain, "range_mm": 1e3 * offset}
        out.states(
            "delay at the aperture's end, N {n}, {mhz:g} MHz", longer, abs(longer - 1) < 0.02, more=100 * (longer - 1)
        )
        rows.append([f"N {n}, {step / 1e6:g} MHz", f"{delay / plain:.4f}", f"{predicted / plain:.4f}",
                     f"{1e3 * offset:.0f}", f"{modulus.max() / n:.4f}"])  # fmt: skip
    out.table("Delays of the systems", rows)


def snapshots(lab: Lab) -> Section:
    """Figures 4.9 and 4.13: the travelling pulse over a plane."""
    out = Section.of("farooq", "snapshots")
    out.say()
    x, y = np.linspace(0.0, 1.6, 161), np.linspace(-1.2, 1.2, 241)
    place = np.stack([*np.meshgrid(x, y, indexing="ij"), np.zeros((len(x), len(y)))], axis=-1)
    distance = np.linalg.norm(place, axis=-1)
    azimuth = np.arctan2(place[..., 1], place[..., 0])
    array = AntennaArray.linear(N, spacing=-HALF_WAVE, frequency_step=STEP)
    edges = (float(y[0]), float(y[-1])), (float(x[0]), float(x[-1]))
    for ns in (1, 2, 3):
        t = ns * 1e-9
        retarded = t - distance / SPEED_OF_LIGHT
        gate = np.abs(retarded) <= 0.5 / STEP
        exact = np.abs(beam(array, F0, times=t, positions=place, device=lab.device)) * gate
        out.picture("Exact field", decibels(exact / N, -60), *edges, floor_db=-15, words={"ns": ns})
        if ns == 2:
            level = np.abs(
                closed.waveform(F0, N, spacing=-HALF_WAVE, frequency_step=STEP, azimuth=azimuth, retarded=retarded)
            )
            late = out.parts.pop()
            out.draw(late)
            out.picture("Closed form", decibels(level * gate / N, -60), *edges, floor_db=-15)
            _orders(out, level * gate, distance, azimuth)
            _normals(out, decibels(level * gate / N, -60), edges)
    return out


def _normals(out: Section, level: np.ndarray, edges: tuple[tuple[float, float], tuple[float, float]]) -> None:
    """Normals of the surfaces of uniform phase and of uniform amplitude at an azimuth of 30 deg, 2 ns (figure 4.13)."""
    step, angle, width = 1e-3, np.radians(30), HALF_WAVE * F0 / STEP  # m: the peak is delayed by width sin(azimuth)/c

    def peak(azimuth: float) -> np.ndarray:
        r = 2e-9 * SPEED_OF_LIGHT - width * np.sin(azimuth)
        return r * np.array([np.cos(azimuth), np.sin(azimuth)])

    at, along = peak(angle), (peak(angle + step) - peak(angle - step)) / (2 * step)
    radial = at / np.linalg.norm(at)
    across = np.array([along[1], -along[0]]) / np.linalg.norm(along)
    apart = float(np.degrees(np.arccos(np.clip(radial @ across, -1, 1))))
    out.states("directions of uniform phase and of uniform amplitude at 30 deg, 2 ns", apart, apart > 5)
    rays = [
        (name, [at[1], at[1] + 0.4 * d[1]], [at[0], at[0] + 0.4 * d[0]])
        for name, d in (("normal of uniform phase", radial), ("normal of uniform amplitude", across))
    ]
    out.picture("Closed form normals", level, *edges, floor_db=-15, lines=rays)


def _orders(out: Section, level: np.ndarray, distance: np.ndarray, azimuth: np.ndarray) -> None:
    """Distance of the closed form's brightest part from the middle of the pulse, m, in three directions, at 2 ns."""
    middle = 2e-9 * SPEED_OF_LIGHT
    places = []
    for degrees in (-45, 0, 45):
        near = np.where(np.abs(azimuth - np.radians(degrees)) < 0.02, level, 0)
        places.append(float(distance.flat[int(near.argmax())] - middle))
    measured = ", ".join(f"{1e2 * p:+.1f} cm" for p in places)
    holds = places[0] > 0.05 > abs(places[1]) and places[2] < -0.05
    out.states("brightest place at -45, 0, 45 deg, 2 ns", places, holds, measured=measured)
