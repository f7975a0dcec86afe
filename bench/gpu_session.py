"""What a GPU does in half an hour: accuracy of every verb, rates against true errors, echoes, FDTD, memory, threads.

    python bench/gpu_session.py [--stages rate,echoes] [--json gpu_session.json] [--device ...] [--limit S] [--small]

Each stage runs in a process of its own with a time limit; a stage that fails or hangs is recorded, and the next begins.
Each measurement is a row {stage, name, ok, wall, ...} of the JSON file as soon as it ends. --small: sizes for a dry run
on a CPU. --limit: seconds of all stages together. The exit status is 1 where a row failed or an error was too large.

    device   the device and its driver, and the errors of its own sine and cosine; always first
    correct  every verb, with and without float64: error against an exact result, predicted error
    rate     8192 x 8192 pixels, 11 566 pulses from 770 km: pulses x pixels per second against the error achieved
    public   the public GPU benchmark's setting in NumPy: linear interpolation of profiles that are not oversampled
    echoes   contributions per second, time per stage
    fdtd     cells per second of the full-wave time steps
    sizes    images of other sizes
    memory   the largest image within less memory than it needs
    threads  four threads on one device get the bits of one
"""

from __future__ import annotations

import argparse
import functools
import itertools
import json
import math
import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from sarcl.bench.verbs import VerbCase
    from sarcl.model.image_grid import ImageGrid
    from sarcl.model.phase_history import PhaseHistory
    from sarcl.opencl.device import Device

Row = dict[str, object]
TOLERANCES = (1e-1, 1e-2, 1e-3, 1e-4, 1e-5)
FINEST = {"echo of points": 1e-5, "backproject": 1e-5}  # tolerance measured beside those of the verb's task
ECHOES = ("echo of points", "echo of facets", "echo with edges", "echo with bounces", "spectral echo")
IMAGES = ("backproject", "polar format", "range-Doppler")
METHODS = ("direct", "factorized")
CHECKED = 1024  # pixels that are compared with the exact sum
RUNS = 3  # of a measurement of time, after the one that builds the kernels
LIBRARIES = "/usr/local/nvidia/lib64", "/usr/local/nvidia/lib", "/usr/lib/x86_64-linux-gnu", "/usr/lib64"  # folders


@dataclass(frozen=True)
class Session:
    """One stage: the JSON file, the stage's name, the device's name, and whether sizes are those of a dry run."""

    path: Path
    stage: str
    device_name: str | None
    small: bool

    def device(self) -> Device:
        """The open device."""
        from sarcl.opencl.choose_device import open_device

        return open_device(self.device_name)

    def measure(self, name: str, work: Callable[[], Row]) -> None:
        """Write one row: the result of `work`, or the error that it raised."""
        start = time.perf_counter()
        try:
            row = {"ok": True, **work()}
        except Exception as exc:
            row = {"ok": False, "error_text": f"{type(exc).__name__}: {exc}"[:1000]}
        append(self.path, {"stage": self.stage, "name": name, "wall": time.perf_counter() - start, **row})


def document_of(path: Path) -> dict[str, list[Row]]:
    """The document as far as it is written."""
    return json.loads(path.read_text())


def append(path: Path, row: Row) -> None:
    """One more row of the document, which is on the disk when this returns."""
    from sarcl.bench import documents

    document = document_of(path)
    document["rows"].append(row)
    documents.write(document, path)
    print(", ".join(f"{k} {v:.4g}" if isinstance(v, float) else f"{k} {v}" for k, v in row.items())[:300], flush=True)


def setting(small: bool, n_pulses: int = 0) -> tuple[PhaseHistory, ImageGrid]:
    """White noise along the track of the public benchmark, by default all its pulses, and the grid of its pixels."""
    import sarcl
    from sarcl.bench import spaceborne

    n = 128 if small else spaceborne.SIDE
    raw = spaceborne.phase_history(white(spaceborne.pulses(n) if small or not n_pulses else n_pulses, n))
    return raw, sarcl.ImageGrid.plane(shape=(n, n), spacing=spaceborne.SPACING)


