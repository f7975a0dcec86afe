"""Targets of several materials: closed forms of permittivities, overlaps, conductors in dielectrics, refusals."""

from __future__ import annotations

import numpy as np
import pytest

from sarcl import shapes
from sarcl.fullwave.bodies import _dielectrics
from sarcl.fullwave.bodies.cut_cells import conductor
from sarcl.fullwave.bodies.materials import Body, bodies
from sarcl.fullwave.bodies.mesh_lines import mesh_lines
from sarcl.fullwave.dispersion import grid_vector
from sarcl.fullwave.lattice import COURANT, Lattice
from sarcl.fullwave.target import material_edges
from sarcl.scene.triangles import rotation

CELL = 0.1  # m
GRID = Lattice(CELL, (30, 30, 32), np.zeros(3))
K = 2 * np.pi / (20 * CELL)
LONG = 2 * np.pi / (5000 * CELL)  # waves so long that permittivities are not corrected for the grid's dispersion


def box(low, high):
    low, high = CELL * np.array(low, float), CELL * np.array(high, float)
    return shapes.box(high - low, position=[*(low + high)[:2] / 2, low[2]]).triangles


def permittivity(target):
    """Of lossless edges (3, *shape): share[1] is 1/permittivity; nan in conductors."""
    out = np.ones((3, *GRID.shape))
    inverse = target.share[1]
    out.flat[target.edges] = np.where(inverse > 0, 1 / np.where(inverse > 0, inverse, 1), np.nan)
    return out


def test_conductors_alone_are_those_of_the_mesh():
    parts = box((8.3, 8.6, 9.2), (14.5, 20.1, 16.9)), box((15.2, 8.6, 9.2), (19.7, 20.1, 16.9))
    made = bodies(GRID, [Body(part) for part in parts], K)
    found = mesh_lines(GRID, np.concatenate(parts))
    wanted = conductor(GRID, found.intervals, found.areas)
    for name in ("edges", "share", "faces", "weight"):
        assert np.array_equal(getattr(made, name), getattr(wanted, name))


@pytest.mark.parametrize("axis", [0, 1, 2])
@pytest.mark.parametrize("end", [10.1, 10.4, 10.75])
def test_a_boundary_along_the_grid_has_the_mean_along_it_and_the_harmonic_mean_across_it(axis, end):
    low, high = np.array([5.3, 5.3, 5.3]), np.array([16.7, 16.7, 16.7])
    high[axis] = end
    target = bodies(GRID, [Body(box(low, high), 3.0)], LONG)
    made = permittivity(target)
    middle = [11, 11, 11]
    for component in range(3):
        along = np.moveaxis(made[component], axis, 0)[:, middle[1], middle[2]][8:13]
        start = np.arange(8, 13) - (0 if component == axis else 0.5)  # of the cell about the edge
        share = np.clip(end - start, 0, 1)
        assert np.allclose(along, 1 / (share / 3 + 1 - share) if component == axis else 1 + 2 * share, atol=2e-5)
    node = np.stack(np.unravel_index(target.coupled, (3, *GRID.shape))[1:], axis=1)
    assert ((np.abs(node - 5.3) < 2) | (np.abs(node - high) < 2)).sum(axis=1).min() >= 2  # at rims of the box alone


def sampled_sphere(centre, radius, offset, eps):
    """Mean of the permittivity and of its inverse in cubes about points of the grid, by 15 places along each axis, and
    the normal of the sphere there."""
    place = np.indices(GRID.shape) + np.reshape(offset, (3, 1, 1, 1)) - np.reshape(centre, (3, 1, 1, 1))
    distance = np.linalg.norm(place, axis=0)
    inside = (distance < radius).astype(float)
    near = np.abs(distance - radius) < 1
    step = (np.arange(15) + 0.5) / 15 - 0.5
    cube = np.stack(np.meshgrid(step, step, step), -1).reshape(-1, 3)
    points = place[:, near].T
    inside[near] = [(np.linalg.norm(point + cube, axis=1) < radius).mean() for point in points]
    return 1 + (eps - 1) * inside, 1 + (1 / eps - 1) * inside, place / np.maximum(distance, 1e-9)


