"""Echoes: run time against achieved error, and run time of whole scenes.

    python bench/echo.py --peer-python PATH --json bench/results/3-echo-pocl.json
        PATH: the Python of an environment that has finufft;  --scenes: the long part too, half an hour on two cores

spread   the same points and complex amplitudes, pulse by pulse, by sarcl and by finufft (1-D, type 1). finufft is given
         the delays (its plan is made once; its points are set for every pulse, because they move); sarcl computes them
         and the carrier from antennas and positions. Errors are measured against the exact sum
whole    facets with all their physics, whole calls, compared with finufft's spreading of as many given delays
scenes   a million facets x 1024 pulses, and the 512 x 512 scene of Franceschetti et al. 1992 at 1, 4, 9, 16 cells a
         pixel of two facets each; errors from echo's own check

Runs alternate; the shortest counts. "cpu" of a row are CPU seconds of its calls, "check" the seconds of their checks,
which no other figure includes. Progress goes to stderr.

This is no part of `sarcl bench`, which measures what verbs take: finufft spreads delays that it is given, pulse by
pulse, and its partner here is a stage of `echo`, read from the report.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np

PEER = """
import json, sys, time
import finufft, numpy as np
data = np.load(sys.argv[1]); x, a, n = data["x"], data["a"], int(data["n"])
print(json.dumps(finufft.__version__), flush=True)
plans = {}
for line in sys.stdin:
    eps, kind = json.loads(line)
    if (eps, kind) not in plans:
        plans[eps, kind] = finufft.Plan(1, (n,), eps=eps, isign=-1, nthreads=int(sys.argv[2]), dtype=kind)
    real, amplitudes = x.astype("f4" if kind == "complex64" else "f8"), a.astype(kind)
    start, out = time.perf_counter(), []
    for row in real:
        plans[eps, kind].setpts(row)
        out.append(plans[eps, kind].execute(amplitudes))
    seconds = time.perf_counter() - start
    made = np.array(out)[data["pulses"]][:, data["samples"]]
    error = float(np.linalg.norm(made - data["wanted"]) / np.linalg.norm(data["wanted"]))
    print(json.dumps([seconds, error]), flush=True)
