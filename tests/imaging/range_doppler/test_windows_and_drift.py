"""Parts of range_doppler against closed forms and twins: windows over apertures, drift of two looks, sums."""

from __future__ import annotations

import numpy as np
import pytest

from sarcl.base.constants import SPEED_OF_LIGHT
from sarcl.imaging.range_doppler import _focus, _map_drift
from sarcl.imaging.range_doppler._aperture_window import ApertureWindow
from sarcl.numerics import windows
from sarcl.reference import map_drift as twin

TAYLOR = ("taylor", 35, 5)
ZONE = 0.002  # sine of the squint angle over a Fresnel zone
WAVE = SPEED_OF_LIGHT / 9.6e9


@pytest.mark.parametrize("zones", [8, 30])
def test_the_error_of_weights_is_that_of_the_smooth_ends_of_a_beam(zones):
    # measured with white noise for ends of k Fresnel zones: 0.45/(k^3 sqrt n), docs/theory/range_doppler.md
    box = np.ones(windows.TABLE)
    half = zones * ZONE / 2
    # an eighth of the width within the beam, whatever share of the rows is left beyond it
    made = ApertureWindow.over(-half, half, box, ZONE, 3e-3, inwards=(1 / 8,))
    width = np.ptp(made.ends) / ZONE - zones
    k = width / (1 - 2 / 8)  # the window begins an eighth of a width within the beam
    assert made.error == pytest.approx(0.5 / (k**3 * np.sqrt(zones)), rel=0.35) and made.error <= 3e-3


@pytest.mark.parametrize("zones", [4, 8, 30])
def test_hardly_any_weight_is_left_to_rows_beyond_the_beam(zones):
    half = zones * ZONE / 2
    for window in ("boxcar", "hamming", "hann", TAYLOR):
        made = ApertureWindow.over(-half, half, windows.table(window), ZONE, 3e-2)
        rows = made.weights / (1 - made.sines**2) ** 1.5  # even in the tangent of the squint angle
        assert rows[np.abs(made.sines) > half].sum() <= 4e-3 * rows.sum()


@pytest.mark.parametrize("window", ["hamming", TAYLOR, "hann", "triang"])
def test_smoothing_keeps_the_window_and_its_sum(window):
    table, half = windows.table(window), 40 * ZONE / 2
    made = ApertureWindow.over(-half, half, table, ZONE, 2.5e-3)
    step = made.sines[1] - made.sines[0]
    u = np.clip((made.sines + half) / (2 * half), 0, 1)
    wanted = np.interp(u, (np.arange(len(table)) + 0.5) / len(table), table)
    middle = np.abs(made.sines) < 0.8 * half
    assert np.abs(made.weights - wanted)[middle].max() < 0.03
    assert made.weights.sum() * step / (2 * half) == pytest.approx(table.mean(), rel=0.02)
    assert made.weight(np.array([-2 * half, 2 * half])) == pytest.approx([0, 0], abs=0)


def test_a_window_beside_the_direction_of_flight_counts_no_rows_beyond_it():
    """The window's smooth end reaches sines above 1, under which no row sees anything: the share of rows was NaN."""
    made = ApertureWindow.over(0.9, 1.0, windows.table("hamming"), 0.002, 3e-2)
    assert made.sines[-1] > 1
    rows = made.weights[made.sines < 1] / (1 - made.sines[made.sines < 1] ** 2) ** 1.5
    beyond = made.sines[made.sines < 1] < 0.9
    assert made.outside(0.9, 1.0) == pytest.approx(rows[beyond].sum() / rows.sum(), rel=1e-12)


@pytest.mark.parametrize("seed", range(3))
def test_the_correlation_is_that_of_the_twin(seed):
    random = np.random.default_rng(seed)
    first, second = random.uniform(0, 1, (2, 31 + seed, 5))
    spectrum = _map_drift.cross_spectrum(first, second)
    for lag in (0.0, 3.0, -2.4, 7.125):
        assert _map_drift.correlation(spectrum, lag) == pytest.approx(twin.correlation(first, second, lag), abs=1e-10)


@pytest.mark.parametrize("doppler", [(-60.0, 60.0), (1200.0, 1500.0), (-2500.0, -2000.0)])
def test_looks_are_displaced_as_the_twin_says(doppler):
    ranges, speeds = np.array([3e3, 4e3]), np.array([101.0, 100.0])
    looks = _map_drift.Looks(np.zeros((1, 2)), np.zeros((1, 2)), ranges, speeds, 1e-3, doppler, WAVE)
    found = _map_drift.displacement(looks, ranges, speeds, 1.02)
    for got, r, v in zip(found, ranges, speeds, strict=True):
        assert got == pytest.approx(twin.displacement(v, v * np.sqrt(1.02), r, WAVE, doppler), rel=1e-3)


def test_a_moved_look_gives_the_factor_that_moves_it():
    """Bumps displaced by the closed form of small angles, (q2 - q1) lambda r/2 (1/v0^2 - 1/v^2)."""
    n, row, ranges = 400, 1e-2, np.linspace(3e3, 5e3, 40)
    speeds, doppler, factor = np.full(40, 100.0), (-150.0, 150.0), 1.03
    late = (doppler[1] - doppler[0]) * WAVE * ranges / 2 * (1 - 1 / factor) / 100.0**2 / row  # rows
    places = np.random.default_rng(1).uniform(60, 340, (3, 40))

    def look(moved):
        return np.exp(-((np.arange(n)[:, None, None] - places - moved) ** 2) / 18).sum(axis=1)

    looks = _map_drift.Looks(look(0.0), look(late), ranges, speeds, row, doppler, WAVE)
    assert _map_drift.factor_of(looks) == pytest.approx(factor, abs=2e-4)


@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize("n", [5, 1024, 2500])
def test_sums_are_those_of_the_equation(n, sign):
    random = np.random.default_rng(n)
    values = (random.normal(size=(n, 3)) + 1j * random.normal(size=(n, 3))).astype(np.complex64)
    places, wanted, period = random.integers(-900_000, 900_000, n), np.array([-7, 0, 4, 123_456]), 333_000
    found = _focus.sums(values, places, wanted, period, sign)
    exact = np.exp(sign * 2j * np.pi * np.outer(wanted, places) / period) @ values
    assert np.linalg.norm(found - exact) <= 4e-7 * np.linalg.norm(exact)
