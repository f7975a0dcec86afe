"""Pictures of docs/guide/proof.md."""

from __future__ import annotations

from typing import Any

import numpy as np

from sarcl.figures import plots

Row = dict[str, Any]
WIDE = (9.5, 4.2)  # inches
LEAST = 1e-8  # ratios below are drawn there


def contract(document: Row) -> bytes:
    """Share of tasks whose error over the tolerance is below x, for every verb."""
    drawing = plots.figure(WIDE)
    drawing.set_layout_engine("constrained")
    axes = drawing.add_subplot()
    for i, (verb, entry) in enumerate(document["verbs"].items()):
        values = np.maximum(np.sort(entry["ratios"]), LEAST)
        look = plots.style(i) | {"markevery": (i * len(values) // 40, max(1, len(values) // 8)), "linewidth": 1.8}
        axes.plot(values, np.arange(1, len(values) + 1) / len(values), label=f"{verb} ({len(values)})", **look)
    axes.axvline(1.0, color="black", linewidth=2)
    axes.annotate("tolerance", (1.0, 0.02), (-4, 0), textcoords="offset points", ha="right", fontsize=9)
    axes.set_xscale("log")
    axes.set_xlim(1e-6, 3)
    plots.names(axes, "largest error of a task over its tolerance", "share of tasks below")
    axes.legend(loc="upper left", fontsize=9, frameon=False, handlelength=4)
    return plots.png(drawing)


def echo_peers(document: Row) -> bytes:
    """Rate of spreading points against achieved error, sarcl beside finufft."""
    drawing = plots.figure(WIDE)
    drawing.set_layout_engine("constrained")
    axes = drawing.add_subplot()
    pairs, names = document["points"] * document["pulses"] / 1e6, {}
    for row in document["spread"]:
        precision = row["setting"].split()[1:]
        names.setdefault(", ".join([row["name"], *precision]), []).append((row["error"], pairs / min(row["seconds"])))
    for i, (name, points) in enumerate(names.items()):
        axes.plot(*np.array(sorted(points)).T, label=name, **plots.style(i))
    axes.set_xscale("log")
    axes.set_yscale("log")
    plots.decades(axes.yaxis)
    plots.names(axes, "relative L2 error against the exact sum", "million pairs of point and pulse per second")
    axes.set_title("Spreading points into range profiles: up and left is better", loc="left")
    axes.legend(fontsize=9, frameon=False, handlelength=4)
    return plots.png(drawing)


def skipping(document: Row) -> bytes:
    """Shares of the pairs of every scene and verb, by reason."""
    drawing = plots.figure(WIDE)
    drawing.set_layout_engine("constrained")
    axes = drawing.add_subplot()
    bars = [
        (f"{scene}, {verb}", found[verb]["shares"])
        for scene, found in document["scenes"].items()
        for verb in ("echo", "backproject")
    ]
    reasons = dict.fromkeys(why for _, shares in bars for why in ("computed", *shares))
    begin = np.zeros(len(bars))
    for i, why in enumerate(reasons):
        width = np.array([100 * shares.get(why, 0.0) for _, shares in bars])
        color = "#d9d9d9" if why == "computed" else plots.COLORS[(i - 1) % len(plots.COLORS)]
        hatch = None if i <= len(plots.COLORS) else "//"
        axes.barh(range(len(bars)), width, left=begin, color=color, hatch=hatch, label=why, edgecolor="white")
        begin += width
    axes.invert_yaxis()
    axes.set_axisbelow(True)
    axes.set_xlim(0, 100)
    plots.names(axes, "per cent of the pairs", "")
    axes.set_yticks(range(len(bars)), [name for name, _ in bars])  # names() writes ticks as numbers
    axes.legend(loc="upper left", bbox_to_anchor=(1.01, 1.0), fontsize=9, frameon=False)
    return plots.png(drawing)
