"""Backprojection: the exact sum, within the tolerance it was asked for."""

from __future__ import annotations

from dataclasses import replace

import h5py
import numpy as np
import pytest
from helpers.cases import REPEATED, image_error, noise_history

import sarcl
from sarcl.base.errors import ToleranceUnreachable
from sarcl.imaging.backproject import pixels_alone
from sarcl.imaging.choose_method import choose
from sarcl.imaging.focus_options import relative_error
from sarcl.imaging.focusing_task import make_task
from sarcl.reference.backproject import backproject as exact_image

PLANE = sarcl.ImageGrid.plane(center=(1, 2, 0), shape=(33, 45), spacing=(0.3, 0.2))
TOLERANCES = [1e-1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6]
GEOMETRIES = [(False, 30.0), (True, 10e3), (True, 36e6), (False, 800e3)]
# every distance with every tolerance: a third of them quick, the last third with the other kind of track
CASES = [
    pytest.param(bistatic != (away == 2), distance, tolerance, marks=REPEATED if away else [])
    for i, (bistatic, distance) in enumerate(GEOMETRIES)
    for j, tolerance in enumerate(TOLERANCES)
    for away in [(i + j) % 3]
]


@pytest.mark.parametrize("bistatic, distance, tolerance", CASES)
def test_error_is_below_prediction_and_prediction_below_tolerance(device, distance, tolerance, bistatic):
    raw = noise_history(distance=distance, bistatic=bistatic)
    image = sarcl.backproject(raw, PLANE, tolerance=tolerance, device=device)
    assert image_error(image, raw) <= image.report.predicted_error <= tolerance


@pytest.mark.parametrize("tolerance", [1e-3, 1e-5])
def test_error_at_800_km_equals_error_at_10_km(device, tolerance):
    errors = []
    for distance in (10e3, 800e3):
        raw = noise_history(distance=distance, seed=5)
        errors.append(image_error(sarcl.backproject(raw, PLANE, tolerance=tolerance, device=device), raw))
    # the plans are alike; what differs is the noise of the same rounding
    assert errors[1] == pytest.approx(errors[0], rel=0.3)


GRIDS = {
    "one pixel": sarcl.ImageGrid.plane(center=(3, 1, 0), shape=(1, 1), spacing=1.0),
    "a tile and one": sarcl.ImageGrid.plane(shape=(33, 32), spacing=0.2),
    "one row": sarcl.ImageGrid.plane(shape=(1, 100), spacing=0.2),
    "steep plane": sarcl.ImageGrid.plane(shape=(20, 30), spacing=0.3, normal=(1, 0.3, 0.5), x_axis=(0, 1, 0)),
    "volume": sarcl.ImageGrid.points(np.random.default_rng(0).uniform(-8, 8, (3, 4, 50, 3))),
    "one point": sarcl.ImageGrid.points([[1.0, 2.0, 3.0]]),
    "coincident points": sarcl.ImageGrid.points(np.ones((70, 3))),
}


@pytest.mark.parametrize("name", GRIDS)
def test_any_grid_is_focused_within_tolerance(device, name):
    raw = noise_history()
    image = sarcl.backproject(raw, GRIDS[name], tolerance=1e-4, device=device)
    assert image.data.shape == GRIDS[name].shape
    assert image_error(image, raw) <= 1e-4


@pytest.mark.parametrize("shape", [(1, 1), (1, 40), (40, 1), (3, 2), (65, 47)])
def test_any_number_of_rows_and_samples_works(device, shape):
    raw = noise_history(n_rows=shape[0], n_samples=shape[1], seed=shape[0])
    image = sarcl.backproject(raw, PLANE, tolerance=1e-3, device=device)
    assert image_error(image, raw) <= 1e-3


def test_rows_may_have_their_own_frequency_plan(device):
    random = np.random.default_rng(4)
    raw = noise_history()
    raw = replace(
        raw,
        frequency=random.uniform(8e9, 10e9, raw.n_rows),
        frequency_step=random.uniform(4e6, 12e6, raw.n_rows),
    )
    assert image_error(sarcl.backproject(raw, PLANE, tolerance=1e-4, device=device), raw) <= 1e-4


