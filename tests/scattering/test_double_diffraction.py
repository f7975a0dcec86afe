"""Waves from border to border: Keller's coefficients, grazing antennas, reciprocity, limits."""

import numpy as np
import pytest

from sarcl.base.vectors import cross, unit
from sarcl.scattering.double_diffraction import FaceBorders, double_matrix
from sarcl.scattering.edge_diffraction import WedgeShape, strip_current
from sarcl.scattering.physical_optics import polarisation

X, Y, Z = np.eye(3)


def borders(n=1, numbers=(2.0, 2.0), angle=0.0):
    """Border 1 along z at x = 0, border 2 beyond it; the face looks along y; the second turned by an angle."""
    turned = -np.cos(angle) * X + np.sin(angle) * Z
    ones = np.ones((n, 1))
    return FaceBorders((ones * X, ones * turned), ones * Y, (np.full(n, numbers[0]), np.full(n, numbers[1])))


def at(angle, cosine=0.0, side=1):
    """Unit vectors (n, 3) at angles about a border, from the face along x or -x, with these components along z."""
    sine = np.sqrt(1 - cosine**2)
    return np.stack([side * sine * np.cos(angle), sine * np.sin(angle), cosine + 0 * angle], axis=-1)


def keller(number, phi):
    """Keller 1962, J. Opt. Soc. Am. 52, 116, eq. (A6), E across the edge, of waves along the face; exp(+j omega t)."""
    return 2 / number * np.sin(np.pi / number) / (np.cos(np.pi / number) - np.cos(phi / number))


@pytest.mark.parametrize("numbers", [(2.0, 2.0), (1.5, 1.5), (1.2, 1.8)])
def test_far_from_grazing_angles_both_borders_diffract_as_keller_says(numbers):
    """The field of a border along the face is D exp(-j k rho - j pi/4)/sqrt(2 pi k rho); half of it meets the other
    border, the rest is what the face reflects. A border scatters a = -2 j D/(2 sqrt(pi)): fields that are sent and
    received point into opposite directions where their magnetic fields are alike."""
    random = np.random.default_rng(0)
    phi = random.uniform(0.1, 0.8 * np.pi, (2, 50))
    phase, ray = np.full((50, 1), 3e5), np.tile(X, (50, 1))
    got = double_matrix(borders(50, numbers), at(phi[0]), at(phi[1], side=-1), ray, phase, (0, 0, 1.0))[:, 0, 0, 0]
    wave = keller(numbers[0], phi[0]) * np.exp(-0.25j * np.pi) / np.sqrt(2 * np.pi * phase[:, 0])
    assert got == pytest.approx(-1j / np.sqrt(np.pi) * keller(numbers[1], phi[1]) * wave / 2, rel=1e-3)


@pytest.mark.parametrize("cosine", [0.0, 0.6])
@pytest.mark.parametrize("numbers", [(2.0, 2.0), (1.5, 1.5), (1.3, 1.7)])
def test_a_border_behind_another_scatters_half_of_the_wave_that_grazes_the_face(numbers, cosine):
    """Where the transmitter passes the face's plane beyond border 1, border 2 comes into the light with all of its
    currents, and what it takes from border 1 goes from half of them to minus half: the sum is continuous."""
    phi, eps = np.linspace(0.3, 2.9, 7), 1e-6
    to_rx = at(phi, cosine, side=-1)
    ray = np.tile(np.sqrt(1 - cosine**2) * X + cosine * Z, (7, 1))
    for side in (1, -1):
        to_tx = at(np.full(7, np.pi - side * eps), -cosine)
        got = double_matrix(borders(7, numbers), to_tx, to_rx, ray, np.full((7, 1), 40.0), (0.3, 0.2, 1.0))[..., 0]
        shape = WedgeShape(np.tile(-X, (7, 1)), np.tile(Y, (7, 1)), np.full(7, numbers[1]))
        above = at(np.full(7, np.pi - eps), -cosine)
        axes = [cross(cross(look, Z), look) for look in (above, to_rx)]  # of fields with E across the edge
        fields = [unit(cross(look, axis)) for look, axis in zip((above, to_rx), axes, strict=True)]
        whole = (fields[1] * strip_current(shape, above, to_rx, fields[0])).sum(axis=1) / (2 * np.sqrt(np.pi))
        sent, received = (
            np.stack([(field * e).sum(axis=1) for e in polarisation(-look, (0.3, 0.2, 1.0))])
            for field, look in zip(fields, (above, to_rx), strict=True)
        )
        wanted = -side / 2 * whole[:, None, None] * received.T[:, :, None] * sent.T[:, None]
        assert np.abs(got - wanted).max() < 1e-4 * np.abs(wanted).max()


def test_exchanging_the_antennas_changes_nothing():
    random = np.random.default_rng(1)
    looks = unit(random.standard_normal((2, 200, 3)))
    numbers, phase = random.uniform(1.1, 2, (2, 200)), random.uniform(0.01, 100, (200, 2))
    shape = borders(200, angle=0.3)
    shape = FaceBorders(shape.inward, shape.normal, tuple(numbers))
    back = FaceBorders(shape.inward[::-1], shape.normal, tuple(numbers[::-1]))
    ray = unit(np.tile(X + 0.1 * Z, (200, 1)))
    forth = double_matrix(shape, *looks, ray, phase)
    assert (
        np.abs(forth - double_matrix(back, *looks[::-1], -ray, phase).swapaxes(1, 2)).max()
        < 1e-12 * np.abs(forth).max()
    )
    assert np.abs(forth).max() > 0.1


def test_everything_is_finite():
    looks = np.concatenate([np.eye(3), -np.eye(3), unit(np.random.default_rng(2).standard_normal((50, 3)))])
    i, j = np.divmod(np.arange(len(looks) ** 2), len(looks))
    for numbers in ((2.0, 2.0), (1.5, 1.2)):
        for phase in (0.0, 1e-9, 1.0, 1e7):
            ray, phases = np.tile(X, (len(i), 1)), np.full((len(i), 1), phase)
            got = double_matrix(borders(len(i), numbers), looks[i], looks[j], ray, phases)
            forward = (looks[i] @ X < -0.99) & (looks[j] @ X > 0.99)
            assert np.isfinite(got).all()
            assert np.abs(got[~forward]).max() < 10


def test_antennas_inside_of_the_wedges_see_nothing():
    ray, phase = X[None], np.ones((1, 1))
    looks = at(np.array([1.0])), at(np.array([-0.5]))
    for pair in (looks, looks[::-1]):
        to_tx, to_rx = pair[0], pair[1] * [-1, 1, 1]
        assert not double_matrix(borders(1, (1.5, 1.5)), to_tx, to_rx, ray, phase).any()


def test_antennas_at_equal_detours_are_the_mean_of_those_beside_them():
    phi, steps = np.array([0.4, 1.2, 2.5]), (-1e-3, 0.0, 1e-3)
    ray, phase = np.tile(X, (3, 1)), np.full((3, 1), 20.0)
    low, middle, high = (
        double_matrix(borders(3), at(phi), at(phi + step, side=-1), ray, phase, (0, 0, 1.0))[:, 0, 0, 0]
        for step in steps
    )
    assert middle == pytest.approx((low + high) / 2, rel=1e-5)
