"""Laws of fields on the grid: energy, stability, materials; and the lengths and areas of cut cells."""

from __future__ import annotations

import tracemalloc
from dataclasses import replace

import numpy as np
import pytest
from helpers.devices import opened, variants
from helpers.fdtd_cases import sphere_intervals

from sarcl import shapes
from sarcl.fullwave.bodies import cut_cells
from sarcl.fullwave.bodies.cut_cells import Box, Intervals, conductor
from sarcl.fullwave.bodies.mesh_lines import mesh_lines
from sarcl.fullwave.fields import BLOCK, Fields
from sarcl.fullwave.lattice import COURANT, Lattice
from sarcl.fullwave.target import VACUUM_PERMITTIVITY, Target, material_edges
from sarcl.reference import equations
from sarcl.scene.triangles import rotation

CELL = 0.01  # m
SHAPE = (13, 14, 16)
CENTRE = CELL * (np.array(SHAPE) / 2 + [0.13, 0.27, -0.41])

on_devices = pytest.mark.parametrize("param", variants(names=()))


def grid_of(shape=SHAPE):
    return Lattice(CELL, shape, np.zeros(3))


def started(param, grid, target, **options):
    """Fields that begin at random, and at 0 in the lists of conductors."""
    e, h = np.random.default_rng(7).uniform(-1, 1, (2, 3, *grid.shape))
    e.flat[target.edges] = 0
    fields = Fields(opened(param), grid, target, **options)
    fields.start(e, h)
    return fields, e, h


def after(values, axis, beyond):
    """values[i + 1] along an axis; `beyond` after the last."""
    return np.insert(np.delete(values, 0, axis), values.shape[axis] - 1, beyond, axis)


def areas_of(target, length):
    """Free areas of all faces (3, *shape), from the free lengths of edges (3, *shape) and the weights of cut faces."""
    area = np.empty(length.shape)
    for a in range(3):
        b, c = (a + 1) % 3, (a + 2) % 3
        around = [length[c], after(length[c], b, 1), length[b], after(length[b], c, 1)]
        area[a] = np.max(around, axis=0) > 0
        listed = target.faces // area[a].size == a
        at = target.faces[listed] % area[a].size
        area[a].flat[at] = np.max(around, axis=0).flat[at] / target.weight[:, listed].max(axis=0)
    return area


def fastest(length, area):
    """s^2 times the largest eigenvalue of C^T l C/A, which is below 4 where the time steps are stable."""
    h = np.random.default_rng(5).uniform(-1, 1, length.shape) * (area > 0)
    for _ in range(50):
        e, curl = np.zeros_like(h), np.zeros_like(h)
        equations.update_e(e, h, 1)
        equations.update_h(e * length, curl, -1)
        h = np.divide(curl, area, out=np.zeros_like(h), where=area > 0)
        size = np.linalg.norm(h)
        h /= size
    return COURANT**2 * size


@on_devices
def test_a_closed_cavity_with_a_cut_sphere_keeps_its_energy(param):
    """sum of l E(n) E(n) + A H(n - 1/2) H(n + 1/2), l and A the free lengths and areas, is constant."""
    grid = grid_of()
    intervals = sphere_intervals(grid, CENTRE, 4.3 * CELL)
    target = conductor(grid, intervals)
    whole = Box(np.zeros(3, int), grid.shape)
    length = np.stack([cut_cells.free_lengths(whole, a, part) for a, part in enumerate(intervals)])
    area = areas_of(target, length)
    e, h = np.random.default_rng(7).uniform(-1, 1, (2, 3, *grid.shape))
    e[length == 0], h[area == 0] = 0, 0
    fields = Fields(opened(param), grid, target)
    fields.start(e, h)
    energy = []
    for _ in range(60):
        e, h = fields.download()
        fields.advance(1)
        _, later = fields.download()
        energy.append((length * e.astype(float) ** 2).sum() + (area * h.astype(float) * later).sum())
        fields.advance(BLOCK - 1)
    assert len(target.faces) > 300 and (area < 1).sum() > 300
    assert np.ptp(energy) < 2e-5 * energy[0]