def white(n_pulses: int, n_samples: int) -> np.ndarray:
    """White noise, complex64 (n_pulses, n_samples), seeded."""
    random = np.random.default_rng(1)
    return random.standard_normal((n_pulses, 2 * n_samples), np.float32).view(np.complex64)


def verb_row(case: VerbCase, device: Device, tolerance: float, *, runs: int, check: bool, method: str) -> Row:
    """The error of a verb's result where it is checked, and seconds of `runs` more calls; method "": it has none."""
    call = functools.partial(case.call, tolerance=tolerance, device=device, **({"method": method} if method else {}))
    row: Row = {"verb": case.scene, "n": case.n, "method": method, "tolerance": tolerance, "fp64": device.info.fp64}
    result = call(check=check)
    if check:
        error = case.compare(result)[0]
        row |= {"error": error, "within": bool(error <= tolerance)}
    if runs:
        row |= (times := timed(functools.partial(call, check=False), runs)[1])
        row["M_per_s"] = case.pairs / min(times["seconds"]) / 1e6
    return row | reported(result)


def timed(work: Callable[[], object], runs: int) -> tuple[object, dict[str, list[float]]]:
    """The last result of so many runs, and their seconds by the clock and of the processors."""
    seconds, cpu = [], []
    for _ in range(runs):
        start, busy = time.perf_counter(), time.process_time()
        result = work()
        seconds.append(time.perf_counter() - start)
        cpu.append(time.process_time() - busy)
    return result, {"seconds": seconds, "cpu": cpu}


def reported(result: object) -> Row:
    """What a report says: predicted error, seconds of each stage, plan; nothing of an array."""
    report = getattr(result, "report", None)
    if report is None:
        return {}
    return {"predicted": report.predicted_error, "stages": dict(report.seconds), "plan": dict(report.plan)}


# Stages


def device(session: Session) -> None:
    """Machine, device and driver become the head of the document."""
    from sarcl.bench import documents
    from sarcl.opencl.native_functions import sincos_error

    def work() -> Row:
        opened = session.device()
        documents.write(document_of(session.path) | documents.header([opened]), session.path)
        return {"info": asdict(opened.info), "native_sincos_error": sincos_error(opened)}

    session.measure("device", work)
    if program := shutil.which("nvidia-smi"):
        text = subprocess.run([program], capture_output=True, text=True, timeout=20).stdout
        append(session.path, {"stage": session.stage, "name": "nvidia-smi", "ok": True, "text": text[:2000]})


def correct(session: Session) -> None:
    """Every verb, with and without float64."""
    from sarcl.bench.verbs import TASKS

    opened = session.device()
    devices = [opened, opened.without_fp64()] if opened.info.fp64 else [opened]
    for name, task in TASKS.items():
        case = task.make(name, task.quick_sizes[0 if session.small else -1])
        tolerances = task.tolerances[1:2] if session.small else (*task.tolerances, *filter(None, [FINEST.get(name)]))
        methods = task.methods[:1] if session.small else task.methods
        for method, tolerance, on in itertools.product(methods, tolerances, devices):
            words = [name, method, f"{tolerance:.0e}", "" if on.info.fp64 else "no float64"]
            work = functools.partial(verb_row, case, on, tolerance, runs=0, check=True, method=method)
            session.measure(", ".join(filter(None, words)), work)


def rate(session: Session) -> None:
    """The largest image at every tolerance by both methods: rates, and errors at random pixels."""
    import sarcl
    from sarcl.bench import exact

    opened, (raw, grid) = session.device(), setting(session.small)
    n_pulses, n = raw.samples.shape
    index, points = grid.sample(CHECKED, seed=1)
    wanted, norm = exact.backproject(raw, points)

    def image(method: str, tolerance: float) -> Row:
        options = {"tolerance": tolerance, "method": method, "check": False, "device": opened}
        result, times = timed(lambda: sarcl.backproject(raw, grid, **options), 1 if session.small else RUNS)
        error = exact.relative(result.data[index], wanted, norm)[0]
        row = {"method": method, "tolerance": tolerance, "error": error, "dB": decibels(error)}
        row |= {"within": bool(error <= tolerance), "G_per_s": n_pulses * n * n / min(times["seconds"]) / 1e9}
        return row | times | reported(result)

    for method, tolerance in itertools.product(METHODS, TOLERANCES):
        session.measure(f"{n}^2 x {n_pulses}, {method}, {tolerance:.0e}", functools.partial(image, method, tolerance))


