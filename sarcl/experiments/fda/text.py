"""Sentences about experiments on frequency-diverse apertures: array and track, and what each mapping gained or lost."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from .experiment import CONVENTIONAL, NEAR, RESOLVED, WEAK, Pair, is_resolved, nearer

SAME = 0.02  # relative difference below which two widths count as equal
DISPLACED = 0.1  # share of the null: smaller errors of position are not worth a sentence
RECEIVERS = {
    "reference": "One receiver, at the reference element.",
    "own": "Every element receives its own channel.",
    "all": "Every element receives every channel; the channels are kept separate.",
}


def rule(null: float | None = None) -> str:
    """Rule by which two points are resolved, with its tolerances; null: of the conventional antenna, m."""
    place = f"{NEAR:g} times the conventional antenna's null" if null is None else f"{NEAR * null:.3f} m"
    return (
        f"as many peaks as points: a dip of {RESOLVED:g} dB or more between two peaks, each within {place} of its "
        f"point and at most {-WEAK:g} dB below a unit point in focus, and every other peak {RESOLVED:g} dB or more "
        "below the lower of the two"
    )


def unresolved(two: Pair, null: float) -> list[str]:
    """Every reason why a pair of points (`fda.pair`) is not resolved, in words; empty where it is.

    null: of the conventional antenna, m
    """
    count = f"{len(two['peaks'])} peak{'s' if len(two['peaks']) > 1 else ''}"
    where = f"{count} within {RESOLVED:g} dB for 2 points, at {', '.join(f'{x:+.3f}' for x in two['peaks'])} m"
    if two["shift"] is None or two["false_db"] is None:
        return [where if len(two["peaks"]) > 1 else "1 peak for 2 points"]
    out = []
    if two["dip_db"] < RESOLVED:
        out.append(f"the dip is {two['dip_db']:.1f} dB ({RESOLVED:g} dB are needed)")
    if two["shift"] > NEAR * null:
        out.append(f"a peak is displaced by {two['shift']:.3f} m ({NEAR * null:.3f} m are allowed)")
    if two["false_db"] > -RESOLVED:
        out.append(f"another peak reaches {decibels(two['false_db'])} of the lower of the two: {where}")
    if two["level_db"] < WEAK:
        out.append(f"the lower peak is at {decibels(two['level_db'])} ({WEAK:g} dB are needed)")
    return out


def conclusion(results: Sequence[Mapping[str, Any]]) -> list[str]:
    """Gains of the mappings over the conventional antenna in all cases: a sentence, then a line per mapping."""
    names, better, lines = mappings_of(results), [], []
    for name in names:
        cases = [case for case in results if name in case["mapped"]]
        if not cases:
            lines.append(f"{name}: applies to none of the {_cases(len(results))}.")
            continue
        rows, plain = ([case["mapped"][who] for case in cases] for who in (name, CONVENTIONAL))
        ranks = [nearer(row, usual, case["null"]) for row, usual, case in zip(rows, plain, cases, strict=True)]
        if ranks.count(1):
            better.append(f"{name} in {ranks.count(1)} of {_cases(len(cases))}")
        share = "" if len(cases) == len(results) else f" (applies to {len(cases)} of {_cases(len(results))})"
        nulls, usual = _extremes(rows, "null", ".4f"), _extremes(plain, "null", ".4f")
        lobes, normal = _extremes(rows, "pslr_db", ".1f"), _extremes(plain, "pslr_db", ".1f")
        neither = f", with neither in {ranks.count(None)}" if None in ranks else ""
        lines.append(
            f"{name}{share}: two points resolved closer together in {ranks.count(1)} of {_cases(len(cases))}, equally "
            f"close in {ranks.count(0)}, only farther apart or not at all in {ranks.count(-1)}{neither}. Null of the "
            f"first point {nulls} m (conventional {usual}), highest side lobe {lobes} dB (conventional {normal}), "
            f"points displaced by at most {at_most(max(worst(row) for row in rows))} m."
        )
    if not names:
        return ["No mapping was measured."]
    first = (
        f"Two points are resolved closer together than by the conventional antenna with {'; with '.join(better)}."
        if better
        else "No mapping resolves two points closer together than the conventional antenna does."
    )
    return [first, *lines]


def mappings_of(results: Sequence[Mapping[str, Any]]) -> list[str]:
    """Every mapping asked for in any case, in order."""
    return list(dict.fromkeys(name for case in results for name in case["mappings"]))


def worst(row: Mapping[str, Any]) -> float:
    """The largest error of position of a lone point, m."""
    return float(max(abs(p["error"]) for p in row["points"]))


def _cases(n: int) -> str:
    return f"{n} case" if n == 1 else f"{n} cases"


def _extremes(rows: Sequence[Mapping[str, Any]], key: str, form: str) -> str:
    """Smallest to largest value of the first points that have a peak on their cut."""
    values = [row["points"][0][key] for row in rows if row["points"][0]["inside"]]
    if not values:
        return "nowhere"
    ends = [f"{v + 0.0:{form}}" for v in (min(values), max(values))]
    return ends[0] if ends[0] == ends[1] else " to ".join(ends)


def setting(result: Mapping[str, Any]) -> str:
    """Array, track and receiver of a case, and the conventional antenna it is compared with."""
    return f"{_array(result)} {_path(result)} {RECEIVERS[result['receive']]} {_beside(result)}"


def _array(result: Mapping[str, Any]) -> str:
    kind, n = result["progression"], result["n"]
    steps = " and ".join(f"{f / 1e6:g}" for f in np.atleast_1d(result["frequency_step"]))
    where = {"vertical": "along z", "planar": "along the track and along z"}.get(kind, "along the track")
    order = {
        "costas": " in a Costas order",
        "subarrays": f" per element, in {result['groups']} groups; each group sends the carrier of its first element",
    }.get(kind, "")
    switch = (
        "; from mid-aperture on the carriers run in reverse over the elements, at the same centre frequency"
        if result["mirrored"]
        else ""
    )
    apart = f"{result['spacing']:.4g} m" if result["spacing"] >= 1 else f"{1e3 * result['spacing']:.4g} mm"
    text = (
        f"{' x '.join(str(i) for i in np.atleast_1d(n))} elements {apart} apart {where}, with carriers from "
        f"{result['center'] / 1e9:g} GHz in steps of {steps} MHz{order}{switch}. Bandwidth "
        f"{result['bandwidth'] / 1e6:g} MHz, centre frequency {result['middle'] / 1e9:.4g} GHz."
    )
    if kind == "subarrays":
        off = (
            f"{np.rad2deg(result['steer']):.4g} deg off the scene's centre" if result["steer"] else "the scene's centre"
        )
        text += f" The groups are steered at {off}, as seen from mid-aperture."
    return text


def _path(result: Mapping[str, Any]) -> str:
    length, pulses = f"{result['aperture']:g} m in {result['n_pulses']} pulses", f"{result['distance'] / 1e3:g} km from"
    high = f" and {result['height']:g} m above it" if result["height"] else ""
    if result["path"] == "circle":
        arc = np.rad2deg(result["aperture"] / np.sqrt(result["distance"] ** 2 - result["height"] ** 2))
        return (
            f"An arc of {length}, {arc:.3g} deg about the scene's centre, {pulses} it{high}; the array turns with it."
        )
    squint = np.rad2deg(result["squint"])
    lean = f", squinted by {abs(squint):.3g} deg {'ahead of' if squint > 0 else 'behind'} broadside" if squint else ""
    return f"A straight track of {length}, {pulses} the scene{high}{lean}."


def _beside(result: Mapping[str, Any]) -> str:
    if not result["is_wide"]:
        return "Compared with a conventional antenna at the mean phase centre that sends a chirp of the same band."
    received = {
        "reference": "received at the reference element",
        "own": "each received by itself",
        "all": "received by all elements",
    }
    return (
        "Compared with a conventional array with the same phase centres, whose elements all send a chirp of the same "
        f"band; the chirps are kept separate, {received[result['receive']]}."
    )


def verdicts(result: Mapping[str, Any]) -> list[str]:
    """Gain or loss of each mapping against the conventional antenna; why other mappings do not apply."""
    rows, null = result["mapped"], result["null"]
    out = [f"{name}: {_verdict(row, rows[CONVENTIONAL], null)}" for name, row in rows.items() if name != CONVENTIONAL]
    return out + [f"{name}: not applicable. {reason}." for name, reason in result["not_applicable"].items()]


def _verdict(row: Mapping[str, Any], plain: Mapping[str, Any], null: float) -> str:
    first, usual = row["points"][0], plain["points"][0]
    place = f"the point at {first['place']:g} m"
    if not first["inside"]:
        return (
            f"{place} has no peak on the cut through it: the largest value, {decibels(first['level_db'])}, is at an "
            "end of the cut."
        )
    narrower = 1 - first["null"] / usual["null"]
    change = (
        f"as far from the peak, to {100 * SAME:g} %, as"
        if abs(narrower) < SAME
        else (
            f"{100 * abs(narrower):.0f} % {'closer to the peak than' if narrower > 0 else 'farther from the peak than'}"
        )
    )
    text = (
        f"the first nulls of {place} are {change} the conventional antenna's ({first['null']:.3f} m; conventional "
        f"{usual['null']:.3f}). Half-power width {first['irw']:.3f} m (conventional {usual['irw']:.3f}), peak at "
        f"{decibels(first['level_db'])}, highest side lobe at {first['pslr_db']:.1f} dB (conventional "
        f"{usual['pslr_db']:.1f})."
    )
    if first["level_db"] < WEAK:
        text += " So weak a peak is smeared, or its main lobe is not on this cut."
    worst_point = max(row["points"], key=lambda p: abs(p["error"]))
    if abs(worst_point["error"]) > DISPLACED * usual["null"]:
        text += f" The point at {worst_point['place']:g} m is displaced by {worst_point['error']:+.3f} m."
    else:
        text += f" No point is displaced along its cut by more than {at_most(worst_point['error'])} m."
    alike = nearer(row, plain, null) == 0 and row["told_apart"] != plain["told_apart"]
    same = ", with dips that differ by less than 0.2 dB" if alike else ""
    text = f"{text} Two points are resolved {_apart(row)} (conventional: {_apart(plain)}{same})."
    return f"{text} {spoiled(row, null)}".rstrip()


def decibels(value: float) -> str:
    """A level with one decimal, and no minus before 0."""
    return f"{round(value, 1) + 0.0:.1f} dB"


def at_most(length: float) -> str:
    """The modulus of a length, m, rounded up to millimetres."""
    return f"{max(np.ceil(1e3 * abs(length)), 1.0) / 1e3:.3f}"


def _apart(row: Mapping[str, Any]) -> str:
    least = row["told_apart"]
    if least is None:
        return "at no separation tried"
    largest = max(d["separation"] for d in row["dips"])
    if least == largest:
        return f"at {least:g} m, the largest separation tried"
    return f"at all separations tried from {least:g} m to {largest:g} m"


def spoiled(row: Mapping[str, Any], null: float) -> str:
    """Reasons why a dip of enough decibels does not resolve two points: all, of the first such dip; "" for none."""
    for dip in row["dips"]:
        counted = row["told_apart"] is not None and dip["separation"] >= row["told_apart"]
        if dip["dip_db"] < RESOLVED or counted:
            continue
        why = ["the points are not resolved at a larger separation"]
        if not is_resolved(dip, null):
            why = unresolved(dip, null)
        return f"At {dip['separation']:g} m there is a dip of {dip['dip_db']:.1f} dB, but {'; '.join(why)}."
    return ""