def test_pixels_outside_the_range_window_get_nothing(device):
    raw = noise_history(n_samples=16)  # a swath of 4 m
    image = sarcl.backproject(raw, PLANE, tolerance=1e-4, device=device)
    assert image_error(image, raw) <= 1e-4
    far = sarcl.ImageGrid.plane(center=(300, 0, 0), shape=(40, 40), spacing=0.2)
    image = sarcl.backproject(raw, far, device=device)
    assert not image.data.any()
    assert image.report.contributions_done == 0


def test_wrap_repeats_the_window_instead(device):
    raw = noise_history(n_samples=16)
    grid = sarcl.ImageGrid.plane(center=(9, 0, 0), shape=(40, 50), spacing=(0.4, 0.4))
    image = sarcl.backproject(raw, grid, tolerance=1e-4, wrap=True, device=device)
    assert image_error(image, raw, wrap=True) <= 1e-4
    assert np.abs(image.data).min() > 0


def test_skipping_changes_nothing_but_the_count(device):
    raw = noise_history(n_samples=16, weight=np.arange(40) % 3)
    grid = sarcl.ImageGrid.plane(shape=(70, 101), spacing=0.5)
    whole = sarcl.backproject(raw, grid, skip=False, device=device)
    picky = sarcl.backproject(raw, grid, skip=True, device=device)
    norm = np.linalg.norm(whole.data)
    assert np.linalg.norm(whole.data - picky.data) <= 1e-6 * norm
    assert sum(whole.report.contributions_skipped.values()) == 0
    assert picky.report.contributions_skipped["zero weight"] == 14 * grid.size
    assert picky.report.contributions_skipped["range window"] > 0
    assert picky.report.contributions_done + sum(picky.report.contributions_skipped.values()) == 40 * grid.size


def test_window_and_weights_are_applied_to_samples_and_rows(device):
    from sarcl.numerics.windows import weights as window_weights

    raw = noise_history(weight=np.linspace(0, 1, 40))
    extra = np.linspace(2, 1, 40)
    image = sarcl.backproject(raw, PLANE, window=("taylor", 35, 5), weights=extra, tolerance=1e-4, device=device)
    samples = window_weights(("taylor", 35, 5), 48)
    rows = window_weights(("taylor", 35, 5), 40) * raw.weight * extra
    assert image_error(image, raw, sample_weight=samples, row_weight=rows) <= 1e-4
    assert image.gain == pytest.approx(samples.sum() * rows.sum())


def test_gain_is_the_modulus_of_a_unit_point(device):
    chirp = sarcl.Waveform.chirp(center=9.6e9, bandwidth=300e6, duration=1e-6)
    track = sarcl.Trajectory.circle(radius=7e3, height=5e3, arc=0.05, n_pulses=31)
    raw = sarcl.echo(sarcl.Scene.points([[2, 3, 0]]), chirp, track, tolerance=1e-5, device=device)
    image = sarcl.backproject(raw, sarcl.ImageGrid.points([[2.0, 3, 0]]), tolerance=1e-5, device=device)
    assert image.data[0] == pytest.approx(image.gain, rel=3e-5)


@pytest.mark.parametrize("max_bytes", [1e6, 3e6, 20e6])
def test_memory_limit_does_not_change_the_image(device, max_bytes):
    raw = noise_history(n_rows=150)
    grid = sarcl.ImageGrid.plane(shape=(180, 170), spacing=0.1)
    whole = sarcl.backproject(raw, grid, tolerance=1e-3, device=device)
    parts = sarcl.backproject(raw, grid, tolerance=1e-3, max_bytes=max_bytes, device=device)
    assert np.linalg.norm(parts.data - whole.data) <= 1e-6 * np.linalg.norm(whole.data)


def test_same_device_same_bits(device):
    raw = noise_history()
    first, second = (sarcl.backproject(raw, PLANE, device=device).data for _ in range(2))
    assert np.array_equal(first, second)