"""
TOLERANCES = (1e-2, 1e-3, 1e-4, 1e-5)
PEER_SETTINGS = [(eps, kind) for eps in (1e-2, 1e-3, 1e-4, 1e-5, 1e-6) for kind in ("complex64", "complex128")]
SARAS_VAX = {1: 490, 4: 930, 9: 1590, 16: 2480}  # s on a VAX 3100/30: Franceschetti et al. 1992, section V
Row = dict[str, Any]


def main() -> None:
    """Measure, print the tables, and write the JSON file."""
    import echo_page

    from sarcl.bench import documents
    from sarcl.opencl.choose_device import open_device

    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--points", type=int, default=1_000_000)
    parser.add_argument("--pulses", type=int, default=16)
    parser.add_argument("--repeats", type=int, default=3)
    parser.add_argument("--scenes", action="store_true", help="the whole scenes too: half an hour on two cores")
    parser.add_argument("--device", default=None)
    parser.add_argument("--peer-python")
    parser.add_argument("--json", type=Path)
    args = parser.parse_args()
    document = documents.header([open_device(args.device)])
    document |= {"kind": "echo", "points": args.points, "pulses": args.pulses}
    document |= {"spread": [], "whole": [], "scenes": []}

    def keep() -> None:  # what comes later may fail
        if args.json:
            documents.write(document, args.json)

    document["spread"] = spread(args, document)
    keep()
    document["whole"] = whole(args)
    keep()
    if args.scenes:
        document["scenes"] = scenes(args.device)
    document["machine"]["load"] += documents.load()
    print(echo_page.section("echo", document))
    keep()


def spread(args: argparse.Namespace, document: Row) -> list[Row]:
    """Rows of sarcl and, where there is one, of finufft; runs alternate."""
    import sarcl
    from sarcl.reference.equations import point_echo as exact

    random = np.random.default_rng(0)
    positions = random.uniform(-1, 1, (args.points, 3)) * [100, 100, 5]
    amplitudes = random.standard_normal(args.points) + 1j * random.standard_normal(args.points)
    scene, data = sarcl.Scene.points(positions, amplitudes), {}
    best: dict[Any, Row] = {}

    def keep(name: str, setting: Any, seconds: float, error: float, **more: float) -> None:
        row = best.setdefault((name, setting), {"name": name, "setting": str(setting), "seconds": [], "error": error})
        row["seconds"].append(seconds)
        for key, value in more.items():
            row.setdefault(key, []).append(value)

    with tempfile.TemporaryDirectory() as folder:
        peer = None
        for _ in range(args.repeats):
            for tolerance in TOLERANCES:
                say(f"points, {tolerance:.0e}")
                options = {"tolerance": tolerance, "reference": (0, 0, 0), "check": False, "device": args.device}
                raw, seconds = called(scene, WAVE, track(args.pulses), **options)
                if not data:
                    data = sums(raw, positions, amplitudes, exact)
                    np.savez(Path(folder) / "points.npz", **{k: v for k, v in data.items() if k != "exact"})
                made = np.asarray(raw.samples)[data["pulses"]][:, data["samples"]]
                error = float(np.linalg.norm(made - data["exact"]) / np.linalg.norm(data["exact"]))
                spreading = raw.report.seconds["echo"] + raw.report.seconds["spectra"]
                keep("sarcl, delays from geometry", f"{tolerance:.0e}", spreading, error, **seconds)
            if args.peer_python and peer is None:
                peer = Peer(args.peer_python, Path(folder) / "points.npz")
                document["peers"].append(
                    {"name": "finufft", "version": peer.version, "python": args.peer_python.rsplit("/", 1)[-1],
                     "backend": "cpu"}
                )  # fmt: skip
            for eps, kind in PEER_SETTINGS if peer else []:
                assert peer is not None
                say(f"finufft, {eps:.0e} {kind}")
                keep("finufft, delays given", f"{eps:.0e} {kind}", *peer.run(eps, kind))
    document["samples"] = int(raw.n_samples)
    return list(best.values())


class Peer:
    """finufft in its own Python, kept alive so that runs can alternate."""

    def __init__(self, python: str, file: Path) -> None:
        import sarcl

        units = str(sarcl.devices()[0].units)
        self.process = subprocess.Popen(
            [python, "-c", PEER, str(file), units], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        )
        self.version = self._answer()

    def run(self, eps: float, kind: str) -> tuple[float, float]:
        """Seconds and achieved error."""
        assert self.process.stdin is not None
        print(json.dumps([eps, kind]), file=self.process.stdin, flush=True)
        seconds, error = self._answer()
        return seconds, error

    def _answer(self) -> Any:
        assert self.process.stdout is not None
        line = self.process.stdout.readline()
        if not line:
            sys.exit("the peer's Python does not run finufft: give one that has it")
        return json.loads(line)


def whole(args: argparse.Namespace) -> list[Row]:
    """Whole calls of a tenth as many facets with their physics."""
    import sarcl

    n = max(2, int(np.sqrt(args.points / 20)))
    axis = 0.3 * (np.arange(n + 1) - n / 2)
    heights = np.random.default_rng(1).normal(0, 0.05, (n + 1, n + 1))
    rough = sarcl.Material(eps_r=4.0, conductivity=1e-3, height=np.inf, diagram="cos")
    out = []
    for name, material, polarization in (
        ("perfect conductor, HH", "metal", "HH"),
        ("wet soil, HH", "wet soil", "HH"),
        ("rough ground, HH", rough, "HH"),
        ("rough ground, four polarisations", rough, "all"),
    ):
        scene = sarcl.Scene.from_heights(axis, axis, heights, material=material)
        for tolerance in (1e-2, 1e-3):
            options = {"polarization": polarization, "device": args.device, "at": track(args.pulses)}
            out.append(timed(name, scene, tolerance, args.repeats, **options))
    return out


def scenes(device: Any) -> list[Row]:
    """A million facets x 1024 pulses, and SARAS's timing."""
    import sarcl

    rough = sarcl.Material(eps_r=4.0, conductivity=1e-3, height=np.inf, diagram="cos")
    out = []
    for name, material in (("a million rough facets", rough), ("a million smooth metal facets", "metal")):
        axis = np.linspace(-175, 175, 708)
        heights = 3 * np.sin(axis / 40)[:, None] * np.cos(axis / 55)
        scene = sarcl.Scene.from_heights(axis, axis, heights, material=material)
        out.append(timed(name, scene, 1e-2, at=track(1024), device=device, max_edge=None))
    for cells in (1, 2, 3, 4):
        axis = np.linspace(-128, 128, 512 * cells + 1)
        scene = sarcl.Scene.from_heights(axis, axis, np.zeros((len(axis), len(axis))), material=rough, roughness=0.02)
        wave = sarcl.Waveform.chirp(center=9.6e9, bandwidth=299_792_458.0 / (2 * 0.5 * np.sqrt(0.5)), duration=1e-6)
        name, options = f"SARAS, {cells * cells} cells a pixel", {"device": device, "wave": wave, "max_edge": None}
        out.append({**timed(name, scene, 1e-2, at=track(512), **options), "vax": SARAS_VAX[cells * cells]})
    return out


