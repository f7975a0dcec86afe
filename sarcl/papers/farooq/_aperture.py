"""Farooq 2009, sections 5.2 and 5.3: apparent apertures, without and with the switch of carriers at mid-aperture."""

from __future__ import annotations

import numpy as np

from ...base.constants import SPEED_OF_LIGHT
from ..paper import Section
from ._lab import Lab, decibels, system
from ._reference import DIAMOND, PRINTED

# N, step, and as printed: length, m, growth, %, the nulls expected, m, figure
SWITCHED = (
    (45, 20e6, 445.0, 3, None, "figure 5.6"),
    (225, 4e6, 502.0, 17, 0.143, "figure 5.7"),
    (450, 2e6, 574.0, 33, 0.125, "figure 5.8"),
)
OTHER_SPACING = 0.015  # m, half a wave of f0
ZOOM = 8.0  # of the pictures of the centre point
THIN = 5  # every fifth position is plotted


def steady(lab: Lab) -> Section:
    """Figures 5.3 to 5.5."""
    out = Section.of("farooq", "steady")
    out.say()
    curves = []
    for n, step, figure in ((45, 20e6, "5.3"), (450, 2e6, "5.4"), (450, -2e6, "5.5")):
        if not lab.small_enough(n):
            continue
        case, name = system(n, step, mirrored=False), f"N {n}, {step / 1e6:+g} MHz"
        actual, mapped = lab.mapped(case, "corrected"), lab.mapped(case, "apparent")
        y = mapped.tx[:, 1]
        out.words = {"name": name, "figure": figure}
        out.number("{name}: length", float(np.ptp(y)))
        shift = float((y - actual.tx[:, 1]).mean())
        direction = "negative" if step > 0 else "positive"
        if n > 45:
            out.states("{name}: places are moved", shift, (shift < 0) == (step > 0), direction=direction)
        nulls = [lab.measure(raw)["null"] for raw in (actual, mapped)]
        remark = (
            ""
            if step > 0
            else (
                f"the mapping changes nothing, but the centre frequency is now {case.middle / 1e9:.2f} GHz (section "
                f"5.3.1), whose wave resolves {case.null:.3f} m over 430 m; figure 5.5 wants f0 moved as well"
            )
        )
        out.number("{name}: nulls in cross-range", nulls[1], expected=PRINTED, why=remark)
        out.states("{name}: nulls before and after the mapping", nulls, abs(nulls[0] - nulls[1]) < 0.002)
        curves.append((name, actual.tx[::THIN, 1], y[::THIN]))
        if n == 45:
            curves.insert(0, ("actual", actual.tx[::THIN, 1], actual.tx[::THIN, 1]))
        out.draw(
            lab.picture(lab.mapped(case, "apparent", DIAMOND), f"{name}, mapped (figure {figure})."),
            lab.picture(mapped, f"{name}: the centre point in a box of 0.167 m (figure {figure}).", ZOOM, PRINTED),
        )
    out.plot("Positions along the track", curves, dots=True)
    return out


def switched(lab: Lab) -> Section:
    """Figures 5.6 to 5.8."""
    out = Section.of("farooq", "switched")
    out.say()
    curves, table = [], []
    for n, step, length, growth, _, figure in SWITCHED:
        if not lab.small_enough(n):
            continue
        case, name = system(n, step), f"N {n}, +-{step / 1e6:g} MHz"
        raw = lab.collect(case)
        mapped = {o: lab.mapped(case, "apparent", offset=o) for o in ("published", "halved")}
        other = system(n, step, spacing=OTHER_SPACING)
        wide = float(np.ptp(lab.mapped(other, "apparent").tx[:, 1]))
        lengths = {o: float(np.ptp(m.tx[:, 1])) for o, m in mapped.items()}
        length_by_paper = lengths["published"]
        growth_by_paper = 100 * (length_by_paper / case.aperture - 1)
        out.words = {"name": name}
        out.number("{name}: apparent length", length_by_paper, source=figure, expected=length)
        out.number("{name}: longer by", growth_by_paper, source=figure, expected=growth)
        table.append([name, f"{length:.0f}", f"{length_by_paper:.1f}", f"{wide:.1f}", f"{lengths['halved']:.1f}"])
        named = {
            "printed": length,
            "half a wave of fc": length_by_paper,
            "d 0.015 m": wide,
            "halved": lengths["halved"],
        }
        out.keep(**{name: named})
        gap = float(np.diff(mapped["published"].tx[:, 1]).max())
        if n == 45:
            out.states("switched aperture", gap, gap > 2 * np.abs(np.diff(raw.tx[:, 1])).max(), source=figure)
            _outer(out, lab, figure)
            curves.append(("actual", raw.tx[::THIN, 1], raw.tx[::THIN, 1]))
        curves.append((name, raw.tx[::THIN, 1], mapped["published"].tx[::THIN, 1]))
        out.draw(
            lab.picture(lab.mapped(case, "apparent", DIAMOND), f"{name}, mapped ({figure})."),
            lab.picture(
                mapped["published"], f"{name}: the centre point in a box of 0.167 m ({figure}).", ZOOM, PRINTED
            ),
        )
    out.table("Lengths of the apertures", table)
    out.plot("Positions along the track", curves, dots=True)
    return out


def _outer(out: Section, lab: Lab, figure: str) -> None:
    """Side lobes of the centre point and of a point 2 m off in cross-range."""
    case = system(45, 20e6)
    inner, outer = (
        lab.measure(lab.mapped(case, "apparent", ((0.0, y, 0.0),)), half=0.9, about=y)["pslr_db"] for y in (0.0, 2.0)
    )
    out.states("side lobes of the outer targets", [outer, inner], outer > inner + 1, source=figure)


def nulls(lab: Lab) -> Section:
    """The nulls of the centre point, sections 5.3.1 and figures 5.6 to 5.8."""
    out = Section.of("farooq", "nulls")
    curves = []
    for n, step, _, _, expected, figure in SWITCHED:
        if not lab.small_enough(n):
            continue
        case, name = system(n, step), f"N {n}, +-{step / 1e6:g} MHz"
        mapped = lab.mapped(case, "apparent")
        response = lab.measure(mapped)
        null, pslr = response["null"], response["pslr_db"]
        if expected is None:
            holds = abs(null - PRINTED) < 0.017
            out.states("{name}: nulls", [null, pslr], holds, source=figure, name=name)
        else:
            uniform = SPEED_OF_LIGHT / case.middle * case.distance / (2 * np.ptp(mapped.tx[:, 1]))
            words = {"name": name, "figure": figure, "printed": expected, "uniform": uniform}
            out.states("{name}: nulls of two halves", [null, pslr], abs(null - expected) < 0.003, **words)
        places, values = lab.cut(mapped, half=1.0, n=401)
        curves.append((name, places, decibels(values)))
    plain = system(45, 20e6, mirrored=False)
    places, values = lab.cut(lab.mapped(plain, "corrected"), half=1.0, n=401)
    curves.insert(0, ("not mapped", places, decibels(values)))
    out.say()
    out.plot("The centre point", curves)
    return out
