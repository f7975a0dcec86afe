"""Fringe currents of wedges: Keller's coefficients, currents of the exact series, physical optics of plates, limits."""

import numpy as np
import pytest
from scipy.special import jv, jvp

from sarcl.base.vectors import unit
from sarcl.scattering.edge_diffraction import WedgeShape, edge_matrix, fringe_current, strip_current
from sarcl.scattering.physical_optics import scattering_matrix

X, Y, Z = np.eye(3)
K = 2 * np.pi


def wedge(number):
    return WedgeShape(X, Y, np.array(number))


def at(angle, cosine=0.0):
    """Unit vector at an angle about the edge, with this component along it."""
    sine = np.sqrt(1 - cosine**2)
    return np.array([sine * np.cos(angle), sine * np.sin(angle), cosine])


def keller(number, phi, phi_tx, sign):
    """Keller 1962, J. Opt. Soc. Am. 52, 116, eq. (A6), exp(+j omega t): -1 soft (E along the edge), +1 hard."""
    poles = [np.cos(np.pi / number) - np.cos((phi + s * phi_tx) / number) for s in (-1, 1)]
    amplitude = np.sin(np.pi / number) / number * (1 / poles[0] + sign / poles[1])
    return amplitude * np.exp(-0.25j * np.pi) / np.sqrt(2 * np.pi * K)


@pytest.mark.parametrize("seed", range(8))
def test_all_currents_radiate_as_kellers_coefficients_say(seed):
    random = np.random.default_rng(seed)
    number = random.uniform(1.05, 2)
    phi_tx, phi = random.uniform(0, number * np.pi, 2)
    line = -(K / 4) * np.sqrt(2j / (np.pi * K))  # the field of a line current, times exp(-j k rho)/sqrt(rho)
    soft = line * strip_current(wedge(number), at(phi_tx), at(phi), Z)[2] / K
    across = np.cross(at(phi_tx), Z)  # of the electric field whose magnetic field is along the edge
    hard = line * at(phi + np.pi / 2) @ strip_current(wedge(number), at(phi_tx), at(phi), across) / K
    assert soft == pytest.approx(keller(number, phi, phi_tx, -1), rel=1e-8)
    assert hard == pytest.approx(keller(number, phi, phi_tx, 1), rel=1e-8)


@pytest.mark.parametrize(("number", "cosine"), [(1.5, 0.45), (2.0, 0.77), (1.7, -0.32)])
def test_currents_on_a_face_are_those_of_the_exact_series_at_oblique_incidence(number, cosine):
    """The exact field of a wedge as a series of Bessel functions, its currents on face 1 added up along the edge's
    perpendicular with the phase of a strip, k = 1. They decay, because the direction to the receiver is complex."""
    random = np.random.default_rng(3)
    phi_tx, damping = random.uniform(0.2, number * np.pi - 0.2), 0.3
    to_tx, to_rx = at(phi_tx, -cosine), at(2.2, 0.4) + damping * 1j * X
    field = unit(np.cross(to_tx, [0.3, 0.1, 1.0]))
    field = 0.8 * field + 0.6 * np.cross(to_tx, field)
    h_t, e_t, sine = np.cross(-to_tx, field)[2], field[2], np.sqrt(1 - cosine**2)
    ends = np.concatenate([[0], np.logspace(-16, -0.4, 40), np.arange(1, 90, 0.8)])
    nodes, weights = np.polynomial.legendre.leggauss(10)
    x = (ends[:-1, None] + np.diff(ends)[:, None] * (nodes + 1) / 2).ravel()
    weight = (np.diff(ends)[:, None] * weights / 2).ravel()
    order = np.arange(260) / number
    twice = np.where(order > 0, 2, 1) * 2 / number * 1j**order
    bessel, slope = jv(order, sine * x[:, None]), jvp(order, sine * x[:, None])
    magnetic = bessel @ (twice * np.cos(order * phi_tx))
    along = slope @ (twice * np.cos(order * phi_tx)) * sine  # d/dx of the magnetic field
    across = bessel @ (twice * order * np.sin(order * phi_tx)) / x  # d/dy of the electric field
    kappa = to_rx[0] + cosine / sine * (to_rx[2] - cosine)
    wave = np.exp(1j * kappa * x) * weight
    wanted = h_t * magnetic @ wave, (1j * cosine * h_t * along - 1j * e_t * across) @ wave / sine**2
    # the difference of a wedge and of one whose second face is dark and far away is face 1 alone
    got = strip_current(wedge(number), to_tx, to_rx, field) - other_face(number, phi_tx, to_tx, to_rx, field)
    assert got[[0, 2]] == pytest.approx(np.array(wanted), rel=2e-6)


