"""Autofocus: known errors are added to echoes computed from the formula (or measured), and must be removed."""

from __future__ import annotations

import functools
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from helpers.cases import quick_of

import sarcl
from sarcl.base.constants import SPEED_OF_LIGHT
from sarcl.model.lazy_rows import Columns, Scaled, Tapered
from sarcl.phase_correction import _phase_gradient, _phase_smoothing
from sarcl.phase_correction._aperture_view import ApertureView, narrow_pulses
from sarcl.phase_correction._bright_points import brightest, contributions
from sarcl.phase_correction._echo_parts import without_constant_echo
from sarcl.reference.backproject import backproject as exact_image

CENTER, BANDWIDTH, N_SAMPLES, N_PULSES, SIDE = 9.6e9, 300e6, 96, 128, 30.0
CELL = SPEED_OF_LIGHT / (2 * BANDWIDTH)
GRID = sarcl.ImageGrid.plane(shape=(120, 120), spacing=SIDE / 120)
# An aperture that resolves 0.5 m on the ground, seen from the x axis, 34 deg above it
ARC = SPEED_OF_LIGHT / CENTER / 2 / 0.5 / np.cos(0.6)


def arc(n=N_PULSES, *, middle=0.0, extent=ARC, distance=5e3):
    """Antenna positions, m (n, 3)."""
    a = middle + extent * (np.arange(n) / (n - 1) - 0.5)
    return distance * np.stack([np.cos(a) * np.cos(0.6), np.sin(a) * np.cos(0.6), np.full(n, np.sin(0.6))], axis=1)


def echoes(points, amplitudes, tx, rx=None, *, center=CENTER, bandwidth=BANDWIDTH, n_samples=N_SAMPLES, **fields):
    """The echo equation, term by term in float64; the reference is the origin."""
    rx = tx if rx is None else rx
    reference = (np.linalg.norm(tx, axis=1) + np.linalg.norm(rx, axis=1)) / 2
    step = bandwidth / n_samples
    frequency = center + (np.arange(n_samples) - (n_samples - 1) / 2) * step
    path = np.linalg.norm(tx[:, None] - points, axis=2) + np.linalg.norm(rx[:, None] - points, axis=2)
    delay = (path - 2 * reference[:, None]) / SPEED_OF_LIGHT
    ramp = np.exp(-2j * np.pi * step * delay)
    term = amplitudes * np.exp(-2j * np.pi * frequency[0] * delay)
    samples = np.empty((len(tx), n_samples), np.complex64)
    for n in range(n_samples):
        samples[:, n] = term.sum(axis=1)
        term = term * ramp
    return sarcl.PhaseHistory(
        samples, frequency=frequency[0], frequency_step=step, tx=tx, rx=rx, reference_range=reference, **fields
    )


def scatterers(bright_points=20, speckle=0, contrast=10.0, seed=0, side=SIDE):
    """Points on the ground, m (n, 3), and amplitudes: some bright, the rest of unit mean power."""
    random = np.random.default_rng(seed)
    n = bright_points + speckle
    points = np.concatenate([random.uniform(-0.4, 0.4, (n, 2)) * side, np.zeros((n, 1))], axis=1)
    amplitudes = (random.standard_normal(n) + 1j * random.standard_normal(n)) / np.sqrt(2)
    amplitudes[:bright_points] *= contrast
    return points, amplitudes


def noisy(raw, level, seed=0):
    """raw with white noise of `level` times its rms."""
    random = np.random.default_rng(seed)
    noise = random.standard_normal(raw.samples.shape) + 1j * random.standard_normal(raw.samples.shape)
    rms = np.sqrt((np.abs(raw.samples) ** 2).mean())
    return replace(raw, samples=(raw.samples + level * rms / np.sqrt(2) * noise).astype(np.complex64))


def disturbed(raw, phase, shift=0.0):
    """raw times exp(j phase) exp(-j 4 pi (f - f0) shift/c), f0 the middle of the band."""
    away = raw.frequency_step[:, None] * (np.arange(raw.n_samples) - (raw.n_samples - 1) / 2)
    shift = np.broadcast_to(shift, raw.n_rows)[:, None]
    turn = np.exp(1j * np.asarray(phase)[:, None] - 4j * np.pi / SPEED_OF_LIGHT * away * shift)
    return replace(raw, samples=(raw.samples * turn).astype(np.complex64))


def smooth(n, seed, *, modes=8, rms=None, peak=None):
    """A seeded sum of falling cosines without slope, rad (n,)."""
    random = np.random.default_rng(seed)
    t = np.linspace(-1, 1, n)
    curve = sum(random.standard_normal() / k * np.cos(np.pi * k * (t + 1) / 2) for k in range(1, modes + 1))
    curve = flat(curve)
    return curve * (rms / np.sqrt((curve**2).mean()) if rms else peak / np.abs(curve).max())


