"""Processor seconds of the host for a large image on a GPU: on a device that computes nothing.

    python bench/host_part.py [--side 8192] [--pulses 11566] [--tolerances 1e-2 1e-3 3e-5] [--rounds 3]

Pulses of 8192 samples from 770 km, X band, 600 MHz, pixels of 0.25 m. A first image of some echoes plans it; a second
one takes the plan that is kept with these echoes, an image of other echoes from the same places the plan that is kept
for these places. Memory is the machine's own: pages are given to the result, and
samples copied, as for a real device (of paper: tests/gpu_static/collect.py). The least of the rounds counts.
"""

from __future__ import annotations

import argparse
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

import sarcl

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests"))

from gpu_static.collect import PAPER, PaperDevice, on_paper

# memory and group sizes of an H100
INFO = replace(PAPER, memory=80 * 10**9, max_alloc=20 * 10**9, max_group=1024, rate=3e13)
SAMPLES = 8192


def echoes(pulses: int) -> sarcl.PhaseHistory:
    """Noise; 64 rows again and again."""
    along, rows = (np.arange(pulses) - pulses / 2) * 1.5, np.ones(pulses)
    tx = np.stack([462e3 * rows, along, 616e3 * rows], axis=1)
    noise = np.random.default_rng(1).standard_normal((64, 2 * SAMPLES)).astype(np.float32).view(np.complex64)
    return sarcl.PhaseHistory(
        np.tile(noise, (-(-pulses // 64), 1))[:pulses], frequency=9.35e9, frequency_step=600e6 / SAMPLES, tx=tx,
        reference_range=np.linalg.norm(tx, axis=1),
    )  # fmt: skip


def main() -> None:
    """Print a row per tolerance and method."""
    parser = argparse.ArgumentParser(description="host seconds of a large image on a device of paper")
    parser.add_argument("--side", type=int, default=8192)
    parser.add_argument("--pulses", type=int, default=11566)
    parser.add_argument("--tolerances", type=float, nargs="+", default=[1e-2, 1e-3, 3e-5])
    parser.add_argument("--rounds", type=int, default=3)
    args = parser.parse_args()
    raw, grid = echoes(args.pulses), sarcl.ImageGrid.plane(shape=(args.side, args.side), spacing=0.25)
    device = PaperDevice(INFO, {})
    print("tolerance  method      first image, CPU s  second image, CPU s  other echoes, CPU s")
    with on_paper(device):
        for tolerance in args.tolerances:
            for method in ("direct", "factorized"):
                seconds = np.empty((args.rounds, 3))
                for number, of_round in enumerate(seconds):
                    # places of which nothing is known, and other echoes of which nothing is known
                    moved = replace(raw, tx=raw.tx + np.array([0, 0, 1e-3 * number]))
                    for i, echoes_of_image in enumerate((moved, moved, replace(moved))):
                        device.begin("image")
                        begun = time.process_time()
                        sarcl.backproject(
                            echoes_of_image, grid, tolerance=tolerance, method=method, check=False, device=device
                        )
                        of_round[i] = time.process_time() - begun
                first, second, other = seconds.min(axis=0)
                print(f"{tolerance:<9g}  {method:10s}  {first:18.2f}  {second:19.2f}  {other:19.2f}", flush=True)


if __name__ == "__main__":
    main()
