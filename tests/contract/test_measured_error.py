"""The check that measures a report's error: its paths, the window edges it excludes, and its messages."""

from __future__ import annotations

from dataclasses import replace
from decimal import Decimal, getcontext

import numpy as np
import pytest
from helpers.cases import noise_history

import sarcl
from sarcl.imaging.direct import line_plan
from sarcl.imaging.method_choice import kept_plans
from sarcl.numerics import interpolation, interpolator_choice
from sarcl.reference.backproject import backproject as exact
from sarcl.reference.geometry import half_path

C = 299792458.0


@pytest.mark.parametrize("distance", [1e-3, 1.0, 1e4, 3.6e7, 4e8])
def test_the_reference_paths_are_those_of_fifty_digits(distance):
    getcontext().prec = 50
    random = np.random.default_rng(0)
    tx = random.standard_normal(3)
    tx *= distance / np.linalg.norm(tx)
    rx = tx + 0.3 * distance * random.standard_normal(3)
    points = random.standard_normal((20, 3)) * min(100.0, distance)
    reference = float(np.linalg.norm(tx) + np.linalg.norm(rx)) / 2

    def length(a, b):
        return sum((Decimal(float(u)) - Decimal(float(v))) ** 2 for u, v in zip(a, b, strict=True)).sqrt()

    for got, x in zip(half_path(tx, rx, points, reference), points, strict=True):
        wanted = (length(x, tx) + length(x, rx)) / 2 - Decimal(reference)
        high = float(got)
        # the rest is the rounding of the result, of the size of the scene, and of the range to twice the digits
        error = abs(Decimal(high) + Decimal(float(got - np.longdouble(high))) - wanted)
        assert error <= Decimal(1e-19 * min(200.0, distance) + 1e-25 * distance)


@pytest.fixture
def too_small(monkeypatch):
    """Interpolators whose error is a thousand times the predicted one."""
    honest = interpolation.interpolator
    monkeypatch.setattr(interpolation, "interpolator", lambda *a: replace(honest(*a), error=honest(*a).error / 1000))
    monkeypatch.setattr(interpolation, "lower_bound", lambda taps, oversample: 0.0)
    monkeypatch.setattr(line_plan, "choose", lambda *a, **k: None)
    clear_choices()
    yield
    clear_choices()


def clear_choices():
    interpolator_choice.choose_interpolator.cache_clear()
    interpolator_choice.least_error.cache_clear()
    kept_plans.clear()


def test_a_tolerance_that_was_missed_is_an_error_that_keeps_the_image(too_small, tmp_path):
    raw, grid = noise_history(), sarcl.ImageGrid.plane(shape=(24, 24), spacing=0.3)
    out = tmp_path / "image.h5"
    for target in (None, out):
        with pytest.raises(sarcl.ToleranceMissed, match=r"tolerance 1\.0e-04 was missed") as missed:
            sarcl.backproject(raw, grid, tolerance=1e-4, check=True, out=target)
        image = missed.value.image
        assert isinstance(missed.value, ValueError) and missed.value.measured == image.report.measured_error > 1e-4
        assert np.asarray(image.data).all()
    assert (np.asarray(sarcl.read(out).data) == np.asarray(image.data)).all()


@pytest.mark.parametrize("distance", [10e3, 36e6])
def test_pixels_on_the_edge_of_a_window_are_not_counted_as_wrong(distance):
    # a column of pixels exactly where |tau - tau_ref| = 1/(2 frequency_step)
    n_samples, step = 64, 4e6
    half = C / (4 * step)
    tx = np.array([[-distance, 0.0, 0.0]])
    samples = np.random.default_rng(1).standard_normal((1, n_samples)).astype(np.complex64)
    raw = sarcl.PhaseHistory(samples, frequency=9.6e9, frequency_step=step, tx=tx, reference_range=[distance])
    grid = sarcl.ImageGrid.plane(center=(half, 0, 0), shape=(1, 9), spacing=half / 4)
    image = sarcl.backproject(raw, grid, tolerance=1e-4, check=True)
    assert 0 < image.report.measured_error <= 1e-4
    wanted, _ = exact(raw, grid.positions.reshape(-1, 3), edge=1e-5)
    assert np.isnan(wanted[4]) and np.isfinite(np.delete(wanted, 4)).all()
    assert not image.data[0, 5:].any() and image.data[0, :4].all()


def test_the_check_is_good_to_1e_9_at_36_000_km():
    n, n_samples, distance = 24, 64, 36e6
    tx = np.stack([np.full(n, -distance), np.linspace(-2e5, 2e5, n), np.zeros(n)], axis=1)
    random = np.random.default_rng(2)
    samples = random.standard_normal((n, n_samples)) + 1j * random.standard_normal((n, n_samples))
    raw = sarcl.PhaseHistory(
        samples, frequency=9.6e9, frequency_step=300e6 / n_samples, tx=tx, reference_range=np.linalg.norm(tx, axis=1)
    )
    image = sarcl.backproject(raw, sarcl.ImageGrid.plane(shape=(32, 32), spacing=0.3), tolerance=1e-9, check=True)
    assert image.report.measured_error <= image.report.predicted_error <= 1e-9
    assert image.report.measured_error <= 2e-10  # a float64 reference has an error of 5e-10 here
