"""Speed of whole full-wave runs beside gprMax: a conducting sphere in 200 x 200 x 208 cells, 10 absorbing layers.

    python bench/full_wave_peers.py --peer PYTHON [--cells 200] [--rounds 3] [--opencl] [--json FILE]

PYTHON is the interpreter of an environment that has gprMax (and pyopencl, for its OpenCL solver). Both run in turn.
The run of sarcl has an incident plane wave, the sphere's cut cells, layers, and the currents and one echo at 50
frequencies. That of gprMax has a dipole, a sphere of whole cells and layers; "far field" adds a surface that records
the same 50 frequencies. Times are of the steps alone: the difference between runs of few and of more steps. Given are
cells updated per second of the clock, and per two CPU seconds, which other work on a machine of two cores affects
less; the best of all rounds.

sarcl updates cells inside the sphere and ahead of the wave only where it must: "all cells" is the same run without.
"""

from __future__ import annotations

import argparse
import os
import resource
import subprocess
import tempfile
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import full_wave_page
import numpy as np

FREQUENCIES = 50
LAYERS, GAP = 10, 3
STEPS = {"sarcl": (256, 768), "sarcl, all cells": (256, 768), "gprMax OpenMP": (16, 80),
         "gprMax OpenMP, far field": (8, 32), "gprMax OpenCL": (4, 12)}  # fmt: skip


