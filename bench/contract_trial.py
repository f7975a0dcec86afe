"""The accuracy contract on random legal tasks: the error achieved over the tolerance, against exact float64 sums.

    python bench/contract_trial.py [-n 300] [--seconds 1200] [--verb NAME ...] [--json FILE]

Each verb runs tasks until N of them have been compared with exact results. Tasks are those of tests/helpers: odd
tracks, distances from 1 m to 36 000 km, carriers from 1 MHz to 10 THz, tolerances down to 1e-9, devices without
float64. Those of `linear.Echoes` are drawn here. A task is refused where sarcl names what does not fit, held where
all of its errors are within the tolerance. Tasks without an exact result count as neither.

Echoes of points, channels and images are compared with the sums of sarcl/reference; echoes of facets and of antennas,
and images of range-Doppler, at random samples by the verb's own check=True, which computes them again in float64.
Full-wave echoes are compared with those of a run of the same grid at every pulse: their tolerance bounds what fewer
runs change.

Tasks that failed in an earlier run are tried again first, and those that are right now are listed as mended.
The file is written after every STEP tasks, and a run continues where the file ends, so that it may be stopped at
any time. Seconds are CPU seconds of this process.
"""

from __future__ import annotations

import argparse
import json
import signal
import sys
import time
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

ROOT = Path(__file__).parents[1]
sys.path.append(str(ROOT / "tests"))
from helpers import echo_tasks, image_tasks, tasks  # noqa: E402
from helpers import task_inputs as inputs  # noqa: E402
from helpers.tasks import Draw  # noqa: E402

import sarcl  # noqa: E402
from sarcl.base.constants import SPEED_OF_LIGHT as C  # noqa: E402
from sarcl.bench.documents import header  # noqa: E402
from sarcl.opencl.choose_device import open_device  # noqa: E402
from sarcl.reference.equations import excess_delay  # noqa: E402
from sarcl.reference.linear import matrix  # noqa: E402
from sarcl.scattering import facet_plan  # noqa: E402

RESULT = ROOT / "bench" / "results" / "trials" / "contract.json"
STEP = 20  # tasks between two writings of the file
PATIENCE = 60.0  # CPU seconds, the longest task
SEEDS = 1_000_000  # numbers of tasks reserved for each verb
EDGE = 1e-6  # relative to half the range window: points nearer to its edge may lie on either side
MOST_FACETS = 20_000  # facets that a scene may be cut into: larger ones take minutes, and are refused
Task = Callable[[Draw], None]


def linear(draw: Draw) -> None:
    """A @ x and A.H @ y against the matrix; y is the echo of other amplitudes of the same points."""
    center = inputs.origin(draw)
    like = inputs.history(draw, draw.whole(1, 16), draw.whole(1, 48), center)
    domain: Any = inputs.grid(draw, center, inputs.extent(draw, like))
    points = domain.positions.reshape(-1, 3) if domain.empty is None else domain.positions[~domain.empty]
    if draw.chance(0.3) or domain.empty is not None:
        domain = points
    reach = [
        abs(excess_delay(like.tx[p], like.rx[p], points, like.reference_range[p])) * 2 * like.frequency_step[p]
        for p in range(like.n_rows)
    ]
    wrap = draw.chance(0.3) or bool((abs(np.array(reach) - 1) < EDGE).any())
    options: dict[str, Any] = {"weights": draw.random.random(like.n_rows) + 0.1} if draw.chance(0.3) else {}
    allowed = inputs.tolerance(draw, 1e-8)
    A = sarcl.linear.Echoes(
        domain, like, tolerance=allowed, exact=draw.chance(0.2), wrap=wrap, device=inputs.device(draw), **options
    )
    rows = np.broadcast_to(options.get("weights", 1.0), like.n_rows) * (1.0 if like.weight is None else like.weight)
    M = matrix(like, points, wrap) * rows[:, None, None]
    x, other = draw.noise(len(points)), draw.noise(len(points))
    kind = A.dtype
    forward = M @ x.astype(kind)
    power = float(np.sqrt((abs(M) ** 2 @ abs(x) ** 2).sum()))
    tasks.near(
        (A @ x.astype(kind)).reshape(forward.shape), forward, allowed, max(np.linalg.norm(forward), power), "A x"
    )
    y = (M @ other).astype(kind)
    terms = np.einsum("pnx,pn->px", M.conj(), y.astype(np.complex128))
    image = terms.sum(axis=0)
    scale = max(float(np.linalg.norm(image)), float(np.linalg.norm(terms)))
    tasks.near(A.H @ y.ravel(), image, allowed, scale, "A.H y")


