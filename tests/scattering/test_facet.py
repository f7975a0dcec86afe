"""Facet physics of sarcl/scattering/physical_optics.py against closed forms and sums in 80 digits."""

from __future__ import annotations

from decimal import Decimal, localcontext

import numpy as np
import pytest
from helpers.facet_cases import CONDUCTOR, UP, adversarial_phases, facing, far_amplitude, plate, quarters, random_units

from sarcl.base.constants import SPEED_OF_LIGHT
from sarcl.scattering import physical_optics


def decibel(x):
    return 10 * np.log10(np.abs(x))


def exact_mean(b, c):
    """2 exp[jx, jy, jz] about the centroid in 80 digits; vertices that coincide are moved 1e-21 apart."""
    with localcontext() as context:
        context.prec = 80
        phases = [Decimal(0), Decimal(float(b)), Decimal(float(c))]
        for i in (1, 2):
            while any(abs(phases[i] - other) < Decimal("1e-21") for other in phases[:i]):
                phases[i] += Decimal("1e-21")
        middle = sum(phases) / 3
        real = imaginary = Decimal(0)
        for i, one in enumerate(phases):
            gap = Decimal("-0.5")
            for j, other in enumerate(phases):
                gap *= 1 if i == j else one - other
            terms = [Decimal(0), Decimal(0)]
            power, k, x = Decimal(1), 0, (one - middle) / 4096
            while abs(power) > Decimal("1e-78") or k < 2:
                terms[k % 2] += -power if k % 4 > 1 else power
                k += 1
                power *= x / k
            for _ in range(12):  # twice the angle, twelve times
                terms = [terms[0] ** 2 - terms[1] ** 2, 2 * terms[0] * terms[1]]
            real += terms[0] / gap
            imaginary += terms[1] / gap
        return complex(float(real), float(imaginary))


def test_triangle_integral_equals_the_divided_difference_in_80_digits():
    phases = adversarial_phases(np.random.default_rng(1))
    wanted = np.array([exact_mean(b, c) for b, c in phases])
    assert np.abs(physical_optics.triangle_mean(*phases.T) - wanted).max() < 1e-14  # gate 1e-10


def test_splitting_a_triangle_changes_nothing():
    random = np.random.default_rng(2)
    whole = random.standard_normal((500, 3, 3))
    needles = random.random(500) < 0.3
    whole[needles, 2] = whole[needles, 1] + 1e-4 * random.standard_normal((needles.sum(), 3))
    q = random_units(random, 500) * 10.0 ** random.uniform(-8, 4, (500, 1))
    parts, area = quarters(whole), physical_optics.normals_and_areas(whole)[1]
    shift = (parts.mean(axis=1) - np.tile(whole.mean(axis=1), (4, 1))) * np.tile(q, (4, 1))
    pieces = physical_optics.triangle_integral(parts, np.tile(q, (4, 1))) * np.exp(1j * shift.sum(axis=1))
    assert (
        np.abs(pieces.reshape(4, -1).sum(axis=0) - physical_optics.triangle_integral(whole, q)) <= 1e-10 * area
    ).all()


def test_two_triangles_of_a_rectangle_add_up_to_it():
    random = np.random.default_rng(3)
    for size in (0.0, 1e-9, 1.0, 30.0, 1e4):
        q = random_units(random, 50) * size
        corners = plate(1.3, 0.4)
        phases = (corners[0, 1:] - corners[0, :-1]) @ q.T  # of both edges
        turned = np.exp(1j * corners.mean(axis=1) @ q.T)
        both = sum(physical_optics.triangle_integral(one[None], q) * t for one, t in zip(corners, turned, strict=True))
        # A sinc(q.edge1/2) sinc(q.edge2/2): SARAS below eq. (10); Wan et al. 2004 for 2 Lx x 2 Ly seen in projection
        assert both == pytest.approx(1.3**2 * np.sinc(phases / (2 * np.pi)).prod(axis=0), abs=1e-12)


def test_a_triangle_off_its_centre_turns_the_way_of_its_nearer_part():
    # a long tip towards the radar: the third moment of its phase is positive
    tip = np.array([[[2.0, 0, 0], [-1, 1, 0], [-1, -1, 0]]])
    assert physical_optics.triangle_integral(tip, np.array([0.5, 0, 0])).imag < 0
    x = (np.arange(3000) + 0.5) / 1000 - 1
    wanted = (np.exp(0.5j * x) * 2 * (2 - x) / 3).sum() / 1000
    assert physical_optics.triangle_integral(tip, np.array([0.5, 0, 0])) == pytest.approx(wanted, abs=1e-6)