def test_a_curved_surface_has_the_tensor_of_both_means_by_its_normal():
    """Diagonal at edges; at nodes the rest, a quarter for each of the eight edges across an edge. Lines and a gradient
    over two cells take the place of the integral, of a sphere with a radius of seven cells."""
    eps, centre, radius = 3.0, np.array([14.8, 15.3, 15.1]), 7.0
    ball = shapes.sphere(radius, facets=20_000, rotation=(0.3, 0.5, -0.2)).triangles
    ball = ball * (4 * np.pi / 3 * radius**3 / (np.linalg.det(ball).sum() / 6)) ** (1 / 3)
    target = bodies(GRID, [Body(CELL * (ball + centre), eps)], LONG)
    made = permittivity(target)
    coupling = np.zeros((4, 3, *GRID.shape))
    coupling.reshape(4, -1)[:, target.coupled] = target.coupling
    mean, inverse, normal = sampled_sphere(centre, radius, (0, 0, 0), eps)
    rest = inverse - 1 / mean
    assert np.abs(rest).max() > 0.1
    for axis in range(3):
        at_edge = sampled_sphere(centre, radius, 0.5 * (np.arange(3) == axis), eps)
        across = at_edge[2][axis] ** 2
        off = 1 / made[axis] - (across * at_edge[1] + (1 - across) / at_edge[0])
        assert np.abs(off).max() < 0.08 and np.sqrt((off[np.abs(off) > 1e-6] ** 2).mean()) < 0.01
        for first, other in ((0, (axis + 1) % 3), (2, (axis + 2) % 3)):
            element = rest * normal[axis] * normal[other] / 4
            for after in (0, 1):
                off = coupling[first + after, axis] - np.roll(element, -after, axis=axis)
                assert np.abs(off).max() < 0.02 and np.sqrt((off[np.abs(off) > 1e-9] ** 2).mean()) < 0.003


def test_weights_of_lossy_bodies_have_their_phase_at_the_frequency_of_the_permittivity():
    """w + v (1 - d)/(1 - d exp(-j omega dt)), omega where |K| averaged over directions is that of K."""
    wanted = np.array([0.3 - 0.2j, -0.1 + 0.05j, 0.2])
    weights, lagging, keep = _dielectrics.lagging_weights(GRID, wanted, K)
    turn = 2 * np.arcsin(COURANT * np.sqrt(6 * (1 - np.sin(K * CELL) / (K * CELL))) / 2)
    assert np.isclose(turn, K * CELL * COURANT, rtol=0.02) and lagging[2] == 0 and weights[2] == 0.2
    assert np.allclose(weights + lagging * (1 - keep) / (1 - keep * np.exp(-1j * turn)), wanted)


def test_slabs_of_few_planes_give_the_same_lists(monkeypatch):
    ball = shapes.sphere(0.62, facets=500, position=(1.5, 1.5, 1.6), rotation=(0.3, 0.5, -0.2)).triangles
    parts = [Body(box((3, 9, 3), (14, 16, 25))), Body(ball, 2.5 - 0.3j)]
    whole = bodies(GRID, parts, K)
    monkeypatch.setattr(_dielectrics, "SLAB", 1)
    slabs = bodies(GRID, parts, K)
    for name in ("edges", "share", "coupled", "coupling"):
        assert np.array_equal(getattr(slabs, name), getattr(whole, name))


@pytest.mark.parametrize("eps", [2.0, 12.0, 80.0])
def test_the_inverse_permittivity_is_symmetric_and_positive_so_that_the_grid_is_stable(eps):
    """As a matrix over all edges, made from the lists entry by entry."""
    turned = shapes.box((0.4, 0.5, 0.35), position=(0, 0, -0.17)).triangles @ rotation(np.array([0.4, 0.6, 0.2])).T
    target = bodies(GRID, [Body(turned + 1.5, eps)], LONG / 10)
    number = {int(at): n for n, at in enumerate(target.edges)}
    matrix = np.diag(target.share[1])
    for at, weights in zip(target.coupled, target.coupling.T, strict=True):
        axis, *node = np.unravel_index(at, (3, *GRID.shape))
        for first, other in ((0, (axis + 1) % 3), (2, (axis + 2) % 3)):
            for after in (0, 1):
                for before in (0, 1):
                    place = np.array(node)
                    place[axis] += after
                    place[other] -= before
                    across = number.get(int(np.ravel_multi_index((other, *place), (3, *GRID.shape))))
                    if across is None:
                        assert weights[first + after] == 0
                    else:
                        matrix[number[int(at)], across] += weights[first + after]
    assert len(target.coupled) > 300 and np.abs(matrix - matrix.T).max() < 1e-6
    values = np.linalg.eigvalsh(matrix)
    assert values.min() > 0.01 / eps and values.max() < 1.5


