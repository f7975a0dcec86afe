"""Mappings of frequency-diverse apertures, their effects and limits: Farooq 2009, chapter 5."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import sarcl
from sarcl.arrays.map_aperture import map_aperture
from sarcl.base.constants import SPEED_OF_LIGHT
from sarcl.model.antenna_array import AntennaArray

F0, R, L, N_PULSES = 10e9, 5e3, 430.0, 431
HALF_WAVE = SPEED_OF_LIGHT / 10.44e9 / 2
CENTER = (0.0, 0.0, 0.0)


def track(n=N_PULSES, length=L, distance=R):
    y = np.linspace(-length / 2, length / 2, n)
    return sarcl.Trajectory(np.arange(n) / 10, np.stack([np.full(n, -distance), y, 0 * y], axis=1))


def collected(n, step, points=(CENTER,), switched=True, pulses=N_PULSES):
    array = AntennaArray.linear(n, spacing=HALF_WAVE, frequency_step=step, axis=(0, -1, 0))
    if switched:
        array = array.mirrored(pulses // 2, pulses)
    tone = sarcl.Waveform.tone(center=F0, duration=1 / abs(step))
    return sarcl.echo(
        sarcl.Scene.points(points), tone, track(pulses), array=array, reference=CENTER, range_window=(-3, 3),
        tolerance=1e-3,
    )  # fmt: skip


def cut(raw, along=0.0, half=1.2, n=961, **options):
    """Cross-range cut through (0, along), of modulus 1 for a unit point: (y, |image|)."""
    y = np.linspace(-half, half, n) + along
    grid = sarcl.ImageGrid.points(np.stack([0 * y, y, 0 * y], axis=1))
    image = sarcl.backproject(raw, grid, tolerance=1e-3, **options)
    return y, np.abs(image.data) / image.gain


def response(y, a):
    """Peak's place and height, half the distance between nulls, and the highest side lobe, dB."""
    peak = left = right = int(a.argmax())
    while left > 0 and a[left - 1] < a[left]:
        left -= 1
    while right < len(a) - 1 and a[right + 1] < a[right]:
        right += 1
    side = max(a[:left].max(initial=0), a[right + 1 :].max(initial=0))
    return y[peak], a[peak], (y[right] - y[left]) / 2, 20 * np.log10(side / a[peak])


@pytest.mark.parametrize("n, step", [(45, 20e6), (225, 4e6), (450, 2e6)])
def test_corrected_data_focus_as_an_ordinary_antenna_does(n, step):
    raw = collected(n, step, switched=False)
    fixed = map_aperture(raw, "corrected")
    peak, height, null, pslr = response(*cut(fixed))
    assert abs(peak) < 1e-6 and height == pytest.approx(1, abs=1e-3)
    assert null == pytest.approx(0.167, abs=0.002) and pslr == pytest.approx(-13.3, abs=0.1)
    # unmodified echoes are defocused: a peak at least 3 dB lower, or 1.5 times as wide
    _, lower, wider, _ = response(*cut(raw))
    assert 20 * np.log10(lower / height) < -3 and (wider > 1.5 * null or n > 45)


@pytest.mark.parametrize(
    "n, step, length, null, pslr",
    [(45, 20e6, 445, 0.1575, -11.8), (225, 4e6, 502, 0.124, -7.8), (450, 2e6, 574, 0.100, -5.1)],
)
def test_apparent_apertures_are_longer_with_a_gap(n, step, length, null, pslr):
    mapped = map_aperture(collected(n, step), "apparent")
    assert np.ptp(mapped.tx[:, 1]) == pytest.approx(length, rel=0.01)
    assert (mapped.tx == mapped.rx).all()
    gap = np.diff(mapped.tx[:, 1]).max()
    assert gap - L / (N_PULSES - 1) == pytest.approx(np.ptp(mapped.tx[:, 1]) - L, rel=0.05)
    found = response(*cut(mapped))
    assert abs(found[0]) < 1e-6
    assert found[2] == pytest.approx(null, abs=0.002) and found[3] == pytest.approx(pslr, abs=0.1)


def test_without_the_switch_nothing_grows():
    for step, n in ((20e6, 45), (2e6, 450), (-2e6, 450)):
        raw = collected(n, step, switched=False, pulses=101)
        mapped = map_aperture(raw, "apparent")
        # moved sideways by d f0/df, since d is half a wave of the centre frequency
        shift = -HALF_WAVE * F0 / step
        np.testing.assert_allclose(mapped.tx[:, 1], raw.tx[:, 1] + shift, atol=0.02 * abs(shift) + 0.5)
        assert np.ptp(mapped.tx[:, 1]) == pytest.approx(L, rel=1e-3)
        # -2 MHz lie below 10 GHz: a longer wave, whatever is mapped
        nulls = [response(*cut(r))[2] for r in (mapped, map_aperture(raw, "corrected"))]
        assert nulls[0] == pytest.approx(nulls[1], abs=1e-3)


