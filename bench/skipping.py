"""What is left out of three scenes, by reason: share of the pairs, time saved, and what it changes.

    python bench/skipping.py [--scene demo car street] [--json FILE]

Each scene is echoed and focused at a tolerance of 1e-2: with everything that contributes nothing left out, as calls
do by default, then once with each reason computed after all, where `skip=` has it, and without shadows. Seconds are
CPU seconds of second calls, kernels built. The change is the norm of the difference over the norm of the result.
Shadows are part of the model: what they change is no error.

The demo is that of `sarcl demo --quick`; the car is a box with a cabin on 3200 rough facets, a spotlight of 100
pulses over 4 deg whose antenna sees part of the ground; the street has six houses on rough hills, with three
reflections.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import reduce
from operator import add
from pathlib import Path
from typing import Any

import numpy as np

import sarcl
from sarcl import shapes
from sarcl.bench.documents import header
from sarcl.experiments import demo, demo_scene
from sarcl.opencl.choose_device import open_device

RESULT = Path(__file__).parents[1] / "bench" / "results" / "trials" / "skipping.json"
TOLERANCE = 1e-2
ECHO_REASONS = "zero reflectivity", "facing away", "range window", "out of beam"
IMAGE_REASONS = "range window", "beam"
DISTANCE, GRAZING = 10e3, np.radians(40)  # m, rad
CHIRP = sarcl.Waveform.chirp(center=9.6e9, bandwidth=300e6, duration=1e-6)
SOIL = sarcl.Material(eps_r=5, diagram="cos", name="soil")
HALF_APERTURE = 2e-3  # rad: the antenna's and the image's beam, 20 m to each side at 10 km


@dataclass(frozen=True)
class Task:
    """Arguments of `echo`, its options, and a grid with options of `backproject`."""

    scene: sarcl.Scene
    waveform: sarcl.Waveform
    track: sarcl.Trajectory
    options: dict[str, Any]
    grid: sarcl.ImageGrid
    focus: dict[str, Any]


def arc(n_pulses: int) -> sarcl.Trajectory:
    """4 deg of a circle about the origin."""
    radius, height = DISTANCE * np.cos(GRAZING), DISTANCE * np.sin(GRAZING)
    track = sarcl.Trajectory.circle(radius=radius, height=height, arc=0.07, n_pulses=n_pulses)
    return sarcl.pointing.spotlight(track, (0, 0, 0))


def hills(half: float, step: float, height: float) -> sarcl.Scene:
    """Rough ground from -half to half, m, with heights of a sine."""
    axis = np.arange(-half, half + step / 2, step)
    z = height * np.sin(axis / 9)[:, None] * np.cos(axis / 13)
    return sarcl.Scene.from_heights(axis, axis, z, material=SOIL)


def demo_task() -> Task:
    setting = demo.QUICK
    scene = demo_scene.scene(setting.edge)
    options = {"bounces": demo.BOUNCES}
    return Task(scene, setting.waveform(), setting.track(), options, setting.grid(), {"window": demo.WINDOW})


def car_task() -> Task:
    car = shapes.box((4.4, 1.8, 0.8), position=(0, 0, 0.3)) + shapes.box((2.0, 1.6, 0.5), position=(-0.3, 0, 1.1))
    antenna = sarcl.Antenna.rectangular(size=(6.0, 6.0))
    options = {"range_window": (-12.0, 12.0), "antenna": antenna}
    grid = sarcl.ImageGrid.plane(shape=(256, 256), spacing=0.25)
    return Task(car + hills(20, 1.0, 0.0), CHIRP, arc(100), options, grid, {"beam": 2 * HALF_APERTURE / 2})


def street_task() -> Task:
    paving = sarcl.material.MATERIALS["concrete"]
    rough = sarcl.Material(paving.eps_r, paving.conductivity, diagram="cos", height=7e-3, name="paving")
    houses = [
        shapes.box((9, 12, 6), position=(x, y, 0.4), material=rough)
        + shapes.box((16, 16, 3), position=(x, y, -2.6), material=rough)
        for x in (-10, 12)
        for y in (-20, 0, 20)
    ]
    grid = sarcl.ImageGrid.plane(shape=(320, 320), spacing=0.4)
    scene = reduce(add, houses) + hills(40, 2.0, 0.3)
    return Task(scene, CHIRP, arc(100), {"bounces": 3}, grid, {"beam": 2 * HALF_APERTURE})


TASKS: dict[str, Callable[[], Task]] = {"demo": demo_task, "car": car_task, "street": street_task}


def timed(call: Callable[[], Any]) -> tuple[Any, float]:
    """A result and the CPU seconds of the second call."""
    call()
    start = time.process_time()
    result = call()
    return result, time.process_time() - start


def difference(result: np.ndarray, other: np.ndarray) -> float:
    return float(np.linalg.norm(np.ravel(result) - np.ravel(other)) / np.linalg.norm(result))


def shares(report: Any) -> dict[str, float]:
    """Share of all pairs that were skipped, by reason, and of those computed."""
    total = report.contributions_done + sum(report.contributions_skipped.values())
    found = {why: n / total for why, n in report.contributions_skipped.items() if n}
    return {**found, "computed": report.contributions_done / total}


def compared(
    call: Callable[..., Any], values: Callable[[Any], np.ndarray], reasons: tuple[str, ...], extra: dict[str, Any]
) -> dict[str, Any]:
    """One verb: shares, seconds, and what each switch costs and changes. extra  switches that are not skip="""
    result, seconds = timed(call)
    entry: dict[str, Any] = {
        "pairs": sum(result.report.contributions_skipped.values()) + result.report.contributions_done
    }
    entry |= {"shares": shares(result.report), "seconds": seconds, "switches": []}
    present = [why for why in reasons if entry["shares"].get(why)]
    switches = {why: {"skip": set(reasons) - {why}} for why in present} | extra
    if len(present) > 1:
        switches["all of these"] = {"skip": False}
    for name, options in switches.items():
        other, busy = timed(lambda options=options: call(**options))
        entry["switches"].append(
            {"computed after all": name, "seconds": busy, "change": difference(values(result), values(other))}
        )
    return entry


def measured(task: Task) -> dict[str, Any]:
    def echo(**options: Any) -> sarcl.PhaseHistory:
        return sarcl.echo(
            task.scene, task.waveform, task.track, tolerance=TOLERANCE, check=False, **task.options | options
        )

    raw = echo()

    def image(**options: Any) -> sarcl.Image:
        return sarcl.backproject(raw, task.grid, tolerance=TOLERANCE, check=False, **task.focus | options)

    # what reflects to another facet also shades it: with several reflections shadows cannot be left out
    shadows = {} if "bounces" in task.options else {"shadows": {"shadows": False}}
    return {
        "facets": len(task.scene.triangles),
        "pulses": len(task.track),
        "echo": compared(echo, lambda raw: raw.samples[:], ECHO_REASONS, shadows),
        "backproject": compared(image, lambda made: np.asarray(made.data), IMAGE_REASONS, {}),
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scene", nargs="+", choices=list(TASKS), default=list(TASKS))
    parser.add_argument("--json", type=Path, default=RESULT)
    asked = parser.parse_args()
    document = json.loads(asked.json.read_text()) if asked.json.exists() else {}
    document |= {**header([open_device(None)]), "kind": "skipping", "command": "python bench/skipping.py"}
    scenes = document.setdefault("scenes", {})
    for name in asked.scene:
        scenes[name] = measured(TASKS[name]())
        print(name, json.dumps(scenes[name], indent=1), flush=True)
        asked.json.write_text(json.dumps(document, indent=1) + "\n")


if __name__ == "__main__":
    main()
