"""Forward scatter: the field of a body's shadow, and what stands in its way."""

from __future__ import annotations

import numpy as np
import pytest

import sarcl
from sarcl import shapes
from sarcl.base.constants import SPEED_OF_LIGHT
from sarcl.reference.facet import facet_amplitude
from sarcl.reference.lit_part import lit_part
from sarcl.reference.mie import conducting_sphere

KA = 64.4
FREQUENCY = KA * SPEED_OF_LIGHT / (2 * np.pi)  # of a sphere of 1 m
ANGLES = np.arange(0.0, 181.0, 2.0)  # degrees, bistatic
TOLERANCE = {
    "H plane": 0.3,  # dB, to 120 deg: physical optics against Mie
    "E plane": 1.0,  # dB rms, to 120 deg: the creeping wave and the tilt of the currents
    "forward": 0.2,  # dB, at 180 deg: the shadow's edge
    "lit part": 1e-6,  # relative: complex64
}


def test_a_sphere_follows_mie_to_the_forward_direction():
    ball = shapes.sphere(1.0, facets=20_000)
    looks = {"receiver": (np.radians(ANGLES), 0.0), "polarization": ("HH", "VV"), "forward": True}
    s = sarcl.rcs(ball, 0.0, 0.0, FREQUENCY, shadows=False, **looks)  # nothing shades a convex body but itself
    # V stands across the plane of both directions, H lies in it and turns with the line of sight
    across, along = conducting_sphere(1.0, KA, np.pi - np.radians(ANGLES))
    e_plane, h_plane = (20 * np.log10(np.abs(a / b)) for a, b in ((s[:, 0], -along), (s[:, 1], across)))
    near = ANGLES <= 120
    assert np.abs(h_plane[near]).max() < TOLERANCE["H plane"]
    assert np.sqrt((e_plane[near] ** 2).mean()) < TOLERANCE["E plane"]
    assert max(abs(h_plane[-1]), abs(e_plane[-1])) < TOLERANCE["forward"]
    assert np.angle(s[-1] / np.array([-along[-1], across[-1]])) == pytest.approx(0, abs=np.radians(10))


def test_shadows_change_nothing_on_a_convex_body():
    ball, receiver = shapes.sphere(1.0, facets=320), (np.linspace(0.2, 3.0, 5), 0.1)
    values = [
        sarcl.rcs(ball, 0.3, 0.2, 1e8, receiver=receiver, forward=True, shadows=shadows) for shadows in (True, False)
    ]
    assert values[0] == pytest.approx(values[1], rel=TOLERANCE["lit part"])


def test_of_its_own_body_a_facet_in_the_transmitters_shadow_sends_nothing():
    """Seen from behind, one plate of a dihedral hides all of the other."""
    corner, hidden = shapes.dihedral((1.0, 1.0)), (np.pi, 0.3)
    receiver = (np.linspace(0.2, 2.9, 5), 0.4)
    s = sarcl.rcs(corner, *hidden, FREQUENCY, receiver=receiver, forward=True)
    wall = corner.part(np.abs(corner.triangles[:, :, 0]).max(axis=1) == 0)
    assert s == pytest.approx(sarcl.rcs(wall, *hidden, FREQUENCY, receiver=receiver, forward=True), rel=1e-6)


def test_what_a_sheet_blocks_is_what_it_sends_forward():
    """4 pi A^2/lambda^2 behind a plate face on, in every linear polarisation: Babinet."""
    plate = shapes.plate((1.0, 0.7))
    s = sarcl.rcs(plate, 0.0, np.pi / 2, FREQUENCY, receiver=(0.0, -np.pi / 2), polarization=("HH", "VV"), forward=True)
    assert np.abs(s) ** 2 == pytest.approx(4 * np.pi * (0.7 * FREQUENCY / SPEED_OF_LIGHT) ** 2, rel=1e-9)
    with pytest.warns(sarcl.SarclWarning, match="reach 180 deg, .*pass forward=True"):
        assert sarcl.rcs(plate, 0.0, np.pi / 2, FREQUENCY, receiver=(0.0, -np.pi / 2)) == 0


def test_one_antenna_sees_the_same_to_the_bit():
    scene = shapes.box((1, 0.6, 0.5)) + shapes.plate((2, 2)).moved((0, 0, -0.1))
    azimuth = np.linspace(0, 6, 7)
    values = [sarcl.rcs(scene, azimuth, 0.4, FREQUENCY, polarization="all", forward=f) for f in (False, True)]
    assert np.array_equal(*values)


