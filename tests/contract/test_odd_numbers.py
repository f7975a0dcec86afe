"""Numbers that NumPy takes for others in silence: with units, masked, complex, huge, tiny; and truth of all kinds."""

from __future__ import annotations

import copy
import pickle
from dataclasses import replace

import numpy as np
import pytest
from helpers.cases import noise_on, straight

import sarcl
from sarcl.base import validation
from sarcl.model.lazy_rows import RowsOnDemand

SCENARIO = """
[waveform.chirp]
center = 9e9
bandwidth = 1e8
duration = 1e-6
[trajectory.line]
start = [-700, -5, 700]
velocity = [0, 10, 0]
prf = 16.0
n_pulses = 4
[[scene.points]]
positions = [[0, 0, 0]]
"""
RAW = noise_on(straight(16), n_samples=32, time=np.linspace(0, 0.1, 16))
TRACK = sarcl.Trajectory.line(start=(-700, -5, 1e3), velocity=(0, 10, 0), prf=16.0, n_pulses=8)
CHIRP = sarcl.Waveform.chirp(center=9e9, bandwidth=1e8, duration=1e-6)
GRID = sarcl.ImageGrid.plane(shape=(6, 5), spacing=0.2)


class Quantity(np.ndarray):
    """Numbers with a unit, as astropy's and unyt's are; NumPy takes its numbers."""

    unit = "km"


def kilometres(*values):
    return np.array(values, float).view(Quantity)


def test_numbers_with_a_unit_are_refused_and_named():
    for name, call in (
        ("tx", lambda: replace(RAW, tx=RAW.tx.view(Quantity))),
        ("reference_range", lambda: replace(RAW, reference_range=kilometres(5.0).reshape(()))),
        ("by", lambda: sarcl.shapes.box((1, 1, 1)).moved(kilometres(1, 2, 3))),
        ("center", lambda: sarcl.ImageGrid.plane(shape=4, spacing=1.0, center=kilometres(1, 2, 3))),
        ("prf", lambda: validation.number("prf", kilometres(1).reshape(()))),
    ):  # fmt: skip
        with pytest.raises(ValueError, match=rf"{name} (carries the unit km; give plain numbers|must be a number)"):
            call()
    plain = np.array([1.0, 2, 3]).view(type("Plain", (np.ndarray,), {"unit": ""}))
    assert type(sarcl.shapes.box((1, 1, 1)).moved(plain).triangles) is np.ndarray


@pytest.mark.parametrize(
    "value", [np.complex128(1 + 5j), np.complex64(2), np.array(1j), np.ma.masked, np.ma.array(2.0, mask=True)]
)
def test_numbers_lose_neither_imaginary_part_nor_mask(value):
    for name, call in (
        ("prf", lambda: sarcl.Trajectory.line(start=(0, 0, 1), velocity=(1, 0, 0), prf=value, n_pulses=2)),
        ("n_pulses", lambda: sarcl.Trajectory.line(start=(0, 0, 1), velocity=(1, 0, 0), prf=1.0, n_pulses=value)),
        ("weight", lambda: replace(RAW, weight=value)),
        ("variance", lambda: sarcl.add_noise(RAW, variance=value)),
        ("roughness", lambda: sarcl.shapes.plate((1, 1), roughness=value)),
        ("rms", lambda: sarcl.motion.perturbed(TRACK, rms=value, correlation_time=0.1)),
        ("phase", lambda: sarcl.motion.sinusoidal(TRACK, amplitude=(0, 0, 1), frequency=1.0, phase=value)),
        ("taper", lambda: sarcl.Antenna.rectangular(size=1.0, taper=value)),
        ("longitude", lambda: sarcl.wgs84.ecef(value, 0.0, 0.0)),
        ("angle", lambda: sarcl.array_factor.reduced(value)),
    ):  # fmt: skip
        with pytest.raises(ValueError, match=name):
            call()


def test_whole_numbers_that_do_not_fit_are_refused_instead_of_wrapped():
    for given in (np.array([2**63 + 5] * 16, np.uint64), np.full(16, 1e30)):
        with pytest.raises(ValueError, match=r"tx_channel must be numbers that fit int64.*not all are small enough"):
            replace(RAW, tx_channel=given)


@pytest.mark.parametrize("value", ["no", "False", 2, -1, np.nan, None, [0, 1], np.array([True, False])])
def test_truth_is_true_or_false(value):
    for name, call in (
        ("stop_and_go", lambda: replace(TRACK, stop_and_go=value)),
        ("compressed", lambda: replace(RAW, compressed=value)),
        ("compressed", lambda: sarcl.echo(sarcl.Scene.points([[0, 0, 0]]), CHIRP, TRACK, compressed=value)),
        ("ripple", lambda: sarcl.spectral_echo(sarcl.Scene.points([[0, 0, 0]]), CHIRP, TRACK, ripple=value)),
        ("j2", lambda: sarcl.Orbit.kepler(7e6, 0, 1, j2=value)),
        ("scalar_first", lambda: sarcl.pointing.from_quaternions(TRACK, np.eye(8, 4), scalar_first=value)),
    ):
        with pytest.raises(TypeError, match=name):
            call()
    if not isinstance(value, (list, np.ndarray)):
        with pytest.raises(TypeError, match="two_sided"):
            sarcl.shapes.plate((1, 1), two_sided=value)


