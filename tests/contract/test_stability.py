"""Inputs on which naive sums fail: many pulses, high contrast, antennas among pixels, odd lengths, tiny values."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from helpers.cases import image_error, noise_history, noise_on, straight

import sarcl
from sarcl.bench.exact import backproject as quick_sum
from sarcl.imaging.factorized import factorized
from sarcl.reference.backproject import backproject as exact

C = 299792458.0
SLOW = pytest.mark.slow


@pytest.fixture
def sights(monkeypatch):
    """The coverage of the largest tiles by rows in factorised runs."""
    seen, coverage_of = [], factorized.coverage_of
    monkeypatch.setattr(factorized, "coverage_of", lambda *a: seen.append(coverage_of(*a)) or seen[-1])
    return seen


def exact_sum_of_equal_rows(raw, points):
    """The image equation where every row has the same samples, all equal: the sum over samples is a polynomial.

    Float64: over tracks of a few metres at 10 km its error is 1e-10.
    """
    turns, total = 2 / C * raw.frequency_step[0], np.zeros(len(points), complex)
    for first in range(0, raw.n_rows, 5000):
        rows = slice(first, first + 5000)
        path = np.linalg.norm(raw.tx[rows, None] - points, axis=2) - raw.reference_range[rows, None]
        z = np.exp(2j * np.pi * turns * path)
        powers = np.polynomial.polynomial.polyval(z, np.ones(raw.n_samples))
        total += (np.exp(4j * np.pi / C * raw.frequency[0] * path) * powers).sum(axis=0)
    return total * raw.samples[0, 0]


def equal_rows(n):
    """Echoes of a point at the centre, the same in every row: rounding that always falls one way would add up."""
    track = np.stack([np.full(n, -7e3), np.linspace(-1, 1, n), np.full(n, 7e3)], axis=1)
    samples = np.broadcast_to(np.complex64(0.3 + 0.7j), (n, 4))
    reference = np.linalg.norm(track, axis=1)
    return sarcl.PhaseHistory(samples, frequency=9.45e9, frequency_step=75e6, tx=track, reference_range=reference)


def test_the_exact_sum_of_equal_rows_is_the_reference():
    points = np.random.default_rng(0).uniform(-0.5, 0.5, (9, 3))  # the window is 1 m
    wanted, _ = exact(equal_rows(300), points)
    assert np.linalg.norm(exact_sum_of_equal_rows(equal_rows(300), points) - wanted) <= 1e-9 * np.linalg.norm(wanted)


def hold_at(few, n, method, device, finer=1):
    """finer  ratio of the pixel spacings for n and for `few` pulses"""
    errors = []
    for raw, fine in ((equal_rows(few), finer), (equal_rows(n), 1)):
        grid = sarcl.ImageGrid.plane(shape=(16 * fine, 16 * fine), spacing=0.1 / fine)
        at = np.random.default_rng(0).choice(grid.size, 16, replace=False)
        image = sarcl.backproject(raw, grid, tolerance=1e-4, method=method, device=device, check=False)
        assert image.report.plan["method"] == method
        wanted = exact_sum_of_equal_rows(raw, grid.positions.reshape(-1, 3)[at])
        errors.append(np.linalg.norm(image.data.ravel()[at] - wanted) / np.linalg.norm(wanted))
        assert errors[-1] <= image.report.predicted_error <= 1e-4
    # the error common to all rows remains; the rounding of the sum itself is compensated and adds almost nothing
    assert errors[1] <= 1.1 * errors[0] + 3e-7


# rounding of a float32 total that is not compensated could reach n/64 2^-25: 1e-4 for 200 000 pulses
@pytest.mark.parametrize(
    "method, n",
    [
        ("direct", 200_000),
        pytest.param("factorized", 50_000, marks=SLOW),
        pytest.param("direct", 1_000_000, marks=SLOW),
        pytest.param("factorized", 250_000, marks=SLOW),
    ],
)
def test_the_error_does_not_grow_with_the_number_of_pulses(method, n):
    hold_at(1000, n, method, None)


@SLOW
def test_the_error_does_not_grow_with_the_number_of_pulses_on_any_device(device):
    # 1e7 pairs of pulse and pixel in both: devices of one lane share lines and take their own sine
    hold_at(1000, 200_000, "direct", device, finer=7)


def test_a_point_120_db_below_its_neighbour_is_seen_at_1e_7():
    n, n_samples = 256, 256
    track = np.stack([np.full(n, -7e3), np.linspace(-60, 60, n), np.full(n, 7e3)], axis=1)
    frequency = 9.6e9 - 150e6 + 300e6 / n_samples * np.arange(n_samples)
    reference = np.linalg.norm(track, axis=1)

    def echo(x, amplitude):
        path = np.linalg.norm(track.astype(np.longdouble) - np.longdouble(x), axis=1) - reference
        turns = (2 * path[:, None] / np.longdouble(C) * frequency) % 1
        return amplitude * np.exp(-2j * np.pi * turns.astype(np.float64))

    weak = np.array([8.0, 6.0, 0.0])
    both = echo(np.zeros(3), 1.0) + echo(weak, 1e-6)
    raw = sarcl.PhaseHistory(
        both, frequency=frequency[0], frequency_step=300e6 / n_samples, tx=track, reference_range=reference
    )
    grid = sarcl.ImageGrid.plane(shape=(110, 110), spacing=0.2)
    image = sarcl.backproject(raw, grid, tolerance=1e-7, check=False)
    assert image.data.dtype == np.complex128
    at = (55 + 30, 55 + 40)
    strong = sarcl.PhaseHistory(
        echo(np.zeros(3), 1.0), frequency=frequency[0], frequency_step=300e6 / n_samples, tx=track,
        reference_range=reference,
    )  # fmt: skip
    rest = image.data[at] - exact(strong, grid.at(*np.array(at))[None])[0][0]
    gained = 1e-6 * n * n_samples
    assert abs(20 * np.log10(abs(rest) / gained)) < 1
    # at looser tolerances the report says how far down the image can be trusted
    loose = sarcl.backproject(raw, grid, tolerance=1e-3, check=False)
    assert loose.report.dynamic_range_db == pytest.approx(-20 * np.log10(loose.report.predicted_error))


@pytest.mark.parametrize("bistatic", [False, True])
def test_pixels_at_the_antenna_and_behind_it(device, bistatic):
    # antennas among the pixels: one sits exactly on a pixel, others beyond the far side
    random = np.random.default_rng(0)
    tx = np.array([[0.0, 0, 0], [0.5, -0.5, 0], [-1.0, 1.0, 0.25], [30.0, 0, 0]])
    rx = tx[::-1].copy() if bistatic else None
    samples = random.standard_normal((4, 64)) + 1j * random.standard_normal((4, 64))
    raw = sarcl.PhaseHistory(
        samples.astype(np.complex64), frequency=1e9, frequency_step=2e6, tx=tx, rx=rx, reference_range=0.0
    )
    grid = sarcl.ImageGrid.plane(shape=(17, 17), spacing=0.25)
    for tolerance in (1e-2, 1e-5):
        image = sarcl.backproject(raw, grid, tolerance=tolerance, device=device, check=False)
        assert np.isfinite(image.data).all()
        assert image_error(image, raw) <= image.report.predicted_error <= tolerance * (1 + 1e-12)


def test_direct_pixels_on_both_sides_of_the_range_window():
    # the window ends between pixels, and far outside everything is exactly zero
    tx = np.stack([np.full(200, -10e3), np.linspace(-10, 10, 200), np.zeros(200)], axis=1)
    raw = noise_on(tx, n_samples=64)
    half = C / 2 / 300e6 * 64 / 2
    grid = sarcl.ImageGrid.plane(shape=(40, 400), spacing=0.25)
    image = sarcl.backproject(raw, grid, tolerance=1e-2, method="direct", check=False)
    assert image_error(image, raw, most=500, exact=quick_sum) <= image.report.predicted_error <= 1e-2
    assert not image.data[:, np.abs(grid.positions[0, :, 0]) > half + 1].any()


def test_sub_apertures_on_both_sides_of_a_window_that_moves(sights):
    # of a large tile that the edge crosses, some rows see all, some a part, some nothing
    raw = noise_on(straight(400), n_samples=384)
    raw = replace(raw, reference_range=raw.reference_range + np.linspace(-30, 30, 400))
    grid = sarcl.ImageGrid.plane(shape=(150, 1100), spacing=0.25)
    image = sarcl.backproject(raw, grid, tolerance=1e-2, method="factorized", check=False)
    (coverage,) = sights
    merged = [rows for rows, some in zip(coverage.left_out, coverage.merged, strict=True) if some]
    assert coverage.directly and any(rows is not None and rows.any() for rows in merged)
    crossed = np.flatnonzero(np.abs(grid.positions[..., 0]) > 94)  # by the edge, at 137 +- 43 m on the ground
    for among in (None, crossed):
        assert image_error(image, raw, most=100, among=among, exact=quick_sum) <= image.report.predicted_error <= 1e-2


@pytest.mark.parametrize("method", ["direct", "factorized"])
def test_a_pixel_exactly_on_the_windows_edge_falls_to_either_side(sights, method):
    # rows are equal and every one has its window's edge at the same pixel, as near as float64 can tell
    n, height = 400, 150 if method == "factorized" else 20
    grid = sarcl.ImageGrid.plane(shape=(height, 1000), spacing=0.25)
    edge = height // 2, 700
    point = grid.at(*map(np.array, edge))
    plain = noise_on(straight(n), n_samples=256)
    half = C / 4 / plain.frequency_step[0]
    samples = np.broadcast_to(plain.samples[:1], plain.samples.shape)
    raw = replace(plain, samples=samples, reference_range=np.linalg.norm(plain.tx - point, axis=1) - half)
    image = sarcl.backproject(raw, grid, tolerance=1e-2, method=method, check=False)
    assert [coverage.merged.any() for coverage in sights] == [True] * (method == "factorized")
    each = exact(raw[:1], point[None], wrap=True)[0][0]
    rows_in = image.data[edge] / each  # each row adds the same, or nothing
    assert abs(rows_in - np.clip(rows_in.real, 0, n)) <= 1e-2 * n
    others = np.delete(np.arange(grid.size), np.ravel_multi_index(edge, grid.shape))
    assert image_error(image, raw, most=100, among=others, exact=quick_sum) <= image.report.predicted_error <= 1e-2


def test_coincident_points_get_the_same_pixel():
    raw = noise_history()
    one = np.array([3.0, -2.0, 0.1])
    image = sarcl.backproject(raw, sarcl.ImageGrid.points(np.broadcast_to(one, (300, 3)).copy()), tolerance=1e-4)
    assert (image.data == image.data[0]).all()
    assert image_error(image, raw) <= 1e-4


@pytest.mark.parametrize("n_samples", [1, 2, 3, 127, 1021, 4099])
def test_odd_prime_and_tiny_numbers_of_samples(device, n_samples):
    raw = noise_history(n_rows=12, n_samples=n_samples)
    grid = sarcl.ImageGrid.plane(shape=(12, 12), spacing=0.3)
    for tolerance in (1e-2, 1e-5):
        image = sarcl.backproject(raw, grid, tolerance=tolerance, device=device, check=False)
        assert image_error(image, raw) <= image.report.predicted_error <= tolerance * (1 + 1e-12)


def test_tiny_values_keep_their_digits(device):
    raw = noise_history(n_rows=20)
    grid = sarcl.ImageGrid.plane(shape=(20, 20), spacing=0.3)
    plain = sarcl.backproject(raw, grid, tolerance=1e-4, device=device, check=False)
    for scale in (1e-30, 1e-34, 1e30):
        scaled = sarcl.PhaseHistory(
            raw.samples.astype(np.complex128) * scale, frequency=raw.frequency, frequency_step=raw.frequency_step,
            tx=raw.tx, reference_range=raw.reference_range,
        )  # fmt: skip
        image = sarcl.backproject(scaled, grid, tolerance=1e-4, device=device, check=False)
        difference = np.linalg.norm(image.data.astype(np.complex128) / scale - plain.data)
        assert difference <= 1e-4 * np.linalg.norm(plain.data)


@pytest.mark.parametrize("method", ["auto", "direct", "factorized"])
def test_denormal_samples_are_refused_in_complex64_and_right_in_complex128(method):
    # 1e-41 leaves complex64 13 bits, 1e-45 none
    raw, grid = noise_history(n_rows=20), sarcl.ImageGrid.plane(shape=(20, 20), spacing=0.3)
    for scale in (1e-41, 1e-44):
        tiny = replace(raw, samples=(raw.samples.astype(np.complex128) * scale).astype(np.complex64))
        assert 0 < np.abs(tiny.samples).max() < np.finfo(np.float32).tiny
        with pytest.raises(ValueError, match=r"complex64 loses digits below .*scale the samples up"):
            sarcl.backproject(tiny, grid, tolerance=1e-3, method=method, check=False)
    if method != "factorized":
        image = sarcl.backproject(tiny, grid, tolerance=1e-7, method=method, check=False)
        assert image_error(image, tiny) <= image.report.predicted_error <= 1e-7


@pytest.mark.parametrize("method", ["direct", "factorized"])
def test_reference_ranges_off_by_three_quarters_of_a_millimetre(method):
    # Gotcha's reference ranges disagree with its positions by so much: a phase, not an error of the sum
    raw = noise_on(straight(300), n_samples=64)
    raw = replace(raw, reference_range=raw.reference_range + 0.75e-3 * np.random.default_rng(2).uniform(-1, 1, 300))
    grid = sarcl.ImageGrid.plane(shape=(70, 70), spacing=0.25)
    image = sarcl.backproject(raw, grid, tolerance=1e-2, method=method, check=False)
    assert image.report.plan["method"] == method
    assert image_error(image, raw, most=500, exact=quick_sum) <= image.report.predicted_error <= 1e-2


@pytest.mark.parametrize("method", ["direct", "auto"])
def test_every_pulse_with_a_frequency_plan_of_its_own(device, method):
    n, random = 60, np.random.default_rng(3)
    raw = noise_on(straight(n), n_samples=48)
    raw = replace(raw, frequency=9.5e9 + 2e8 * random.uniform(size=n), frequency_step=random.uniform(4e6, 8e6, n))
    grid = sarcl.ImageGrid.plane(shape=(40, 40), spacing=0.3)
    for tolerance in (1e-2, 1e-4):
        image = sarcl.backproject(raw, grid, tolerance=tolerance, method=method, device=device, check=False)
        assert image_error(image, raw) <= image.report.predicted_error <= tolerance * (1 + 1e-12)


def test_the_same_bits_every_time():
    raw = noise_on(straight(300), n_samples=64)
    grid = sarcl.ImageGrid.plane(shape=(100, 100), spacing=0.3)
    for method in ("direct", "factorized"):
        a, b = (sarcl.backproject(raw, grid, tolerance=3e-2, method=method, check=False).data for _ in range(2))
        assert (a == b).all()
