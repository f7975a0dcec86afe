"""Closed forms of arrays: against sums, against exact fields, and the figures that Farooq (2009) prints."""

from __future__ import annotations

import numpy as np
import pytest

import sarcl
from sarcl.arrays import array_factor as closed
from sarcl.model.antenna_array import AntennaArray

C = 299_792_458.0
F0 = 10e9
HALF = C / F0 / 2  # half a wavelength, m
FAR = 1e7  # m


def directions(azimuth, elevation=0.0):
    azimuth, elevation = np.broadcast_arrays(azimuth, elevation)
    level = np.cos(elevation)
    return np.stack([level * np.cos(azimuth), level * np.sin(azimuth), np.sin(elevation)], axis=-1)


@pytest.mark.parametrize("n", [1, 2, 3, 8, 9, 450, 9999, 10_000])
def test_dirichlet_is_its_quotient_in_extended_precision(n):
    """At angles of 24 bits n x is exact in longdouble, whose sine reduces properly."""
    if np.finfo(np.longdouble).eps > 2e-19:
        pytest.skip("longdouble is float64 here")
    random = np.random.default_rng(n)
    x = (random.uniform(-1, 1, 4000) * 10.0 ** random.uniform(-8, 6, 4000)).astype(np.float32)
    poles = (2 * np.pi * random.integers(-159_000, 159_000, 2000)).astype(np.float32)  # near the removable 0/0
    x = np.concatenate([x, poles, np.nextafter(poles, np.float32(0))]).astype(np.longdouble)
    wanted = np.sin(n * x / 2) / np.sin(x / 2)
    assert np.abs(closed.dirichlet(x.astype(np.float64), n) - wanted).max() < 1e-12 * n


@pytest.mark.parametrize("n", [2, 9, 10_000])
def test_dirichlet_at_whole_turns_is_n_with_its_sign(n):
    assert closed.dirichlet(0.0, n) == n
    turns = np.arange(-5, 6)
    sign = np.where((turns % 2 != 0) & (n % 2 == 0), -1, 1)
    assert closed.dirichlet(2 * np.pi * turns, n) == pytest.approx(n * sign, rel=1e-9)
    tiny = np.array([1e-300, -1e-300, 5e-324, 1e-9 / n])
    assert closed.dirichlet(tiny, n) == pytest.approx(n, rel=1e-12)
    with pytest.raises(ValueError, match="too large"):
        closed.dirichlet(1e7, n)


def test_the_geometric_sum_is_a_sum():
    x = np.random.default_rng(1).uniform(-50, 50, 200)
    for n in (1, 2, 7, 45):
        wanted = np.exp(1j * np.outer(np.arange(n), x)).sum(axis=0)
        assert np.abs(closed.geometric(x, n) - wanted).max() < 1e-11


def test_the_constant_factor_is_the_far_field(device):
    array = AntennaArray.planar((9, 5), spacing=(HALF, 0.7 * HALF))
    azimuth, elevation = np.meshgrid(np.linspace(-1.5, 1.5, 41), np.linspace(-1.5, 1.5, 31))
    u = directions(azimuth, elevation)
    made = sarcl.beam(array, F0, times=FAR / C, positions=FAR * u, device=device)
    wanted = closed.constant_factor(F0, shape=(9, 5), spacing=(HALF, 0.7 * HALF), cosines=(u[..., 1], u[..., 2]))
    phase = np.exp(2j * np.pi * ((F0 * np.longdouble(FAR) / C) % 1 - (F0 * np.longdouble(FAR / C)) % 1).astype(float))
    assert np.abs(made * phase - wanted).max() < 1e-4 * 45


