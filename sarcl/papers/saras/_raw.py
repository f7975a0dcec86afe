"""SARAS, sections V and VI: the raw signal of a cone (figure 9), its image, and the run time of raw signals."""

from __future__ import annotations

import time
import warnings
from typing import Any

import numpy as np

from ...base.constants import SPEED_OF_LIGHT
from ...base.errors import SarclWarning
from ...imaging.compress import compress
from ...imaging.range_doppler.range_doppler import range_doppler
from ...model import pointing
from ...model.antenna import Antenna
from ...model.phase_history import PhaseHistory
from ...model.trajectory import Trajectory
from ...model.waveform import Waveform
from ...scene.scene import Scene
from ...simulation.echo import echo
from ...simulation.spectral.spectral_echo import spectral_echo
from ..far_radar import ground
from ..lab import Lab
from ..paper import Section
from ._ground import ROUGH

LOOK, HEIGHT = np.radians(50), 6e3  # of the antenna, m
DISTANCE = HEIGHT * np.tan(LOOK)  # m on the ground
CHIRP = Waveform.chirp(center=9.6e9, bandwidth=150e6, duration=0.5e-6)
STEP, WIDTH = 0.8, 0.012  # m between pulses; rad, beam along the track
ANTENNA = Antenna.gaussian(width=(WIDTH, 0.3))
CONE = (12.0, 12 * float(np.tan(LOOK)))  # m, radius and height
SIDE, CELL = 120.0, 0.4  # m, of the field and of a facet: four facets per pixel of 0.8 m, as in section VI
SIGMA = 0.1 * SPEED_OF_LIGHT / CHIRP.center  # m, standard deviation of the heights (section VI)
RAW_TOLERANCE = 1e-2  # relative error of the raw signals of section V
PAPER_TOLERANCE = 0.05  # of the paper's generator, which is less accurate
VAX = {1: 490, 4: 930, 9: 1590, 16: 2480}  # s, section V, on a VAX 3100/30: 8'10", 15'30", 26'30", 41'20"
PIXELS = {True: 64, False: 512}


def figure_9(lab: Lab) -> Section:
    """Figures 9 and 10: the raw signal before range compression, by both generators, and its image."""
    out = Section.of("saras", "raw")
    half = SIDE / 2
    scene, track = _cone(), _track(SIDE)
    window = half * np.sin(LOOK) + SPEED_OF_LIGHT * CHIRP.duration / 4 + 20
    options: dict[str, Any] = {
        "antenna": ANTENNA, "reference": (DISTANCE, 0, 0), "range_window": (-window, window), "compressed": False,
        "max_edge": None, "check": False, "seed": 1, "device": lab.device,
    }  # fmt: skip
    raw, direct = (make(scene, CHIRP, track, tolerance=1e-2, **options) for make in (spectral_echo, echo))
    paper = spectral_echo(scene, CHIRP, track, variant="saras", tolerance=PAPER_TOLERANCE, **options)
    difference, of_paper = (_apart(samples, direct) for samples in (raw, paper))
    out.states("raw signal by Fourier transforms and by the sum over facets and pulses", difference, difference < 2e-2)
    footprint = WIDTH * np.hypot(HEIGHT, DISTANCE)
    order = SPEED_OF_LIGHT / CHIRP.center * np.hypot(HEIGHT, DISTANCE) / (2 * np.pi * footprint**2)
    holds = order / 5 < of_paper < 5 * order
    out.states("error of the paper's transfer function, by stationary phase", of_paper, holds, order=order)
    _show_raw(out, raw, window)
    _show_image(out, lab, raw, track)
    look = np.degrees(LOOK)
    out.say(height_km=HEIGHT / 1e3, look_deg=look, side=SIDE, cone=CONE, cone_width=2 * CONE[0], cell=CELL, step=STEP)
    return out