def public(session: Session) -> None:
    """Linear interpolation of profiles with one sample per 1/bandwidth: errors against the exact sum."""
    from sarcl.bench import baseline, exact, spaceborne

    raw, grid = setting(session.small)
    points, n = grid.sample(CHECKED, seed=1)[1], raw.n_samples

    def work(weights: np.ndarray) -> Row:
        weighted = spaceborne.phase_history(raw.samples * weights.astype(np.float32))
        error = exact.relative(baseline.backproject(weighted, points, finer=1), *exact.backproject(weighted, points))[0]
        return {"error": error, "dB": decibels(error)}

    for window, weights in (("Hamming", np.hamming(n)), ("none", np.ones(n))):
        session.measure(f"linear, upsampling 1, window {window}", functools.partial(work, weights))


def decibels(error: float) -> float:
    """20 log10 of a relative error."""
    return 20 * math.log10(error)


def echoes(session: Session) -> None:
    """Echoes of points, facets, edges, several reflections, and by Fourier transforms; `correct` has their errors."""
    for name in ECHOES:
        verb_rates(session, name, (-1,), (1e-2,), check=False)


def sizes(session: Session) -> None:
    """Images of growing size, the small ones too small to fill a GPU."""
    for name in IMAGES:
        verb_rates(session, name, (0, 1, 2), (1e-2,) if name == "range-Doppler" else (1e-2, 1e-3), check=True)


def verb_rates(
    session: Session, name: str, places: tuple[int, ...], tolerances: tuple[float, ...], *, check: bool
) -> None:
    """Rates of a verb at sizes[i] of its task for i of `places`; of a dry run at its least size."""
    from sarcl.bench.verbs import TASKS

    opened, task, runs = session.device(), TASKS[name], 1 if session.small else RUNS
    for n in [task.quick_sizes[0]] if session.small else [task.sizes[i] for i in places]:
        case = task.make(name, n)
        for method, tolerance in itertools.product(task.methods, tolerances[:1] if session.small else tolerances):
            words = ", ".join(filter(None, [name, f"{n}", method, f"{tolerance:.0e}"]))
            options = {"runs": runs, "check": check, "method": method}
            session.measure(words, functools.partial(verb_row, case, opened, tolerance, **options))


def fdtd(session: Session) -> None:
    """Cells per second of bench/full_wave.py."""
    import full_wave

    opened = session.device()

    def work(n: int) -> Row:
        shape, rates = full_wave.measure(opened, n, 16 if session.small else 480)
        return {"cells": shape, "M_cells_per_s": {case: float(value[0]) for case, value in rates.items()}}

    for n in (48,) if session.small else (128, 200, 320, 512):
        session.measure(f"{n}^3", functools.partial(work, n))


def memory(session: Session) -> None:
    """An image within less memory than it would take, and ten times the device's, which must not break the device."""
    import sarcl

    opened, (raw, grid) = session.device(), setting(session.small, 4096)
    options = {"tolerance": 1e-3, "method": "direct", "check": False, "device": opened}

    def work(bound: float | None) -> Row:
        result, times = timed(lambda: sarcl.backproject(raw, grid, max_bytes=bound, **options), 1)
        return times | reported(result)

    for bound in (None, 8e9, 2e9, 5e8, 10.0 * opened.info.memory):
        session.measure("max_bytes " + (f"{bound:.3g}" if bound else "not given"), functools.partial(work, bound))


def threads(session: Session) -> None:
    """The same image by four threads at once and alone."""
    import sarcl
    from sarcl.bench import spaceborne

    opened, n = session.device(), 64 if session.small else 512
    raw = spaceborne.phase_history(white(n, n))
    grid = sarcl.ImageGrid.plane(shape=(n, n), spacing=spaceborne.SPACING)

    def image() -> np.ndarray:
        return sarcl.backproject(raw, grid, tolerance=1e-3, method="direct", check=False, device=opened).data

    def work() -> Row:
        alone = image()
        with ThreadPoolExecutor(4) as pool:
            others = list(pool.map(lambda _: image(), range(4)))
        return {"within": all(np.array_equal(alone, other) for other in others)}

    session.measure("four threads", work)


