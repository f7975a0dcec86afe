"""Range-Doppler images: equal to backprojection within the tolerance; points as theory says; refusals."""

from __future__ import annotations

import warnings
from dataclasses import replace

import numpy as np
import pytest
from helpers.cases import image_error, noise_on, thinned

import sarcl
from sarcl.base.constants import SPEED_OF_LIGHT
from sarcl.imaging.range_doppler import _focus
from sarcl.imaging.range_doppler._bins import Bins
from sarcl.imaging.range_doppler._doppler import Band
from sarcl.imaging.range_doppler._plan import _Compression, curved
from sarcl.imaging.range_doppler._velocity import Hyperbolas
from sarcl.numerics.interpolation import interpolator
from sarcl.numerics.range_profiles import correction, from_samples
from sarcl.reference.range_doppler import straighten

SPEED = 100.0


def flown(n=200, aperture=90.0, squint=0.0, distance=4e3, climb=0.0):
    """Positions, m (n, 3), and times, s, of a straight flight past the origin, which is on its right."""
    along = aperture * (np.arange(n) / (n - 1) - 0.5)
    y = along + 0.7 * distance * np.tan(squint)
    tx = np.stack([np.full(n, -0.7 * distance), y, 0.714 * distance + climb * along], axis=1)
    return tx, np.linspace(0, aperture * np.hypot(1, climb) / SPEED, n)


def noise(n_samples=80, seed=0, bandwidth=150e6, **track):
    tx, time = flown(**track)
    return noise_on(tx, n_samples=n_samples, bandwidth=bandwidth, seed=seed, time=time)


def points(places, n_samples=200, bandwidth=300e6, reference=None, **track):
    """Echoes of unit points from a formula, not from `sarcl.echo`."""
    tx, time = flown(**track)
    frequency = 9.6e9 - bandwidth / 2 + np.arange(n_samples) * bandwidth / n_samples
    reference = np.linalg.norm(tx, axis=1) if reference is None else np.full(len(tx), reference)
    samples = np.zeros((len(tx), n_samples), complex)
    for place in places:
        path = 2 * (np.linalg.norm(tx - place, axis=1) - reference)
        samples += np.exp(-2j * np.pi * np.outer(path, frequency) / SPEED_OF_LIGHT)
    return sarcl.PhaseHistory(
        samples, frequency=frequency[0], frequency_step=bandwidth / n_samples, tx=tx, reference_range=reference,
        time=time,
    )  # fmt: skip


def hold(raw, tolerance, **options):
    image = sarcl.range_doppler(raw, tolerance=tolerance, check=False, **options)
    error = image_error(image, raw, most=100)
    print(f"{error:.1e} of {image.report.predicted_error:.1e}")
    assert error <= image.report.predicted_error <= tolerance
    return image


TRACKS = {
    "broadside": {},
    "forward": {"squint": -0.5, "n": 300},
    "backward": {"squint": 0.3, "n": 300},
    "climbing": {"climb": 0.1},
    "short": {"aperture": 12.0, "n": 40},
    "far": {"distance": 60e3, "aperture": 300.0},
}


@pytest.mark.parametrize("track, tolerance", thinned(TRACKS, [1e-1, 1e-2, 1e-3, 1e-4]))
def test_the_image_is_that_of_backproject(track, tolerance):
    hold(noise(**TRACKS[track]), tolerance)


@pytest.mark.parametrize("tolerance", [1e-2, 1e-4])
def test_the_image_is_that_of_backproject_on_every_device(device, tolerance):
    hold(noise(squint=0.3), tolerance, device=device)


@pytest.mark.parametrize("columns", [1, 2, 3, 4, 7, 13])
def test_swaths_of_few_columns_at_a_large_squint(columns):
    raw = noise(n=512, n_samples=512, squint=np.deg2rad(40), bandwidth=1e9, aperture=60.0)
    middle, half = 4e3 * np.hypot(0.7, 0.714), (columns - 0.5) * SPEED_OF_LIGHT / 4.8e9
    image = hold(raw, 1e-2, ranges=(middle - half, middle + half))
    assert abs(image.data.shape[1] - columns) <= 1 and np.isfinite(image.data).all()


@pytest.mark.parametrize("tolerance", [0.3, 3e-2, 3e-3])
@pytest.mark.parametrize("squint", [0.25, 0.45])
def test_images_beside_points_hold_the_prediction(squint, tolerance):
    """Few columns that see the side lobes of points alone, from short tracks: errors add up in phase, echoes do not."""
    raw = points(
        [(0.0, 0.3, 0.0), (1.0, -0.4, 0.0)], n_samples=300, bandwidth=480e6, n=300, aperture=2.5, squint=squint
    )
    middle = 4e3 * np.hypot(0.7, 0.714) + 11.0
    hold(raw, tolerance, ranges=(middle, middle + 1.5))