def test_the_diverse_factor_is_the_far_field_of_small_steps(device):
    """Steps of some kHz: the closed form neglects 1e-5 rad."""
    steps, shape, spacing = (1.5e3, -1e3), (9, 9), (HALF, HALF)
    array = AntennaArray.planar(shape, spacing=spacing, frequency_step=steps)
    assert closed.quadratic_phase(shape=shape, spacing=spacing, frequency_step=steps) < 2e-4
    azimuth, elevation = np.meshgrid(np.linspace(-1.4, 1.4, 31), np.linspace(-1.4, 1.4, 31))
    u, t = directions(azimuth, elevation), np.array([-250e-6, 0, 250e-6, 1.234e-3])
    made = sarcl.beam(array, F0, times=FAR / C + t, positions=FAR * u, device=device)
    wanted = closed.diverse_factor(
        F0, shape=shape, spacing=spacing, frequency_step=steps, cosines=(u[..., 1], u[..., 2]),
        retarded=t[:, None, None],
    )  # fmt: skip
    assert np.abs(np.abs(made) - np.abs(wanted)).max() < 5e-4 * 81


def test_a_diverse_factor_without_steps_is_the_constant_one():
    k = (np.linspace(-1, 1, 50), np.linspace(0.3, -0.3, 50))
    shape, spacing = (9, 4), (HALF, HALF)
    still = closed.diverse_factor(F0, shape=shape, spacing=spacing, frequency_step=(0, 0), cosines=k, retarded=7.0)
    assert np.array_equal(still, closed.constant_factor(F0, shape=shape, spacing=spacing, cosines=k))


@pytest.mark.parametrize("step, largest, at_20, at_45", [(30e6, 0.182, 0.063, 0.129), (150e6, 0.768, 0.308, 0.596)])
def test_closed_and_exact_power_patterns_differ_by_the_known_figures(step, largest, at_20, at_45):
    """9 x 9, principal azimuth plane, over one period. Farooq's figures 3.10 to 3.14 say "not appreciable" and -1.2 dB,
    and little within 45 deg: the first is -7.4 dB, the last 0.31 at 20 deg already."""
    shape, spacing = (9, 9), (-HALF, -HALF)  # his layout
    array = AntennaArray.planar(shape, spacing=spacing, frequency_step=(step, 0))
    azimuth, t = np.deg2rad(np.linspace(-90, 90, 361)), np.linspace(0, 1 / step, 401)
    exact = sarcl.beam(array, F0, times=FAR / C + t, positions=FAR * directions(azimuth))
    made = closed.diverse_factor(
        F0, shape=shape, spacing=spacing, frequency_step=(step, 0), cosines=(np.sin(azimuth), 0.0),
        retarded=t[:, None],
    )  # fmt: skip
    apart = np.abs(closed.power_pattern(exact, 81) - closed.power_pattern(made, 81)).max(axis=0)
    assert apart.max() == pytest.approx(largest, abs=1e-3)
    assert abs(azimuth[apart.argmax()]) == pytest.approx(np.pi / 2)
    for degrees, wanted in ((20, at_20), (45, at_45)):
        assert apart[np.isclose(azimuth, np.deg2rad(degrees))] == pytest.approx(wanted, abs=2e-3)
    assert apart[180] < 1e-4  # broadside


def test_the_quadratic_phase_of_the_papers_scenarios():
    plane = {"shape": (9, 9), "spacing": (0.015, 0.015)}
    azimuth = closed.quadratic_phase(**plane, frequency_step=(30e6, 0), cosines=(1, 0))
    assert azimuth == pytest.approx(81 * 2 * np.pi * 30e6 / C * 0.015, rel=1e-12)  # (3.59)
    assert azimuth == pytest.approx(np.pi / 4, rel=0.03)
    assert closed.quadratic_phase(**plane, frequency_step=(30e6, 0)) == pytest.approx(2 * azimuth)  # (3.40)
    # steps of opposite signs cancel at the corner (N, P), not along an edge
    opposite = closed.quadratic_phase(**plane, frequency_step=(30e6, -30e6))
    assert opposite == closed.quadratic_phase(**plane, frequency_step=(30e6, 30e6)) == pytest.approx(4 * azimuth)


