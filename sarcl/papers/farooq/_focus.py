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
    out = Section("correction", "Unmodified and corrected backprojection (table 5.1, figures 5.1 and 5.2)")
    table, first = [], system(*SYSTEMS[0], mirrored=False)
    out.number("centre frequency, N 45, 20 MHz", "table 5.1", 10.44, first.middle / 1e9, 0.005, "GHz", ".2f")
    curves = []
    for n, step in SYSTEMS:
        if not lab.small_enough(n):
            continue
        case = system(n, step, mirrored=False)
        name = f"N {n}, {step / 1e6:g} MHz"
        raw = lab.mapped(case, None)
        places, values = lab.cut(raw)
        lost = float(20 * np.log10(values.max()))
        where = float(places[values.argmax()])
        wide = lab.measure(raw)["irw"]
        linear, full = (lab.measure(lab.mapped(case, "corrected", quadratic=q)) for q in (False, True))
        range_null = lab.measure(lab.mapped(case, "corrected"), 0)["null"]
        out.states(
            f"unmodified, {name}", "figure 5.1" if n == 45 else "section 5.1", "defocused",
            f"peak {lost:.1f} dB, {abs(where):.2f} m off, {wide:.2f} m wide", lost < -3,
            value=[lost, where, wide],
            rule="peak below -3 dB",
        )  # fmt: skip
        item = f"corrected, {name}: nulls in cross-range"
        out.number(item, "figure 5.2" if n == 45 else "section 5.1", PRINTED, full["null"], 0.002, "m")
        if n == 45:
            out.number(f"corrected, {name}: nulls in range", "figure 5.2", PRINTED, range_null, 0.002, "m")
        off = abs(linear["null"] - PRINTED) > 0.002 or linear["level_db"] < -0.3
        phase = closed.quadratic_phase(
            shape=(n, 1),
            spacing=(case.step, 0),
            frequency_step=(step, 0),
            cosines=(np.sin(np.arctan(case.aperture / 2 / case.distance)), 0),
        )
        out.states(
            f"equations 5.4 and 5.5 alone, {name}", "section 5.1", "focused",
            f"null {linear['null']:.3f} m, peak {linear['level_db']:.2f} dB, PSLR {linear['pslr_db']:.1f} dB", not off,
            "" if not off else f"they leave the quadratic phase of the elements, {phase:.1f} rad at the aperture's "
            "end; it must be taken out frequency by frequency", [linear["null"], linear["level_db"], linear["pslr_db"]],
            rule="null within 2 mm of 0.167 m, peak above -0.3 dB", cause="interpretation",
        )  # fmt: skip
        table.append([name, f"{lost:.1f}", f"{phase:.2f}", f"{linear['null']:.3f}", f"{linear['level_db']:.2f}",
                      f"{linear['pslr_db']:.1f}", f"{full['null']:.3f}", f"{full['pslr_db']:.1f}"])  # fmt: skip
        for quadratic, label in ((True, "corrected"), (False, "linear part")):
            places, values = lab.cut(lab.mapped(case, "corrected", quadratic=quadratic), half=0.8, n=321)
            curves.append((f"{name}, {label}", places, values))
    out.say(
        "By equation 4.27 the peak of every pulse is at a wrong range of its own, which smears the image of figure "
        "5.1. Taking out delay and phase focuses it. The paper takes out the part that is linear in the element's "
        "number; for 225 and 450 elements the quadratic rest is no longer small."
    )
    out.table(
        ["", "unmodified peak, dB", "quadratic phase, rad", "linear: null, m", "peak, dB", "PSLR, dB", "all: null, m",
         "PSLR, dB"], table,
    )  # fmt: skip
    out.draw(lab.picture(lab.mapped(first, None, DIAMOND), "Unmodified backprojection, N 45, 20 MHz (figure 5.1)."))
    out.draw(lab.picture(lab.mapped(first, "corrected", DIAMOND), "Delay and phase corrected (figure 5.2)."))
    out.plot(curves, "cross-range, m", "modulus", "The centre point, with and without the quadratic phase.")
    return out
