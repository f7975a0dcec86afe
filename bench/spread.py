"""Spreading scatterers into range profiles: sarcl's echo of points against the PyPI package finufft (1-D, type 1).

    python bench/spread.py --peer-python PATH     the Python of an environment that has finufft

Both add up the same points with the same complex amplitudes, pulse by pulse. finufft is given the delays (its plan is
made once, its points are set for every pulse, as they move); sarcl finds them from antennas and positions, carrier
included. Errors are those achieved, relative to the exact sum at some frequencies of some pulses. The shortest run
counts.
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
threads, rows = int(sys.argv[2]), []
for eps in (1e-2, 1e-3, 1e-4, 1e-5, 1e-6):
    for kind in (np.complex64, np.complex128):
        real, amplitudes, best = x.astype(np.zeros(1, kind).real.dtype), a.astype(kind), 1e9
        plan = finufft.Plan(1, (n,), eps=eps, isign=-1, nthreads=threads, dtype=np.dtype(kind).name)
        for _ in range(3):
            start = time.perf_counter()
            out = []
            for row in real:
                plan.setpts(row)
                out.append(plan.execute(amplitudes))
            best = min(best, time.perf_counter() - start)
        made = np.array(out)[data["pulses"]][:, data["samples"]]
        error = float(np.linalg.norm(made - data["wanted"]) / np.linalg.norm(data["wanted"]))
        rows.append([f"{eps:.0e} {np.dtype(kind).name}", best, error])
print(json.dumps({"version": finufft.__version__, "rows": rows}))
"""


def main() -> None:
    """Print the table."""
    import sarcl
    from sarcl.reference.echo import echo as exact

    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--points", type=int, default=200_000)
    parser.add_argument("--pulses", type=int, default=64)
    parser.add_argument("--device", default=None)
    parser.add_argument("--peer-python")
    args = parser.parse_args()

    random = np.random.default_rng(0)
    positions = random.uniform(-1, 1, (args.points, 3)) * [100, 100, 5]
    amplitudes = random.standard_normal(args.points) + 1j * random.standard_normal(args.points)
    scene = sarcl.Scene.points(positions, amplitudes)
    wave = sarcl.Waveform.chirp(center=9.6e9, bandwidth=600e6, duration=1e-6)
    n = args.pulses
    track = sarcl.Trajectory.line(start=(-7e3, -50, 7e3), velocity=(0, 100, 0), prf=float(n), n_pulses=n)
    pairs = args.points * n / 1e6
    rows: list[tuple[str, float, float]] = []
    data: dict[str, Any] = {}
    for tolerance in (1e-2, 1e-3, 1e-4, 1e-5):
        best = np.inf
        for _ in range(3):
            start = time.perf_counter()
            raw = sarcl.echo(
                scene, wave, track, tolerance=tolerance, reference=(0, 0, 0), check=False, device=args.device
            )
            whole = time.perf_counter() - start
            best = min(best, raw.report.seconds["echo"] + raw.report.seconds["spectra"])
        if not data:
            data = _sums(raw, positions, amplitudes, exact)
        made = np.asarray(raw.samples)[data["pulses"]][:, data["samples"]]
        error = float(np.linalg.norm(made - data["exact"]) / np.linalg.norm(data["exact"]))
        rows.append((f"sarcl {tolerance:.0e}, with geometry (whole call {pairs / whole:.0f})", best, error))
    if args.peer_python:
        with tempfile.TemporaryDirectory() as folder:
            file = Path(folder) / "points.npz"
            np.savez(file, **{k: v for k, v in data.items() if k != "exact"})
            ran = subprocess.run(
                [args.peer_python, "-c", PEER, str(file), str(sarcl.devices()[0].units)],
                check=True, capture_output=True, text=True,
            )  # fmt: skip
        peer = json.loads(ran.stdout)
        rows += [(f"finufft {peer['version']} {name}, delays given", s, e) for name, s, e in peer["rows"]]
    print(f"{args.points} points x {n} pulses x {raw.n_samples} samples on {raw.report.device}")
    print(f"{'':55}{'Mpts/s':>8}{'error':>10}")
    for name, seconds, error in rows:
        print(f"{name:55}{pairs / seconds:8.1f}{error:10.1e}")


def _sums(raw: Any, positions: np.ndarray, amplitudes: np.ndarray, exact: Any) -> dict[str, Any]:
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
    sys.exit(main())
