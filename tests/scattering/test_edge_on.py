"""Facets that are edge-on to an antenna: physical optics fades there, and rounding decides nothing."""

from __future__ import annotations

import numpy as np
import pytest
from helpers.cases import thinned
from helpers.facet_cases import CONDUCTOR, WET, echo_and_integral, plate, random_units, still

import sarcl
from sarcl.base.constants import EDGE_ON, SPEED_OF_LIGHT
from sarcl.base.vectors import unit
from sarcl.numerics.pulse_geometry import PulseGeometry
from sarcl.scattering.facets import FacetSet
from sarcl.scattering.physical_optics import lit_share, scattering_matrix, turned
from sarcl.scattering.scatterers import faces_away
from sarcl.scene.triangles import normals
from sarcl.visibility.illumination import lit

TONE = sarcl.Waveform.chirp(center=9.6e9, bandwidth=1e6, duration=1e-6)
# transmitter and receiver in the planes of faces of a box, one of them, and the other way round
ALONG, ASIDE = np.array([1e7, 0.0, 0.0]), np.array([6e3, 8e3, 1e3])
UP = np.array([0.0, 0.0, 1.0])
NAMES = ("HH", "VV")


def rotated(triangles, seed):
    """Triangles turned by 1e-7 rad about a random axis; seed 0: as they are."""
    a, b, c = random_units(np.random.default_rng(seed), 1)[0] * 1e-7 * (seed > 0)
    return triangles @ (np.eye(3) + np.array([[0, -c, b], [c, 0, -a], [-b, a, 0]])).T


def box(side=1.0):
    """A cube about the origin: turned about it, nothing moves by more than a millionth of a wavelength."""
    corners = sarcl.shapes.box((side, side, side)).triangles
    return corners - corners.reshape(-1, 3).mean(axis=0)


def around(angle, chord):
    """Directions to two antennas `chord` apart, the first `angle` off the plane z = 0, the second well above it."""
    height = min(0.4, chord / 2)
    across = np.sqrt(1 - height**2)
    u = np.array([np.cos(angle), 0.0, np.sin(angle)])
    turn = 2 * np.arcsin(min(np.sqrt(max(chord**2 - height**2, 0.0)) / (2 * across), 1.0))
    return u, np.array([across * np.cos(turn), across * np.sin(turn), height])


@pytest.mark.parametrize("ends", [(ALONG, ASIDE), (ASIDE, ALONG)])
@pytest.mark.parametrize("two_sided", [False, True])
def test_turning_a_box_by_the_rounding_of_its_corners_changes_no_sum_of_its_facets(ends, two_sided):
    """In float64, polarisations together; physical optics without the rule: by up to 28 %."""
    sums = []
    for seed in range(30):
        triangles, k = rotated(box(), seed), np.arange(12)
        part = FacetSet(
            triangles, np.ones(12), np.full(12, two_sided), np.zeros(12, int), (sarcl.Material(),), None, k, np.zeros(0)
        )
        middle = triangles.mean(axis=1)
        path = sum(np.linalg.norm(end - middle, axis=1) - np.linalg.norm(end) for end in ends)
        made = part.amplitudes(*ends, np.array([9.6e9]), NAMES, UP)[0]
        sums.append(np.exp(-2j * np.pi * 9.6e9 / SPEED_OF_LIGHT * path) @ made)
    assert np.abs(sums[0]).min() > 1e-3
    assert (np.abs(np.array(sums) - sums[0]) <= 1e-4 * np.abs(sums[0])).all()


