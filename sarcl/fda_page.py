"""The page of an experiment on frequency-diverse apertures: what was gained, and what was not, in words and numbers."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from . import page
from .fda import CONVENTIONAL

RESOLVED = 3.0  # dB between two points that are told apart
SAME = 0.02  # relative: widths that differ by less are one


def html(results: Sequence[dict[str, Any]], title: str = "Frequency-diverse apertures") -> str:
    """The page of `sarcl.fda.run`'s results."""
    parts = [
        page.words(
            "Every case is collected once and focused in several ways, beside a conventional antenna at the array's "
            "mean phase centre that sends a chirp of the same band along the same track. Widths of a point at the "
            "centre say little by themselves: a mapping can narrow that point and nothing else. So there are points "
            "off the centre, and two points side by side; the drawings show the spatial frequencies that were "
            "collected, and those that the mapped positions claim."
        )
    ]
    for result in results:
        parts += section(result)
    return page.page(title, parts)


def section(result: dict[str, Any]) -> list[str]:
    """One case."""
    rows = result["mapped"]
    places = [p["place"] for p in rows[CONVENTIONAL]["points"]]
    parts = [page.heading(result["name"]), page.words(setting(result))]
    parts += [page.words(text) for text in verdicts(result)]
    parts.append(page.table(
        ["", "aperture, m", "gap, m", "claimed, turns/m", "nulls, m", "half power, m", "PSLR, dB", "ISLR, dB"],
        [[name, f"{row['length']:.1f}", f"{row['gap']:.1f}", f"{row['claimed']:.3f}", *_widths(row["points"][0])]
         for name, row in rows.items()],
    ))  # fmt: skip
    parts.append(
        page.words(f"A point at {places[0]:g} m. Lone points elsewhere: error of place, m, and PSLR, dB:", True)
    )
    parts.append(page.table(
        ["", *(f"y = {p:g} m" for p in places)],
        [[name, *(f"{p['error']:+.3f}, {p['pslr_db']:.1f}" for p in row["points"])] for name, row in rows.items()],
    ))  # fmt: skip
    separations = [d["separation"] for d in rows[CONVENTIONAL]["dips"]]
    parts.append(
        page.words("Two equal points in phase about the centre: how deep the image falls between them, dB:", True)
    )
    parts.append(page.table(
        ["", *(f"{s:g} m apart" for s in separations)],
        [[name, *(f"{d['dip_db']:.1f}" for d in row["dips"])] for name, row in rows.items()],
    ))  # fmt: skip
    curves = [(name, separations, [min(d["dip_db"], 40.0) for d in row["dips"]]) for name, row in rows.items()]
    parts.append(page.plot(curves, "separation, m", "dip, dB", "Two points: the dip between them"))
    for name in rows:
        if name in ("apparent", CONVENTIONAL):
            x, y = zip(*rows[name]["support"], strict=True)
            what = "claimed by the mapped positions" if name == "apparent" else "of the conventional antenna"
            parts.append(
                page.plot([(name, y, x)], "across, turns/m", "along, turns/m", f"Spatial frequencies {what}", dots=True)
            )
    collected = rows.get("channels") or rows.get("corrected")
    if collected:
        x, y = zip(*collected["support"], strict=True)
        parts.append(
            page.plot(
                [("collected", y, x)], "across, turns/m", "along, turns/m", "Spatial frequencies collected", dots=True
            )
        )
    return parts


def setting(result: dict[str, Any]) -> str:
    """What was flown."""
    switch = ", its sign changed at mid-aperture with the centre frequency kept" if result["mirrored"] else ""
    return (
        f"{result['n']} elements {1e3 * result['spacing']:.4g} mm apart from {result['center'] / 1e9:g} GHz in steps "
        f"of {result['frequency_step'] / 1e6:g} MHz{switch}: {result['bandwidth'] / 1e6:g} MHz about "
        f"{result['middle'] / 1e9:.4g} GHz. A straight track of {result['aperture']:g} m in "
        f"{result['n_pulses']} pulses, {result['distance'] / 1e3:g} km from the scene. One receiver, at the reference "
        "element."
    )


def verdicts(result: dict[str, Any]) -> list[str]:
    """What each mapping gained over the conventional antenna, and what it did not."""
    rows, out = result["mapped"], []
    plain = rows[CONVENTIONAL]
    for name, row in rows.items():
        if name == CONVENTIONAL:
            continue
        centre, usual = row["points"][0], plain["points"][0]
        narrower = 1 - centre["null"] / usual["null"]
        change = "as far out as" if abs(narrower) < SAME else (
            f"{100 * abs(narrower):.0f} % {'nearer than' if narrower > 0 else 'farther than'}"
        )  # fmt: skip
        text = (
            f"{name}: the first nulls of the point at {centre['place']:g} m lie {change} the conventional antenna's "
            f"({centre['null']:.3f} and {usual['null']:.3f} m), its peak is at {centre['level_db']:.1f} dB, its "
            f"highest side lobe at {centre['pslr_db']:.1f} dB (conventional {usual['pslr_db']:.1f})"
        )
        worst = max(row["points"], key=lambda p: abs(p["error"]))
        if abs(worst["error"]) > 0.1 * usual["null"]:
            text += f"; the point at {worst['place']:g} m comes out {worst['error']:+.3f} m off"
        else:
            text += "; no point is displaced"
        told = [_resolved(r["dips"]) for r in (row, plain)]
        text += f". Two points are told apart {told[0]} (conventional: {told[1]})."
        out.append(text)
    return out


def _resolved(dips: Sequence[dict[str, float]]) -> str:
    apart = [d["separation"] for d in dips if d["dip_db"] >= RESOLVED]
    return f"from {min(apart):g} m on" if apart else "at no separation tried"


def _widths(point: dict[str, float]) -> list[str]:
    return [f"{point['null']:.4f}", f"{point['irw']:.4f}", f"{point['pslr_db']:.2f}", f"{point['islr_db']:.2f}"]
