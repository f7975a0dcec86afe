"""Every kernel beside the ceilings of this machine: operations, bytes, the share that is reached, and what limits it.

    python bench/roofline.py [--rounds 3] [--only TEXT] [--json FILE]

The calls are those of `sarcl bench` at one size, and some more. All of them run in a process that builds the kernels,
in one that counts what they do (operation_counts.py), and for some rounds in one that is timed. A launch is timed from
an empty queue to an empty queue, in CPU seconds of the process, which other programs hardly affect; the best round
counts. Ceilings are the rates of the kernels of ceilings.py, counted and timed in the same way.

Bytes of memory are those of all buffers of a launch, once, but no more than the kernel loads and stores: what memory
moves where caches are ideal.
"""

from __future__ import annotations

import argparse
import functools
import json
import os
import re
import subprocess
import sys
import tempfile
import threading
import time
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any
from unittest import mock

import ceilings
import numpy as np
import operation_counts

import sarcl
from sarcl.bench.documents import header
from sarcl.bench.verbs import TASKS
from sarcl.fullwave.fields import Fields
from sarcl.fullwave.lattice import LANES, Lattice
from sarcl.fullwave.target import Target
from sarcl.opencl.choose_device import open_device
from sarcl.opencl.device import Device
from sarcl.opencl.failures import buffer_bytes

KERNELS = Path(__file__).parents[1] / "kernels"
RESULT = Path(__file__).parents[1] / "bench" / "results" / "trials" / "roofline.json"
TOLERANCE = 1e-2
# n of the task of each verb in `sarcl bench`: a few CPU seconds in all
SIZES = {
    "echo of points": 512, "echo of facets": 64, "echo with edges": 16, "echo with bounces": 8,
    "radar cross section": 8, "spectral echo": 1024, "channels of an array": 450, "beam of an array": 256,
    "backproject": 1024, "polar format": 1024, "range-Doppler": 1024, "full wave": 16,
}  # fmt: skip
FINE = {"echo of points": (128, 1e-6), "backproject": (128, 1e-8)}  # n, and tolerance
CELLS, TIME_STEPS = 160, 16  # side of a full-wave grid that exceeds caches, and its time steps
Call = Callable[[Device], object]
Measured = dict[str, float]


class Launches:
    """What kernels cost in a call: {(file, kernel): {quantity: sum over launches}}.

    counters  of instrumented kernels; without them launches are timed alone
    """

    def __init__(self, counters: operation_counts.Counters | None = None) -> None:
        self.rows: dict[tuple[str, str], Measured] = {}
        self._files: dict[Any, str] = {}
        self._counters, self._lock = counters, threading.RLock()
        self._launch, self._build = Device.run, Device.kernel

    def kernel(self, device: Device, file: str, name: str, **macros: int) -> Any:
        """Device.kernel, which remembers the file."""
        built = self._build(device, file, name, **macros)
        self._files[built] = file
        return built

    def run(self, device: Device, kernel: Any, *args: Any, **options: Any) -> None:
        """Device.run, measured."""
        with self._lock:
            device.finish()
            start = time.process_time()
            self._launch(device, kernel, *args, **options)
            device.finish()
            cost = {"cpu_seconds": time.process_time() - start, "launches": 1.0}
            if self._counters is not None:
                counts = self._counters.take()
                cost |= counts | {"memory": min(counts["bytes"], float(buffer_bytes(args[2:])))}
            row = self.rows.setdefault((self._files.get(kernel, ceilings.FILE), kernel.function_name), {})
            for name, value in cost.items():
                row[name] = row.get(name, 0.0) + value

    def of(self, call: Call, device: Device) -> list[dict[str, Any]]:
        """Rows of a call, and of the whole of it, whose kernel is ""."""
        self.rows = {}
        with (
            mock.patch.object(Device, "run", lambda *args, **options: self.run(*args, **options)),
            mock.patch.object(Device, "kernel", lambda *args, **macros: self.kernel(*args, **macros)),
        ):
            start = time.process_time()
            call(device)
            self.rows["", ""] = {"cpu_seconds": time.process_time() - start}
        return [{"file": file, "kernel": name, **row} for (file, name), row in self.rows.items()]