def fullwave(draw: Draw) -> None:
    """Waveform forming from few anchors against a run of the grid at every pulse, each to a tenth of the tolerance."""
    center = draw.log(1e8, 1e11)
    wavelength, n = C / center, draw.whole(4, 9)
    size = wavelength * draw.random.uniform(0.15, 0.7, 3)
    eps = draw.pick(None, None, None, 1.5 + 1.5 * draw.random.random())
    material: Any = "metal" if eps is None else sarcl.Material(eps_r=eps)
    scene = draw.pick(
        sarcl.shapes.box(size, material=material),
        sarcl.shapes.cylinder(size[0] / 2, size[1], material=material),
        sarcl.shapes.sphere(size[0] / 2, facets=320, material=material),
    )
    bearing, arc = draw.random.uniform(0, 2 * np.pi), draw.log(3e-2, 3.0)
    angles = bearing + arc * np.sort(draw.random.uniform(-0.5, 0.5, n))
    distance, slope = wavelength * draw.log(5, 1e6), draw.random.uniform(-1.2, 1.2)
    along = np.cos(slope) * np.stack([np.cos(angles), np.sin(angles)])
    track = sarcl.Trajectory(np.arange(n) / 100, distance * np.stack([*along, np.full(n, np.sin(slope))], axis=1))
    chirp = sarcl.Waveform.chirp(center=center, bandwidth=center * draw.log(1e-3, 0.2), duration=100 / center)
    options: dict[str, Any] = {"cells": 8 * np.sqrt(eps or 1), "model_error": False}
    options |= draw.pick({}, {"polarization": "VV"}, {"polarization": ("HH", "VH")})
    allowed = draw.log(1e-3, 1e-1)
    raw = sarcl.fullwave_echo(scene, chirp, track, tolerance=allowed, **options)
    if len(raw.report.plan["anchors"]) == n:
        return  # nothing was left out: nothing to compare
    every = sarcl.fullwave_echo(scene, chirp, track, tolerance=allowed / 10, anchors=range(n), **options)
    tasks.near(raw.samples[:], every.samples[:], allowed, what="echoes")
    tasks.expect(raw.report.predicted_error <= allowed * (1 + 1e-9), "more is predicted than allowed")


# Verb -> its kinds of tasks, which take turns
VERBS: dict[str, tuple[Task, ...]] = {
    "echo": (echo_tasks.points, echo_tasks.facets, echo_tasks.channels),
    "spectral_echo": (echo_tasks.spectral,),
    "backproject": (image_tasks.backproject, image_tasks.backproject, image_tasks.smooth),
    "polar_format": (image_tasks.polar_format,),
    "range_doppler": (image_tasks.range_doppler,),
    "linear.Echoes": (linear,),
    "fullwave_echo": (fullwave,),
}


class Late(BaseException):
    """A task that takes longer than PATIENCE."""


def late(*_: object) -> None:
    raise Late


def trial(verb: str, seed: int) -> tuple[str, float | None, str]:
    """Outcome of a task (right, refused, wrong, bare or hung), its error over the tolerance, and the text."""
    tasks.ratios.clear()
    kinds = VERBS[verb]
    outcome, text = "right", ""
    signal.setitimer(signal.ITIMER_PROF, PATIENCE)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            warnings.simplefilter("error", RuntimeWarning)
            kinds[seed % len(kinds)](Draw(seed))
    except Late:
        outcome, text = "hung", f"longer than {PATIENCE} CPU s"
    except Exception as exc:
        outcome, text = tasks.outcome(exc)
        if isinstance(exc, sarcl.ToleranceMissed):
            tasks.note(exc.measured, exc.tolerance)
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
    return outcome, max(tasks.ratios, default=None), text


