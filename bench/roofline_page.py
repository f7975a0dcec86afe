"""Kernels beside the ceilings of the machine: the section and the picture of docs/guide/proof.md."""

from __future__ import annotations

from typing import Any

import numpy as np

from sarcl.bench import tables
from sarcl.figures import plots

Row = dict[str, Any]
# Ceiling -> the quantities that it bounds, each with the name of its rate
CEILINGS = {
    "multiply-adds": ("operations32", "operations64"),
    "memory": ("memory",),
    "divisions": ("divisions32", "divisions64"),
    "first cache": ("bytes",),
    "instructions": ("instructions",),
    "launches": ("launches",),
}
ROOF = "multiply-adds", "memory"
LEAST_SHARE = 0.02  # of a call's CPU seconds: kernels below are named alone
NEAR = 0.5  # of a ceiling: a kernel that reaches less of each of them waits
WAITS = "latency"
SIZE = (9.5, 8.0)  # inches
TEXT = """Every launch of the calls is counted and timed: those of `sarcl bench` at a tolerance of 1e-2, and
some more. A copy of each kernel counts how often its basic blocks run; LLVM's code of a block says
what it does. An addition, multiplication, division or square root is one operation, a multiply-add
two. "MB" is what memory moves where caches are ideal: the buffers of a launch, once. Ceilings are
rates of small kernels (bench/ceilings.py), counted and timed in the same run: multiply-adds of
numbers in registers, a triad in memory, divisions, loads from the first cache, instructions of LLVM's
code, and launches. The processor joins some of LLVM's instructions, and a cache may keep the buffers
between launches: such a kernel may reach more than 100 % of the rate of another. "Of the roof" is the
share of the nearer one of multiply-adds and memory. "Limited by" names the nearest of all six; where
a kernel reaches less than half of each, its instructions wait for results of others, loads included,
and for jumps (latency). Each kernel stands in the call where it takes the largest share of the CPU
seconds.
"""


def shares(row: Row, tops: Row) -> dict[str, float]:
    """Share of each ceiling that a kernel reaches in a call: the CPU seconds it would take, over those it takes."""
    return {
        name: sum(row[quantity] / tops[quantity] for quantity in quantities) / row["cpu_seconds"]
        for name, quantities in CEILINGS.items()
    }


def nearest(row: Row, tops: Row) -> tuple[str, float]:
    """The ceiling that a kernel comes nearest to, and the share that it reaches."""
    reached = shares(row, tops)
    name = max(reached, key=lambda ceiling: reached[ceiling])
    return name, reached[name]


def in_kernels(document: Row) -> dict[str, float]:
    """Share of the CPU seconds of each call that its kernels take; the rest is that of the host."""
    out: dict[str, float] = {}
    for row in document["kernels"]:
        if row["file"] and row["call"] != "ceilings":
            out[row["call"]] = out.get(row["call"], 0.0) + row["cpu_seconds"] / whole(document)[row["call"]]
    return out


def whole(document: Row) -> dict[str, float]:
    """CPU seconds of each call."""
    return {row["call"]: row["cpu_seconds"] for row in document["kernels"] if not row["file"]}


def kernels(document: Row) -> list[Row]:
    """Rows of kernels, each from the call where its `share` of the CPU seconds is largest; the largest first."""
    seconds = whole(document)
    largest: dict[tuple[str, str], Row] = {}
    for row in document["kernels"]:
        if row["file"] and row["call"] != "ceilings":
            key, share = (row["file"], row["kernel"]), row["cpu_seconds"] / seconds[row["call"]]
            if share > largest.get(key, {"share": 0.0})["share"]:
                largest[key] = {**row, "share": share}
    return sorted(largest.values(), key=lambda row: -row["share"])


def drawn(document: Row) -> list[Row]:
    """The kernels that some call depends on."""
    return [row for row in kernels(document) if row["share"] >= LEAST_SHARE]


def title(row: Row) -> str:
    """File and name of a kernel."""
    stem = row["file"].removesuffix(".cl")
    return stem if stem == row["kernel"] else f"{stem}: {row['kernel']}"


def operations(row: Row) -> float:
    return float(row["operations32"] + row["operations64"])


def claim(document: Row) -> str:
    """All kernels in a line."""
    reached = [100 * nearest(row, document["ceilings"])[1] for row in drawn(document)]
    return (
        f"{len(reached)} kernels: {min(reached):.0f} to {max(reached):.0f} % of the nearest ceiling, "
        f"median {np.median(reached):.0f} %"
    )