def flat(curve):
    """A curve minus its straight line, which only displaces the image."""
    t = np.arange(len(curve))
    return curve - np.polyval(np.polyfit(t, curve, 1), t)


def random_walk(n, seed, step):
    return flat(np.cumsum(np.random.default_rng(seed).standard_normal(n) * step))


@functools.cache  # truths are shared by tests
def response(raw, grid=GRID):
    """Point response of the brightest point, on a patch of its own."""
    level = np.abs(sarcl.backproject(raw, grid, tolerance=1e-3).data)
    at = grid.at(*np.unravel_index(level.argmax(), level.shape))
    spacing = min(grid.spacing) / 2
    patch = sarcl.ImageGrid.plane(center=at, shape=(161, 161), spacing=spacing)
    return sarcl.measure(sarcl.backproject(raw, patch, tolerance=1e-3), near=at)


@functools.cache
def highest(raw, grid=GRID):
    """Of all pixels."""
    return np.abs(sarcl.backproject(raw, grid, tolerance=1e-3).data).max()


def assert_as_sharp(raw, truth, decibels=0.5, width=0.05, grid=GRID):
    """The brightest point of raw stands as high as that of `truth` and is as wide."""
    got, wanted = response(raw, grid), response(truth, grid)
    assert abs(20 * np.log10(abs(got.peak) / abs(wanted.peak))) <= decibels
    assert got.irw == pytest.approx(wanted.irw, rel=width)
    return np.linalg.norm(got.position - wanted.position)


def residual(raw, phase, found, frequency=CENTER):
    """rms difference of two phases, rad, less the mean and what shifts of the scene by metres do, from the geometry."""
    ends = raw.tx, raw.rx
    shifts = [sum(np.linalg.norm(e - d, axis=1) - np.linalg.norm(e, axis=1) for e in ends) for d in np.eye(3)[:2]]
    basis = np.stack([np.ones(raw.n_rows), *(2 * np.pi * frequency / SPEED_OF_LIGHT * s for s in shifts)], axis=1)
    basis -= basis.mean(axis=0) * (np.arange(3) > 0)
    apart = np.unwrap(np.angle(np.exp(1j * (found - phase))))
    # across range alone: in range, over so short an arc, a shift is a constant, and a bend is no shift
    return np.std(apart - basis[:, [0, 2]] @ np.linalg.lstsq(basis[:, [0, 2]], apart, rcond=None)[0])


@pytest.fixture(scope="module")
def points():
    return echoes(*scatterers(), arc())


ERRORS = {
    "smooth, 10 rad peak": smooth(N_PULSES, 1, peak=10),
    "smooth, 10 rad rms": smooth(N_PULSES, 2, rms=10),
    "polynomial of order 10": flat(
        np.polynomial.legendre.legval(np.linspace(-1, 1, N_PULSES), [0, 0, 2, -4, 3, 3, -3, 2, 2, -2, 3])
    ),
    "random walk, 0.5 rad a pulse": random_walk(N_PULSES, 3, 0.5),
}


@pytest.mark.parametrize("name", quick_of(["smooth, 10 rad rms", "random walk, 0.5 rad a pulse"], ERRORS))
def test_a_phase_error_is_removed(points, name):
    phase = ERRORS[name]
    raw = disturbed(points, phase)
    better, errors = sarcl.autofocus(raw, GRID, range_errors="rms" in name)
    assert errors.found
    assert not errors.range.any()  # nor where one was looked for
    assert residual(raw, phase, errors.phase) <= 0.15
    assert assert_as_sharp(better, points) <= CELL
    # what was blurred in the first place
    assert highest(raw) < 0.75 * highest(points)
    # the correction is what the estimate says
    wanted = raw.samples * np.exp(-1j * errors.phase)[:, None]
    assert np.abs(better.samples - wanted).max() <= 1e-5 * np.abs(wanted).max()


@pytest.mark.slow
def test_squinted_straight_track():
    n = N_PULSES
    squint = np.radians(50)
    length = ARC * 5e3 / np.cos(squint)
    along = 5e3 * np.cos(0.6) * np.sin(squint) + length * (np.arange(n) / (n - 1) - 0.5)
    tx = np.stack([np.full(n, 5e3 * np.cos(0.6) * np.cos(squint)), along, np.full(n, 5e3 * np.sin(0.6))], axis=1)
    truth = echoes(*scatterers(), tx)
    better, errors = sarcl.autofocus(disturbed(truth, smooth(n, 4, rms=10)), GRID, range_errors=False)
    assert errors.found
    fine = sarcl.ImageGrid.plane(shape=(240, 240), spacing=SIDE / 240)
    assert abs(20 * np.log10(highest(better, fine) / highest(truth, fine))) <= 0.5


