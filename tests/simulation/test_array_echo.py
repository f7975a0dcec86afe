"""Echoes of arrays against the sum over channels, element by element, in extended precision."""

from __future__ import annotations

import numpy as np
import pytest
from helpers.array_cases import APART, EACH, F0, SCENE, STEP, TONE, WINDOW, error, line, passing
from helpers.cases import thinned

import sarcl
from sarcl import shapes
from sarcl.arrays.channels import channels_of, sampling, spacing
from sarcl.base.constants import SPEED_OF_LIGHT
from sarcl.model.antenna_array import AntennaArray

WAYS = [
    {}, {"receive": "all"}, {"channels": "separated"}, {"channels": "separated", "receive": "own"},
    {"channels": "separated", "receive": "all"},
]  # fmt: skip


@pytest.mark.parametrize("options, tolerance", thinned(WAYS, [1e-2, 1e-4, 1e-6], every=3, slow=(1,)))
def test_every_way_to_send_and_receive(options, tolerance, device):
    array, track = line(5, spacing=0.4), passing(6)
    receivers = 5 if options.get("receive") == "all" else 1
    senders = 5 if options.get("channels") == "separated" else 1
    for skip in (True, EACH):
        raw = sarcl.echo(
            SCENE, TONE, track, array=array, reference=(0, 0, 0), range_window=WINDOW, tolerance=tolerance,
            device=device, check=True, skip=skip, **options,
        )  # fmt: skip
        assert raw.samples.shape == (6 * senders * receivers, 1 if senders > 1 else 5)
        measured = error(raw, SCENE, TONE, array, track)
        assert measured <= raw.report.predicted_error <= tolerance
        assert raw.report.measured_error == pytest.approx(measured, rel=0.5)  # of 256 samples
        left_out = raw.report.contributions_skipped.get("interpolated channels", 0)
        assert raw.report.contributions_done + left_out == 6 * 5 * receivers * 3 and raw.array is array
        assert left_out == 0 if skip is EACH else left_out > 0 or tolerance < 1e-2


ARRAYS = {
    "costas": lambda: AntennaArray.costas(6, spacing=0.3, frequency_step=STEP),
    "planar": lambda: AntennaArray.planar((3, 2), spacing=(0.2, 0.3), frequency_step=(STEP, 3 * STEP)),
    "uneven": lambda: line(3).with_offsets([0.0, 1.0e6, 3.7e6]),
    "steered groups": lambda: line(6).subarrays(3, steer=(0.1, 0.0), frequency=F0),
    "mirrored": lambda: line(5).mirrored(4, 12),
    "weighted": lambda: line(3, weights=[1, 0.5j, -0.2]),
}


@pytest.mark.parametrize("name", ARRAYS)
def test_every_kind_of_array(name):
    array, track = ARRAYS[name](), passing()
    tone = sarcl.Waveform.tone(center=F0, duration=1 / (2 * STEP)) if name == "steered groups" else TONE
    raw = sarcl.echo(SCENE, tone, track, array=array, reference=(0, 0, 0), range_window=WINDOW, tolerance=1e-4)
    assert error(raw, SCENE, tone, array, track) <= raw.report.predicted_error <= 1e-4


