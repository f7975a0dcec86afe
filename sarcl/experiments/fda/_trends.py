"""Table of all cases on the page of an experiment, and plots of measured quantities against a swept one."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from ...figures import html
from ...figures.plots import ends
from ._sweep import UNITS, shown
from .experiment import CONVENTIONAL, nearer
from .text import conclusion, mappings_of, spoiled, worst

DECADE = 20.0  # ratio of largest to smallest value from which on the axis is logarithmic
Result = Mapping[str, Any]

RANKS = {
    1: "resolved closer together",
    0: "resolved equally close",
    -1: "resolved farther apart or not at all",
    None: "resolved by neither",
}


def _of_first(key: str) -> Callable[[Mapping[str, Any]], float | None]:
    return lambda row: row["points"][0][key] if row["points"][0]["inside"] else None


QUANTITIES: tuple[tuple[str, str, Callable[[Mapping[str, Any]], float | None]], ...] = (
    ("null, m", "{:.4f}", _of_first("null")),
    ("half power, m", "{:.4f}", _of_first("irw")),
    ("PSLR, dB", "{:.2f}", _of_first("pslr_db")),
    ("ISLR, dB", "{:.2f}", _of_first("islr_db")),
    ("largest error of position, m", "{:.3f}", worst),
    ("resolved from, m", "{:g}", lambda row: row["told_apart"]),
)


def summary(results: Sequence[Result], plots: bool = True) -> list[html.Block]:
    """Blocks of every series that was swept: heading, plots (unless left out), and its conclusion in words."""
    blocks: list[html.Block] = []
    series: dict[tuple[str, tuple[str, ...]], list[Result]] = {}
    for result in results:
        if result["swept"]:
            series.setdefault((result["series"], tuple(result["swept"])), []).append(result)
    for (name, keys), cases in series.items():
        blocks.append(html.heading(f"{name}: sweep of {', '.join(keys)}"))
        drawn = _plots(cases) if plots else []
        if drawn:
            note = "The first point of each case. A marker is missing where there is no value."
            blocks += [html.words(note, True), *drawn]
        if len(cases) < len(results):  # else the conclusion of the page says it
            blocks.append(html.listed(conclusion(cases)))
    return blocks


def _names(cases: Sequence[Result]) -> list[str]:
    return [CONVENTIONAL, *mappings_of(cases)]


def table(results: Sequence[Result]) -> html.Block:
    """Every case and mapping: values of the first point, and whether two points are resolved closer together."""
    series = {(result["series"], *result["swept"]) for result in results}
    keys = [*results[0]["swept"]] if len(series) == 1 else []
    rows: list[list[str]] = []
    marked = []
    for case in results:
        plain = case["mapped"][CONVENTIONAL]
        which = [shown(key, case["swept"][key]) for key in keys] or [case["name"]]
        for name in _names(results):
            if name in case["mapped"]:
                row = case["mapped"][name]
                values = [(form, value(row)) for _, form, value in QUANTITIES]
                rank = nearer(row, plain, case["null"])
                verdict = "reference" if name == CONVENTIONAL else RANKS[rank]
                if name != CONVENTIONAL and rank == -1:
                    marked.append(len(rows))
                texts = ["none" if v is None else form.format(v) for form, v in values]
                rows.append([*which, name, *texts, verdict, spoiled(row, case["null"])])
            elif name in case["not_applicable"]:
                reason = case["not_applicable"][name]
                rows.append([*which, name, *[""] * len(QUANTITIES), "not applicable", f"{reason}."])
    head = [*(keys or ["case"]), "mapping", *(title for title, _, _ in QUANTITIES), "two points", "why"]
    caption = (
        "The first point, focused alone; the largest error of position of any point; the smallest separation from "
        "which on two points are resolved, and whether the conventional antenna needs a larger one."
    )
    return html.table(head, rows, caption, text=True, marked=marked)


def _plots(cases: Sequence[Result]) -> list[html.Block]:
    """Every quantity against the first swept key with several numbers, once for every combination of the others."""
    for key in cases[0]["swept"]:
        values = [case["swept"][key] for case in cases]
        if all(isinstance(v, (int, float)) and not isinstance(v, bool) for v in values) and len(set(values)) > 1:
            break
    else:
        return []
    unit, scale = UNITS.get(key, ("", 1.0))
    many = min(values) > 0 and max(values) / min(values) >= DECADE
    axis = f"{key}, {unit}".rstrip(" ,")
    others: dict[str, list[Result]] = {}
    for case in cases:
        rest = ", ".join(f"{k} {shown(k, v)}" for k, v in case["swept"].items() if k != key)
        others.setdefault(rest, []).append(case)
    out = []
    for rest, group in others.items():
        for title, form, value in QUANTITIES:
            known = [
                float(form.format(v))
                for case in cases
                for row in case["mapped"].values()
                if (v := value(row)) is not None
            ]
            limits = None if many else ends([scale * np.array(values)]), ends([known])
            curves = []
            for name in _names(group):
                pairs = sorted(
                    (scale * case["swept"][key], float(form.format(v)))  # to the digits of the table
                    for case in group
                    if name in case["mapped"] and (v := value(case["mapped"][name])) is not None
                )
                x, y = zip(*pairs, strict=True) if pairs else ((), ())
                curves.append((name if pairs else f"({name}: none)", x, y))
            if any(len(x) > 1 for _, x, _ in curves):
                text = f"{title}{'; ' if rest else ''}{rest}"
                out.append(html.plot(curves, axis, title, text, log_x=many, limits=limits))
    return out
