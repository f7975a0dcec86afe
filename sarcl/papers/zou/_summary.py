"""Zou et al. 2021, section 4: the six targets side by side, and full wave against physical optics."""

from __future__ import annotations

import numpy as np

from ..paper import Section
from . import _targets
from ._lab import Lab, report_of

CROSS, NEAR = -40.0, 10.0  # dB: VH over HH in amplitude as printed, and how near counts as about that


def section(lab: Lab) -> Section:
    """All targets that have been imaged."""
    out = Section.of("zou", "summary")
    rows, cross = [], {}
    imaged = [target for target in _targets.TARGETS if target.name in lab.levels]
    for target in imaged:
        level, (report, plan) = lab.levels[target.name], report_of(lab.full_wave(target.name))
        peaks = _db(level.peak[0]), _db(level.optics)
        cross[target.name] = _db(level.peak[1] / level.peak[0])
        rows.append([
            target.name, f"{peaks[0]:.1f}", f"{peaks[1]:.1f}", f"{level.apart:.0%}", f"{cross[target.name]:.0f}",
            f"{_db(level.rms[1] / level.rms[0]):.0f}", len(plan["anchors"]), plan["runs"],
            f"{sum(report.seconds.values()):.0f}",
        ])  # fmt: skip
    out.table("Brightest pixels", rows)
    others = np.array([v for name, v in cross.items() if name != "sphere"])
    middle = float(np.median(others))
    out.words = {"least": others.min(), "most": others.max(), "near": NEAR, "cross": CROSS}
    item = "VH over HH, brightest pixels of the targets but the sphere"
    out.states(item, middle, abs(middle - CROSS) < NEAR)
    edged = [target.name for target in imaged if target.name != "sphere"]
    differ = np.array([lab.levels[name].apart for name in edged])
    reports = [report_of(lab.full_wave(name))[0] for name in edged]
    uncertain = np.array([(report.predicted_error or 0.0) + (report.model_error or 0.0) for report in reports])
    errors = zip(edged, differ, uncertain, strict=True)
    measured = ", ".join(f"{name} {d:.0%} (full wave {u:.0%})" for name, d, u in errors)
    item = "physical optics against full wave, targets with edges"
    out.states(item, differ, (differ > uncertain).all(), measured=measured)
    out.keep(cross_over_co_db=cross, optics_differs={name: level.apart for name, level in lab.levels.items()})
    return out


def _db(amplitude: float) -> float:
    return float(20 * np.log10(max(amplitude, 1e-9)))
