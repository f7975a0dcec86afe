"""Echoes interpolated between a few positions of an array, against the exact sum of every channel."""

from __future__ import annotations

import numpy as np
import pytest
from helpers.array_cases import EACH, F0, SCENE, STEP, TONE, error, line, passing

import sarcl
from sarcl import shapes
from sarcl.base.constants import SPEED_OF_LIGHT
from sarcl.model.antenna_array import AntennaArray
from sarcl.simulation.channels._chebyshev_positions import choose_positions

WINDOW = (-3.7, 3.7)


def drawn(seed):
    """An array, a track, a scene and options at random."""
    random = np.random.default_rng(seed)
    distance = 10.0 ** random.uniform(2.5, 7.5)
    kind = random.choice(["line", "costas", "plane", "scattered", "switched"])
    spacing = random.uniform(0.005, 0.2)
    n = int(random.integers(5, 12))
    if kind == "costas":
        array = AntennaArray.costas(10, spacing=spacing, frequency_step=STEP)
    elif kind == "plane":
        array = AntennaArray.planar((4, 3), spacing=(spacing, spacing), frequency_step=(STEP, -STEP))
    elif kind == "scattered":
        places = random.uniform(-1, 1, (n, 3)) * [0.3, 1, 0.6]
        array = AntennaArray(
            positions=places, offsets=random.permutation(n)[None] * STEP, weights=random.normal(size=n) + 1j
        )
    else:
        array = line(n, spacing=spacing)
    pulses = 5
    if kind == "switched":
        array = array.mirrored(3, pulses)
    y = np.linspace(-0.5, 0.5, pulses) * random.uniform(0.01, 0.3) * distance
    height = 0.6 * distance
    turns = None
    if random.random() < 0.4:
        from scipy.spatial.transform import Rotation

        turns = Rotation.from_rotvec(random.normal(size=(pulses, 3))).as_matrix()
    track = sarcl.Trajectory(
        np.arange(pulses), np.stack([np.full(pulses, -0.8 * distance), y, 0 * y + height], axis=1), attitude=turns
    )
    receiver = None
    if random.random() < 0.3:
        off = random.normal(size=3) * 0.2 * distance
        receiver = sarcl.Trajectory(np.arange(pulses), track.positions + off)
    k = int(random.integers(1, 40))
    scene = sarcl.Scene.points(random.uniform(-1, 1, (k, 3)) * random.uniform(0.05, 2, 3), random.normal(size=k) + 0.3j)
    options = [
        {}, {"receive": "all"}, {"channels": "separated"}, {"channels": "separated", "receive": "own"},
        {"channels": "separated", "receive": "all"},
    ][int(random.integers(5))]  # fmt: skip
    return array, track, receiver, scene, options, float(10.0 ** random.uniform(-4.5, -1.3))


@pytest.mark.filterwarnings("ignore::sarcl.SarclWarning")
@pytest.mark.parametrize("seeds", [range(40), pytest.param(range(40, 80), marks=pytest.mark.slow)], ids=str)
def test_random_arrays_keep_their_tolerance(seeds):
    interpolated = 0
    for seed in seeds:
        array, track, receiver, scene, options, tolerance = drawn(seed)
        raw = sarcl.echo(
            scene, TONE, track, array=array, receiver=receiver, reference=(0, 0, 0), range_window=WINDOW,
            tolerance=tolerance, check=True, **options,
        )  # fmt: skip
        interpolated += raw.report.contributions_skipped.get("interpolated channels", 0) > 0
        achieved = error(raw, scene, TONE, array, track, receiver)
        assert achieved <= raw.report.predicted_error <= tolerance, seed
    assert interpolated > len(seeds) / 2