def calls() -> dict[str, Call]:
    """Calls by name, ceilings first."""
    out: dict[str, Call] = {"ceilings": ceilings.launch_all}
    for verb, n in SIZES.items():
        for method in TASKS[verb].methods:
            out[", ".join(filter(None, (verb, method)))] = functools.partial(bench_task, verb, n, method, TOLERANCE)
    for verb, (n, tolerance) in FINE.items():
        out[f"{verb}, tolerance {tolerance:.0e}"] = functools.partial(
            bench_task, verb, n, TASKS[verb].methods[0], tolerance
        )
    return out | {
        "backproject, list of points": listed,
        "linear.Echoes, exact": linear,
        "spectral echo of facets": spectral_facets,
        "full wave, dielectric": dielectric,
        "time steps of a large grid": time_steps,
    }


@functools.cache
def case(verb: str, n: int) -> Any:
    """The case of a verb's task, made once."""
    return TASKS[verb].make(verb, n)


def bench_task(verb: str, n: int, method: str, tolerance: float, device: Device) -> None:
    """The call of a verb's task in `sarcl bench`."""
    options = {"method": method} if method else {}
    case(verb, n).call(tolerance=tolerance, device=device, check=False, **options)


def noise() -> sarcl.PhaseHistory:
    """512 pulses of noise, 300 MHz at 9.6 GHz, from 9.9 km."""
    n = 512
    tx = np.stack([np.full(n, -7e3), np.linspace(-150, 150, n), np.full(n, 7e3)], axis=1)
    samples = np.random.default_rng(0).standard_normal((n, 2 * n), np.float32).view(np.complex64)
    return sarcl.PhaseHistory(
        samples, frequency=9.45e9, frequency_step=3e8 / n, tx=tx, reference_range=np.linalg.norm(tx, axis=1)
    )


def scattered(count: int) -> np.ndarray:
    """Positions, m (count, 3), in no order."""
    return np.random.default_rng(1).uniform(-30, 30, (count, 3)) * [1, 1, 0.1]


def listed(device: Device) -> None:
    """An image at points in no order."""
    grid = sarcl.ImageGrid.points(scattered(2**17))
    sarcl.backproject(noise(), grid, method="direct", tolerance=TOLERANCE, check=False, device=device)


def linear(device: Device) -> None:
    """Echoes and gradients of points by an operator in float64."""
    positions, raw = scattered(2**13), noise()
    operator = sarcl.linear.Echoes(positions, raw, tolerance=TOLERANCE, exact=True, device=device)
    operator.gradients(np.ones(len(positions), complex), operator @ np.ones(len(positions), complex))


def spectral_facets(device: Device) -> None:
    """Spectral echoes of a hilly field of 2 x 64 x 64 facets beside a straight track of 512 pulses."""
    line = sarcl.Trajectory.line(start=(0, -100, 6e3), velocity=(0, 100, 0), prf=250, n_pulses=512)
    track = sarcl.pointing.stripmap(line, look=np.radians(50), side="right")
    x = np.linspace(-20, 20, 65)
    rough = sarcl.Material(eps_r=4.0, height=np.inf, diagram="cos")
    hills = sarcl.Scene.from_heights(
        x + 6e3 * np.tan(np.radians(50)), x, np.outer(np.sin(x), np.cos(x)), material=rough
    )
    chirp = sarcl.Waveform.chirp(center=9.6e9, bandwidth=3e8, duration=1e-6)
    antenna = sarcl.Antenna.gaussian(width=(0.012, 0.5))
    sarcl.spectral_echo(hills, chirp, track, antenna=antenna, tolerance=TOLERANCE, check=False, device=device)


def dielectric(device: Device) -> None:
    """Full-wave echoes of a dielectric sphere of 0.4 wavelengths: 8 pulses of 1 GHz, over 0.2 rad."""
    sphere = sarcl.shapes.sphere(0.06, facets=320, material=sarcl.Material(eps_r=2.5))
    chirp = sarcl.Waveform.chirp(center=1e9, bandwidth=1e8, duration=1e-7)
    angles = np.linspace(-0.1, 0.1, 8)
    track = sarcl.Trajectory(None, 100 * np.stack([np.cos(angles), np.sin(angles), 0.5 + 0 * angles], axis=1))
    sarcl.fullwave_echo(sphere, chirp, track, cells=13, tolerance=TOLERANCE, model_error=False, device=device)