@pytest.mark.slow
def test_bistatic_with_a_receiver_elsewhere():
    truth = echoes(*scatterers(seed=1), arc(extent=2 * ARC), arc(middle=0.9, extent=ARC / 2))
    phase = smooth(N_PULSES, 5, rms=10)
    better, errors = sarcl.autofocus(disturbed(truth, phase), GRID, range_errors=False)
    assert errors.found
    assert_as_sharp(better, truth)


@pytest.mark.slow
def test_points_in_speckle_and_noise():
    truth = noisy(echoes(*scatterers(8, 1500, contrast=20, seed=2), arc()), 0.3)
    phase = smooth(N_PULSES, 6, rms=10)
    better, errors = sarcl.autofocus(disturbed(truth, phase), GRID)
    assert errors.found
    assert errors.modes < N_PULSES  # smoothed, for noise does not pay
    assert residual(truth, phase, errors.phase) <= 0.3
    assert_as_sharp(better, truth)


@pytest.mark.parametrize(
    "tied",
    [pytest.param(True, id="from motion", marks=pytest.mark.slow), pytest.param(False, id="beside another phase")],
)
def test_a_range_error_of_several_cells_is_removed(tied):
    center, n, bandwidth, side = 3e9, 160, 600e6, 12.0
    cell = SPEED_OF_LIGHT / (2 * bandwidth)
    extent = SPEED_OF_LIGHT / center / 2 / 0.25 / np.cos(0.6)
    points, amplitudes = scatterers(15, side=side, seed=3)
    truth = echoes(points, amplitudes, arc(n, extent=extent), center=center, bandwidth=bandwidth)
    shift = 1.5 * cell * flat(np.cos(2 * np.pi * np.linspace(0, 1, n)))  # three cells from end to end
    phase = -4 * np.pi * center * shift / SPEED_OF_LIGHT if tied else smooth(n, 7, rms=10)
    raw = disturbed(truth, phase, shift)
    grid = sarcl.ImageGrid.plane(shape=(112, 112), spacing=0.125)
    better, errors = sarcl.autofocus(raw, grid)
    assert errors.found
    assert np.std(flat(errors.range - shift)) <= 0.1 * cell
    assert np.array_equal(better.reference_range, raw.reference_range - errors.range)
    assert_as_sharp(better, truth, grid=grid)


@pytest.mark.slow
def test_phases_alone_do_not_mend_a_range_error(points):
    shift = 1.5 * CELL * smooth(N_PULSES, 8, rms=1)
    raw = disturbed(points, smooth(N_PULSES, 7, rms=10), shift)
    both, phases_only = sarcl.autofocus(raw, GRID), sarcl.autofocus(raw, GRID, range_errors=False)
    assert not phases_only.errors.range.any()
    assert highest(phases_only.raw) < 0.8 * highest(both.raw)


@pytest.mark.slow
def test_motion_of_a_fifth_of_a_cell_is_taken_as_motion(points):
    shift = 0.2 * CELL * smooth(N_PULSES, 8, rms=1)
    phase = -4 * np.pi * CENTER * shift / SPEED_OF_LIGHT
    _, errors = sarcl.autofocus(disturbed(points, phase, shift), GRID)
    assert np.std(flat(errors.range - shift)) <= 0.03 * CELL


@pytest.mark.parametrize(
    "speckle, noise",
    [pytest.param(0, 0.0, id="points", marks=pytest.mark.slow), pytest.param(1500, 0.5, id="in speckle and noise")],
)
def test_a_good_image_stays_good(speckle, noise):
    raw = noisy(echoes(*scatterers(12, speckle, contrast=15, seed=4), arc()), noise)
    better, errors = sarcl.autofocus(raw, GRID)
    assert np.std(errors.phase) <= 0.1
    assert not errors.range.any()
    assert assert_as_sharp(better, raw, decibels=0.05, width=0.005) <= 0.1 * CELL


def test_what_only_moves_the_image_is_left_alone(points):
    # a linear phase is an image shifted across range, here by 1.5 m: as sharp as before
    y = 4 * np.pi * CENTER / SPEED_OF_LIGHT * points.tx[:, 1] / np.linalg.norm(points.tx, axis=1)
    moved = disturbed(points, 1.5 * (y - y.mean()))
    better, errors = sarcl.autofocus(moved, GRID)
    assert np.std(errors.phase) <= 0.1
    at = response(better).position - response(points).position
    assert at == pytest.approx((0, -1.5, 0), abs=0.1 * CELL) or at == pytest.approx((0, 1.5, 0), abs=0.1 * CELL)