def test_places_are_two_a_turn_and_a_few():
    # the phase changes by `span` cycles over the array: Bessel functions of pi span vanish beyond as many terms
    elements = np.stack([np.zeros(900), np.linspace(-1, 1, 900), np.zeros(900)], axis=1)
    for span in (0.1, 1.0, 10.0, 100.0):
        for allowed in (1e-2, 1e-6):
            found = choose_positions(elements, lambda d, s=span: np.exp(-1j * np.pi * s * d[:, 1:2]), allowed)
            order = np.pi * span
            tail = (1.5 * np.log(10 / allowed)) ** (2 / 3) * max(1.0, order) ** (1 / 3)
            assert 2 * span <= len(found) <= order + tail + 2
            made = found.basis @ np.exp(-1j * np.pi * span * found.at[:, 1])
            assert np.abs(made - np.exp(-1j * np.pi * span * elements[:, 1])).max() <= found.error <= allowed
            np.testing.assert_allclose(found.basis.sum(axis=1), 1, atol=1e-9)


def test_a_plane_array_is_a_grid_of_places_along_its_own_axes():
    y, z = np.meshgrid(np.arange(-15, 16) * 0.1, np.arange(-10, 11) * 0.1, indexing="ij")
    turned = np.stack([0 * y, (y + z) / 2**0.5, (y - z) / 2**0.5], axis=-1).reshape(-1, 3)
    for elements in (np.stack([0 * y, y, z], axis=-1).reshape(-1, 3), turned):
        found = choose_positions(elements, lambda d: np.exp(-2j * np.pi * d @ np.array([[0.0], [0.1], [0.2]])), 1e-3)
        assert len(found) <= 48 < len(elements) and found.error <= 1e-3


@pytest.mark.parametrize("name", ["outside the window", "near", "uneven"])
def test_where_echoes_are_not_smooth_over_the_array_every_channel_is_made(name):
    track, array = passing(4), line(12)
    scene = sarcl.Scene.points([[0.0, 0, 0], [3.75 if name == "outside the window" else 0.5, 0, 0]])
    window, options = WINDOW, {}
    if name == "near":
        track = sarcl.Trajectory(track.times, track.positions / 1000)
    if name == "uneven":
        array, options = line(3).with_offsets([0.0, 1.0e6, 3.7e6]), {"channels": "separated"}
    raw, each = (
        sarcl.echo(
            scene,
            TONE,
            track,
            array=array,
            reference=(0, 0, 0),
            range_window=window,
            skip=skip,
            tolerance=1e-3,
            **options,
        )
        for skip in (True, EACH)
    )
    assert "interpolated channels" not in raw.report.contributions_skipped
    np.testing.assert_array_equal(raw.samples, each.samples)


@pytest.mark.slow
def test_facets_between_places():
    scene = shapes.box((0.5, 0.4, 0.3)) + shapes.sphere(0.2, edge=0.02).moved((0, 1, 0))
    track, array = passing(8), line(45, spacing=0.0144)
    window, options = (-3.6, 3.6), {"polarization": ("HH", "VV"), "tolerance": 1e-2, "check": True}
    raw, each = (
        sarcl.echo(scene, TONE, track, array=array, reference=(0, 0, 0), range_window=window, skip=skip, **options)
        for skip in (True, EACH)
    )
    assert raw.report.contributions_done < each.report.contributions_done / 8
    assert np.linalg.norm(np.asarray(raw.samples) - each.samples) <= 1e-2 * np.linalg.norm(each.samples)
    terms = {term.name: term.value for term in raw.report.error_terms}
    assert set(terms) == {"points", "interpolation between channels"}
    assert np.sqrt(sum(value**2 for value in terms.values())) == pytest.approx(raw.report.predicted_error)
    assert raw.report.measured_error <= raw.report.predicted_error <= 1e-2
    elsewhere = sarcl.Trajectory(track.times, track.positions + np.array([0.0, 2e3, 0]))
    apart = sarcl.echo(scene, TONE, track, receiver=elsewhere, array=line(9), reference=(0, 0, 0), tolerance=1e-2)
    assert "interpolated channels" not in apart.report.contributions_skipped


