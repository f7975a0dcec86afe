"""Table of bench/spaceborne.py's documents, for a terminal and for docs/guide/results_echoes.md."""

from __future__ import annotations

from typing import Any

from sarcl.bench import tables

Row = dict[str, Any]
HEAD = ["", "theory", "range-Doppler", "backprojection"]
EXPLAINED = """Theory follows from orbit, antenna, elevation model, solids and material, without the echoes. The other
columns are measured in the images, or by range_doppler. Places are ground ranges from the middle of the scene.
"""


def section(name: str, document: Row) -> str:
    """One document: machine, sizes, cost, table."""
    text = f"## {name}\n\n" + "".join(f"- {line}\n" for line in tables.machine_text(document)) + "\n"
    width, length = (side / 1e3 for side in document["swath"])
    fast, slow = (f"{n} x {m}" for n, m in document["pixels"].values())
    text += (
        f"A pass at C band, {width:g} x {length:g} km of ground in {document['facets']:,} facets, "
        f"{document['slant_km']:g} km away, incidence {document['incidence_deg']:.1f} deg, {document['pulses']} pulses "
        f"of {document['samples']} samples, {fast} pixels by range-Doppler and {slow} on the terrain by "
        "backprojection.\n\n"
    )
    head = ["", "CPU seconds", "relative error, measured"]
    errors = document["errors"]
    text += tables.markdown(
        head,
        [
            [stage, f"{seconds:.1f}", f"{errors[stage]:.1e}" if errors.get(stage) is not None else ""]
            for stage, seconds in document["cpu"].items()
        ],
    )
    return text + "\n" + tables.markdown(HEAD, [_line(row) for row in document["rows"]]) + f"\n{EXPLAINED}\n"


def _line(row: Row) -> list[str]:
    unit = f", {row['unit']}" if row["unit"] else ""
    numbers = ("" if row[key] is None else f"{row[key]:{row['digits']}}" for key in ("theory", "fast", "slow"))
    return [row["item"] + unit, *numbers]
