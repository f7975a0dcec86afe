"""The page of an experiment on frequency-diverse apertures: what was gained, and what was not, in words and numbers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from ...figures.html import heading, page, plot, table, words
from . import _trends
from .experiment import CONVENTIONAL, RESOLVED
from .text import setting, verdicts

__all__ = ["html", "section", "setting", "verdicts"]


def html(results: Sequence[Mapping[str, Any]], title: str = "Frequency-diverse apertures") -> str:
    """The page of `sarcl.fda.run`'s results: sweeps first, as tables and trends, then every case."""
    parts = [
        words(
            "Every case is collected once and focused in several ways, beside a conventional antenna with the same "
            "phase centres that sends a chirp of the same band along the same track. Widths are measured across: "
            "along y, in the ground plane, at right angles to the line of sight from mid-aperture. Those of a point at "
            "the centre say little by themselves: a mapping can narrow that point and nothing else. So there are "
            "points off the centre, and two points side by side; the drawings show the spatial frequencies that were "
            "collected, and those that the mapped positions claim. 0 dB is a focused point seen by one element."
        )
    ]
    parts += _trends.summary(results)
    for result in results:
        parts += section(result)
    return page(title, parts)


def section(result: Mapping[str, Any]) -> list[str]:
    """One case."""
    rows = result["mapped"]
    points = [p["place"] for p in rows[CONVENTIONAL]["points"]]
    parts = [heading(result["name"]), words(setting(result))]
    parts += [words(text) for text in verdicts(result)]
    parts.append(words(f"A point at {points[0]:g} m:", True))
    parts.append(table(
        ["", "aperture, m", "gap, m", "claimed, turns/m", *WIDTHS],
        [[name, f"{row['length']:.1f}", f"{row['gap']:.1f}", f"{row['claimed']:.3f}", *_widths(row["points"][0])]
         for name, row in rows.items()],
    ))  # fmt: skip
    if len(points) > 1:
        parts.append(words("Lone points elsewhere:", True))
        parts.append(table(
            ["", "y, m", "error of place, m", "peak, dB", *WIDTHS],
            [[name, f"{p['place']:g}", f"{p['error']:+.3f}", f"{p['level_db']:.1f}", *_widths(p)]
             for i in range(1, len(points)) for name, row in rows.items() for p in [row["points"][i]]],
        ))  # fmt: skip
    separations = [d["separation"] for d in rows[CONVENTIONAL]["dips"]]
    parts.append(words(
        "Two equal points in phase about the centre: how deep the image falls between them, dB. They are told apart "
        "where it falls by 3 dB, both peaks stand within a quarter of the null width of their points, and no other "
        "peak comes within 3 dB of them; * marks a dip where that fails:", True
    ))  # fmt: skip
    parts.append(table(
        ["", *(f"{s:g} m apart" for s in separations)],
        [[name, *(_dip(d, row["told_apart"]) for d in row["dips"])] for name, row in rows.items()],
    ))  # fmt: skip
    curves = [(name, separations, [min(d["dip_db"], 40.0) for d in row["dips"]]) for name, row in rows.items()]
    parts.append(plot(curves, "separation, m", "dip, dB", "Two points: the dip between them"))
    return parts + _supports(result)


def _supports(result: Mapping[str, Any]) -> list[str]:
    """Drawings of spatial frequencies: collected, of the conventional antenna, and claimed by each set of positions
    that claims others."""
    rows = result["mapped"]
    clouds = [("collected", result["collected"], "Spatial frequencies collected"),
              (CONVENTIONAL, rows[CONVENTIONAL], "Spatial frequencies of the conventional antenna")]  # fmt: skip
    if "apparent" in rows:
        clouds.append(("apparent", rows["apparent"], "Spatial frequencies claimed by the apparent positions"))
    out = []
    for name, row, caption in clouds:
        along, across = zip(*row["support"], strict=True)
        text = f"{caption}: {row['claimed']:.3f} turns/m across"
        out.append(plot([(name, across, along)], "across, turns/m", "along, turns/m", text, dots=True))
    return out


WIDTHS = ("nulls, m", "half power, m", "PSLR, dB", "ISLR, dB")


def _widths(point: Mapping[str, float]) -> list[str]:
    if not point["inside"]:
        return ["no peak", "", "", ""]
    return [f"{point['null']:.4f}", f"{point['irw']:.4f}", f"{point['pslr_db']:.2f}", f"{point['islr_db']:.2f}"]


def _dip(found: Mapping[str, float], told_apart: float | None) -> str:
    told = told_apart is not None and found["separation"] >= told_apart
    return f"{found['dip_db']:.1f}{'' if told or found['dip_db'] < RESOLVED else '*'}"
