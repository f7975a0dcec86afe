"""The accuracy contract over all it covers: achieved <= predicted <= tolerance, or an error that names the best."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from helpers.cases import image_error, noise_on
from helpers.contract_cases import build, draw

import sarcl
from sarcl.bench.exact import backproject as quick_sum
from sarcl.imaging.direct import direct, line_plan
from sarcl.imaging.method_choice import kept_plans
from sarcl.numerics import interpolation, interpolator_choice
from sarcl.opencl.choose_device import open_device

SLOW = pytest.mark.slow


def hold(seed, terms=3e6, lowest=-6.0):
    """Focus case `seed` and hold the contract; achieved/asked, or None where it was refused."""
    case = draw(seed, terms, lowest)
    raw, grid = build(case)
    device = open_device(None)
    device = device if case.fp64 else device.without_fp64()
    try:
        image = sarcl.backproject(raw, grid, tolerance=case.tolerance, device=device, check=False)
    except ValueError as exc:
        assert "the best" in str(exc) or "float64" in str(exc), f"{case}: {exc}"
        return None
    error = image_error(image, raw, most=300)
    assert error <= image.report.predicted_error <= case.tolerance * (1 + 1e-12), f"{case}: {error:.2e}"
    return error / case.tolerance


def hold_all(seeds, share, **limits):
    """Hold the contract for each; at least `share` of them must not be refused. The ratios of those."""
    met = np.array([ratio for seed in seeds if (ratio := hold(seed, **limits)) is not None])
    assert len(met) >= share * len(seeds), "tasks were refused that the numbers allow"
    return met


# plans are not needlessly accurate: half of the errors exceed a thirtieth of the tolerance. The median of 40 tasks is
# uncertain by a quarter, that of 24 by a third, so that a third less is accepted of it
@pytest.mark.parametrize(
    "seeds, least", [(range(24), 1 / 45), pytest.param(range(24, 74), 1 / 30, marks=SLOW)], ids=str
)
def test_random_tasks(seeds, least):
    assert np.median(hold_all(seeds, 0.975, terms=6e5)) >= least


@SLOW
def test_larger_random_tasks():
    assert np.median(hold_all(range(200, 240), 0.97, terms=3e7)) >= 1 / 30


@SLOW
def test_a_task_of_a_billion_terms():
    assert hold(12, terms=1e9) is not None


@pytest.mark.parametrize("seeds", [range(500, 510), pytest.param(range(510, 540), marks=SLOW)], ids=str)
def test_random_tasks_in_float64(seeds):
    hold_all(seeds, 0.5, terms=3e5, lowest=-9.0)


def test_a_formula_four_times_too_small_breaks_the_contract(monkeypatch):
    # the test is sensitive: with the interpolation error divided by four, an error exceeds its prediction
    honest = interpolation.interpolator

    def smaller(taps, oversample):
        made = honest(taps, oversample)
        return replace(made, error=made.error / 4)

    monkeypatch.setattr(interpolation, "interpolator", smaller)
    monkeypatch.setattr(interpolation, "lower_bound", lambda taps, oversample: 0.0)
    monkeypatch.setattr(line_plan, "choose", lambda *a, **k: None)
    clear_choices()  # else an interpolator that another test has chosen would be taken
    try:
        with pytest.raises(AssertionError):
            hold_worst(1e-2)
            hold_worst(1e-3)
    finally:
        clear_choices()


def clear_choices():
    interpolator_choice.choose_interpolator.cache_clear()
    interpolator_choice.least_error.cache_clear()
    kept_plans.clear()


def hold_worst(tolerance):
    """All energy at the band's edge and pixels half way between samples: where the interpolation error is largest."""
    n, n_samples = 6, 64
    tx = np.stack([np.full(n, -7e3), np.linspace(-1, 1, n), np.full(n, 7e3)], axis=1)
    samples = np.zeros((n, n_samples), np.complex64)
    samples[:, 0] = 1
    raw = sarcl.PhaseHistory(
        samples, frequency=9.6e9, frequency_step=300e6 / n_samples, tx=tx, reference_range=np.linalg.norm(tx, axis=1)
    )
    for spacing in np.linspace(0.11, 0.37, 5):
        grid = sarcl.ImageGrid.plane(shape=(64, 64), spacing=spacing)
        image = sarcl.backproject(raw, grid, tolerance=tolerance, method="direct", check=False)
        assert image_error(image, raw, most=300) <= image.report.predicted_error