def timed(
    name: str, scene: Any, tolerance: float, repeats: int = 1, *, at: Any, wave: Any = None, **options: Any
) -> Row:
    """The entries of some calls that the page shows, of which the first is checked."""
    runs = []
    for i in range(repeats):
        say(f"{name}, {tolerance:.0e}")
        runs.append(called(scene, wave or WAVE, at, tolerance=tolerance, check=i == 0, **options))
    report, seconds = runs[0][0].report, {key: [one[key] for _, one in runs] for key in runs[0][1]}
    pairs = report.contributions_done + sum(report.contributions_skipped.values())
    return {
        "name": name, "setting": f"{tolerance:.0e}", "pairs": pairs, "error": report.measured_error,
        "predicted": report.predicted_error, "samples": runs[0][0].n_samples, "plan": dict(report.plan),
        "stages": dict(report.seconds), **seconds, "seconds": seconds["call"],
    }  # fmt: skip


def called(*subjects: Any, **options: Any) -> tuple[Any, dict[str, float]]:
    """Echoes; seconds of the call and of its check, apart, and CPU seconds of both."""
    import sarcl

    start, busy = time.perf_counter(), time.process_time()
    raw = sarcl.echo(*subjects, **options)
    call, busy = time.perf_counter() - start, time.process_time() - busy
    check = raw.report.seconds.get("check", 0.0)
    return raw, {"call": call - check, "check": check, "cpu": busy}


def say(text: str) -> None:
    """A line of progress."""
    print(f"{time.strftime('%H:%M:%S')}  {text}", file=sys.stderr, flush=True)


def track(n: int) -> Any:
    """100 m in n pulses, 9.9 km away, 45 deg up."""
    import sarcl

    return sarcl.Trajectory.line(start=(-7e3, -50, 7e3), velocity=(0, 100, 0), prf=float(n), n_pulses=n)


def sums(raw: Any, positions: np.ndarray, amplitudes: np.ndarray, exact: Any) -> dict[str, Any]:
    """Phases of the points for finufft, and exact sums at 8 frequencies of 3 pulses, with and without the carrier."""
    n, step = raw.n_samples, float(raw.frequency_step[0])
    pulses, samples = np.array([0, raw.n_rows // 2, raw.n_rows - 1]), np.linspace(0, n - 1, 8).astype(int)
    half = np.linalg.norm(raw.tx[:, None] - positions, axis=2) - raw.reference_range[:, None]
    delay = 2 * half / 299_792_458.0
    x = 2 * np.pi * step * delay
    f = raw.frequency[0] + step * samples
    wanted = [exact(positions, amplitudes, f, raw.tx[p], raw.rx[p], float(raw.reference_range[p])) for p in pulses]
    bare = [(amplitudes * np.exp(-1j * (samples - n // 2)[:, None] * x[p])).sum(axis=1) for p in pulses]
    return {
        "x": (x + np.pi) % (2 * np.pi) - np.pi, "a": amplitudes, "n": n, "pulses": pulses, "samples": samples,
        "wanted": np.array(bare), "exact": np.array(wanted),
    }  # fmt: skip


if __name__ == "__main__":
    import sarcl

    WAVE = sarcl.Waveform.chirp(center=9.6e9, bandwidth=600e6, duration=1e-6)
    sys.exit(main())
