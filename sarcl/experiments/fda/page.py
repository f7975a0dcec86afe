"""The page of an experiment on frequency-diverse apertures: pictures, table of all cases, plots, tables, terms."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping, Sequence
from pkgutil import get_data
from typing import Any

from ...figures.html import Block, heading, page, plot, strip, table, terms, words
from ...figures.html import listed as bullets
from ...figures.plots import ends
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
    sections = [*map(section, results)] if sections is None else sections
    trends, cases = _trends.summary(results, finished), [block for blocks in sections for block in blocks]
    first, *for_mappings = conclusion(results)
    blocks = [] if finished else [words("Not finished: more cases follow.", True)]
    blocks += strip(trends) or strip(cases)
    blocks += [heading("Conclusion"), words(first), _trends.table(results), *trends, *cases]
    if for_mappings:
        blocks += [heading("Mappings in words"), bullets(for_mappings)]
    blocks += [heading("Terms"), terms([(term, text.format(rule=rule())) for term, text in _terms().items()])]
    blocks += [
        heading("About this page"),
        words(
            "Every case is an array and a track. Its echoes are collected once, mapped and focused in several ways, "
            "and compared with a conventional antenna."
        ),
    ]
    return page(title, blocks, command)


def section(result: Result, level: int = 2) -> list[Block]:
    """One case: array and track, plots, tables, and what each mapping gained in words; level: of its heading."""
    rows = result["mapped"]
    points = [p["place"] for p in rows[CONVENTIONAL]["points"]]
    separations = [d["separation"] for d in rows[CONVENTIONAL]["dips"]]
    dips = [(name, separations, [min(d["dip_db"], 40.0) for d in row["dips"]]) for name, row in rows.items()]
    blocks = [
        heading(result["name"], level),
        words(setting(result)),
        *([plot(dips, "separation, m", "dip, dB", _caption_of_dips(rows))] if len(separations) > 1 else []),
        *_supports(result),
        table(
            ["mapping", "aperture, m", "gap, m", "spread of spatial frequencies, cycles/m"],
            [
                [name, f"{row['length']:.1f}", f"{row['gap']:.1f}", f"{row['claimed']:.3f}"]
                for name, row in rows.items()
            ],
            "Aperture and gap: length of the track from which the echoes are focused, and the largest gap in it.",
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
    return [*blocks, table(head, cells, caption), bullets(verdicts(result))]


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
    supports = [zip(*row["support"], strict=True) for _, row, _ in clouds]
    along, across = zip(*supports, strict=True)
    limits = ends(across), ends(along)
    return [
        plot(
            [(name, across[i], along[i])],
            "across, cycles/m",
            "along, cycles/m",
            f"{caption}: spread of {row['claimed']:.3f} cycles/m across.",
            dots=True,
            limits=limits,
        )
        for i, (name, row, caption) in enumerate(clouds)
    ]


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
