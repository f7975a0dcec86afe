"""Range-Doppler images of strip maps: the window over the beam, and the gain of each pixel."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from helpers import strip_map
from helpers.cases import noise_on

import sarcl
from sarcl.base.constants import SPEED_OF_LIGHT
from sarcl.imaging.range_doppler.range_doppler import gain_of, row_weights

TAYLOR = ("taylor", 35, 5)
SPEED = 75.0  # of strip_map, m/s
HERTZ = 2 * SPEED * strip_map.CARRIER / SPEED_OF_LIGHT
BEAM = {"azimuth_beam": strip_map.ANGLE, "doppler": HERTZ * np.sin(strip_map.SQUINT), "side": "right"}
ZONE = 0.002


@pytest.fixture(scope="module")
def raw():
    return strip_map.unit_points(n_samples=128)


def at_point(image, raw, k):
    """`measure` of a point, with the antenna in the middle of the rows that see it."""
    rows = np.flatnonzero(strip_map.seen(strip_map.POINTS[k : k + 1])[0])
    return sarcl.measure(replace(image, tx=raw.tx[rows[len(rows) // 2]], rx=None), near=strip_map.POINTS[k])


# level: of the pedestal hardly any lies in rows that do not see the point; width: the window begins within the beam
@pytest.mark.parametrize(
    "window, lobes",
    [(TAYLOR, -33.5), *(pytest.param(*one, marks=pytest.mark.slow) for one in (("hamming", -41.5), ("hann", -31.2)))],
)
def test_points_read_0_dbsm_and_have_the_side_lobes_of_the_window(raw, window, lobes):
    image = sarcl.range_doppler(raw, tolerance=3e-3, window=(None, window), check=True, **BEAM)
    assert image.report.measured_error <= image.report.predicted_error
    grid = sarcl.ImageGrid.plane(center=strip_map.POINTS[1], shape=(300, 40), spacing=(0.2, 0.6))
    exact = sarcl.backproject(raw, grid, beam=strip_map.BEAM, window=(None, window), tolerance=1e-3)
    exact = sarcl.measure(exact, near=strip_map.POINTS[1])
    for k, place in enumerate(strip_map.POINTS):
        seen = at_point(image, raw, k)
        assert np.linalg.norm(seen.position - place) < 0.01
        assert 20 * np.log10(abs(seen.peak) / seen.gain) == pytest.approx(0, abs=0.05)
        assert seen.pslr[1] < lobes and abs(seen.pslr[1] - exact.pslr[1]) < 2.0
        assert 1 < seen.irw[1] / exact.irw[1] < 1.06


@pytest.fixture(scope="module")
def seen_beyond():
    """The same points, seen by every row."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(strip_map, "seen", lambda points: np.ones((len(points), strip_map.N_ROWS), bool))
        return strip_map.unit_points(n_samples=128)


def levels(image, raw):
    """Of the points, dB of the gain there."""
    seen = [at_point(image, raw, k) for k in range(len(strip_map.POINTS))]
    return 20 * np.log10([abs(point.peak) / point.gain for point in seen])


@pytest.mark.parametrize("tolerance", [1e-2, pytest.param(3e-3, marks=pytest.mark.slow)])
def test_uniform_weights_within_the_beam_read_0_dbsm_wherever_the_antenna_sees(raw, seen_beyond, tolerance, caplog):
    for data in (raw, seen_beyond):
        image = sarcl.range_doppler(data, tolerance=tolerance, window=(None, "boxcar"), **BEAM)
        assert np.abs(levels(image, data)).max() <= 0.05
    assert "gain from beyond the beam" not in image.report.plan and not caplog.text


@pytest.mark.parametrize("tolerance", [1e-2, pytest.param(3e-3, marks=pytest.mark.slow)])
def test_without_a_window_the_report_says_what_rows_beyond_the_beam_make_of_the_gain(
    raw, seen_beyond, tolerance, caplog
):
    """A point seen there reads 0 dBsm, one that is not reads low by what the report says, and the log with a remedy."""
    image = sarcl.range_doppler(seen_beyond, tolerance=tolerance, **BEAM)
    assert np.abs(levels(image, seen_beyond)).max() <= 0.05
    image = sarcl.range_doppler(raw, tolerance=tolerance, **BEAM)
    said = image.report.plan["gain from beyond the beam"]
    # of the inner points, which rows see over the whole taper; the track ends within that of the others
    assert levels(image, raw)[1:3] == pytest.approx(-float(said.split()[0]), abs=0.1)
    assert f"reads up to {said} low; window=(None, 'boxcar') keeps within the beam" in caplog.text