LIMITS: Mapping[Callable[[Session], None], float] = {  # s of each stage, in the order in which they run
    device: 120,
    correct: 600,
    rate: 300,
    public: 150,
    echoes: 200,
    fdtd: 120,
    sizes: 150,
    memory: 90,
    threads: 60,
}
STAGES = {work.__name__: work for work in LIMITS}


def process(command: list[str], limit: float) -> Row:
    """Run a command for at most `limit` seconds: whether it ended well, how it ended, and its seconds."""
    start = time.perf_counter()
    try:
        status = subprocess.run(command, timeout=max(limit, 0.0)).returncode
        end = f"exit status {status}"
    except subprocess.TimeoutExpired:
        status, end = -1, f"ended at its limit of {limit:.0f} s"
    return {"ok": status == 0, "end": end, "seconds": time.perf_counter() - start}


def vendor_folder(folder: Path) -> dict[str, str]:
    """OCL_ICD_VENDORS for NVIDIA's driver where no .icd file of the system names it, as in most containers."""
    if "OCL_ICD_VENDORS" in os.environ or any(Path("/etc/OpenCL/vendors").glob("*nvidia*")):
        return {}
    libraries = [path for place in LIBRARIES for path in sorted(Path(place).glob("libnvidia-opencl.so*"))]
    if not libraries:
        return {}
    (folder / "nvidia.icd").write_text(f"{libraries[0]}\n")
    return {"OCL_ICD_VENDORS": f"{folder}/"}


def parsed(arguments: list[str] | None) -> argparse.Namespace:
    """The command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--stages", default=",".join(STAGES), help="names with commas; default: all")
    parser.add_argument("--json", type=Path, default=Path("gpu_session.json"))
    parser.add_argument("--device")
    parser.add_argument("--limit", type=float, default=1800.0, help="seconds of all stages together; default: 1800")
    parser.add_argument("--small", action="store_true", help="sizes for a dry run on a CPU")
    parser.add_argument("--one", choices=STAGES, help=argparse.SUPPRESS)  # the stage of this process
    asked = parser.parse_args(arguments)
    asked.stages = list(dict.fromkeys(["device", *asked.stages.split(",")]))
    if unknown := set(asked.stages) - set(STAGES):
        parser.error(f"no stage {', '.join(sorted(unknown))}; the stages are {', '.join(STAGES)}")
    if not asked.json.parent.is_dir():
        parser.error(f"--json: there is no folder {asked.json.parent}")
    if not asked.limit > 0:
        parser.error(f"--limit is {asked.limit:g}, must be above 0")
    return asked


def main(arguments: list[str] | None = None) -> int:
    """Run the stages, or the one stage of this process."""
    asked = parsed(arguments)
    if asked.one:
        STAGES[asked.one](Session(asked.json, asked.one, asked.device, asked.small))
        return 0
    from sarcl.bench import documents

    documents.write({"kind": "gpu session", "small": asked.small, "rows": []}, asked.json)
    options = ["--json", str(asked.json), *(["--small"] if asked.small else [])]
    options += ["--device", asked.device] if asked.device else []
    end = time.monotonic() + asked.limit
    with tempfile.TemporaryDirectory() as folder:
        os.environ.update(vendor_folder(Path(folder)))
        for stage in asked.stages:
            command = [sys.executable, str(Path(__file__).resolve()), "--one", stage, *options]
            limit = min(LIMITS[STAGES[stage]], end - time.monotonic())
            append(asked.json, {"stage": stage, "name": "end", **process(command, limit)})
            rows = document_of(asked.json)["rows"]
            if stage == "device" and not all(row["ok"] for row in rows):
                break  # no stage can run
    failures = [row for row in rows if not row["ok"] or row.get("within") is False]
    print(f"{asked.json}: {len(rows)} rows, {len(failures)} of them failed or beyond their tolerance")
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