def test_degrees_in_float32_are_places_to_the_rounding_of_the_degrees():
    """Sines in float32 moved places by up to half a metre beyond that."""
    random = np.random.default_rng(0)
    longitude, latitude = (random.uniform(-a, a, 200).astype(np.float32) for a in (180, 90))
    found = sarcl.wgs84.ecef(longitude, latitude, np.float32(100.0))
    assert found.dtype == np.float64
    assert np.array_equal(found, sarcl.wgs84.ecef(longitude.astype(float), latitude.astype(float), 100.0))
    assert np.array_equal(sarcl.wgs84.up(longitude, latitude), sarcl.wgs84.up(*map(np.float64, (longitude, latitude))))


def test_levels_that_float32_does_not_hold_are_refused():
    scene = sarcl.Scene.points([[0, 0, 0]])
    tiny = replace(RAW, samples=np.asarray(RAW.samples, np.complex128) * 1e-50)
    weak = sarcl.Scene.points([[0, 0, 0]], 1e-40)
    for words, call in (
        (r"amplitudes reach 1e-40; .*scale them up", lambda: sarcl.echo(weak, CHIRP, TRACK)),
        (
            r"samples times weights reach \S+e-50; .*scale the samples up",
            lambda: sarcl.polar_format(tiny, GRID, check=False),
        ),
        (
            r"samples times weights reach \S+e-50; .*scale the samples up",
            lambda: sarcl.range_doppler(
                replace(noise_on(straight(64, aperture=10.0), n_samples=48, time=np.linspace(0, 0.1, 64)),
                        samples=np.full((64, 48), 1e-50 + 0j)), side="right", check=False),
        ),
        (r"frequency_step is 1e-30 Hz, a swath of 1.5e\+38 m; steps", lambda: replace(RAW, frequency_step=1e-30)),
        (r"swaths at most 1e\+08 m: is it in MHz\? Give 1\.39e\+06", lambda: replace(RAW, frequency_step=1.39)),
        (r"gain_db is 10000; gains reach from -300 to 300 dB", lambda: sarcl.Antenna.isotropic(gain_db=1e4)),
        (r"gain_db is -700", lambda: sarcl.Antenna.isotropic(gain_db=-700.0)),
        (r"losses_db is 10000; at most 300 dB", lambda: sarcl.Radar(power=1.0, losses_db=1e4)),
        (r"nesz_db is 10000; levels reach", lambda: sarcl.add_noise(RAW, nesz_db=1e4, cell_area=1.0)),
    ):  # fmt: skip
        with pytest.raises(ValueError, match=words):
            call()
    sarcl.echo(scene, CHIRP, TRACK, antenna=sarcl.Antenna.isotropic(gain_db=-300.0), radar=None)


def lazy_rows():
    raw = replace(RAW, samples=np.asarray(RAW.samples))

    class Lazy:
        shape, dtype = raw.samples.shape, raw.samples.dtype

        def __getitem__(self, rows):
            assert isinstance(rows, slice) and rows.step in (None, 1)
            return raw.samples[rows]

    lazy = replace(raw, samples=Lazy())
    yield sarcl.add_noise(lazy, variance=1.0)
    yield lazy[[3, 4, 1, 15]]
    yield sarcl.concatenate([lazy, lazy[::-1]])
    yield sarcl.stop_and_go.pulse_motion(
        replace(lazy, waveform=CHIRP, tx_velocity=np.ones((16, 3)), rx_velocity=np.ones((16, 3))), (0, 0, 0)
    )


def test_lazy_rows_are_indexed_as_arrays_are():
    for raw in lazy_rows():
        assert isinstance(raw.samples, RowsOnDemand)
        whole = np.asarray(raw.samples)
        for index in (
            0, -1, np.int64(2), np.s_[::2], np.s_[::-1], np.s_[3:1], np.s_[-2:], np.s_[1:3, 5], np.s_[2, ::4],
            np.s_[...], [2, 0], np.arange(len(whole)) % 2 == 0, np.s_[::-2, None],
            (np.s_[:], [1, 3]), np.s_[:0], np.s_[-100:100],
        ):  # fmt: skip
            assert np.array_equal(raw.samples[index], whole[index]), index
        with pytest.raises(IndexError, match=r"row \d+ was requested, but there are"):
            raw.samples[len(whole)]