@pytest.mark.parametrize("tolerance", [1e-1, 1e-3, 1e-5, *(pytest.param(t, marks=SLOW) for t in (1e-2, 1e-4))])
def test_honest_formulas_hold_where_they_are_worst(tolerance):
    hold_worst(tolerance)


def arc_at(distance, n=256):
    """The same angles at any distance, smooth so that sub-apertures can be used."""
    angle = 0.02 * (np.arange(n) / (n - 1) - 0.5)
    return noise_on(distance * np.stack([0.7 * np.cos(angle), 0.7 * np.sin(angle), np.full(n, 0.714)], axis=1),
                    n_samples=256)  # fmt: skip


@pytest.mark.parametrize(
    "method, tolerance", [("direct", 1e-2), ("direct", 1e-4), ("direct", 1e-6), ("factorized", 1e-2)]
)
def test_the_same_error_at_10_km_and_at_800_km(monkeypatch, method, tolerance):
    grid = sarcl.ImageGrid.plane(shape=(96, 96), spacing=0.3)

    def focused(raw):
        image = sarcl.backproject(raw, grid, tolerance=tolerance, method=method, check=False)
        assert image.report.plan["method"] == method
        return image_error(image, raw, most=200, exact=quick_sum), image.report.predicted_error

    plans, honest = [], direct.make_plan
    monkeypatch.setattr(direct, "make_plan", lambda *a: plans.append(honest(*a)) or plans[-1])
    near, predicted = focused(arc_at(10e3))
    far, far_predicted = focused(arc_at(800e3))
    assert near <= predicted <= tolerance and far <= far_predicted <= tolerance
    if method == "direct":
        # less curvature allows cheaper plans, so the errors are compared for the plan of 10 km
        monkeypatch.setattr(direct, "make_plan", lambda *a: plans[0])
        far, _ = focused(arc_at(800e3))
    assert far <= 1.5 * near


def test_one_pixel_at_a_null_of_its_only_pulse():
    # the profile of a flat spectrum is zero at whole resolution cells: what is asked is relative to next to nothing
    n = 64
    tx = np.array([[-7e3, 0, 7e3]])
    raw = sarcl.PhaseHistory(
        np.ones((1, n), np.complex64), frequency=9.6e9, frequency_step=300e6 / n, tx=tx,
        reference_range=np.linalg.norm(tx, axis=1),
    )  # fmt: skip
    cell = 299792458.0 / 2 / 300e6
    away = (np.linalg.norm(tx[0]) + 3 * cell) * tx[0] / -np.linalg.norm(tx[0]) + tx[0]  # 3 cells beyond the reference
    grid = sarcl.ImageGrid.points((away * (1 + 1e-5))[None])
    for tolerance in (1e-1, 1e-3):
        try:
            image = sarcl.backproject(raw, grid, tolerance=tolerance, check=False)
        except ValueError as exc:
            assert "the best" in str(exc)
            continue
        assert image_error(image, raw, most=300) <= tolerance


def test_a_patch_far_darker_than_what_is_in_the_same_rows():
    # a bright point and, 400 resolution cells away, its side lobes under a taper: 100 dB darker
    n, n_rows = 2048, 24
    tx = np.stack([np.full(n_rows, -7e3), np.linspace(-20, 20, n_rows), np.full(n_rows, 7e3)], axis=1)
    raw = sarcl.PhaseHistory(
        np.broadcast_to(np.hanning(n).astype(np.complex64), (n_rows, n)), frequency=9.5e9, frequency_step=600e6 / n,
        tx=tx, reference_range=np.linalg.norm(tx, axis=1),
    )  # fmt: skip
    grid = sarcl.ImageGrid.plane(center=(120, 0, 0), shape=(24, 24), spacing=0.3)
    for tolerance in (1e-1, 1e-2, 1e-3):
        image = sarcl.backproject(raw, grid, tolerance=tolerance, check=False)
        assert image_error(image, raw, most=300) <= image.report.predicted_error <= tolerance * (1 + 1e-12)
