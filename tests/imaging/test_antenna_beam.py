"""An antenna as beam: the matched filter of its pattern, and the gain that belongs to it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import sarcl
from sarcl.imaging import choose_method
from sarcl.imaging.focusing_task import make_task
from sarcl.model.antenna_pattern import two_way_gain
from sarcl.reference.backproject import PerPoint
from sarcl.reference.backproject import backproject as exact

N = 240
LOOK, SQUINT = np.arctan2(4000.0, 2000.0), 0.05
MIDDLE = np.array([4000.0, 210.0, 0.0])
TRACK = sarcl.pointing.stripmap(
    sarcl.Trajectory.line(start=(0, -N / 2 * 3.0, 2000.0), velocity=(0, 300, 0), prf=100.0, n_pulses=N),
    look=LOOK, squint=SQUINT,
)  # fmt: skip
GRID = sarcl.ImageGrid.plane(center=MIDDLE, shape=(40, 36), spacing=(4.0, 2.0))
ANGLES = np.linspace(-0.3, 0.3, 41)
TURNING = np.exp(-((ANGLES[:, None] / 0.1) ** 2) - (ANGLES / 0.2) ** 2 + 20j * ANGLES[:, None])  # a phase of its own
ANTENNAS = {
    "aperture": sarcl.Antenna.rectangular(size=(0.6, 0.2), taper=0.4),
    "gaussian": sarcl.Antenna.gaussian(width=(0.08, 0.3), gain_db=20.0),
    "table": sarcl.Antenna.table(ANGLES, ANGLES, TURNING),
    "two-way": sarcl.Antenna.gaussian(width=(0.08, 0.3), two_way=True),
}


def noise(bistatic=False):
    random = np.random.default_rng(3)
    samples = random.standard_normal((N, 64)) + 1j * random.standard_normal((N, 64))
    tx = TRACK.positions
    return sarcl.PhaseHistory(
        samples.astype(np.complex64), frequency=5.27e9, frequency_step=60e6 / 64, tx=tx,
        rx=tx + np.array([40.0, -60.0, 20.0]) if bistatic else None,
        reference_range=np.linalg.norm(tx - MIDDLE, axis=1), time=TRACK.times,
    )  # fmt: skip


def gains(raw, antenna, points, axes):
    """g_p(x), complex (n, n_rows), from the formula of the pattern; axes (n_rows, 3, 3), of both ends."""
    carrier = raw.frequency[0] + raw.n_samples // 2 * raw.frequency_step[0]
    pair = antenna, None if antenna.two_way else antenna
    rows = range(raw.n_rows)
    return np.stack([two_way_gain(pair, (axes[p], axes[p]), raw.tx[p], raw.rx[p], points, carrier) for p in rows], 1)


def compare(image, raw, g):
    """Relative errors of an image and of its gain against the float64 twin, at the pixels of g (index, (n, n_rows))."""
    (index, points), g = g
    wanted, norm = exact(raw, points, None, None, False, None, 0.0, PerPoint(g.conj()))
    error = np.linalg.norm(np.asarray(image.data)[index] - wanted) / max(norm, np.linalg.norm(wanted))
    wanted = (np.abs(g) ** 2).sum(axis=1) * raw.n_samples
    return error, np.abs(image.gain[index] / wanted - 1).max()


@pytest.mark.parametrize(
    "name", [pytest.param(n, marks=[pytest.mark.slow] if n == "aperture" else []) for n in ANTENNAS]
)
def test_the_image_is_the_sum_with_the_conjugate_gains(device, name):
    raw, antenna = noise(), ANTENNAS[name]
    image = sarcl.backproject(raw, GRID, beam=(antenna, TRACK), tolerance=1e-3, device=device)
    at = GRID.sample(50, seed=1)
    error, gain = compare(image, raw, (at, gains(raw, antenna, at[1], TRACK.attitude)))
    print(f"{name}: error {error:.1e} of {image.report.predicted_error:.1e}, gain {gain:.1e}")
    assert error <= image.report.predicted_error <= 1e-3 and gain <= 1e-4


@pytest.mark.parametrize(
    ("name", "bistatic", "tolerance"),
    [
        ("table", False, 1e-9),
        pytest.param("aperture", True, 1e-9, marks=pytest.mark.slow),
        pytest.param("gaussian", False, 1e-6, marks=pytest.mark.slow),
        pytest.param("two-way", False, 1e-10, marks=pytest.mark.slow),
    ],
)
def test_tolerances_that_float32_gains_cannot_meet_are_met_in_float64(name, bistatic, tolerance):
    raw, antenna = noise(bistatic), ANTENNAS[name]
    weights = np.linspace(0.5, 1.0, N)
    image = sarcl.backproject(raw, GRID, beam=(antenna, TRACK), tolerance=tolerance, weights=weights)
    assert image.dtype == np.complex128 and image.gain.dtype == np.float64
    index, points = GRID.sample(50, seed=1)
    g = gains(raw, antenna, points, TRACK.attitude)
    wanted, norm = exact(raw, points, None, weights, False, None, 0.0, PerPoint(g.conj()))
    error = np.linalg.norm(np.asarray(image.data)[index] - wanted) / max(norm, np.linalg.norm(wanted))
    gain = (np.abs(g) ** 2 @ weights) * raw.n_samples
    print(f"{name}: error {error:.1e} of {image.report.predicted_error:.1e}")
    assert error <= image.report.predicted_error <= tolerance
    assert np.abs(image.gain[index] / gain - 1).max() < 1e-11


def test_a_device_without_float64_says_that_it_lacks_it():
    task = make_task(noise(), GRID, None, None, False, True, ANTENNAS["gaussian"])
    with pytest.raises(sarcl.ToleranceUnreachable, match="cannot be met without float64; the best here is"):
        choose_method.choose(task, "direct", 1e-8, float64=False)


@pytest.mark.slow
def test_two_antennas_listed_points_and_blocks(device):
    raw, antenna = noise(bistatic=True), ANTENNAS["gaussian"]
    grid = sarcl.ImageGrid.points(GRID.positions + np.random.default_rng(2).uniform(-2, 2, (40, 36, 3)))
    options = {"beam": (antenna, TRACK.attitude), "tolerance": 1e-3, "device": device}
    image = sarcl.backproject(raw, grid, check=True, **options)
    assert 0 < image.report.measured_error <= image.report.predicted_error
    at = grid.sample(50, seed=1)
    error, gain = compare(image, raw, (at, gains(raw, antenna, at[1], TRACK.attitude)))
    assert error <= 1e-3 and gain <= 1e-4
    small = sarcl.backproject(raw, grid, max_bytes=1e6, **options)
    assert np.linalg.norm(small.data - image.data) <= 1e-6 * np.linalg.norm(image.data)
    assert small.gain == pytest.approx(image.gain, rel=1e-6)


@pytest.fixture(scope="module")
def strip():
    """Unit points along a strip, seen through an antenna whose beam passes over them."""
    track = sarcl.Trajectory.line(start=(0, -330.0, 2000.0), velocity=(0, 120, 0), prf=100.0, n_pulses=550)
    track = sarcl.pointing.stripmap(track, look=LOOK, squint=SQUINT)
    antenna = sarcl.Antenna.rectangular(size=(3.0, 0.3), taper=0.3)
    points = MIDDLE + np.array([[0, 0, 0], [18, 40, 0], [-14, -45, 0]])
    chirp = sarcl.Waveform.chirp(center=5.3e9, bandwidth=60e6, duration=2e-6)
    raw = sarcl.echo(
        sarcl.Scene.points(points), chirp, track, antenna=antenna, reference=MIDDLE, range_window=(-150, 150)
    )
    return raw, antenna, track, points


def test_points_read_their_cross_section_anywhere_in_the_beam(strip):
    raw, antenna, track, points = strip
    grid = sarcl.ImageGrid.plane(center=MIDDLE, shape=(412, 72), spacing=(0.35, 1.5))
    for window in (None, (("taylor", 35, 5), None)):
        image = sarcl.backproject(raw, grid, beam=(antenna, track), window=window, tolerance=1e-3)
        for point, seen in zip(points, sarcl.measure(image, near=points), strict=True):
            print(f"{10 * np.log10(seen.rcs):+.4f} dBsm")
            assert abs(10 * np.log10(seen.rcs)) <= 0.05 and np.linalg.norm(seen.position - point) < 0.02
    # without the antenna in the image the points read what the beam leaves of them
    plain = sarcl.backproject(raw, grid, tolerance=1e-3)
    assert max(10 * np.log10(seen.rcs) for seen in sarcl.measure(plain, near=points)) < -3


def test_aims_are_the_centre_a_direction_or_an_attitude():
    raw, antenna = noise(), ANTENNAS["aperture"]
    at = GRID.sample(20, seed=1)
    toward = MIDDLE - raw.tx
    spot = sarcl.pointing.spotlight(TRACK, MIDDLE).attitude
    fixed = sarcl.pointing.fixed(TRACK, (4000.0, 200.0, -2000.0)).attitude
    for beam, axes in (
        (antenna, spot),
        ((antenna, toward), spot),
        ((antenna, (4000.0, 200.0, -2000.0)), fixed),
        ((antenna, TRACK.attitude), TRACK.attitude),
    ):
        task = make_task(raw, GRID, None, None, False, True, beam)
        made = np.stack([task.antenna.weights(at[1], p, task.antenna.frequency) for p in range(N)], axis=1)
        assert made == pytest.approx(gains(raw, antenna, at[1], axes), abs=1e-9)
    used = make_task(raw, GRID, None, np.arange(N) % 2, False, True, (antenna, TRACK))
    assert used.antenna.axes[0] == pytest.approx(TRACK.attitude[1::2]) and len(used.antenna.geometry) == N // 2


def test_an_antenna_that_looks_everywhere_changes_nothing():
    raw = noise()
    image = sarcl.backproject(raw, GRID, beam=sarcl.Antenna.isotropic(), tolerance=1e-3)
    plain = sarcl.backproject(raw, GRID, tolerance=1e-3)
    assert np.linalg.norm(image.data - plain.data) <= 2e-3 * np.linalg.norm(plain.data)
    assert image.gain == pytest.approx(plain.gain, rel=1e-6)


@pytest.mark.parametrize("gain_db", [-300.0, 200.0])
@pytest.mark.parametrize("tolerance", [1e-3, 1e-9])
def test_gains_at_the_ends_of_what_an_antenna_takes_are_factors(gain_db, tolerance):
    """The peaks' squares lie beyond float32, and the sums of weights with them; the image over its gain does not."""
    raw, antenna = noise(), sarcl.Antenna.gaussian(width=(0.08, 0.3))
    plain, strong = (
        sarcl.backproject(raw, GRID, beam=(one, TRACK), tolerance=tolerance)
        for one in (antenna, replace(antenna, gain_db=gain_db))
    )
    factor = 10 ** (gain_db / 10)  # two ways
    assert np.abs(strong.gain / factor**2 / plain.gain - 1).max() < 1e-6
    pixels = np.asarray(strong.data, np.complex128) / factor
    assert np.linalg.norm(pixels - plain.data) <= 2 * tolerance * np.linalg.norm(plain.data)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"beam": (ANTENNAS["gaussian"], (1.0, 2.0))}, r"beam\[1\] has shape \(2,\); with an Antenna give"),
        (
            {"beam": (ANTENNAS["gaussian"], replace(TRACK, attitude=None))},
            "without attitude; give one with",
        ),
        ({"beam": (ANTENNAS["gaussian"], np.ones((N, 3, 3)))}, "is no rotation"),
        ({"beam": (ANTENNAS["gaussian"], None, None)}, "beam has 3 parts; give an Antenna"),
        ({"beam": (ANTENNAS["table"], (-1.0, 0, 0))}, "wholly out of the antenna's beam; aim it"),
        ({"beam": ANTENNAS["gaussian"], "method": "factorized"}, "or an Antenna as beam: take method='direct'"),
    ],
)
def test_what_cannot_be_says_why(options, message):
    with pytest.raises(ValueError, match=message):
        sarcl.plan(noise(), GRID, **{"tolerance": 1e-3, **options})


def test_rows_weighted_pixel_by_pixel_are_never_merged():
    """Sub-apertures share the weights of their rows: of a large image with an antenna they lost its gains."""
    task = make_task(
        noise(), sarcl.ImageGrid.plane(center=MIDDLE, shape=(512, 512), spacing=0.1), None, None, False, True
    )
    assert choose_method.choose(task, "auto", 1e-2).method == "factorized"
    weighted = replace(task, antenna=make_task(noise(), GRID, None, None, False, True, ANTENNAS["gaussian"]).antenna)
    assert choose_method.choose(weighted, "auto", 1e-2).method == "direct"
