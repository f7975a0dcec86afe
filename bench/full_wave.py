"""Speed of the full-wave time steps: cells per second of the vacuum update, whole and tile by tile, and with layers.

    python bench/full_wave.py [--cells 128 200] [--steps 48] [--device ...]

A cube of vacuum in walls; with layers: 10 absorbing cells on each side. Cells per second are given by the clock, and
per two CPU seconds: other work on a machine of two cores affects these less. The best of five runs, the cases in turn.
"""

from __future__ import annotations

import argparse
import time

import numpy as np

WHOLE = 10_000  # planes: more than any grid has
CASES = {"whole": (0, WHOLE), "16 planes at a time": (0, 16), "whole, layers": (10, WHOLE), "16, layers": (10, 16)}


def measure(device, n, steps):
    """Cells of a cube along x, y and z, and per case: Mcells per second, Mcells per CPU second, bytes per cell."""
    from sarcl.fullwave.fields import Fields
    from sarcl.fullwave.lattice import LANES, Lattice
    from sarcl.fullwave.target import Target

    grid = Lattice(0.01, (n, n, -(-n // LANES) * LANES), np.zeros(3))
    runs = {name: Fields(device, grid, Target.nothing(), absorber=a, tile=t) for name, (a, t) in CASES.items()}
    best = {name: np.full(2, np.inf) for name in CASES}
    for _ in range(5):
        for name, fields in runs.items():
            start = time.perf_counter(), time.process_time()
            for _ in range(steps // 8):
                fields.advance(8)
            device.finish()
            best[name] = np.minimum(best[name], (time.perf_counter() - start[0], time.process_time() - start[1]))
    cells = np.prod(grid.shape)
    updates = cells * (steps // 8) * 8 / 1e6
    return grid.shape, {name: (*(updates / best[name]), 24 * grid.component / cells) for name in CASES}


def main() -> None:
    """Measure, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cells", type=int, nargs="+", default=[128, 200])
    parser.add_argument("--steps", type=int, default=48)
    parser.add_argument("--device")
    asked = parser.parse_args()

    from sarcl.opencl.choose_device import open_device

    device = open_device(asked.device)
    print(f"{device.info.name}: vacuum update, {asked.steps} steps\n")
    print("| grid | case | Mcells/s | Mcells per two CPU s | bytes per cell |")
    print("|---|---|---|---|---|")
    for n in asked.cells:
        shape, rates = measure(device, n, asked.steps)
        for name, rate in rates.items():
            print(f"| {' x '.join(map(str, shape))} | {name} | {rate[0]:.0f} | {2 * rate[1]:.0f} | {rate[2]:.1f} |")


if __name__ == "__main__":
    main()