def test_every_element_to_every_other_takes_few_places():
    scene, array = sarcl.Scene.points([[0.0, 0, 0], [0.2, 0.4, 0]]), line(120, step=2e6, spacing=0.0144)
    tone = sarcl.Waveform.tone(center=F0, duration=1 / 2e6)
    raw = sarcl.echo(
        scene, tone, passing(2), array=array, channels="separated", receive="all", reference=(0, 0, 0),
        range_window=(-36, 36), tolerance=1e-3, check=True,
    )  # fmt: skip
    assert raw.n_rows == 2 * 120 * 120 and raw.report.plan["array positions"] <= 16
    assert raw.report.measured_error <= raw.report.predicted_error <= 1e-3
    row = 120 * 17 + 93  # pulse 0, sender 17, receiver 93
    tx, rx = raw.tx[row].astype(np.longdouble), raw.rx[row].astype(np.longdouble)
    path = [np.sqrt(((tx - x) ** 2).sum()) + np.sqrt(((rx - x) ** 2).sum()) for x in scene.positions]
    turns = (np.array(path) - 2 * raw.reference_range[row]) * raw.frequency[row] / SPEED_OF_LIGHT
    wanted = np.exp(-2j * np.pi * np.mod(turns, 1).astype(float)).sum()
    assert abs(raw.samples[row, 0] - wanted) < 1e-3 * 2**0.5


def test_a_single_pulse_close_by_is_seen():
    # one pulse of 200 from a tenth of the distance, where phases change ten times as much over the array
    positions = np.stack([np.full(200, -5e4), np.linspace(-50, 50, 200), np.full(200, 2e4)], axis=1)
    positions[101] /= 10
    track, array = sarcl.Trajectory(np.arange(200), positions), line(45, spacing=0.3)
    scene = sarcl.Scene.points([[0.0, -3, 0], [0.5, 3, 0]])
    raw = sarcl.echo(scene, TONE, track, array=array, reference=(0, 0, 0), range_window=WINDOW, tolerance=1e-3)
    assert raw.report.contributions_skipped["interpolated channels"] > 0
    close = sarcl.Trajectory([0.0], positions[101:102])
    wanted = sarcl.echo(
        scene, TONE, close, array=array, reference=(0, 0, 0), range_window=WINDOW, tolerance=1e-5, skip=EACH
    ).samples[0]
    assert np.linalg.norm(raw.samples[101] - wanted) <= 1e-3 * np.linalg.norm(wanted)


# Inputs on which other choices of positions fail
def straight(n, distance, length, look):
    look = np.array(look, float) / np.linalg.norm(look)
    across = np.cross([0, 0, 1.0], look)
    y = np.linspace(-length / 2, length / 2, n)
    return sarcl.Trajectory(np.arange(n) / 100, look * distance + y[:, None] * across / np.linalg.norm(across))


def both(scene, wave, track, tolerance, **options):
    """Echoes as they come, and how far off those of every channel they are."""
    raw, each = (
        sarcl.echo(scene, wave, track, reference=(0, 0, 0), tolerance=tolerance, skip=skip, **options)
        for skip in (True, EACH)
    )
    return raw, np.linalg.norm(raw.samples[:] - each.samples[:]) / np.linalg.norm(each.samples[:])


def test_two_elements():
    four = AntennaArray(positions=line(2).positions.repeat(2, axis=0), offsets=np.arange(4)[None] * STEP)
    for array in (line(2, spacing=0.3), four):
        _, off = both(SCENE, TONE, passing(6), 1e-3, array=array, range_window=WINDOW)
        assert off <= 2e-3


@pytest.mark.parametrize("width", [0.1, 0.02, 0.005])
def test_beams_differ_from_element_to_element(width):
    track = sarcl.pointing.spotlight(straight(4, 1000, 20, (-1, 0, 0)), (0, 0, 0))
    array = AntennaArray.linear(31, spacing=16 / 30, frequency_step=STEP)
    _, off = both(
        sarcl.Scene.points([[0.0, 0, 0]]), TONE, track, 1e-3, array=array, channels="separated", range_window=WINDOW,
        antenna=sarcl.Antenna.gaussian(width=(width, width)),
    )  # fmt: skip
    assert off <= 2e-3