@pytest.mark.parametrize(
    "antenna, step, apparent",
    [
        ((-4000.0, 300.0, 1000.0), 20e6, (-4000.025708, 292.502867, 999.868344)),  # g = d f0/df = 7.5 m
        ((-5000.0, -200.0, 0.0), 2e6, (-4999.437596, -275.014018, 0.0)),  # 75 m
    ],
)
def test_apparent_positions_are_those_of_the_papers_angles(antenna, step, apparent):
    """Computed by hand: theta = atan2((Yc - Ry) + g (1 - ky^2), (Xc - Rx) - g kx ky), (5.14) with the signs corrected,
    at range r + g ky, (5.15) and (5.16), and the elevation of the antenna, (5.17) and (5.18)."""
    array = AntennaArray.linear(3, spacing=0.015, frequency_step=step, axis=(0, -1, 0))
    here = sarcl.Trajectory([0.0, 0.1], [antenna, antenna])
    tone = sarcl.Waveform.tone(center=F0, duration=1 / step)
    raw = sarcl.echo(
        sarcl.Scene.points([CENTER]), tone, here, array=array, reference=CENTER, range_window=(-3, 3), tolerance=1e-3
    )
    mapped = map_aperture(raw, "apparent")
    np.testing.assert_allclose(mapped.tx, np.tile(apparent, (2, 1)), atol=1e-5)
    np.testing.assert_allclose(mapped.reference_range, np.linalg.norm(apparent), atol=1e-5)


def test_halved_offsets_make_half_the_growth():
    raw = collected(45, 20e6, pulses=51)
    growth = [np.ptp(map_aperture(raw, "apparent", offset=o).tx[:, 1]) - L for o in ("published", "halved")]
    assert growth[1] == pytest.approx(growth[0] / 2, rel=0.02)


def test_the_papers_linear_correction_leaves_a_quadratic_phase():
    # 0.55 rad at 45 channels, 5.5 rad at 450
    few, many = (map_aperture(collected(n, s, switched=False), "corrected", quadratic=False)
                 for n, s in ((45, 20e6), (450, 2e6)))  # fmt: skip
    assert response(*cut(few))[1] > 0.95
    assert response(*cut(many))[1] < 0.9


@pytest.mark.slow
def test_off_centre_points_are_displaced_by_the_mapping():
    # worst where 4 k_c g y/R is an odd half of 2 pi: 2.25 m, with a side lobe as high as the peak
    for y, place, pslr in ((2.25, 2.162, -0.13), (2.0, 2.0, -5.1)):
        raw = collected(450, 2e6, points=[(0, y, 0)])
        found = response(*cut(map_aperture(raw, "apparent"), along=y, half=0.6))
        assert found[0] == pytest.approx(place, abs=0.01)
        assert found[3] == pytest.approx(pslr, abs=0.4)
        true = response(*cut(map_aperture(raw, "channels"), along=y, half=0.6))
        assert true[0] == pytest.approx(y, abs=0.002) and true[3] < -13


def test_two_points_closer_than_the_ordinary_resolution_stay_one():
    half = 0.125 / 2
    raw = collected(450, 2e6, points=[(0, -half, 0), (0, half, 0)])
    y, a = cut(map_aperture(raw, "apparent"), half=0.3)
    between = a[np.abs(y) < half * 1.2]
    assert between.argmax() == pytest.approx(len(between) / 2, abs=2)  # one peak, in the middle


@pytest.mark.parametrize("switched", [False, True])
def test_channels_separated_by_mapping_equal_those_kept_separate(switched):
    array = AntennaArray.linear(9, spacing=0.3, frequency_step=20e6)
    array = array.mirrored(8, 20) if switched else array
    tone, scene = sarcl.Waveform.tone(center=F0, duration=5e-8), sarcl.Scene.points([[0.5, 1, 0]])
    together, apart = (
        sarcl.echo(
            scene, tone, track(20), array=array, channels=c, reference=CENTER, range_window=(-11, 11), tolerance=1e-5
        )
        for c in ("simultaneous", "separated")
    )
    told = map_aperture(together, "channels")
    assert told.samples.shape == apart.samples.shape == (180, 3)
    for name in ("frequency", "tx", "rx", "tx_channel", "time"):
        np.testing.assert_allclose(getattr(told, name), getattr(apart, name), atol=1e-3)
    # sums and rows have reference ranges of their own
    shift = 2 * (told.reference_range - apart.reference_range)[:, None] / SPEED_OF_LIGHT
    f = apart.frequency[:, None] + apart.frequency_step[0] * np.arange(3)
    error = told.samples * np.exp(-2j * np.pi * f * shift) - apart.samples
    assert np.linalg.norm(error) < 1e-4 * np.linalg.norm(apart.samples)