@pytest.mark.parametrize("n", [100, 400])
@pytest.mark.parametrize("tolerance", [0.3, 3e-2])
def test_noise_in_few_fresnel_zones_holds_coarse_predictions(n, tolerance):
    for seed in range(2):
        hold(noise(n=n, n_samples=120, aperture=1.0, squint=0.25, seed=seed), tolerance)


def test_any_reference_range_will_do():
    raw = noise()
    hold(replace(raw, reference_range=np.full(raw.n_rows, 4e3)), 1e-3)
    hold(replace(raw, reference_range=raw.reference_range + np.linspace(-3, 3, raw.n_rows)), 1e-3)


def test_weights_and_windows_are_those_of_backproject():
    raw = noise(n=120, aperture=40.0)
    raw = replace(raw, weight=np.linspace(0.5, 1, 120))
    options = {"window": ("taylor", 35, 5), "weights": np.arange(120) % 4 / 3.0}
    image = sarcl.range_doppler(raw, tolerance=1e-3, check=True, **options)
    assert image.report.measured_error <= image.report.predicted_error
    exact = sarcl.backproject(raw, image.grid, tolerance=1e-4, **options)
    assert np.linalg.norm(image.data - exact.data) <= 1e-3 * np.linalg.norm(exact.data)
    assert image.gain == pytest.approx(exact.gain, rel=1e-12)
    assert image.frequency == pytest.approx(exact.frequency, rel=1e-12)


@pytest.mark.parametrize("squint", [0.0, 0.4])
def test_a_point_is_where_and_as_sharp_as_theory_says(squint):
    place = np.array([4.0, -6.0, 0.0])
    raw = points([place], squint=squint, n=400)
    image = sarcl.range_doppler(raw, tolerance=1e-3)
    grid = sarcl.ImageGrid.plane(center=place, shape=(121, 121), spacing=0.2)
    seen, oracle = (sarcl.measure(im, near=place) for im in (image, sarcl.backproject(raw, grid, tolerance=1e-4)))
    tx = raw.tx - place
    level = np.median(np.linalg.norm(tx[:, :2], axis=1) / np.linalg.norm(tx, axis=1))
    along = np.unwrap(np.arctan2(tx[:, 1], tx[:, 0]))
    theory = (
        0.886 * SPEED_OF_LIGHT / (2 * 300e6) / level,
        0.886 * SPEED_OF_LIGHT / 9.6e9 / (2 * np.ptp(along) * 400 / 399) / level,
    )
    print(seen.position - place, seen.irw, theory, seen.pslr)
    assert np.linalg.norm(seen.position - place) <= 0.01 * min(theory)
    assert np.linalg.norm(seen.position - oracle.position) <= 1e-3 * min(theory)
    assert seen.irw == pytest.approx(oracle.irw, rel=1e-3)
    assert seen.pslr == pytest.approx(oracle.pslr, abs=0.02)
    if not squint:  # there the spectrum is a rectangle along range and cross-range
        assert seen.irw == pytest.approx(theory, rel=0.01)
        assert seen.pslr == pytest.approx((-13.26, -13.26), abs=0.1)
    # gain and phase: a unit point has the value image.gain at its position
    index, axes = image.grid.index(place), (image.grid.times, image.grid.ranges)
    times, ranges = (np.interp(i, np.arange(len(a)), a) for i, a in zip(index, axes, strict=True))
    part = sarcl.range_doppler(raw, tolerance=1e-3, times=(times, times + 0.1), ranges=(ranges, ranges + 2))
    assert np.linalg.norm(part.grid.listed[0, 0] - place) < 1e-6
    assert part.data[0, 0] == pytest.approx(part.gain, rel=2e-3)


def test_the_grid_knows_its_positions():
    raw = noise(squint=0.2, climb=0.1)
    image = sarcl.range_doppler(raw, heights=7.0)
    grid = image.grid
    assert grid.positions.shape == (*image.data.shape, 3) and (grid.times.size, grid.ranges.size) == image.data.shape
    velocity = (raw.tx[-1] - raw.tx[0]) / raw.time[-1]
    antenna = raw.tx[0] + grid.times[:, None] * velocity
    away = grid.positions - antenna[:, None]
    assert np.abs(away @ velocity).max() <= 1e-6 * SPEED  # zero Doppler
    assert np.linalg.norm(away, axis=2) == pytest.approx(np.broadcast_to(grid.ranges, image.data.shape), abs=1e-8)
    assert grid.positions[..., 2] == pytest.approx(np.full(image.data.shape, 7.0), abs=1e-8)
    assert (grid.positions[..., 0] > raw.tx[0, 0]).all()  # the side where the origin is
    other = sarcl.range_doppler(raw, heights=7.0, side="left")
    assert (other.grid.positions[..., 0] < raw.tx[0, 0]).all()
    assert np.linalg.norm(other.data - image.data) <= 1e-5 * np.linalg.norm(image.data)
    here = np.array([[3.25, 8.5], [40.0, 20.0]])
    assert grid.index(grid.at(*here.T)) == pytest.approx(here, abs=1e-6)