@pytest.mark.parametrize("seed", [0, *(pytest.param(k, marks=pytest.mark.slow) for k in range(1, 3))])
def test_noise_comes_back_as_it_was_and_the_estimate_says_so(points, seed):
    random = np.random.default_rng(seed)
    shape = points.samples.shape
    noise = (random.standard_normal(shape) + 1j * random.standard_normal(shape)).astype(np.complex64)
    raw = replace(points, samples=noise)
    better, errors = sarcl.autofocus(raw, GRID)
    assert not errors.found
    assert better is raw
    assert not errors.phase.any() and not errors.range.any()
    assert errors.agreement < 0.4
    assert "no error found" in str(errors)
    assert "grid over bright isolated points" in errors.reason


class Recording:
    """Samples that only slices can reach; the largest slice asked for is kept."""

    def __init__(self, samples):
        self.samples, self.shape, self.dtype, self.largest = samples, samples.shape, samples.dtype, 0

    def __getitem__(self, rows):
        part = self.samples[rows]
        self.largest = max(self.largest, len(part))
        return part


def test_samples_in_a_file_are_never_read_whole(points):
    many = echoes(*scatterers(10), arc(512), n_samples=32, bandwidth=100e6)
    phase = smooth(512, 9, rms=5)
    raw = disturbed(many, phase)
    source = Recording(raw.samples)
    lazy, errors = sarcl.autofocus(replace(raw, samples=source), GRID, places=30, range_errors=False)
    assert errors.found
    assert 0 < source.largest < 512
    assert isinstance(lazy.samples, Scaled)
    wanted = raw.samples * np.exp(-1j * errors.phase)[:, None]
    assert np.abs(lazy.read(300, 320) - wanted[300:320]).max() <= 1e-5 * np.abs(wanted).max()
    assert np.abs(lazy[[3, 490]].read(1, 2) - wanted[490]).max() <= 1e-5 * np.abs(wanted).max()


def test_polarisations_of_a_pulse_share_one_error_in_any_order(points):
    phase = smooth(N_PULSES, 10, rms=6)
    other = echoes(*scatterers(seed=11), arc())
    both = sarcl.concatenate([replace(disturbed(r, phase), polarization=p) for r, p in ((points, "HH"), (other, "VV"))])
    order = np.random.default_rng(12).permutation(2 * N_PULSES)
    time = np.concatenate([np.arange(N_PULSES)] * 2) * 1e-3
    mixed = replace(both, time=time)[order]
    better, errors = sarcl.autofocus(mixed, GRID, range_errors=False)
    back = np.argsort(order)
    assert np.array_equal(errors.phase[back][:N_PULSES], errors.phase[back][N_PULSES:])
    assert residual(points, phase, errors.phase[back][:N_PULSES]) <= 0.15
    assert_as_sharp(better[back][:N_PULSES], points)


def test_pulses_that_hold_nothing_are_passed_over_and_progress_is_told_to_its_end(points):
    phase = smooth(N_PULSES, 13, rms=6)
    samples = disturbed(points, phase).samples.copy()
    samples[60:68] = 0
    truth = points.samples.copy()
    truth[60:68] = 0
    told = []
    better, errors = sarcl.autofocus(
        replace(points, samples=samples), GRID, range_errors=False, progress=lambda *step: told.append(step)
    )
    assert errors.found and told == [("autofocus", k, 3) for k in range(4)]
    assert_as_sharp(better, replace(points, samples=truth))


def test_window_and_weights_weigh_the_estimate_and_the_echoes_come_back_without(points):
    phase = smooth(N_PULSES, 3, rms=6)
    raw = disturbed(points, phase)
    weights = np.hamming(N_PULSES)
    better, errors = sarcl.autofocus(raw, GRID, window=("hamming", None), weights=weights, range_errors=False)
    assert errors.found
    assert better.weight is None
    wanted = raw.samples * np.exp(-1j * errors.phase)[:, None]
    assert np.abs(better.samples - wanted).max() <= 1e-5 * np.abs(wanted).max()
    assert residual(raw, phase, errors.phase) <= 0.15


def test_rows_with_weight_zero_have_no_part_in_the_estimate(points):
    phase = smooth(N_PULSES, 3, rms=6)
    raw = disturbed(points, phase)
    spoiled = raw.samples.copy()
    spoiled[40:48] = 100 * np.random.default_rng(0).standard_normal((8, N_SAMPLES))
    weights = np.ones(N_PULSES)
    weights[40:48] = 0
    _, errors = sarcl.autofocus(replace(raw, samples=spoiled), GRID, weights=weights, range_errors=False)
    seen = weights > 0
    assert errors.found
    assert residual(raw[seen], phase[seen], errors.phase[seen]) <= 0.15