def section(document: Row, command: str) -> list[str]:
    """Paragraphs, picture and table."""
    tops, body = document["ceilings"], []
    for row in drawn(document):
        name, share = nearest(row, tops)
        reached = shares(row, tops)
        roof = max(reached[ceiling] for ceiling in ROOF)
        limit = f"{name} {share:.0%}" if share >= NEAR else f"{WAITS}; {name} {share:.0%}"
        work = [f"{operations(row) / 1e6:.3g}", f"{row['memory'] / 1e6:.3g}", f"{1e3 * row['cpu_seconds']:.3g}"]
        body.append([f"`{title(row)}`", row["call"], f"{row['share']:.0%}", *work, f"{roof:.0%}", limit])
    head = ["kernel", "call", "of its CPU s", "1e6 operations", "MB", "CPU ms", "of the roof", "limited by"]
    here = (
        f"Here, per CPU second: {tops['operations32'] / 1e9:.0f}e9 operations in float32, "
        f"{tops['operations64'] / 1e9:.0f}e9 in float64, {tops['memory'] / 1e9:.0f} GB of memory, "
        f"{tops['bytes'] / 1e9:.0f} GB of the first cache, {tops['divisions32'] / 1e9:.1f}e9 divisions in float32, "
        f"{tops['instructions'] / 1e9:.0f}e9 instructions; a launch takes {1e6 / tops['launches']:.0f} CPU us.\n"
        "GPUs: [instructions counted](../developers/gpu_static.md), "
        "[H100 measured](../developers/gpu_benchmarks.md)."
    )
    inside = ", ".join(f"{call} {share:.0%}" for call, share in in_kernels(document).items())
    rest = [f"`{title(row)}` {100 * row['share']:.2g} %" for row in kernels(document) if row["share"] < LEAST_SHARE]
    unused = ", ".join(f"`{file}`" for file in document["unused"])
    return [
        "## Kernels beside the ceilings of the machine",
        "![kernels below the ceilings](proof-roofline.png)",
        TEXT,
        here,
        tables.markdown(head, body),
        f"Share of the CPU seconds that all kernels take, by call: {inside}.",
        f"Below {LEAST_SHARE:.0%} of the CPU seconds of every call: {', '.join(rest)}." if rest else "",
        f"Launched by none of these calls on this device: {unused}." if unused else "",
        command,
    ]


def picture(document: Row) -> bytes:
    """Operations per CPU second against operations per byte, numbered, and what every kernel reaches of its ceiling."""
    drawing = plots.figure(SIZE)
    drawing.set_layout_engine("constrained")
    plane, bars = drawing.subplots(1, 2, width_ratios=(1.25, 1))
    tops, rows = document["ceilings"], drawn(document)
    x = np.geomspace(0.01, 1e3, 200)
    for precision, line in ((32, "-"), (64, "--")):
        top = np.minimum(tops[f"operations{precision}"], tops["memory"] * x)
        plane.plot(x, top / 1e9, color="black", linestyle=line, linewidth=1.5, label=f"float{precision}")
    names = [*CEILINGS, WAITS]
    colours = dict(zip(names, plots.COLORS, strict=True))
    used = set()
    for number, row in enumerate(rows, 1):
        name, share = nearest(row, tops)
        limit = name if share >= NEAR else WAITS
        place = operations(row) / row["memory"], operations(row) / row["cpu_seconds"] / 1e9
        look = {"color": colours[limit], "label": None if limit in used else limit}
        used.add(limit)
        bars.barh(number, 100 * share, **look)
        if min(place) > 0:
            plane.plot(*place, marker="o", markersize=4, linestyle="none", color=colours[limit])
            plane.annotate(str(number), place, (3, 2), textcoords="offset points", fontsize=8, color=colours[limit])
    plane.set_xscale("log")
    plane.set_yscale("log")
    plots.decades(plane.yaxis)
    plots.names(plane, "operations per byte of memory", "1e9 operations per CPU second")
    plane.legend(loc="lower right", fontsize=9, frameon=False)
    plots.names(bars, "per cent of the nearest ceiling", "")
    bars.set_yticks(range(1, len(rows) + 1), [f"{title(row)}  {n}" for n, row in enumerate(rows, 1)], fontsize=8)
    bars.set_ylim(len(rows) + 0.7, 0.3)
    bars.legend(loc="lower right", fontsize=8, frameon=True, title="limited by", title_fontsize=8)
    return plots.png(drawing)
