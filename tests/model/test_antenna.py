"""Antenna patterns, pointing, and the limits beyond which a pattern is negligible, against closed forms."""

from __future__ import annotations

import numpy as np
import pytest
from helpers.antenna_cases import FC, everyone, measured

import sarcl
from sarcl import pointing
from sarcl.base.constants import SPEED_OF_LIGHT
from sarcl.model.antenna import Antenna, pair_of
from sarcl.model.antenna_pattern import two_way_gain

WAVE = SPEED_OF_LIGHT / FC
TRACK = sarcl.Trajectory.line(start=(-4e3, -50, 3e3), velocity=(0, 100, 0), prf=10, n_pulses=11)


def toward(azimuth, elevation):
    """Directions (..., 3) at azimuth and elevation, rad."""
    a, e = np.broadcast_arrays(azimuth, elevation)
    return np.stack([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)], axis=-1)


def test_an_evenly_lit_aperture_is_a_sinc_in_both_axes():
    antenna = Antenna.rectangular(size=(1.5, 0.5), gain_db=6.0)
    v = np.linspace(-0.3, 0.3, 101)
    d = np.stack([np.sqrt(1 - v**2 - 0.01**2), v, np.full_like(v, 0.01)], axis=-1)
    wanted = 10 ** (6 / 20) * np.sinc(1.5 * v / WAVE) * np.sinc(0.5 * 0.01 / WAVE)
    assert np.abs(antenna.gain(d, FC) - wanted).max() < 1e-12


@pytest.mark.parametrize("taper", [1.0, 0.3, 0.08, 0.0])
def test_a_tapered_aperture_is_the_transform_of_its_illumination(taper):
    size, v = 0.7, np.linspace(-0.9, 0.9, 301)
    x = (np.arange(20000) + 0.5) / 20000 - 0.5
    lit = taper + (1 - taper) * np.cos(np.pi * x) ** 2
    wanted = (lit * np.cos(2 * np.pi * np.outer(v, x) * size / WAVE)).mean(axis=1) / lit.mean()
    antenna = Antenna.rectangular(size=(size, size), taper=(taper, 1.0))
    d = np.stack([np.sqrt(1 - v**2), v, np.zeros_like(v)], axis=-1)
    assert np.abs(antenna.gain(d, FC) - wanted).max() < 1e-6  # a midpoint sum of 20000


def test_a_gaussian_falls_to_half_power_at_half_its_width():
    antenna = Antenna.gaussian(width=(0.02, 0.3))
    sides = toward([0.01, -0.01, 0, 0], [0, 0, 0.15, -0.15])
    assert np.allclose(np.abs(antenna.gain(sides, FC)) ** 2, 0.5, atol=1e-12)
    assert antenna.gain([2.0, 0, 0], FC) == 1  # of any length
    assert abs(antenna.gain([-1.0, 0, 0], FC)) < 1e-100


def test_a_table_goes_through_its_values_and_between_them_as_the_pattern_does():
    antenna, shape = measured()
    a, e = antenna.azimuth, antenna.elevation
    at = antenna.gain(toward(a[:, None], e), FC)
    assert np.abs(at - antenna.values).max() < 1e-12
    random = np.random.default_rng(0)
    a, e = random.uniform(-0.18, 0.18, (2, 500))
    # the spline's error falls as the fourth power of the step
    errors = [np.abs(measured(step)[0].gain(toward(a, e), FC) - shape(a, e)).max() for step in (1.0, 0.5)]
    assert errors[1] < 1e-3 and errors[0] > 8 * errors[1]


def test_a_table_in_decibels_is_scaled_to_its_peak_and_blind_outside():
    axis = np.linspace(-0.1, 0.1, 9)
    db = 30 - 2e3 * (axis[:, None] ** 2 + axis**2)
    antenna = Antenna.table(axis, axis, values_db=db, gain_db=20)
    assert antenna.gain([1, 0, 0], FC) == pytest.approx(10)
    assert antenna.gain(toward(0.05, 0.0), FC) == pytest.approx(10 * 10 ** (-5 / 20), rel=1e-3)
    assert not antenna.gain(toward([0.11, 0.0, 3.0], [0.0, -0.11, 0.0]), FC).any()


def test_angles_of_a_pattern_with_a_frequency_shrink_as_it_rises():
    at = toward(0.03, 0.02)
    for antenna in (Antenna.gaussian(width=(0.1, 0.2), frequency=FC), measured(frequency=FC)[0]):
        twice = antenna.gain(toward(0.015, 0.01), 2 * FC)
        # a Gaussian's angles are not quite the table's azimuth and elevation off its axes
        assert twice == pytest.approx(antenna.gain(at, FC), rel=1e-4)
    same = Antenna.gaussian(width=(0.1, 0.2))
    assert same.gain(at, 2 * FC) == same.gain(at, FC)


