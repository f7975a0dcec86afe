"""Table of bench/full_wave_peers.py's documents, for a terminal and for docs/guide/results_echoes.md."""

from __future__ import annotations

from typing import Any

from sarcl.bench import tables

HEAD = ["solver", "Mcells/s", "Mcells per two CPU s", "sarcl is faster by, clock", "by CPU seconds"]
EXPLAINED = """The time steps of a whole run alone: cells updated per second of the clock, and per two CPU seconds, the
best of all rounds. sarcl: a plane wave, cut cells of a conducting sphere, absorbing layers, currents and an echo at all
frequencies; "all cells": cells at rest are updated too. gprMax: a dipole, a sphere of whole cells, layers; "far field":
also a surface that records the same frequencies. The error of sarcl's spheres at 10 cells per wavelength is 0.05 dB rms
against Mie's series (docs/theory/full_wave.md); that of gprMax was not measured.
"""


def section(name: str, document: dict[str, Any]) -> str:
    """One document: machine, task, table."""
    text = f"## {name}\n\n" + "".join(f"- {line}\n" for line in tables.machine_text(document)) + "\n"
    text += (
        f"A full-wave run (FDTD) of a conducting sphere in {' x '.join(map(str, document['cells']))} cells, "
        f"{document['frequencies']} frequencies; {document['resting']:.0%} of the cells are at rest inside it. "
        f"Rounds: {document['rounds']}.\n\n"
    )
    rates = document["rates"]
    ours = rates["sarcl"]
    body = [
        [
            solver,
            *(f"{rate:.3g}" for rate in found.values()),
            *(f"{ours[key] / rate:.1f}" for key, rate in found.items()),
        ]
        for solver, found in rates.items()
    ]
    return text + tables.markdown(HEAD, body) + f"\n{EXPLAINED}\n"
