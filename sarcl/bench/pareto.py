"""Rate against achieved error, both logarithmic: a panel for each case, a curve for each library, device and method."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from ..figures import plots
from . import ratios

if TYPE_CHECKING:
    from matplotlib.axes import Axes

PANEL = (9.5, 4.8)  # inches
OURS = ("#165294", "#c44418", "#5a96d7", "#e88c5a")
THEIRS = ("#107c58", "#844696", "#b8860b", "#6e6e6e", "#3ca0aa", "#aa3c6e")
MARKS = ("s", "D", "^", "x")

Series = dict[str, list[ratios.Row]]


def picture(cases: list[ratios.Result]) -> bytes:
    """PNG of a document's cases; cases without a row that ran are left out. Needs the extra `plots`.

    ValueError where no case has such a row.
    """
    drawn = [case for case in cases if ratios.ran(case)]
    if not drawn:
        raise ValueError("no case has a row that ran; there is nothing to draw")
    columns = 1 if len(drawn) < 4 else 2
    rows = -(-len(drawn) // columns)
    label = plots.figure((columns * PANEL[0], rows * PANEL[1]))
    label.set_layout_engine("constrained")
    styles = _styles(drawn)
    panels = [label.add_subplot(rows, columns, i + 1) for i in range(len(drawn))]
    for axes, case in zip(panels, drawn, strict=True):
        _draw(axes, case, styles)
    label.canvas.draw()  # places the panels; labels are then put where none stands yet
    for axes, case in zip(panels, drawn, strict=True):
        _label(axes, case, styles)
    return plots.png(label, 256)


def series(case: ratios.Result) -> Series:
    """The rows of each curve, by its label; sarcl's first, the exact peers' by kind of interpolation."""
    curves: Series = {}
    for row in sorted(ratios.ran(case), key=lambda row: not ratios.is_sarcl(row)):
        label = f"{row['who']} {row['method']}"
        if ratios.is_sarcl(row):
            label += f", {row['device']}"
        elif row["method"] == "direct":
            label += f", {row['setting'].split(',')[0]}"
        curves.setdefault(label, []).append(row)
    return curves


def _styles(cases: list[ratios.Result]) -> dict[str, dict[str, Any]]:
    """Options of every curve for matplotlib, the same in all panels."""
    styles: dict[str, dict[str, Any]] = {}
    ours = theirs = 0
    for case in cases:
        for label, rows in series(case).items():
            if label in styles:
                continue
            if ratios.is_sarcl(rows[0]):
                styles[label] = {"color": OURS[ours % len(OURS)], "marker": "o", "linestyle": plots.LINES[ours % 4]}
                ours += 1
            else:
                # Settings of a peer's factorized former are no sequence: their points are not connected.
                line = "--" if rows[0]["method"] == "direct" else "none"
                look = {"color": THEIRS[theirs % len(THEIRS)], "marker": MARKS[theirs % len(MARKS)], "linestyle": line}
                styles[label] = look
                theirs += 1
    return styles


def _draw(axes: Axes, case: ratios.Result, styles: dict[str, dict[str, Any]]) -> None:
    for label, rows in series(case).items():
        x, y = [row["error"] for row in rows], [ratios.rate(case, row) for row in rows]
        axes.plot(x, y, label=label, linewidth=1.5, markersize=6, **styles[label])
    axes.set_xscale("log")
    axes.set_yscale("log")
    plots.decades(axes.yaxis)
    axes.margins(0.08, 0.15)
    plots.names(axes, "relative L2 error against the exact sum", "rate, Gbp/s (1e9 pulses x pixels per second)")
    axes.set_title(f"{case['scene']}, {case['data']}, n = {case['n']}: up and left is better", loc="left")
    axes.legend(loc="upper left", bbox_to_anchor=(1.01, 1.0), fontsize=9, frameon=False, handlelength=4)


def _label(axes: Axes, case: ratios.Result, styles: dict[str, dict[str, Any]]) -> None:
    """sarcl's tolerances above the points, the exact peers' upsampling below; the other side where that is taken."""
    taken: list[Any] = []
    for label, rows in series(case).items():
        for row in rows:
            if ratios.is_sarcl(row):
                text, sides = row["setting"].replace("e-0", "e-"), (7, -14)
            elif row["method"] == "direct":
                text, sides = row["setting"].split(";")[0].split(", ")[-1], (-14, 7)
            else:
                continue
            for shift in sides:
                annotation = axes.annotate(
                    text,
                    (row["error"], ratios.rate(case, row)),
                    (0, shift),
                    textcoords="offset points",
                    ha="center",
                    fontsize=8,
                    color=styles[label]["color"],
                )
                box = annotation.get_window_extent()
                if not any(box.overlaps(other) for other in taken):
                    taken.append(box)
                    break
                annotation.remove()
