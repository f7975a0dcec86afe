"""Measurements as tables, for the terminal and, in Markdown, for the page. Every speed stands with its error."""

from __future__ import annotations

from typing import Any

from . import ratios
from ._cases import WORDS

Cells = list[list[str]]
HEAD = ", method, setting, error, of |I|, form s, median, call s, kernel s, process s, cpu s, Gbp/s".split(", ")
MATCH_HEAD = ["peer", "its error", "Gbp/s", "sarcl", "error", "Gbp/s", "form", "median form", "call", "process", "cpu"]
GROWTH_HEAD = ["", "method", "setting", "error at most", "n", "form s", "form", "cpu"]
VERB_HEAD = ["", "method", "n", "tolerance", "error", "predicted", "s", "median", "cpu s", "M/s"]
VERBS_EXPLAINED = (
    "error: relative to the exact result, as docs/theory/accuracy.md defines it, from a run that is not timed. s: the "
    "shortest of the whole calls, planning included, kernels built. cpu: CPU seconds of all processors, which other "
    "programs on the machine hardly affect. M/s: millions of contributions per second, as each task counts them."
)
EXPLAINED = (
    "error: relative L2 error against the exact sum, as defined in docs/theory/accuracy.md; of |I|: the same relative "
    "to the norm of the image alone. form: time from data in memory to the finished image, without the preparation "
    "that serves all images of a geometry (sarcl's plan, fastsar's former), of the shortest and the median run. call: "
    "time with that preparation. kernel: time in the device's kernels. process: time of a new process that reads the "
    "data and makes one image. cpu: CPU seconds of all processors together (of sarcl's call, of a peer's form), which "
    "other programs on the machine hardly affect. Gbp/s: 1e9 pairs of pulse and pixel per second, from the shortest "
    "form. A peer is another program."
)


def title(result: ratios.Result) -> str:
    """Description of a case, one line."""
    if "words" in result:
        return f"{result['scene']}, n = {result['n']}: {result['words']}"
    return (
        f"{result['scene']}, {result['data']}, n = {result['n']}: {WORDS[result['scene']]} of n samples on n x n pixels"
    )


def name(row: ratios.Row) -> str:
    """Program and device of a row."""
    return f"{row['who']}, {row['device']}"


def body(result: ratios.Result) -> Cells:
    """A line for every row that ran, under HEAD."""
    return [
        [
            name(row),
            row["method"],
            row["setting"],
            f"{row['error']:.1e}",
            f"{ratios.decibels(row):.1f} dB",
            _seconds(ratios.best(row)),
            _seconds(ratios.middle(row)),
            *(_seconds(ratios.best(row, key)) for key in ("call", "kernel", "process", "cpu")),
            f"{ratios.rate(result, row):.3g}",
        ]
        for row in ratios.ran(result)
    ]


def verb_body(result: ratios.Result) -> Cells:
    """A line for every row of a verb that ran, under VERB_HEAD."""
    return [
        [
            name(row),
            row["method"],
            str(result["n"]),
            row["setting"],
            f"{row['error']:.1e}",
            f"{row['predicted']:.1e}" if "predicted" in row else "",
            *(_seconds(s) for s in (ratios.best(row), ratios.middle(row), ratios.best(row, "cpu"))),
            f"{1e3 * ratios.rate(result, row):.3g}",
        ]
        for row in ratios.ran(result)
    ]


def match_body(result: ratios.Result) -> Cells:
    """A line for every peer's row and device of sarcl's, under MATCH_HEAD."""
    lines = []
    for entry in ratios.matches(result):
        peer, own = entry["peer"], entry["sarcl"]
        line = [
            f"{peer['who']} {peer['method']}, {peer['setting'].split(';')[0]}",
            f"{peer['error']:.1e}, {ratios.decibels(peer):.1f} dB",
            f"{ratios.rate(result, peer):.3g}",
        ]
        if own is None:
            lines.append([*line, f"{entry['method']}: no row with an error as small", *[""] * 7])
            continue
        times = [entry[key] for key in ("form", "median form", "call", "process", "cpu")]
        lines.append(
            [
                *line,
                f"{own['method']}, {own['setting']}, {own['device']}",
                f"{own['error']:.1e}, {ratios.decibels(own):.1f} dB",
                f"{ratios.rate(result, own):.3g}",
                *("" if r is None else f"{r:.2f} x" for r in times),
            ]
        )
    return lines


