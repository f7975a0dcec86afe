"""Kernels beside the ceilings of this machine: operations and bytes per unit of work, and the share that is reached.

    python bench/roofline.py [--rounds 3] [--json FILE]

Two small kernels measure the ceilings: multiply-adds on numbers in registers, and a triad a = b + s c of arrays
larger than caches. Then each kernel runs in a call that uses it, in turns with them; a launch is timed from an
empty queue to an empty queue, in CPU seconds of the process, which other programs hardly affect. The best of the
rounds counts.

Operations per unit are counted in the source, by the functions below: a multiply-add is two, integer operations and
loads are none. Of kernels by lines the innermost loop counts alone: profiles and weights of lines are work beside
it. Bytes per unit are those that must come from memory or go there if caches are ideal within a work-item.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

import sarcl
from sarcl.bench.documents import header
from sarcl.fullwave.fields import Fields
from sarcl.fullwave.lattice import LANES, Lattice
from sarcl.fullwave.target import Target
from sarcl.opencl import programs
from sarcl.opencl.choose_device import open_device
from sarcl.opencl.device import Device

RESULT = Path(__file__).parents[1] / "bench" / "results" / "trials" / "roofline.json"
CHAINS, STEPS, ITEMS = 10, 20_000, 256  # sums in registers, multiply-adds each, work-items
TRIAD = 2**24  # float32 numbers of each of three arrays, 64 MB
CEILINGS = """
typedef float%(lanes)d fv;
__kernel void multiply_add(__global float *out, int steps, float factor) {
    fv sum[%(chains)d];
#pragma unroll
    for (int k = 0; k < %(chains)d; k++) sum[k] = (fv)(0.1f * k + get_global_id(0));
    for (int n = 0; n < steps; n++) {
#pragma unroll
        for (int k = 0; k < %(chains)d; k++) sum[k] = fma(sum[k], (fv)factor, (fv)0.5f);
    }
    fv all = 0;
#pragma unroll
    for (int k = 0; k < %(chains)d; k++) all += sum[k];
    vstore%(lanes)d(all, get_global_id(0), out);
}
__kernel void triad(__global float *a, __global const float *b, __global const float *c, float factor, int each) {
    for (int n = 0; n < each; n++) {
        size_t i = get_global_id(0) * (size_t)each + n;
        vstore%(lanes)d(fma(vload%(lanes)d(i, c), (fv)factor, vload%(lanes)d(i, b)), i, a);
    }
}
"""
SINE_COSINE = 23  # operations of sincos_cycles in kernels/common.clh, as polynomials
ROTATION = 8  # a complex product, added
Macros = Mapping[str, int]


def weights(macros: Macros) -> int:
    """Operations of the weights of TAPS samples at a position: DEFINE_WEIGHTS of kernels/taps.clh."""
    taps = macros["TAPS"]
    return 2 if taps == 2 else 1 + 2 * taps * macros["TERMS"]


def place(macros: Macros) -> int:
    """Phase and position of a point in float32 (locate_near of kernels/range_phase.clh), and its first tap."""
    order = macros.get("NEAR") or macros["ORDER"]
    return 5 + (3 if order == 2 else 5) + 8 + 5


def gathered(macros: Macros) -> float:
    """A pulse and a pixel of kernels/backproject.cl."""
    return place(macros) + weights(macros) + 4 * macros["TAPS"] + SINE_COSINE + ROTATION


def of_line(macros: Macros) -> float:
    """A pulse and a pixel in the innermost loop of kernels/backproject_lines.cl."""
    return 8 * macros["LINE_TAPS"] * (1 + macros["SLOPE"])


def spread_point(macros: Macros) -> float:
    """A pulse and a point of kernels/spread_points.cl without weights of antennas."""
    return place(macros) + weights(macros) + SINE_COSINE + 6 + 4 * macros["TAPS"]


def spread_sample(macros: Macros) -> float:
    """A sample of kernels/nufft2d.cl: positions, weights of both directions, and TAPS x TAPS complex sums."""
    taps = macros["TAPS"]
    return 2 * 8 + 2 * weights(macros) + 2 * taps + 4 * taps**2


def updated_cell(macros: Macros) -> float:
    """A cell and a step of both updates of kernels/fdtd_vacuum.cl: nine differences and three multiply-adds each."""
    return 2 * (9 + 2 * 3)


@dataclass
class Timed:
    """A device whose launches are timed, with the macros of its kernels.

    seconds  CPU seconds by name of the kernel;  macros  of the kernel that was built last, by file
    """

    device: Device
    seconds: dict[str, float] = field(default_factory=dict)
    macros: dict[str, dict[str, int]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        launch, build = self.device.run, self.device.kernel

        def run(kernel: Any, *args: Any, **options: Any) -> None:
            self.device.finish()
            start = time.process_time()
            launch(kernel, *args, **options)
            self.device.finish()
            name = kernel.function_name
            self.seconds[name] = self.seconds.get(name, 0.0) + time.process_time() - start

        def kernel(file: str, name: str, **macros: int) -> Any:
            self.macros[file] = macros
            return build(file, name, **macros)

        self.device.run, self.device.kernel = run, kernel  # type: ignore[method-assign]

    def of(self, names: tuple[str, ...], call: Callable[[], Any]) -> float:
        """CPU seconds of kernels in a call."""
        self.seconds.clear()
        call()
        return sum(self.seconds[name] for name in names)


@dataclass(frozen=True)
class Kernel:
    """One kernel, the call that runs it, and its work.

    names  of the kernels of the file;  units  of work of the call, in `unit`
    operations, bytes  per unit, from the macros that the plan chose;  limit  what holds it back, from reading the loop
    """

    file: str
    names: tuple[str, ...]
    call: Callable[[], Any]
    units: float
    unit: str
    operations: Callable[[Macros], float]
    bytes: Callable[[Macros], float]
    limit: str


def noise(n: int) -> sarcl.PhaseHistory:
    """n pulses of n samples over 300 m at 9.9 km, X band, 300 MHz."""
    random = np.random.default_rng(0)
    tx = np.stack([np.full(n, -7e3), np.linspace(-150, 150, n), np.full(n, 7e3)], axis=1)
    samples = random.standard_normal((n, n, 2)).astype(np.float32).view(np.complex64)[..., 0]
    return sarcl.PhaseHistory(
        samples, frequency=9.45e9, frequency_step=3e8 / n, tx=tx, reference_range=np.linalg.norm(tx, axis=1)
    )


def kernels(device: Device) -> list[Kernel]:
    """Kernels with calls of about a tenth of a CPU second each, or more."""
    n, random = 512, np.random.default_rng(1)
    raw, plane = noise(n), sarcl.ImageGrid.plane(shape=(n, n), spacing=0.25)
    listed = sarcl.ImageGrid.points(random.uniform(-30, 30, (n * n // 2, 3)) * [1, 1, 0.1])
    points = sarcl.Scene.points(random.uniform(-60, 60, (n * n, 3)) * [1, 1, 0.01])
    chirp = sarcl.Waveform.chirp(center=9.6e9, bandwidth=3e8, duration=1e-6)
    track = sarcl.Trajectory(None, raw.tx)
    cells, steps = 160, 16
    grid = Lattice(0.01, (cells, cells, -(-cells // LANES) * LANES), np.zeros(3))
    fields = Fields(device, grid, Target.nothing(), absorber=0, tile=10_000)
    options = {"tolerance": 1e-2, "check": False, "device": device}

    def image(domain: sarcl.ImageGrid) -> sarcl.Image:
        return sarcl.backproject(raw, domain, method="direct", **options)

    return [
        Kernel(
            "backproject_lines.cl",
            ("backproject_lines",),
            lambda: image(plane),
            float(n) ** 3,
            "pulse x pixel",
            of_line,
            lambda m: 32 / m["GROUP"],
            "multiply-adds, and loads of samples from the first cache",
        ),
        Kernel(
            "backproject.cl",
            ("backproject",),
            lambda: image(listed),
            n * listed.size,
            "pulse x pixel",
            gathered,
            lambda m: 32 / m["CHUNK"] + 12 / n,
            "the gather of samples and its shuffles",
        ),
        Kernel(
            "spread_points.cl",
            ("spread",),
            lambda: sarcl.echo(points, chirp, track, method="direct", **options),
            float(n) ** 3,
            "pulse x point",
            spread_point,
            lambda m: 20 / m.get("PULSES", 1),
            "adding lane by lane to sums in the first cache",
        ),
        Kernel(
            "nufft2d.cl",
            ("spread",),
            lambda: sarcl.polar_format(raw, plane, **options),
            float(n) ** 2,
            "sample",
            spread_sample,
            lambda m: 8.0,
            "one lane per work-item: at most one in eight of the operations",
        ),
        Kernel(
            "fdtd_vacuum.cl",
            ("update_e", "update_h"),
            lambda: fields.advance(steps),
            float(steps * np.prod(grid.shape)),
            "cell x step",
            updated_cell,
            lambda m: 72.0,
            "memory: fields are larger than caches",
        ),
    ]


def ceilings(device: Device) -> Callable[[], dict[str, float]]:
    """A function that measures operations and bytes per CPU second."""
    lanes = device.info.vector_width
    text = CEILINGS % {"lanes": lanes, "chains": CHAINS}
    made = programs.kernels_of(programs.build(device.context, text, []))
    out = device.zeros(4 * ITEMS * lanes)
    arrays = [device.zeros(4 * TRIAD) for _ in range(3)]
    each = TRIAD // lanes // ITEMS

    def seconds(kernel: Any, *args: Any) -> float:
        device.finish()
        start = time.process_time()
        device.run(kernel, (ITEMS,), (1,), *args)
        device.finish()
        return time.process_time() - start

    def measure() -> dict[str, float]:
        register = seconds(made["multiply_add"], out, STEPS, np.float32(0.999))
        memory = seconds(made["triad"], *arrays, np.float32(0.5), each)
        operations = 2.0 * ITEMS * STEPS * CHAINS * lanes
        return {"operations": operations / register, "bytes": 4 * 4.0 * TRIAD / memory}

    measure()
    return measure


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--json", type=Path, default=RESULT)
    asked = parser.parse_args()
    device = open_device("cpu")
    ceiling, timed = ceilings(device), Timed(device)
    rows, best = kernels(device), {"operations": 0.0, "bytes": 0.0}
    fastest = [float("inf")] * len(rows)
    macros: list[dict[str, int]] = [{}] * len(rows)
    for _ in range(asked.rounds + 1):
        best = {name: max(best[name], value) for name, value in ceiling().items()}
        for k, row in enumerate(rows):
            fastest[k] = min(fastest[k], timed.of(row.names, row.call))
            macros[k] = timed.macros.get(row.file, macros[k])
    document = {**header([device]), "kind": "roofline", "command": "python bench/roofline.py", "ceilings": best}
    document["kernels"] = [
        {
            "file": row.file,
            "unit": row.unit,
            "units": row.units,
            "cpu_seconds": fastest[k],
            "limit": row.limit,
            "operations": row.operations(macros[k]),
            "bytes": row.bytes(macros[k]),
            "macros": macros[k],
        }
        for k, row in enumerate(rows)
    ]
    asked.json.write_text(json.dumps(document, indent=1, default=int) + "\n")
    for row in document["kernels"]:
        rate = row["units"] / row["cpu_seconds"]
        print(
            f"{row['file']}: {rate / 1e6:.1f} M {row['unit']} per CPU s, {row['operations']:.0f} operations, "
            f"{rate * row['operations'] / best['operations']:.0%} of the operations, "
            f"{rate * row['bytes'] / best['bytes']:.0%} of the bytes; {row['macros']}"
        )
    print(best)


if __name__ == "__main__":
    main()
