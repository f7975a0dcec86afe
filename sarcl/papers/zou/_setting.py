"""Zou et al. 2021, tables 1 and 2: the radar's own numbers, response of a point, targets, what a full run takes."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...analysis.point_response import PointResponse, measure
from ...imaging.backproject import backproject
from ...scene.scene import Scene
from ...simulation.echo import echo
from ..paper import Section
from . import _targets
from ._lab import CELLS, FULL_BYTES, Lab
from ._radar import (
    AZIMUTH_RESOLUTION,
    BANDWIDTH,
    CHIRP,
    DOPPLER,
    HALF_BEAM,
    PRF,
    PULSES,
    RANGE,
    RANGE_RESOLUTION,
    WAVELENGTH,
)

TABLE = "table 1"
HALF_POWER = 0.886  # of a flat spectrum: width at half power over the distance from peak to null
POINT, SPACING = 3.0, 0.05  # m: half the range window and the image; pixels


def section(lab: Lab) -> Section:
    """Tables 1 and 2."""
    out = Section("setting", "Radar and targets (tables 1 and 2)")
    radar = lab.radar
    upper = DOPPLER * (1 + BANDWIDTH / (2 * CHIRP.center))
    _point(out, lab)
    plane = max(_curved(radar.range_, lab.scene(target.name)) for target in _targets.TARGETS)
    phase = _curved(RANGE, _targets.find("tank").scene())
    item = "phase error of plane waves at the ends of the tank, equation 4"
    expected = "approximately a plane wave"
    why = "equation 4 leaves out r'^2/2r of the distance of a cell; sarcl delays every cell by its own distance"
    rule = "below 0.1 rad, two ways"
    out.states(
        item, "section 2.2", expected, f"{phase:.2f} rad", phase < 0.1, why, phase, rule=rule, cause="interpretation"
    )
    out.keep(range_m=radar.range_, pulses=len(radar.track), half_beam_deg=np.degrees(HALF_BEAM), plane_wave_rad=plane)
    size = "" if radar.reduction == 1 else f" This run has targets, range and track of 1/{radar.reduction} of these."
    out.say(
        f"The paper prints no range. Here it is {RANGE:.0f} m, at which {PULSES} pulses, "
        f"{RANGE * 2 * np.tan(HALF_BEAM):.0f} m of track, just cross the beam of {np.degrees(HALF_BEAM):.1f} degrees "
        f"on either side that {DOPPLER:.0f} Hz of Doppler bandwidth need: {upper:.0f} Hz at the upper end of the band, "
        f"below the PRF of {PRF:.0f} Hz.{size} Targets are in free space, with the centre of "
        "their box at the origin, 45 degrees below the radar. Solids stand upright; cuboid and tank are longest along "
        "the track. Distances are spherical: every cell has its own. Flat sides lie on nodes of the grid."
    )
    _table(out, lab)
    return out


def _point(out: Section, lab: Lab) -> None:
    """Response of a point: widths and place."""
    raw = echo(
        Scene.points([[0.0, 0.0, 0.0]]), CHIRP, lab.radar.track, range_window=(-2 * POINT, 2 * POINT),
        reference=(0.0, 0.0, 0.0), tolerance=1e-4, check=False, device=lab.device,
    )  # fmt: skip
    image = backproject(raw, lab.radar.grid((POINT, POINT), SPACING), tolerance=1e-3, check=False, device=lab.device)
    response = measure(image, near=(0.0, 0.0, 0.0))
    assert isinstance(response, PointResponse)
    for name, width, printed in zip(
        ("range", "azimuth"), response.irw, (RANGE_RESOLUTION, AZIMUTH_RESOLUTION), strict=True
    ):
        item = f"{name} resolution of a point: distance of peak and null"
        out.number(item, TABLE, printed, width / HALF_POWER, 0.02, "m", ".3f", f"{width:.3f} m wide at half power")
    off = float(np.linalg.norm(response.position))
    item = "place of a point at the origin"
    out.states(
        item, "", "origin", f"{1000 * off:.2f} mm off", off < 0.01, value=off, rule="within 10 mm", basis="geometry"
    )


def _curved(range_: float, scene: Scene) -> float:
    """Largest phase by which plane waves differ from spherical ones over a scene's corners, two ways, rad."""
    from_radar = scene.triangles.reshape(-1, 3) - np.array([-1.0, 0, 1.0]) / np.sqrt(2) * range_
    plane = range_ + scene.triangles.reshape(-1, 3) @ np.array([1.0, 0, -1.0]) / np.sqrt(2)
    return float(4 * np.pi / WAVELENGTH * np.abs(np.linalg.norm(from_radar, axis=1) - plane).max())


def _table(out: Section, lab: Lab) -> None:
    """Targets, printed and made, and what their echoes take in full size."""
    sizes, full = [], []
    for target in _targets.TARGETS:
        scene, needs = lab.scene(target.name), lab.forecast(target.name)
        size = np.diff(scene.bounds, axis=0)[0]
        sizes.append([target.name, target.printed, " x ".join(f"{v:.3g}" for v in size), len(scene.triangles)])
        plan: dict[str, Any] = dict(needs.plan)
        full.append([
            target.name, plan["grid"], plan["steps"], f"{plan['run_bytes'] / 2**30:.1f}", plan["runs"],
            f"{plan['run_seconds'] / 60:.0f}", f"{needs.seconds / 3600:.1f}",
        ])  # fmt: skip
        out.keep(**{target.name: {"run_bytes": plan["run_bytes"], "runs": plan["runs"], "seconds": needs.seconds}})
    caption = "Targets of table 2."
    out.table(["target", "table 2", "here: ground range x azimuth x height, m", "facets"], sizes, caption, text=True)
    out.table(
        ["target", "cells of the grid", "time steps", "GiB per run", "runs", "minutes per run", "hours"],
        full,
        f"What the sizes of the paper take with at least {CELLS[False]} cells per shortest wavelength and "
        f"{FULL_BYTES / 1e9:g} GB for a run, forecast for this machine at its present speed "
        "(sarcl.plan). Figure 8 takes 18 runs more for cuboid and "
        "sharp cone each.",
    )
