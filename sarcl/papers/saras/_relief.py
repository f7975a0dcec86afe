"""SARAS, section VI: layover, shadow and polarisation of solids on flat ground (figures 13 to 17)."""

from __future__ import annotations

import numpy as np

from ...model.phase_history import PhaseHistory
from ...scattering.physical_optics import fresnel
from ...scene import shapes
from ...scene.scene import Scene
from ..far_radar import FarRadar, ground
from ..lab import Lab, picture
from ..paper import Section
from ._ground import ROUGH

# What matters is how many resolution cells a shape covers
RADAR = FarRadar(look=np.radians(50), bandwidth=100e6, turn=0.014, n_pulses=64)
FINE = FarRadar(look=np.radians(50), bandwidth=150e6, turn=0.02, n_pulses=100)
COTANGENT, TANGENT = 1 / np.tan(RADAR.look), np.tan(RADAR.look)
LOOKS = {True: 6, False: 24}
BOX = (14.0, 36.0, 14.0)  # m along x, y, z: depth, width, height
POLARIZATIONS = ("HH", "VV", "HV")


def parallelepiped(lab: Lab) -> Section:
    """Figure 13."""
    out = Section.of("saras", "parallelepiped")
    depth, width, height = BOX[0] / 2, BOX[1] / 2, BOX[2]
    scene = ground((-40, 40), (-45, 45), material=ROUGH) + shapes.box(BOX, material=ROUGH)
    raw = FINE.echo(scene, tolerance=1e-3, seed=1, device=lab.device)
    grid = FINE.grid((140, 130), pixels=2)
    # Taylor's window of -90 dB adds -74 dB from the ground around the shadow
    power = np.abs(FINE.focus(raw, grid, tolerance=1e-3, window=("taylor", 90, 16), device=lab.device)) ** 2
    out.draw(picture(power, grid, "A parallelepiped on flat ground, seen from the left (figure 13)."))
    y, x = np.abs(grid.positions[..., 1]), grid.positions[..., 0]
    inside = 4 * FINE.null[0], 4 * FINE.null[1]
    ends = depth - height * COTANGENT, depth + height * TANGENT
    dark = (y < width - inside[0]) & (x > ends[0] + inside[1]) & (x < ends[1] - inside[1])
    lit = power[(x > ends[1] + inside[1]) & (x < 42)].mean()
    level = float(10 * np.log10(power[dark].mean() / lit))
    out.states("power in the shadow", level, level < -60)
    _edges(out, lab, raw, ends, (depth, width, height))
    return out


def _edges(
    out: Section, lab: Lab, raw: PhaseHistory, ends: tuple[float, float], half: tuple[float, float, float]
) -> None:
    """Begin of layover, begin and end of the dark run, on the ground and along slant range."""
    depth, width, height = half
    front = -depth - height * COTANGENT
    for plane in ("ground", "slant"):
        scale = 1.0 if plane == "ground" else float(np.sin(FINE.look))
        turned = {} if plane == "ground" else {"normal": (FINE.up[2], 0, -FINE.up[0]), "x_axis": -FINE.up}
        grid = FINE.grid((240, 240), pixels=(4, 4 / scale), **turned)
        power = np.abs(FINE.focus(raw, grid, window="hamming", device=lab.device)) ** 2
        profile = power[np.abs(grid.positions[:, 0, 1]) < width - 4].mean(axis=0)
        places = (np.arange(240) - 120) * FINE.null[1] * scale / 4
        lit = profile[places > ends[1] * scale + 4].mean()
        first, last = crossings(profile, places, lit / 2)
        cell = FINE.null[1] * scale
        out.words = {"plane": plane}
        for name, wanted, edge in (("begins", ends[0], first), ("ends", ends[1], last)):
            out.number("shadow {name}, {plane} range", edge, expected=wanted * scale, within=0.5 * cell, name=name)
        run = (ends[1] - ends[0]) * scale
        out.number("length of the dark run, {plane} range", last - first, expected=run, within=0.7 * cell)
        if plane == "ground":
            over = profile[(places > front + 2) & (places < -depth - 2)].mean()
            before = profile[(places > front - 15) & (places < front - 2)].mean()
            near = places < front + 3
            start = crossings(profile[near], places[near], (before + over) / 2)[1]
            out.number("layover begins", start, expected=front, within=FINE.null[1])
            out.plot("Profile across the parallelepiped", [("mean over azimuth", places, 10 * np.log10(profile / lit))])
    out.say(depth=2 * depth, width=2 * width, height=height, look_deg=np.degrees(FINE.look))


