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


def main() -> None:
    """Measure, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cells", type=int, nargs="+", default=[128, 200])
    parser.add_argument("--steps", type=int, default=48)
    parser.add_argument("--device")
    asked = parser.parse_args()

    from sarcl.fullwave.fields import Fields
    from sarcl.fullwave.lattice import LANES, Lattice
    from sarcl.fullwave.target import Target
    from sarcl.opencl.choose_device import open_device

    device = open_device(asked.device)
    print(f"{device.info.name}: vacuum update, {asked.steps} steps\n")
    print("| grid | case | Mcells/s | Mcells per two CPU s | bytes per cell |")
    print("|---|---|---|---|---|")
    for n in asked.cells:
        grid = Lattice(0.01, (n, n, -(-n // LANES) * LANES), np.zeros(3))
        runs = {name: Fields(device, grid, Target.nothing(), absorber=a, tile=t) for name, (a, t) in CASES.items()}
        best = {name: np.full(2, np.inf) for name in CASES}
        for _ in range(5):
            for name, fields in runs.items():
                started = time.perf_counter(), time.process_time()
                for _ in range(asked.steps // 8):
                    fields.advance(8)
                device.finish()
                took = time.perf_counter() - started[0], time.process_time() - started[1]
                best[name] = np.minimum(best[name], took)
        updates = np.prod(grid.shape) * (asked.steps // 8) * 8 / 1e6
        for name, (wall, cpu) in best.items():
            stored = 24 * grid.component / np.prod(grid.shape)
            print(f"| {' x '.join(map(str, grid.shape))} | {name} | {updates / wall:.0f} | {2 * updates / cpu:.0f} | "
                  f"{stored:.1f} |")  # fmt: skip


if __name__ == "__main__":
    main()