def test_waves_in_a_body_have_their_wavelength_on_the_grid():
    """At a wavenumber m k, |K|^2 averaged over directions is the permittivity on the grid times that in vacuum."""
    directions = np.random.default_rng(3).normal(size=(20_000, 3))
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    vacuum, inside = (
        np.mean([(grid_vector(GRID, np.array([m * K]), d) ** 2).sum() for d in directions]) for m in (1, 2)
    )
    made = permittivity(bodies(GRID, [Body(box((6, 6, 6), (20, 20, 20)), 4.0)], K))
    assert np.isclose(made[0, 12, 13, 13], inside / vacuum, rtol=1e-3) and inside / vacuum < 3.97


def test_the_later_of_two_dielectrics_holds_and_the_core_of_a_coating_is_its_own():
    coating, core = box((6, 6, 6), (20, 20, 20)), box((10, 10, 10), (16, 16, 16))
    made = permittivity(bodies(GRID, [Body(coating, 2.0), Body(core, 5.0)], LONG))
    assert np.isclose(made[0, 12, 13, 13], 5) and np.isclose(made[0, 7, 13, 13], 2) and made[0, 22, 13, 13] == 1
    hidden = permittivity(bodies(GRID, [Body(core, 5.0), Body(coating, 2.0)], LONG))
    assert np.isclose(hidden[0, 12, 13, 13], 2) and set(np.unique(hidden).round(6)) <= set(
        np.unique(permittivity(bodies(GRID, [Body(coating, 2.0)], LONG))).round(6)
    )


@pytest.mark.parametrize("metal_first", [True, False])
def test_a_conductor_in_a_dielectric_takes_its_edges(metal_first):
    ball = shapes.sphere(0.62, facets=500, position=(1.5, 1.5, 1.6), rotation=(0.3, 0.5, -0.2)).triangles
    parts = [Body(ball), Body(box((6.3, 6.3, 6.3), (24.2, 24.2, 25.4)), 2.5)]
    made, alone = (bodies(GRID, some, LONG) for some in (parts if metal_first else parts[::-1], parts[:1]))
    n = len(alone.edges)
    assert np.array_equal(made.edges[:n], alone.edges) and np.array_equal(made.weight, alone.weight)
    assert len(np.unique(made.edges)) == len(made.edges) > n
    assert (made.share[1, n:] > 0).all()
    inner = np.linalg.norm(GRID.positions(made.edges[n:], magnetic=False) - [1.5, 1.5, 1.6], axis=1)
    assert inner.min() > 0.62 - CELL  # cut edges have their middle inside
    near = inner < 0.75
    assert near.sum() > 300 and np.allclose(made.share[1, n:][near], 1 / 2.5)


def test_losses_are_those_of_the_permittivity_at_the_frequency_of_the_run():
    """X/(change of E) of E = p E_old + q (E_old + X) for a wave of |K| averaged over directions is eps' - j eps''."""
    directions = np.random.default_rng(3).normal(size=(20_000, 3))
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    square = np.mean([(grid_vector(GRID, np.array([K]), d) ** 2).sum() for d in directions])
    turn = np.exp(2j * np.arcsin(COURANT * CELL * np.sqrt(square) / 2))
    eps = np.array([3 - 0.7j, 1.5 - 4j])
    sigma = _dielectrics.conductivities(GRID, eps, K)
    p, q = material_edges(GRID, np.arange(2), eps.real, sigma).share
    assert np.allclose((turn - p - q) / (q * (turn - 1)), eps, rtol=1e-3)


def test_permittivities_that_no_passive_body_has_are_refused():
    body = box((8, 8, 8), (20, 20, 20))
    for value in (0.5, 3 + 1j, np.inf):
        with pytest.raises(
            ValueError, match=r"parts\[1\] has permittivity .* at least 1 and eps'' at least 0, or None"
        ):
            bodies(GRID, [Body(body), Body(body, value)], K)


def test_cells_too_large_for_the_waves_in_a_body_are_refused_with_the_size_that_fits():
    body = box((8, 8, 8), (20, 20, 20))
    with pytest.raises(ValueError, match=r"leaves 3\.3 cells of 0\.1 m per .* cells of at most 0\.0833 m, or None"):
        bodies(GRID, [Body(body, 36.0)], K)
    assert len(bodies(Lattice(0.08, (40, 40, 48), np.zeros(3)), [Body(body, 36.0)], K).edges) > 1000


def test_an_open_dielectric_is_refused_by_its_number():
    with pytest.raises(ValueError, match=r"parts\[1\]: triangles are open at"):
        bodies(GRID, [Body(box((8, 8, 8), (12, 12, 12))), Body(box((14, 8, 8), (20, 20, 20))[1:], 3.0)], K)
