"""Mirror symmetry: planes that leave a target unchanged, and one run that serves two anchors."""

from __future__ import annotations

import numpy as np
import pytest
from helpers.fdtd_cases import conductor_on_grid, sphere_intervals

from sarcl.fullwave import runs
from sarcl.fullwave.bodies.cut_cells import conductor
from sarcl.fullwave.currents import currents
from sarcl.fullwave.formed_echoes import formed_echoes
from sarcl.fullwave.incident import PlaneWave
from sarcl.fullwave.lattice import Lattice
from sarcl.fullwave.mirrors import Twin, mirror_axes, mirrored_echoes, twins
from sarcl.fullwave.target import material_edges
from sarcl.scattering.physical_optics import polarisation

CELL = 0.01  # m
BAND = 1.8e9, 2.5e9  # Hz


def prism(outline, height):
    """A closed body between two copies of a polygon, counterclockwise and star-shaped from its first corner."""
    n = len(outline)
    low, high = (np.column_stack([outline, np.full(n, z)]) for z in (-height / 2, height / 2))
    out = [[high[0], high[i], high[i + 1]] for i in range(1, n - 1)]
    out += [[low[0], low[i + 1], low[i]] for i in range(1, n - 1)]
    for i in range(n):
        j = (i + 1) % n
        out += [[low[i], low[j], high[j]], [low[i], high[j], high[i]]]
    return np.array(out)


BOX = prism(np.array([[-0.2, -0.1], [0.2, -0.1], [0.2, 0.1], [-0.2, 0.1]]), 0.15)
CORNER = prism(np.array([[0.03, 0.03], [0.03, 0.2], [0, 0.2], [0, 0], [0.2, 0], [0.2, 0.03]]), 0.15)
TRAPEZE = prism(np.array([[-0.2, -0.1], [0.2, -0.1], [0.13, 0.1], [-0.13, 0.1]]), 0.15)


def turned(triangles, angle):
    c, s = np.cos(angle), np.sin(angle)
    return triangles @ np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]])


@pytest.mark.parametrize(
    ("triangles", "axes"),
    [
        (BOX, (0, 1, 2)),
        (BOX + np.array([0.0123, -0.0456, 0.0789]), (0, 1, 2)),
        (turned(BOX, 0.3), (2,)),
        (TRAPEZE, (0, 2)),
        (CORNER, (2,)),
        (turned(CORNER, -3 * np.pi / 4), (0, 2)),
        (np.concatenate([BOX, BOX / 8 + np.array([0.15, 0, 0.09])]), (1,)),
    ],
    ids=["box", "box elsewhere", "turned box", "trapeze", "corner", "corner on its symmetry", "box with a knob"],
)
def test_planes_that_leave_a_mesh_unchanged(triangles, axes):
    assert mirror_axes(*conductor_on_grid(triangles, CELL)) == axes


def test_a_sphere_has_three_planes_and_one_beside_the_centre_of_the_grid_two():
    grid = Lattice(CELL, (20, 21, 32), np.zeros(3))
    middle = CELL * np.array(grid.shape) / 2
    for shift, axes in ((0, (0, 1, 2)), (0.3 * CELL, (0, 2))):
        ball = conductor(grid, sphere_intervals(grid, middle + np.array([0, shift, 0]), 6.3 * CELL))
        assert mirror_axes(grid, ball) == axes


def test_materials_that_differ_across_the_plane_are_no_symmetry():
    grid = Lattice(CELL, (6, 6, 16), np.zeros(3))
    # edges along x in cells 2 and 3 of six: a mirror across x exchanges them
    at = np.ravel_multi_index(
        [np.zeros(2, int), np.array([2, 3]), np.array([3, 3]), np.array([8, 8])], (3, *grid.shape)
    )
    for permittivity, axes in (([2.0, 2.0], (0, 1, 2)), ([2.0, 3.0], (1, 2))):
        target = material_edges(grid, at, np.array(permittivity), np.zeros(2))
        assert mirror_axes(grid, target) == axes


def antennas(azimuth, elevation=0.6, distance=40.0, centre=0.0):
    a = np.asarray(azimuth)
    e = np.full_like(a, elevation)
    return centre + distance * np.stack([np.sin(a) * np.cos(e), -np.cos(a) * np.cos(e), np.sin(e)], axis=-1)


def senses(centre, places):
    """H and V of antennas (P, 3) that look at the centre: (2, P, 3)."""
    return np.stack(polarisation(centre - places))


def test_twins_are_pulses_on_both_sides_of_the_plane():
    tx = antennas(np.linspace(-0.2, 0.2, 8))
    towards = tx / np.linalg.norm(tx, axis=1)[:, None]
    for sent, sign in zip(senses(np.zeros(3), tx), (-1, 1), strict=True):
        found = twins((0, 1), towards, sent, 50.0, 1.0)
        assert found == {p: Twin(7 - p, 0, sign) for p in range(8)}
    beside = antennas(np.linspace(-0.19, 0.2, 8))
    assert twins((0,), beside / np.linalg.norm(beside, axis=1)[:, None], sent, 50.0, 1.0) == {}
    odd = antennas(np.linspace(-0.2, 0.2, 5))
    assert sorted(twins((0,), odd / np.linalg.norm(odd, axis=1)[:, None], senses(np.zeros(3), odd)[0], 50.0, 1.0)) == [
        0, 1, 3, 4
    ]  # fmt: skip


@pytest.mark.parametrize("sent", [0, pytest.param(1, marks=pytest.mark.slow)], ids=["H", "V"])
def test_the_mirrored_run_gives_the_echoes_of_the_other_anchors_own_run(sent):
    """HH, VH and HV, VV of a target that makes cross-polar echoes."""
    from sarcl.opencl.choose_device import open_device

    device = open_device(None)
    grid, target = conductor_on_grid(TRAPEZE, 0.014)
    assert mirror_axes(grid, target) == (0, 2)
    centre = grid.origin + grid.cell * np.array(grid.shape) / 2
    tx = antennas(np.array([-0.5, -0.2, 0.3, 0.5]), centre=centre)
    received = senses(centre, tx)
    k = 2 * np.pi / 0.299792458 * np.array([1.9, 2.4])
    towards = (tx - centre) / np.linalg.norm(tx - centre, axis=1)[:, None]
    twin = twins((0,), towards, received[sent], k.max(), 0.3)[0]
    assert twin.pulse == 3
    own, other = (
        currents(
            device, grid, target, PlaneWave(centre - tx[p], received[sent, p], runs.incident_pulse(BAND)), k,
            absorber=runs.ABSORBER, gap=runs.GAP, options=runs.RunOptions(most_steps=4000),
        )
        for p in (3, 0)
    )  # fmt: skip
    wanted = formed_echoes(device, own, tx, tx, received)
    got = mirrored_echoes(device, other, twin, tx, tx, received)
    size = np.abs(wanted).max(axis=(0, 2))
    assert size.min() > 0.02 * size.max()  # co-polar and cross-polar
    assert (np.abs(got - wanted).max(axis=(0, 2)) < 1e-4 * size).all()
