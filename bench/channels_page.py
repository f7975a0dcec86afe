"""Tables of bench/channels.py's documents, for a terminal and for docs/guide/results_echoes.md."""

from __future__ import annotations

from typing import Any

from sarcl.bench import tables

Row = dict[str, Any]
HEAD = [
    "",
    "channels",
    "way",
    "error achieved",
    "predicted",
    "s",
    "median",
    "G contributions/s",
    "seconds / seconds of one call",
]
EXPLAINED = """A contribution is one scatterer in one pulse from one transmitter to one receiver. Few contributions are
computed where channels are interpolated between positions of the array (docs/theory/fda.md). The last column
compares shortest runs. With "one call per channel" the error is the largest of nine channels.
"""


def section(name: str, document: Row) -> str:
    """One document: machine, tables."""
    text = f"## {name}\n\n" + "".join(f"- {line}\n" for line in tables.machine_text(document)) + "\n"
    for part, title in (
        ("growth", f"Carriers of 900 MHz in all x {document['pulses']} pulses"),
        ("one", f"One carrier x {document['pulses']} pulses"),
        ("many", f"450 senders x 450 receivers x {document['pulses']} pulses, into a file within 100 MB"),
    ):
        if document[part]:
            text += (
                f"### {title}\n\n" + tables.markdown(HEAD, [_line(r, document[part]) for r in document[part]]) + "\n"
            )
    return text + EXPLAINED + "\n"


def _line(row: Row, rows: list[Row]) -> list[str]:
    first = next(r for r in rows if (r["scene"], r["n"]) == (row["scene"], row["n"]))
    seconds = sorted(row["seconds"])
    positions = f", {row['positions']} positions" if row["positions"] else ""
    error = "" if row["error"] is None else f"{row['error']:.1e}"
    return [
        row["scene"], str(row["n"]), row["way"] + positions, error, f"{row['predicted']:.1e}", f"{seconds[0]:.3g}",
        f"{seconds[len(seconds) // 2]:.3g}", f"{row['contributions'] / seconds[0] / 1e9:.3g}",
        f"{seconds[0] / min(first['seconds']):.2f}",
    ]  # fmt: skip
