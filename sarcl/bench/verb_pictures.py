"""CPU seconds of a verb against achieved error, and against the size of its task."""

from __future__ import annotations

import itertools

from ..figures import plots
from . import ratios

SIZE = (12.0, 4.2)  # inches
MARKS = ("o", "s", "D", "^", "v")  # of tolerances


def picture(cases: list[ratios.Result]) -> bytes:
    """PNG of the cases of one verb, in growing size: needs the extra `plots`.

    ValueError where no case has a row that ran.
    """
    lines: dict[tuple[str, str], list[ratios.Row]] = {}  # (device and method, tolerance) -> rows in growing size
    for case in cases:
        for row in ratios.ran(case):
            label = ", ".join(filter(None, (row["method"], row["device"])))
            lines.setdefault((label, row["setting"]), []).append(
                {**row, "n": case["n"], "cpu": ratios.best(row, "cpu")}
            )
    if not lines:
        raise ValueError("no case has a row that ran; there is nothing to draw")
    sizes = [case["n"] for case in cases]
    figure = plots.figure(SIZE)
    figure.set_layout_engine("constrained")
    panels = figure.subplots(1, min(len(sizes), 2), sharey=True, squeeze=False)[0]  # one size is no curve
    error, of_size = panels[0], panels[1:]
    marks = dict(zip(dict.fromkeys(tolerance for _, tolerance in lines), itertools.cycle(MARKS), strict=False))
    for i, label in enumerate(dict.fromkeys(label for label, _ in lines)):
        look = plots.style(i)
        own = {tolerance: rows for (name, tolerance), rows in lines.items() if name == label}
        for k, n in enumerate(sizes):
            rows = [row for group in own.values() for row in group if row["n"] == n]
            error.plot([row["error"] for row in rows], [row["cpu"] for row in rows], **look | {"marker": ""})
            for row in rows[:1]:  # the largest tolerance
                place, shift = (row["error"], row["cpu"]), (6, 4 - 14 * (k % 2))
                error.annotate(f"n = {n}", place, shift, textcoords="offset points", fontsize=8)
        for tolerance, rows in own.items():
            look["marker"] = marks[tolerance]
            name, cpu = f"{label} at {tolerance.replace('e-0', 'e-')}", [row["cpu"] for row in rows]
            error.plot([row["error"] for row in rows], cpu, label=name, **look | {"linestyle": "none"})
            for axes in of_size:
                axes.plot([row["n"] for row in rows], cpu, label=name, **look)
    for axes in panels:
        axes.set_xscale("log")
        axes.set_yscale("log")
        axes.margins(0.12, 0.1)
    plots.decades(error.yaxis)
    plots.decades(error.xaxis)
    plots.names(error, "relative error against the exact result", "CPU seconds")
    for axes in of_size:
        plots.names(axes, "size n", "")
        axes.set_xticks(sizes, [str(n) for n in sizes])
        axes.minorticks_off()
    error.set_title(f"{cases[0]['scene']}: down and left is better", loc="left")
    panels[-1].legend(fontsize=8, frameon=False, loc="upper left", bbox_to_anchor=(1.01, 1.0))
    return plots.png(figure, 128)
