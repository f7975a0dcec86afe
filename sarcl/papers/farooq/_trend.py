"""Farooq 2009, section 5.3.2 and the abstract: nulls and side lobes against the frequency step at one bandwidth."""

from __future__ import annotations

import numpy as np

from ...figures import html
from ..paper import Section
from ._lab import Lab, decibels, system
from ._reference import PRINTED

BAND = 900e6  # Hz
STEPS = (100e6, 50e6, 20e6, 10e6, 5e6, 2e6, 1e6)
DRAWN = (100e6, 20e6, 2e6, 1e6)


def trends(lab: Lab) -> Section:
    """Figures 5.9 to 5.11."""
    out = Section.of("farooq", "trends")
    results: dict[float, tuple[float, float]] = {}
    curves = []
    for step in STEPS:
        n = round(BAND / step)
        if not lab.small_enough(n):
            continue
        mapped = lab.mapped(system(n, step), "apparent")
        point = lab.measure(mapped)
        results[step] = point["null"], point["pslr_db"]
        if step in DRAWN:
            places, values = lab.cut(mapped, half=1.0, n=401)
            curves.append((f"N {n}, {step / 1e6:g} MHz", places, decibels(values)))
    out.number("PSLR at 100 MHz", results[100e6][1])
    if 1e6 in results:
        ratio = {step: null / PRINTED for step, (null, _) in results.items()}
        little, much = 100 * (ratio[100e6] - ratio[10e6]), 100 * (ratio[10e6] - ratio[1e6])
        out.states("nulls from 100 to 10 MHz", little, little < 15)
        out.states("nulls from 10 to 1 MHz", much, much > 3 * little)
        rise = [results[a][1] - results[b][1] for a, b in ((10e6, 100e6), (1e6, 10e6))]
        out.states("PSLR from 10 to 1 MHz", rise, rise[1] > 2 * rise[0])
    out.say()
    steps = [s / 1e6 for s in results]
    nulls, lobes = zip(*results.values(), strict=True)
    rows = [["nulls, m", *(f"{null:.3f}" for null in nulls)], ["PSLR, dB", *(f"{pslr:.1f}" for pslr in lobes)]]
    out.draw(html.table(["df, MHz", *(f"{s:g}" for s in steps)], rows))
    out.plot("The centre point", curves)
    out.plot("First null", [("null", steps, [null / PRINTED for null, _ in results.values()])], log_x=True)
    out.plot("Highest side lobe", [("PSLR", steps, [pslr for _, pslr in results.values()])], log_x=True)
    out.keep(df_mhz=steps, null=[f[0] for f in results.values()], pslr_db=[f[1] for f in results.values()])
    return out


def abstract(lab: Lab) -> Section:
    """The abstract's claims of time and resolution."""
    out = Section.of("farooq", "abstract")
    table, lengths, gains = [], [], []
    steps = [s for s in STEPS if lab.small_enough(round(BAND / s))]
    for step in steps:
        case = system(round(BAND / step), step)
        mapped = lab.mapped(case, "apparent")
        length = float(np.ptp(mapped.tx[:, 1]))
        null = lab.measure(mapped)["null"]
        lengths.append(20 * np.log10(length / case.aperture))
        gains.append(20 * np.log10(PRINTED / null))
        table.append([f"{step / 1e6:g} MHz", f"{length:.0f}", f"{100 * (length / case.aperture - 1):.0f}",
                      f"{100 * (1 - case.aperture / length):.0f}", f"{lengths[-1]:.2f}", f"{null:.3f}",
                      f"{gains[-1]:.2f}"])  # fmt: skip
    if 2e6 in steps and 1e6 in steps:
        two, one = steps.index(2e6), steps.index(1e6)
        growth = 10 ** (lengths[two] / 20) - 1
        saved = 100 * (1 - 1 / (1 + growth))
        out.states("collection time reduced", saved, abs(saved - 33) < 1, longer=100 * growth, ratio=1 + growth)
        longer = 100 * (10 ** (lengths[one] / 20) - 1)
        item, value = "cross-range resolution, by the same system's aperture", [lengths[two], lengths[one]]
        out.states(item, value, abs(lengths[two] - 4.5) < 0.1, growth=longer)
        out.states("cross-range resolution, by the same system's nulls", gains[two], abs(gains[two] - 4.5) < 0.1)
    out.say()
    out.table("Gains by frequency step", table)
    x = [s / 1e6 for s in steps]
    out.plot("Gains", [("by length", x, lengths), ("by nulls", x, gains)], log_x=True)
    out.keep(df_mhz=x, length_db=lengths, nulls_db=gains)
    return out