def test_image_and_echoes_may_live_in_files(device, tmp_path):
    raw = noise_history()
    raw.save(tmp_path / "raw.h5")
    lazy = sarcl.read(tmp_path / "raw.h5")
    wanted = sarcl.backproject(raw, PLANE, device=device)
    image = sarcl.backproject(lazy, PLANE, out=tmp_path / "image.h5", device=device)
    assert np.array_equal(image.data[...], wanted.data)
    again = sarcl.read(tmp_path / "image.h5")
    assert np.array_equal(again.data[...], wanted.data)
    assert again.gain == wanted.gain and again.report.tolerance == 1e-3
    with h5py.File(tmp_path / "plain.h5", "w") as file:
        dataset = file.create_dataset("image", PLANE.shape, np.complex64)
        sarcl.backproject(raw, PLANE, out=dataset, device=device)
        assert np.array_equal(dataset[...], wanted.data)
    memmap = np.memmap(tmp_path / "image.raw", np.complex64, "w+", shape=PLANE.shape)
    sarcl.backproject(raw, PLANE, out=memmap, device=device)
    assert np.array_equal(memmap, wanted.data)


def test_listed_points_arrive_in_a_file_in_their_own_order(device, tmp_path):
    raw = noise_history()
    grid = GRIDS["volume"]
    wanted = sarcl.backproject(raw, grid, device=device)
    image = sarcl.backproject(raw, grid, out=tmp_path / "volume.h5", device=device)
    assert np.array_equal(image.data[...], wanted.data)


def test_an_interrupted_run_leaves_no_file(device, tmp_path):
    def stop(stage, done, total):
        if done:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        sarcl.backproject(noise_history(), PLANE, out=tmp_path / "image.h5", device=device, progress=stop)
    assert list(tmp_path.iterdir()) == []


def test_progress_runs_from_nothing_to_all(device):
    calls, pairs = [], 300 * PLANE.size
    sarcl.backproject(noise_history(n_rows=300), PLANE, device=device, progress=lambda *a: calls.append(a))
    assert calls[0] == ("backproject", 0, pairs) and calls[-1] == ("backproject", pairs, pairs)
    assert [c[1] for c in calls] == sorted(c[1] for c in calls)


def test_measured_error_is_what_the_report_says(device):
    raw = noise_history()
    report = sarcl.backproject(raw, PLANE, tolerance=1e-3, check=True, device=device).report
    assert 0 < report.measured_error <= report.predicted_error <= 1e-3


def test_a_pixel_at_the_antenna_and_one_behind_it_are_finite_and_right(device):
    raw = noise_history(distance=30.0, n_rows=9)
    grid = sarcl.ImageGrid.points(np.stack([raw.tx[4], raw.tx[4] * 1.2, raw.tx[0]]))
    raw = replace(raw, frequency_step=raw.frequency_step / 40)  # a swath that holds them
    image = sarcl.backproject(raw, grid, tolerance=1e-4, device=device)
    assert image_error(image, raw) <= 1e-4


def test_weak_point_beside_a_strong_one_keeps_its_place(device):
    raw = noise_history()
    raw = replace(raw, samples=raw.samples * np.float32(1e30))
    assert image_error(sarcl.backproject(raw, PLANE, device=device), raw) <= 1e-3
    tiny = replace(raw, samples=(raw.samples / 1e30 * 1e-30).astype(np.complex64))
    assert image_error(sarcl.backproject(tiny, PLANE, device=device), tiny) <= 1e-3


@pytest.mark.costly
def test_a_tile_far_larger_than_the_window_reads_nothing_beyond_a_profile(device):
    # pixels 2 km and 200 km apart: places in a tile exceed what float32 counts in samples
    for spacing, bandwidth in ((2e4, 5e9), (2e5, 6e8)):
        raw = noise_history(n_rows=3, n_samples=256, distance=1e7, center=20e9, bandwidth=bandwidth)
        grid = sarcl.ImageGrid.plane(shape=(9, 9), spacing=spacing)
        for skip in (True, False):
            image = sarcl.backproject(raw, grid, skip=skip, device=device)
            assert image_error(image, raw) <= 1e-3


