"""Scenes with several reflections, beside a tenth of their tolerance; reciprocity of what they send back."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

import sarcl
from sarcl import shapes

CHIRP = sarcl.Waveform.chirp(center=9.6e9, bandwidth=300e6, duration=1e-6)
TRACK = sarcl.Trajectory(None, np.array([[6.43e3, 50.0, 7.66e3]]))


def car_on_asphalt(folder) -> sarcl.Scene:
    """A vehicle of 792 facets, which intersect."""
    car = sarcl.Scene.from_mesh(folder / "meshes/car_of_boxes/car_mm.stl", scale=1e-3)
    floor = shapes.plate((12, 12), material="asphalt")
    return floor + car.on(floor, 0, 0)


def house_on_paving(folder) -> sarcl.Scene:
    """Brick walls with the reflection that heights of 4 mm leave, on paving."""
    brick, paving = (
        dataclasses.replace(sarcl.material.MATERIALS[name], height=h)
        for name, h in (("brick", 4e-3), ("concrete", 8e-3))
    )
    yard = shapes.box((4, 3, 2.5), position=(0, 0, -0.05), material=brick)
    wing = shapes.box((2, 2, 2), position=(3.0, 1.5, -0.05), material=brick)
    return shapes.box((12, 8, 1), position=(2, 0, -1), material=paving) + yard + wing


@pytest.mark.parametrize(
    ("scene", "tolerance"),
    [
        (house_on_paving, 1e-1),
        *(
            pytest.param(scene, tolerance, marks=pytest.mark.slow)
            for scene, tolerance in [
                (house_on_paving, 1e-2),
                (house_on_paving, 1e-3),
                (car_on_asphalt, 1e-1),
                (car_on_asphalt, 1e-2),
                (car_on_asphalt, 1e-3),
            ]
        ),
    ],
)
def test_a_run_at_a_tenth_of_the_tolerance_differs_by_less_than_the_tolerance(data_folder, scene, tolerance):
    options = {"bounces": 3, "reference": (0, 0, 0), "range_window": (-12, 12), "check": False}
    coarse, fine = (
        sarcl.echo(scene(data_folder), CHIRP, TRACK, tolerance=t, **options) for t in (tolerance, tolerance / 10)
    )
    assert np.linalg.norm(coarse.samples - fine.samples) < tolerance * np.linalg.norm(fine.samples)
    assert coarse.report.predicted_error <= tolerance
    assert coarse.report.plan["contributions by reflections"].count(":") == 3


@pytest.mark.parametrize("width", [0.3, 1.6], ids=["steep", "gentle"])
def test_a_terrain_shades_what_walls_and_slabs_reflect_as_its_facets_do(width):
    """A ridge of 20 808 dark facets between a wall and the farther of two slabs, with and without its heights."""
    axis = np.linspace(-6, 9, 103)
    ridge = 1.7 * np.exp(-(((axis - 2) / width) ** 2)) * (np.abs(axis - 2) < 1) * (np.abs(axis) < 1.4)[:, None]
    wall = shapes.plate((5, 3), rotation=(0, np.pi / 2, 0), position=(0, 0, 2.52))
    slabs = shapes.plate((0.9, 3), position=(0.5, 0, 0.02)) + shapes.plate((0.8, 3), position=(3.5, 0, 0.02))
    dark, options = sarcl.Material(reflectivity=0.0), {"reference": (0, 0, 0), "range_window": (-12, 12)}
    ground, plain = (sarcl.Scene.from_heights(axis, axis, z, material=dark) for z in (ridge, 0 * ridge))
    scenes = [part + wall + slabs for part in (ground, dataclasses.replace(ground, heights=None), plain)]
    a, b, c = (sarcl.echo(s, CHIRP, TRACK, bounces=2, tolerance=1e-4, check=False, **options).samples for s in scenes)
    assert np.linalg.norm(a - b) <= 1e-4 * np.linalg.norm(b)
    assert np.linalg.norm(a - c) > 0.5 * np.linalg.norm(b)


def test_cross_polarisation_of_single_reflections_is_reciprocal():
    block = shapes.box((1.0, 0.6, 0.8), material="concrete")
    scene = block + shapes.box((0.5, 0.7, 0.9), material="sand", position=(1.5, 0, 0), rotation=(0.3, 0.2, 0.5))
    azimuth, elevation = np.linspace(0.1, 6.2, 24), np.linspace(0.1, 1.4, 24)
    s = sarcl.rcs(scene, azimuth, elevation, 9.6e9, polarization="all")
    assert np.linalg.norm(s[:, 1] - s[:, 2]) <= 1e-5 * np.linalg.norm(s[:, 1])
    assert np.linalg.norm(s[:, 1]) > 1e-3 * np.linalg.norm(s)


@pytest.mark.parametrize("material", ["metal", "concrete"])
def test_in_the_main_lobe_several_reflections_are_reciprocal(material):
    random, look = np.random.default_rng(3), np.array([1, 0, 1]) / np.sqrt(2)
    across = np.cross(np.eye(3), look)
    for roll in random.uniform(0.2, 1.3, 8):
        turn = np.eye(3) + np.sin(roll) * across + (1 - np.cos(roll)) * across @ across
        scene = shapes.dihedral((0.5, 0.5), rotation=turn, material=material)
        azimuth, elevation = random.normal(0, 0.008, 2)  # half a main lobe
        s = sarcl.rcs(scene, azimuth, np.pi / 4 + elevation, 9.6e9, bounces=2, polarization=("HV", "VH")).ravel()
        assert abs(20 * np.log10(abs(s[0] / s[1]))) < 0.1
