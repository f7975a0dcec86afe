"""Rates, ratios at equal or smaller error, and cost against size, from the rows of a benchmark."""

from __future__ import annotations

from typing import Any

import numpy as np

Row = dict[str, Any]
Result = dict[str, Any]  # a case: scene, data, n, pairs, pixels, rows


def best(row: Row, name: str = "form") -> float | None:
    """The shortest of a row's seconds, or None."""
    runs = row["seconds"].get(name)
    return min(runs) if runs else None


def middle(row: Row) -> float | None:
    """The median of a row's seconds, or None."""
    runs = row["seconds"].get("form")
    return float(np.median(runs)) if runs else None


def ran(result: Result) -> list[Row]:
    """The rows that ran: by method, sarcl's before its peers'."""
    rows = [row for row in result["rows"] if "absent" not in row and best(row)]
    return sorted(rows, key=lambda row: (row["method"], not is_sarcl(row), row["who"], row["device"]))


def is_sarcl(row: Row) -> bool:
    """Whether a row is one of sarcl."""
    return bool(row["who"] == "sarcl")


def rate(result: Result, row: Row, name: str = "form") -> float:
    """1e9 pulses x pixels a second, from the shortest run."""
    return float(result["pairs"] / (best(row, name) or np.nan) / 1e9)


def decibels(row: Row) -> float:
    """Error relative to |I|, dB."""
    return float(20 * np.log10(max(row["error_of_image"], 1e-30)))


def matches(result: Result) -> list[dict[str, Any]]:
    """Every peer's row with the fastest row of sarcl whose error is no larger, on each device: by the same method, and
    by sub-apertures too where the peer computes all pairs.

    Entries: peer, sarcl (rows; None where no row of sarcl has as small an error), device and method of sarcl's row,
    ratios peer/sarcl of the shortest form, call, process and cpu and of the median form.
    """
    pairs = []
    rows = ran(result)
    for peer in (row for row in rows if not is_sarcl(row)):
        rivals = [
            row for row in rows if is_sarcl(row) and (row["method"] == peer["method"] or peer["method"] == "direct")
        ]
        for device, method in dict.fromkeys((row["device"], row["method"]) for row in rivals):
            same = [row for row in rivals if (row["device"], row["method"]) == (device, method)]
            pairs.append(_match(peer, same, device, method))
    return pairs


def _match(peer: Row, rivals: list[Row], device: str, method: str) -> dict[str, Any]:
    entry: dict[str, Any] = {"peer": peer, "device": device, "method": method, "sarcl": None}
    able = [row for row in rivals if row["error"] <= peer["error"]]
    if able:
        own_row = min(able, key=lambda row: best(row) or np.inf)
        entry["sarcl"] = own_row
        for name in ("form", "call", "process", "cpu"):
            theirs, own = best(peer, name), best(own_row, name)
            entry[name] = theirs / own if theirs and own else None
        theirs, own = middle(peer), middle(own_row)
        entry["median form"] = theirs / own if theirs and own else None
    return entry


def growth(results: list[Result]) -> list[dict[str, Any]]:
    """Cost against size: for everything measured at two sizes or more, the exponent k of seconds ~ n^k.

    Entries: scene, data, who, device, method, setting, sizes, seconds (shortest form), error (largest); exponent,
    the slope of a least-squares line through the logarithms, and cpu_exponent, that of the processors' seconds (None
    where they are not known).
    """
    lines: dict[tuple[str, ...], list[tuple[int, float, float, float]]] = {}
    for result in results:
        for row in ran(result):
            key = (result["scene"], result["data"], row["who"], row["device"], row["method"], row["setting"])
            lines.setdefault(key, []).append(
                (result["n"], best(row) or np.nan, row["error"], best(row, "cpu") or np.nan)
            )
    exponents = []
    names = ("scene", "data", "who", "device", "method", "setting")
    for line, points in lines.items():
        points.sort()
        sizes, seconds, errors, busy = (list(column) for column in zip(*points, strict=True))
        if len(set(sizes)) < 2:
            continue
        exponents.append(
            {
                **dict(zip(names, line, strict=True)),
                "sizes": sizes,
                "seconds": seconds,
                "error": max(errors),
                "exponent": _slope(sizes, seconds),
                "cpu_exponent": _slope(sizes, busy) if np.isfinite(busy).all() else None,
            }
        )
    return exponents


def _slope(sizes: list[float], seconds: list[float]) -> float:
    return float(np.polyfit(np.log(sizes), np.log(seconds), 1)[0])