def test_a_reference_range_of_zero_loses_no_phase(device):
    raw = noise_history(n_rows=5, distance=36e6)
    raw = replace(raw, reference_range=np.zeros(5))
    image = sarcl.backproject(raw, PLANE, tolerance=1e-5, wrap=True, device=device)
    assert image_error(image, raw, wrap=True) <= 1e-5


def test_strips_and_columns_are_not_padded_to_squares():
    raw = noise_history(n_rows=2, n_samples=4)
    for shape in ((1, 100_000), (100_000, 1), (3, 40_000)):
        grid = sarcl.ImageGrid.plane(shape=shape, spacing=1e-5)
        image = sarcl.backproject(raw, grid, max_bytes=4e6, tolerance=1e-2)
        assert image.data.shape == shape


def test_an_image_of_nothing_is_zero_and_its_error_zero(device):
    raw = noise_history(n_rows=3, n_samples=16)
    raw = replace(raw, samples=np.zeros((3, 16), np.complex64))
    image = sarcl.backproject(raw, PLANE, check=True, device=device)
    assert not image.data.any() and image.report.measured_error == 0


def test_samples_whose_sums_overflow_are_refused():
    raw = replace(noise_history(), samples=np.full((40, 48), 1e36, np.complex64))
    with pytest.raises(ValueError, match="scale the samples down"):
        sarcl.backproject(raw, PLANE)


def test_the_best_tolerance_that_is_named_can_be_asked_for():
    """Below what users may ask for, where float64 is exhausted."""
    raw = noise_history(n_rows=1, n_samples=20000)
    grid = sarcl.ImageGrid.plane(shape=(9, 9), spacing=1.0)
    task = make_task(raw, grid, None, None, False, True, None)
    with pytest.raises(ToleranceUnreachable) as caught:
        choose(task, "auto", 1e-16)
    best = caught.value.best
    assert 1e-16 < best < 1e-11 and choose(task, "auto", best).predicted_error <= best


BAD = {
    "tolerance zero": ({"tolerance": 0}, "tolerance is 0"),
    "tolerance too small": ({"tolerance": 1e-12}, "float64 do not carry an error below 1e-11: give more"),
    "tolerance too large": ({"tolerance": 0.5}, "an error above 0.3 of the norm leaves no image: give less"),
    "tolerance not a number": ({"tolerance": "low"}, "must be a number"),
    "method unknown": ({"method": "magic"}, "'direct'"),
    "window unknown": ({"window": "square"}, "hamming"),
    "weights of wrong length": ({"weights": np.ones(3)}, r"weights has shape \(3,\), wanted \(40,\)"),
    "weights negative": ({"weights": -np.ones(40)}, "negative"),
    "weights all zero": ({"weights": np.zeros(40)}, "weight 0"),
    "weights not finite": ({"weights": np.full(40, np.nan)}, r"weights\[0\] is nan"),
    "skip unknown": ({"skip": {"rain"}}, "range window"),
    "max_bytes too small": ({"max_bytes": 10}, "max_bytes is 10"),
    "out of wrong shape": ({"out": np.zeros((2, 2), complex)}, r"out has shape \(2, 2\)"),
    "out not complex": ({"out": np.zeros(PLANE.shape)}, "wanted complex"),
}


@pytest.mark.parametrize("name", BAD)
def test_bad_options_say_what_was_wanted(name):
    options, message = BAD[name]
    with pytest.raises(ValueError, match=message):
        sarcl.backproject(noise_history(), PLANE, **options)


def test_pixels_alone_are_those_of_the_image():
    raw = noise_history()
    beam = (8.0 / 10e3, -raw.tx)  # 4 m on either side of the origin: the plane is 10 m x 9 m
    for options in ({}, {"tolerance": 1e-7}, {"beam": beam, "window": "hamming", "weights": np.arange(40.0)}):
        wanted = sarcl.backproject(raw, PLANE, **options)
        made = pixels_alone(raw, PLANE, **options)
        assert np.array_equal(made, wanted.data) and made.dtype == wanted.data.dtype
    assert np.ndim(wanted.gain) == 2  # the beam leaves pixels out


