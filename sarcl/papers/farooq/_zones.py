"""Range zones separated by carriers that continue from pulse to pulse (sarcl's own experiment, range_zones.py)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ...figures import html
from ...opencl.device import DeviceChoice
from ...scene.scene import Scene
from ..paper import Section
from ._lab import Lab, decibels
from .range_zones import RangeZones, amplitudes, collect, isolation, leak

ZONES = 4
BEYOND = (-45.0, -15.0, 15.0, 45.0)  # m, distance of each zone's point behind the centre of the zone
FLOOR = -60.0  # dB, lowest level plotted


def section(lab: Lab) -> Section:
    """Isolation of four zones; how it depends on the carrier step and on the direction."""
    out = Section.of("farooq", "zones")
    radar = RangeZones()
    step, prf, depth = radar.step / 1e3, radar.prf / 1e3, radar.depth / 1e3
    out.say("principle", radar=radar, step=step, prf=prf, depth=depth, cycles=step / prf)
    systems = {"running carriers": radar, "one carrier": replace(radar, step=0.0)}
    places = np.linspace(-70, 70, 281)
    for name, system in systems.items():
        cuts = cuts_of(system, places, lab.device)
        levels = matrix(system, lab.device)
        title = f"{name[0].upper()}{name[1:]}"
        out.say("levels", title=title)
        rows = [[f"point of zone {p}", *(f"{round(v, 1) + 0.0:.1f}" for v in row)] for p, row in enumerate(levels)]
        out.draw(html.table(["", *(f"image of zone {q}" for q in range(ZONES))], rows))
        curves = [(f"zone {q}", places, decibels(c, FLOOR)) for q, c in enumerate(cuts)]
        out.plot("Images of the four zones", curves, title=title)
        off = levels[~np.eye(ZONES, dtype=bool)]
        out.keep(**{name: {"levels_db": levels, "best_other_db": off.min(), "worst_other_db": off.max()}})
    _sweeps(out, radar, lab)
    out.say()
    return out


def cuts_of(radar: RangeZones, at: np.ndarray, device: DeviceChoice | None = None) -> list[np.ndarray]:
    """Amplitudes (n,) of each zone's image, `at` m (n,) behind its centre, with a unit point in every zone."""
    record = collect(radar, [Scene.points([radar.place(q, b)]) for q, b in enumerate(BEYOND)], device)
    weights = np.hamming(record.n_samples)
    record = replace(record, samples=(record.samples * (weights / weights.mean())).astype(np.complex64))
    return [amplitudes(radar, record, q, at, device=device) for q in range(ZONES)]


def matrix(radar: RangeZones, device: DeviceChoice | None = None) -> np.ndarray:
    """Levels (point, image), dB: the highest within 5 m of each zone's point in each image, over its own image."""
    out = np.empty((ZONES, ZONES))
    for p, beyond in enumerate(BEYOND):
        empty: list[Scene | None] = [None] * p
        record = collect(radar, [*empty, Scene.points([radar.place(p, beyond)])], device)
        places = beyond + np.linspace(-5, 5, 41)
        out[p] = [amplitudes(radar, record, q, places, device=device).max() for q in range(ZONES)]
    return np.asarray(20 * np.log10(np.maximum(out / np.diag(out)[:, None], 1e-9)))


def _sweeps(out: Section, radar: RangeZones, lab: Lab) -> None:
    """Isolation of the next zone against df/PRF and against direction, measured and predicted."""
    short = replace(radar, n_pulses=2)
    turns, lines = np.linspace(0.02, 0.48, 12), np.linspace(0.005, 0.495, 197)
    angles, fine = np.linspace(-35, 35, 15), np.linspace(-35, 35, 281)
    cycles = np.floor(radar.step / radar.prf)

    def stepped(turn: float) -> RangeZones:
        return replace(short, step=(cycles + turn) * short.prf)

    for name, x, measured, xs, predicted, axis in (
        ("df over PRF", turns, [leak(stepped(t), 1, device=lab.device) for t in turns], lines,
         [isolation(stepped(t), 1) for t in lines], "df/PRF, fractional part"),
        ("direction", angles, [leak(short, 1, np.radians(a), lab.device) for a in angles], fine,
         [isolation(short, 1, np.radians(a)) for a in fine], "elevation of the echo, deg"),
    ):  # fmt: skip
        same = [isolation(stepped(v), 1) if name == "df over PRF" else isolation(short, 1, np.radians(v)) for v in x]
        clear = np.array(same) > FLOOR
        error = float(np.abs(np.array(measured) - same)[clear].max())
        out.keep(**{name: {"at": x, "measured_db": measured, "predicted_db": same, "largest_error_db": error}})
        curves = [("predicted", xs, np.maximum(predicted, FLOOR)), ("measured", x, np.maximum(measured, FLOOR))]
        out.plot("Isolation of the next zone", curves, dots=("measured",), axis=axis, name=name, error=error)