def test_a_pulse_contributes_in_its_beam_alone(points):
    toward = -points.tx / np.linalg.norm(points.tx, axis=1)[:, None]
    places = np.array([[0.0, 0, 0], [0, 9.0, 0]])
    cone = (2 * 7.0 / 5e3, toward)  # 7 m on either side of the middle
    every, within = (contributions(points, places, [0.0], 1.0, beam=beam)[:, :, 0] for beam in (None, cone))
    assert np.array_equal(within[:, 0], every[:, 0])
    assert every[:, 1].all() and not within[:, 1].any()
    phase = smooth(N_PULSES, 3, rms=6)
    beam = (cone[0], toward)
    _, errors = sarcl.autofocus(disturbed(points, phase), GRID, beam=beam, range_errors=False)
    assert errors.found and errors.reason == ""
    assert residual(points, phase, errors.phase) <= 0.15


def test_pixels_outside_every_range_window_are_warned_of_once(points):
    """A grid whose far half lies behind the unambiguous range of 48 m: one warning, whatever number of images."""
    grid = sarcl.ImageGrid.plane(center=(20, 0, 0), shape=(120, 240), spacing=0.5)
    with pytest.warns(sarcl.SarclWarning, match="of the pixels lie outside the range window of every row") as caught:
        _, errors = sarcl.autofocus(disturbed(points, smooth(N_PULSES, 14, rms=4)), grid, range_errors=False)
    assert errors.found and len(caught) == 1
    assert "wrap" not in str(caught[0].message)  # autofocus has no such argument


def test_scale_and_listed_pixels_do_not_matter(points):
    phase = smooth(N_PULSES, 14, rms=4)
    raw = disturbed(points, phase)
    shuffled = np.random.default_rng(0).permutation(GRID.positions.reshape(-1, 3))
    tiny = replace(raw, samples=(raw.samples * np.float32(2.0**-80)))
    _, errors = sarcl.autofocus(tiny, sarcl.ImageGrid.points(shuffled), range_errors=False)
    assert residual(raw, phase, errors.phase) <= 0.15


def test_every_device_finds_the_same(device, points):
    phase = smooth(N_PULSES, 15, rms=4)
    raw = disturbed(points, phase)
    _, errors = sarcl.autofocus(raw, GRID, range_errors=False, device=device)
    assert residual(raw, phase, errors.phase) <= 0.15


# --- measured data ------------------------------------------------------------------------------------------------

REFLECTOR = (-15.6, 21.6, 0.0)


@pytest.fixture(scope="module")
def gotcha(data_folder):
    folder = data_folder / "gotcha"
    if not folder.is_dir():
        pytest.skip("no Gotcha data in the data folder")
    return sarcl.read(sorted(folder.glob("*.mat")))


def assert_gotcha_refocused(raw, phase, grid):
    better, errors = sarcl.autofocus(disturbed(raw, phase), grid)
    assert errors.found
    assert_as_sharp(better, raw, grid=grid)


@pytest.mark.slow
def test_gotcha_with_ten_radians_comes_back(gotcha):
    patch = sarcl.ImageGrid.plane(center=REFLECTOR, shape=(128, 128), spacing=0.2)
    assert_gotcha_refocused(gotcha, smooth(gotcha.n_rows, 0, rms=10), patch)


@pytest.mark.slow
@pytest.mark.parametrize(
    "modes, seed, scale",
    [(3, 0, "rms"), (8, 1, "peak"), (20, 2, "rms")],
)
def test_gotcha_with_any_ten_radians_comes_back(gotcha, modes, seed, scale):
    scene = sarcl.ImageGrid.plane(shape=(500, 500), spacing=0.2)
    assert_gotcha_refocused(gotcha, smooth(gotcha.n_rows, seed, modes=modes, **{scale: 10}), scene)


@pytest.mark.slow
def test_gotcha_as_it_is_does_not_suffer(gotcha):
    scene = sarcl.ImageGrid.plane(shape=(500, 500), spacing=0.2)
    better, _ = sarcl.autofocus(gotcha, scene)
    assert_as_sharp(better, gotcha, decibels=0.15, width=0.01, grid=scene)


@pytest.mark.slow
def test_an_aperture_of_46_degrees_is_grown_from_its_core():
    n, side, extent = 450, 10.0, np.radians(46)
    truth = echoes(*scatterers(40, side=side, seed=6), arc(n, extent=extent), bandwidth=600e6, n_samples=160)
    grid = sarcl.ImageGrid.plane(shape=(500, 500), spacing=side / 500)
    better, errors = sarcl.autofocus(disturbed(truth, smooth(n, 1, rms=10)), grid)
    assert errors.found
    assert_as_sharp(better, truth, grid=grid)


# --- the parts ------------------------------------------------------------------------------------------------------