def test_times_ranges_and_spacing_are_as_asked():
    raw = noise()
    middle = float(np.sqrt(0.7**2 + 0.714**2)) * 4e3
    image = hold(raw, 1e-3, times=(0.35, 0.55), ranges=(middle - 8, middle + 6), spacing=(1e-3, 0.5))
    assert image.grid.ranges[[0, -1]] == pytest.approx([middle - 8, middle + 6])
    assert image.grid.times[0] == pytest.approx(0.35) and image.grid.times[-1] <= 0.55 + 1e-9
    interval = raw.time[1] - raw.time[0]
    steps = interval / np.diff(image.grid.times)
    assert steps == pytest.approx(np.full(len(steps), np.ceil(interval / 1e-3)))


def test_an_image_is_saved_and_read(tmp_path):
    image = sarcl.range_doppler(noise(n=60, aperture=20.0))
    image.save(tmp_path / "image.h5")
    image.save(tmp_path / "image.png")
    again = sarcl.read(tmp_path / "image.h5")
    assert (np.asarray(again.data) == image.data).all()
    assert (again.grid.times == image.grid.times).all() and (again.grid.ranges == image.grid.ranges).all()
    assert (again.grid.positions == image.grid.positions).all()
    assert (again.band == image.band).all() and np.ptp(image.band) == pytest.approx(150e6, rel=0.05)
    assert (again.window, again.frame) == (None, "local") and (again.time == image.time).all()


def test_the_beam_limits_the_rows_and_the_report_knows_the_band():
    raw = points([(0, 0, 0), (5, 60, 0)], aperture=400.0, n=500, reference=4e3)
    with pytest.raises(ValueError, match=r"PRF|pulse rate.*124\.\d+ Hz, is below the Doppler bandwidth.*azimuth_beam="):
        sarcl.range_doppler(raw)
    image = sarcl.range_doppler(raw, azimuth_beam=0.015, tolerance=1e-3, check=True, ranges=(3985, 4025))
    assert image.report.measured_error <= image.report.predicted_error
    for place in ((0, 0, 0), (5, 60, 0)):
        row = int(np.argmin(np.abs(raw.tx[:, 1] - place[1])))  # each point has its own aperture, and carrier
        seen = sarcl.measure(replace(image, tx=raw.tx[row], rx=None), near=place)
        assert np.linalg.norm(seen.position - place) <= 0.05
        assert abs(seen.peak) == pytest.approx(seen.gain, rel=0.01)
    rows = 0.015 * 4e3 / 400 * 500  # within the beam; each taper has half its width of rows
    at = image.gain.shape[0] // 2, image.gain.shape[1] // 2
    assert 200 * rows < image.gain[at] < 200 * 2.3 * rows  # tapers 1.3 times as wide as the beam
    assert "Hz of a pixel, PRF 124.7" in image.report.plan["Doppler band"]


@pytest.mark.parametrize("tolerance", [3e-2, 1e-3])
@pytest.mark.parametrize("zones, squint", [(3, 0.0), (12, -0.3)])
def test_white_noise_of_strips_has_the_predicted_error(zones, squint, tolerance):
    # a beam of some Fresnel zones, a pulse rate 5 % above its Doppler bandwidth, a track of four apertures
    zone = np.sqrt(SPEED_OF_LIGHT / 9.6e9 / 8e3)
    hertz = 2 * SPEED * 9.6e9 / SPEED_OF_LIGHT
    prf, length = 1.05 * hertz * zones * zone * np.cos(squint), 4 * zones * zone * 4e3
    raw = noise(n=int(length / SPEED * prf), aperture=length, squint=np.arctan(np.tan(squint) / 0.7))
    raw = replace(raw, reference_range=np.full(raw.n_rows, 4e3 / np.cos(squint)))
    image = sarcl.range_doppler(
        raw, azimuth_beam=zones * zone, doppler=-hertz * np.sin(squint), side="right", tolerance=tolerance, check=True
    )
    assert image.report.measured_error <= image.report.predicted_error <= tolerance


@pytest.mark.parametrize("tolerance", [1e-2, 1e-3])
def test_a_point_of_a_strip_map_is_as_exact_as_predicted(tolerance, monkeypatch):
    """At the pixels about it, where few random ones would lie: the tapers of the beam weight the rows."""
    raw = points([(0, 0, 0)], aperture=400.0, n=500, n_samples=64, reference=4e3, bandwidth=150e6)
    options = {"azimuth_beam": 0.015, "tolerance": tolerance, "ranges": (3990, 4010)}
    image = sarcl.range_doppler(raw, check=False, **options)
    i, j = np.unravel_index(np.abs(image.data).argmax(), image.data.shape)
    near = tuple(a.ravel() for a in np.mgrid[i - 150 : i + 150 : 3, j - 4 : j + 5 : 2])
    monkeypatch.setattr(sarcl.ImageGrid, "sample", lambda self, most, seed: (near, self.positions_of(near)))
    report = sarcl.range_doppler(raw, check=True, **options).report
    print(report.measured_error, report.predicted_error)
    assert 0.1 * report.predicted_error < report.measured_error <= report.predicted_error