def time_steps(device: Device) -> None:
    """Time steps of an empty full-wave grid."""
    grid = Lattice(0.01, (CELLS, CELLS, -(-CELLS // LANES) * LANES), np.zeros(3))
    Fields(device, grid, Target.nothing(), absorber=0, tile=10_000).advance(TIME_STEPS)


def child(part: str, only: str, file: Path, libraries: list[Path]) -> None:
    """One run of the calls in this process, counted where there are libraries; written to a file."""
    device = open_device("cpu")
    launches = Launches(operation_counts.Counters(libraries) if part == "count" else None)
    warnings.simplefilter("ignore", sarcl.SarclWarning)
    rows = []
    for name, call in chosen(only).items():
        rows += [{"call": name, **row} for row in launches.of(call, device)]
    file.write_text(json.dumps(rows))


def chosen(only: str) -> dict[str, Call]:
    """Calls whose names contain a text, and the ceilings."""
    return {name: call for name, call in calls().items() if only in name or name == "ceilings"}


def counted(only: str, device: Device) -> list[dict[str, Any]]:
    """What every kernel of the calls does."""
    clang = operation_counts.clang_of(device.context.devices[0].platform.version)
    processor = re.sub(r"^(?:pthread|basic|cpu)-(?:minimal-)?", "", device.info.name).rpartition("-")[0]
    with tempfile.TemporaryDirectory() as folder:
        cache, libraries = Path(folder), Path(folder, "libraries.json")
        environment = {**os.environ, "POCL_CACHE_DIR": folder, **operation_counts.LEAVE_CODE}
        command = [sys.executable, __file__, "--only", only, "--libraries", str(libraries), "--json"]
        subprocess.run([*command, str(cache / "built.json"), "--part", "build"], env=environment, check=True)
        paths = operation_counts.instrument(cache, clang, processor)
        libraries.write_text(json.dumps([str(path) for path in paths]))
        subprocess.run([*command, str(cache / "counted.json"), "--part", "count"], env=environment, check=True)
        return list(json.loads((cache / "counted.json").read_text()))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--only", default="", help="calls whose names contain this")
    parser.add_argument("--json", type=Path, default=RESULT)
    parser.add_argument("--part", choices=("build", "count"), help=argparse.SUPPRESS)
    parser.add_argument("--libraries", type=Path, help=argparse.SUPPRESS)
    asked = parser.parse_args()
    if asked.part:
        libraries = [Path(path) for path in json.loads(asked.libraries.read_text())] if asked.part == "count" else []
        child(asked.part, asked.only, asked.json, libraries)
        return
    device = open_device("cpu")
    warnings.simplefilter("ignore", sarcl.SarclWarning)
    rows = counted(asked.only, device)
    ceilings.verified(rows, device.info.vector_width)
    launches = Launches()
    once = {(row["call"], row["file"], row["kernel"]): row.get("launches") for row in rows}
    fastest: dict[tuple[str, str, str], float] = {}
    for _ in range(asked.rounds + 1):  # the first round builds kernels
        for name, call in chosen(asked.only).items():
            for row in launches.of(call, device):
                key = name, row["file"], row["kernel"]
                if row.get("launches") != once.get(key):
                    raise RuntimeError(
                        f"{key} is launched {row.get('launches')} times, but {once.get(key)} when counted"
                    )
                fastest[key] = min(fastest.get(key, np.inf), row["cpu_seconds"])
    for row in rows:
        row["cpu_seconds"] = fastest[row["call"], row["file"], row["kernel"]]
    document = {
        **header([device]),
        "kind": "roofline",
        "command": "python bench/roofline.py",
        "ceilings": ceilings.rates(rows),
    }
    document["kernels"] = rows
    document["unused"] = sorted({path.name for path in KERNELS.glob("*.cl")} - {row["file"] for row in rows})
    asked.json.write_text(json.dumps(document, indent=1) + "\n")
    print(document["ceilings"])


if __name__ == "__main__":
    main()
