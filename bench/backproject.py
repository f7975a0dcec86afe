"""Time against error of direct backprojection.

    python bench/backproject.py [--device cpu] [--size 1024] [--tolerances 1e-1 1e-2 ...] [--json FILE]

Timed: `sarcl.backproject` as a user calls it, plan to finished image, kernels built before; the median of
`--repeats` runs. "kernel" is the part spent in the device's kernels. The error is measured against the exact
float64 sum at 256 random pixels, relative as docs/accuracy.md says. White noise in every sample.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import time
from pathlib import Path

import numpy as np

import sarcl
from sarcl import cl
from sarcl.reference.backproject import backproject as exact


def noise(n: int) -> sarcl.PhaseHistory:
    """n pulses of n samples of white noise, X band, 600 MHz, 4 deg at 10 km."""
    random = np.random.default_rng(0)
    samples = random.standard_normal((n, n)) + 1j * random.standard_normal((n, n))
    track = sarcl.Trajectory.circle(radius=8e3, height=6e3, arc=0.07, n_pulses=n)
    return sarcl.PhaseHistory(
        samples.astype(np.complex64),
        frequency=9.3e9,
        frequency_step=600e6 / n,
        tx=track.positions,
        reference_range=np.linalg.norm(track.positions, axis=1),
    )


def measure(raw: sarcl.PhaseHistory, size: int, tolerance: float, device: cl.Device, repeats: int) -> dict:
    """One row of the table."""
    grid = sarcl.ImageGrid.plane(shape=(size, size), spacing=0.1)
    sarcl.backproject(raw[:64], grid, tolerance=tolerance, device=device, check=False)
    seconds, kernel = [], []
    for _ in range(repeats):
        start = time.perf_counter()
        image = sarcl.backproject(raw, grid, tolerance=tolerance, device=device, check=False)
        seconds.append(time.perf_counter() - start)
        kernel.append(image.report.seconds["backproject"])
    at = np.random.default_rng(1).integers(0, size, (256, 2))
    wanted, norm = exact(raw, grid.at(at[:, 0], at[:, 1]))
    error = np.linalg.norm(image.data[at[:, 0], at[:, 1]] - wanted) / max(np.linalg.norm(wanted), norm)
    pairs = image.report.contributions_done
    return {
        "tolerance": tolerance,
        "error": float(error),
        "predicted": image.report.predicted_error,
        "seconds": float(np.median(seconds)),
        "gbps": pairs / float(np.median(seconds)) / 1e9,
        "kernel_gbps": pairs / float(np.median(kernel)) / 1e9,
        "plan": dict(image.report.plan),
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--device")
    parser.add_argument("--size", type=int, default=1024, help="pulses, samples and image side")
    parser.add_argument("--tolerances", type=float, nargs="+", default=[1e-1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6])
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("--no-fp64", action="store_true", help="as on a device without float64")
    parser.add_argument("--json", type=Path)
    args = parser.parse_args()
    device = cl.open_device(args.device)
    if args.no_fp64:
        device = device.without_fp64()
    raw = noise(args.size)
    print(f"{device.info.name}, driver {device.info.driver}, {cl.threads()} threads, float64 {device.info.fp64}")
    print(f"direct backprojection, {args.size} pulses x {args.size} x {args.size} pixels, median of {args.repeats}")
    print("tolerance |   error | predicted | median s | Gbp/s | kernel Gbp/s | plan")
    rows = []
    for tolerance in args.tolerances:
        row = measure(raw, args.size, tolerance, device, args.repeats)
        rows.append(row)
        plan = row["plan"]
        print(
            f"  {tolerance:7.0e} | {row['error']:7.1e} |   {row['predicted']:7.1e} | {row['seconds']:8.2f} |"
            f" {row['gbps']:5.2f} | {row['kernel_gbps']:12.2f} | {plan['taps']} taps, {plan['profile samples']} "
            f"samples, {plan['ranges']}, {plan['series']}",
            flush=True,
        )
    if args.json:
        machine = {
            "device": device.info.name,
            "platform": device.info.platform,
            "driver": device.info.driver,
            "fp64": device.info.fp64,
            "threads": cl.threads(),
            "processors": os.cpu_count(),
            "python": platform.python_version(),
            "sarcl": sarcl.__version__,
        }
        args.json.parent.mkdir(parents=True, exist_ok=True)
        args.json.write_text(json.dumps({"machine": machine, "size": args.size, "rows": rows}, indent=1) + "\n")


if __name__ == "__main__":
    main()