def proceed(entry: dict[str, Any], verb: str, seconds: float) -> None:
    """Run STEP tasks more, fewer after `seconds`, and add them to the entry of the verb."""
    start = time.process_time()
    for _ in range(STEP):
        seed = entry["first"] + entry["tried"]
        entry["tried"] += 1
        note(entry, seed, *trial(verb, seed))
        if time.process_time() - start > seconds:
            break
    entry["seconds"] = round(entry["seconds"] + time.process_time() - start, 1)


def note(entry: dict[str, Any], seed: int, outcome: str, ratio: float | None, text: str) -> None:
    """Add the outcome of a task to the entry of its verb."""
    ratio = None if ratio is None else float(f"{ratio:.3g}")
    if outcome == "refused":
        entry["refused"] += 1
    elif outcome != "right":
        entry["failures"].append({"seed": seed, "outcome": outcome, "text": text, "ratio": ratio})
    if outcome != "refused" and ratio is not None:
        entry["ratios"].append(ratio)


def try_again(entry: dict[str, Any], verb: str) -> None:
    """Run the tasks again that failed; what is right now is listed as mended."""
    failures, entry["failures"] = entry["failures"], []
    for failure in failures:
        if failure["ratio"] is not None:
            entry["ratios"].remove(failure["ratio"])
        before = len(entry["failures"])
        note(entry, failure["seed"], *trial(verb, failure["seed"]))
        if len(entry["failures"]) == before:
            entry["mended"].append(failure)


def run(path: Path, number: int, verbs: list[str], seconds: float) -> dict[str, Any]:
    """Continue the trial in the file: verbs take turns until `number` tasks of each are compared, or `seconds` over."""
    document = json.loads(path.read_text()) if path.exists() else {**header([open_device(None)]), "kind": "contract"}
    entries = document.setdefault("verbs", {})
    for verb in verbs:
        first = list(VERBS).index(verb) * SEEDS
        fresh = {"first": first, "tried": 0, "refused": 0, "failures": [], "seconds": 0.0, "ratios": []}
        entry = entries.setdefault(verb, fresh)
        entry.setdefault("mended", [])
        try_again(entry, verb)
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(document) + "\n")
    start = time.process_time()
    while todo := [verb for verb in verbs if len(entries[verb]["ratios"]) < number]:
        for verb in todo:
            proceed(entries[verb], verb, seconds - (time.process_time() - start))
            path.write_text(json.dumps(document) + "\n")
            print(line(verb, entries[verb]), flush=True)
        if time.process_time() - start > seconds:
            break
    return document


def held(entry: dict[str, Any]) -> int:
    """Compared tasks without a failure."""
    return len(entry["ratios"]) - sum(failure["ratio"] is not None for failure in entry["failures"])


def line(verb: str, entry: dict[str, Any]) -> str:
    """The state of a verb for the terminal."""
    ratios = entry["ratios"] or [0.0]
    return (
        f"{verb}: {held(entry)} of {len(entry['ratios'])} held, worst {max(ratios):.3g}, median {np.median(ratios):.2g}"
        f", {entry['refused']} refused of {entry['tried']}, {entry['seconds']:.0f} CPU s, "
        f"{len(entry['failures'])} failures {[f['seed'] for f in entry['failures']]}"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("-n", type=int, default=300, help="compared tasks of each verb")
    parser.add_argument("--verb", nargs="+", choices=list(VERBS), default=list(VERBS))
    parser.add_argument("--seconds", type=float, default=1200, help="CPU seconds of this run")
    parser.add_argument("--json", type=Path, default=RESULT)
    parser.add_argument("--seed", nargs=2, metavar=("VERB", "SEED"), help="one task, printed")
    options = parser.parse_args()
    signal.signal(signal.SIGPROF, late)
    facet_plan.MOST_FACETS = MOST_FACETS
    if options.seed:
        print(trial(options.seed[0], int(options.seed[1])))
        return
    run(options.json, options.n, options.verb, options.seconds)


if __name__ == "__main__":
    main()