@pytest.mark.parametrize("name", everyone())
@pytest.mark.parametrize("level", [0.3, 1e-2, 1e-3])
def test_outside_its_limits_a_beam_is_below_the_level(name, level):
    antenna = everyone()[name]
    y, z, behind = antenna.limits(level, FC)
    random = np.random.default_rng(1)
    off, turn = np.pi * random.uniform(0, 1, 40000) ** 2, random.uniform(0, 2 * np.pi, 40000)
    d = np.stack([np.cos(off), np.sin(off) * np.cos(turn), np.sin(off) * np.sin(turn)], axis=-1)
    gain = np.abs(antenna.gain(d, FC))
    outside = (np.abs(d[:, 1]) > y) | (np.abs(d[:, 2]) > z) | ((behind != 0) & (d[:, 0] < 0))
    assert (gain[outside] < level).all()
    if name not in ("isotropic", "tapered", "wide gaussian") and max(y, z) < 1:
        # no wider than a dozen times what is needed
        assert gain[(np.abs(d[:, 1]) > y / 12) | (np.abs(d[:, 2]) > z / 12)].max() >= level


@pytest.mark.parametrize("name", everyone())
def test_no_pattern_is_steeper_than_its_slope(name):
    antenna = everyone()[name]
    random = np.random.default_rng(2)
    off, turn = 1.5 * random.uniform(0, 1, 20000) ** 2, random.uniform(0, 2 * np.pi, 20000)
    d = np.stack([np.cos(off), np.sin(off) * np.cos(turn), np.sin(off) * np.sin(turn)], axis=-1)
    step = random.normal(size=d.shape)
    step -= (step * d).sum(axis=-1, keepdims=True) * d
    step *= 1e-6 / np.linalg.norm(step, axis=-1, keepdims=True)
    at = antenna.gain(d, FC)
    change = np.abs(antenna.gain(d + step, FC) - at) / 1e-6
    inside = at != 0  # the edge of a table is a jump
    slope = antenna.slope(FC)
    assert (change[inside] <= 1.02 * slope + 1e-6).all()
    if name != "isotropic":
        assert change[inside].max() > 0.2 * slope


def test_spotlight_and_fixed_look_where_they_should():
    point = np.array([120.0, 40, 5])
    lit = pointing.spotlight(TRACK, point)
    axes = lit.attitude
    away = point - TRACK.positions
    assert np.allclose(axes[:, :, 0], away / np.linalg.norm(away, axis=1, keepdims=True))
    assert np.allclose(axes[:, 2, 1], 0) and (axes[:, 2, 2] > 0).all()  # azimuth is level, elevation up
    d = np.einsum("ni,nij->nj", away, axes)
    assert np.allclose(d[:, 1:], 0, atol=1e-9)
    down = pointing.fixed(TRACK, (0, 0, -2.0)).attitude
    assert np.allclose(down[:, :, 0], (0, 0, -1)) and np.allclose(np.linalg.det(down), 1)


@pytest.mark.parametrize("side, sign", [("right", 1), ("left", -1)])
def test_stripmap_looks_off_nadir_and_squints_towards_the_velocity(side, sign):
    look, squint = 0.7, 0.1
    axes = pointing.stripmap(TRACK, look, squint=squint, side=side).attitude[0]
    across = np.array([sign * np.sin(look), 0, -np.cos(look)])
    assert np.allclose(axes[:, 0], np.cos(squint) * across + np.sin(squint) * np.array([0, 1, 0]))
    # the aperture's long side stays in the plane of track and boresight; up is up
    assert abs(np.cross(across, [0, 1, 0]) @ axes[:, 1]) < 1e-12 and axes[2, 2] > 0
    assert np.linalg.det(axes) == pytest.approx(1)


def test_steered_turned_and_quaternions_are_the_same_turns():
    aimed = pointing.stripmap(TRACK, 0.6)
    angle = np.linspace(-0.1, 0.1, len(TRACK))
    swept = pointing.steered(aimed, angle, 0.02).attitude
    for axes in swept:  # a rotation, whose y axis stays across the vertical of the old ones
        assert np.allclose(axes @ axes.T, np.eye(3)) and np.linalg.det(axes) == pytest.approx(1)
    assert np.allclose(np.einsum("ni,ni->n", swept[:, :, 1], aimed.attitude[:, :, 2]), 0)
    assert (np.einsum("ni,ni->n", swept[:, :, 1], aimed.attitude[:, :, 1]) > 0.9).all()
    # the old boresight is seen at minus the angle that the beam was turned by
    level = pointing.steered(aimed, angle).attitude
    seen = np.einsum("ni,nij->nj", aimed.attitude[:, :, 0], level)
    assert np.allclose(np.arctan2(seen[:, 1], seen[:, 0]), -angle)
    assert np.allclose(np.einsum("ni,nij->nj", swept[:, :, 0], aimed.attitude), toward(angle, 0.02))
    turn = angle[:, None] * np.array([0, 0, 1])
    assert np.allclose(pointing.turned(aimed, turn).attitude, level)
    from scipy.spatial.transform import Rotation

    xyzw = Rotation.from_matrix(level.copy()).as_quat()  # SciPy 1.13 takes no array that is read-only
    assert np.allclose(pointing.from_quaternions(TRACK, np.roll(xyzw, 1, axis=1)).attitude, level)
    assert np.allclose(pointing.from_quaternions(TRACK, xyzw, scalar_first=False).attitude, level)