def test_a_track_longer_than_the_times_need_is_folded_and_changes_nothing():
    raw = points([(0, 0, 0), (5, 60, 0), (3, -150, 0)], aperture=800.0, n=1000, reference=4e3)
    wide = sarcl.range_doppler(raw, azimuth_beam=0.015, tolerance=1e-3, ranges=(3985, 4025), check=True)
    narrow = sarcl.range_doppler(
        raw, azimuth_beam=0.015, tolerance=1e-3, ranges=(3985, 4025), times=(3.9, 4.1), check=True
    )
    assert int(narrow.report.plan["Doppler bins"].split()[-1]) < raw.n_rows
    assert narrow.report.measured_error <= narrow.report.predicted_error <= 1e-3
    at = np.array([0.0, 0.0, 0.0])
    found = [sarcl.measure(replace(one, tx=raw.tx[500], rx=None), near=at) for one in (wide, narrow)]
    levels = [abs(one.peak) / one.gain for one in found]
    assert levels[0] == pytest.approx(levels[1], rel=0.02)


@pytest.mark.parametrize("squint", [0.0, 0.3])
def test_the_centroid_is_estimated_from_the_data(squint):
    raw = points([(x, y, 0) for x in (-6, 0, 5) for y in (-4, 3)], squint=squint, n=300)
    wanted = -2 * 9.6e9 / SPEED_OF_LIGHT * SPEED * np.sin(np.arctan(0.7 * np.tan(squint)))
    for doppler in ("geometry", "data"):
        plan = sarcl.range_doppler(raw, doppler=doppler, check=False).report.plan
        assert float(plan["Doppler centroid"].split()[0]) == pytest.approx(wanted, abs=10)
    # a constant reference tells nothing; the data do
    fixed = points([(0, 0, 0)], squint=0.02, n=300, reference=4e3)
    wanted = -2 * 9.6e9 / SPEED_OF_LIGHT * SPEED * np.sin(np.arctan(0.7 * np.tan(0.02)))
    found = {d: sarcl.range_doppler(fixed, doppler=d).report.plan["Doppler centroid"] for d in ("geometry", "data")}
    assert float(found["geometry"].split()[0]) == 0
    assert float(found["data"].split()[0]) == pytest.approx(wanted, abs=3)


def strip_of_ground(reference):
    random = np.random.default_rng(3)
    y0 = 2800 * np.tan(0.2)
    places = np.c_[random.uniform(-15, 15, (60, 2)), np.zeros(60)]
    return points(places, n_samples=256, reference=reference, n=400, aperture=45.0, squint=0.2), y0


@pytest.mark.filterwarnings("error::sarcl.SarclWarning")
def test_the_centroid_of_data_is_the_right_multiple_of_the_pulse_rate_or_doubted():
    told, _ = strip_of_ground(None)  # reference ranges follow the scene
    silent = sarcl.PhaseHistory(  # the same samples about one range: the geometry does not know the squint
        told.samples * np.exp(
            -4j * np.pi / SPEED_OF_LIGHT
            * np.outer(told.reference_range - told.reference_range.mean(),
                       told.frequency[0] + np.arange(told.n_samples) * told.frequency_step[0])
        ),
        frequency=told.frequency, frequency_step=told.frequency_step, tx=told.tx,
        reference_range=told.reference_range.mean(), time=told.time,
    )  # fmt: skip

    def centroid(raw, **options):
        forecast = sarcl.plan(sarcl.range_doppler, raw, side="right", doppler="data", azimuth_beam=0.004, **options)
        return float(forecast.plan["Doppler centroid"].split()[0])

    rate = (told.n_rows - 1) / float(told.time[-1] - told.time[0])
    right = centroid(told)
    geometry = 2 * SPEED * 9.6e9 / SPEED_OF_LIGHT * np.sin(np.arctan(0.7 * np.tan(0.2)))
    assert abs(abs(right) - geometry) < 0.1 * rate and geometry > 0.9 * rate
    with pytest.warns(sarcl.SarclWarning, match=r"Give near=") as warned:
        wrong = centroid(silent)
    assert abs(wrong) <= rate / 2
    near = float(str(warned[0].message).split("Give near=")[1].split(",")[0])
    assert centroid(silent, near=near) == pytest.approx(right, rel=1e-3)
    assert centroid(silent, near=wrong + 1) == wrong  # asked for: no warning
    with pytest.raises(ValueError, match="near is for doppler='data'"):
        sarcl.range_doppler(told, side="right", near=100.0)


@pytest.mark.parametrize("epoch", [1.7e9, -3e7, 2e9])
def test_absolute_times_give_the_image_of_times_from_the_first_pulse(epoch):
    raw = noise(squint=0.2)
    first = raw.time[0]
    late = replace(raw, time=raw.time + epoch)
    images = [sarcl.range_doppler(one, tolerance=1e-3) for one in (raw, late)]
    assert np.linalg.norm(images[1].data - images[0].data) < 1e-3 * np.linalg.norm(images[0].data)
    np.testing.assert_allclose(images[1].grid.times - epoch, images[0].grid.times - first, atol=1e-6)
    asked = images[1].grid.times[[10, 60]]
    part = sarcl.range_doppler(late, tolerance=1e-3, times=asked)
    assert abs(part.grid.times[0] - asked[0]) < 1e-6 and len(part.grid.times) in (50, 51)