@pytest.mark.parametrize("angle,h,v", [(0, -0.26794919, 0.26794919), (45, -0.38196601, 0.14589803), (60, -0.5, 0.0)])
def test_fresnel_coefficients_of_eps_3(angle, h, v):
    got = physical_optics.fresnel(np.cos(np.radians(angle)), 3.0)
    assert got == (pytest.approx(h, abs=1e-8), pytest.approx(v, abs=1e-8))


def test_fresnel_limits():
    cosines = np.array([0.0, 1e-12, 1e-3, 0.5, 1.0])
    assert (np.array(physical_optics.fresnel(cosines, 1.0)) == 0).all()
    assert (physical_optics.fresnel(cosines, CONDUCTOR)[0] == -1).all() and (
        physical_optics.fresnel(cosines, CONDUCTOR)[1] == 1
    ).all()
    assert np.array(physical_optics.fresnel(1.0, 1e9 - 1e9j)) == pytest.approx([-1, 1], abs=6e-5)
    lossy = np.array(physical_optics.fresnel(cosines, 80 - 30j))
    assert (np.abs(lossy) <= 1 + 1e-15).all() and lossy[0, 0] == -1 and lossy[1, 0] == -1


def test_conducting_facets_of_any_tilt_keep_polarisation():
    normal, u, _ = facing(np.random.default_rng(4), 300)
    s = physical_optics.scattering_matrix(normal, u, u, CONDUCTOR)
    assert s == pytest.approx(2 * (normal * u).sum(axis=1)[:, None, None] * np.eye(2), abs=1e-12)  # -120 dB is 1e-6


def test_dielectric_facets_at_normal_incidence_give_twice_r():
    n = np.concatenate([random_units(np.random.default_rng(5), 50), [UP, -UP]])
    tilted = n + 1e-7 * random_units(np.random.default_rng(6), 52)  # beside the degenerate tangent
    tilted /= np.linalg.norm(tilted, axis=1, keepdims=True)
    r = (np.sqrt(4 - 1j) - 1) / (np.sqrt(4 - 1j) + 1)
    for normal in (n, tilted):
        got = physical_optics.scattering_matrix(normal, n, n, 4 - 1j)
        assert got == pytest.approx(np.broadcast_to(2 * r * np.eye(2), got.shape), abs=1e-8)


def test_facets_that_face_away_from_either_antenna_give_nothing():
    s = physical_optics.scattering_matrix(UP, np.array([[0, 0.6, -0.8], [0, 0.6, 0.8]]), np.array([0, -0.6, 0.8]), 4.0)
    assert (s[0] == 0).all() and (s[1] != 0).any()


def test_monostatic_scattering_is_reciprocal_and_turns_with_the_radar():
    normal, u, r = facing(np.random.default_rng(7), 300)
    s = physical_optics.scattering_matrix(normal, u, u, 5 - 2j)
    assert s[:, 0, 1] == pytest.approx(s[:, 1, 0], abs=1e-12) and np.abs(s[:, 0, 1]).max() > 0.1
    turn = np.array([[0.8, -0.6, 0], [0.6, 0.8, 0], [0, 0, 1]])
    both = physical_optics.scattering_matrix(normal, u, r, 5 - 2j)
    assert physical_optics.scattering_matrix(normal @ turn.T, u @ turn.T, r @ turn.T, 5 - 2j) == pytest.approx(
        both, abs=1e-12
    )


def test_specular_bistatic_field_is_that_of_the_image():
    # plane of incidence vertical: H is across it, V in it. The receiver looks the other way, so its H and V oppose
    # the reflected ones; S is -2 cos times the reflected field (a conductor turns E over and has S = +2 cos).
    for angle in (0.1, 0.7, 1.4):
        u, r = (np.array([sign * np.sin(angle), 0, np.cos(angle)]) for sign in (1, -1))
        h, v = physical_optics.fresnel(np.cos(angle), 6 - 1j)
        s = physical_optics.scattering_matrix(UP, u, r, 6 - 1j)
        assert s == pytest.approx(2 * np.cos(angle) * np.diag([h, -v]), abs=1e-12)


