"""Channels of arrays: run time against achieved error, and how it grows with their number.

    python bench/channels.py --json bench/results/4-channels-pocl.json

growth   points in front of 9, 45 and 450 elements half a wavelength apart, each with its own carrier, 900 MHz in all:
         with one call of echo; with one call and every channel computed; with one call per element as a single antenna
one      9, 45 and 450 elements with one carrier: `AntennaArray.linear` without a step, the same array given element by
         element, every element computed (not for 450), and a single element
many     450 transmitters and 450 receivers, written to a file within 100 MB

A contribution is one scatterer in one pulse from one transmitter to one receiver. Errors are measured by echo's own
check against exact sums. Runs alternate; the shortest counts. Compiling is not included.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

import sarcl
from sarcl.experiments.fda.case import Case

BAND, PULSES = 900e6, 101
POINTS = {"100 points in 1 m": (100, 0.5), "10 000 points in 5 m": (10_000, 2.5)}
OTHERS = {"zero reflectivity", "facing away", "range window", "out of beam"}
Row = dict[str, Any]


def main() -> None:
    """Measure, print the tables, and write the JSON file."""
    import channels_page

    from sarcl.bench import documents
    from sarcl.opencl.choose_device import open_device

    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--repeats", type=int, default=3)
    parser.add_argument("--device", default=None)
    parser.add_argument("--json", type=Path)
    args = parser.parse_args()
    document = documents.header([open_device(args.device)])
    document |= {"kind": "channels", "pulses": PULSES, "growth": [], "one": [], "many": []}
    for name, part in (("growth", growth), ("one", one), ("many", many)):
        document[name] = part(args)
        if args.json:  # what comes later may fail
            documents.write(document, args.json)
    document["machine"]["load"] += documents.load()
    print(channels_page.section("channels", document))
    if args.json:
        documents.write(document, args.json)


def growth(args: argparse.Namespace) -> list[Row]:
    """Rows for every number of channels and points."""
    out = []
    for name, (count, half) in POINTS.items():
        for n in (9, 45, 450):
            case = Case("growth", n=n, frequency_step=BAND / n, n_pulses=PULSES, mirrored=False)
            what = scatter(count, half), sarcl.Waveform.tone(center=case.center, duration=n / BAND), case.track()
            options: Row = {"reference": (0, 0, 0), "range_window": (-half - 2, half + 2), "tolerance": 1e-3}
            options["device"] = args.device
            array = case.array()
            ways = {
                "one call": partial(sarcl.echo, *what, array=array, **options),
                "one call, each channel made": partial(
                    sarcl.echo, *what, array=array, skip=OTHERS | {"equal channels"}, **options
                ),
                "one call per channel": partial(singly, *what, array, options),
            }
            out += measured(args, name, n, n * PULSES * count, ways)
    return out


def singly(scene: Any, tone: Any, track: Any, array: Any, options: Row, *, check: bool) -> Any:
    """One call per element as a single antenna; returns the echoes with the largest error of nine that are checked."""
    made, some = [], max(1, array.n // 9)
    for i, (place, offset) in enumerate(zip(array.positions, array.offsets[0], strict=True)):
        wave = replace(tone, center=tone.center + float(offset))
        moved = replace(track, positions=track.positions + place)
        made.append(sarcl.echo(scene, wave, moved, receiver=track, check=check and i % some == 0, **options))
    return max(made, key=lambda raw: (raw.report.measured_error or 0.0, raw.report.predicted_error))


def one(args: argparse.Namespace) -> list[Row]:
    """Rows for arrays with one carrier."""
    out = []
    scene, tolerance = scatter(20_000, 5.0), 1e-3
    chirp = sarcl.Waveform.chirp(center=10e9, bandwidth=300e6, duration=1e-6)
    for n in (9, 45, 450):
        track = Case("one", n=n, n_pulses=PULSES).track()
        even = sarcl.AntennaArray.linear(n, spacing=0.015, axis=(0, -1, 0))
        listed = sarcl.AntennaArray(positions=even.positions, offsets=np.zeros((1, n)))

        made = partial(
            sarcl.echo, scene, chirp, track, reference=(0, 0, 0), tolerance=tolerance, device=args.device
        )  # fmt: skip
        ways = {"without a step": partial(made, array=even), "listed": partial(made, array=listed)}
        if n < 100:
            ways["each element made"] = partial(made, array=even, skip=OTHERS)
        out += measured(args, "20 000 points in 10 m", n, n * PULSES * 20_000, ways | {"a single element": made})
    return out


def many(args: argparse.Namespace) -> list[Row]:
    """Rows for 450 transmitters and 450 receivers, into a file."""
    case = Case("many", n=450, frequency_step=2e6, n_pulses=PULSES, mirrored=False)
    tone = sarcl.Waveform.tone(center=case.center, duration=1 / 2e6)
    out = []
    with tempfile.TemporaryDirectory() as folder:
        for name, (count, half) in POINTS.items():
            scene = scatter(count, half)
            call = partial(
                sarcl.echo, scene, tone, case.track(), array=case.array(), receive="all", reference=(0, 0, 0),
                range_window=(-36, 36), tolerance=1e-3, max_bytes=1e8, out=Path(folder) / "raw.h5", device=args.device,
            )  # fmt: skip
            ways = {"one call": call}
            out += measured(args, name, 450 * 450, 450 * 450 * PULSES * count, ways)
    return out


def scatter(count: int, half: float) -> sarcl.Scene:
    """Points within `half` m of the origin."""
    random = np.random.default_rng(0)
    return sarcl.Scene.points(random.uniform(-half, half, (count, 3)) * [1, 1, 0.1], random.normal(size=count) + 0j)


def measured(
    args: argparse.Namespace, name: str, n: int, contributions: int, ways: dict[str, Callable[..., Any]]
) -> list[Row]:
    """A row for each way; runs alternate, after one run that builds kernels."""
    rows: dict[str, Row] = {}
    for turn in range(args.repeats + 1):
        for way, call in ways.items():
            start = time.perf_counter()
            raw = call(check=turn == 0)
            seconds = time.perf_counter() - start
            row = rows.setdefault(
                way,
                {"scene": name, "n": n, "way": way, "contributions": contributions, "seconds": [],
                 "error": raw.report.measured_error, "predicted": raw.report.predicted_error,
                 "visited": raw.report.contributions_done, "positions": raw.report.plan.get("array positions")},
            )  # fmt: skip
            if turn:
                row["seconds"].append(seconds)
    return list(rows.values())


if __name__ == "__main__":
    sys.exit(main())
