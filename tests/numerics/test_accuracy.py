"""Error formulas against the errors that they bound."""

from __future__ import annotations

import numpy as np
import pytest

from sarcl.base import constants, float_pairs
from sarcl.numerics import cost_model, error_bounds, interpolation, interpolator_choice, nufft2d, plan, range_profiles
from sarcl.numerics.interpolation import fitted, interpolator


@pytest.mark.parametrize("make", [interpolator, fitted])
@pytest.mark.parametrize("taps", interpolation.TERMS)
@pytest.mark.parametrize("oversample", [2.0, 4.0, 10.0])
def test_interpolation_error_is_bounded_at_every_frequency_and_place(make, taps, oversample):
    made = make(taps, oversample)
    random = np.random.default_rng(0)
    nu = random.uniform(-0.5, 0.5, 300) / oversample
    t = random.uniform(20, 30, 300)
    s = t - (taps - 1) / 2
    j = np.rint(s)
    weights = made.weights(s - j)
    waves = np.exp(2j * np.pi * nu[:, None] * (j[:, None] + np.arange(taps))) / made.transform(nu)[:, None]
    got = (weights * waves).sum(axis=1)
    error = np.abs(got - np.exp(2j * np.pi * nu * t)).max()
    assert error <= 1.02 * made.error  # the bound is taken on a grid of 33 frequencies and 65 places
    assert error >= 0.3 * made.error  # and the bound is not much larger than the error


def test_the_hat_errs_by_3_3_nu_squared():
    # alias images of sinc^2: sum over m of (nu/(nu + m))^2 is (pi^2/3) nu^2 for small nu
    for oversample in (16.0, 32.0):
        nu = 0.5 / oversample
        assert interpolator(2, oversample).error == pytest.approx(interpolation.MARGIN * np.pi**2 / 3 * nu**2, rel=0.03)


def test_more_taps_and_finer_profiles_reduce_the_error():
    for oversample in (2.0, 4.0):
        errors = [interpolator(t, oversample).error for t in interpolation.TERMS]
        assert errors == sorted(errors, reverse=True)
    assert interpolator(2, 8.0).error < interpolator(2, 4.0).error


@pytest.mark.parametrize("taps", interpolation.TERMS)
def test_the_lower_bound_of_an_interpolation_error_is_below_it_and_close(taps):
    for oversample in (*interpolator_choice.OVERSAMPLE, *nufft2d.OVERSAMPLE):
        bound, error = interpolation.lower_bound(taps, oversample), interpolator(taps, float(oversample)).error
        assert bound <= error <= 5 * bound


@pytest.mark.parametrize("taps", [4, 6, 8])
@pytest.mark.parametrize("oversample", [1.5, 2.0, 3.0, 4.0])
def test_fitted_kernels_have_smaller_errors_with_half_the_terms_than_kaiser_bessel_kernels(taps, oversample):
    made, other = fitted(taps, oversample), interpolator(taps, oversample)
    assert made.terms == taps // 2 < other.terms
    assert made.error < 0.9 * other.error
    assert made.edge_gain == pytest.approx(other.edge_gain, rel=0.01)  # so that sums round alike


@pytest.mark.parametrize("taps", interpolation.TERMS)
def test_the_lower_bound_of_fitted_kernels_is_below_their_error(taps):
    for oversample in map(float, interpolator_choice.OVERSAMPLE):
        bound, error = interpolation.fitted_lower_bound(taps, oversample), fitted(taps, oversample).error
        assert bound <= error
        if taps == 4:  # where the degree of the polynomials decides
            assert error <= 4 * bound