def main() -> None:
    """Measure, print the table, and write the file."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--peer", required=True)
    parser.add_argument("--cells", type=int, default=200)
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--opencl", action="store_true", help="also gprMax's OpenCL solver")
    parser.add_argument("--json", type=Path)
    asked = parser.parse_args()

    from sarcl.bench import documents
    from sarcl.opencl.choose_device import open_device

    device = open_device(None)
    document = documents.header([device])
    names = [name for name in STEPS if asked.opencl or "OpenCL" not in name]
    n_cells = asked.cells**2 * (-(-asked.cells // 16) * 16)
    ours = Ours(device, asked.cells)
    best = {name: np.full(2, np.inf) for name in names}
    for _ in range(asked.rounds):
        for name in names:
            took = [
                ours.run(name, steps) if name in ours.targets else peer(asked.peer, name, asked.cells, steps)
                for steps in STEPS[name]
            ]
            per_step = np.subtract(took[1], took[0]) / (STEPS[name][1] - STEPS[name][0])
            best[name] = np.minimum(best[name], np.where(per_step > 0, per_step, np.inf))
    rates = {name: {"Mcells/s": n_cells / wall / 1e6, "Mcells per two CPU s": 2 * n_cells / cpu / 1e6}
             for name, (wall, cpu) in best.items()}  # fmt: skip
    document |= {
        "kind": "full wave", "cells": [asked.cells, asked.cells, n_cells // asked.cells**2], "frequencies": FREQUENCIES,
        "rounds": asked.rounds, "resting": ours.resting, "peers": [about(asked.peer)],
        "rates": rates,
    }  # fmt: skip
    document["machine"]["load"] += documents.load()
    print(full_wave_page.section("full wave", document))
    if asked.json:
        documents.write(document, asked.json)


class Ours:
    """sarcl's run, with and without the cells that it may leave out."""

    def __init__(self, device: Any, n: int) -> None:
        from sarcl import shapes
        from sarcl.base.constants import SPEED_OF_LIGHT
        from sarcl.fullwave.lattice import LANES, Lattice
        from sarcl.fullwave.runs import target_of

        cell = 0.01
        self.device, self.grid = device, Lattice(cell, (n, n, -(-n // LANES) * LANES), np.zeros(3))
        middle = cell * np.array(self.grid.shape) / 2
        radius = cell * (n / 2 - LAYERS - GAP - 10)
        ball = shapes.sphere(radius, facets=20_000, position=middle).triangles
        target = target_of(self.grid, [(ball, None)], 1.0)
        self.targets = {"sarcl": target, "sarcl, all cells": replace(target, resting=None)}
        self.resting = float((target.resting[:, 3] - target.resting[:, 2]).sum() / np.prod(self.grid.shape))
        top = SPEED_OF_LIGHT / (10 * cell)
        self.band = 0.2 * top, top
        self.k = 2 * np.pi * np.linspace(*self.band, FREQUENCIES) / SPEED_OF_LIGHT
        self.antenna = middle - 1000 * np.array([0.5, -0.3, -0.8])

    def run(self, name: str, steps: int) -> tuple[float, float]:
        """Seconds of the clock and of the processors."""
        from sarcl.fullwave import runs

        across, antenna = np.array([0.6, 1.0, 0.0]) / np.hypot(0.6, 1), self.antenna[None]
        started = time.perf_counter(), time.process_time()
        runs.run(
            self.device, self.grid, self.targets[name], self.band, self.k, anchor=runs.Anchor(self.antenna, across),
            antennas=runs.Antennas(antenna, antenna, across[None, None]),
            options=runs.RunOptions(most_steps=steps, max_bytes=1e9),
        )  # fmt: skip
        return time.perf_counter() - started[0], time.process_time() - started[1]


def peer(python: str, name: str, n: int, steps: int) -> tuple[float, float]:
    """Seconds of the clock and of the processors of a run of gprMax."""
    nz = -(-n // 16) * 16
    middle, top = [0.005 * m for m in (n, n, nz)], 3e9
    text = [
        f"#domain: {0.01 * n} {0.01 * n} {0.01 * nz}", "#dx_dy_dz: 0.01 0.01 0.01", f"#time_window: {steps}",
        f"#pml_cells: {LAYERS}", f"#waveform: gaussiandotnorm 1 {top / 2} pulse",
        f"#hertzian_dipole: z {0.01 * (LAYERS + 8)} {middle[1]} {middle[2]} pulse",
        f"#sphere: {middle[0]} {middle[1]} {middle[2]} {0.01 * (n / 2 - LAYERS - GAP - 10)} pec",
    ]  # fmt: skip
    if "far field" in name:
        low, high = 0.01 * (LAYERS + 3), [0.01 * (m - LAYERS - 3) for m in (n, n, nz)]
        listed = " ".join(f"{f:.6e}" for f in np.linspace(0.2, 1, FREQUENCIES) * top)
        text += [f"#ntff_surface: {low} {low} {low} {high[0]} {high[1]} {high[2]} box",
                 f"#ntff_frequency: box far {listed}", "#ntff_far_field: 60 30 far"]  # fmt: skip
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "sphere.in"
        file.write_text("\n".join(["#title: sphere", *text]) + "\n")
        start = [python, "-c", "from gprMax.gprMax import cli; cli()", str(file), "--hide-progress-bars"]
        command = [*start, *(["-opencl"] * ("OpenCL" in name))]
        settings = {**os.environ, "OMP_NUM_THREADS": str(os.cpu_count()), "OMP_WAIT_POLICY": "PASSIVE"}
        started = time.perf_counter(), _children()
        done = subprocess.run(command, env=settings, cwd=folder, capture_output=True, text=True)
        if done.returncode:
            raise SystemExit(f"gprMax failed: {done.stdout[-1500:]}\n{done.stderr[-1500:]}")
        return time.perf_counter() - started[0], _children() - started[1]


def _children() -> float:
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def about(python: str) -> dict[str, str]:
    """The version of gprMax, and of Python that runs it."""
    code = "import importlib.metadata as m, platform as p; print(m.version('gprMax'), p.python_version())"
    said = subprocess.run([python, "-c", code], capture_output=True, text=True, check=True).stdout.split()
    return {"name": "gprMax", "version": said[0], "python": said[1], "backend": "OpenMP, OpenCL"}


if __name__ == "__main__":
    main()