def width(raw):
    """-3 dB width across, m."""
    y, a = cut(raw, half=2.0, n=4001)
    a = a / a.max()
    return np.ptp(y[a >= np.sqrt(0.5)])


@pytest.mark.slow
def test_frequency_steps_do_not_resolve_more_than_phase_centres_do():
    # 10 GHz, 10 km, 100 m, widths at half power of the sums of exact phases; 8 elements half a wave, or 10 m, apart
    wave, flight = SPEED_OF_LIGHT / F0, track(100, 99.0, 10e3)  # 100 steps of 1 m
    scene, options = sarcl.Scene.points([CENTER]), {"reference": CENTER, "range_window": (-1, 1), "tolerance": 1e-4}
    single = sarcl.Waveform.tone(center=F0, duration=1e-6, bandwidth=1.0)
    plain = sarcl.echo(scene, single, flight, **options)
    assert width(plain) == pytest.approx(1.327, abs=0.003)
    small = {step: AntennaArray.linear(8, spacing=wave / 2, frequency_step=step) for step in (0.0, 50e6)}
    wide = {step: AntennaArray.linear(8, spacing=10.0, frequency_step=step) for step in (0.0, 50e6)}
    for step in (0.0, 50e6):
        wave_form = single if step == 0 else sarcl.Waveform.tone(center=F0 - 3.5 * step, duration=1 / step)
        own = {"channels": "separated", "receive": "own"}
        for array, wanted in ((small[step], 1.327), (wide[step], 1.056)):
            # about the middle of the array: off it, carriers that rise with the place change the width by 0.7 %
            middle = sarcl.Trajectory(flight.times, flight.positions - array.positions.mean(axis=0))
            raw = sarcl.echo(scene, wave_form, middle, array=array, **own, **options)
            assert width(raw) == pytest.approx(wanted, abs=0.004)
    for receive, wanted in (("all", 1.172), ("reference", 1.242)):
        raw = sarcl.echo(scene, single, flight, array=wide[0.0], channels="separated", receive=receive, **options)
        assert width(raw) == pytest.approx(wanted, abs=0.004)


def test_shorthand_of_backproject_maps_first():
    raw = collected(45, 20e6, points=[(0, 0.3, 0)], pulses=64)
    direct = cut(map_aperture(raw, "channels"))[1]
    assert np.abs(cut(raw, mapping="channels")[1] - direct).max() < 1e-4


RAW = None


def simple():
    global RAW
    if RAW is None:
        RAW = collected(5, 20e6, switched=False, pulses=7)
    return RAW


BAD = {
    "no array": (lambda: map_aperture(replace(simple(), array=None), "corrected"), "no array"),
    "mapping": (lambda: map_aperture(simple(), "sideways"), "corrected"),
    "center": (lambda: map_aperture(simple(), "corrected", center=(5, 0, 0)), "give the point"),
    "apart": (lambda: map_aperture(map_aperture(simple(), "channels"), "corrected"), "separate already"),
    "one carrier": (
        lambda: map_aperture(replace(simple(), array=AntennaArray.linear(5, spacing=1)), "corrected"), "share carriers"
    ),
    "too few attitudes": (lambda: map_aperture(simple(), "corrected", attitude=np.eye(3)[None]), "attitude has shape"),
    "no rotation": (
        lambda: map_aperture(simple(), "corrected", attitude=7 * np.tile(np.eye(3), (7, 1, 1))), "no rotation"
    ),
    "bands that overlap": (
        lambda: map_aperture(replace(simple(), waveform=sarcl.Waveform.chirp(center=10e9, bandwidth=50e6,
                                                                             duration=1e-7)), "corrected"),
        "channels 20 MHz apart share samples: their pulses are 50 MHz wide",
    ),
    "no length": (
        lambda: map_aperture(replace(simple(), array=AntennaArray(positions=np.zeros((5, 3)),
                                                                 offsets=20e6 * np.arange(5)[None])), "apparent"),
        "even steps",
    ),
    "channels outside the samples": (
        lambda: map_aperture(replace(simple(), samples=simple().samples[:, :3]), "corrected"),
        r"2 of the array's 5 channels lie outside the sampled band of 10 to 10.04 GHz, such as element 3 at 10.06 GHz",
    ),
    "costas": (
        lambda: map_aperture(replace(simple(), array=AntennaArray.costas(5, spacing=0.1, frequency_step=20e6)),
                             "apparent"),
        "even steps",
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", BAD)
def test_bad_input_is_refused(name):
    call, message = BAD[name]
    with pytest.raises(ValueError, match=message):
        call()
