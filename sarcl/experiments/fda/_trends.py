"""Sweeps on the page of an experiment: measured quantities plotted against the swept one, and a table of all cases."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from ...figures import html
from ._sweep import UNITS, shown
from .experiment import CONVENTIONAL
from .text import conclusion, mappings_of, worst

DECADE = 20.0  # ratio of largest to smallest value from which on the axis is logarithmic
Result = Mapping[str, Any]


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
    """Blocks of every series that was swept: heading, conclusion, plots (unless left out) and table."""
    blocks: list[html.Block] = []
    series: dict[tuple[str, tuple[str, ...]], list[Result]] = {}
    for result in results:
        if result["swept"]:
            series.setdefault((result["series"], tuple(result["swept"])), []).append(result)
    for (name, keys), cases in series.items():
        blocks.append(html.heading(f"{name}: sweep of {', '.join(keys)}"))
        if len(cases) < len(results):  # else the conclusion of the page says it
            blocks.append(html.listed(conclusion(cases)))
        drawn = _plots(cases) if plots else []
        if drawn:
            note = "The first point of each case. A marker is missing where there is no value."
            blocks += [html.words(note, True), *drawn]
        blocks.append(_table(cases))
    return blocks


def _names(cases: Sequence[Result]) -> list[str]:
    return [CONVENTIONAL, *mappings_of(cases)]


def _table(cases: Sequence[Result]) -> html.Block:
    rows = []
    for case in cases:
        values = [shown(key, value) for key, value in case["swept"].items()]
        for name in _names(cases):
            if name in case["mapped"]:
                row_of = [(form, value(case["mapped"][name])) for _, form, value in QUANTITIES]
                rows.append([*values, name, *("none" if v is None else form.format(v) for form, v in row_of)])
            elif name in case["not_applicable"]:
                rows.append([*values, name, "not applicable", *[""] * (len(QUANTITIES) - 1)])
    head = [*cases[0]["swept"], "mapping", *(title for title, _, _ in QUANTITIES)]
    caption = (
        "All cases of the sweep: the first point, focused alone; the largest error of position of any point; the "
        "smallest separation from which on two points are resolved."
    )
    return html.table(head, rows, caption)


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
        for title, _, value in QUANTITIES:
            curves = []
            for name in _names(group):
                pairs = sorted(
                    (scale * case["swept"][key], v)
                    for case in group
                    if name in case["mapped"] and (v := value(case["mapped"][name])) is not None
                )
                x, y = zip(*pairs, strict=True) if pairs else ((), ())
                curves.append((name if pairs else f"({name}: none)", x, y))
            if any(len(x) for _, x, _ in curves):
                out.append(html.plot(curves, axis, title, f"{title}{'; ' if rest else ''}{rest}", log_x=many))
    return out