def test_the_beam_angle_at_retarded_time():
    azimuth, elevation = closed.beam_angles(F0, spacing=(HALF, HALF), frequency_step=(100e3, 0), retarded=2e-6)
    assert np.rad2deg(azimuth) == pytest.approx(-23.578, abs=1e-3) and elevation == 0
    papers, _ = closed.beam_angles(F0, spacing=(-HALF, -HALF), frequency_step=(100e3, 0), retarded=2e-6)
    assert papers == -azimuth
    nowhere, _ = closed.beam_angles(F0, spacing=(HALF, HALF), frequency_step=(100e3, 0), retarded=6e-6)
    assert np.isnan(nowhere)
    again, _ = closed.beam_angles(F0, spacing=(HALF, HALF), frequency_step=(100e3, 0), retarded=8e-6, lobe=(1, 0))
    assert np.rad2deg(again) == pytest.approx(np.rad2deg(np.arcsin(0.4)))


@pytest.mark.parametrize("sign", [1, -1])
def test_the_planar_beam_at_30_and_60_degrees(sign):
    """Figure 3.7's (+30, -60) deg belong to t' = -250 us in the paper's layout, +250 us here."""
    given = {"frequency_step": (1.5e3, -1e3), "retarded": sign * 250e-6}
    azimuth, elevation = closed.beam_angles(F0, spacing=(HALF, HALF), **given)
    assert np.rad2deg([azimuth, elevation]) == pytest.approx([-60 * sign, 30 * sign])
    azimuth, elevation = closed.beam_angles(F0, spacing=(-HALF, -HALF), **given)
    assert np.rad2deg([azimuth, elevation]) == pytest.approx([60 * sign, -30 * sign])


def test_the_waveform_has_its_period_nulls_bandwidth_and_product():
    n, step = 9, 1e9
    assert closed.period(step) == closed.period(-step) == 1e-9
    assert closed.main_lobe(n, step) == pytest.approx(2e-9 / 9)
    assert closed.bandwidth(n, -step) == 9e9 and closed.time_bandwidth(n, step) == pytest.approx(n)
    assert closed.center_frequency(F0, n, step) == 14e9
    t = np.linspace(-0.5e-9, 1.5e-9, 2001)
    made = np.abs(closed.waveform(F0, n, spacing=HALF, frequency_step=step, azimuth=0.0, retarded=t))
    assert made[:1001] == pytest.approx(made[1000:], abs=1e-9 * n)  # period
    assert made[np.argmin(np.abs(t - 1e-9))] == pytest.approx(9)
    assert made[np.argmin(np.abs(t - 1e-9 / 9))] < 0.03  # the null
    pulse = closed.waveform(F0, n, spacing=HALF, frequency_step=step, azimuth=0.0, retarded=t, pulsed=True)
    assert not pulse[t > 0.5001e-9].any() and (np.abs(pulse[:1000]) == made[:1000]).all()
    # 99 % of its energy within n |df|, about the centre frequency
    dense = np.arange(-2048, 2048) * 5e-12
    pulse = closed.waveform(F0, n, spacing=HALF, frequency_step=step, azimuth=0.0, retarded=dense, pulsed=True)
    power = np.abs(np.fft.fft(pulse)) ** 2
    inside = np.abs(np.fft.fftfreq(4096, 5e-12) - 14e9) <= 4.5e9
    assert power[inside].sum() / power.sum() > 0.95


@pytest.mark.parametrize("degrees", [45, -45, 10])
def test_the_closed_waveform_peaks_where_4_27_says(degrees):
    t = np.linspace(-0.5e-9, 0.5e-9, 100_001)
    azimuth = np.deg2rad(degrees)
    for layout in (1, -1):
        given = {"spacing": layout * HALF, "frequency_step": 1e9, "azimuth": azimuth}
        wanted = closed.peak_delay(F0, **given)
        made = np.abs(closed.waveform(F0, 9, **given, retarded=t))
        assert t[made.argmax()] == pytest.approx(wanted, abs=2e-14)
        if abs(degrees) == 45:
            assert wanted == pytest.approx(-layout * np.sign(degrees) * 0.3536e-9, abs=1e-13)