@pytest.mark.parametrize("track", [None, 5, "x", np.ones((8, 3))])
def test_what_is_no_track_is_said_to_be_none(track):
    for call in (
        lambda: sarcl.pointing.fixed(track, (1, 0, 0)),
        lambda: sarcl.pointing.spotlight(track, (0, 0, 0)),
        lambda: sarcl.pointing.stripmap(track, 0.5),
        lambda: sarcl.pointing.steered(track, 0.1),
        lambda: sarcl.pointing.turned(track, (0, 0, 0.1)),
        lambda: sarcl.pointing.from_quaternions(track, np.eye(8, 4)),
        lambda: sarcl.stop_and_go.stop_and_go_error(track, [[0, 0, 0]], CHIRP),
        lambda: sarcl.stop_and_go.receiver_at_arrival(track, (0, 0, 0)),
        lambda: sarcl.motion.with_positions(RAW, track),
        lambda: sarcl.Antenna.gaussian(width=0.1).axes(track),
    ):
        with pytest.raises(TypeError, match=r"track is a \w+; wanted a sarcl.Trajectory"):
            call()
    for name, call in (
        ("raw", lambda: sarcl.compress(track)),
        ("raw", lambda: sarcl.noise.cell_area(track, (0, 0, 0))),
        ("raw", lambda: sarcl.radar.noise_variance(track, 290.0)),
        ("image", lambda: sarcl.measure(track)),
        ("image grid", lambda: sarcl.Image(np.ones((2, 2), np.complex64), track)),
    ):
        with pytest.raises(TypeError, match=rf"{name} is a \w+; wanted a sarcl\."):
            call()


def test_what_no_shape_or_picture_can_be_is_refused():
    for make in (
        lambda: sarcl.shapes.sphere(1.0, edge=5e-324),
        lambda: sarcl.shapes.cylinder(1.0, 1.0, edge=5e-324),
        lambda: sarcl.shapes.cone(1.0, 1.0, sections=10**11),
        lambda: sarcl.Orbit.kepler(7e6, 0, 1).trajectory(start=0.0, prf=100.0, n_pulses=10**12),
    ):
        with pytest.raises(MemoryError, match=r"(facets; take|is too fine; take|give fewer pulses)"):
            make()
    image = sarcl.Image(np.ones((4, 4), np.complex64), sarcl.ImageGrid.plane(shape=4, spacing=1.0))
    for options in ({"top_db": 1e300}, {"floor_db": -1e300}):
        with pytest.raises(ValueError, match=rf"{next(iter(options))} is"):
            image.show(**options)
    assert sarcl.Material(width=None, reflectivity=None) == sarcl.Material()


def test_two_line_elements_are_copied_and_open_files_are_said_not_to_be(tmp_path):
    pytest.importorskip("sgp4")
    orbit = sarcl.Orbit.tle(
        "1 25544U 98067A   08264.51782528 -.00002182  00000-0 -11606-4 0  2927",
        "2 25544  51.6416 247.4627 0006703 130.5360 325.0288 15.72125391563537",
    )
    for again in (pickle.loads(pickle.dumps(orbit)), copy.deepcopy(orbit)):
        assert np.array_equal(again.positions([0.0, 100.0]), orbit.positions([0.0, 100.0]))
    RAW.save(tmp_path / "a.h5")
    raw = sarcl.read(tmp_path / "a.h5")
    for made in (raw, raw[[2, 1]], sarcl.add_noise(raw, variance=1.0)):
        for handed in (pickle.dumps, copy.deepcopy):
            with pytest.raises(TypeError, match=r"rows of the open file '.*a\.h5', .*sarcl\.read\(path\)"):
                handed(made)


@pytest.mark.parametrize(
    "window, words",
    [
        (("taylor", 1e9, 5), r"taylor sidelobe_db is 1e\+09; windows take at most 300"),
        (("taylor", 35, 10**8), r"taylor nbar is 1e\+08; windows take at most 200"),
        (("chebwin", 1e6), r"chebwin at is 1e\+06; windows take at most 300"),
        (("kaiser", 1e9), r"kaiser beta is 1e\+09; windows take at most 700"),
        (("dpss", 1e9), r"dpss NW is 1e\+09; it lies above 0 and below half the number of cells, "),
        (("gaussian", 0.0), r"window \('gaussian', 0.0\) "),
        (("general_cosine", [1e308, 1e308, 1e308]), r"has weights that are not finite"),
    ],
)
def test_parameters_of_windows_that_overflow_are_refused(window, words):
    with pytest.raises(ValueError, match=words):
        sarcl.backproject(RAW, GRID, window=window)


def test_noise_is_checked_before_the_work():
    from sarcl.scenario import scenario

    for levels in ("", "variance = 1.0\nnesz_db = 3.0"):
        made = scenario.loads(f"{SCENARIO}\n[noise]\n{levels}")
        for call in (made.simulate, made.plan):
            with pytest.raises(ValueError, match=r"noise has one level; give one of nesz_db"):
                call()
