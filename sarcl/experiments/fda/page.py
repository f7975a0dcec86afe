"""The page of an experiment on frequency-diverse apertures: conclusion, terms, plots, tables."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping, Sequence
from pkgutil import get_data
from typing import Any

from ...figures.html import Block, heading, page, plot, table, terms, words
from ...figures.html import listed as bullets
from . import _trends
from .experiment import CONVENTIONAL, RESOLVED
from .text import conclusion, decibels, rule, setting, verdicts

__all__ = ["html", "section", "setting", "verdicts"]

Result = Mapping[str, Any]
TITLE = "Frequency-diverse apertures"


def _terms() -> dict[str, str]:
    """Terms of the page, with what they mean: terms.toml beside this file."""
    return tomllib.loads((get_data(__package__, "terms.toml") or b"").decode())


def html(
    results: Sequence[Result],
    title: str = TITLE,
    command: str = "",
    sections: Sequence[Sequence[Block]] | None = None,
    finished: bool = True,
) -> str:
    """The page of `sarcl.fda.run`'s results. Needs the extra `plots`.

    command   the line that made the page, printed on it
    sections  `section` of each result, where they were made before; None: made here
    finished  whether all cases are there; until then the plots of sweeps are left out
    """
    blocks = [
        words(
            "Every case is an array and a track. Its echoes are collected once, mapped and focused in several ways, "
            "and compared with a conventional antenna. The terms are explained after the conclusion."
        ),
        heading("Conclusion"),
        bullets(conclusion(results)),
        heading("Terms"),
        terms([(term, text.format(rule=rule())) for term, text in _terms().items()]),
    ]
    if not finished:
        blocks.insert(1, words("Not finished: more cases follow.", True))
    blocks += _trends.summary(results, finished)
    for blocks_of_cases in sections or map(section, results):
        blocks += blocks_of_cases
    return page(title, blocks, command)


def section(result: Result, level: int = 2) -> list[Block]:
    """One case: what was flown, what each mapping gained, plots, tables; level: of its heading."""
    rows = result["mapped"]
    points = [p["place"] for p in rows[CONVENTIONAL]["points"]]
    separations = [d["separation"] for d in rows[CONVENTIONAL]["dips"]]
    dips = [(name, separations, [min(d["dip_db"], 40.0) for d in row["dips"]]) for name, row in rows.items()]
    blocks = [
        heading(result["name"], level),
        words(setting(result)),
        bullets(verdicts(result)),
        plot(dips, "separation, m", "dip, dB", _caption_of_dips(rows)),
        *_supports(result),
        table(
            ["mapping", "aperture, m", "gap, m", "spread of spatial frequencies, cycles/m", *WIDTHS],
            [
                [name, f"{row['length']:.1f}", f"{row['gap']:.1f}", f"{row['claimed']:.3f}", *_widths(row["points"][0])]
                for name, row in rows.items()
            ],
            f"A point at y = {points[0]:g} m, focused alone. Aperture and gap: length of the track from which the "
            "echoes are focused, and the largest gap in it.",
        ),
    ]
    if len(points) > 1:
        blocks.append(table(
            ["mapping", "y, m", "error of position, m", "peak, dB", *WIDTHS],
            [[name, f"{p['place']:g}", f"{round(p['error'], 3) + 0.0:+.3f}", decibels(p["level_db"])[:-3], *_widths(p)]
             for i in range(1, len(points)) for name, row in rows.items() for p in [row["points"][i]]],
            "Points elsewhere, each focused alone.",
        ))  # fmt: skip
    head = ["mapping", *(f"{s:g} m apart" for s in separations)]
    cells = [[name, *(_dip(d, result["resolved_if"]["shift"]) for d in row["dips"])] for name, row in rows.items()]
    caption = (
        "Two equal points in phase about the centre: dip between their peaks, dB, and whether they are resolved; where "
        "the dip alone would resolve them, the number of peaks, or their largest error of position, or their level. "
        f"Resolved here: {rule(result['null'])}."
    )
    blocks.append(table(head, cells, caption))
    return blocks


def _caption_of_dips(rows: Mapping[str, Any]) -> str:
    text = "Dip between two points against their separation, up to 40 dB."
    deep = {
        name: [f"{d['separation']:g}" for d in row["dips"] if d["dip_db"] >= RESOLVED and not d["resolved"]]
        for name, row in rows.items()
    }
    unresolved = "; ".join(f"{name} at {', '.join(at)} m" for name, at in deep.items() if at)
    return f"{text} Not resolved in spite of their dip: {unresolved}." if unresolved else text


def _supports(result: Result) -> list[Block]:
    """Plots of spatial frequencies: collected, of the conventional antenna, and implied by the apparent positions."""
    rows = result["mapped"]
    clouds = [
        ("collected", result["collected"], "Spatial frequencies collected"),
        (CONVENTIONAL, rows[CONVENTIONAL], "Spatial frequencies of the conventional antenna"),
    ]
    if "apparent" in rows:
        clouds.append(("apparent", rows["apparent"], "Spatial frequencies implied by the apparent positions"))
    out = []
    for name, row, caption in clouds:
        along, across = zip(*row["support"], strict=True)
        text = f"{caption}: spread of {row['claimed']:.3f} cycles/m across."
        out.append(plot([(name, across, along)], "across, cycles/m", "along, cycles/m", text, dots=True))
    return out


WIDTHS = ("null, m", "half power, m", "PSLR, dB", "ISLR, dB")


def _widths(point: Mapping[str, float]) -> list[str]:
    if not point["inside"]:
        return ["no peak", "", "", ""]
    return [f"{point['null']:.4f}", f"{point['irw']:.4f}", f"{point['pslr_db']:.2f}", f"{point['islr_db']:.2f}"]


def _dip(pair: Mapping[str, Any], near: float) -> str:
    """A dip, and whether the points are resolved; near: allowed error of position, m."""
    text = f"{pair['dip_db']:.1f}"
    if pair["resolved"]:
        return f"{text} resolved"
    if pair["dip_db"] < RESOLVED:
        return text
    if len(pair["peaks"]) != 2:
        return f"{text}, {len(pair['peaks'])} peaks"
    return f"{text}, {pair['shift']:.3f} m off" if pair["shift"] > near else f"{text}, at {pair['level_db']:.1f} dB"