def test_kernels_of_gpus_are_the_cheapest_of_both_families():
    for error in (1e-7, 1e-5, 1e-4, 1e-3):
        made, length, cost = interpolator_choice.choose_interpolator(error, 1000, 1e6, 0.0, cost_model.ON_GPU)
        every = [(t, s, n) for t, s, n in interpolator_choice.interpolators(1000, 0.0) if fitted(t, s).error <= error]
        costs = [1e6 * cost_model.ON_GPU.of_taps(t, s) + cost_model.profile(n) for t, s, n in every]
        assert made.error <= error and cost * 1e6 == pytest.approx(min(costs))
        assert (made.taps, made.oversample, length) in every and made.terms == max(made.taps // 2, 1)


def test_wavefronts_of_long_profiles_cost_more_than_taps():
    # with float32 ranges in a tile of a satellite's image: six taps, or four in profiles eight times as long
    gpu, cpu = cost_model.ON_GPU, cost_model.ON_CPU
    assert cpu.of_taps(4, 32.0) == cpu.of_taps(4, 2.0) == cost_model.TAPS[4]
    spreading, n = cost_model.SPREADING, cost_model.CACHED_SAMPLES
    assert spreading.of_taps(2, 2.0, n) == spreading.of_taps(2, 2.0) < spreading.of_taps(2, 2.0, 2 * n)
    assert gpu.of_taps(4, 2.0) == gpu.taps[1] < gpu.of_taps(6, 4.0) < gpu.of_taps(4, 32.0)


@pytest.mark.parametrize("n_samples, carrier", [(1, 0.0), (100, 0.0), (3000, 1024.0), (2**19, 0.0)])
def test_the_choice_is_the_cheapest_of_all_interpolators(n_samples, carrier):
    every = [(interpolator(t, s), length) for t, s, length in interpolator_choice.interpolators(n_samples, carrier)]
    least = min(made.error for made, _ in every)
    assert interpolator_choice.least_error(n_samples, carrier) == least
    for error in (least, 1e-6, 1e-4, 1e-2, 0.4):
        made, length, cost = interpolator_choice.choose_interpolator(error, n_samples, 1e5, carrier)
        able = [(m.taps, n) for m, n in every if m.error <= error]
        costs = [1e5 * cost_model.TAPS[taps] + cost_model.profile(n) for taps, n in able]
        assert (made, length) in every and cost * 1e5 == pytest.approx(min(costs))


@pytest.mark.parametrize("radius", [0.02, 1.0, 5.7, 11.3])
@pytest.mark.parametrize("frequency", [60e6, 1.3e9, 9.95e9, 94e9])
def test_the_linear_term_in_two_parts_is_exact_but_for_its_rests(radius, frequency):
    """As kernels/tile_constants.cl and range_phase.clh split and add, against longdouble."""
    random, kappa, single = np.random.default_rng(0), 2 * frequency / constants.SPEED_OF_LIGHT, np.float32
    u, p = random.standard_normal((2, 20000, 3))
    u[:3], p[:3] = np.eye(3), np.eye(3)  # along axes, where sums are largest
    u, p = kappa * u / np.linalg.norm(u, axis=1)[:, None], radius * p / np.linalg.norm(p, axis=1)[:, None]
    steps = error_bounds.two_part_steps(radius, frequency)
    high, low = [], []
    for values, step in zip((u, p), steps, strict=True):
        magic = float_pairs.magic(step)
        assert np.log2(step) == np.rint(np.log2(step)) and magic.dtype == single
        high.append((values.astype(single) + magic) - magic)
        low.append((values - high[-1]).astype(single))
        assert np.abs(low[-1]).max() <= 0.502 * step
    exact = [(high[0][:, i].astype(float) * high[1][:, i]) for i in range(3)]
    for total in (exact[2], exact[1] + exact[2], exact[0] + exact[1] + exact[2]):
        assert (total == total.astype(single)).all()  # no float32 addition rounds
    rest = np.zeros(len(u), single)
    for first, second in ((high[0], low[1]), (low[0], p.astype(single))):
        for i in (2, 1, 0):
            rest = (first[:, i].astype(float) * second[:, i] + rest).astype(single)  # one rounding, as fma
    wanted = (u.astype(np.longdouble) * p).sum(axis=1) - sum(exact)
    worst, bound = 2 * np.pi * np.abs(wanted - rest).max(), error_bounds.two_part_rounding(radius, frequency)
    assert 0.05 * bound <= worst <= bound


@pytest.mark.parametrize("distance", [20.0, 300.0, 1e4])
@pytest.mark.parametrize("order", [2, 3])
def test_series_error_bounds_the_exact_difference(distance, order):
    radius, frequency = 4.0, 10e9
    random = np.random.default_rng(1)
    p = random.standard_normal((20000, 3))
    p *= radius / np.linalg.norm(p, axis=1, keepdims=True)
    p = p.astype(np.longdouble)
    u = np.array([0, 0, 1], np.longdouble)
    exact = np.sqrt(((distance * u - p) ** 2).sum(axis=1)) - distance
    a = p @ u
    w = (p**2).sum(axis=1) - a**2
    series = -a + w / (2 * distance) * (1 if order == 2 else 1 + a / distance)
    worst = float(4 * np.pi * frequency / constants.SPEED_OF_LIGHT * np.abs(series - exact).max())
    bound = error_bounds.series_error(radius, distance, frequency, order)
    assert 0.3 * bound <= worst <= bound


def test_a_series_about_a_near_antenna_is_refused():
    assert error_bounds.series_error(4.0, 7.0, 1e9, 2) == np.inf
    assert error_bounds.series_error(4.0, 7.0, 1e9, 0) == 0


def test_the_cheapest_interpolator_meets_its_share_and_the_impossible_is_named():
    for error in (1e-1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6):
        made, length, _ = interpolator_choice.choose_interpolator(error, 1000, 1e6)
        assert made.error <= error
        assert length >= made.oversample * 1000 and length % 2 == 0
    with pytest.raises(ValueError, match="the best here is"):
        interpolator_choice.choose_interpolator(1e-12, 1000, 1e6)


def test_spreading_is_the_adjoint_of_interpolation_profiles(device):
    random = np.random.default_rng(2)
    made, length, _ = interpolator_choice.choose_interpolator(1e-4, 37, 1e3)
    pad = range_profiles.padding(made)
    samples = (random.standard_normal((3, 37)) + 1j * random.standard_normal((3, 37))).astype(np.complex64)
    rows = random.standard_normal((3, length + 2 * pad)) + 1j * random.standard_normal((3, length + 2 * pad))
    weights = np.broadcast_to(range_profiles.correction(made, 37, length), samples.shape)
    forward = range_profiles.from_samples(device, samples, weights, length, pad)
    backward = range_profiles.to_samples(device, rows.astype(np.complex64), 37, made)
    assert np.vdot(rows, forward) == pytest.approx(np.vdot(backward, samples), rel=1e-5)


@pytest.mark.parametrize("carrier", [0.0, 1.3, 40.0, 1024.0, 1e4, 3.21e7])
@pytest.mark.parametrize("error", [1e-1, 1e-3, 1e-5])
def test_images_keep_off_the_carrier(error, carrier):
    made, length, _ = interpolator_choice.choose_interpolator(error, 64, 1e6, carrier)
    assert made.error <= error
    nearest = np.abs(carrier - length * np.arange(1, carrier / length + 2)).min()
    assert nearest >= 0.25 * length
    assert length <= 1.6 * interpolator_choice.choose_interpolator(error, 64, 1e6)[1]


def test_tiles_that_float32_carries_are_computed_in_it_and_their_error_counts():
    sums = plan.ProfileSums(1e4, 9.7e9, 150e6, n_samples=300, points_per_row=10**6, chunk=10**4)
    tiles = [(256, 175.0)]
    alone = plan.cheapest(1e-2, tiles, sums)
    made = plan.cheapest(1e-2, tiles, sums, near={256: [(4.0, 0.9), (20.0, 0.98)]})
    assert alone.near.order == 0 and made.near.radius == 20.0 and made.cost < alone.cost - 0.5
    assert (made.range_mode, made.order) == (alone.range_mode, alone.order)
    float32 = error_bounds.range_error(20.0, 1e4, 9.7e9, 150e6, 0, made.near.order)
    assert made.predicted_error - made.interpolator.error > float32 > 1e-3
    assert "float32 of 98 % of the tiles" in made.describe("spread")["ranges"]