def test_a_mounted_antenna_looks_to_the_side_of_its_body():
    forward = pointing.fixed(TRACK, (0, 1, 0))  # body axes: ahead, left, up
    right = np.array([[0.0, 1, 0], [-1, 0, 0], [0, 0, 1]])  # the antenna's boresight is the body's -y
    axes = Antenna.rectangular(size=(1, 1), mount=right).axes(forward)
    assert np.allclose(axes[:, :, 0], (1, 0, 0)) and np.allclose(axes[:, :, 2], (0, 0, 1))


def test_both_ways_multiply_and_a_two_way_pattern_serves_once():
    one, both = (
        Antenna.gaussian(width=0.2, gain_db=3),
        Antenna.gaussian(width=0.2 / np.sqrt(2), gain_db=6, two_way=True),
    )
    axes = pointing.spotlight(TRACK, (0, 0, 0)).attitude[0]
    points = np.random.default_rng(3).normal(size=(20, 3)) * 300
    at = TRACK.positions[0]
    product = two_way_gain(pair_of(one, False), (axes, axes), at, at, points, FC)
    assert np.allclose(product, two_way_gain(pair_of(both, False), (axes, axes), at, at, points, FC))
    narrow = Antenna.rectangular(size=(0.1, 0.1))
    mixed = two_way_gain(pair_of((one, narrow), True), (axes, axes), at, at + 5, points, FC)
    wanted = one.gain((points - at) @ axes, FC) * narrow.gain((points - at - 5) @ axes, FC)
    assert np.allclose(mixed, wanted)
    with pytest.raises(ValueError, match="two one-way patterns"):
        pair_of(both, True)
    with pytest.raises(ValueError, match="two one-way patterns"):
        pair_of((both, one), False)


BAD = [
    (lambda: Antenna.rectangular(size=(1, -1)), "greater than 0"),
    (lambda: Antenna(kind="aperture", size=1, frequency=FC), "every frequency"),
    (lambda: Antenna.rectangular(size=1, taper=2), "0 to 1"),
    (lambda: Antenna.gaussian(width=20), "in deg"),
    (lambda: Antenna.gaussian(width=np.nan), "finite"),
    (lambda: Antenna.gaussian(width=0.1, mount=-np.eye(3)), "no rotation"),
    (lambda: Antenna.table(np.arange(4) * 10.0, np.arange(4) * 0.1, np.ones((4, 4))), "degrees"),
    (lambda: Antenna.table([0, 0.1, 0.2, 0.4], np.arange(4) * 0.1, np.ones((4, 4))), "even steps"),
    (lambda: Antenna.table([0, 0.1, 0.2], np.arange(4) * 0.1, np.ones((3, 4))), "at least 4"),
    (lambda: Antenna.table(np.arange(4) * 0.1, np.arange(4) * 0.1, np.ones((4, 5))), "shape"),
    (lambda: Antenna.table(np.arange(4) * 0.1, np.arange(4) * 0.1, np.zeros((4, 4))), "zero everywhere"),
    (lambda: Antenna.table(np.arange(4) * 0.1, np.arange(4) * 0.1), "either"),
    (lambda: Antenna(kind="dish"), "choose one of"),
    (lambda: Antenna.gaussian(width=0.1).axes(TRACK), "spotlight"),
    (lambda: pointing.spotlight(TRACK, TRACK.positions[3]), "pulse 3"),
    (lambda: pointing.stripmap(TRACK, 35), "degrees"),
    (lambda: pointing.stripmap(TRACK, 0.5, side="up"), "choose one of"),
    (lambda: pointing.stripmap(TRACK, 0.5, up=(0, 1, 0)), "straight up"),
    (lambda: pointing.steered(TRACK, 0.1), "aim it first"),
    (lambda: pointing.from_quaternions(TRACK, np.ones((11, 4))), "length 2"),
    (lambda: pointing.fixed(TRACK, np.zeros((11, 3))), "needs a length"),
    (lambda: pair_of((Antenna.isotropic(),), False), "1 entries"),
]


@pytest.mark.parametrize("make, says", BAD, ids=[says for _, says in BAD])
def test_what_is_no_antenna_or_aim_is_refused(make, says):
    with pytest.raises(ValueError, match=says):
        make()


def test_an_isotropic_antenna_needs_no_attitude():
    assert Antenna.isotropic().axes(TRACK).shape == (11, 3, 3)
    assert (Antenna.isotropic(gain_db=20).gain(np.eye(3), FC) == 10).all()
