"""Backprojection in float64: the exact sum to 1e-9, at any range."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from helpers.cases import noise_history, thinned
from helpers.float64_cases import decimal_image, error, focus, task_of

import sarcl
from sarcl.base.constants import SPEED_OF_LIGHT
from sarcl.imaging.float64.plan import WIDE, make_plan
from sarcl.numerics import error_bounds, interpolation
from sarcl.opencl.choose_device import open_device
from sarcl.reference.backproject import backproject as exact_image

PLANE = sarcl.ImageGrid.plane(center=(1, 2, 0), shape=(9, 11), spacing=(0.9, 0.7))


@pytest.mark.parametrize(
    "distance, tolerance, bistatic",
    thinned(
        [1.0, 30.0, 10e3, 800e3, 36e6], [(1e-7, False), (1e-9, True), (1e-9, False), (1e-8, True)], every=4, slow=(2,)
    ),
)
def test_error_is_below_prediction_and_prediction_below_tolerance(double, distance, tolerance, bistatic):
    raw = noise_history(n_rows=7, distance=distance, bistatic=bistatic)
    data, plan, _ = focus(raw, PLANE, tolerance, double)
    assert error(data, raw, PLANE, most=20) <= plan.predicted_error <= tolerance


@pytest.mark.parametrize("center", [100e6, 1e9, 100e9])
@pytest.mark.parametrize("relative", [0.01, 0.6])
def test_any_band_at_any_distance_meets_1e_9(double, center, relative):
    random = np.random.default_rng(int(center))
    for distance, extent in ((1.0, 1.0), (20e3, 1e3), (36e6, 100e3)):
        raw = noise_history(n_rows=3, n_samples=64, distance=distance, center=center, bandwidth=relative * center)
        raw = replace(raw, frequency_step=min(relative * center / 64, SPEED_OF_LIGHT / 4 / extent))
        grid = sarcl.ImageGrid.points(random.uniform(-extent / 2, extent / 2, (30, 3)))
        data, plan, _ = focus(raw, grid, 1e-9, double)
        assert error(data, raw, grid) <= plan.predicted_error <= 1e-9


def test_positions_about_the_earths_centre_lose_nothing(double):
    # positions are rounded to 1e-9 m here, 4e-7 rad: what counts is that they are taken as the grid gives them
    up = np.array([0.6, 0.3, np.sqrt(1 - 0.45)])
    center = 6.371e6 * up
    raw = noise_history(n_rows=5, distance=800e3)
    raw = replace(raw, tx=raw.tx + center, rx=None)
    grid = sarcl.ImageGrid.plane(center=center, shape=(33, 40), spacing=0.123, normal=up)
    data, plan, _ = focus(raw, grid, 1e-9, double)
    assert error(data, raw, grid) <= plan.predicted_error <= 1e-9


DATA = {
    "band edge": lambda s: np.where(np.arange(s.shape[1]) == 0, 1, 0 * s),
    "bright point": lambda s: np.ones_like(s),
    "one row": lambda s: s * (np.arange(len(s)) == 3)[:, None],
}


@pytest.mark.parametrize("name", DATA)
@pytest.mark.parametrize("shape, tolerance", [((1, 1), 1e-7), ((24, 24), 1e-9)], ids=str)
def test_unkind_data_stay_below_prediction(double, name, shape, tolerance):
    raw = noise_history(n_rows=7)
    raw = replace(raw, samples=DATA[name](raw.samples.astype(np.complex128)))
    grid = sarcl.ImageGrid.plane(center=(1.3, 0.4, 0), shape=shape, spacing=0.31)
    data, plan, _ = focus(raw, grid, tolerance, double)
    assert error(data, raw, grid) <= plan.predicted_error <= tolerance


def test_dark_single_pixels_stay_below_prediction(double):
    # at a pixel where the noise of the only row vanishes, the interpolation error is all there is
    raw = noise_history(n_rows=1)
    random = np.random.default_rng(1)
    for _ in range(20):
        raw = replace(raw, samples=random.standard_normal((1, 48)) + 1j * random.standard_normal((1, 48)))
        places = random.uniform(-3, 3, (400, 3))
        wanted, _ = exact_image(raw, places)
        grid = sarcl.ImageGrid.points(places[np.argmin(abs(wanted))][None])
        data, plan, _ = focus(raw, grid, 1e-7, double)
        assert error(data, raw, grid) <= plan.predicted_error <= 1e-7


def test_side_lobes_beside_a_bright_point_stay_below_prediction(double):
    raw = replace(noise_history(n_rows=4), samples=np.ones((4, 48)))
    window = np.hamming(48) ** 2
    grid = sarcl.ImageGrid.plane(center=(2.1, 0, 0), shape=(6, 6), spacing=0.1)
    data, plan, _ = focus(raw, grid, 1e-9, double, samples=window)
    assert np.abs(data).max() < 1e-3 * 4 * window.sum()
    assert error(data, replace(raw, samples=raw.samples * window), grid) <= plan.predicted_error <= 1e-9


def test_a_broken_formula_breaks_the_contract(double, monkeypatch):
    """A prediction 4 times too small fails: the bound of interpolation errors is closer than that."""
    honest = interpolation.deconvolved
    edge = np.zeros((3, 256))
    edge[:, 0] = 1
    raw = replace(noise_history(n_rows=3, n_samples=256), samples=edge)
    grid = sarcl.ImageGrid.plane(shape=(64, 64), spacing=1.3)
    ratio = []
    for factor in (1.0, 0.25):
        interpolation.interpolator_float64.cache_clear()

        def said(taps, oversample, terms, dtype, factor=factor):
            made = honest(taps, oversample, terms, dtype)
            return replace(made, error=made.error * factor)

        monkeypatch.setattr(interpolation, "deconvolved", said)
        data, plan, _ = focus(raw, grid, 1e-7, double)
        ratio.append(error(data, raw, grid, most=200) / plan.predicted_error)
    interpolation.interpolator_float64.cache_clear()
    assert ratio[0] <= 1 < ratio[1]


GRIDS = {
    "one pixel": sarcl.ImageGrid.plane(center=(3, 1, 0), shape=(1, 1), spacing=1.0),
    "a tile and one": sarcl.ImageGrid.plane(shape=(17, 16), spacing=0.2),
    "one row": sarcl.ImageGrid.plane(shape=(1, 100), spacing=0.2),
    "one column": sarcl.ImageGrid.plane(shape=(70, 1), spacing=0.2),
    "steep plane": sarcl.ImageGrid.plane(shape=(20, 30), spacing=0.3, normal=(1, 0.3, 0.5), x_axis=(0, 1, 0)),
    "volume": sarcl.ImageGrid.points(np.random.default_rng(0).uniform(-8, 8, (3, 4, 50, 3))),
    "one point": sarcl.ImageGrid.points([[1.0, 2.0, 3.0]]),
    "coincident points": sarcl.ImageGrid.points(np.ones((70, 3))),
}


@pytest.mark.parametrize("name", GRIDS)
def test_any_grid_is_focused_within_tolerance(double, name):
    raw = noise_history(n_rows=10)
    data, plan, _ = focus(raw, GRIDS[name], 1e-9, double)
    assert np.isfinite(data).all()
    assert error(data, raw, GRIDS[name]) <= plan.predicted_error <= 1e-9


@pytest.mark.parametrize("shape", [(1, 1), (1, 40), (40, 1), (3, 2), (65, 47), (130, 3)])
def test_any_number_of_rows_and_samples_works(double, shape):
    raw = noise_history(n_rows=shape[0], n_samples=shape[1], seed=shape[0])
    data, plan, _ = focus(raw, PLANE, 1e-8, double)
    assert error(data, raw, PLANE, most=15) <= plan.predicted_error <= 1e-8


def test_rows_may_have_their_own_frequency_plan(double):
    random = np.random.default_rng(4)
    raw = noise_history(n_rows=12)
    raw = replace(raw, frequency=random.uniform(8e9, 10e9, 12), frequency_step=random.uniform(4e6, 12e6, 12))
    data, plan, _ = focus(raw, PLANE, 1e-9, double)
    assert error(data, raw, PLANE) <= plan.predicted_error <= 1e-9


@pytest.mark.parametrize("order, bistatic", [(4, False), (4, True), (0, True), (WIDE, True)])
def test_the_error_of_every_order_of_the_range_series_is_below_its_formula(double, order, bistatic):
    raw = noise_history(n_rows=5, distance=300.0, bistatic=bistatic)
    kernel = interpolation.deconvolved(14, 4.0, 7, np.float64)
    made, tiling = make_plan(task_of(raw, PLANE), 1e-7)
    plan = replace(made, interpolator=kernel, length=4 * 48, order=order)
    data, _, _ = focus(raw, PLANE, 1e-7, double, plan=plan)
    bound = error_bounds.range_error_float64(tiling.radius, 290.0, 9.9e9, order)
    assert error(data, raw, PLANE) <= bound + 1e-13
    if order > 1:  # and not much less: no term is missing from the series
        assert error(data, raw, PLANE) >= bound / 300


def test_the_error_of_coarse_tiles_is_that_of_their_formula(double):
    raw = noise_history(n_rows=5, distance=3e6)
    raw = replace(raw, frequency_step=raw.frequency_step / 400)
    grid = sarcl.ImageGrid.plane(shape=(16, 16), spacing=70.0)
    made, tiling = make_plan(task_of(raw, grid), 1e-7)
    plan = replace(
        made, interpolator=interpolation.deconvolved(14, 4.0, 7, np.float64), length=4 * 48, per_tile=256, order=0
    )
    data, _, _ = focus(raw, grid, 1e-7, double, plan=plan)
    bound = error_bounds.phase_rounding(tiling.radius, 9.4e9, number=error_bounds.FLOAT64)
    assert 1e-10 < bound and bound / 100 <= error(data, raw, grid) <= bound


def test_long_rows_meet_1e_9(double):
    raw = noise_history(n_rows=2, n_samples=65536)
    grid = sarcl.ImageGrid.points(np.random.default_rng(0).uniform(-2e3, 2e3, (10, 3)))
    data, plan, _ = focus(raw, grid, 1e-9, double)
    assert error(data, raw, grid) <= plan.predicted_error <= 1e-9


def test_weights_of_rows_and_samples_are_applied(double):
    raw = noise_history(n_rows=12)
    rows, samples = np.linspace(0, 1, 12), np.hamming(48)
    data, plan, _ = focus(raw, PLANE, 1e-9, double, rows=rows, samples=samples)
    weighted = replace(raw, samples=raw.samples * (rows[:, None] * samples))
    assert error(data, weighted, PLANE) <= plan.predicted_error


def random_case(seed):
    """Anything the contract covers: data, grid and tolerance."""
    random = np.random.default_rng(seed)

    def log(a, b):
        return float(np.exp(random.uniform(np.log(a), np.log(b))))

    n_rows, n_samples = int(log(1, 12)), int(log(1, 600))
    distance, center = log(1, 36e6), log(100e6, 100e9)
    bandwidth = center * log(0.01, 0.6)
    extent = log(1, 1e5)
    squint = random.uniform(-np.pi / 3, np.pi / 3)
    look = np.array([np.cos(squint), np.sin(squint), random.uniform(0.1, 1)])
    origin = random.standard_normal(3) * random.choice([0.0, 1e3, 6.4e6])
    tx = distance * look / np.linalg.norm(look) + random.standard_normal((n_rows, 3)) * distance * log(1e-6, 0.3)
    rx = tx + random.standard_normal(3) * distance * 0.3 if random.random() < 0.5 else None
    spread = np.linalg.norm(tx, axis=1), np.linalg.norm(tx if rx is None else rx, axis=1)
    samples = random.standard_normal((n_rows, n_samples)) + 1j * random.standard_normal((n_rows, n_samples))
    kind = random.integers(4)
    if kind == 1:
        samples[:, 1:] = 0
    elif kind == 2:
        samples = np.ones_like(samples)
    raw = sarcl.PhaseHistory(
        samples,
        frequency=center - bandwidth / 2,
        frequency_step=bandwidth / n_samples,
        tx=tx + origin,
        rx=None if rx is None else rx + origin,
        reference_range=sum(spread) / 2 + random.choice([0.0, 7.5e-4]),
    )
    if random.random() < 0.5:
        shape = tuple(int(log(1, 64)) for _ in range(2))
        grid = sarcl.ImageGrid.plane(center=origin, shape=shape, spacing=extent / max(shape))
    else:
        grid = sarcl.ImageGrid.points(origin + random.uniform(-0.5, 0.5, (int(log(1, 300)), 3)) * extent)
    return raw, grid, float(random.choice([1e-6, 1e-7, 1e-8, 1e-9])), bool(random.random() < 0.5)


@pytest.mark.slow
def test_random_cases_keep_the_contract():
    device, seen = open_device(), 0
    assert device.info.fp64
    for seed in range(60):
        raw, grid, tolerance, wrap = random_case(seed)
        data, plan, _ = focus(raw, grid, tolerance, device, wrap=wrap)
        picked = np.random.default_rng(0).permutation(grid.size)[:20]
        wanted, spread = decimal_image(raw, grid.positions.reshape(-1, 3)[picked], wrap)
        wrong, scale = np.linalg.norm(data.ravel()[picked] - wanted), max(np.linalg.norm(wanted), spread)
        assert wrong <= plan.predicted_error * scale and plan.predicted_error <= tolerance, f"seed {seed}"
        seen += scale > 0
    assert seen > 30