def other_face(number, phi_tx, to_tx, to_rx, field):
    """Currents of face 2: those of face 1 of the wedge seen from its other face, less those of that wedge's own
    second face, by the formula of the page docs/theory/edges.md."""
    angle = np.pi * number
    x, t = np.array([np.cos(angle), np.sin(angle), 0]), -Z
    phi = angle - phi_tx
    cosine = -to_tx @ t
    sine = np.sqrt(1 - cosine**2)
    mu = (to_rx @ x + cosine / sine * (to_rx @ t - cosine)) / sine
    alpha = np.arccos(-mu)
    gap = np.cos(phi / number) - np.cos(alpha / number)
    t_h = 2j * np.sin(alpha / number) / (number * sine * np.sin(alpha) * gap)
    t_s = -2 * np.sin(phi / number) / (number * gap)
    h_t = np.cross(-to_tx, field) @ t
    along = -1j * (cosine * h_t * (2 / number + 1j * mu * sine * t_h) + field @ t * t_s) / sine**2
    return h_t * t_h * x + along * t


@pytest.mark.parametrize("angle", [0.3, 0.8, 1.3])
@pytest.mark.parametrize("other", [0.0, 0.5])
def test_physical_optics_of_the_two_edges_of_a_strip_is_that_of_its_facets(angle, other):
    """A strip -w/2 < x < w/2, seen across its edges: the same amplitude as scattering_matrix times the integral."""
    width = 2.3
    to_tx, to_rx = at(np.pi / 2 - angle), at(np.pi / 2 - other)
    q = K * (to_tx + to_rx)[0]
    wanted = K / (2 * np.sqrt(np.pi)) * scattering_matrix(Y, to_tx, to_rx, np.inf, (0, 1, 0)) * width
    wanted = wanted * np.sinc(q * width / 2 / np.pi)
    got = 0
    for side, end in ((X, -width / 2), (-X, width / 2)):
        shape = WedgeShape(side, Y, np.array(2.0))
        total = edge_matrix(shape, to_tx, to_rx, (0, 1, 0), optics=True)
        got = got + total * np.exp(1j * q * end)
    assert np.abs(got - wanted).max() < 1e-10 * np.abs(wanted).max()


def test_one_antenna_receives_as_v_what_it_sends_as_h_as_it_receives_as_h_what_it_sends_as_v():
    random = np.random.default_rng(5)
    looks = unit(random.standard_normal((500, 3)))
    shape = WedgeShape(np.broadcast_to(X, (500, 3)), np.broadcast_to(Y, (500, 3)), random.uniform(1.05, 2, 500))
    got = edge_matrix(shape, looks, looks)
    assert np.array_equal(got[:, 0, 1], got[:, 1, 0])
    assert np.abs(got[:, 0, 1]).max() > 0.1


def test_all_currents_are_reciprocal_on_the_cone_of_diffracted_rays():
    random = np.random.default_rng(6)
    for number, cosine in random.uniform((1.05, -0.9), (2, 0.9), (20, 2)):
        one, other = (at(angle, cosine) for angle in random.uniform(0, np.pi * number, 2))
        one = one * [1, 1, -1]  # the cone of rays: u_r.t = d.t = -u_t.t
        forth, back = (
            edge_matrix(wedge(number), *looks) + edge_matrix(wedge(number), *looks, optics=True)
            for looks in ((one, other), (other, one))
        )
        assert np.abs(forth - back.T).max() < 1e-9 * np.abs(forth).max()


