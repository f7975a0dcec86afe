"""The random surface of a scene follows from scene, seed and waveform alone."""

from __future__ import annotations

import numpy as np
import pytest
from helpers.cases import thinned

import sarcl
from sarcl.scattering.random_surface import cell_edge, pieces_of

CHIRP = sarcl.Waveform.chirp(center=9.6e9, bandwidth=300e6, duration=1e-6)
ROUGH = sarcl.Material(eps_r=4.0, conductivity=1e-3, diagram="cos2")
MIXED = sarcl.Material(eps_r=4.0, conductivity=1e-3, height=3e-3, diagram="cos2")
GIVEN = {"reference": (0, 0, 0), "range_window": (-6, 6)}


def flat(material, roughness=0.0, extent=4.0):
    axis = np.linspace(-extent / 2, extent / 2, 5)
    return sarcl.Scene.from_heights(axis, axis, np.zeros((5, 5)), material=material, roughness=roughness)


def track(distance=4000.0, n=8, turn=0.05, azimuth=0.3):
    angle = azimuth + turn * (np.arange(n) / max(n - 1, 1) - 0.5)
    places = distance * np.c_[0.7 * np.cos(angle), 0.7 * np.sin(angle), np.full(n, 0.714)]
    return sarcl.Trajectory(np.arange(n) * 1e-2, places)


SURFACES = {
    "rough": flat(ROUGH),
    "slightly rough": flat(MIXED),
    "random heights": flat("metal", 0.01),
    "slightly rough, random heights": flat(MIXED, 0.01),
}


@pytest.mark.parametrize(
    "name, other", thinned(SURFACES, [{"tolerance": 1e-2}, {"max_edge": 0.11}, {"max_bytes": 1e8}])
)
def test_tolerance_max_edge_and_max_bytes_leave_the_surface_as_it_is(name, other):
    scene = SURFACES[name]
    one = sarcl.echo(scene, CHIRP, track(), tolerance=5e-2, seed=3, **GIVEN)
    two = sarcl.echo(scene, CHIRP, track(), **{"tolerance": 5e-2, "seed": 3, **GIVEN, **other})
    asked = 5e-2 + other.get("tolerance", 5e-2)
    assert np.linalg.norm(one.samples - two.samples) <= asked * np.linalg.norm(two.samples)


def test_cells_beside_their_coherent_pieces_add_the_incoherent_part_alone():
    """Near the normal, where the coherent part is the larger one: pieces that are cells, and cells with pieces."""
    above = sarcl.Trajectory(np.arange(4) * 1e-2, [[40.0 * i, 10.0, 4e3] for i in range(4)])
    options = {"tolerance": 2e-2, "shadows": False, "seed": 3, **GIVEN}
    one, two = (sarcl.echo(SURFACES["slightly rough"], CHIRP, above, max_edge=edge, **options) for edge in (0.26, 0.09))
    assert two.report.plan["facets"] > 4 * one.report.plan["facets"]
    assert np.linalg.norm(one.samples - two.samples) <= 4e-2 * np.linalg.norm(two.samples)


@pytest.mark.parametrize("name", SURFACES)
def test_the_seed_names_the_surface(name):
    one, two = (
        sarcl.echo(SURFACES[name], CHIRP, track(), tolerance=5e-2, seed=seed, **GIVEN).samples for seed in (3, 4)
    )
    assert np.linalg.norm(one - two) > 0.3 * np.linalg.norm(one)


@pytest.mark.parametrize("name", SURFACES)
def test_pieces_add_up_to_the_same_echo_however_finely_coherent_parts_are_cut(name):
    """In float64, of pieces a wavelength apart: random heights and amplitudes are those of the cells."""
    from sarcl.scattering.facets import FacetSet
    from sarcl.scene.triangles import normals

    def echo(edge):
        pieces = pieces_of(SURFACES[name], cell_edge(CHIRP), edge, 5)
        moved = pieces.scene.triangles + (pieces.height[:, None] * normals(pieces.scene.triangles))[:, None]
        n = len(moved)
        facets = FacetSet(
            moved, pieces.scene.reflectivity, pieces.scene.two_sided, pieces.scene.material, pieces.scene.materials,
            None, np.arange(n), pieces.random, incoherent=pieces.incoherent,
        )  # fmt: skip
        made = facets.amplitudes(antenna, antenna, np.array([9.6e9]), ("VV",), np.array([0.0, 0, 1]))[0, :, 0]
        away = np.linalg.norm(moved.mean(axis=1) - antenna, axis=1) - np.linalg.norm(antenna)
        return n, (made * np.exp(-4j * np.pi * 9.6e9 / sarcl.base.constants.SPEED_OF_LIGHT * away)).sum()

    antenna = np.array([3e4, 1e4, 4e4])  # far enough for linear phases over pieces of any size
    few, coarse = echo(np.inf)
    many, fine = echo(0.05)
    assert many >= 2 * few or name == "rough"
    assert abs(fine - coarse) <= 3e-3 * abs(coarse)


def test_two_passes_and_two_tolerances_share_their_cells():
    places = [pieces_of(SURFACES["slightly rough"], cell_edge(CHIRP), edge, 1) for edge in (np.inf, 0.1, 0.03)]
    cells = [np.sort(pieces.cells.triangles.mean(axis=1), axis=0) for pieces in places]
    assert np.array_equal(cells[0], cells[1]) and np.array_equal(cells[1], cells[2])
    random = [np.sort_complex(pieces.random[pieces.random != 0]) for pieces in places]
    assert np.array_equal(random[0], random[1]) and np.array_equal(random[1], random[2])


def test_facets_that_are_not_random_stay_whole_and_in_their_order():
    scene = flat("metal")
    pieces = pieces_of(scene, 0.1, np.inf, 0)
    assert np.array_equal(pieces.scene.triangles, scene.triangles)
    assert not pieces.random.any() and not pieces.height.any() and not pieces.incoherent.any()
