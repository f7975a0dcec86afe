"""Peak memory of a large backprojection, raw data and image in files.

    python bench/memory.py [--pulses 2048] [--samples 4096] [--size 4096] [--max-bytes 5e8] [--compare]
    python bench/memory.py --series 1024 2048 4096 8192 --max-bytes 1e8 --pulses 512 --samples 1024 --json FILE

Prints the peak resident memory in GiB above that of the same process after a first image of 256 x 256
pixels: code, driver and kernels are loaded then. "code" is what these took, above an idle process with an open device.
--in-memory makes the image an array, whose bytes are subtracted. With --compare also the relative difference from the
image made in one block. --series runs each size in a process of its own, after one that leaves its kernels in the
driver's cache: a compiler takes memory too.
"""

from __future__ import annotations

import argparse
import json
import resource
import subprocess
import sys
import tempfile
from pathlib import Path

import h5py
import numpy as np

import sarcl
from sarcl.opencl.choose_device import open_device


def resident() -> float:
    """Resident memory now, GiB."""
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * resource.getpagesize() / 2**30


def peak() -> float:
    """Largest resident memory so far, GiB; ru_maxrss would count a parent's before the fork."""
    line = next(t for t in Path("/proc/self/status").read_text().splitlines() if t.startswith("VmHWM"))
    return int(line.split()[1]) / 2**20


def restart_peak() -> None:
    """Let `peak` begin anew at what is resident now (Linux)."""
    Path("/proc/self/clear_refs").write_text("5")


def write_raw(path: Path, n_pulses: int, n_samples: int) -> sarcl.PhaseHistory:
    """White noise written pulse by pulse, and its phase history read from the file."""
    random = np.random.default_rng(0)
    file = h5py.File(path, "w")
    samples = file.create_dataset("samples", (n_pulses, n_samples), np.complex64)
    for p in range(n_pulses):
        samples[p] = random.standard_normal((n_samples, 2)).astype(np.float32).view(np.complex64)[:, 0]
    track = sarcl.Trajectory.circle(radius=8e3, height=6e3, arc=0.07, n_pulses=n_pulses)
    return sarcl.PhaseHistory(
        samples,
        frequency=9.3e9,
        frequency_step=600e6 / n_samples,
        tx=track.positions,
        reference_range=np.linalg.norm(track.positions, axis=1),
    )


def series(args: argparse.Namespace) -> None:
    """Peak memory of images of growing size, with the same limit and the same rows."""
    options = ["--max-bytes", str(args.max_bytes), "--pulses", str(args.pulses), "--samples", str(args.samples)]
    rows = []
    for size in args.series:
        command = [sys.executable, __file__, "--size", str(size), "--tolerance", str(args.tolerance), *options]
        for _ in ("kernels are built", "measured"):
            said = subprocess.run(command, check=True, capture_output=True, text=True).stdout
        rows.append({"size": size, "image_bytes": 8 * size**2, **json.loads(said.splitlines()[-1])})
        print(rows[-1], flush=True)
    words = f"--series {' '.join(map(str, args.series))} --tolerance {args.tolerance:g} {' '.join(options)}"
    document = {
        "kind": "memory",
        "command": f"python bench/memory.py {words}",
        "max_bytes": args.max_bytes,
        "rows": rows,
    }
    if args.json:
        args.json.write_text(json.dumps(document, indent=1) + "\n")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--device")
    parser.add_argument("--pulses", type=int, default=2048)
    parser.add_argument("--samples", type=int, default=4096)
    parser.add_argument("--size", type=int, default=4096)
    parser.add_argument("--tolerance", type=float, default=1e-2)
    parser.add_argument("--max-bytes", type=float)
    parser.add_argument("--in-memory", action="store_true", help="the image in memory, not in a file")
    parser.add_argument("--compare", action="store_true", help="focus again in one block and compare")
    parser.add_argument("--series", type=int, nargs="+", help="sizes, each in a process of its own")
    parser.add_argument("--json", type=Path, help="file of the series")
    args = parser.parse_args()
    if args.series:
        series(args)
        return
    open_device(args.device)
    with tempfile.TemporaryDirectory() as folder:
        raw = write_raw(Path(folder, "raw.h5"), args.pulses, args.samples)
        grid = sarcl.ImageGrid.plane(shape=(args.size, args.size), spacing=0.02)
        options = {"tolerance": args.tolerance, "device": args.device, "check": False}
        idle, out = resident(), None if args.in_memory else Path(folder, "image.h5")
        small = sarcl.ImageGrid.plane(shape=(256, 256), spacing=0.02 * args.size / 256)
        sarcl.backproject(raw, small, max_bytes=args.max_bytes, out=Path(folder, "small.h5"), **options)
        loaded = resident()
        restart_peak()
        image = sarcl.backproject(raw, grid, max_bytes=args.max_bytes, out=out, **options)
        result = {
            "peak_gib": peak() - loaded - (image.data.nbytes / 2**30 if args.in_memory else 0.0),
            "code_gib": loaded - idle,
            "seconds": sum(image.report.seconds.values()),
            "contributions": image.report.contributions_done,
        }
        if args.compare:
            whole = sarcl.backproject(raw, grid, max_bytes=16e9, **options)
            wrong = right = 0.0
            for start in range(0, args.size, 256):
                part, other = image.data[start : start + 256], whole.data[start : start + 256]
                wrong += float((np.abs(part - other) ** 2).sum(dtype=np.float64))
                right += float((np.abs(other) ** 2).sum(dtype=np.float64))
            result["relative_difference"] = float(np.sqrt(wrong / right))
        print(json.dumps(result))


if __name__ == "__main__":
    main()