@pytest.mark.parametrize("step", [0.0, 5e6, 300e6])
def test_chirps_on_every_carrier(step):
    # the same carrier, bands that overlap, bands apart
    chirp = sarcl.Waveform.chirp(center=F0, bandwidth=150e6, duration=1e-9)
    array, track = line(3, spacing=0.5, step=step), passing(5)
    for channels in ("simultaneous", "separated"):
        raw = sarcl.echo(
            SCENE, chirp, track, array=array, channels=channels, reference=(0, 0, 0), range_window=(-40, 40),
            tolerance=1e-4,
        )  # fmt: skip
        wanted = np.zeros(raw.samples.shape, np.complex128)
        f = raw.frequency[:, None] + raw.frequency_step[0] * np.arange(raw.n_samples)
        for n in range(3):
            rows = np.ones(raw.n_rows, bool) if channels == "simultaneous" else raw.tx_channel == n
            own = np.abs(f - F0 - n * step) <= 75e6 * (1 + 1e-9)
            tx = np.repeat(track.positions, raw.n_rows // 5, axis=0) + array.positions[n]
            for x, a in zip(SCENE.positions, SCENE.amplitudes, strict=True):
                path = np.linalg.norm(tx - x, axis=1) + np.linalg.norm(raw.rx - x, axis=1) - 2 * raw.reference_range
                wanted += a * rows[:, None] * own * np.exp(-2j * np.pi * f * path[:, None] / SPEED_OF_LIGHT)
        assert np.linalg.norm(raw.samples - wanted) <= 2e-4 * np.linalg.norm(wanted)


def test_arrays_turn_with_the_track_and_receivers_may_fly_elsewhere():
    from scipy.spatial.transform import Rotation

    turns = Rotation.from_rotvec(np.outer(np.linspace(0, 1.5, 8), [0, 0, 1])).as_matrix()
    track, array = passing(8, attitude=turns), line(4, spacing=0.5)
    raw = sarcl.echo(SCENE, TONE, track, array=array, reference=(0, 0, 0), range_window=WINDOW, tolerance=1e-4)
    assert error(raw, SCENE, TONE, array, track) <= 1e-4
    other = sarcl.Trajectory(track.times, track.positions + np.array([300.0, 500, 100]))
    raw = sarcl.echo(
        SCENE, TONE, track, receiver=other, array=array, reference=(0, 0, 0), range_window=WINDOW, tolerance=1e-4
    )
    assert error(raw, SCENE, TONE, array, track, other) <= 1e-4


def test_one_element_is_the_single_antenna_bitwise():
    for scene in (SCENE, shapes.plate((0.3, 0.3))):
        options = {"tolerance": 1e-3, "polarization": ("HH", "VV")}
        one, two = (sarcl.echo(scene, TONE, passing(), array=a, **options) for a in (AntennaArray.single(), None))
        assert (np.asarray(one.samples) == two.samples).all() and one.array is not None and two.array is None


def test_equal_channels_are_computed_once():
    array = AntennaArray(positions=np.zeros((4, 3)), offsets=[[0.0, 0, STEP, STEP]], weights=[1, 2, 3, -1j])
    track = passing(4)
    assert len(channels_of(array, F0, 4)) == 2
    raw = sarcl.echo(SCENE, TONE, track, array=array, reference=(0, 0, 0), range_window=WINDOW, skip=EACH)
    assert raw.report.contributions_done == 2 * 4 * 3
    assert error(raw, SCENE, TONE, array, track) <= 1e-3
    apart = sarcl.echo(
        SCENE, TONE, track, array=array, channels="separated", reference=(0, 0, 0), range_window=WINDOW, skip=EACH
    )
    assert apart.report.contributions_done == 2 * 4 * 3 and apart.n_rows == 16
    np.testing.assert_allclose(apart.samples[1::4], 2 * apart.samples[::4])


def test_facets_are_seen_by_every_channel():
    # a plate large beside the wavelength: its lobe differs from carrier to carrier
    scene, array = shapes.plate((0.4, 0.4)), line(4, step=200e6)
    tone = sarcl.Waveform.tone(center=F0, duration=1 / 200e6)
    track = passing(6)
    raw = sarcl.echo(
        scene, tone, track, array=array, reference=(0, 0, 0), range_window=(-0.3, 0.3), tolerance=1e-3, check=True
    )
    assert 0 < raw.report.measured_error < raw.report.predicted_error
    for n in range(4):
        own = sarcl.echo(
            scene, sarcl.Waveform.tone(center=F0 + n * 200e6, duration=1e-3, bandwidth=3.0),
            sarcl.Trajectory(track.times, track.positions + array.positions[n]), receiver=track, reference=(0, 0, 0),
            range_window=(-0.3, 0.3), tolerance=1e-3,
        )  # fmt: skip
        shift = 2 * (own.reference_range - raw.reference_range)
        turned = own.samples[:, 0] * np.exp(-2j * np.pi * (F0 + n * 200e6) * shift / SPEED_OF_LIGHT)
        assert np.linalg.norm(raw.samples[:, n] - turned) <= 3e-3 * np.linalg.norm(turned)


def test_carriers_lie_on_samples():
    for n, step, half in ((9, 20e6, 3.0), (9, 20e6, 30.0), (4, 1e6, 500.0)):
        carriers = F0 + step * np.arange(n)
        tone = sarcl.Waveform.tone(center=F0, duration=1 / step)
        grid = sampling(carriers, tone, -half, half, True)
        at = (carriers - grid.frequency) / grid.step
        np.testing.assert_allclose(at, np.rint(at), atol=1e-6)
        assert grid.n * grid.step == pytest.approx(n * step) and grid.step <= SPEED_OF_LIGHT / (4 * half) * (1 + 1e-9)
        assert [grid.part(c).stop - grid.part(c).start for c in carriers] == [grid.width] * n
    assert spacing(np.array([3.0, 5.0, 11.0])) == pytest.approx(2.0)
    assert spacing(np.array([3.0, 5.0, 8.1])) is None and spacing(np.array([3.0, 3.0])) is None


def test_a_pulse_with_several_peaks_is_warned_of_with_its_ambiguity():
    long = sarcl.Waveform.tone(center=F0, duration=2 / STEP)
    with pytest.warns(sarcl.SarclWarning, match=r"peaks 2 times in it, so that ranges 7\.495 m apart are ambiguous"):
        sarcl.echo(SCENE, long, passing(3), array=line(3), reference=(0, 0, 0), range_window=WINDOW)


def test_a_centre_frequency_that_jumps_is_warned_of():
    array = line(5).switched(line(5, step=-STEP), 6, 12)
    with pytest.warns(sarcl.SarclWarning, match=r"centre frequency jumps by 8e\+07 Hz .* move the base frequency"):
        sarcl.echo(SCENE, TONE, passing(), array=array, reference=(0, 0, 0), range_window=WINDOW)


BAD = {
    "no array": ({"array": "nine"}, TypeError, "array is a str"),
    "channels": ({"channels": "both"}, ValueError, "simultaneous"),
    "receive": ({"receive": "none"}, ValueError, "reference"),
    "own together": ({"receive": "own"}, ValueError, "separated"),
    "carrier": ({"array": line(3, step=-6e9)}, ValueError, "element 2 would send at -2e"),
    "plan": ({"array": line(3).mirrored(2, 5)}, ValueError, "plan names 5 pulses but the track has 12"),
}


@pytest.mark.parametrize("name", BAD)
def test_bad_input_is_refused(name):
    options, kind, message = BAD[name]
    with pytest.raises(kind, match=message):
        sarcl.echo(SCENE, TONE, passing(), **{"array": line(3), "range_window": WINDOW, **options})


def test_warnings_point_at_the_line_that_asked():
    long = sarcl.Waveform.tone(center=F0, duration=2 / STEP)
    with pytest.warns(sarcl.SarclWarning) as found:
        sarcl.echo(SCENE, long, passing(3), array=line(3), reference=(0, 0, 0), range_window=WINDOW)
    assert [w.filename for w in found] == [__file__]


def constant(n=9, spacing=0.015, **options):
    return line(n, spacing=spacing, step=0.0, **options)


CHIRP = sarcl.Waveform.chirp(center=F0, bandwidth=300e6, duration=1e-6)


@pytest.mark.parametrize("name", ["elements", "weighted", "wide", "near", "turning", "planned"])
def test_elements_of_one_carrier(name, device):
    from scipy.spatial.transform import Rotation

    track, tolerance = passing(6), 1e-2 if name == "wide" else 1e-3
    array = constant(weights=[1, 2, 1j, -1, 1, 1, 0.5, 1, 1]) if name == "weighted" else constant()
    if name == "wide":
        array = constant(5, spacing=0.2)
    if name == "near":
        track = sarcl.Trajectory(track.times, track.positions / 100)
    if name == "turning":
        turns = Rotation.from_rotvec(np.outer(np.linspace(0, 1.5, 6), [0, 0, 1])).as_matrix()
        track = sarcl.Trajectory(track.times, track.positions, attitude=turns)
    if name == "planned":
        array = array.switched(array.with_offsets(np.full(9, 1e6)), 2, 6)
    options = {
        "array": array,
        "reference": (0, 0, 0),
        "range_window": (-40, 40),
        "tolerance": tolerance,
        "device": device,
    }
    if name == "planned":
        with pytest.warns(sarcl.SarclWarning, match="centre frequency jumps"):
            raw, apart = (sarcl.echo(SCENE, CHIRP, track, skip=s, check=True, **options) for s in (True, APART))
    else:
        raw, apart = (sarcl.echo(SCENE, CHIRP, track, skip=s, check=True, **options) for s in (True, APART))
    left_out = raw.report.contributions_skipped.get("interpolated channels", 0)
    assert raw.report.contributions_done + left_out == apart.report.contributions_done
    assert left_out > 0 or name in ("wide", "near", "planned")  # where it does not pay
    size = np.sqrt(raw.samples.size * (np.abs(SCENE.amplitudes) ** 2).sum() * (np.abs(array.weights) ** 2).sum())
    size = max(size, np.linalg.norm(apart.samples))
    assert np.linalg.norm(np.asarray(raw.samples) - apart.samples) <= 2 * tolerance * size
    for found in (raw, apart):
        assert found.report.measured_error <= found.report.predicted_error <= tolerance


@pytest.mark.parametrize("half", [0.0, 2.0])
def test_one_carrier_from_few_places_or_element_by_element_is_the_same_to_a_millionth(half):
    scene = sarcl.Scene.points(half * np.random.default_rng(0).uniform(-1, 1, (9, 3)) * [1, 1, 0.1])
    options = {"array": constant(45), "reference": (0, 0, 0), "range_window": (-40, 40)}
    raw, apart = (
        sarcl.echo(scene, CHIRP, passing(6, 20.0), skip=s, tolerance=t, **options)
        for s, t in ((True, 3e-5), (APART, 2e-6))
    )
    assert raw.report.contributions_done * 5 <= apart.report.contributions_done
    assert np.linalg.norm(np.asarray(raw.samples) - apart.samples) <= 1e-6 * np.linalg.norm(apart.samples)


@pytest.mark.slow
def test_facets_in_front_of_an_array_of_one_carrier():
    scene, array = (
        shapes.box((0.3, 0.25, 0.2))
        + sarcl.Scene.facets(shapes.plate((0.8, 0.8)).triangles, material=sarcl.Material(4.0, diagram="cos")),
        constant(7, spacing=0.05),
    )
    options = {"array": array, "reference": (0, 0, 0), "tolerance": 1e-2, "check": True, "polarization": ("HH", "VV")}
    raw, apart = (sarcl.echo(scene, CHIRP, passing(4), skip=s, **options) for s in (True, APART))
    assert raw.report.contributions_done < apart.report.contributions_done
    assert np.linalg.norm(np.asarray(raw.samples) - apart.samples) <= 2e-2 * np.linalg.norm(apart.samples)
    assert raw.report.measured_error <= raw.report.predicted_error <= 1e-2


def test_a_beam_that_looks_away_is_dim_as_the_array_factor_says():
    array, tone = constant(32), sarcl.Waveform.chirp(center=F0, bandwidth=1e6, duration=1e-6)
    for turned, wanted in ((0.0, 32.0), (0.3, None)):
        track = sarcl.Trajectory([0.0], [[-5e3 * np.cos(turned), 5e3 * np.sin(turned), 0]])
        raw = sarcl.echo(sarcl.Scene.points([[0.0, 0, 0]]), tone, track, array=array, tolerance=1e-3)
        phase = 2 * np.pi * F0 * 0.015 * np.sin(turned) / SPEED_OF_LIGHT
        wanted = wanted or abs(np.sin(16 * phase) / np.sin(phase / 2))
        assert np.abs(raw.samples[0]).mean() == pytest.approx(wanted, rel=0.02)
