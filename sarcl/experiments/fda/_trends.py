"""Sweeps on the page of an experiment: a table of all cases, and what is measured drawn against what was swept."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from ...figures import html
from ._sweep import UNITS, shown
from .experiment import CONVENTIONAL, nearer
from .text import at_most

DECADE = 20.0  # ratio of values from which on the axis is in decades
Result = Mapping[str, Any]


def worst(row: Mapping[str, Any]) -> float:
    """The largest error of place of a lone point, m."""
    return float(max(abs(p["error"]) for p in row["points"]))


def _of_first(key: str) -> Callable[[Mapping[str, Any]], float | None]:
    return lambda row: row["points"][0][key] if row["points"][0]["inside"] else None


QUANTITIES: tuple[tuple[str, str, Callable[[Mapping[str, Any]], float | None]], ...] = (
    ("nulls, m", "{:.4f}", _of_first("null")),
    ("half power, m", "{:.4f}", _of_first("irw")),
    ("PSLR, dB", "{:.2f}", _of_first("pslr_db")),
    ("ISLR, dB", "{:.2f}", _of_first("islr_db")),
    ("largest error of place, m", "{:.3f}", worst),
    ("told apart from, m", "{:g}", lambda row: row["told_apart"]),
)


def summary(results: Sequence[Result]) -> list[str]:
    """Of every series that was swept: heading, words, table and drawings; nothing where nothing was."""
    parts: list[str] = []
    series: dict[tuple[str, tuple[str, ...]], list[Result]] = {}
    for result in results:
        if result["swept"]:
            series.setdefault((result["series"], tuple(result["swept"])), []).append(result)
    for (name, keys), cases in series.items():
        parts.append(html.heading(f"{name}: sweep of {', '.join(keys)}"))
        parts += [html.words(text) for text in words(cases)]
        parts.append(_table(cases))
        drawings = _drawings(cases)
        if drawings:
            note = (
                "Curves that coincide hide one another, the last named on top; a point is missing where there is none."
            )
            parts.append(html.words(note, True))
        parts += drawings
    return parts


def names(cases: Sequence[Result]) -> list[str]:
    """Conventional antenna first, then every mapping asked for."""
    return [CONVENTIONAL, *dict.fromkeys(name for case in cases for name in case["mappings"])]


def words(cases: Sequence[Result]) -> list[str]:
    """Over all cases of a sweep, what each mapping gained and what it did not."""
    out = []
    for name in names(cases)[1:]:
        there = [case for case in cases if name in case["mapped"]]
        if not there:
            out.append(f"{name}: applies to none of the {len(cases)} cases.")
            continue
        rows, plain = ([case["mapped"][who] for case in there] for who in (name, CONVENTIONAL))
        found = [nearer(row, usual, case["null"]) for row, usual, case in zip(rows, plain, there, strict=True)]
        some = "" if len(there) == len(cases) else f" (it applies to {len(there)} of {len(cases)} cases)"
        out.append(
            f"{name}{some}: nulls of the first point {_range(rows, 0)} m out (conventional {_range(plain, 0)}), "
            f"highest side lobes {_range(rows, 2)} dB (conventional {_range(plain, 2)}), no point displaced by more "
            f"than {at_most(max(worst(row) for row in rows))} m. Two points are told apart nearer together than by the "
            f"conventional antenna in {found.count(1)} of {len(there)} cases, from the same separation on in "
            f"{found.count(0)}, only farther apart or not at all in {found.count(-1)}, and by neither in "
            f"{found.count(None)}."
        )
    return out


def _range(rows: Sequence[Mapping[str, Any]], quantity: int) -> str:
    _, form, value = QUANTITIES[quantity]
    found = [v for v in map(value, rows) if v is not None]
    if not found:
        return "nowhere"
    ends = [form.format(v) for v in (min(found), max(found))]
    ends = [end if float(end) else end.lstrip("-") for end in ends]
    return ends[0] if ends[0] == ends[1] else " to ".join(ends)


def _table(cases: Sequence[Result]) -> str:
    rows = []
    for case in cases:
        values = [shown(key, value) for key, value in case["swept"].items()]
        for name in names(cases):
            if name in case["mapped"]:
                found = [(form, value(case["mapped"][name])) for _, form, value in QUANTITIES]
                rows.append([*values, name, *("none" if v is None else form.format(v) for form, v in found)])
            elif name in case["not_applicable"]:
                rows.append([*values, name, "not applicable", *[""] * (len(QUANTITIES) - 1)])
    return html.table([*cases[0]["swept"], "", *(title for title, _, _ in QUANTITIES)], rows)


def _drawings(cases: Sequence[Result]) -> list[str]:
    """Every quantity against the first key of several numbers, anew for every combination of the other keys."""
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
    for rest, some in others.items():
        for title, _, value in QUANTITIES:
            curves = []
            for name in names(some):
                found = sorted(
                    (scale * case["swept"][key], v)
                    for case in some
                    if name in case["mapped"] and (v := value(case["mapped"][name])) is not None
                )
                x, y = zip(*found, strict=True) if found else ((), ())
                curves.append((name if found else f"({name}: none)", x, y))
            if any(len(x) for _, x, _ in curves):
                out.append(html.plot(curves, axis, title, f"{title}{'; ' if rest else ''}{rest}", log_x=many))
    return out