@pytest.mark.parametrize("window", ["hamming", "triang", TAYLOR])
@pytest.mark.parametrize(
    "zones, tolerance", [(4, 3e-2), (12, 3e-2), (12, 1e-3), pytest.param(40, 1e-3, marks=pytest.mark.slow)]
)
def test_white_noise_has_the_predicted_error_with_windows(window, zones, tolerance):
    # the pulse rate 30 % above the Doppler bandwidth of a beam of some Fresnel zones, a track of four apertures
    zone, hertz = np.sqrt(SPEED_OF_LIGHT / 9.6e9 / 8e3), 2 * 100 * 9.6e9 / SPEED_OF_LIGHT
    length = 4 * zones * zone * 4e3
    n = int(length / 100 * 1.3 * hertz * zones * zone)
    tx = np.stack([np.full(n, -2.8e3), np.linspace(-length / 2, length / 2, n), np.full(n, 2.856e3)], axis=1)
    raw = noise_on(tx, n_samples=48, bandwidth=150e6, seed=1, time=np.arange(n) * length / n / 100)
    raw = replace(raw, reference_range=np.full(n, 4e3))
    image = sarcl.range_doppler(
        raw, azimuth_beam=zones * zone, side="right", tolerance=tolerance, window=window, check=True
    )
    assert 0.01 * tolerance < image.report.measured_error <= image.report.predicted_error <= tolerance


def test_where_every_row_sees_every_pixel_the_window_is_that_of_the_rows(raw):
    lit = raw[500:700]
    options = {"window": "hamming", "times": (19.0, 20.0), "ranges": (9980, 10020), "spacing": (0.004, 1.0)}
    wide, plain = (
        sarcl.range_doppler(lit, side="right", doppler=0.0, azimuth_beam=beam, check=False, **options)
        for beam in (1.0, None)
    )
    assert np.linalg.norm(wide.data - plain.data) < 1e-2 * np.linalg.norm(plain.data)
    assert wide.gain == pytest.approx(128 * 0.54**2 * 200, rel=1e-6) == plain.gain


@pytest.mark.parametrize("window", [None, "hamming"])
def test_the_gain_is_the_sum_of_the_weights_of_the_rows(raw, window):
    weights = np.random.default_rng(3).uniform(0.5, 1.0, raw.n_rows)
    image = sarcl.range_doppler(raw, window=window, weights=weights, check=False, **BEAM)
    task = sarcl.range_doppler.planned(raw, window=window, weights=weights, **BEAM).task
    index, _ = image.grid.sample(200, seed=2)
    share = row_weights(task.track, task.plan, task.plan.times[index[0]], image.grid.ranges[index[1]],
                         task.wavelength).real  # fmt: skip
    wanted = task.sample_weight.sum() * share @ task.row_weight
    seen = image.gain[index] > 0
    assert seen.sum() > 150 and image.gain[index][seen] == pytest.approx(wanted[seen], rel=1e-3)
    # pixels that hardly any row sees are empty, not noise over a small number
    assert (wanted[~seen] < 0.011 * image.gain.max()).all() and (image.data[image.gain == 0] == 0).all()
    assert gain_of(task.plan, task.track, task.sample_weight, task.row_weight, 1e-2).dtype == np.float32


def test_points_at_the_end_of_a_strip_are_as_bright_as_in_its_middle():
    # the rows beyond the end are missing: two thirds of the aperture are left
    frequency = 9.6e9 + (np.arange(128) - 63.5) * 150e6 / 128
    tx = np.stack([np.full(500, -2.8e3), np.linspace(-200, 200, 500), np.full(500, 2.856e3)], axis=1)

    def image(places):
        samples = sum(
            np.exp(-4j * np.pi / SPEED_OF_LIGHT * (np.linalg.norm(tx - p, axis=1) - 4e3)[:, None] * frequency)
            for p in places
        )
        raw = sarcl.PhaseHistory(
            samples, frequency=frequency[0], frequency_step=150e6 / 128, tx=tx, reference_range=4e3,
            time=np.arange(500) * 400 / 499 / 100,
        )  # fmt: skip
        return sarcl.range_doppler(raw, azimuth_beam=0.015, window=(None, "hann"), ranges=(3985, 4025), side="right")

    positions = image([np.zeros(3)]).grid.positions  # points in the middle of pixels
    rows, column = (len(positions) // 50, len(positions) // 2), positions.shape[1] // 2
    made = image(positions[rows, column])
    assert made.gain[rows[0], column] < 0.8 * made.gain[rows[1], column]
    assert np.abs(made.normalized()[rows, column]) == pytest.approx(1, abs=5e-3)
