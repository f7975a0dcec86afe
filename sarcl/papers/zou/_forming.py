"""Zou et al. 2021, figure 8: waveform forming against a run of the grid for every azimuth."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...base.text import duration
from ..paper import Section
from ._lab import TOLERANCE, Lab, report_of

BRICK, CONE = "cuboid", "sharp cone"
N_AZIMUTHS = 16
FINE = 0.05  # difference that counts as not significant


@dataclass(frozen=True, eq=False)
class Comparison:
    """Echoes in HH at some pulses: errors against a run for each, and times.

    angle     azimuth from the middle of the track, rad (n,)
    one, own  error of one anchor and of several, each over the rms of the echoes of that azimuth (n,)
    totals    errors of both over all azimuths;  seconds  of a run for each azimuth, of one anchor
    """

    angle: np.ndarray
    one: np.ndarray
    own: np.ndarray
    totals: tuple[float, float]
    seconds: tuple[float, float]


def section(lab: Lab) -> Section:
    """Figure 8."""
    out = Section.of("zou", "forming", n_azimuths=N_AZIMUTHS, fine=FINE, tolerance=TOLERANCE)
    n, times = len(lab.radar.track), []
    for name in (BRICK, CONE):
        errors = compared(lab, name)
        report, plan = report_of(lab.full_wave(name))
        anchors, one, own = len(plan["anchors"]), *errors.totals
        out.words |= {"name": name, "anchors": anchors, "predicted": report.predicted_error}
        source, worst = "figure 8" if name == BRICK else "section 4", errors.one.max()
        out.states("{name}: one anchor against one run per azimuth", one, one < FINE, source=source, worst=worst)
        item = "{name}: {anchors} anchors against one run per azimuth"
        out.states(item, own, own < TOLERANCE, worst=errors.own.max())
        degrees = np.degrees(errors.angle)
        curves = [("one anchor, as in the paper", errors.one), (f"{anchors} anchors", errors.own)]
        curves_db = [(label, degrees, 20 * np.log10(np.maximum(error, 1e-6))) for label, error in curves]
        out.plot("Error of waveform forming at each azimuth", curves_db)
        own_seconds = sum(report.seconds.values())
        seconds = errors.seconds[0] * n, errors.seconds[1], own_seconds
        times.append([name, *map(duration, seconds), f"{seconds[0] / own_seconds:.0f}"])
        out.keep(**{name: {
            "azimuth_deg": degrees, "one_anchor": errors.one, "own_anchors": errors.own, "totals": errors.totals,
            "seconds_per_azimuth": errors.seconds[0], "seconds_one_anchor": errors.seconds[1], "anchors": anchors,
            "seconds_own": own_seconds, "predicted": report.predicted_error,
        }})  # fmt: skip
    out.table("Time of all {n} pulses", times, n=n, n_runs=N_AZIMUTHS + 1)
    return out


def azimuths(n_pulses: int, anchors: np.ndarray) -> np.ndarray:
    """Numbers of N_AZIMUTHS pulses over the whole track, in pairs about the middle; none is an anchor."""
    half = np.linspace(0, (n_pulses - 1) / 2, N_AZIMUTHS + 1)[1::2]
    excluded = set(np.concatenate([anchors, n_pulses - 1 - anchors]).tolist())
    rows = [
        next(r for r in (*range(row, -1, -1), *range(row, n_pulses)) if r not in excluded)
        for row in half.astype(int).tolist()
    ]
    return np.unique(np.concatenate([rows, n_pulses - 1 - np.array(rows)]))


def compared(lab: Lab, name: str) -> Comparison:
    """A target by one anchor in the middle and by those of the lab's echoes, against a run for every azimuth."""
    raw = lab.full_wave(name).select(polarization="HH")
    track, n = lab.radar.track, len(lab.radar.track)
    rows = azimuths(n, np.array(report_of(raw)[1]["anchors"]))
    pulses = np.union1d(rows, [n // 2])
    middle = int(np.searchsorted(pulses, n // 2))
    picked, seconds, echoes = track.picked(pulses), [], []
    for label, anchors in (("azimuths", list(range(len(pulses)))), ("one", [middle])):
        run = lab.run(name, picked, "HH", label, anchors=anchors, model_error=False)
        seconds.append(sum(report_of(run)[0].seconds.values()))
        echoes.append(np.delete(run.read(0, run.n_rows), middle, axis=0))
    exact, own = echoes[0], raw.read(0, n)[rows]
    norm = np.linalg.norm(exact, axis=1)
    total = float(np.linalg.norm(norm))
    positions = track.positions[rows]
    errors = [np.linalg.norm(run - exact, axis=1) for run in (echoes[1], own)]
    return Comparison(
        np.arctan2(positions[:, 1], np.hypot(positions[:, 0], positions[:, 2])),
        errors[0] / norm,
        errors[1] / norm,
        (float(np.linalg.norm(errors[0])) / total, float(np.linalg.norm(errors[1])) / total),
        (seconds[0] / len(pulses), seconds[1]),
    )
