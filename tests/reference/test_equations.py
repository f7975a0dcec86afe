"""The verbs against the equations of sarcl/reference/equations.py, on small cases that lie half in the range window.

Transmitter and receiver are apart, so that an equation with one of the two paths alone does not pass. The equations
themselves are held to laws: adjointness, energy, and what fields far from an array tend to.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy.special import fresnel as fresnel_integrals

import sarcl
from sarcl.base.constants import SPEED_OF_LIGHT
from sarcl.reference import equations as eq
from sarcl.reference.facet import facet_echo

CHIRP = sarcl.Waveform.chirp(center=9.6e9, bandwidth=300e6, duration=1e-6)
TX = sarcl.Trajectory.line(start=(-4e3, -60, 3e3), velocity=(0, 100, 0), prf=20.0, n_pulses=24)
RX = sarcl.Trajectory.line(start=(-3e3, 2e3, 4e3), velocity=(30, 80, 5), prf=20.0, n_pulses=24)
# relative error: the verbs' tolerance is 1e-5, and complex64 samples round to 6e-8
TOLERANCE = 1e-5


def relative(values, wanted):
    return np.linalg.norm(values - wanted) / np.linalg.norm(wanted)


def delays(raw, points):
    """tau - tau_ref, s (n_rows, n)."""
    ends = zip(raw.tx, raw.rx, raw.reference_range, strict=True)
    return np.array([eq.excess_delay(tx, rx, points, r) for tx, rx, r in ends])


def frequencies_of(raw):
    return raw.frequency[0] + raw.frequency_step[0] * np.arange(raw.n_samples)


@pytest.fixture(scope="module")
def points():
    """Scatterers within 60 m of the origin, of which the range window of 20 m holds about a third at every pulse."""
    rng = np.random.default_rng(5)
    return rng.uniform(-60, 60, (40, 3)) * (1, 1, 0.2), rng.normal(size=40) + 1j * rng.normal(size=40)


@pytest.fixture(scope="module")
def raw(points):
    scene = sarcl.Scene.points(*points)
    return sarcl.echo(scene, CHIRP, TX, receiver=RX, range_window=(-20, 20), reference=(0, 0, 0), tolerance=TOLERANCE)


def test_the_echo_of_points_is_the_sum_over_those_in_the_range_window(points, raw):
    positions, amplitudes = points
    inside = abs(delays(raw, positions)) <= 2 * 20 / SPEED_OF_LIGHT
    assert 0.2 < inside.mean() < 0.5 and (inside.any(axis=0) & ~inside.all(axis=0)).any()
    f = frequencies_of(raw)
    wanted = [
        eq.point_echo(positions[seen], amplitudes[seen], f, tx, rx, r)
        for seen, tx, rx, r in zip(inside, raw.tx, raw.rx, raw.reference_range, strict=True)
    ]
    assert relative(raw.samples, np.array(wanted)) < TOLERANCE


def test_the_spectral_echo_is_that_of_points():
    track = sarcl.Trajectory.line(start=(-4e3, -40, 3e3), velocity=(0, 100, 0), prf=150.0, n_pulses=120)
    rng = np.random.default_rng(6)
    positions, amplitudes = rng.uniform(-8, 8, (30, 3)), rng.normal(size=30) + 1j * rng.normal(size=30)
    raw = sarcl.spectral_echo(sarcl.Scene.points(positions, amplitudes), CHIRP, track, tolerance=1e-3)
    wanted = [
        eq.point_echo(positions, amplitudes, frequencies_of(raw), tx, rx, r)
        for tx, rx, r in zip(raw.tx, raw.rx, raw.reference_range, strict=True)
    ]
    assert relative(raw.samples, np.array(wanted)) < 1e-3


def test_the_image_is_the_sum_over_pulses_whose_range_window_holds_the_pixel(raw):
    grid = sarcl.ImageGrid.plane(shape=(9, 11), spacing=(11.0, 9.0))
    tau = delays(raw, grid.positions.reshape(-1, 3))
    seen = abs(tau) <= 1 / (2 * raw.frequency_step[0])
    assert 0.3 < seen.mean() < 0.9 and (seen.any(axis=0) & ~seen.all(axis=0)).any()
    wanted = eq.image(raw.samples, raw.frequency[0], raw.frequency_step[0], tau).reshape(grid.shape)
    assert relative(sarcl.backproject(raw, grid, tolerance=TOLERANCE).data, wanted) < 4 * TOLERANCE  # a dark image


def test_polar_format_is_the_image_with_delays_of_plane_waves(raw):
    grid = sarcl.ImageGrid.plane(shape=(12, 10), spacing=(0.5, 0.5))
    points, step = grid.positions.reshape(-1, 3), raw.frequency_step[0]
    ends = zip(raw.tx, raw.rx, raw.reference_range, strict=True)
    tau = np.array([eq.plane_delay(tx, rx, points, np.zeros(3), r) for tx, rx, r in ends])
    wanted = eq.image(raw.samples, raw.frequency[0], step, tau, wrap=True).reshape(grid.shape)
    assert relative(sarcl.polar_format(raw, grid, tolerance=1e-4).data, wanted) < 1e-4


def test_plane_waves_have_the_delay_and_its_gradient_at_the_centre():
    center, tx, rx = np.array([3.0, -2.0, 1.0]), TX.positions[0], RX.positions[0]
    steps = 1e-3 * np.concatenate([np.zeros((1, 3)), np.eye(3), -np.eye(3)])
    spherical, plane = (
        eq.excess_delay(tx, rx, center + steps, 5e3), eq.plane_delay(tx, rx, center + steps, center, 5e3)
    )  # fmt: skip
    assert spherical[0] == pytest.approx(plane[0], abs=1e-24)
    slopes = [(tau[1:4] - tau[4:]).astype(float) for tau in (spherical, plane)]
    assert slopes[0] == pytest.approx(slopes[1], rel=1e-9)


def test_the_image_is_the_adjoint_of_the_echo(raw):
    rng = np.random.default_rng(7)
    positions, amplitudes = rng.uniform(-9, 9, (6, 3)), rng.normal(size=6) + 1j * rng.normal(size=6)
    samples = rng.normal(size=raw.samples.shape) + 1j * rng.normal(size=raw.samples.shape)
    ends = zip(raw.tx, raw.rx, raw.reference_range, strict=True)
    echoes = np.array([eq.point_echo(positions, amplitudes, frequencies_of(raw), tx, rx, r) for tx, rx, r in ends])
    image = eq.image(samples, raw.frequency[0], raw.frequency_step[0], delays(raw, positions), wrap=True)
    assert np.vdot(echoes, samples) == pytest.approx(np.vdot(amplitudes, image), rel=1e-9)


@pytest.fixture(scope="module")
def facets():
    """Two facets, of which the second turns its back to the receiver."""
    first = np.array([[0.0, 0, 0], [0.7, 0.1, 0.2], [0.1, 0.6, 0.1]])
    return np.stack([first, np.array([[2.0, 0, 0], [2.0, 0.3, 0.5], [2.0, -0.4, 0.4]])])


def test_the_echo_of_conducting_facets_is_the_integral_of_their_currents(facets):
    scene = sarcl.Scene.facets(facets[:1], two_sided=False)
    raw = sarcl.echo(scene, CHIRP, TX, receiver=RX, polarization="all", shadows=False, tolerance=1e-3)
    names = np.array(raw.polarization)
    wanted = np.empty((raw.n_rows, raw.n_samples), complex)
    for row, name in enumerate(names):
        whole = eq.conductor_echo(facets[0], frequencies_of(raw), raw.tx[row], raw.rx[row], raw.reference_range[row])
        wanted[row] = whole[:, "HV".index(name[0]), "HV".index(name[1])]
    assert set(names) == {"HH", "HV", "VH", "VV"}
    assert relative(raw.samples, wanted) < 1e-3


def test_currents_are_the_limit_of_fresnels_coefficients_and_end_behind_a_facet(facets):
    f = np.array([9.5e9, 9.7e9])
    tx, rx = np.array([-4e3, -60.0, 3e3]), np.array([-3e3, 2e3, 4e3])
    for triangle in (facets[0], facets[1], facets[0][::-1]):
        wanted = facet_echo(triangle[None], np.inf, f, tx, rx, 5e3)
        made = eq.conductor_echo(triangle, f, tx, rx, 5e3)
        assert np.abs(made - wanted).max() < 1e-9
    assert not made.any()


def test_a_plate_at_normal_incidence_is_a_pair_of_fresnel_integrals():
    distance, side, f = 1e3, 5.0, np.array([9.6e9])
    corners = side / 2 * np.array([[-1.0, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]])
    above = np.array([0, 0, distance])
    echo = sum(eq.conductor_echo(corners[list(i)], f, above, above, distance, 200) for i in ((0, 1, 2), (0, 2, 3)))
    k = 2 * np.pi * f[0] / SPEED_OF_LIGHT
    scale = np.sqrt(2 * k / (np.pi * distance))
    sine, cosine = fresnel_integrals(scale * side / 2)
    # of the path to second order in x/R; the direction of the field turns by 2.5 mrad towards the sides
    wanted = k / np.sqrt(np.pi) * (2 * (cosine - 1j * sine) / scale) ** 2
    assert echo[0, 0, 0] == pytest.approx(wanted, rel=2e-5)


def test_the_beam_of_an_array_is_its_field_and_far_away_its_array_factor():
    n, spacing, step, f0 = 9, 0.015, 20e6, 10e9
    array = sarcl.AntennaArray.linear(n, spacing=spacing, frequency_step=step, axis=(0, 1, 0))
    angles, times = np.radians([-40.0, 5, 30]), np.array([0.0, 3e-9, 2.1e-8])
    directions = np.stack([np.cos(angles), np.sin(angles), 0 * angles], axis=1)
    elements = spacing * np.outer(np.arange(n), (0, 1, 0))
    near = eq.field(elements, step * np.arange(n), np.ones(n), f0, times, 3.0 * directions)
    assert np.abs(sarcl.beam(array, f0, times=times, positions=3.0 * directions) - near).max() < 1e-5 * n
    distance = 1e7
    retarded = times[:, None] - distance / SPEED_OF_LIGHT
    far = eq.field(elements, step * np.arange(n), np.ones(n), f0, times, distance * directions)
    factor = eq.array_factor(f0, step, n, spacing, np.sin(angles), retarded)
    wanted = factor * np.exp(2j * np.pi * f0 * retarded)
    # the phase 2 pi n^2 step spacing cosine/c, which the factor leaves out, is at most 0.27 rad
    assert np.abs(far - wanted).max() < 0.3 * n
    closed = sarcl.array_factor.diverse_factor(
        f0, shape=(n, 1), spacing=(spacing, spacing), frequency_step=(step, 0), cosines=(np.sin(angles), 0 * angles),
        retarded=retarded,
    )  # fmt: skip
    assert np.abs(closed - factor).max() < 1e-6 * n
    period = eq.array_factor(f0, step, n, spacing, np.sin(angles), retarded + 1 / step)
    assert np.abs(period - factor).max() < 1e-5 * n  # the range dependence repeats with c/step


def test_updates_of_the_grid_keep_a_standing_wave_between_walls():
    n, s, modes = 24, 0.2887, (2, 3)
    i = np.arange(n)
    e, h = np.zeros((2, 3, n, n, 1))  # one cell between plates
    shape = np.outer(np.sin(np.pi * modes[0] * i / n), np.sin(np.pi * modes[1] * i / n))
    e[2, :, :, 0] = shape
    k = 2 * np.sin(np.pi * np.array(modes) / (2 * n))
    omega = 2 * np.arcsin(s / 2 * np.linalg.norm(k))  # rad per step: the grid's dispersion
    eq.update_h(e, h, s / 2)  # half a step to the time of H
    for step in range(1, 200):
        eq.update_e(e, h, s)
        e[2, 0] = e[2, :, 0] = e[:2] = 0  # walls; those on the high sides are the border of the grid
        eq.update_h(e, h, s)
        if step % 50 == 0:
            assert e[2, :, :, 0] == pytest.approx(shape * np.cos(omega * step), abs=2e-3)


def test_a_current_formed_for_every_pulse_is_the_echo_of_a_point():
    rng = np.random.default_rng(8)
    cells, tx, rx = rng.uniform(-2, 2, (5, 3)), TX.positions[:4], RX.positions[:4]
    f = np.array([1.0e9, 1.3e9])
    k = 2 * np.pi * f / SPEED_OF_LIGHT
    travel = np.array([1.0, 0.2, -0.4]) / np.linalg.norm([1.0, 0.2, -0.4])
    amplitudes = rng.normal(size=5) + 1j * rng.normal(size=5)
    current = amplitudes * np.exp(-1j * np.outer(k, cells @ travel))  # as the wave of the run causes them
    formed = eq.current_sums(cells, current, travel, k, np.broadcast_to(k, (4, 2)), tx, rx)
    for p in range(4):
        reference = (np.linalg.norm(tx[p]) + np.linalg.norm(rx[p])) / 2
        assert formed[p] == pytest.approx(eq.point_echo(cells, amplitudes, f, tx[p], rx[p], reference), rel=1e-6)