def _cone() -> Scene:
    """A cone on flat ground as a height profile, with random heights of the grid points."""
    axis = np.linspace(-SIDE / 2, SIDE / 2, round(SIDE / CELL) + 1)

    def height(x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return np.maximum(CONE[1] * (1 - np.hypot(x, y) / CONE[0]), 0)

    return Scene.from_heights(axis, axis, height, material=ROUGH, point_roughness=SIGMA).moved((DISTANCE, 0, 0))


def _apart(one: PhaseHistory, other: PhaseHistory) -> float:
    """Norm of the difference of samples over the norm of the other's."""
    samples = np.asarray(other.samples)
    return float(np.linalg.norm(np.asarray(one.samples) - samples) / np.linalg.norm(samples))


def _show_raw(out: Section, raw: PhaseHistory, window: float) -> None:
    """Real part over range and azimuth, where there is a signal."""
    delay, signal = raw.time_signal()
    ranges, azimuth = delay * SPEED_OF_LIGHT / 2, np.asarray(raw.tx)[:, 1]
    columns = np.abs(ranges) < window - 20
    rows = np.abs(azimuth) < SIDE / 2 + WIDTH * np.hypot(HEIGHT, DISTANCE) / 2
    real = signal.real[np.ix_(rows, columns)] / np.abs(signal).max()
    top = float(np.percentile(np.abs(real), 99))
    ends, unit = (_edges(ranges[columns]), _edges(azimuth[rows])), "of the largest modulus"
    values = np.clip(real, -top, top)
    out.picture("Real part of the raw signal", values, *ends, floor_db=-2 * top, unit=unit, equal=True)


def _show_image(out: Section, lab: Lab, raw: PhaseHistory, track: Trajectory) -> None:
    """Figure 10, and where the side of the cone that faces the radar lies in it."""
    middle, across, half = float(np.hypot(HEIGHT, DISTANCE)), SIDE / 2 * np.sin(LOOK), SIDE / 2
    assert track.velocities is not None
    closest = track.known_times[0] + (np.array([-half, half]) - track.positions[0, 1]) / track.velocities[0, 1]
    image = range_doppler(
        compress(raw), azimuth_beam=1.5 * WIDTH, side="right", tolerance=1e-2, window="hamming", check=False,
        times=closest, ranges=(middle - across, middle + across), device=lab.device,
    )  # fmt: skip
    power = np.abs(np.asarray(image.data)) ** 2
    assert image.grid.times is not None and image.grid.ranges is not None
    ranges, azimuth = image.grid.ranges - middle, (image.grid.times - closest.mean()) * track.velocities[0, 1]
    profile = power[np.abs(azimuth) < 2].mean(axis=0)
    front = -CONE[0] * float(np.sin(LOOK))  # the whole line from foot to tip lies at one range
    cell, brightest = SPEED_OF_LIGHT / 2 / CHIRP.bandwidth, float(ranges[profile.argmax()])
    item = "brightest slant range of the cone in the range-Doppler image"
    out.number(item, brightest, expected=front, within=1.5 * cell)
    db = 10 * np.log10(np.maximum(power / np.median(power), 1e-9))
    look: dict[str, Any] = {"floor_db": -30.0, "percentile": 99.5, "equal": True}
    out.picture("Range-Doppler image of this raw signal", db, _edges(ranges), _edges(azimuth), **look)


def _edges(middles: np.ndarray) -> tuple[float, float]:
    """Edges of the first and the last of evenly spaced pixels from their middles, m (n,)."""
    half = (middles[1] - middles[0]) / 2
    return float(middles[0] - half), float(middles[-1] + half)


def times(lab: Lab) -> Section:
    """Section V: seconds and error of both generators."""
    n = PIXELS[lab.quick]
    out = Section.of("saras", "times", n=n)
    rows, worst = [], 0.0
    for cells in (1, 2, 3, 4):
        side = n * STEP / 2
        scene = ground((-side, side), (DISTANCE - side, DISTANCE + side), (cells * n, cells * n), material=ROUGH)
        options: dict[str, Any] = {"antenna": ANTENNA, "max_edge": None, "device": lab.device}
        results = []
        for generator in (spectral_echo, echo):
            start = time.perf_counter()
            with warnings.catch_warnings():  # one facet per pixel is too few for speckle, and the paper's choice
                warnings.simplefilter("ignore", SarclWarning)
                raw = generator(scene, CHIRP, _track(2 * side), tolerance=RAW_TOLERANCE, check=True, **options)
            report = raw.report
            assert report is not None and report.measured_error is not None
            seconds = time.perf_counter() - start - report.seconds.get("check", 0.0)
            results += [seconds, report.measured_error]
        square = cells * cells
        measured = [f"{value:{form}}" for value, form in zip(results, (".1f", ".1e", ".1f", ".1e"), strict=True)]
        rows.append([str(square), str(VAX[square]), *measured])
        out.keep(**{f"{square} facets per pixel: seconds and errors": results})
        worst = max(worst, results[1], results[3])
    out.table("Seconds on the device of this run", rows)
    out.states("largest error of the timed raw signals", worst, worst <= RAW_TOLERANCE, raw_tolerance=RAW_TOLERANCE)
    out.say()
    return out


def _track(length: float) -> Trajectory:
    """A strip map of a scene of so many metres along the track, and of the beam's width more on both sides."""
    n = int((length + 2.5 * WIDTH * np.hypot(HEIGHT, DISTANCE)) / STEP)
    line = Trajectory.line(start=(0, -n * STEP / 2, HEIGHT), velocity=(0, 100, 0), prf=100 / STEP, n_pulses=n)
    return pointing.stripmap(line, look=float(LOOK), side="right")
