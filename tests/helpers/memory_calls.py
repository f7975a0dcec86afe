"""Many calls of one verb after another, in this process, and by how much its resident memory grew.

`python -m helpers.memory_calls CALLS [VERB ...]`, from the folder tests, prints a line of JSON for each verb.
"""

from __future__ import annotations

import ctypes
import gc
import json
import os
import sys
import tempfile
import time
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

import sarcl
from sarcl.experiments import fda
from sarcl.experiments.fda import file as fda_file
from sarcl.scenario.scenario import loads

from .cases import noise_on, straight
from .scenario_cases import SCENARIO

EXPERIMENT = """[fda]
n = 16
frequency_step = 50e6
n_pulses = 44
aperture = 43.0
distance = 500.0
points = [0.0, 0.63]
separations = [0.2, 0.3]
"""


def verbs(folder: Path) -> dict[str, Callable[[], Any]]:
    """Small calls, a few milliseconds each, of everything that computes, reads or writes."""
    raw = noise_on(straight(32, aperture=10.0), n_samples=48, time=np.linspace(0, 0.1, 32))
    grid = sarcl.ImageGrid.plane(shape=(24, 24), spacing=0.2)
    chirp = sarcl.Waveform.chirp(center=9e9, bandwidth=1e8, duration=1e-6)
    track = sarcl.Trajectory.line(start=(-700, -1, 700), velocity=(0, 1, 0), prf=8.0, n_pulses=16)
    points, box = sarcl.Scene.points([[0.0, 0, 0], [1, 2, 0]]), sarcl.shapes.box((0.05, 0.04, 0.03))
    array = sarcl.AntennaArray.linear(3, spacing=0.015, frequency_step=1e6)
    tones = sarcl.echo(
        points, sarcl.Waveform.tone(center=1e10, duration=1e-6), track, array=array, reference=(0, 0, 0), check=False
    )
    chirps = sarcl.echo(points, chirp, track, check=False)
    image = sarcl.backproject(raw, grid, check=False)
    sharp = sarcl.backproject(
        sarcl.PhaseHistory(np.ones((64, 64), np.complex64), frequency=9e9, frequency_step=5e6,
                           tx=(turn := straight(64, aperture=500.0, distance=1e3)),
                           reference_range=np.linalg.norm(turn, axis=1)),
        sarcl.ImageGrid.plane(shape=(96, 96), spacing=(0.01, 0.15)), check=False,
    )  # fmt: skip
    orbit = sarcl.Orbit.kepler(7e6, 0.001, 1.7, span=(-100, 100))
    heights = np.random.default_rng(0).random((8, 9))
    model = sarcl.ElevationModel(12 + np.arange(9) * 1e-3, 42 + np.arange(8) * 1e-3, heights)
    experiment = folder / "experiment.toml"
    experiment.write_text(EXPERIMENT)
    long_waves = sarcl.Waveform.chirp(center=1.25e9, bandwidth=1e8, duration=2e-8)
    full = {"cells": 10, "model_error": False, "tolerance": 0.1}
    looks = sarcl.Trajectory(None, [[40.0, 0, 0]])
    scenario = loads(SCENARIO)
    h5, png, pixels = folder / "a.h5", folder / "a.png", folder / "b.h5"

    def files() -> None:
        raw.save(h5)
        assert sarcl.read(h5).samples[3:5].any()

    return {
        "backproject": lambda: sarcl.backproject(raw, grid, check=False),
        "backproject, factorized": lambda: sarcl.backproject(
            raw, grid, method="factorized", tolerance=0.05, check=False
        ),
        "backproject, float64": lambda: sarcl.backproject(raw, grid, tolerance=1e-8, check=False),
        "backproject to a file": lambda: sarcl.backproject(raw, grid, out=pixels, resume=True, check=False),
        "plan": lambda: sarcl.plan(raw, grid),
        "polar_format": lambda: sarcl.polar_format(raw, grid, check=False),
        "range_doppler": lambda: sarcl.range_doppler(raw, side="right", check=False),
        "autofocus": lambda: sarcl.autofocus(raw, grid, places=8),
        "echo, points": lambda: sarcl.echo(points, chirp, track, check=False),
        "echo, facets": lambda: sarcl.echo(box, chirp, track, check=False),
        "echo, array": lambda: sarcl.echo(points, chirp, track, array=array, channels="separated", check=False),
        "echo to a file": lambda: sarcl.echo(points, chirp, track, out=h5, check=False),
        "fullwave_echo": lambda: sarcl.fullwave_echo(box, long_waves, looks, **full),
        "plan fullwave_echo": lambda: sarcl.plan(sarcl.fullwave_echo, box, long_waves, looks, **full),
        "spectral_echo": lambda: sarcl.spectral_echo(points, chirp, track, check=False),
        "plan_echo": lambda: sarcl.plan(sarcl.echo, points, chirp, track),
        "compress": lambda: sarcl.compress(sarcl.echo(points, chirp, track, compressed=False, check=False)),
        "map_aperture": lambda: sarcl.map_aperture(tones, "corrected"),
        "fda": lambda: fda.run(fda_file.load(experiment)[1]),
        "beam": lambda: sarcl.beam(array, 1e10, times=[0.0], positions=np.ones((20, 3)) * 1e3),
        "measure": lambda: sarcl.measure(sharp),
        "multilook": lambda: image.multilook((2, 3)),
        "picture": lambda: image.save(png),
        "files": files,
        "add_noise": lambda: sarcl.add_noise(raw, variance=1.0).samples[2:5],
        "from_time": lambda: sarcl.PhaseHistory.from_time(
            np.ones((4, 64)) + 0j, rate=1e8, carrier=9e9, tx=np.ones((4, 3))
        ),
        "concatenate": lambda: sarcl.concatenate([raw, raw]).samples[3:40],
        "doppler_centroid": lambda: sarcl.doppler_centroid(raw),
        "stop_and_go": lambda: sarcl.stop_and_go.stop_and_go_error(track, [[0.0, 0, 0]], chirp),
        "pulse_motion": lambda: sarcl.stop_and_go.pulse_motion(chirps, (0, 0, 0)).samples[2:5],
        "devices": sarcl.devices,
        "motion": lambda: sarcl.motion.perturbed(track, rms=0.1, correlation_time=1.0, seed=3),
        "illumination": lambda: sarcl.illumination.lit(box.triangles, track.positions),
        "scenario": lambda: loads(scenario.dumps()).simulate(check=False),
        "orbit": lambda: orbit.geolocate([0.0, 1.0], 8.5e5, heights=0.0),
        "elevation model": lambda: sarcl.ImageGrid.on_terrain(model, 30.0),
        "split": lambda: sarcl.shapes.sphere(1.0, facets=80).split(0.2),
        "ambiguity": lambda: sarcl.ambiguity(np.ones(64) + 0j, 1e6),
    }


def resident() -> int:
    """Resident memory of this process without its file pages, bytes, after garbage and free pages are given back."""
    gc.collect()
    ctypes.CDLL(None).malloc_trim(0)
    with open("/proc/self/statm") as file:
        _, total, shared = map(int, file.read().split()[:3])
    return (total - shared) * os.sysconf("SC_PAGE_SIZE")


def measured(call: Callable[[], Any], calls: int) -> dict[str, float]:
    """Resident memory, bytes, after a half and all of the calls, and CPU seconds of a call."""
    for _ in range(calls - calls // 2):
        call()
    half, start = resident(), time.process_time()
    for _ in range(calls // 2):
        call()
    seconds = (time.process_time() - start) / (calls // 2)
    return {"calls": calls, "half": half, "growth": resident() - half, "seconds": seconds}


def main(calls: int, names: list[str]) -> None:
    warnings.simplefilter("ignore")
    with tempfile.TemporaryDirectory() as folder:
        known = verbs(Path(folder))
        for name in names or known:
            print(json.dumps({"verb": name, **measured(known[name], calls)}), flush=True)


if __name__ == "__main__":
    main(int(sys.argv[1]), sys.argv[2:])
