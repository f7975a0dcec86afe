"""Flat parts at right angles that face each other: what single reflections leave out, beside rcs with bounces=2."""

from __future__ import annotations

import warnings

import numpy as np
import pytest

import sarcl
from sarcl import shapes

CHIRP = sarcl.Waveform.chirp(center=9.6e9, bandwidth=100e6, duration=1e-6)
NEARBY = np.linspace(9.4e9, 9.8e9, 9)  # Hz, over the lobes of single reflections
GROUND = shapes.plate((20, 20))
SOIL, STONE = sarcl.Material(3 - 0.05j), sarcl.Material(5.24 - 0.53j)
DIFFUSE = sarcl.Material(height=np.inf, diagram="isotropic")
WALL = shapes.box((0.3, 3, 5))
ENTRY = "left out at right angles, dB"


def towards(elevation: float, azimuth: float = 0.0) -> sarcl.Trajectory:
    """A track of one position, 10 km away, rad."""
    flat = np.cos(elevation) * np.array([np.cos(azimuth), np.sin(azimuth)])
    return sarcl.Trajectory(None, 1e4 * np.array([[*flat, np.sin(elevation)]]))


def excess(scene: sarcl.Scene, track: sarcl.Trajectory) -> float | None:
    """What a forecast says of a scene, dB, with or without its warning."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", sarcl.SarclWarning)
        words = sarcl.plan(sarcl.echo, scene, CHIRP, track, tolerance=0.1).plan
    assert (ENTRY in words) == any("right angles" in str(w.message) for w in caught)
    return words.get(ENTRY)  # type: ignore[return-value]


@pytest.mark.parametrize("elevation", np.radians([30, 45, 60]))
@pytest.mark.parametrize("materials", ["metal", "stone on soil"])
def test_it_is_about_the_ratio_of_radar_cross_sections(elevation, materials):
    scene = WALL.on(GROUND, 0, 0) + GROUND
    if materials != "metal":
        scene = shapes.box((0.3, 3, 5), material=STONE).on(GROUND, 0, 0) + shapes.plate((20, 20), material=SOIL)
    sigma = [
        np.mean(np.abs(sarcl.rcs(scene, 0.0, elevation, NEARBY, bounces=n, polarization=("HH", "VV"))) ** 2, axis=0)
        for n in (1, 2)
    ]
    assert excess(scene, towards(elevation)) == pytest.approx(10 * np.log10((sigma[1] / sigma[0]).max()), abs=5)


def hidden() -> sarcl.Scene:
    screen = shapes.plate(
        (30, 30),
        position=(25, 0, 10),
        rotation=(0, np.pi / 2, 0),
        material=DIFFUSE,
    )
    return WALL.on(GROUND, 0, 0) + GROUND + screen


def hilly() -> sarcl.Scene:
    axis = np.linspace(-20, 20, 41)
    heights = 2 * np.sin(axis / 3)[:, None] * np.cos(axis / 4)
    return sarcl.Scene.from_heights(axis, axis, heights, material=SOIL)


SILENT = {
    "a convex body": lambda: WALL,
    "a plate": lambda: GROUND,
    "terrain": hilly,
    "diffuse ground": lambda: WALL.on(GROUND, 0, 0) + shapes.plate((20, 20), material=DIFFUSE),
    "a wall that leans by 10 deg": lambda: GROUND + shapes.plate((5, 3), position=(0, 0, 3), rotation=(0, 1.4, 0)),
    "parts smaller than the wavelength asks for": lambda: shapes.dihedral((0.1, 0.1)),
    "a corner behind a screen": hidden,
}  # fmt: skip


@pytest.mark.parametrize("name", SILENT)
def test_it_is_silent_of(name):
    assert excess(SILENT[name](), towards(0.6)) is None


def test_a_wall_that_faces_away_is_not_seen():
    one_sided = shapes.plate((5, 3), position=(0, 0, 2.5), rotation=(0, np.pi / 2, 0))
    scene = sarcl.Scene.facets(np.concatenate([one_sided.triangles, GROUND.triangles]), two_sided=np.zeros(4, bool))
    seen = [excess(scene, towards(0.6, azimuth)) is not None for azimuth in (0.0, np.pi)]
    assert sorted(seen) == [False, True]


def test_echo_warns_with_the_remedy_and_is_silent_with_it():
    scene = shapes.dihedral((0.5, 0.5))
    options = {"tolerance": 0.1, "reference": (0, 0, 0), "range_window": (-5, 5)}
    with pytest.warns(sarcl.SarclWarning, match=r"of 0.5 and 0.5 m: .* about 4\d dB weaker .*pass bounces=2"):
        raw = sarcl.echo(scene, CHIRP, towards(np.pi / 4), **options)
    assert 40 <= raw.report.plan[ENTRY] < 50
    with warnings.catch_warnings():
        warnings.simplefilter("error", sarcl.SarclWarning)
        two = sarcl.echo(scene, CHIRP, towards(np.pi / 4), bounces=2, **options)
    assert ENTRY not in two.report.plan
    ratio = np.linalg.norm(two.samples) / np.linalg.norm(raw.samples)
    assert 20 * np.log10(ratio) == pytest.approx(raw.report.plan[ENTRY], abs=6)