def test_times_that_float64_does_not_resolve_are_refused_by_their_name():
    raw = noise()
    with pytest.raises(ValueError, match=r"raw\.time reaches 1e\+14 s"):
        sarcl.range_doppler(replace(raw, time=raw.time + 1e14))
    with pytest.raises(ValueError, match=r"raw\.time reaches"):
        sarcl.range_doppler(replace(raw, time=raw.time / 500 + 1e10))


def test_profiles_are_read_as_the_twin_says(device):
    raw = noise(n=40, aperture=10.0, n_samples=50)
    random = np.random.default_rng(2)
    for taps in (2, 4, 6, 8):
        kernel = interpolator(taps, 2.0)
        bins = Bins.__new__(Bins)
        plan = type("Plan", (), {"profile_length": 100})
        bins.device, bins.plan, bins.pad = device, plan, 200
        bins.kernel = device.kernel("range_doppler.cl", "straighten", TAPS=taps, TERMS=kernel.terms, SEGMENT=64)
        bins.table = device.upload(kernel.table)
        profiles = from_samples(device, raw.samples[:5], correction(kernel, 50, 100).astype(np.float32), 100, 200)
        cell = random.integers(-50, 50, (5, 2)).astype(np.int32)
        line = random.uniform(-0.5, 0.5, (5, 2, 4)).astype(np.float32)
        bins.lines = lambda doppler, ranges, made=(cell, line): made
        made = bins._straightened(profiles, np.zeros(5), np.zeros(100))
        column = np.arange(64)
        for q in range(5):
            wanted = np.concatenate(
                [
                    straighten(profiles[q], 250 + cell[q, k] + a + b * column, c + d * column, kernel)
                    for k, (a, b, c, d) in enumerate(line[q].astype(np.float64))
                ]
            )[:100]
            assert np.linalg.norm(made[q] - wanted) <= 1e-5 * np.linalg.norm(wanted)


def test_the_curved_part_of_the_root_does_not_cancel():
    frequency, bend = 9.6e9 + np.linspace(-1e8, 1e8, 5), np.array([[1e6], [4e9]])
    wide, b = frequency.astype(np.longdouble), bend.astype(np.longdouble)
    center = np.longdouble(9.6e9)
    a = np.sqrt(center**2 - b**2)
    wanted = np.sqrt(wide**2 - b**2) - a - (wide - center) * center / a
    assert curved(frequency, 9.6e9, bend) == pytest.approx(wanted.astype(float), rel=1e-6, abs=1e-9)


def test_bytes_do_not_change_the_image_and_too_few_are_refused():
    raw = noise(n=100, n_samples=20000, aperture=30.0)
    cut = {"ranges": (3990.0, 4010.0), "times": (0.1, 0.2)}
    whole = sarcl.range_doppler(raw, check=False, **cut)
    less = sarcl.range_doppler(raw, check=False, max_bytes=1.2e6, **cut)
    assert np.linalg.norm(whole.data - less.data) <= 1e-6 * np.linalg.norm(whole.data)
    assert np.array_equal(whole.data, sarcl.range_doppler(raw, check=False, max_bytes=5e7, **cut).data)
    with pytest.raises(MemoryError, match="raise max_bytes"):
        sarcl.range_doppler(noise(n=20, n_samples=200000, aperture=6.0), max_bytes=1e6, **cut)


def test_large_arrays_go_to_files_and_change_nothing(monkeypatch):
    raw = noise(n_samples=300)
    whole = sarcl.range_doppler(raw, check=False)
    made, real = [], _focus.host_memory.zeros
    monkeypatch.setattr(_focus.host_memory, "zeros", lambda *given: made.append(real(*given)) or made[-1])
    spilled = sarcl.range_doppler(raw, check=False, max_bytes=1e6)
    assert len(made) == 3 and all(isinstance(array, np.memmap) for array in made)
    assert np.linalg.norm(whole.data - spilled.data) <= 1e-6 * np.linalg.norm(whole.data)


def test_an_image_that_memory_does_not_hold_is_refused_with_the_size_that_it_does(monkeypatch):
    monkeypatch.setattr(_focus.host_memory, "installed", lambda: 56e3)
    with pytest.raises(MemoryError, match=r"this machine has 56 kB; give times=, .* of at most 1,000 pixels"):
        sarcl.range_doppler(noise())


def test_progress_of_range_doppler_is_reported_up_to_its_end():
    said = []
    sarcl.range_doppler(noise(n=60, aperture=20.0), progress=lambda *a: said.append(a), check=False)
    stages, done, totals = zip(*said, strict=True)
    assert set(stages) == {"range Doppler"} and set(totals) == {1000}
    assert list(done) == sorted(done) and done[-1] == 1000