def growth_body(results: list[ratios.Result]) -> Cells:
    """A line for everything measured at two sizes or more, under GROWTH_HEAD."""
    return [
        [
            name(entry),
            ", ".join(filter(None, (entry["method"], f"{entry['scene']} {entry['data']}".strip()))),
            entry["setting"],
            f"{entry['error']:.1e}",
            ", ".join(str(n) for n in entry["sizes"]),
            ", ".join(_seconds(s) for s in entry["seconds"]),
            f"n^{entry['exponent']:.2f}",
            "" if entry["cpu_exponent"] is None else f"n^{entry['cpu_exponent']:.2f}",
        ]
        for entry in ratios.growth(results)
    ]


def missing(result: ratios.Result) -> list[str]:
    """A line for every row that did not run, with the reason, equal reasons together; a line for disturbed runs."""
    reasons: dict[tuple[str, str], list[str]] = {}
    for row in result["rows"]:
        if "absent" in row:
            reasons.setdefault((f"{name(row)}, {row['method']}", row["absent"]), []).append(row["setting"])
    lines = [f"{who} at {'; '.join(cells)}: absent: {why}" for (who, why), cells in reasons.items()]
    disturbed = sum(row.get("disturbed", 0) for row in result["rows"])
    return lines + ([f"{disturbed} runs began while other programs ran"] if disturbed else [])


def text(result: ratios.Result) -> str:
    """The tables of a case for the terminal."""
    table = _aligned(VERB_HEAD, verb_body(result)) if "words" in result else _aligned(HEAD, body(result))
    parts = [title(result), table, *missing(result)]
    lines = match_body(result)
    if lines:
        parts += ["", "ratios, peer's seconds over sarcl's, at equal or smaller error:", _aligned(MATCH_HEAD, lines)]
    return "\n".join(parts)


def growth_text(results: list[ratios.Result]) -> str:
    """Cost against size for the terminal; empty where nothing was measured at two sizes."""
    lines = growth_body(results)
    return "cost against size:\n" + _aligned(GROWTH_HEAD, lines) if lines else ""


def markdown(head: list[str], lines: Cells) -> str:
    """A table in Markdown."""

    def line(cells: list[str]) -> str:
        return "| " + " | ".join(c.replace("|", "\\|") for c in cells) + " |\n"

    return line(head) + "|" + "---|" * len(head) + "\n" + "".join(map(line, lines))


def machine_text(document: dict[str, Any]) -> list[str]:
    """The machine, the devices and the peers, a line each."""
    m = document["machine"]
    load = ", ".join(f"{v:.1f}" for v in m["load"]) or "unknown"
    lines = [
        f"{m['processor']}, {m['processors']} processors, {m['threads']} threads for all; sarcl {m['sarcl']}, "
        f"Python {m['python']}, NumPy {m['numpy']}; load before and after: {load}"
    ]
    for d in document["devices"]:
        fp64 = "float64" if d["fp64"] else "no float64"
        lines.append(f"device {d['index']}: {d['name']} ({d['platform']}, driver {d['driver']}, {d['kind']}, {fp64})")
    for p in document["peers"]:
        if "absent" in p:
            lines.append(f"peer {p['name']}: absent: {p['absent']}")
        else:
            lines.append(f"peer {p['name']} {p['version']} (Python {p['python']}, backend {p['backend']})")
    return lines


def _seconds(value: float | None) -> str:
    return "" if value is None else f"{value:.3g}" if value < 100 else f"{value:.0f}"


def _aligned(head: list[str], lines: Cells) -> str:
    rows = [head, *lines]
    widths = [max(len(row[i]) for row in rows) for i in range(len(head))]
    left = [all(not row[i][:1].isdigit() for row in lines) for i in range(len(head))]
    return "\n".join(
        "  ".join(c.ljust(w) if flush else c.rjust(w) for c, w, flush in zip(row, widths, left, strict=True)).rstrip()
        for row in rows
    )