def saras_matrix(normal, look, permittivity):
    """SARAS (A.13)-(A.15), corrected as sarcl/scattering/physical_optics.py says: k perpendicular to x, H along x.

    normal  unit (a, b, c) in the axes (x, r, s);  look  Delta theta, rad: k = (0, cos, -sin), not along the normal
    """
    a, b, c = normal
    cosine = c * np.sin(look) - b * np.cos(look)
    along = b * np.sin(look) + c * np.cos(look)
    p, q = physical_optics.fresnel(np.array(cosine), np.array(permittivity))
    hv = a * along * (p + q)
    return (
        2
        * cosine
        / (a * a + along * along)
        * np.array([[a * a * q - along**2 * p, hv], [hv, along**2 * q - a * a * p]])
    )


@pytest.mark.parametrize("permittivity", [CONDUCTOR, 4 - 0.1j, 40 - 2j])
def test_the_form_of_saras_is_the_special_case_k_across_x(permittivity):
    # (x, r, s): s is up, k = (0, cos, -sin) and H = k x up = +x
    random = np.random.default_rng(8)
    for look in random.uniform(0.1, 1.5, 20):
        k = np.array([0, np.cos(look), -np.sin(look)])
        normal = random_units(random, 1)[0]
        normal *= -np.sign(normal @ k)
        got = physical_optics.scattering_matrix(normal, -k, -k, permittivity)
        assert got == pytest.approx(saras_matrix(normal, look, permittivity), abs=1e-12)


@pytest.mark.parametrize(
    "side,gigahertz,dbsm", [(1, 5.405, 36.112), (1, 9.6, 41.101), (1, 10, 41.456), (5, 1, 49.41), (5, 3, 58.96)]
)
def test_conducting_plate_at_normal_incidence(side, gigahertz, dbsm):
    a = far_amplitude(plate(side), CONDUCTOR, gigahertz * 1e9, UP)
    exact = decibel(4 * np.pi * side**4 * (gigahertz * 1e9 / SPEED_OF_LIGHT) ** 2)
    assert decibel(a[[0, 1], [0, 1]] ** 2) == pytest.approx([exact, exact], abs=1e-3)
    assert exact == pytest.approx(dbsm, abs=0.006)


@pytest.mark.parametrize(
    "degrees,dbsm", [(0, 1.0302), (5, -3.7595), (10, -21.2624), (20, -23.5638), (40, -47.8401), (60, -29.9208)]
)
def test_conducting_plate_off_normal(degrees, dbsm):
    angle = np.radians(degrees)
    u = np.array([np.sin(angle), 0, np.cos(angle)])
    a = far_amplitude(plate(0.1016), CONDUCTOR, SPEED_OF_LIGHT / 0.0325, u)
    assert decibel(a[0, 0] ** 2) == pytest.approx(dbsm, abs=0.01)
    assert decibel(a[1, 1] ** 2) == pytest.approx(dbsm, abs=0.01)


def sphere(n):
    """Unit sphere of n latitudes by 2 n longitudes, m (k, 3, 3), normals outward."""
    theta, phi = np.meshgrid(np.linspace(0, np.pi, n + 1), np.linspace(0, 2 * np.pi, 2 * n + 1), indexing="ij")
    p = np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], axis=-1)
    a, b, c, d = (x.reshape(-1, 3) for x in (p[:-1, :-1], p[1:, :-1], p[1:, 1:], p[:-1, 1:]))
    both = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
    return both[physical_optics.normals_and_areas(both)[1] > 1e-12]


@pytest.mark.parametrize("ka,n,ratio", [(10, 100, 0.91167), (20, 100, 0.96483), (50, 160, 1.01015)])
def test_sphere_by_physical_optics(ka, n, ratio):
    u = np.array([0.5, 0.3, 0.81240384])
    u /= np.linalg.norm(u)
    errors = []
    for m in (n // 2, n):
        a = far_amplitude(sphere(m), CONDUCTOR, ka * SPEED_OF_LIGHT / (2 * np.pi), u)
        errors.append(abs(decibel(abs(a[0, 0]) ** 2 / np.pi / ratio)))
        assert abs(a[0, 1]) < 1e-6 * abs(a[0, 0])
    assert errors[1] < 0.02 and errors[1] < 0.4 * errors[0]  # falls as 1/n^2