def test_unknown_options_raise():
    with pytest.raises(TypeError, match="tolerence"):
        sarcl.backproject(noise_history(), PLANE, tolerence=1e-3)


def test_uncompressed_data_are_refused():
    with pytest.raises(ValueError, match=r"sarcl\.compress"):
        sarcl.backproject(noise_history(compressed=False), PLANE)


def test_nan_in_a_lazy_source_is_named_when_it_is_read(tmp_path):
    raw = noise_history()
    samples = np.array(raw.samples)
    samples[7, 5] = np.nan
    with h5py.File(tmp_path / "raw.h5", "w") as file:
        lazy = replace(raw, samples=file.create_dataset("samples", data=samples))
        with pytest.raises(ValueError, match=r"samples\[7, 5\]"):
            sarcl.backproject(lazy, PLANE)


def test_unwritable_output_is_found_before_the_work(tmp_path):
    def fail(*_):
        raise AssertionError("work began")

    with pytest.raises(FileNotFoundError, match="nowhere"):
        sarcl.backproject(noise_history(), PLANE, out=tmp_path / "nowhere" / "image.h5", progress=fail)


def test_caller_gets_the_reference_image_for_free():
    raw = noise_history(n_rows=3, n_samples=4)
    image, norm = exact_image(raw, np.zeros((1, 3)))
    # at the centre every row's reference range is the path itself: the sum of all samples
    assert image[0] == pytest.approx(raw.samples.sum(), rel=1e-6)
    assert norm == pytest.approx(np.linalg.norm(raw.samples.sum(axis=1)), rel=1e-6)


def test_wrong_kinds_of_argument_are_named():
    with pytest.raises(TypeError, match=r"grid is a list; wanted a sarcl\.ImageGrid"):
        sarcl.backproject(noise_history(), [1, 2])
    with pytest.raises(TypeError, match=r"raw is a ndarray; wanted a sarcl\.PhaseHistory"):
        sarcl.backproject(np.zeros((3, 3), complex), PLANE)


def test_rows_of_several_polarizations_are_summed_only_where_the_sum_is_asked_for():
    raw = replace(noise_history(), polarization=["HH", "VV"] * 20)
    for verb in (sarcl.backproject, sarcl.plan, sarcl.polar_format):
        with pytest.raises(
            ValueError, match=r"polarisations HH, VV.*raw.select\(polarization='HH'\).*sum_polarizations"
        ):
            verb(raw, PLANE)
    parts = [sarcl.backproject(raw.select(polarization=kind), PLANE).data for kind in ("HH", "VV")]
    both = sarcl.backproject(raw, PLANE, sum_polarizations=True).data
    assert np.linalg.norm(both - sum(parts)) <= 2e-3 * np.linalg.norm(both)
    with pytest.raises(TypeError, match="sum_polarizations is 'HH'"):
        sarcl.backproject(raw, PLANE, sum_polarizations="HH")


@pytest.mark.parametrize("ratio", [0.5, 2.0])
def test_the_measured_error_of_an_image_with_few_bright_pixels_is_that_of_the_image(ratio):
    """Pixels chosen at random seldom meet the bright ones; their own norm would make 2.5e-3 of the image 1.1e-2."""
    random, tolerance, shape = np.random.default_rng(4), 1e-2, (300, 200)
    exact = 1e-3 * (random.standard_normal(shape) + 1j * random.standard_normal(shape))
    exact[[20, 151, 250], [17, 60, 188]] = 40.0
    wrong = random.standard_normal(shape) + 1j * random.standard_normal(shape)
    data = exact + wrong * (ratio * tolerance * np.linalg.norm(exact) / np.linalg.norm(wrong))
    index = tuple(random.integers(0, n, 256) for n in shape)
    for image in (data, data.astype(np.complex64)):
        measured = relative_error(image, index, exact[index], 0.0, tolerance)
        assert measured == pytest.approx(ratio * tolerance, rel=0.15)
    index = index[0][:2], index[1][:2]  # of an infinite sum, as at an antenna
    assert relative_error(data, index, np.array([np.inf, exact[index][1]]), 0.0, tolerance) < 1.0