@pytest.mark.slow
@on_devices
def test_twenty_thousand_steps_beside_a_cut_sphere_are_stable(param):
    grid = grid_of()
    fields, e, _ = started(param, grid, conductor(grid, sphere_intervals(grid, CENTRE, 4.3 * CELL)))
    for _ in range(20_000 // BLOCK):
        fields.advance(BLOCK)
    assert 0.1 < np.abs(fields.download()[0]).max() < 10 * np.abs(e).max()


@on_devices
def test_without_the_least_area_of_cut_faces_the_fields_explode(param):
    grid = grid_of()
    target = conductor(grid, sphere_intervals(grid, CENTRE, 4.3 * CELL))
    least = target.weight.max(axis=0) >= np.quantile(target.weight.max(axis=0), 0.9)
    smaller = replace(target, weight=np.where(least, 10, 1) * target.weight)  # a tenth of the least areas
    fields, e, _ = started(param, grid, smaller)
    for _ in range(60):
        fields.advance(BLOCK)
    assert not np.abs(fields.download()[0]).max() < 1e3 * np.abs(e).max()


@on_devices
def test_a_dielectric_that_fills_the_cavity_slows_waves_by_the_root_of_its_permittivity(param):
    """E and H sqrt(eps) of the dielectric are E and H of vacuum with half the time step, for eps = 4."""
    grid = grid_of((5, 6, 16))
    everywhere = np.arange(3 * np.prod(grid.shape))
    target = material_edges(grid, everywhere, np.full(len(everywhere), 4.0), np.zeros(len(everywhere)))
    e, h = np.random.default_rng(8).uniform(-1, 1, (2, 3, *grid.shape))
    fields = Fields(opened(param), grid, target)
    fields.start(e, h)
    slow_e, slow_h = e.copy(), h / 2
    for _ in range(5):
        fields.advance(BLOCK)
    for _ in range(5 * BLOCK):
        equations.update_h(slow_e, slow_h, COURANT / 2)
        equations.update_e(slow_e, slow_h, COURANT / 2)
    # H of the dielectric begins at H and follows -s curl E; in units of 1/sqrt(eps) it is H/2 and follows -(s/2) curl E
    got_e, got_h = fields.download()
    assert np.abs(got_e - slow_e).max() < 2e-5
    assert np.abs(got_h / 2 - slow_h).max() < 2e-5


@on_devices
def test_a_lossy_medium_relaxes_by_its_conductivity_over_its_permittivity(param):
    """A field without curl decays by (1 - x)/(1 + x) per step: exp(-sigma t/eps) to second order."""
    grid = grid_of((3, 4, 16))
    at = np.arange(3 * np.prod(grid.shape))
    sigma, eps = 0.02, 3.0
    target = material_edges(grid, at, np.full(len(at), eps), np.full(len(at), sigma))
    fields = Fields(opened(param), grid, target)
    potential = np.random.default_rng(9).uniform(-1, 1, grid.shape)
    potential[-1], potential[:, -1], potential[:, :, -1] = 0, 0, 0  # walls
    e = np.stack([np.diff(potential, axis=a, append=0) for a in range(3)])
    fields.start(e, np.zeros_like(e))
    for _ in range(5):
        fields.advance(BLOCK)
    x = sigma * grid.time_step / (2 * eps * VACUUM_PERMITTIVITY)
    decay = ((1 - x) / (1 + x)) ** (5 * BLOCK)
    assert 0.1 < decay < 0.9
    assert np.isclose(decay, np.exp(-sigma * 5 * BLOCK * grid.time_step / (eps * VACUUM_PERMITTIVITY)), rtol=1e-3)
    got_e, got_h = fields.download()
    assert np.abs(got_e - decay * e).max() < 1e-6
    assert np.abs(got_h).max() < 1e-6


def plate(grid, along, start, end):
    """Intervals of a slab that fills the grid, from `start` to `end` along one axis."""
    out = []
    for a in range(3):
        b, c = (a + 1) % 3, (a + 2) % 3
        line = np.stack(np.meshgrid(np.arange(grid.shape[b]), np.arange(grid.shape[c]), indexing="ij"), -1).reshape(
            -1, 2
        )
        if a == along:
            out.append(Intervals(line, np.full(len(line), start), np.full(len(line), end)))
        else:
            line = line[(line[:, (along - a - 1) % 3] >= start) & (line[:, (along - a - 1) % 3] <= end)]
            out.append(Intervals(line, np.full(len(line), -1.0), np.full(len(line), grid.shape[a] + 1.0)))
    return tuple(out)


@pytest.mark.parametrize("along", [0, 1, 2])
def test_a_slab_cuts_edges_across_it_and_the_faces_beside_them(along):
    grid, b = grid_of((9, 10, 16)), (along + 1) % 3
    target = conductor(grid, plate(grid, along, 3.3, 6.6))
    component, *node = np.unravel_index(target.faces, (3, *grid.shape))
    within = (np.stack(node, 1) < np.array(grid.shape) - 1).all(axis=1)  # not at the walls of the grid
    assert set(np.unique(component[within])) == {b, (along + 2) % 3}  # faces across the slab stay whole
    assert set(np.unique(node[along][within])) == {3, 6}
    low = target.weight[:, (node[along] == 3) & (component == b) & within]
    # of the edges of such a face two cross the surface, of one only its end is outside, and one is inside
    assert np.allclose(np.sort(low, axis=0), np.array([0, 1, 1, 1 / 0.3])[:, None])
    component, *node = np.unravel_index(target.edges, (3, *grid.shape))
    within = (np.stack(node, 1) < np.array(grid.shape) - 1).all(axis=1)
    assert (component[within] != along).all() and set(np.unique(node[along][within])) == {4, 6}


def test_the_free_area_of_a_face_is_that_of_its_polygon():
    """Every number of corners inside, for a plane that cuts a face at an angle."""
    rng = np.random.default_rng(10)
    seen = set()
    for _ in range(60):
        normal, offset = rng.normal(size=2), rng.uniform(-0.5, 1.5)
        value = np.add.outer(normal[0] * np.arange(2), normal[1] * np.arange(2)) - offset * normal.sum()

        def outside(start, end):
            return 1.0 if min(start, end) >= 0 else 0.0 if max(start, end) < 0 else max(start, end) / abs(start - end)

        free = [outside(*value[at]) for at in (1, 0)] + [outside(*value[:, at]) for at in (1, 0)]
        fine = (np.arange(400) + 0.5) / 400
        wanted = (np.add.outer(normal[0] * fine, normal[1] * fine) - offset * normal.sum() >= 0).mean()
        got = cut_cells.free_area((value < 0).T.reshape(4, 1), np.array(free)[:, None])
        assert abs(got[0] - wanted) < 0.005
        seen.add(int((value < 0).sum()))
    assert seen == {0, 1, 2, 3, 4}


def test_a_staircase_has_no_cut_faces():
    grid = grid_of()
    target = conductor(grid, sphere_intervals(grid, CENTRE, 4.3 * CELL), staircase=True)
    assert len(target.faces) == 0 and len(target.edges) > 300


def test_no_mode_beside_cut_bodies_is_faster_than_the_time_steps_allow():
    """Spheres, boxes and cones askew, whose faces have areas down to 0."""
    rng, grid = np.random.default_rng(12), grid_of((14, 15, 16))
    whole, centre = Box(np.zeros(3, int), grid.shape), CELL * np.array([7, 7.5, 8])
    spheres = [
        sphere_intervals(grid, centre + CELL * rng.uniform(-1, 1, 3), CELL * rng.uniform(2, 4)) for _ in range(4)
    ]
    cases = [(part, None) for part in spheres]
    for body in (
        shapes.box((0.06, 0.05, 0.04), position=(0, 0, -0.02)),
        shapes.cone(0.04, 0.07, position=(0, 0, -0.03)),
    ):
        for _ in range(2):
            found = mesh_lines(grid, body.triangles @ rotation(rng.normal(size=3)).T + centre)
            cases.append((found.intervals, found.areas))
    reached, least = [], []
    for intervals, areas in cases:
        length = np.stack([cut_cells.free_lengths(whole, a, part) for a, part in enumerate(intervals)])
        inside = cut_cells.nodes_inside(whole, intervals[0])
        for a in range(3):
            length[a][inside & after(inside, a, False)] = 0
        area = areas_of(conductor(grid, intervals, areas), length)
        reached.append(fastest(length, area))
        least.append(area[area > 0].min())
    assert 0.9 < min(reached) and max(reached) < 4
    assert min(least) < 0.03


def test_the_lists_do_not_depend_on_how_large_the_grid_is_around_the_body():
    """Neither do the arrays that are made: a sphere at the same place in a grid of 30 times as many cells."""
    lists, peaks = [], []
    for more in (0, 32):
        grid = grid_of(tuple(n + 2 * more for n in SHAPE))
        intervals = sphere_intervals(grid, CENTRE + more * CELL, 4.3 * CELL)
        tracemalloc.start()
        target = conductor(grid, intervals)
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
        component, *node = np.unravel_index(target.edges, (3, *grid.shape))
        lists.append(np.stack([component, *(n - more for n in node)]))
        lists.append(np.sort(target.weight, axis=1))
    assert np.array_equal(lists[0], lists[2])
    assert np.allclose(lists[1], lists[3], rtol=1e-4)
    assert peaks[1] < 1.1 * peaks[0]


def test_an_empty_target_has_empty_lists():
    assert [len(part) for part in (Target.nothing().edges, Target.nothing().faces)] == [0, 0]
