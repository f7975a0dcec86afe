"""The mapped aperture off the centre, with two points, and in spatial frequencies: sarcl's own check."""

from __future__ import annotations

from dataclasses import replace

from ...experiments.fda import experiment, page
from ...experiments.fda.text import rule, unresolved
from ..paper import Section
from ._lab import Lab, system

PLACES = (0.0, 2.0, 2.25)  # m across
SEPARATIONS = (0.125, 0.2, 0.25, 0.3)  # m
MAPPINGS = ("corrected", "apparent", "channels")


def section(lab: Lab) -> Section:
    """The experiment of `sarcl fda` on the paper's smallest and largest array."""
    out = Section.of("farooq", "honest")
    cases = [
        replace(system(n, step), points=PLACES, separations=SEPARATIONS, mappings=MAPPINGS)
        for n, step in ((45, 20e6), (450, 2e6))
        if lab.small_enough(n)
    ]
    out.say()
    for result in experiment.run(cases, device=lab.device):
        rows, name = result["mapped"], result["name"]
        plain, apparent, own = (rows[k] for k in (experiment.CONVENTIONAL, "apparent", "channels"))
        shifts = [p["error"] for p in apparent["points"]]
        off = max(shifts, key=abs)
        out.words = {"name": name, "separation": SEPARATIONS[0], "rule": rule(result["null"])}
        lobes, limit = [p["pslr_db"] for p in apparent["points"]], 0.1 * plain["points"][0]["null"]
        out.states("{name}: places of points 2 and 2.25 m off", shifts, abs(off) < limit, pslr=lobes)
        least = [row["told_apart"] for row in (apparent, plain)]
        largest = _reason(apparent["dips"][-1], result["null"])
        dips = [
            next(d["dip_db"] for d in row["dips"] if d["separation"] == SEPARATIONS[0]) for row in (apparent, plain)
        ]
        pairs = {"own": _from(least[0]), "conventional": _from(least[1]), "largest": largest, "dips": dips}
        holds = experiment.nearer(apparent, plain, result["null"]) == 1
        out.states("{name}: two points resolved", least, holds, **pairs)
        spans = [row["claimed"] for row in (own, apparent, plain)]
        out.states("{name}: spatial frequencies across", spans, spans[0] > 1.02 * spans[2])
        out.parts += page.section(result, level=3)
        out.keep(**{name: {k: v for k, v in result.items() if k != "mapped"}})
        for kind, row in rows.items():
            out.keep(**{f"{name}, {kind}": {k: v for k, v in row.items() if k != "support"}})
    return out


def _reason(pair: experiment.PairApart, null: float) -> str:
    """Whether a pair of points is resolved, and why not, in words."""
    why = unresolved(pair, null)
    text = f"at {pair['separation']:g} m the dip is {pair['dip_db']:.1f} dB"
    return f"{text} and the points are {'not resolved: ' + '; '.join(why) if why else 'resolved'}"


def _from(separation: float | None) -> str:
    """A separation from which on points are resolved, in words."""
    if separation is None:
        return "at no separation tried"
    return f"at {separation:g} m" + (", the largest tried" if separation == max(SEPARATIONS) else " and more")