@pytest.mark.parametrize("ends", [(ALONG, ASIDE), (ASIDE, ALONG)], ids=["transmitter", "receiver"])
@pytest.mark.parametrize("shadows, two_sided", thinned([False, True], [False, True]))
def test_echoes_of_a_box_edge_on_do_not_hinge_on_rounding(ends, shadows, two_sided):
    rows = []
    for seed in range(4):
        scene = sarcl.Scene.facets(rotated(box(0.1), seed), two_sided=two_sided)
        raw = sarcl.echo(
            scene, TONE, still(ends[0]), receiver=still(ends[1]), polarization=NAMES, tolerance=1e-4, shadows=shadows,
            range_window=(-5, 5), check=False,
        )  # fmt: skip
        rows.append(raw.samples[:, raw.n_samples // 2])
    assert (np.abs(np.array(rows) - rows[0]) <= 1e-4 * np.abs(rows[0])).all()


@pytest.mark.parametrize("ends", [(ALONG, ASIDE), (ASIDE, ALONG)], ids=["transmitter", "receiver"])
@pytest.mark.parametrize("two_sided", [False, True])
def test_faces_edge_on_are_lit_or_dark_whatever_the_rounding(ends, two_sided):
    shares = [
        lit(rotated(box(), seed), ends[0][None], ends[1][None], two_sided=two_sided).share(0) for seed in range(12)
    ]
    assert all((share == shares[0]).all() for share in shares)
    # two faces lie in planes that hold the one antenna, and are seen by the other: those towards y and z
    outward = normals(box())
    assert (shares[0][(outward[:, 1:] > 0.5).any(axis=1)] == 255).all()
    assert (shares[0][(outward[:, 1:] < -0.5).any(axis=1)] == 0).all()


@pytest.mark.parametrize("chord, permittivity", thinned([1e-3, 0.1, 1.0, 1.8], [CONDUCTOR, 5 - 2j]))
def test_the_echo_is_half_in_the_plane_and_changes_evenly_across_it(permittivity, chord):
    wide = EDGE_ON * chord
    angles = np.linspace(-2 * wide, 2 * wide, 401)
    for swap in (False, True):
        rows = []
        for angle in angles:
            u, r = around(angle, chord)
            rows.append(scattering_matrix(UP, *((r, u) if swap else (u, r)), permittivity, (0.0, 1.0, 0.0)))
        rows = np.array(rows)
        assert (rows[angles < -1.1 * wide] == 0).all()
        # an even ramp of a value that is at most 2 |u_t - u_r| in the plane, and grows by at most 2 per radian
        most = chord / wide + 4
        assert np.abs(np.diff(rows, axis=0)).max() <= most * (angles[1] - angles[0])
        if permittivity == CONDUCTOR:
            above = rows[np.argmin(np.abs(angles - 1.2 * wide))]
            assert np.abs(rows[200] - above / 2).max() <= 2.5 * wide
            assert np.abs(rows[200]).max() > 0.01 * chord


def test_one_antenna_sees_the_cosine_as_it_is():
    random = np.random.default_rng(1)
    normal, cosine = random_units(random, 2000), random.uniform(-2 * EDGE_ON, 2 * EDGE_ON, (2000, 1))
    u = cosine * normal + np.sqrt(1 - cosine**2) * unit(np.cross(normal, random_units(random, 2000)))
    wanted = 2 * np.maximum((normal * u).sum(axis=1), 0)[:, None, None] * np.eye(2)
    assert np.abs(scattering_matrix(normal, u, u, CONDUCTOR) - wanted).max() < 1e-12
    assert (lit_share(normal, u, u) == ((normal * u).sum(axis=1) > 0)).all()


def test_both_sides_of_a_sheet_fade_into_each_other():
    """A conducting sheet with both antennas near its plane: one value from either side, none in the plane."""
    for first in np.linspace(-1.2, 1.2, 7) * EDGE_ON:
        rows = []
        for second in first + np.linspace(-4, 4, 201) * EDGE_ON:
            u, r = (unit(np.array([*way, height])) for way, height in (((1, 0), first), ((0, 1), second)))
            normal = -UP if turned(UP, u, r) else UP
            rows.append(scattering_matrix(normal, u, r, CONDUCTOR, (0.0, 0.0, 1.0)))
        assert np.abs(np.diff(np.array(rows), axis=0)).max() <= 2.1 * 0.04 / np.sqrt(2)
    u, r = np.eye(3)[:2]
    assert (scattering_matrix(UP, u, r, CONDUCTOR) == 0).all()


@pytest.mark.parametrize("material", [sarcl.Material(), WET], ids=["metal", "soil"])
def test_the_echo_of_a_plate_edge_on_is_that_of_the_integral(material):
    scene = sarcl.Scene.facets(plate(0.5), material=material, two_sided=False)
    tx, rx = np.array([5e3, 1e3, 4.0]), np.array([1e3, 4e3, 2e3])  # at grazing incidence soil takes all off
    got, wanted = echo_and_integral(scene, TONE, tx, rx, (0.6, 0.0, 0.8), tolerance=1e-3, shadows=True)
    assert np.linalg.norm(wanted) > 0
    assert np.linalg.norm(got - wanted) <= 1e-3 * np.linalg.norm(wanted)


def test_facets_turned_away_by_less_than_the_ramp_are_not_left_out():
    centers, chord = np.zeros((3, 3)), np.linalg.norm(unit(ALONG) - unit(ASIDE))
    angles = np.array([0.0, 0.9 * EDGE_ON * chord, 2.1 * EDGE_ON])
    normals = np.stack([-np.sin(angles), np.cos(angles), np.zeros(3)], axis=1)
    ends = PulseGeometry(1e9 * unit(ALONG)[None], 1e9 * unit(ASIDE)[None])
    assert faces_away(centers, normals, ends).tolist() == [False, False, True]
    assert (lit_share(normals, unit(ALONG), unit(ASIDE)) > 0).tolist() == [True, True, False]
    alone = PulseGeometry(1e9 * unit(ALONG)[None], 1e9 * unit(ALONG)[None])
    assert faces_away(centers, normals, alone).tolist() == [False, True, True]