@pytest.mark.parametrize("tolerance", [1e-3, 1e-4])
def test_echoes_fall_with_range_from_element_to_element(tolerance):
    array = AntennaArray.linear(31, spacing=0.6, frequency_step=STEP, axis=(1, 0, 0))
    raw, off = both(
        SCENE, TONE, straight(4, 1000, 20, (-1, 0, 0.2)), tolerance, array=array, channels="separated",
        range_window=(-40, 40), radar=sarcl.Radar(power=1.0),
    )  # fmt: skip
    assert off <= 2 * raw.report.predicted_error


def interleaved():
    i = np.arange(65)
    places = np.where((i % 2 == 0)[:, None], [0.0, -1000, 100], [-1000.0, 0, 100]) + i[:, None] * [0.1, 0.1, 0]
    return sarcl.Trajectory(i / 100, places)


def passed_by():
    i = np.arange(129)
    return sarcl.Trajectory(i / 100, np.stack([np.full(129, 500.0), (i - 66) * 600.0, np.full(129, 300.0)], axis=1))


def turning():
    from scipy.spatial.transform import Rotation

    track = straight(65, 1000, 30, (-1, 0, 0.1))
    turns = Rotation.from_rotvec(np.outer(np.arange(65) * np.pi / 2, [0, 0, 1])).as_matrix()
    return sarcl.Trajectory(track.times, track.positions, attitude=turns)


@pytest.mark.parametrize("fly", [interleaved, passed_by, turning])
def test_every_pulse_counts(fly):
    scene = sarcl.Scene.points([[0.0, 0, 0], [10, 3, 0], [-10, 5, 0], [0, -10, 0], [3, 10, 0]])
    tone = sarcl.Waveform.tone(center=F0, duration=1 / 2e6)
    array = AntennaArray.linear(45, spacing=0.2 if fly is not passed_by else 0.1, frequency_step=2e6)
    _, off = both(scene, tone, fly(), 1e-3, array=array, range_window=(-36, 36))
    assert off <= 2e-3


def test_a_reference_beside_the_array_bends_the_range_window():
    track = sarcl.Trajectory(np.arange(4) / 10, np.arange(4)[:, None] * [0.0, 0.1, 0])
    places = np.stack([np.zeros(41), np.linspace(-10, 10, 41), np.zeros(41)], axis=1)
    array, chirp = (
        AntennaArray(positions=places, offsets=np.zeros((1, 41))),
        sarcl.Waveform.chirp(center=F0, bandwidth=10e6, duration=1e-6),
    )
    scene = sarcl.Scene.points([[2000.0, 0, 0], [2000, 1, 0]], [1, 1j])
    raw, each = (
        sarcl.echo(
            scene, chirp, track, array=array, channels="separated", receive="own", reference=(5.0, 0, 0),
            range_window=(-1992.0, 1992.0), tolerance=1e-2, skip=skip,
        )
        for skip in (True, EACH)
    )  # fmt: skip
    assert np.linalg.norm(raw.samples - each.samples) <= 2e-2 * np.linalg.norm(each.samples)


@pytest.mark.filterwarnings("ignore::sarcl.SarclWarning")
def test_channels_that_cancel_add_their_errors_up():
    m = 200
    y = np.concatenate([1 + np.arange(m) * 1e-5, -1 - np.arange(m) * 1e-5, [0]])
    array = AntennaArray(
        positions=np.stack([0 * y, y, 0 * y], axis=1), offsets=[np.append(np.zeros(2 * m), 2e9)],
        weights=np.concatenate([np.ones(m), -np.ones(m), [1e-3]]),
    )  # fmt: skip
    chirp = sarcl.Waveform.chirp(center=F0, bandwidth=20e6, duration=1e-6)
    for x in (0.04, 0.17, 0.69):
        scene, track = sarcl.Scene.points([[0.0, x, 0], [0, -x, 0]], [1, 1e-6]), sarcl.Trajectory([0.0], [[-5e3, 0, 0]])
        raw = sarcl.echo(
            scene, chirp, track, array=array, reference=(0, 0, 0), range_window=(-60, 60), tolerance=0.1, check=True
        )
        assert raw.report.measured_error <= raw.report.predicted_error <= 0.1


