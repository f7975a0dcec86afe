"""Zou et al. 2021, tables 1 and 2: the radar's own numbers, response of a point, targets, what a full run takes."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...analysis.point_response import PointResponse, measure
from ...base.text import duration
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
    out = Section.of("zou", "setting")
    radar = lab.radar
    upper = DOPPLER * (1 + BANDWIDTH / (2 * CHIRP.center))
    _point(out, lab)
    plane = max(_curved(radar.range_, lab.scene(target.name)) for target in _targets.TARGETS)
    phase = _curved(RANGE, _targets.find("tank").scene())
    out.states("phase error of plane waves at the ends of the tank, equation 4", phase, phase < 0.1)
    out.keep(range_m=radar.range_, pulses=len(radar.track), half_beam_deg=np.degrees(HALF_BEAM), plane_wave_rad=plane)
    size = "" if radar.reduction == 1 else f" This run has targets, range and track of 1/{radar.reduction} of these."
    track, half_beam = RANGE * 2 * np.tan(HALF_BEAM), np.degrees(HALF_BEAM)
    out.words = {"range": RANGE, "pulses": PULSES, "track": track, "doppler": DOPPLER, "prf": PRF}
    out.say(half_beam_deg=half_beam, upper=upper, size=size)
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
    printed = RANGE_RESOLUTION, AZIMUTH_RESOLUTION
    for name, width, expected in zip(("range", "azimuth"), response.irw, printed, strict=True):
        out.words = {"name": name, "width": width}
        item = "{name} resolution of a point: distance of peak and null"
        out.number(item, width / HALF_POWER, expected=expected)
    off = float(np.linalg.norm(response.position))
    out.states("place of a point at the origin", off, off < 0.01, off_mm=1000 * off)


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
            duration(plan["run_seconds"]), duration(needs.seconds),
        ])  # fmt: skip
        out.keep(**{target.name: {"run_bytes": plan["run_bytes"], "runs": plan["runs"], "seconds": needs.seconds}})
    out.table("Targets of table 2", sizes, text=True)
    out.table("What the sizes of the paper take", full, cells=CELLS[False], gigabytes=FULL_BYTES / 1e9)
