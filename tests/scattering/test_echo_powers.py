"""Powers by which errors of shadows on rough facets count: against their mean echoes, pulse by pulse."""

from __future__ import annotations

import numpy as np
import pytest

import sarcl
from sarcl.base.vectors import unit
from sarcl.numerics.pulse_geometry import PulseGeometry
from sarcl.opencl.choose_device import open_device
from sarcl.scattering.facet_shadows import Casters, ShadowRule, echo_powers
from sarcl.scattering.physical_optics import scattering_matrix
from sarcl.scene.triangles import areas, centroids, normals

MATERIALS = [
    sarcl.Material(diagram="isotropic"), sarcl.Material(diagram="cos2"), sarcl.Material(diagram="exp", width=0.5),
]  # fmt: skip
METAL = 1 - 1e12j  # relative permittivity


def facets(n=300):
    random = np.random.default_rng(0)
    parts = [
        sarcl.Scene.facets(random.uniform(-1, 1, (n, 3, 3)), material=material, two_sided=random.random(n) < 0.5)
        for material in MATERIALS
    ]
    return parts[0] + parts[1] + parts[2]


def powers_of(scene, antennas):
    return echo_powers(scene, scene.triangles, np.arange(len(scene.triangles)), antennas)


def mean_echoes(scene, track):
    """Means over pulses of |S|^2 A D/Omega, by facet: that of a rough plate is lambda^2 times this."""
    normal, total = normals(scene.triangles), np.zeros(len(scene.triangles))
    for place in track.positions:
        look = unit(place - centroids(scene.triangles))
        side = np.where(scene.two_sided & ((normal * look).sum(axis=1) < 0), -1, 1)[:, None] * normal
        matrix = scattering_matrix(side, look, look, np.full(len(total), METAL))[:, 0, 0]
        delta = np.arccos(np.clip((side * look).sum(axis=1), -1, 1))
        lobes = np.array([material.lobe(delta) / material.solid_angle for material in scene.materials])
        total += np.abs(matrix) ** 2 * areas(scene.triangles) * lobes[scene.material, np.arange(len(total))]
    return total / len(track.positions)


@pytest.mark.parametrize("arc, room", [(1e-3, 1e-3), (0.09, 0.01), (1.5, 0.04)])
def test_powers_are_those_of_mean_echoes(arc, room):
    scene = facets()
    track = sarcl.Trajectory.circle(radius=40.0, height=30.0, start=0.3, arc=arc, n_pulses=40)
    powers = powers_of(scene, PulseGeometry(track.positions, track.positions))
    wanted = mean_echoes(scene, track)
    powers *= wanted.sum() / powers.sum()
    assert np.linalg.norm(powers - wanted) < room * np.linalg.norm(wanted)
    assert (wanted < 1e-6 * wanted.max()).any()  # facets that turn their back count for little
    assert powers[wanted < 1e-6 * wanted.max()].max() < room * wanted.max()


def test_between_two_antennas_areas_count():
    scene = facets(20)
    tx, rx = np.full((3, 3), [50.0, 0, 30]), np.full((3, 3), [0.0, 50, 30])
    powers = powers_of(scene, PulseGeometry(tx, rx))
    assert powers == pytest.approx(areas(scene.triangles), rel=1e-12)


def looks(turn):
    """Number of looks at shadows on a hall and the ground about it, from an arc whose middle is off the plane of two
    walls by an angle, rad."""
    axis = np.linspace(-12, 12, 61)
    ground = sarcl.Scene.from_heights(axis, axis, np.zeros((61, 61)), material=MATERIALS[0])
    hall = sarcl.shapes.box((8, 4, 3), material=MATERIALS[0]).split(max_edge=0.4).moved((0, 0, 1.5))
    scene = ground + hall
    arc = sarcl.Trajectory.circle(radius=8e3, height=6e3, start=np.pi / 2 - 0.03 + turn, arc=0.06, n_pulses=241)
    antennas = PulseGeometry(arc.positions, arc.positions)
    rule = ShadowRule(False, True, 0.01, 1e8)
    every = np.arange(len(scene.triangles))
    light = Casters.of(scene, antennas).light(scene, every, antennas, rule, open_device(None), lambda *a: None, 0.0)
    return len(light)


def test_a_wall_that_turns_edge_on_asks_for_no_more_looks():
    """From one pulse to the next a wall turns dark, of which no pulse receives an echo."""
    assert looks(0.011) <= 1.1 * looks(0.1)