def test_an_image_wider_than_the_pulse_rate_allows_is_warned_of():
    raw = points([(0, 0, 0)], aperture=90.0, n=140)
    with pytest.warns(sarcl.SarclWarning, match=r"more than the pulse rate.*again .* m along the track"):
        sarcl.range_doppler(raw, times=(-0.3, 1.2), check=False)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        sarcl.range_doppler(raw, check=False)


AROUND = np.array([-1.0, 1.0])
ORBIT = sarcl.Orbit.kepler(7.171e6, 0.001, 1.72, span=(-60, 60))


def seen_from_orbit(n=160, prf=1000.0, width=0.0):
    """Echoes of a point 200 m above the ellipsoid, and it: C band, 850 km."""
    track = ORBIT.trajectory(start=0.0, prf=prf, n_pulses=n)
    place = ORBIT.geolocate(n / prf / 2, 1e6, heights=200.0, side="right")
    chirp = sarcl.Waveform.chirp(center=5.4e9, bandwidth=60e6, duration=10e-6)
    scene = sarcl.Scene.points([place])
    return sarcl.echo(scene, chirp, track, range_window=(-width, width), tolerance=1e-4, check=False), place


def test_an_orbit_is_focused_with_its_effective_velocity():
    raw, place = seen_from_orbit(n=300, width=300.0)
    assert not raw.is_monostatic  # the receiver moves on while the pulse is on its way
    image = sarcl.range_doppler(raw, side="right", heights=200.0, tolerance=5e-3)
    seen = sarcl.measure(image, near=place)
    speed = np.linalg.norm(ORBIT.velocities(0.15))
    hertz = 2 * 5.4e9 / SPEED_OF_LIGHT * speed
    print(image.report.plan["effective velocity"], speed, seen)
    assert 0.93 * speed < float(image.report.plan["effective velocity"].split()[0]) < 0.97 * speed
    assert np.linalg.norm(seen.position - place) <= 0.02
    assert seen.pslr == pytest.approx((-13.26, -13.26), abs=0.1)
    assert abs(seen.peak) == pytest.approx(image.gain, rel=2e-3) and abs(np.angle(seen.peak)) < 0.02
    rate = ORBIT.view(0.15, place).doppler_rate(5.4e9)
    assert float(image.report.plan["Doppler rate"].split()[0]) == pytest.approx(rate, rel=2e-3), hertz


@pytest.mark.parametrize("tolerance", [3e-2, 3e-3])
def test_noise_seen_from_an_orbit_is_focused_as_by_backproject(tolerance):
    raw, place = seen_from_orbit(width=150.0)
    random = np.random.default_rng(1)
    samples = random.standard_normal((2, *raw.samples.shape)).astype(np.float32)
    noisy = replace(raw, samples=samples[0] + 1j * samples[1])
    longitude, latitude, _ = sarcl.wgs84.geodetic(place)
    level = sarcl.ElevationModel(longitude + AROUND, latitude + AROUND, [[200.0, 200], [200, 200]])
    flat = hold(noisy, tolerance, side="right", heights=200.0)
    assert sarcl.wgs84.geodetic(flat.grid.positions)[2] == pytest.approx(np.full(flat.data.shape, 200.0), abs=1e-6)
    on_terrain = sarcl.range_doppler(noisy, tolerance=tolerance, side="right", heights=level, check=False)
    assert np.abs(on_terrain.grid.positions - flat.grid.positions).max() < 1e-6
    assert np.linalg.norm(on_terrain.data - flat.data) <= 1e-4 * np.linalg.norm(flat.data)


@pytest.mark.parametrize("side", ["right", "left"])
@pytest.mark.parametrize("beam", [None, 0.0008])
def test_squinted_orbits_have_doppler_frequencies_of_the_effective_velocity(side, beam):
    # the speed of the satellite would put the band 7 % away: 280 Hz, more than a pixel has
    n, prf = 128, 1500.0
    track = ORBIT.trajectory(start=-n / prf / 2, prf=prf, n_pulses=n)
    place = ORBIT.geolocate(2.0, 9e5, side=side)
    chirp = sarcl.Waveform.chirp(center=5.4e9, bandwidth=40e6, duration=10e-6)
    raw = sarcl.echo(sarcl.Scene.points([place]), chirp, track, range_window=(-80, 80), check=False)
    random = np.random.default_rng(1).standard_normal((2, *raw.samples.shape)).astype(np.float32)
    noisy = replace(raw, samples=random[0] + 1j * random[1])
    image = sarcl.range_doppler(noisy, side=side, azimuth_beam=beam, tolerance=5e-2, check=True)
    assert image.report.measured_error <= image.report.predicted_error
    assert image.grid.times[0] < 2.0 < image.grid.times[-1]
    wanted = float(ORBIT.view(0.0, place).doppler(5.4e9))
    assert float(image.report.plan["Doppler centroid"].split()[0]) == pytest.approx(wanted, abs=8)  # 3 ms of echo delay