def test_other_bodies_block_the_receiver_and_the_own_body_does_not():
    """A box in front of the transmitter, with a large plate behind it or beside: the plate hides what it covers."""
    k, box = 2 * np.pi * FREQUENCY / SPEED_OF_LIGHT, shapes.box((0.4, 0.3, 0.2), position=(0, 0, 1.0))
    looks = (0.3, 1.2), (2.9, -1.0)  # azimuth, elevation: transmitter from above, receiver from below
    alone = sarcl.rcs(box, *looks[0], FREQUENCY, receiver=looks[1], forward=True)
    lid = shapes.plate((40.0, 40.0), position=(0, 0, -1.0))
    both = sarcl.rcs(box + lid, *looks[0], FREQUENCY, receiver=looks[1], forward=True)
    plate = sarcl.rcs(lid, *looks[0], FREQUENCY, receiver=looks[1], forward=True)
    assert abs(alone) > 0.1
    # the plate is lit but for the box's shadow, and the box behind it is not seen
    u_t, u_r = (np.array([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)]) for a, e in looks)
    shadow = 0j
    for facet in lid.triangles:
        whole = facet_amplitude_forward(facet, u_t, u_r)
        mean = [
            lit_part(facet, solid, [1e12 * u_t, 1e12 * u_r], np.array([k]), 1e-9, np.zeros(len(solid), bool))[1][0]
            for solid in (box.triangles, box.triangles[:0])
        ]
        shadow += whole * (mean[0] / mean[1] - 1) * np.exp(1j * k * (u_t + u_r) @ facet.mean(axis=0))
    assert abs(shadow) > 0.1
    assert both == pytest.approx(plate + shadow, abs=1e-5 * abs(plate))


def facet_amplitude_forward(facet, u_t, u_r):
    """HH of a conducting facet that the transmitter lights, whatever side the receiver is on: by its plane currents."""
    from sarcl.scattering.physical_optics import normals_and_areas, scattering_matrix, triangle_integral

    k, normal = 2 * np.pi * FREQUENCY / SPEED_OF_LIGHT, normals_and_areas(facet[None])[0]
    matrix = scattering_matrix(normal, u_t, u_r, np.array(np.inf), forward=True)[0, 0, 0]
    return k / (2 * np.sqrt(np.pi)) * matrix * triangle_integral(facet[None], k * (u_t + u_r))[0]


def test_forward_currents_radiate_as_a_plane_sheet_of_them_does():
    """S of a conductor is e_r.(2 n x eta H_i x ...): e_r.J eta with J = 2 n x H_i, from the definition."""
    random = np.random.default_rng(4)
    for _ in range(20):
        u_t, u_r = (v / np.linalg.norm(v) for v in random.standard_normal((2, 3)))
        facet = random.standard_normal((3, 3))
        normal = np.cross(facet[1] - facet[0], facet[2] - facet[0])
        if normal @ u_t < 0.1:
            continue
        normal /= np.linalg.norm(normal)
        up = np.array([0.0, 0, 1])
        h_t, h_r = (np.cross(s, up) / np.linalg.norm(np.cross(s, up)) for s in (-u_t, -u_r))
        current = 2 * np.cross(normal, np.cross(-u_t, h_t))  # eta J of an H-polarised wave of 1 V/m
        k = 2 * np.pi * FREQUENCY / SPEED_OF_LIGHT
        whole = facet_amplitude_forward(facet, u_t, u_r)
        if (normal @ u_r) > 0.1:
            same = facet_amplitude(facet[None], np.array(np.inf), FREQUENCY, u_t, u_r)[0, 0, 0]
            assert whole == pytest.approx(same, rel=1e-12)
        from sarcl.scattering.physical_optics import triangle_integral

        integral = triangle_integral(facet[None], k * (u_t + u_r))[0]
        assert whole == pytest.approx(k / (2 * np.sqrt(np.pi)) * (h_r @ current) * integral, rel=1e-9)


def test_a_scene_of_several_bodies_is_recomputed_within_the_tolerance():
    """Among them a body that is hidden from one antenna, and a sheet; the check recomputes shadows by the reference."""
    scene = (
        shapes.box((1, 0.6, 0.5))
        + shapes.plate((2, 2)).moved((0, 0, -0.4))
        + shapes.box((0.3, 0.3, 0.3)).moved((0.9, 0.1, 0.2))
    )
    azimuth = np.linspace(0, 6, 9)
    receiver = azimuth + 2.5, -0.3
    s = sarcl.rcs(scene, azimuth, 0.5, 2e9, receiver=receiver, forward=True, check=True, tolerance=1e-6)
    less = sarcl.rcs(scene, azimuth, 0.5, 2e9, receiver=receiver, forward=True, shadows=False)
    assert np.linalg.norm(s - less) > 0.05 * np.linalg.norm(s)