@pytest.mark.parametrize("n, step, degrees, worth", [(9, 1e9, 3, 1.8), (9, -0.2e9, 10, 0.84), (450, 2e6, 2.46, 1.0898)])
def test_the_exact_waveform_peaks_where_the_last_carrier_would(device, n, step, degrees, worth):
    """The phase that (3.40) neglects, i^2 dk d ky, moves the peak from f0 to f0 + (n - 1) df in (4.27): by 1.8 at 1 GHz
    steps, where the paper's own bound is passed 32 times."""
    azimuth = np.deg2rad(degrees)
    plain = closed.peak_delay(F0, spacing=-HALF, frequency_step=step, azimuth=azimuth)
    wanted = closed.peak_delay(F0, spacing=-HALF, frequency_step=step, azimuth=azimuth, n=n)
    assert wanted == pytest.approx(worth * plain, rel=1e-3)
    t = wanted + np.linspace(-1, 1, 4001) / (n * abs(step))
    array = AntennaArray.linear(n, spacing=-HALF, frequency_step=step)
    made = np.abs(sarcl.beam(array, F0, times=FAR / C + t, positions=FAR * directions(azimuth), device=device))
    assert abs(t[made.argmax()] - wanted) < 0.01 / (n * abs(step)) < 0.1 * abs(wanted - plain)


@pytest.mark.parametrize(
    "n, step, phase, peak", [(45, 20e6, 0.547, 0.9992), (225, 4e6, 2.735, 0.9794), (450, 2e6, 5.470, 0.9193)]
)
def test_what_the_closed_form_leaves_out_at_the_end_of_the_papers_aperture(n, step, phase, peak):
    """215 m along the track, 5 km away, elements 15 mm apart: quadratic phase, and the height of the peak with it."""
    azimuth, spacing = np.arctan(215 / 5000), -0.015
    left_out = closed.quadratic_phase(
        shape=(n, 1), spacing=(spacing, 0), frequency_step=(step, 0), cosines=(np.sin(azimuth), 0)
    )
    assert left_out == pytest.approx(phase, abs=1e-3)
    middle = closed.peak_delay(F0, spacing=spacing, frequency_step=step, azimuth=azimuth, n=n)
    t = middle + np.linspace(-1, 1, 2001) / (n * step)
    array = AntennaArray.linear(n, spacing=spacing, frequency_step=step)
    made = np.abs(sarcl.beam(array, F0, times=FAR / C + t, positions=FAR * directions(azimuth)))
    assert made.max() / n == pytest.approx(peak, abs=5e-4)


def test_the_papers_waveform_is_far_beyond_its_own_bound():
    """At 45 deg its 9 carriers, 1 GHz apart, are never in phase: at most 4.9 of 9 over a whole period."""
    array = AntennaArray.linear(9, spacing=-HALF, frequency_step=1e9)
    t, azimuth = np.linspace(-0.5e-9, 0.5e-9, 10_001), np.deg2rad(45)
    made = np.abs(sarcl.beam(array, F0, times=FAR / C + t, positions=FAR * directions(azimuth)))
    assert made.max() == pytest.approx(4.873, abs=0.01)
    bound = closed.quadratic_phase(shape=(9, 1), spacing=(HALF, 0), frequency_step=(1e9, 0), cosines=(1, 0))
    assert bound == pytest.approx(32.4 * np.pi / 4, rel=1e-3)


@pytest.mark.parametrize(
    "make, message",
    [
        (lambda: closed.period(0.0), "frequency_step is 0"),
        (lambda: closed.dirichlet(1.0, 0), "n is 0"),
        (lambda: closed.dirichlet([1.0, np.nan], 3), r"angle\[1\] is nan"),
        (lambda: closed.peak_delay(0.0, spacing=1, frequency_step=1, azimuth=0), "f0 is 0"),
        (lambda: closed.quadratic_phase(shape=(9, 9), spacing=(1, np.nan), frequency_step=(1, 1)), "finite"),
        (lambda: closed.beam_angles(F0, spacing=(0, 1), frequency_step=(1, 1), retarded=0), "at one position"),
        (lambda: closed.power_pattern([1, 2], peak=0), "peak is 0"),
    ],
)
def test_bad_input_is_named(make, message):
    with pytest.raises(ValueError, match=message):
        make()
