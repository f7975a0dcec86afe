"""rcs(bounces=, edges=): published totals of corner reflectors, edges in closed form, echo from far away, refusals."""

import numpy as np
import pytest

import sarcl
from sarcl import Material, Scene, Trajectory, Waveform, shapes
from sarcl.base.errors import NotApplicable
from sarcl.scattering.edge_diffraction import WedgeShape, edge_matrix
from sarcl.scene.wedges import wedges

F = 9.6e9
DIHEDRAL = shapes.dihedral((1.0, 1.0))
BOX = shapes.box((0.3, 0.2, 0.25), rotation=(0.2, 0.1, 0.4))


def level(s):
    return 20 * np.log10(np.abs(s))


@pytest.mark.parametrize(("elevation", "hh", "vv"), [(45, 44.082, 44.141), (35, 42.317, 42.270), (25, 39.615, 39.666)])
def test_dihedrals_have_the_totals_of_an_independent_beam_tracer(elevation, hh, vv):
    got = sarcl.rcs(DIHEDRAL, 0.0, np.radians(elevation), F, bounces=2, polarization=("HH", "VV", "HV"))
    assert level(got[:2]) == pytest.approx([hh, vv], abs=0.01)
    assert level(got[2]) < -100
    turn = np.degrees(np.angle(got[:2] / [-1, 1]))  # H along the fold, at the origin: signs of a plate, reversed in H
    assert np.abs(turn).max() < 5


def test_a_trihedral_at_boresight():
    got = sarcl.rcs(shapes.trihedral(0.5), np.pi / 4, np.arctan(np.sqrt(0.5)), F, bounces=3, polarization=("HH", "VV"))
    assert level(got) == pytest.approx([24.305, 24.305], abs=0.1)


@pytest.mark.parametrize("receiver", [None, (0.9, 0.2)])
@pytest.mark.parametrize("options", [{"edges": True}, {"bounces": 3}, {"edges": True, "bounces": 2}])
def test_rcs_is_the_echo_from_far_away(options, receiver):
    scene = BOX + shapes.plate((1.0, 1.0), position=(0, 0, -0.3))
    azimuth, elevation, tolerance = np.array([0.3, 0.5]), 0.7, 1e-3
    got = sarcl.rcs(scene, azimuth, elevation, F, receiver=receiver, tolerance=tolerance, **options)

    def track(a, e):
        a, e = np.broadcast_arrays(a, e)
        return Trajectory(
            np.arange(2) / 10, 1e6 * np.stack([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)], 1)
        )

    raw = sarcl.echo(
        scene, Waveform.chirp(center=F, bandwidth=2e6, duration=1e-4), track(azimuth, elevation),
        receiver=None if receiver is None else track(*(np.full(2, angle) for angle in receiver)),
        reference=(0, 0, 0), range_window=(-40, 40), tolerance=tolerance, check=False, **options,
    )  # fmt: skip
    frequencies = raw.frequency[0] + raw.frequency_step[0] * np.arange(raw.n_samples)
    middle = [np.interp(F, frequencies, part) for row in raw.samples for part in (row.real, row.imag)]
    wanted = np.array(middle[::2]) + 1j * np.array(middle[1::2])
    single = sarcl.rcs(scene, azimuth, elevation, F, receiver=receiver)
    assert np.linalg.norm(got - wanted) < 4 * tolerance * np.linalg.norm(wanted) + 1e-3
    assert np.linalg.norm(got - single) > 20 * np.linalg.norm(got - wanted)


def test_edges_of_a_tetrahedron_in_closed_form_at_several_frequencies():
    """Sums over the edges that face the antenna, each a constant times sinc; turned so that none is grazed. Borders of
    triangles meet: no wave from one to another is added."""
    corners = np.array([[0.4, 0.1, 0.0], [-0.2, 0.3, 0.05], [-0.1, -0.35, 0.0], [0.05, 0.0, 0.5]])
    solid = Scene.facets(corners[[[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]]], two_sided=False)
    frequencies, azimuth, elevation = np.array([9e9, 3e9, 10e9]), 0.35, 0.5
    options = {"polarization": ("HH", "HV", "VV"), "tolerance": 1e-4, "shadows": False}
    both, facets = (sarcl.rcs(solid, azimuth, elevation, frequencies, edges=e, **options) for e in (True, False))
    look = np.array([np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)])
    edges = wedges(solid.triangles, solid.two_sided, 0.35)
    looks = np.tile(look, (len(edges), 1))
    matrix = edge_matrix(WedgeShape(edges.inward, edges.normal, edges.number), looks, looks)
    way, k = edges.ends[:, 1] - edges.ends[:, 0], 2 * np.pi * frequencies[:, None] / 299792458.0
    line = np.linalg.norm(way, axis=1) * np.sinc(k * (way @ look) / np.pi)
    line = line * np.exp(2j * k * (edges.ends.mean(axis=1) @ look))
    wanted = np.stack([line @ matrix[:, r, t] for r, t in ((0, 0), (0, 1), (1, 1))], axis=-1)
    assert np.abs(both - facets - wanted).max() < 1e-4 * np.abs(wanted).max()


def test_a_forecast_names_the_terms():
    terms = sarcl.plan(sarcl.rcs, DIHEDRAL, 0.0, 0.7, F, bounces=2, edges=True, tolerance=1e-2).error_terms
    assert {"edges", "bounces", "waves from a distance"} <= {term.name for term in terms}


@pytest.mark.parametrize(
    ("scene", "options", "kind", "words"),
    [
        (DIHEDRAL, {"bounces": 0}, ValueError, "bounces"),
        (DIHEDRAL, {"bounces": 9}, ValueError, "bounces"),
        (DIHEDRAL, {"bounces": 2, "shadows": False}, ValueError, "shadows"),
        (DIHEDRAL, {"edges": "yes"}, TypeError, "edges"),
        (DIHEDRAL, {"bounces": 2, "forward": True, "receiver": (0.1, 0.2)}, NotApplicable, "forward"),
        (DIHEDRAL, {"edges": True, "forward": True, "receiver": (0.1, 0.2)}, NotApplicable, "forward"),
        (
            Scene.facets(DIHEDRAL.triangles, material=Material(3.0, thickness=2e-3)),
            {"bounces": 2}, NotApplicable, "thin sheets.*bounces=2: leave it out",
        ),
        (DIHEDRAL, {"bounces": 2, "check": True}, NotApplicable, "check=True.*bounces=2; leave one out"),
        (DIHEDRAL, {"edges": True, "check": True}, NotApplicable, "check=True.*edges=True; leave one out"),
        (DIHEDRAL, {"bounces": 2, "tolerance": 1e-7}, ValueError, "tolerance"),
    ],
)  # fmt: skip
def test_bad_input(scene, options, kind, words):
    with pytest.raises(kind, match=words):
        sarcl.rcs(scene, 0.0, 0.7, F, **options)


@pytest.mark.parametrize("options", [{"bounces": 2}, {"edges": True}])
def test_a_forecast_holds_the_seconds_of_what_options_add(options):
    directions = np.linspace(-0.2, 0.2, 50), 0.7, F
    alone = sarcl.plan(sarcl.rcs, DIHEDRAL, *directions).seconds  # from a table, not from a measurement
    assert sarcl.plan(sarcl.rcs, DIHEDRAL, *directions, **options).seconds > alone