def test_facets_seen_along_the_vertical_are_made_channel_by_channel():
    array = AntennaArray.linear(30, spacing=0.1, frequency_step=2e6, axis=(1, 0, 0))
    tone = sarcl.Waveform.tone(center=F0, duration=1 / 2e6)
    raw = sarcl.echo(
        shapes.plate((1.0, 1.0)), tone, straight(5, 3000, 1, (-0.001, 0, 1)), array=array, reference=(0, 0, 0),
        range_window=(-36, 36), tolerance=1e-2, check=True,
    )  # fmt: skip
    assert raw.report.measured_error <= raw.report.predicted_error <= 1e-2


def test_a_search_for_places_that_cannot_pay_is_short_and_small():
    import time

    array, chirp = line(2500, spacing=1.0, step=0.0), sarcl.Waveform.chirp(center=F0, bandwidth=1e6, duration=1e-6)
    scene = sarcl.Scene.points([[0.0, -1e4, 0], [0, 1e4, 0]])
    track = sarcl.Trajectory(np.arange(2), [[-5e5, 0, 0], [-5e5, 10, 0]])
    from sarcl.scattering.antenna_weights import weights_of
    from sarcl.simulation.channels._channel_rows import ChannelRows
    from sarcl.simulation.channels._response_samples import ResponseSamples

    rows = ChannelRows(array, track, None, scene.center, "simultaneous", "reference", ("HH",))
    weights = weights_of(None, None, track, None, chirp, scene.center)
    responses = ResponseSamples(rows, scene, weights, F0, array.positions, np.zeros((1, 3)))
    calls = []

    def counted(places):
        calls.append(len(places))
        return responses.tx_response(places)

    start = time.perf_counter()
    found = choose_positions(array.positions, counted, 1e-3, most=200.0)
    assert found.basis is None and max(calls) <= 400 and time.perf_counter() - start < 60


def test_what_progress_raises_is_not_lost():
    calls = []

    def stop(stage, done, total):
        calls.append(stage)
        raise ValueError("mine")

    with pytest.raises(ValueError, match="mine"):
        sarcl.echo(SCENE, TONE, passing(6), array=line(45, spacing=0.0144), progress=stop, range_window=WINDOW)
    assert len(calls) == 1


def test_paths_beyond_float64_are_made_up_for():
    # at 36 000 km a reference range is rounded by 4e-9 m: 1e-5 rad at 100 GHz there and back, more than is asked here
    tone, distance = sarcl.Waveform.tone(center=100e9, duration=1 / STEP), 3.6e7
    y = np.linspace(-3e3, 3e3, 40)
    track = sarcl.Trajectory(
        np.arange(40), np.stack([np.full(40, -0.8 * distance), y, np.full(40, 0.6 * distance)], axis=1)
    )
    scene, array = sarcl.Scene.points([[0.0, 0, 0], [1.0, 2, 0.3]]), line(9, spacing=0.0015)
    raw = sarcl.echo(scene, tone, track, array=array, reference=(0, 0, 0), range_window=WINDOW, tolerance=6e-6)
    assert raw.report.contributions_skipped["interpolated channels"] > 0
    assert error(raw, scene, tone, array, track) <= raw.report.predicted_error <= 6e-6


def test_weights_that_overflow_are_refused():
    scene = sarcl.Scene.points([[0.0, 0, 0]], 1e29)
    with pytest.raises(ValueError, match=r"amplitudes reach 4e\+49; .* scale them down"):
        sarcl.echo(scene, TONE, passing(3), array=line(4, weights=[1e20] * 4), range_window=WINDOW)