@pytest.mark.parametrize("number", [1.2, 1.5, 2.0])
def test_the_fringe_is_finite_and_smooth_at_shadow_and_reflection_boundaries(number):
    for phi_tx in (0.4, 1.5, np.pi * number - 0.6):
        for boundary in (np.pi - phi_tx, np.pi + phi_tx, 2 * np.pi * number - np.pi - phi_tx):
            if not 0.1 < boundary < np.pi * number - 0.1:
                continue
            for field in (Z, np.cross(at(phi_tx), Z)):
                near = [
                    fringe_current(wedge(number), at(phi_tx), at(boundary + step), field)
                    for step in (-1e-2, -1e-3, -1e-5, 0, 1e-5, 1e-3, 1e-2)
                ]
                assert np.isfinite(near).all()
                assert np.abs(np.diff(near, axis=0)).max() < 0.3 * np.abs(near).max() + 0.05
                assert np.abs(near[2] - near[4]).max() < 1e-3 * (1 + np.abs(near).max())


@pytest.mark.parametrize("number", [1.2, 1.5, 2.0])
def test_the_fringe_beside_a_boundary_is_all_currents_less_physical_optics(number):
    """0.09 rad from it a series takes the place of the difference."""
    for field in (Z, np.cross(at(0.8), Z)):
        looks = wedge(number), at(0.8), at(np.pi - 0.8 + 0.09), field
        wanted = strip_current(*looks) - strip_current(*looks, optics=True)
        assert np.abs(fringe_current(*looks) - wanted).max() < 1e-11


def test_the_fringe_is_finite_along_the_edge_along_a_face_and_in_its_plane():
    looks = np.array([Z, -Z, X, -X, Y, at(1.2, 1 - 1e-9), at(0.0, 0.3), at(np.pi, -0.6)])
    for number in (1.5, 2.0):
        shape = WedgeShape(np.broadcast_to(X, (8, 3)), np.broadcast_to(Y, (8, 3)), np.full(8, number))
        got = edge_matrix(shape, looks, looks, (0.1, 0.2, 1.0))
        assert np.isfinite(got).all()
        assert np.abs(got).max() < 10


def test_a_transmitter_inside_of_a_wedge_sees_no_edge():
    assert not edge_matrix(wedge(1.5), at(-0.5), at(0.5)).any()


def test_half_planes_scatter_half_of_a_wave_that_meets_them_edge_on():
    """Backscatter from the front at phi' = pi: E along the edge, D_s = -(1 - 1/cos phi') = -2, physical optics 0."""
    got = edge_matrix(wedge(2.0), at(np.pi), at(np.pi), (0, 0, 1))  # V along the edge
    line = -2 * np.exp(-0.25j * np.pi) / np.sqrt(2 * np.pi * K) / 2
    current = line / (-(K / 4) * np.sqrt(2j / (np.pi * K))) * K
    assert got[1, 1] == pytest.approx(current / (2 * np.sqrt(np.pi)), rel=1e-6)
    assert abs(got[0, 0]) < 1e-9


@pytest.mark.parametrize("angle", [1e-5, 1e-7, 1e-9, 1e-10])
def test_the_far_border_of_a_sheet_is_as_bright_however_near_the_plane_it_is_seen(angle):
    """The fringe of the border behind, E across it, goes to 2: 1/sin(alpha) grows as e_r.x falls."""
    got = edge_matrix(wedge(2.0), at(angle), at(angle), (0, 0, 1))  # H across the edge
    assert abs(got[0, 0]) == pytest.approx(1 / np.sqrt(np.pi), rel=1e-5)


@pytest.mark.parametrize(("inward", "cosine"), [(X, 0.3), (-X, 0.3), (X, -0.6)])
def test_in_the_plane_of_a_sheet_nothing_is_turned_into_the_other_polarisation(inward, cosine):
    """The plane is a mirror, of which one of H and V is odd and the other even."""
    got = edge_matrix(WedgeShape(inward, Y, np.array(2.0)), at(0.0, cosine), at(0.0, cosine), (0, 1, 0))
    assert abs(got[0, 1]) < 1e-12
