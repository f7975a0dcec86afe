"""Experiments on frequency-diverse apertures in words: what was flown, what was gained, and what was not."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from .experiment import CONVENTIONAL, NEAR, RESOLVED, nearer

SAME = 0.02  # relative: widths that differ by less are one
WEAK = -6.0  # dB of a unit point: less than this is no main lobe on its place
RECEIVERS = {
    "reference": "One receiver, at the reference element.",
    "own": "Every element receives its own channel.",
    "all": "Every element receives all channels, told apart.",
}


def setting(result: Mapping[str, Any]) -> str:
    """What was flown, and what stands beside it."""
    return f"{_array(result)} {_path(result)} {RECEIVERS[result['receive']]} {_beside(result)}"


def _array(result: Mapping[str, Any]) -> str:
    kind, n = result["progression"], result["n"]
    steps = " and ".join(f"{f / 1e6:g}" for f in np.atleast_1d(result["frequency_step"]))
    where = {"vertical": "along z", "planar": "along the track and along z"}.get(kind, "along the track")
    order = {
        "costas": " in a Costas order",
        "subarrays": f" an element, in {result['groups']} groups that each send the carrier of their first",
    }.get(kind, "")
    switch = ", in reverse over the elements from mid-aperture on with the centre frequency kept"
    apart = f"{result['spacing']:.4g} m" if result["spacing"] >= 1 else f"{1e3 * result['spacing']:.4g} mm"
    text = (
        f"{' x '.join(str(i) for i in np.atleast_1d(n))} elements {apart} apart {where}, from "
        f"{result['center'] / 1e9:g} GHz in steps of {steps} MHz{order}{switch if result['mirrored'] else ''}: "
        f"{result['bandwidth'] / 1e6:g} MHz about {result['middle'] / 1e9:.4g} GHz."
    )
    if kind == "subarrays":
        off = (
            f"{np.rad2deg(result['steer']):.4g} deg off the scene's centre" if result["steer"] else "the scene's centre"
        )
        text += f" The groups are steered at {off} as seen from mid-aperture."
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
    lean = f", which lies {abs(squint):.3g} deg {'ahead of' if squint > 0 else 'behind'} abeam" if squint else ""
    return f"A straight track of {length}, {pulses} the scene{high}{lean}."


def _beside(result: Mapping[str, Any]) -> str:
    if not result["is_wide"]:
        return "Beside it: a conventional antenna at the mean phase centre, with a chirp of the same band."
    heard = {"reference": "heard at the reference element", "own": "each heard by itself", "all": "heard by all"}
    return (
        "Beside it: a conventional array with the same phase centres, whose elements all send a chirp of the same "
        f"band, told apart, {heard[result['receive']]}."
    )


def verdicts(result: Mapping[str, Any]) -> list[str]:
    """What each mapping gained over the conventional antenna, and what it did not; why others do not apply."""
    rows, null = result["mapped"], result["null"]
    out = [f"{name}: {_verdict(row, rows[CONVENTIONAL], null)}" for name, row in rows.items() if name != CONVENTIONAL]
    return out + [f"{name}: not applicable. {reason}." for name, reason in result["not_applicable"].items()]


def _verdict(row: Mapping[str, Any], plain: Mapping[str, Any], null: float) -> str:
    first, usual = row["points"][0], plain["points"][0]
    place = f"the point at {first['place']:g} m"
    if not first["inside"]:
        return f"{place} has no peak on the cut through it, only {decibels(first['level_db'])} at an end of that."
    narrower = 1 - first["null"] / usual["null"]
    change = "as far out as" if abs(narrower) < SAME else (
        f"{100 * abs(narrower):.0f} % {'nearer than' if narrower > 0 else 'farther than'}"
    )  # fmt: skip
    text = (
        f"the first nulls of {place} lie {change} the conventional antenna's ({first['null']:.3f} and "
        f"{usual['null']:.3f} m), its half-power width is {first['irw']:.3f} m (conventional {usual['irw']:.3f}), its "
        f"peak is at {decibels(first['level_db'])}, its highest side lobe at {first['pslr_db']:.1f} dB (conventional "
        f"{usual['pslr_db']:.1f})"
    )
    if first["level_db"] < WEAK:
        text += "; so weak a peak is smeared, or its main lobe stands off this cut"
    worst = max(row["points"], key=lambda p: abs(p["error"]))
    if abs(worst["error"]) > 0.1 * usual["null"]:
        text += f"; the point at {worst['place']:g} m comes out {worst['error']:+.3f} m off"
    else:
        text += f"; on its cut no point comes out more than {at_most(worst['error'])} m off"
    alike = nearer(row, plain, null) == 0 and row["told_apart"] != plain["told_apart"]
    same = ", with dips that differ by less than 0.2 dB" if alike else ""
    return (
        f"{text}. Two points are told apart {_apart(row)} (conventional: {_apart(plain)}{same}).{_spoiled(row, null)}"
    )


def decibels(value: float) -> str:
    """With one decimal, and no minus before 0."""
    return f"{round(value, 1) + 0.0:.1f} dB"


def at_most(length: float) -> str:
    """Its modulus, m, rounded up to millimetres."""
    return f"{max(np.ceil(1e3 * abs(length)), 1.0) / 1e3:.3f}"


def _apart(row: Mapping[str, Any]) -> str:
    told = row["told_apart"]
    if told is None:
        return "at no separation tried"
    last = told == max(d["separation"] for d in row["dips"])
    return f"at {told:g} m, the farthest tried" if last else f"from {told:g} m on"


def _spoiled(row: Mapping[str, Any], null: float) -> str:
    """Why a dip does not tell two points apart."""
    dips: Sequence[Mapping[str, float]] = row["dips"]
    for found in dips:
        told = row["told_apart"] is not None and found["separation"] >= row["told_apart"]
        if found["dip_db"] < RESOLVED or told:
            continue
        start = f" {found['separation']:g} m apart there is a dip of {found['dip_db']:.1f} dB, but "
        if found["false_db"] > -RESOLVED:
            return f"{start}another peak comes to {decibels(found['false_db'])} of the lower of the two."
        if found["shift"] > null * NEAR:
            return f"{start}a peak stands {found['shift']:.3f} m from its point."
        return f"{start}farther apart they are not told apart again."
    return ""
