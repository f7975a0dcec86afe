"""sarcl as a competitor: one row for each device, method and tolerance."""

from __future__ import annotations

import json
import re
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any, cast

from ..opencl import device_list
from ..opencl.device import Device
from ._cases import BenchCase
from ._competitor import Absent, Competitor, Reading

BEFORE = ("plan",)  # stages of a report that depend on geometry and tolerance alone


def competitors(
    case: BenchCase, folder: Path, devices: Sequence[Device], methods: Sequence[str], tolerances: Sequence[float]
) -> list[Competitor]:
    """sarcl on every device, by every method, at every tolerance; `folder` holds the saved case."""
    return [
        _competitor(case, folder, device, method, tolerance)
        for device in devices
        for method in methods
        for tolerance in tolerances
    ]


def describe(device: Device) -> str:
    """A short unique description of a device: platform, processor, and whether float64 is disabled."""
    info = device.info
    platform = "PoCL" if info.platform == "Portable Computing Language" else info.platform.split()[0].split("(")[0]
    name = re.sub(r"^(pthread|cpu)-[^ ]*-", "", info.name)  # PoCL puts its target before the processor's name
    words = name if platform.lower() in name.lower() else f"{platform} {name}"
    alike = [d for d in device_list.devices() if d.works and (d.platform, d.name) == (info.platform, info.name)]
    return words + (f" ({info.index})" if len(alike) > 1 else "") + ("" if info.fp64 else ", no float64")


def _competitor(case: BenchCase, folder: Path, device: Device, method: str, tolerance: float) -> Competitor:
    def run() -> Reading:
        from ..imaging.backproject import backproject

        start, busy = time.perf_counter(), time.process_time()
        image = backproject(
            case.raw, case.grid, tolerance=tolerance, method=cast(Any, method), device=device, check=False
        )
        call, busy = time.perf_counter() - start, time.process_time() - busy
        report = image.report
        assert report is not None  # backproject always gives one
        seconds = {
            "call": call,
            "form": call - sum(report.seconds.get(stage, 0.0) for stage in BEFORE),
            "kernel": report.seconds["backproject"],
        }
        if device.is_cpu:
            seconds["cpu"] = busy
        total = report.contributions_done + sum(report.contributions_skipped.values())
        notes = {
            "predicted": report.predicted_error,
            "plan": dict(report.plan),
            "skipped": 1 - report.contributions_done / total,
        }
        return Reading(image.data[case.at[0], case.at[1]], seconds, notes)

    def process() -> float:
        options = {"tolerance": tolerance, "method": method, "device": device.info.index, "fp64": device.info.fp64}
        command = [sys.executable, "-m", "sarcl.bench.one_shot", str(folder), json.dumps(options)]
        start = time.perf_counter()
        done = subprocess.run(command, capture_output=True, text=True)
        seconds = time.perf_counter() - start
        if done.returncode:
            raise Absent(f"the process ended with {done.returncode}: {done.stderr.strip()[-400:]}")
        return seconds

    info = device.info
    facts = {"tolerance": tolerance, "kind": info.kind, "fp64": info.fp64}
    return Competitor("sarcl", describe(device), method, f"{tolerance:.0e}", run, process, facts)
