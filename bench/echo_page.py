"""Tables of bench/echo.py's documents, for a terminal and for docs/guide/results_echoes.md."""

from __future__ import annotations

from typing import Any

from sarcl.bench import tables

Row = dict[str, Any]
EXPLAINED = """Mpts/s: millions of pairs of scatterer and pulse per second, shortest run. sarcl computes delays and
carrier from antennas and positions; it sorts the points once per call, which only "whole call" includes. finufft is
given the delays, and sorts for every pulse, because its points move.
"""


def section(name: str, document: Row) -> str:
    """One document: machine, tables."""
    text = f"## {name}\n\n" + "".join(f"- {line}\n" for line in tables.machine_text(document)) + "\n"
    if document["spread"]:
        pairs = document["points"] * document["pulses"]
        text += f"### Spreading {document['points']:,} points x {document['pulses']} pulses x "
        text += f"{document['samples']} samples\n\n"
        head = ["", "setting", "error achieved", "s", "Mpts/s", "median", "whole call", "its CPU s"]
        text += tables.markdown(head, [_spread(row, pairs) for row in document["spread"]]) + f"\n{EXPLAINED}\n"
        text += _matches(document["spread"])
    if document["whole"]:
        fastest = [r for r in document["spread"] if r["name"].startswith("finufft")]
        text += f"### Whole echoes of facets with their physics x {document['pulses']} pulses\n\n"
        head = [
            "",
            "tolerance",
            "error achieved",
            "predicted",
            "s",
            "CPU s",
            "Mpairs/s",
            "finufft's spreading alone, at no larger error",
        ]
        pairs = document["points"] * document["pulses"]
        text += tables.markdown(head, [_whole(row, fastest, pairs) for row in document["whole"]]) + "\n"
    if document["scenes"]:
        text += "### Whole scenes, one run each, compiling included\n\n"
        head = ["", "tolerance", "error achieved", "pulses x facets", "samples", "s", "a VAX 3100/30 in 1992, s"]
        text += tables.markdown(head, [_scene(row) for row in document["scenes"]]) + "\n"
    return text


def _spread(row: Row, pairs: int) -> list[str]:
    call = f"{pairs / 1e6 / min(row['call']):.0f}" if "call" in row else ""
    rates = [f"{pairs / 1e6 / s:.0f}" for s in (min(row["seconds"]), _median(row["seconds"]))]
    return [row["name"], row["setting"], f"{row['error']:.1e}", f"{min(row['seconds']):.3g}", *rates, call, _cpu(row)]


def _matches(rows: list[Row]) -> str:
    """finufft's seconds over sarcl's at an error no larger."""
    ours = [r for r in rows if r["name"].startswith("sarcl")]
    lines = []
    for peer in (r for r in rows if not r["name"].startswith("sarcl")):
        able = [r for r in ours if r["error"] <= peer["error"]]
        if able:
            best = min(able, key=lambda r: min(r["seconds"]))
            ratios = [min(peer["seconds"]) / min(best["seconds"]), _median(peer["seconds"]) / _median(best["seconds"])]
            cells = [peer["setting"], f"{peer['error']:.1e}", best["setting"], f"{best['error']:.1e}"]
            lines.append([*cells, *(f"{r:.2f} x" for r in ratios)])
    if not lines:
        return ""
    head = ["finufft", "its error", "sarcl", "its error", "finufft's seconds over sarcl's", "medians"]
    return tables.markdown(head, lines) + "\n"


def _whole(row: Row, peers: list[Row], pairs: int) -> list[str]:
    able = [min(p["seconds"]) for p in peers if p["error"] <= row["error"]]
    rate = row["pairs"] / min(row["seconds"])
    ratio = f"{rate / (pairs / min(able)):.2f} x its rate" if able else ""
    cells = [f"{row['error']:.1e}", f"{row['predicted']:.1e}", f"{min(row['seconds']):.3g}"]
    cells += [_cpu(row), f"{rate / 1e6:.1f}"]
    return [row["name"], row["setting"], *cells, ratio]


def _scene(row: Row) -> list[str]:
    vax = f"{row['vax']}" if "vax" in row else ""
    cells = [f"{row['error']:.1e}", f"{row['pairs']:.3g}", str(row["samples"]), f"{min(row['seconds']):.3g}", vax]
    return [row["name"], row["setting"], *cells]


def _cpu(row: Row) -> str:
    """CPU seconds of the call that took least, with its check where it has one; "" in older documents."""
    return f"{min(row['cpu']):.3g}" if "cpu" in row else ""


def _median(values: list[float]) -> float:
    return sorted(values)[len(values) // 2]
