"""Metal beside dielectrics: mirrored and translated pairs of bodies have mirrored and translated coefficients."""

from __future__ import annotations

import numpy as np
import pytest

from sarcl import shapes
from sarcl.fullwave.bodies.materials import Body, bodies
from sarcl.fullwave.lattice import Lattice

CELLS = 48  # along each side of the grid
GRID = Lattice(1.0, (CELLS, CELLS, CELLS), np.zeros(3))
K = 2 * np.pi / 20  # rad/m


def pair(seed):
    """Facets (k, 3, 3) of a metal body and of a dielectric one: apart, touching, or one sticking out of the other."""
    rng, out = np.random.default_rng(seed), []
    for _ in range(2):
        size = rng.uniform(3, 14, 3)
        centre = rng.uniform(13, CELLS - 13, 3)
        if rng.integers(2):
            body = shapes.box(size, position=centre - [0, 0, size[2] / 2])
        else:
            body = shapes.sphere(size[0] / 2, facets=200, position=centre, rotation=(0.3, 0.5, -0.2))
        out.append(body.triangles)
    return out


def coefficients(metal, dielectric):
    """Of every edge (2, 3, *shape), of every face, and of coupled edges (4, 3, *shape), as Fields takes them."""
    made = bodies(GRID, [Body(metal), Body(dielectric, 2.5 - 0.3j)], K)
    edges, faces = np.zeros((2, 3, *GRID.shape)), np.ones((4, 3, *GRID.shape))
    edges[1] = 1
    coupling = np.zeros_like(faces)
    lists = (edges, made.edges, made.share), (faces, made.faces, made.weight), (coupling, made.coupled, made.coupling)
    for out, at, values in lists:
        assert len(np.unique(at)) == len(at)
        out.reshape(len(out), -1)[:, at] = values
    assert np.isin(made.coupled, made.edges).all()
    return edges, faces, coupling


def mirrored_body(triangles, axis):
    """The body of which node n is node CELLS - n, wound outwards."""
    out = triangles.copy()
    out[..., axis] = CELLS - out[..., axis]
    return out[:, ::-1]


def mirrored_values(values, axis, magnetic):
    """Values (n, 3, *shape) of components between nodes n and n + 1 along `axis`, or on them, of the mirrored grid."""
    out = values.copy()
    for component in range(3):
        flipped = np.flip(values[:, component], axis + 1)
        on_nodes = (component == axis) == magnetic
        out[:, component] = np.roll(flipped, 1, axis + 1) if on_nodes else flipped
    return out


def mirrored_weights(weight, axis):
    """Weights of faces (4, 3, *shape), of their edges c(+b), c, b(+c), b, on the mirrored grid."""
    out = mirrored_values(weight, axis, magnetic=True)
    for component in range(3):
        if component != axis:
            first = 0 if (component + 1) % 3 == axis else 2
            out[[first, first + 1], component] = out[[first + 1, first], component]
    return out


def mirrored_coupling(weight, axis):
    """Weights (4, 3, *shape) of the axes after an edge's own, before and after it, on the mirrored grid."""
    out = mirrored_values(weight, axis, magnetic=False)
    for component in range(3):
        if component == axis:
            out[:, component] = -out[[1, 0, 3, 2], component]
        else:
            first = 0 if (component + 1) % 3 == axis else 2
            out[first : first + 2, component] *= -1
    return out


@pytest.mark.parametrize("seed", [pytest.param(n, marks=pytest.mark.slow if n >= 15 else ()) for n in range(50)])
def test_a_mirrored_pair_of_bodies_has_mirrored_coefficients_and_a_translated_one_the_same(seed):
    metal, dielectric = pair(seed)
    edges, faces, coupling = coefficients(metal, dielectric)
    axis = seed % 3
    got = coefficients(mirrored_body(metal, axis), mirrored_body(dielectric, axis))
    assert np.abs(got[0] - mirrored_values(edges, axis, magnetic=False)).max() < 1e-5
    assert np.abs(got[1] - mirrored_weights(faces, axis)).max() < 1e-5
    assert np.abs(got[2] - mirrored_coupling(coupling, axis)).max() < 1e-5
    steps = np.random.default_rng(seed).integers(-5, 6, 3)
    moved = coefficients(metal + steps, dielectric + steps)
    for values, wanted in zip(moved, (edges, faces, coupling), strict=True):
        assert np.abs(values - np.roll(wanted, steps, axis=(2, 3, 4))).max() < 1e-5


@pytest.mark.parametrize("seed", range(10))
def test_edges_outside_conductors_have_the_permittivity_of_the_dielectric_alone(seed):
    """Far from the surface of the metal, the list of both is that of the dielectric."""
    metal, dielectric = pair(seed)
    both = coefficients(metal, dielectric)[0]
    alone = bodies(GRID, [Body(dielectric, 2.5 - 0.3j)], K)
    wanted = np.zeros_like(both)
    wanted[1] = 1
    wanted.reshape(2, -1)[:, alone.edges] = alone.share
    low, high = metal.min(axis=(0, 1)) - 2, metal.max(axis=(0, 1)) + 2
    place = np.moveaxis(np.indices(GRID.shape), 0, -1)
    far = ((place < low) | (place > high)).any(axis=-1)
    assert np.array_equal(both[:, :, far], wanted[:, :, far])
