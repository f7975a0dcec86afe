"""SARAS, sections V and VI: the raw signal of a cone (figure 9), its image, and the run time of raw signals."""

from __future__ import annotations

import time
import warnings
from typing import Any

import numpy as np

from ...base.constants import SPEED_OF_LIGHT
from ...base.errors import SarclWarning
from ...figures import html
from ...imaging.compress import compress
from ...imaging.range_doppler.range_doppler import range_doppler
from ...model import pointing
from ...model.antenna import Antenna
from ...model.trajectory import Trajectory
from ...model.waveform import Waveform
from ...scene import shapes
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
CONE = (12.0, 12 * np.tan(LOOK))  # m, radius and height
VAX = {1: 490, 4: 930, 9: 1590, 16: 2480}  # s, section V, on a VAX 3100/30: 8'10", 15'30", 26'30", 41'20"
PIXELS = {True: 128, False: 512}


def figure_9(lab: Lab) -> Section:
    """Figures 9 and 10: the raw signal before range compression, and its image."""
    out = Section("raw", "The raw signal of a cone, and its image (figures 9 and 10)")
    half = 60.0
    flat = ground((-half, half), (-half, half), material=ROUGH)
    scene = (flat + shapes.cone(*CONE, sections=120, material=ROUGH)).moved((DISTANCE, 0, 0))
    track = _track(2 * half)
    window = half * np.sin(LOOK) + SPEED_OF_LIGHT * CHIRP.duration / 4 + 20
    options: dict[str, Any] = {
        "antenna": ANTENNA, "reference": (DISTANCE, 0, 0), "range_window": (-window, window), "compressed": False,
        "tolerance": 1e-2, "check": False, "seed": 1, "device": lab.device,
    }  # fmt: skip
    raw, direct = spectral_echo(scene, CHIRP, track, **options), echo(scene, CHIRP, track, **options)
    samples = np.asarray(direct.samples)
    apart = float(np.linalg.norm(np.asarray(raw.samples) - samples) / np.linalg.norm(samples))
    out.states(
        "raw signal by Fourier transforms and by the sum over facets and pulses", "section IV", "the same signal",
        f"differ by {apart:.1e}", apart < 2e-2, value=apart, rule="below 2e-2, the tolerances of both together",
    )  # fmt: skip
    delay, signal = raw.time_signal()
    real = signal.real / np.abs(signal).max()
    ends = delay * SPEED_OF_LIGHT / 2
    out.draw(html.picture(
        real, (float(ends[0]), float(ends[-1])), (float(raw.tx[0, 1]), float(raw.tx[-1, 1])),
        "range from the middle, m", "azimuth of the antenna, m",
        "Real part of the raw signal, before range compression (figure 9).", floor_db=-1.0, percentile=99.5,
        unit="of the largest amplitude",
    ))  # fmt: skip
    middle, across = float(np.hypot(HEIGHT, DISTANCE)), half * np.sin(LOOK)
    speed = float(np.linalg.norm(track.velocities[0])) if track.velocities is not None else 1.0
    closest = float(track.known_times[0]) + np.array([-half, half]) / speed - track.positions[0, 1] / speed
    image = range_doppler(
        compress(raw), beam=1.5 * WIDTH, side="right", tolerance=1e-2, window="hamming", check=False,
        times=closest, ranges=(middle - across, middle + across), device=lab.device,
    )  # fmt: skip
    power = np.abs(np.asarray(image.data)) ** 2
    out.draw(html.picture(
        10 * np.log10(np.maximum(power, 1e-9 * power.max())), (-across, across), (-half, half),
        "slant range from the middle, m", "azimuth, m", "Range-Doppler image of this raw signal (figure 10).",
        floor_db=-30.0, percentile=99.5,
    ))  # fmt: skip
    return out


def times(lab: Lab) -> Section:
    """Section V: seconds and error of both generators."""
    n = PIXELS[lab.quick]
    out = Section("times", f"Run times of {n} x {n} pixels (section V)")
    rows = []
    for cells in (1, 2, 3, 4):
        side = n * STEP / 2
        scene = ground(
            (-side, side), (DISTANCE - side, DISTANCE + side), (cells * n, cells * n), material=ROUGH
        )  # fmt: skip
        options: dict[str, Any] = {"antenna": ANTENNA, "tolerance": 1e-2, "max_edge": None, "device": lab.device}
        found = []
        for generator in (spectral_echo, echo):
            start = time.perf_counter()
            with warnings.catch_warnings():  # one facet per pixel is too few for speckle, and the paper's choice
                warnings.simplefilter("ignore", SarclWarning)
                raw = generator(scene, CHIRP, _track(2 * side), check=True, **options)
            report = raw.report
            assert report is not None and report.measured_error is not None
            seconds = time.perf_counter() - start - report.seconds.get("check", 0.0)
            found += [seconds, report.measured_error]
        square = cells * cells
        rows.append([str(square), str(VAX[square]), f"{found[0]:.1f}", f"{found[1]:.1e}", f"{found[2]:.1f}",
                     f"{found[3]:.1e}"])  # fmt: skip
        out.states(
            f"{square} facets per pixel", "section V", f"{VAX[square]} s on a VAX 3100/30 for 512 x 512 pixels",
            f"{found[0]:.1f} s by Fourier transforms, {found[2]:.1f} s by the sum, for {n} x {n}",
            max(found[1], found[3]) < 1e-2, value=found, rule="both errors below the tolerance of 1e-2",
        )  # fmt: skip
    out.parts.append(html.table(
        ["facets per pixel", "VAX, 512 x 512, s", "Fourier transforms, s", "error", "sum, s", "error"], rows,
        "Seconds on the device of this run, with echoes and scene, and the measured error against the exact sum.",
    ))  # fmt: skip
    out.say(
        "A pixel is 0.8 m on the ground; a facet of the paper is a square, of which sarcl makes two triangles. The sum "
        "over facets and pulses grows with their product; the Fourier transforms grow with the number of facets."
    )
    return out


def _track(length: float) -> Trajectory:
    """A strip map of a scene of so many metres along the track, and of the beam's width more on both sides."""
    n = int((length + 2.5 * WIDTH * np.hypot(HEIGHT, DISTANCE)) / STEP)
    line = Trajectory.line(start=(0, -n * STEP / 2, HEIGHT), velocity=(0, 100, 0), prf=100 / STEP, n_pulses=n)
    return pointing.stripmap(line, look=float(LOOK), side="right")