def test_contributions_add_up_to_the_exact_image(points):
    rng = np.random.default_rng(0)
    places = np.concatenate([rng.uniform(-12, 12, (50, 2)), np.zeros((50, 1))], axis=1)
    weighted = replace(points, weight=rng.uniform(0.5, 1.5, N_PULSES))
    v = contributions(weighted, places, [0.0], 2.0)[:, :, 0]
    wanted, spread = exact_image(points, places, row_weight=weighted.weight)
    assert np.linalg.norm(2 * v.sum(axis=0) - wanted) <= 0.01 * max(np.linalg.norm(wanted), spread)


def test_the_constant_echo_is_taken_out_and_nothing_else(points):
    away = np.linalg.norm(points.tx, axis=1)
    fixed = replace(points, reference_range=away + 3 * np.linspace(-1, 1, N_PULSES) ** 2)  # no point is at one delay
    frequency = points.frequency[:, None] + points.frequency_step[:, None] * np.arange(N_SAMPLES)
    leak = 100 * np.exp(-4j * np.pi / SPEED_OF_LIGHT * frequency * (away.min() + 1 - fixed.reference_range[:, None]))
    shifted = np.exp(4j * np.pi / SPEED_OF_LIGHT * frequency * (fixed.reference_range - away)[:, None])
    fixed = replace(fixed, samples=(points.samples * shifted).astype(np.complex64))
    found = without_constant_echo(replace(fixed, samples=(fixed.samples + leak).astype(np.complex64)), 1)
    left = found.read(0, N_PULSES) - fixed.samples
    assert np.linalg.norm(left) < 0.3 * np.linalg.norm(fixed.samples) < 0.3 * np.linalg.norm(leak)
    noise = np.random.default_rng(0).standard_normal((N_PULSES, N_SAMPLES)).astype(np.complex64)
    assert without_constant_echo(replace(fixed, samples=noise), 1) is None


def test_narrow_apertures_are_those_with_linear_phases_near_a_place(points):
    assert narrow_pulses(points, GRID, CENTER, CELL / 2) == (0, N_PULSES)
    wide = echoes(np.zeros((1, 3)), np.ones(1), arc(200, extent=np.radians(60)), bandwidth=600e6, n_samples=16)
    first, last = narrow_pulses(wide, GRID, CENTER, CELL / 4)
    # phase of a point at a distance d behind: k d cos(elevation)^2 (1 - cos a), of which a line leaves two thirds
    bend = 4 * np.pi * CENTER / SPEED_OF_LIGHT * CELL / 4 * np.cos(0.6) ** 2
    bend *= 1 - np.cos(np.radians(30) * (last - first) / 200)
    assert first == 200 - last > 0
    assert 2 / 3 * bend == pytest.approx(1.5, rel=0.1)
    turn = np.linspace(-np.pi / 2, np.pi / 2, 200)  # an arm of 0.3 m, 3 m before its targets
    arm = 0.3 * np.stack([np.cos(turn), np.sin(turn), 0 * turn], axis=1)
    near = sarcl.ImageGrid.plane(center=(3, 0, 0), shape=(80, 80), spacing=0.05)
    raw = echoes(np.array([[3.0, 0, 0]]), np.ones(1), arm, center=24e9, bandwidth=1.5e9, n_samples=16)
    first, last = narrow_pulses(raw, near, 24e9, 0.05)
    assert 60 < first < last < 140


