"""Echoes interpolated between few places of an array, against every channel's own exact sum."""

from __future__ import annotations

import numpy as np
import pytest
from test_array_echo import EACH, F0, STEP, TONE, error, line, passing

import sarcl
from sarcl import AntennaArray, shapes
from sarcl.array_places import places_of
from sarcl.check import SPEED_OF_LIGHT

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
def test_random_arrays_keep_their_tolerance():
    interpolated, tasks = 0, 80
    for seed in range(tasks):
        array, track, receiver, scene, options, tolerance = drawn(seed)
        raw = sarcl.echo(
            scene, TONE, track, array=array, receiver=receiver, reference=(0, 0, 0), range_window=WINDOW,
            tolerance=tolerance, check=True, **options,
        )  # fmt: skip
        interpolated += raw.report.contributions_skipped.get("interpolated channels", 0) > 0
        achieved = error(raw, scene, TONE, array, track, receiver)
        assert achieved <= raw.report.predicted_error <= tolerance, seed
    assert interpolated > tasks / 2


def test_places_are_two_a_turn_and_a_few():
    # phase turns by `span` over the array: Bessel's functions of pi span vanish beyond as many terms
    elements = np.stack([np.zeros(900), np.linspace(-1, 1, 900), np.zeros(900)], axis=1)
    for span in (0.1, 1.0, 10.0, 100.0):
        for allowed in (1e-2, 1e-6):
            found = places_of(elements, lambda d, s=span: d[:, 1:2] * s / 2, allowed)
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
        found = places_of(elements, lambda d: d @ np.array([[0.0], [0.1], [0.2]]), 1e-3)
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
    assert raw.n_rows == 2 * 120 * 120 and raw.report.plan["places"] <= 16
    assert raw.report.measured_error <= raw.report.predicted_error <= 1e-3
    row = 120 * 17 + 93  # pulse 0, sender 17, receiver 93
    tx, rx = raw.tx[row].astype(np.longdouble), raw.rx[row].astype(np.longdouble)
    path = [np.sqrt(((tx - x) ** 2).sum()) + np.sqrt(((rx - x) ** 2).sum()) for x in scene.positions]
    turns = (np.array(path) - 2 * raw.reference_range[row]) * raw.frequency[row] / SPEED_OF_LIGHT
    wanted = np.exp(-2j * np.pi * np.mod(turns, 1).astype(float)).sum()
    assert abs(raw.samples[row, 0] - wanted) < 1e-3 * 2**0.5


def test_a_single_pulse_close_by_is_seen():
    # one pulse of 200 from a tenth of the distance, where the scene turns ten times as much over the array
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
