"""SHA-256 hashes of what sarcl computes on one OpenCL device, to prove that a change of the code changed no output.

    python bench/output_hashes.py -o FILE.json           compute every task, write the hashes
    python bench/output_hashes.py --compare FILE.json    compute them again; exit 1 and name each task that differs
    python bench/output_hashes.py --list                 names of the tasks
    options: --device NAME (default: the device that sarcl chooses), --only TEXT (tasks whose name holds TEXT)

Exit status: 0 equal (or written), 1 different, 2 the file is of another machine, driver or library version.

Only public names are used (of `sarcl`, `sarcl.shapes`, `.pointing` and `.motion`, and `python -m sarcl`), so that the
script runs unchanged whatever modules are called. It takes about two minutes on two cores with kernels built before.

Each task is hashed under several names: `task/samples`, `task/geometry`, `task/data`, `task/report` (numbers of the
report: tolerance, predicted and measured error, contributions done and skipped, seed) and `task/plan` (words and
numbers of the plan). Arrays are hashed with dtype and shape, floats to the last bit. Hashes are comparable only on one
machine with one driver, NumPy, SciPy and Python: the file records these, and --compare refuses a file of others.

Left out because they depend on the clock: `report.seconds`, `Forecast.seconds`, the seconds in `Forecast.cheaper`, and
those in the plan of a forecast. The clock also decides whether `check=None` measures an error (so every task says
check=True or False), and how often finished tiles are written to "PATH.parts" before an image is complete (no pixel
depends on it).
No plan depends on the clock: the planner's costs are constants in the code.

Left out because it follows from names and comments of kernels too: the mark of the job ("job") in an image's file.

Left out because no public name reaches them: devices as if they had no float64, or one lane (the tests cover these).
Left out because not every machine has them: Gotcha files, elevation models (rasterio), dask workers.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import platform
import subprocess
import sys
import tempfile
import warnings
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import scipy

import sarcl

C = 299792458.0
Parts = Mapping[str, Any]
TASKS: dict[str, Callable[[], Parts]] = {}
RAW = (
    "frequency", "frequency_step", "tx", "rx", "reference_range", "time", "tx_channel", "rx_channel", "polarization",
    "weight", "tx_velocity", "rx_velocity", "compressed",
)  # fmt: skip
REPORT = ("tolerance", "predicted_error", "measured_error", "contributions_done", "contributions_skipped", "seed")


# ---- what is hashed


def leaves(value: Any) -> Iterator[bytes]:
    """The bytes that a value follows from: arrays with dtype and shape, floats to the last bit, the rest as text."""
    if isinstance(value, Mapping):
        for key in sorted(value, key=str):
            yield f"key {key}".encode()
            yield from leaves(value[key])
    elif isinstance(value, (list, tuple)):
        yield f"{len(value)} items".encode()
        for item in value:
            yield from leaves(item)
    elif isinstance(value, np.ndarray) and value.dtype.kind not in "OUST":
        yield f"{value.dtype.str} {value.shape}".encode()
        yield np.ascontiguousarray(value).tobytes()
    elif isinstance(value, np.ndarray):
        yield from leaves([str(item) for item in value.ravel().tolist()])
    elif isinstance(value, np.generic):
        yield from leaves(value.item())
    elif value is None or isinstance(value, (bool, int, float, complex, str)):
        yield repr(value).encode()
    else:
        raise TypeError(f"a task returned a {type(value).__name__}, which has no hash; return arrays, numbers or text")


def digest(value: Any) -> str:
    made = hashlib.sha256()
    for part in leaves(value):
        made.update(len(part).to_bytes(8, "little") + part)
    return made.hexdigest()


def of_report(report: Any) -> dict[str, Any]:
    if report is None:
        return {}
    return {"report": {name: getattr(report, name) for name in REPORT}, "plan": report.plan}


def of_raw(raw: sarcl.PhaseHistory) -> dict[str, Any]:
    samples = np.asarray(raw.samples[0 : raw.n_rows])
    return {"samples": samples, "geometry": {n: getattr(raw, n) for n in RAW}, **of_report(raw.report)}


def of_image(image: sarcl.Image) -> dict[str, Any]:
    return {"data": np.asarray(image.data), "gain": image.gain, **of_report(image.report)}


def of_hdf5(path: Any) -> dict[str, Any]:
    """Every dataset and attribute of an HDF5 file, but for the report, which holds seconds, and the mark of the job."""
    import h5py

    found: dict[str, Any] = {}

    def visit(name: str, item: Any) -> None:
        found.update({f"{name}@{key}": value for key, value in item.attrs.items() if key != "job"})
        if isinstance(item, h5py.Dataset) and name != "report":
            value = item[()]
            found[name] = value.decode() if isinstance(value, bytes) else value

    with h5py.File(path, "r") as file:
        visit("", file)
        file.visititems(visit)
    return found


def task(name: str) -> Callable[[Callable[[], Parts]], Callable[[], Parts]]:
    """Register a task: a function that returns {part: value}."""

    def register(made: Callable[[], Parts]) -> Callable[[], Parts]:
        assert name not in TASKS, name
        TASKS[name] = made
        return made

    return register


def table(make: Callable[..., Any], read: Callable[[Any], Parts], cases: Mapping[str, Mapping[str, Any]]) -> None:
    """Register a task for each case: `read(make(**options))`. An option that is a function is called first."""

    def one(options: Mapping[str, Any]) -> Callable[[], Parts]:
        return lambda: read(make(**{k: v() if callable(v) else v for k, v in options.items()}))

    for name, options in cases.items():
        task(name)(one(options))


# ---- echoes


def chirp(**changes: Any) -> sarcl.Waveform:
    return sarcl.Waveform.chirp(**{"center": 9.6e9, "bandwidth": 200e6, "duration": 1e-6, **changes})


def sampled() -> sarcl.Waveform:
    t = np.arange(64) - 31.5
    return sarcl.Waveform.sampled(np.exp(1j * np.pi * t**2 / 80) * np.hanning(64), 150e6, 9.6e9)


def circle(n: int = 24, **changes: Any) -> sarcl.Trajectory:
    return sarcl.Trajectory.circle(
        **{"radius": 8e3, "height": 6e3, "arc": 0.02, "n_pulses": n, "prf": 100.0, "center": (0, 0, 0), **changes}
    )


def passing(n: int = 12, height: float = 800.0) -> sarcl.Trajectory:
    y = np.linspace(-150, 150, n)
    return sarcl.Trajectory(np.arange(n) / 10, np.stack([np.full(n, -5e3), y, 0 * y + height], axis=1))


def cloud(n: int = 150, half: float = 12.0) -> sarcl.Scene:
    random = np.random.default_rng(3)
    places = random.uniform(-half, half, (n, 3)) * (1, 1, 0.2)
    return sarcl.Scene.points(places, random.standard_normal(n) + 1j * random.standard_normal(n))


def solids(**options: Any) -> sarcl.Scene:
    """Some shapes on a plate, all small against the wavelength times the range, large against the wavelength."""
    from sarcl import shapes

    ground = shapes.plate((6, 6), edge=1.5, two_sided=False, **options)
    for place, solid in {
        (1, 1): shapes.box((0.6, 0.5, 0.7)), (-1.5, 1): shapes.cylinder(0.3, 0.6, sections=16),
        (0, -1.5): shapes.sphere(0.4, facets=80), (1.6, -1.2): shapes.frustum(0.4, 0.2, 0.5, sections=12),
        (-1.6, -1.4): shapes.cone(0.4, 0.6, sections=12),
    }.items():  # fmt: skip
        ground = ground + solid.on(ground, *place)
    return ground


def soil(**changes: Any) -> sarcl.Material:
    return sarcl.Material(**{"eps_r": 5.0, "conductivity": 0.02, **changes})


def hills(n: int = 24, **options: Any) -> sarcl.Scene:
    axis = np.arange(n + 1) - n / 2
    x, y = np.meshgrid(axis, axis)
    z = 2.0 * np.exp(-((x - 3) ** 2 + y**2) / 12) + 1.2 * np.exp(-((x + 5) ** 2 + (y - 4) ** 2) / 8) + 0.2 * np.sin(x)
    return sarcl.Scene.from_heights(axis, axis, z, **{"material": soil(diagram="cos"), **options})


def spotlight(track: sarcl.Trajectory) -> sarcl.Trajectory:
    from sarcl import pointing

    return pointing.spotlight(track, (0, 0, 0))


def stripmap(track: sarcl.Trajectory) -> sarcl.Trajectory:
    from sarcl import pointing

    return pointing.stripmap(track, 0.9, squint=0.02)


def gaussian(**changes: Any) -> sarcl.Antenna:
    return sarcl.Antenna.gaussian(**{"width": (0.002, 0.003), "gain_db": 30, **changes})


def measured(half: float = 0.02, frequency: float | None = 9.5e9) -> sarcl.Antenna:
    """A table that ends `half` rad from boresight."""
    azimuth, elevation = np.linspace(-half, half, 41), np.linspace(-half, half, 31)
    values = np.sinc(azimuth[:, None] / 0.004) * np.sinc(elevation / 0.005) * np.exp(1j * azimuth[:, None] * 30)
    return sarcl.Antenna.table(azimuth, elevation, values, gain_db=33, frequency=frequency)


def echo(scene: Any = None, wave: Any = None, track: Any = None, **options: Any) -> sarcl.PhaseHistory:
    found = cloud() if scene is None else scene, chirp() if wave is None else wave, circle() if track is None else track
    return sarcl.echo(*found, **{"check": False, **options})


table(echo, of_raw, {
    "echo points": {"check": True},
    "echo points 1e-1": {"tolerance": 1e-1},
    "echo points 1e-5": {"tolerance": 1e-5},
    "echo points 1e-6": {"tolerance": 1e-6, "check": True},
    "echo points bistatic": {"receiver": lambda: circle(start=0.4, height=3e3)},
    "echo points window": {"range_window": (-4.0, 6.0)},
    "echo points reference": {"reference": (40.0, -30.0, 5.0)},
    "echo points tone": {"wave": lambda: sarcl.Waveform.tone(center=9.6e9, duration=2e-7)},
    "echo points sampled": {"wave": sampled},
    "echo points uncompressed": {"compressed": False},
    "echo points all": {"polarization": "all"},
    "echo points skip False": {"skip": False, "range_window": (-4.0, 6.0)},
    "echo points near": {"track": lambda: circle(radius=60.0, height=40.0, arc=0.3)},
    "echo points blocks": {"scene": lambda: cloud(4000, 40.0), "max_bytes": 2e6},
    "echo points far": {"track": lambda: circle(radius=6e5, height=5e5, arc=1e-3), "tolerance": 1e-4},
    "echo factorized 1e-02": {"scene": lambda: cloud(4000, 40.0), "track": lambda: circle(200), "method": "factorized"},
    "echo factorized 1e-04": {
        "scene": lambda: cloud(4000, 40.0), "track": lambda: circle(200), "method": "factorized", "tolerance": 1e-4,
    },
    "echo factorized bistatic": {
        "scene": lambda: cloud(4000, 40.0), "track": lambda: circle(200), "method": "factorized",
        "receiver": lambda: circle(200, start=0.1),
    },
    "echo facets": {"scene": solids, "check": True},
    "echo facets 1e-2": {"scene": solids, "tolerance": 1e-2},
    "echo facets 1e-4": {"scene": solids, "tolerance": 1e-4, "wave": lambda: chirp(bandwidth=100e6)},
    "echo facets all": {"scene": lambda: solids(material=soil()), "polarization": "all", "tolerance": 1e-2},
    "echo facets VV vertical": {"scene": solids, "polarization": "VV", "vertical": (0.1, 0.3, 1.0), "tolerance": 1e-2},
    "echo facets bistatic": {"scene": solids, "tolerance": 1e-2, "receiver": lambda: circle(start=0.5, height=4e3)},
    "echo facets near": {"scene": solids, "tolerance": 5e-2, "track": lambda: circle(radius=50.0, height=30.0)},
    "echo facets uncut": {"scene": solids, "max_edge": None, "tolerance": 0.1},
    "echo facets cut": {"scene": solids, "max_edge": 0.2, "tolerance": 1e-2},
    "echo facets skip False": {"scene": solids, "skip": False, "tolerance": 1e-2},
    "echo facets unshadowed": {"scene": solids, "shadows": False, "tolerance": 1e-2},
    "echo facets points": {"scene": lambda: solids() + cloud(30, 2.0), "tolerance": 1e-2},
    "echo facets window": {"scene": solids, "range_window": (-0.8, 0.9), "tolerance": 1e-2},
    "echo rough": {"scene": lambda: solids(roughness=0.05), "seed": 7, "tolerance": 1e-2},
    "echo rough material": {"scene": lambda: solids(material=soil(diagram="exp", width=0.2, height=0.02)),
                            "tolerance": 1e-2, "polarization": ["HH", "VH"]},
    "echo terrain": {"scene": hills, "track": lambda: circle(height=2e3), "tolerance": 1e-2, "max_edge": 0.7},
    "echo terrain tank": {"track": lambda: circle(height=2e3), "tolerance": 1e-2, "max_edge": 0.7,
                          "scene": lambda: (g := hills()) + solids().on(g, 4, 3, depth=0.5)},
    "echo terrain rays": {"scene": lambda: replace(hills(), heights=None), "track": lambda: circle(height=2e3),
                          "tolerance": 1e-2, "max_edge": 0.7},
    "echo terrain random": {"scene": lambda: hills(point_roughness=0.05, roughness=0.02), "seed": 11,
                            "track": lambda: circle(height=2e3), "tolerance": 1e-2, "max_edge": 0.7},
    "echo terrain bistatic": {"scene": hills, "track": lambda: circle(height=2e3), "tolerance": 1e-2, "max_edge": 0.7,
                              "receiver": lambda: circle(height=3e3, start=1.0)},
    "echo antenna gaussian": {"antenna": gaussian, "track": lambda: spotlight(circle()), "check": True},
    "echo antenna pair": {"antenna": lambda: (gaussian(), measured()), "track": lambda: spotlight(circle()),
                          "radar": lambda: sarcl.Radar(power=1e3, losses_db=3)},
    "echo antenna aperture": {"antenna": lambda: sarcl.Antenna.rectangular(size=(2.0, 1.0), taper=0.3, two_way=True),
                              "track": lambda: stripmap(sarcl.Trajectory.line(
                                  start=(-7e3, -40, 5e3), velocity=(0, 100, 0), prf=50, n_pulses=24)),
                              "scene": lambda: cloud().moved((-700, 0, 0))},
    "echo antenna facets": {"antenna": gaussian, "track": lambda: spotlight(circle()), "scene": solids,
                            "radar": lambda: sarcl.Radar(power=1e3), "tolerance": 1e-2, "check": True},
    "echo radar near": {"radar": lambda: sarcl.Radar(power=10.0), "track": lambda: circle(radius=60, height=40)},
})  # fmt: skip


table(lambda **options: echo(cloud(4000, 40.0), track=spotlight(circle()), tolerance=1e-2, **options), of_raw, {
    "echo antenna edge": {"antenna": lambda: measured(8e-4, None)},
    "echo antenna edge, skip False": {"antenna": lambda: measured(8e-4, None), "skip": False},
})  # fmt: skip


# ---- full wave


def full_wave(material: Any = "metal", cells: float = 8, **options: Any) -> sarcl.PhaseHistory:
    """A box of half a wavelength and more, in five pulses."""
    box = sarcl.shapes.box((0.1, 0.15, 0.1), material=material)
    wave = sarcl.Waveform.chirp(center=1.25e9, bandwidth=500e6, duration=2e-8)
    track = circle(5, radius=40.0, height=15.0, arc=0.8)
    return sarcl.fullwave_echo(box, wave, track, cells=cells, max_bytes=1e9, **options)


def of_full_wave(raw: sarcl.PhaseHistory) -> dict[str, Any]:
    parts = of_raw(raw)
    return {**parts, "plan": {name: value for name, value in parts["plan"].items() if name != "run_seconds"}}


table(full_wave, of_full_wave, {
    "full wave": {"check": True, "polarization": ("HH", "VH")},
    "full wave, three anchors": {"anchors": 3, "compressed": False, "model_error": False},
    "full wave, lossy": {"material": lambda: sarcl.Material(eps_r=3 - 0.5j), "cells": 12, "anchors": 1},
})  # fmt: skip


# ---- arrays


def line(n: int = 9, frequency_step: float = 20e6, **options: Any) -> sarcl.AntennaArray:
    return sarcl.AntennaArray.linear(n, spacing=0.015, frequency_step=frequency_step, axis=(0, -1, 0), **options)


def planar() -> sarcl.AntennaArray:
    return sarcl.AntennaArray.planar((4, 3), spacing=(0.02, 0.03), frequency_step=(10e6, 40e6))


def small_scene() -> sarcl.Scene:
    return sarcl.Scene.points([[0.0, 0, 0], [1.0, 2, 0.3], [-2, 0.5, -0.4]], [1.0, 0.7, 0.5j])


def array_echo(**options: Any) -> sarcl.PhaseHistory:
    """Echoes of an array whose elements send tones."""
    given = {"array": line(), "scene": small_scene(), "track": passing(), "range_window": (-3.7, 3.7), **options}
    return echo(wave=sarcl.Waveform.tone(center=10e9, duration=5e-8), **given)


APART = {"zero reflectivity", "facing away", "range window", "out of beam"}
table(array_echo, of_raw, {
    f"array {channels} {receive}{word}": {"channels": channels, "receive": receive, **more}
    for channels, receive in (
        ("simultaneous", "reference"), ("simultaneous", "all"), ("separated", "reference"), ("separated", "own"),
        ("separated", "all"),
    )
    for word, more in {"": {}, " planar": {"array": planar}, " apart": {"skip": APART}}.items()
})  # fmt: skip
table(array_echo, of_raw, {
    "array checked": {"check": True},
    "array 1e-5": {"tolerance": 1e-5},
    "array step 0": {"array": lambda: line(frequency_step=0.0)},
    "array step 0 separated": {"array": lambda: line(frequency_step=0.0), "channels": "separated", "receive": "all"},
    "array single": {"array": sarcl.AntennaArray.single},
    "array weights": {"array": lambda: line(weights=np.hanning(11)[1:-1] * np.exp(1j * np.arange(9)))},
    "array costas": {"array": lambda: sarcl.AntennaArray.costas(10, spacing=0.015, frequency_step=20e6)},
    "array mirrored": {"array": lambda: line().mirrored(6, 12)},
    "array subarrays": {"array": lambda: line().subarrays(3, steer=(0.1, 0.0), frequency=10e9)},
    "array bistatic": {"receiver": lambda: passing(height=1500.0), "receive": "all"},
    "array many places": {"array": lambda: line(45), "scene": lambda: cloud(400, 2.0), "check": True},
    "array many places all": {"array": lambda: line(45), "scene": lambda: cloud(400, 2.0), "receive": "all"},
    "array facets": {"scene": solids, "tolerance": 1e-2, "polarization": "all", "receive": "all"},
    "array facets apart": {"scene": solids, "tolerance": 1e-2, "skip": APART},
    "array attitude": {"track": lambda: spotlight(passing()), "antenna": lambda: gaussian(width=(0.2, 0.3)),
                       "radar": lambda: sarcl.Radar(power=100.0)},
    "array uncompressed": {"compressed": False},
})  # fmt: skip


def field(array: sarcl.AntennaArray, **options: Any) -> np.ndarray:
    random = np.random.default_rng(0)
    times, places = random.uniform(0, 1e-6, 13), random.uniform(-50, 50, (5, 7, 3)) + np.array([1e3, 0, 0])
    return sarcl.beam(array, 10e9, times=times, positions=places, reference=(0, 0, 20.0), **options)


table(field, lambda made: {"field": made}, {
    "beam": {"array": lambda: line(45)},
    "beam 1e-9": {"array": lambda: line(45), "tolerance": 1e-9},
    "beam 1e-3": {"array": planar, "tolerance": 1e-3},
    "beam one carrier": {"array": lambda: line(9, frequency_step=0.0)},
    "beam pulse": {"array": lambda: line().mirrored(2, 4), "pulse": 3},
    "beam blocks": {"array": lambda: line(200), "max_bytes": 2e6},
})  # fmt: skip


@task("ambiguity")
def _ambiguity() -> Parts:
    signal = np.exp(1j * np.pi * (np.arange(48) - 24) ** 2 / 60)
    whole, part = sarcl.ambiguity(signal, 1e6), sarcl.ambiguity(signal, 1e6, max_delay=1e-5, max_doppler=2e5)
    return {
        name: {"delays": a.delays, "dopplers": a.dopplers, "magnitude": a.magnitude, "volume": a.volume}
        for name, a in (("whole", whole), ("part", part))
    }


def fda_raw() -> sarcl.PhaseHistory:
    return array_echo(array=line(15), reference=(0, 0, 0), track=passing(31, height=0.0))


table(lambda **options: sarcl.map_aperture(fda_raw(), **options), of_raw, {
    "map_aperture corrected": {"mapping": "corrected"},
    "map_aperture linear": {"mapping": "corrected", "quadratic": False},
    "map_aperture apparent": {"mapping": "apparent"},
    "map_aperture halved": {"mapping": "apparent", "offset": "halved"},
    "map_aperture channels": {"mapping": "channels"},
})  # fmt: skip


# ---- noise, motion, compression, waveforms, shapes


def noisy(**options: Any) -> sarcl.PhaseHistory:
    return sarcl.add_noise(echo(track=circle(8)), seed=5, **options)


table(noisy, of_raw, {
    "noise nesz_db": {"nesz_db": -20.0, "grid": lambda: plane()},
    "noise nesz cell": {"nesz": 0.02, "cell_area": 0.5},
    "noise temperature": {"temperature": 290.0},
    "noise radar": {"radar": lambda: sarcl.Radar(power=1.0, noise_temperature=500.0)},
    "noise variance": {"variance": 0.3},
})  # fmt: skip


@task("motion")
def _motion() -> Parts:
    from sarcl import motion

    track = circle(16)
    tracks = {
        "perturbed": motion.perturbed(track, rms=0.02, correlation_time=0.05, attitude_rms=0.0, seed=3),
        "spectrum": motion.perturbed(track, rms=(0.01, 0.02, 0), spectrum=([1, 5, 20], [1, 0.5, 0]), frame="track"),
        "attitude": motion.perturbed(spotlight(track), correlation_time=0.05, attitude_rms=0.001, seed=4),
        "sinusoidal": motion.sinusoidal(track, amplitude=(0, 0.01, 0.02), frequency=8.0, phase=0.3),
        "relative": motion.relative(track, velocity=(3, 1, 0), acceleration=(0, 1, 0), rotation=(0, 0, 0.1)),
    }
    raw = echo(track=tracks["perturbed"], range_window=(-20, 20))
    both = motion.combined([raw, echo(track=tracks["relative"], range_window=(-20, 20))])
    return {
        "tracks": {n: (t.times, t.positions, t.velocities, t.attitude) for n, t in tracks.items()},
        "with positions": of_raw(motion.with_positions(raw, track)),
        "combined": of_raw(both),
    }


@task("pointing")
def _pointing() -> Parts:
    from sarcl import pointing

    track = sarcl.Trajectory.line(start=(-7e3, -40, 5e3), velocity=(0, 100, 0), prf=50, n_pulses=9)
    made = spotlight(track), stripmap(track), pointing.fixed(track, (1, 0.1, -0.7))
    return {"attitude": [t.attitude for t in made]}


@task("waveforms")
def _waveforms() -> Parts:
    f = np.linspace(9.4e9, 9.8e9, 101)
    waves = chirp(), sampled(), sarcl.Waveform.tone(center=9.6e9, duration=2e-8)
    return {"pulse": [w.pulse_spectrum(f) for w in waves], "matched": [w.matched_spectrum(f) for w in waves]}


@task("antennas")
def _antennas() -> Parts:
    look = np.random.default_rng(1).standard_normal((40, 3)) * (0, 0.005, 0.005) + (1, 0, 0)
    made = gaussian(), measured(), sarcl.Antenna.rectangular(size=(2.0, 1.0), taper=(0.3, 1)), sarcl.Antenna.isotropic()
    radar = sarcl.Radar(power=1e3, losses_db=2)
    return {
        "gain": [a.gain(look, 9.6e9) for a in made],
        "limits": [a.limits(1e-3, 9.6e9) for a in made],
        "radar": radar.amplitude(9.6e9, 5e3, 6e3, 10.0, 20.0),
    }


def of_scene(scene: sarcl.Scene) -> dict[str, Any]:
    names = "positions", "amplitudes", "triangles", "reflectivity", "roughness", "two_sided", "material"
    return {n: getattr(scene, n) for n in names} | {"materials": [repr(m) for m in scene.materials]}


@task("scenes")
def _scenes() -> Parts:
    from sarcl import shapes

    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "roof.off"
        path.write_text("OFF\n5 4 0\n0 0 1\n-1 -1 0\n1 -1 0\n1 1 0\n-1 1 0\n3 0 1 2\n3 0 2 3\n3 0 3 4\n3 0 4 1\n")
        mesh = sarcl.Scene.from_mesh(path, scale=2.0, position=(1, 2, 3), rotation=(0, 0, 0.3), max_edge=0.9)
    made = {
        "mesh": mesh, "solids": solids(material=soil()), "split": shapes.box((1, 2, 3)).split(0.8), "hills": hills(),
        "realized": hills(8, point_roughness=0.1).realized(3), "sum": cloud() + shapes.disc(1.0, material="concrete"),
    }  # fmt: skip
    return {name: of_scene(scene) for name, scene in made.items()}


@task("compress")
def _compress() -> Parts:
    return of_raw(sarcl.compress(echo(compressed=False)))


# ---- images


def white(
    rows: int = 128, samples: int = 96, *, bistatic: bool = False, arc: float = 0.05, jitter: float = 1.0, **fields: Any
) -> sarcl.PhaseHistory:
    """White noise on an arc 10 km off, its positions `jitter` m rms off it, bandwidth 300 MHz."""
    random = np.random.default_rng(2)
    a = arc * (np.arange(rows) / (rows - 1) - 0.5)
    tx = 1e4 * np.stack([0.7 * np.cos(a), 0.7 * np.sin(a), np.full(rows, 0.714)], axis=1)
    tx += jitter * random.standard_normal((rows, 3))
    rx = tx + np.array([1e3, 2e3, 0]) if bistatic else None
    values = random.standard_normal((rows, samples)) + 1j * random.standard_normal((rows, samples))
    far = (np.linalg.norm(tx, axis=1) + np.linalg.norm(tx if rx is None else rx, axis=1)) / 2
    return sarcl.PhaseHistory(
        values.astype(fields.pop("dtype", np.complex64)), frequency=9.6e9 - 150e6, frequency_step=300e6 / samples,
        tx=tx, rx=rx, reference_range=far, **fields,
    )  # fmt: skip


def plane(n: int = 80, spacing: float = 0.3, **options: Any) -> sarcl.ImageGrid:
    return sarcl.ImageGrid.plane(**{"shape": (n, n + 5), "spacing": spacing, **options})


def bumps() -> np.ndarray:
    return plane(33).positions + np.random.default_rng(4).uniform(-1, 1, (33, 38, 3))


def holes() -> sarcl.ImageGrid:
    places = bumps()
    places[3:9, 20:] = np.nan
    return sarcl.ImageGrid.points(places)


def focus(raw: Any = None, grid: Any = None, **options: Any) -> sarcl.Image:
    found = white() if raw is None else raw, plane() if grid is None else grid
    return sarcl.backproject(*found, **{"method": "direct", "check": False, **options})


def large() -> dict[str, Any]:
    return {"raw": white(512, 64, jitter=0), "grid": plane(256, 0.2), "method": "factorized"}


table(focus, of_image, {
    f"{method} {tolerance:.0e}": {
        "tolerance": tolerance, "method": method, "check": True,
        **({} if method == "direct" else {"raw": lambda: large()["raw"], "grid": lambda: large()["grid"]}),
    }
    for method, tolerances in {"direct": (1e-1, 1e-2, 1e-3, 1e-4, 1e-6), "factorized": (1e-1, 1e-2, 1e-3)}.items()
    for tolerance in tolerances
})  # fmt: skip
table(focus, of_image, {
    "auto": {"method": "auto", "check": True},
    "direct float64 1e-8": {"tolerance": 1e-8, "check": True, "grid": lambda: plane(40)},
    "direct float64 bistatic": {"tolerance": 1e-9, "raw": lambda: white(bistatic=True), "grid": lambda: plane(40)},
    "direct float64 points": {"tolerance": 1e-8, "grid": lambda: sarcl.ImageGrid.points(bumps()), "wrap": True},
    "direct float64 beam": {"tolerance": 1e-8, "grid": lambda: plane(40), "beam": 0.0015},
    "direct float64 antenna": {"tolerance": 1e-8, "grid": lambda: plane(40), "beam": gaussian},
    "direct complex128": {"raw": lambda: white(dtype=np.complex128)},
    "direct bistatic": {"raw": lambda: white(bistatic=True)},
    "direct bistatic 1e-5": {"raw": lambda: white(bistatic=True), "tolerance": 1e-5},
    "direct points": {"grid": lambda: sarcl.ImageGrid.points(bumps())},
    "direct points 1-D": {"grid": lambda: sarcl.ImageGrid.points(bumps().reshape(-1, 3)[:301])},
    "direct empty cells": {"grid": holes},
    "direct empty cells, skip False": {"grid": holes, "skip": False},
    "direct wall": {"grid": lambda: plane(normal=(1, 0.2, 0), center=(2, 3, 4))},
    "direct turned": {"grid": lambda: plane(x_axis=(1, 0.7, 0))},
    "direct wide": {"grid": lambda: plane(120, 2.0)},
    "direct wide, skip False": {"grid": lambda: plane(120, 2.0), "skip": False},
    "direct wrap": {"grid": lambda: plane(120, 2.0), "wrap": True},
    "direct beam": {"beam": 0.0015},
    "direct beam stripmap": {"beam": (0.0015, (-0.7, 0.0, -0.714))},
    "direct beam, skip False": {"beam": 0.0015, "skip": False},
    "direct hamming": {"window": "hamming"},
    "direct taylor": {"window": ("taylor", 35, 5)},
    "direct weights": {"weights": lambda: np.hanning(130)[1:-1]},
    "direct zero weights": {"weights": lambda: np.arange(128) % 3 == 0, "window": "hamming"},
    "direct raw weight": {"raw": lambda: white(weight=np.linspace(0, 1, 128))},
    "direct near": {"raw": lambda: echo(track=circle(radius=60.0, height=40.0, arc=0.3))},
    "direct blocks": {"max_bytes": 2e6, "grid": lambda: plane(200, 0.1)},
    "direct mapping": {"raw": fda_raw, "mapping": "corrected", "grid": lambda: plane(40, 0.1)},
    "direct mapping apparent": {"raw": fda_raw, "grid": lambda: plane(40, 0.1),
                                "mapping": lambda: {"mapping": "apparent", "offset": "halved"}},
    "direct mapping channels": {"raw": fda_raw, "mapping": "channels", "grid": lambda: plane(40, 0.1)},
    "direct several frequencies": {"raw": lambda: sarcl.concatenate([white(64), replace(
        white(64), frequency=9.3e9, frequency_step=2.5e6)])},
})  # fmt: skip
table(lambda **options: focus(**{**large(), "tolerance": 1e-2, **options}), of_image, {
    "factorized bistatic": {"raw": lambda: white(512, 64, jitter=0, bistatic=True)},
    "factorized beam": {"beam": 0.003},
    "factorized wide": {"grid": lambda: plane(256, 0.6)},
    "factorized wide, skip False": {"grid": lambda: plane(256, 0.6), "skip": False},
    "factorized wrap": {"grid": lambda: plane(256, 0.6), "wrap": True},
    "factorized points": {"grid": lambda: sarcl.ImageGrid.points(plane(200, 0.2).positions * (1, 1, 1) + (0, 0, 0.5))},
    "factorized window": {"window": "hamming", "weights": lambda: np.linspace(0, 1, 512)},
    "factorized blocks": {"max_bytes": 8e6},
})  # fmt: skip


def planar_fronts(**options: Any) -> sarcl.Image:
    return sarcl.polar_format(**{"raw": white(), "grid": plane(60), "check": False, **options})


table(planar_fronts, of_image, {
    "polar_format": {"check": True},
    "polar_format 1e-4": {"tolerance": 1e-4},
    "polar_format window": {"window": ("taylor", 35, 5), "weights": lambda: np.linspace(0.1, 1, 128)},
    "polar_format blocks": {"max_bytes": 4e6, "grid": lambda: plane(120, 0.2)},
    "polar_format wall": {"grid": lambda: plane(60, 0.3, center=(1, 2, 3), normal=(0.3, 0.1, 1))},
})  # fmt: skip


@task("image file")
def _image_file() -> Parts:
    """An image made in three pieces, in a file, and what the file holds."""
    with tempfile.TemporaryDirectory() as folder:
        path, whole = Path(folder) / "image.h5", Path(folder) / "whole.h5"
        made = [focus(out=path, tile=(i, 3)) for i in (1, 2, 3)]
        assert made[0] is None and made[2] is not None
        focus(out=whole, grid=plane(120, 0.2), max_bytes=2e6)
        return {"pieces": of_hdf5(path), "whole": of_hdf5(whole), **of_image(sarcl.read(whole))}


@task("echo file")
def _echo_file() -> Parts:
    with tempfile.TemporaryDirectory() as folder:
        path, again = Path(folder) / "raw.h5", Path(folder) / "again.h5"
        raw = array_echo(channels="separated", receive="all", out=path)
        sarcl.read(path).save(again)
        return {"written": of_hdf5(path), "saved": of_hdf5(again), "part": of_raw(raw[3:9])}


@task("multilook and measure")
def _measure() -> Parts:
    raw = echo(scene=sarcl.Scene.points([[1.0, 2.0, 0]]), track=circle(96, arc=0.04))
    image = focus(raw, plane(160, 0.12), window="hamming")
    found = sarcl.measure(image, near=(1, 2, 0))
    names = "position", "irw", "pslr", "islr", "peak", "gain", "reach"
    picture = np.asarray(image.show(-40))
    return {
        "looks": np.asarray(image.multilook((3, 2)).data),
        "decibels": image.decibels(),
        "picture": picture,
        "response": {n: getattr(found, n) for n in names},
        "words": str(found),
    }


def spoiled(walk: float) -> Parts:
    """Echoes of bright points with a phase (and range) error on every pulse, refocused."""
    random, n = np.random.default_rng(6), 96
    points = np.concatenate([random.uniform(-8, 8, (30, 2)), np.zeros((30, 1))], axis=1)
    raw = echo(scene=sarcl.Scene.points(points, 5.0), track=circle(n, arc=0.04))
    x = np.linspace(-1, 1, n)
    phase, shift = 3 * np.cos(4 * x) + x**3, walk * np.cos(3 * x)
    f = raw.frequency[:, None] + raw.frequency_step[:, None] * np.arange(raw.n_samples)
    bad = np.exp(1j * phase[:, None] - 4j * np.pi * (f - 9.6e9) / C * shift[:, None]) * np.asarray(raw.samples)
    fixed, errors = sarcl.autofocus(
        replace(raw, samples=bad.astype(np.complex64)), plane(64, 0.3), range_errors=walk > 0, places=40
    )
    names = "phase", "range", "frequency", "found", "gain", "agreement", "spread", "modes"
    return {**of_raw(fixed), "errors": {name: getattr(errors, name) for name in names}}


task("autofocus phase")(lambda: spoiled(0.0))
task("autofocus range")(lambda: spoiled(0.25))


def planned(raw: Any = None, grid: Any = None, **options: Any) -> Parts:
    made = sarcl.plan(white() if raw is None else raw, plane() if grid is None else grid, **options)
    error = None if made.cheaper is None else made.cheaper[0]
    return {"plan": made.plan, "numbers": [made.method, made.bytes, made.predicted_error, error]}


table(planned, lambda made: made, {
    "plan": {},
    "plan 1e-5": {"tolerance": 1e-5},
    "plan 1e-8": {"tolerance": 1e-8},
    "plan factorized": large(),
    "plan large": {"raw": lambda: white(1024, 32), "grid": lambda: plane(4000, 0.05)},
    "plan beam": {"beam": 0.0015, "window": "hamming", "max_bytes": 4e6},
})  # fmt: skip


def planned_echo(scene: Any, wave: Any = None, track: Any = None, **options: Any) -> Parts:
    made = sarcl.plan(
        sarcl.echo, scene, chirp() if wave is None else wave, circle(60) if track is None else track, **options
    )
    numbers = made.n_rows, made.n_samples, made.bytes, made.predicted_error
    plan = {name: value for name, value in made.plan.items() if name != "spectral_echo"}  # it names seconds
    return {"plan": plan, "numbers": numbers}


table(planned_echo, lambda made: made, {
    "plan echo": {"scene": cloud},
    "plan echo facets": {"scene": solids, "tolerance": 1e-2},
    "plan echo array": {"scene": small_scene, "array": line, "receive": "all", "range_window": (-3.7, 3.7),
                        "track": lambda: passing(60), "wave": lambda: sarcl.Waveform.tone(center=10e9, duration=5e-8)},
})  # fmt: skip


# ---- the command line

SCENARIO = """
[waveform.chirp]
center = 9.6e9
bandwidth = 200e6
duration = 1e-6
[trajectory.circle]
radius = 8e3
height = 6e3
arc = 0.02
n_pulses = 48
[pointing.spotlight]
point = [0, 0, 0]
[antenna.gaussian]
width = [0.004, 0.004]
[materials.gravel]
eps_r = 5.0
conductivity = 0.02
diagram = "cos"
[[scene.from_heights]]
x = [-6, 0, 6]
y = [-6, 0, 6]
z = [[0, 0, 0], [0, 1, 0], [0, 0, 0.5]]
material = "gravel"
roughness = 0.02
[[scene.box]]
size = [0.5, 0.6, 0.7]
on = [2, 3]
[[scene.points]]
positions = [[1, -2, 1], [3, 2, 1]]
amplitudes = [[1, 0], [0, 1.5]]
[grid.plane]
shape = [48, 50]
spacing = [0.3, 0.3]
[echo]
tolerance = 1e-2
seed = 7
max_edge = 1.0
check = false
[backproject]
tolerance = 1e-3
window = ["taylor", 35, 5]
check = false
"""

EXPERIMENT = """
[fda]
title = "Two tries"
n = 16
frequency_step = 50e6
aperture = 200.0
n_pulses = 201
points = [0.0]
separations = [0.3]
[[case]]
name = "switched"
[[case]]
name = "steady"
mirrored = false
receive = "own"
"""


def command(folder: Path, *words: str) -> str:
    """What `python -m sarcl WORDS` prints in `folder`, on the device that SARCL_DEVICE names."""
    done = subprocess.run([sys.executable, "-m", "sarcl", *words], cwd=folder, capture_output=True, text=True)
    if done.returncode:
        raise RuntimeError(f"sarcl {' '.join(words)} ended with {done.returncode}: {done.stderr.strip()[-500:]}")
    return done.stdout


@task("command simulate, focus, measure")
def _simulate() -> Parts:
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "s.toml").write_text(SCENARIO)
        command(folder, "simulate", "s.toml", "-o", "raw.h5", "--image", "first.h5")
        command(folder, "focus", "raw.h5", "-o", "second.h5", "--grid", "s.toml", "--tolerance", "1e-4")
        command(folder, "focus", "raw.h5", "-o", "third.h5", "--shape", "140", "140", "--spacing", "0.3", "0.3")
        files = {f"{stem}.h5": of_hdf5(folder / f"{stem}.h5") for stem in ("raw", "first", "second", "third")}
        words = command(folder, "measure", "third.h5", "--near", "3", "2", "1")
        reports = [of_report(sarcl.read(folder / f"{stem}.h5").report) for stem in ("raw", "first")]
        return {**files, "measure": words, "reports": reports}


@task("command fda")
def _fda() -> Parts:
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "try.toml").write_text(EXPERIMENT)
        words = command(folder, "fda", "try.toml")
        return {"json": json.loads((folder / "try.json").read_text()), "words": words}


@task("scenario text")
def _scenario_text() -> Parts:
    given = sarcl.Scenario(waveform=chirp(), trajectory=circle(5), scene=cloud(3), grid=plane(), echo={"seed": 7})
    return {"toml": given.dumps()}


# ---- the whole


def machine() -> dict[str, Any]:
    """What floats depend on: the device that sarcl chooses, its driver, libraries, processors."""
    name = echo(track=circle(2)).report.device
    found = next(d for d in sarcl.devices() if d.works and d.name == name)
    return {
        "device": found.name, "platform": found.platform, "driver": found.driver, "units": found.units,
        "processors": len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count(),
        "numpy": np.__version__, "scipy": scipy.__version__, "python": platform.python_version(),
    }  # fmt: skip


def computed(names: list[str]) -> dict[str, str]:
    """{task/part: hash}; what a task raised stands in place of its hashes."""
    out: dict[str, str] = {}
    for name in names:
        try:
            out |= {f"{name}/{part}": digest(value) for part, value in TASKS[name]().items()}
        except Exception as exc:
            out[name] = f"raised {type(exc).__name__}: {exc}"
            print(f"{name} {out[name]}", file=sys.stderr)
    return out


def differences(there: Mapping[str, str], here: Mapping[str, str]) -> list[str]:
    """A line for every entry that is not the same in both."""
    out = []
    for name in sorted({*there, *here}):
        if name not in here:
            out.append(f"{name}: in the file, not computed now")
        elif name not in there:
            out.append(f"{name}: computed now, not in the file")
        elif there[name] != here[name]:
            out.append(f"{name}: differs")
    return out


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("-o", "--output", metavar="FILE", help="write the hashes (default: print them)")
    parser.add_argument("--compare", metavar="FILE", help="compare with the hashes in this file")
    parser.add_argument("--device", help="as SARCL_DEVICE")
    parser.add_argument("--only", default="", metavar="TEXT", help="tasks whose name holds this text")
    parser.add_argument("--list", action="store_true", help="print the names of the tasks")
    args = parser.parse_args()
    names = [name for name in TASKS if args.only in name]
    if args.list or not names:
        print("\n".join(names) or f"no task's name holds {args.only!r}")
        return 0 if names else 2
    if args.device:
        os.environ["SARCL_DEVICE"] = args.device
    warnings.simplefilter("ignore", sarcl.SarclWarning)
    here = machine()
    there = json.loads(Path(args.compare).read_text()) if args.compare else {}
    before = there.get("machine", here)
    other = [
        f"{name}: {before.get(name)} there, {value} here" for name, value in here.items() if before.get(name) != value
    ]
    if other:
        print("hashes of floats hold on one machine with one driver only, but " + "; ".join(other), file=sys.stderr)
        return 2
    hashes = computed(names)
    if args.compare:
        wanted = {k: v for k, v in there["hashes"].items() if args.only in k.split("/")[0]}
        lines = differences(wanted, hashes)
        print("\n".join([*lines, f"{len(lines)} of {len({*wanted, *hashes})} hashes differ from {args.compare}"]))
        return 1 if lines else 0
    text = json.dumps({"sarcl": sarcl.__version__, "machine": here, "hashes": hashes}, indent=1)
    if args.output:
        Path(args.output).write_text(text + "\n")
    else:
        print(text)
    return 1 if any(value.startswith("raised ") for value in hashes.values()) else 0


if __name__ == "__main__":
    sys.exit(main())
