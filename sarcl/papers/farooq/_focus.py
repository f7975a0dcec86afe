"""Farooq 2009, section 5.1: frequency-diverse echoes backprojected unmodified, and with delay and phase corrected."""

from __future__ import annotations

import numpy as np

from ...arrays import array_factor as closed
from ..paper import Section
from ._lab import Lab, system
from ._reference import DIAMOND, PRINTED

SYSTEMS = ((45, 20e6), (225, 4e6), (450, 2e6))


def section(lab: Lab) -> Section:
    """Table 5.1, figures 5.1 and 5.2."""
    out = Section.of("farooq", "correction")
    table, first = [], system(*SYSTEMS[0], mirrored=False)
    out.number("centre frequency, N 45, 20 MHz", first.middle / 1e9)
    curves = []
    for n, step in SYSTEMS:
        if not lab.small_enough(n):
            continue
        case = system(n, step, mirrored=False)
        name = f"N {n}, {step / 1e6:g} MHz"
        sources = ("figure 5.1", "figure 5.2") if n == 45 else ("section 5.1", "section 5.1")
        out.words = {"name": name}
        raw = lab.mapped(case, None)
        places, values = lab.cut(raw)
        lost = float(20 * np.log10(values.max()))
        where = float(places[values.argmax()])
        wide = lab.measure(raw)["irw"]
        linear, full = (lab.measure(lab.mapped(case, "corrected", quadratic=q)) for q in (False, True))
        range_null = lab.measure(lab.mapped(case, "corrected"), 0)["null"]
        out.states("unmodified, {name}", [lost, where, wide], lost < -3, source=sources[0], offset=abs(where))
        out.number("corrected, {name}: nulls in cross-range", full["null"], source=sources[1], expected=PRINTED)
        if n == 45:
            out.number("corrected, {name}: nulls in range", range_null, expected=PRINTED)
        off = abs(linear["null"] - PRINTED) > 0.002 or linear["level_db"] < -0.3
        cosines = np.sin(np.arctan(case.aperture / 2 / case.distance)), 0
        steps = {"spacing": (case.step, 0), "frequency_step": (step, 0)}
        phase = closed.quadratic_phase(shape=(n, 1), cosines=cosines, **steps)
        why = {} if off else {"why": ""}
        value = [linear["null"], linear["level_db"], linear["pslr_db"]]
        out.states("equations 5.4 and 5.5 alone, {name}", value, not off, phase=phase, **why)
        table.append([name, f"{lost:.1f}", f"{phase:.2f}", f"{linear['null']:.3f}", f"{linear['level_db']:.2f}",
                      f"{linear['pslr_db']:.1f}", f"{full['null']:.3f}", f"{full['pslr_db']:.1f}"])  # fmt: skip
        for quadratic, label in ((True, "corrected"), (False, "linear part")):
            places, values = lab.cut(lab.mapped(case, "corrected", quadratic=quadratic), half=0.8, n=321)
            curves.append((f"{name}, {label}", places, values))
    out.say()
    out.table("Unmodified, linear and all", table)
    out.draw(lab.picture(lab.mapped(first, None, DIAMOND), "Unmodified backprojection, N 45, 20 MHz (figure 5.1)."))
    out.draw(lab.picture(lab.mapped(first, "corrected", DIAMOND), "Delay and phase corrected (figure 5.2)."))
    out.plot("The centre point", curves)
    return out