@pytest.mark.parametrize("share", [0.25, 0.65])  # between two of nine even ranges
def test_a_narrow_ridge_anywhere_in_the_swath_counts_in_the_predicted_error(share):
    n, prf = 300, 1000.0
    near, middle, far = ORBIT.geolocate(n / prf / 2, [995e3, 1000e3, 1005e3], side="right")
    chirp = sarcl.Waveform.chirp(center=5.4e9, bandwidth=5e6, duration=10e-6)
    track = ORBIT.trajectory(start=0.0, prf=prf, n_pulses=n)
    raw = sarcl.echo(sarcl.Scene.points([middle]), chirp, track, range_window=(-6e3, 6e3), check=False)
    (lon, far_lon), (lat, far_lat) = np.transpose([sarcl.wgs84.geodetic(x)[:2] for x in (near, far)])
    x, y = np.meshgrid(
        np.linspace(-0.5, 1.5, 401), np.linspace(-0.5, 1.5, 5)
    )  # shares of the swath, and along the track
    longitude = lon + (far_lon - lon) * x - (far_lat - lat) * (y - 0.5) * 2
    latitude = lat + (far_lat - lat) * x + (far_lon - lon) * (y - 0.5) * 2
    height = 300 * np.exp(-(((x - share) / 0.02) ** 2))
    height[0, 0] = -300.0  # the hyperbolas are those of the mean of the lowest and the highest point
    options = {"side": "right", "ranges": (996e3, 1004e3), "times": (0.14, 0.16), "tolerance": 0.1}
    errors = []
    for z in (0 * height, height):
        model = sarcl.ElevationModel(longitude, latitude, z)
        plan = sarcl.plan(sarcl.range_doppler, raw, heights=model, **options).plan
        errors.append(float(str(plan["error, hyperbolic ranges"])))

    assert errors[1] > 100 * errors[0]


def test_the_needed_pulse_rate_of_an_orbit_is_that_of_its_doppler_rate():
    raw, place = seen_from_orbit(n=200, prf=600.0, width=200.0)
    rate = abs(ORBIT.view(1 / 6, place).doppler_rate(5.4e9))
    with pytest.raises(ValueError, match="below the Doppler bandwidth") as refused:
        sarcl.range_doppler(raw, side="right", heights=200.0, times=(0.16, 0.17))
    needed = float(str(refused.value).split("under ")[1].split()[0])
    assert needed == pytest.approx(rate * 199 / 600, rel=1e-3)


def test_the_forecast_is_of_the_plan_that_is_carried_out():
    raw = noise(n=96, aperture=40.0)
    options = {"tolerance": 3e-3, "window": "hamming"}
    forecast = sarcl.plan(sarcl.range_doppler, raw, **options)
    image = sarcl.range_doppler(raw, **options, check=False)
    assert forecast.predicted_error == image.report.predicted_error and forecast.method == "range-Doppler"
    assert forecast.plan["pixels"] == " x ".join(map(str, image.data.shape))
    assert {k: forecast.plan[k] for k in image.report.plan} == image.report.plan
    assert image.data.nbytes < forecast.bytes and 0 < forecast.seconds < 60
    with pytest.raises(ValueError, match="side is 'up'"):
        sarcl.plan(sarcl.range_doppler, raw, side="up")


def test_a_swath_wider_than_the_pulse_interval_is_warned_of():
    raw = noise(n=64, aperture=30.0)
    with pytest.warns(sarcl.SarclWarning, match=r"echoes of the next pulse begin after 7\.1\d+ m"):
        sarcl.range_doppler(replace(raw, time=1e-5 * raw.time), check=False)


def bent(size):
    tx, time = flown()
    return noise_on(tx + np.sin(np.linspace(0, 40, len(tx)))[:, None] * [0, 0, size], time=time)


def circling():
    track = sarcl.Trajectory.circle(radius=7e3, height=5e3, arc=0.005, n_pulses=64, prf=100.0)
    return noise_on(track.positions, time=track.times)


def rocket():
    tx = np.stack([np.full(64, -3e3), np.zeros(64), np.linspace(1e3, 1.03e3, 64)], axis=1)
    return noise_on(tx, time=np.linspace(0, 0.3, 64))


def uneven(raw):
    return replace(raw, time=raw.time + 0.1 * (raw.time[1] - raw.time[0]) * (np.arange(raw.n_rows) % 2))


