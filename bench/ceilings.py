"""Ceilings of a device: small kernels that do one thing as fast as it can, counted and timed as the others are."""

from __future__ import annotations

from typing import Any

import numpy as np

from sarcl.opencl import programs
from sarcl.opencl.device import Device

FILE = "ceilings.py"  # of their rows
CHAINS, STEPS, ITEMS = 12, 20_000, 256  # sums of a work-item, each of which waits for its own last step; steps; items
TRIAD = 2**24  # float32 numbers of each of three arrays, 64 MB
EMPTY = 200  # launches that do nothing
TEXT = """
#define NEAR 480  // vectors of an array within the first cache: 15 kB of 8 lanes
#define UNROLL __attribute__((opencl_unroll_hint(CHAINS)))
#define JOINED_(a, b) a##b
#define JOINED(a, b) JOINED_(a, b)
typedef JOINED(float, VW) fv;
typedef JOINED(double, VW) dv;

// One step of every chain; the last line keeps the sums, so that no step is left out.
#define STEPS_OF_CHAINS(real, step) \\
    real x[CHAINS], sum = 0, by = (real)(factor); \\
    UNROLL \\
    for (int k = 0; k < CHAINS; k++) x[k] = by + (k + (int)get_global_id(0));\\
    for (int n = 0; n < steps; n++) { \\
        UNROLL \\
        for (int k = 0; k < CHAINS; k++) x[k] = step; \\
    } \\
    UNROLL \\
    for (int k = 0; k < CHAINS; k++) sum += x[k]; \\
    out[get_global_id(0)] = sum;

__kernel void multiply_add32(__global fv *out, int steps, float factor) {
    STEPS_OF_CHAINS(fv, fma(x[k], by, by))
}

__kernel void multiply_add64(__global dv *out, int steps, float factor) {
    STEPS_OF_CHAINS(dv, fma(x[k], by, by))
}

__kernel void divide32(__global fv *out, int steps, float factor) {
    STEPS_OF_CHAINS(fv, by / x[k])
}

__kernel void divide64(__global dv *out, int steps, float factor) {
    STEPS_OF_CHAINS(dv, by / x[k])
}

// Sums of an array that each work-item reads again and again.
__kernel void first_cache(__global fv *out, __global const fv *table, int steps) {
    fv x[CHAINS], sum = 0;
    UNROLL
    for (int k = 0; k < CHAINS; k++) x[k] = 0;
    for (int n = 0; n < steps; n++)
        for (int i = 0; i < NEAR; i += CHAINS) {
            UNROLL
            for (int k = 0; k < CHAINS; k++) x[k] += table[i + k];
        }
    UNROLL
    for (int k = 0; k < CHAINS; k++) sum += x[k];
    out[get_global_id(0)] = sum;
}

// a = b + s c, `each` vectors of a work-item.
__kernel void triad(__global fv *a, __global const fv *b, __global const fv *c, float s, int each) {
    for (size_t i = get_global_id(0) * (size_t)each, last = i + each; i < last; i++) a[i] = fma(c[i], (fv)s, b[i]);
}

__kernel void empty(__global float *out) {
}
"""


def kernels_of(device: Device) -> dict[str, Any]:
    """The kernels, built for the device's vectors."""
    options = [f"-DVW={device.info.vector_width}", f"-DCHAINS={CHAINS}"]
    with programs.quiet():
        return programs.kernels_of(programs.build(device.context, TEXT, options))


def launch_all(device: Device) -> None:
    """Launch each kernel once, the empty one often."""
    lanes, kernels = device.info.vector_width, kernels_of(device)
    out, table = device.zeros(8 * ITEMS * lanes), device.zeros(2**16)
    arrays = [device.zeros(4 * TRIAD) for _ in range(3)]

    def launch(name: str, *args: Any) -> None:
        device.run(kernels[name], (ITEMS,), (1,), *args)

    for name in ("multiply_add32", "multiply_add64"):
        launch(name, out, STEPS, np.float32(0.999))
    for name in ("divide32", "divide64"):
        launch(name, out, STEPS // 10, np.float32(1.5))
    launch("first_cache", out, table, STEPS // 100)
    launch("triad", *arrays, np.float32(0.5), TRIAD // lanes // ITEMS)
    for _ in range(EMPTY):
        device.run(kernels["empty"], (1,), (1,), out)


def verified(rows: list[dict[str, Any]], lanes: int) -> None:
    """Compare the counts of the kernels with what their text says."""
    counts = {row["kernel"]: row for row in rows if row["file"] == FILE}
    per_item = 2 * CHAINS * STEPS * lanes
    for precision in (32, 64):
        operations = counts[f"multiply_add{precision}"][f"operations{precision}"] / ITEMS
        divisions = counts[f"divide{precision}"][f"divisions{precision}"] / ITEMS
        beside = 2 * CHAINS * lanes  # first values and the last sum
        if not per_item <= operations <= per_item + beside or divisions != CHAINS * STEPS // 10 * lanes:
            raise RuntimeError(f"counts of ceilings are wrong: {operations} operations, {divisions} divisions")
    if not 12 * TRIAD <= counts["triad"]["bytes"] <= 12.01 * TRIAD or counts["triad"]["operations32"] != 2 * TRIAD:
        raise RuntimeError(f"counts of ceilings are wrong: {counts['triad']}")


def rates(rows: list[dict[str, Any]]) -> dict[str, float]:
    """Ceilings per CPU second."""
    of = {row["kernel"]: row for row in rows if row["file"] == FILE}

    def rate(kernel: str, quantity: str) -> float:
        return float(of[kernel][quantity] / of[kernel]["cpu_seconds"])

    return {
        **{f"operations{n}": rate(f"multiply_add{n}", f"operations{n}") for n in (32, 64)},
        **{f"divisions{n}": rate(f"divide{n}", f"divisions{n}") for n in (32, 64)},
        "memory": rate("triad", "memory"),
        "bytes": max(rate(name, "bytes") for name in ("first_cache", "triad")),
        "instructions": max(rate(name, "instructions") for name in of if name != "empty"),
        "launches": rate("empty", "launches"),
    }