def test_a_lag_is_half_the_path_behind_a_place():
    point = np.array([[3.0, 2.0, 0.0]])
    raw = echoes(point, np.ones(1), arc())
    away = raw.tx / np.linalg.norm(raw.tx, axis=1)[:, None]
    nearer = point + 0.5 * CELL * away[N_PULSES // 2]
    v = contributions(raw, nearer, [0.0, 0.5], 1.0)[N_PULSES // 2, 0]
    assert abs(v[1]) == pytest.approx(N_SAMPLES, rel=0.01)
    assert abs(v[0]) == pytest.approx(N_SAMPLES * np.sinc(0.5), rel=0.02)


def test_contributions_are_those_of_the_image_equation_pair_by_pair(points):
    """Of a bistatic row, of rows that start at other frequencies, and behind places in range, in any number of rows."""
    random = np.random.default_rng(3)
    places = random.uniform(-10, 10, (700, 3)) * (1, 1, 0)
    lags = np.array([-0.5, 0.0, 1.5])
    raw = replace(
        points, rx=points.tx + np.array([0, 30, 5]), frequency=points.frequency + 1e6 * random.random(N_PULSES)
    )
    made = contributions(raw, places, lags, 2.0)
    f = raw.frequency[:, None] + raw.frequency_step[:, None] * np.arange(N_SAMPLES)
    for row in (0, 63, 64, N_PULSES - 1):
        path = np.linalg.norm(raw.tx[row] - places, axis=1) + np.linalg.norm(raw.rx[row] - places, axis=1)
        delay = (path - 2 * raw.reference_range[row]) / SPEED_OF_LIGHT
        middle = f[row, N_SAMPLES // 2]
        later = delay[:, None] + lags / (N_SAMPLES * raw.frequency_step[row])
        ramp = np.exp(2j * np.pi * (f[row] - middle) * later[:, :, None])
        wanted = (raw.samples[row] * ramp).sum(axis=2) * np.exp(2j * np.pi * middle * delay)[:, None] / 2
        # profiles are read linearly between eight values per cell: largest curvature (pi/8)^2/8, 2 % of the peak
        assert np.abs(made[row] - wanted).max() <= 0.02 * np.abs(wanted).max()


def test_an_antenna_that_is_farther_away_delays_the_phase():
    frequency, farther = 9.6e9, np.array([0.0, 2e-3, -5e-3])
    phase = -4 * np.pi * frequency * farther / SPEED_OF_LIGHT  # of exp(-j 2 pi f 2 d/c)
    found = ApertureView.implied_range(SimpleNamespace(frequency=frequency), phase)
    np.testing.assert_allclose(found, farther, rtol=1e-12)


def test_brightest_places_lie_on_the_points_and_apart(points):
    positions = scatterers()[0]
    image = sarcl.backproject(points, GRID)
    places = brightest(points, np.abs(image.data) ** 2, GRID, 8.0, 10)
    assert np.abs(image.data).max() == pytest.approx(abs(exact_image(points, places[:1])[0][0]), rel=1e-2)
    assert np.linalg.norm(places[:, None] - positions, axis=2).min(axis=1).max() <= 2 * CELL
    gaps = np.linalg.norm(places[:, None] - places, axis=2)[~np.eye(len(places), dtype=bool)]
    assert gaps.min() > CELL


def test_sharpening_never_lowers_the_sharpness():
    rng = np.random.default_rng(1)
    v = (rng.standard_normal((40, 30)) + 1j * rng.standard_normal((40, 30))).astype(np.complex64)
    for width in (0.0, 16.0, 40.0):
        levels = [
            _phase_gradient.sharpness(v, _phase_gradient.sharpen(v, np.zeros(40), width, steps), width)
            for steps in range(6)
        ]
        assert (np.diff(levels) >= -1e-5 * levels[0]).all()
        assert levels[-1] > 1.05 * levels[0]


def test_sharpness_is_the_sum_of_fourth_powers_of_the_doppler_spectrum():
    rng = np.random.default_rng(2)
    v = (rng.standard_normal((24, 5)) + 1j * rng.standard_normal((24, 5))).astype(np.complex64)
    phase = rng.uniform(-3, 3, 24)
    wanted = (np.abs(np.fft.fft(v * np.exp(-1j * phase)[:, None], 48, axis=0)) ** 4).sum()
    assert _phase_gradient.sharpness(v, phase, 1e9) == pytest.approx(wanted, rel=1e-5)


def test_gradient_finds_the_phase_of_points_beside_their_places():
    rng = np.random.default_rng(3)
    n, k = 200, 40
    phase = smooth(n, 16, rms=8)
    beside = np.exp(2j * np.pi * np.outer(np.arange(n) / n, rng.uniform(-9, 9, k)))
    clutter = 0.5 * (rng.standard_normal((n, k)) + 1j * rng.standard_normal((n, k)))
    v = (np.exp(1j * phase)[:, None] * beside + clutter).astype(np.complex64)
    found = _phase_gradient.gradient(v, [n, n / 2, n / 4, n / 8, n / 16])
    assert np.std(flat(found - phase)) <= 0.2


@pytest.mark.filterwarnings("error")
def test_gradient_passes_over_columns_without_echoes():
    n = 64
    one = np.exp(1j * smooth(n, 16, rms=8))[:, None].astype(np.complex64)
    widths = [n, n / 2, n / 4, n / 8]
    among_empty_ones = _phase_gradient.gradient(one * np.array([0, 1, 0], np.complex64), widths)
    assert np.abs(among_empty_ones - _phase_gradient.gradient(one, widths)).max() <= 1e-5


def test_smoothing_does_not_slip_in_noise():
    worst, plain = 1.0, 1.0
    for seed in range(20):
        phase = smooth(200, seed, modes=3, rms=5)
        given = np.angle(np.exp(1j * (phase + 0.8 * np.random.default_rng(seed).standard_normal(200))))
        found = _phase_smoothing.smooth(given, 16)
        worst = min(worst, abs(np.exp(1j * (found - phase)).mean()))
        cosines = _phase_smoothing.cosines(200, 16)
        least_squares = cosines @ np.linalg.lstsq(cosines, np.unwrap(given), rcond=None)[0]
        plain = min(plain, abs(np.exp(1j * (least_squares - phase)).mean()))
    assert plain < 0.8 < 0.9 < worst


def test_unwrapping_follows_a_phase_that_climbs_by_more_than_pi_a_pulse():
    phase = 0.04 * np.arange(200.0) ** 2  # 16 rad a pulse in the end
    assert _phase_smoothing.unwrapped(np.angle(np.exp(1j * phase))) == pytest.approx(phase, abs=1e-6)


def test_alignment_removes_a_shift_and_distinguishes_unrelated_curves():
    rng = np.random.default_rng(4)
    n = 150
    t = np.linspace(-1, 1, n)
    along = np.stack([40 * t, 3 * t**2], axis=1)
    phase = rng.uniform(-3, 3, n)
    moved = phase + along @ (2.7, 0.2) + 0.3 * rng.standard_normal(n) + 1.0
    aligned, close = _phase_smoothing.alignment(phase, moved, along, 0.5)
    assert close == pytest.approx(np.exp(-(0.3**2) / 2), abs=0.03)
    assert np.std(np.angle(np.exp(1j * (aligned - moved + 1.0)))) <= 0.4
    strangers = [_phase_smoothing.alignment(phase, rng.uniform(-3, 3, n), along, 0.5)[1] for _ in range(50)]
    assert max(strangers) < _phase_smoothing.chance(n)


def test_scaled_and_cut_rows_are_those_of_plain_arrays():
    samples = np.arange(24, dtype=np.complex64).reshape(6, 4)
    factor = np.exp(1j * np.arange(6))
    scaled, cut, tapered = Scaled(samples, factor), Columns(samples, 1, 3), Tapered(samples, np.arange(4))
    assert tapered.shape == (6, 4) and tapered.dtype == np.complex64
    assert np.array_equal(tapered[2:5], (samples * np.arange(4))[2:5])
    assert scaled.shape == (6, 4) and scaled.dtype == np.complex64
    assert np.asarray(scaled) == pytest.approx(samples * factor[:, None], rel=1e-6)
    assert scaled[2:5] == pytest.approx((samples * factor[:, None])[2:5], rel=1e-6)
    assert np.array_equal(np.asarray(cut), samples[:, 1:3])
    assert np.array_equal(cut[4:], samples[4:, 1:3])


# --- bad input --------------------------------------------------------------------------------------------------------


ELSEWHERE = sarcl.ImageGrid.plane(center=(9e3, 9e3, 0), shape=(20, 20), spacing=1)


def still(raw):
    """Every pulse from the same place."""
    return replace(raw, tx=np.tile(raw.tx[:1], (raw.n_rows, 1)), rx=None, time=np.arange(raw.n_rows))


@pytest.mark.parametrize(
    "change, message",
    [
        (lambda r: (r[:11], GRID), "11 pulses with any energy, of 11; autofocus needs 12"),
        (lambda r: (replace(r, samples=np.zeros(r.samples.shape, np.complex64)), GRID), "0 pulses with any energy"),
        (lambda r: (replace(r, samples=r.samples[:, :15]), GRID), "15 samples per row.*needs 16 or more"),
        (lambda r: (replace(r, compressed=False), GRID), "not compressed.*sarcl.compress"),
        (lambda r: (still(r), GRID), "same in every pulse"),
        (lambda r: (r, ELSEWHERE), "zero everywhere.*center"),
        (lambda r: (sarcl.concatenate([r, r]), GRID), "rows 0 and 128 have equal antenna positions.*own time"),
        (
            lambda r: (sarcl.concatenate([replace(r, polarization="HH"), replace(r, polarization="VV")[1:]]), GRID),
            "pulse 0 has no row of polarization VV.*select",
        ),
    ],
    ids=["few", "zeros", "narrow band", "uncompressed", "still", "elsewhere", "twice", "lacking"],
)
def test_what_cannot_be_focused_is_named(points, change, message):
    with pytest.raises(ValueError, match=message):
        sarcl.autofocus(*change(points))


def test_arguments_of_the_wrong_kind(points):
    with pytest.raises(TypeError, match=r"raw is a str; wanted a sarcl\.PhaseHistory"):
        sarcl.autofocus("raw", GRID)
    with pytest.raises(TypeError, match=r"grid is a tuple; wanted a sarcl\.ImageGrid"):
        sarcl.autofocus(points, (1, 2))
    with pytest.raises(TypeError, match="range_errors is 'no'"):
        sarcl.autofocus(points, GRID, range_errors="no")
    with pytest.raises(TypeError, match="beam is an Antenna; autofocus takes the cone"):
        sarcl.autofocus(points, GRID, beam=sarcl.Antenna.isotropic())
    with pytest.raises(ValueError, match="places is 1; it must be at least 2"):
        sarcl.autofocus(points, GRID, places=1)