RAW = noise(n=64, aperture=30.0)
TERRAIN = sarcl.ElevationModel([8.0, 9.0], [47.0, 48.0], [[0.0, 0.0], [0.0, 0.0]])
REFUSED = {
    "not compressed": (lambda: replace(RAW, compressed=False), {}, "call sarcl.compress"),
    "no times": (lambda: replace(RAW, time=None), {}, "raw.time is None"),
    "few rows": (lambda: RAW[:5], {}, "raw has 5 rows"),
    "channels": (lambda: replace(RAW, time=np.repeat(RAW.time[::2], 2)), {}, "take one channel with raw.select"),
    "uneven": (lambda: uneven(RAW), {}, "not evenly spaced in time.*use backproject"),
    "hovering": (lambda: replace(RAW, tx=np.tile(RAW.tx[:1], (64, 1)), rx=None), {}, "antenna rests"),
    "own frequencies": (lambda: replace(RAW, frequency=RAW.frequency + np.arange(64)), {}, "raw.frequency differs"),
    "one sample": (lambda: noise(n_samples=1), {}, "without bandwidth there is no range"),
    "Earth-fixed": (lambda: replace(RAW, tx=RAW.tx + 7e6, rx=None), {}, "side is None"),
    "terrain": (lambda: RAW, {"heights": TERRAIN}, "longitude and latitude, but the track is in local coordinates"),
    "no side": (lambda: replace(RAW, reference_range=RAW.reference_range + 500), {}, "side is None"),
    "side": (lambda: RAW, {"side": "up"}, "side is 'up'"),
    "doppler": (lambda: RAW, {"doppler": "guess"}, "doppler is 'guess'"),
    "two centroids": (lambda: RAW, {"doppler": np.array([1.0, 2.0])}, "doppler must be a number"),
    "two rates": (lambda: RAW, {"doppler_rate": np.array([-1.0, 2.0])}, "doppler_rate must be a number"),
    "beam in degrees": (lambda: RAW, {"azimuth_beam": 5.0}, "azimuth_beam is 5 rad.*less than pi: was it in degrees"),
    "near end": (lambda: RAW, {"doppler": 6399.0}, "near to the direction of flight"),
    "times": (lambda: RAW, {"times": (1, 0)}, "times is"),
    "spacing": (lambda: RAW, {"spacing": (1, 2, 3)}, "spacing is .* wanted"),
    "a circle": (lambda: circling(), {"side": "left"}, "turns about the scene.*polar_format"),
    "climbing straight up": (lambda: rocket(), {"side": "left"}, "the track is vertical"),
    "too high": (lambda: RAW, {"heights": 9e4}, "beyond the range window.*correct heights"),
    "too large": (lambda: replace(RAW, samples=1e36 * RAW.samples), {}, "scale the samples down"),
    "other ranges": (lambda: RAW, {"ranges": (3980.0, 4300.0)}, r"range window.*is too small for slant ranges"),
    "underground": (lambda: RAW, {"ranges": (2000.0, 4000.0)}, "the ground is 28.* m from the track"),
    "beam elsewhere": (lambda: RAW, {"azimuth_beam": 0.001, "times": (3, 3.1)}, "no row sees the times"),
    "silent": (lambda: replace(RAW, samples=0 * RAW.samples), {"doppler": "data"}, "have no Doppler centroid"),
    "migration": (
        lambda: points([(0, 0, 0)], n_samples=8, reference=4e3, aperture=700.0, n=9000), {"side": "right"}, "migration"
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", REFUSED)
def test_what_it_cannot_do_is_refused_with_a_remedy(name):
    raw, options, match = REFUSED[name]
    with pytest.raises(ValueError, match=match):
        sarcl.range_doppler(raw(), check=False, **options)


def test_a_track_is_as_straight_as_the_tolerance_needs():
    with pytest.raises(sarcl.ToleranceUnreachable, match=r"ranges, which are no hyperbolas.*backproject"):
        sarcl.range_doppler(bent(2e-3))
    hold(bent(1e-6), 1e-2)
    with pytest.raises(sarcl.ToleranceUnreachable, match=r"rounding of complex64"):
        sarcl.range_doppler(RAW, tolerance=1e-6)


@pytest.mark.parametrize("psi", [0.25, 0.3, 0.4, 0.6, 1.0])
def test_range_blocks_have_the_error_of_a_cubic(psi):
    """Phases that grow evenly over the swath by `psi` per block, read by a cubic through the ends of four blocks."""
    nodes, at = np.arange(4.0), np.linspace(0, 1, 201)
    exact = np.exp(1j * psi * at)
    cubic = sum(
        np.exp(1j * psi * nodes[k]) * np.prod([(at - m) / (nodes[k] - m) for m in nodes if m != nodes[k]], axis=0)
        for k in range(4)
    )
    worst = np.abs(cubic - exact).max()
    ranges = np.linspace(4e3, 5e3, 3001)
    fit = Hyperbolas(4e3, 5e3, np.array([[100.0, 0.0, 0.0]]))
    band = Band(-0.3, 0.1, 0.02, 0.0)
    frequencies = np.linspace(9.3e9, 9.9e9, 64)
    compression = _Compression(frequencies, 9.6e9, fit, band, ranges)
    whole = compression._difference(0, -1)
    allowed = 0.3 * worst * 1.001
    blocks, error = compression.blocks(allowed, 1e-3)
    assert 0.11 * worst < error <= allowed
    # as many blocks as that phase needs, in steps of a third of an octave
    assert whole / psi <= 1.01 * len(blocks) <= 1.45 * whole / psi