def cone(lab: Lab) -> Section:
    """Figures 14 to 16."""
    out = Section.of("saras", "cone")
    flat = ground((-34, 34), (-55, 50), material=ROUGH)
    scene = flat + shapes.cone(12, 12 * TANGENT, sections=120, material=ROUGH)
    grid, n = RADAR.grid((80, 90), pixels=2), LOOKS[lab.quick]
    first, mean = lab.looks(RADAR, scene, grid, n, POLARIZATIONS)
    for name, power, one, number in zip(POLARIZATIONS, mean, first, (14, 15, 16), strict=True):
        out.draw(picture(power, grid, f"The cone in {name}, mean of {n} looks (figure {number}, without speckle)."))
        out.draw(picture(one, grid, f"The cone in {name}, one look: with speckle."))
    y = np.abs(grid.positions[:, 0, 1])
    middle, side = y < 0.5, (y > 5) & (y < 9)
    bright = [float(p[middle].mean(axis=0).max() / p[side].mean(axis=0).max()) for p in mean]
    for name, number, ratio in zip(POLARIZATIONS, (14, 15, 16), bright, strict=True):
        out.words = {"name": name, "number": number}
        if name == "HV":
            out.states("{name} where it faces the radar", ratio, ratio < 0.3)
        else:
            out.states("{name} where the cone faces the radar", ratio, ratio > 2)
    x = grid.positions[0, :, 0]
    peak = mean[:2, middle].mean(axis=1).max(axis=1)
    apart = float(10 * np.log10(peak[1] / peak[0]))
    out.states("VV over HH where the cone faces the radar", apart, abs(apart) < 1)
    beside = mean[:2][:, y < 20][:, :, x > 40].mean(axis=(1, 2))
    flat_apart = float(10 * np.log10(beside[1] / beside[0]))
    cosine = np.array(np.cos(RADAR.look))
    h, v = fresnel(cosine, np.array(ROUGH.permittivity(RADAR.center)))
    out.number("VV over HH on flat ground", flat_apart, expected=float(20 * np.log10(abs(v / h))))
    out.say()
    samples = RADAR.echo(flat, polarization=POLARIZATIONS, device=lab.device).samples
    hh, hv = (float(np.linalg.norm(np.asarray(samples)[i::3])) for i in (0, 2))
    out.states("HV of flat ground", hv / hh, hv < 1e-5 * hh)
    return out


def composite(lab: Lab) -> Section:
    """Figure 17."""
    out = Section.of("saras", "composite")
    plain = ground((-34, 34), (-55, 50), material=ROUGH)
    tower = shapes.cylinder(12, 8, sections=120, material=ROUGH).on(plain, -12, -12)
    top = shapes.box((10, 12, 12), material=ROUGH).on(tower, -12, -12)
    scene: Scene = plain + tower + top + shapes.cone(12, 16, sections=120, material=ROUGH).on(plain, 10, 16)
    grid, n = RADAR.grid((80, 90), pixels=2), LOOKS[lab.quick]
    first, mean = lab.looks(RADAR, scene, grid, n)
    out.draw(
        picture(first[0], grid, "Parallelepiped on a cylinder, and a cone, one look (figure 17)."),
        picture(mean[0], grid, f"The same, mean of {n} looks."),
    )
    y, x = grid.positions[:, 0, 1], grid.positions[0, :, 0]
    profile = mean[0][np.abs(y + 12) < 4].mean(axis=0)
    end = -7 + 20 * TANGENT  # the shadow of the rear edge of the parallelepiped, 20 m high
    lit = profile[(x > end + 4) & (x < 44)].mean()
    edge = crossings(profile, x, lit / 2)[1]
    out.number("end of the parallelepiped's shadow", edge, expected=end, within=RADAR.null[1])
    return out


def crossings(profile: np.ndarray, at: np.ndarray, level: float) -> tuple[float, float]:
    """First and last place between samples where a profile (n,) at places, m (n,), crosses `level`; NaN: nowhere."""
    below = profile < level
    i = np.flatnonzero(below[1:] != below[:-1])
    if len(i) == 0:
        return np.nan, np.nan
    i = i[[0, -1]]
    places = at[i] + (at[i + 1] - at[i]) * (level - profile[i]) / (profile[i + 1] - profile[i])
    return float(places[0]), float(places[1])
