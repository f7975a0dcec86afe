"""The ambiguity function: closed forms, its volume, and which waveforms couple delay and Doppler."""

from __future__ import annotations

import numpy as np
import pytest

import sarcl
from sarcl.arrays import array_factor

LENGTH, BAND = 1e-9, 9e9  # s, Hz: Farooq's figures 4.6 and 4.7
RATE = 64e9
SLOPE = BAND / LENGTH
N_TONES, STEP = 9, 1e9


def times():
    n = round(LENGTH * RATE)
    return (np.arange(n) - (n - 1) / 2) / RATE


def chirp(sign=1):
    return np.exp(1j * np.pi * sign * SLOPE * times() ** 2)


def tones():
    """The array's pulse at broadside, without its carrier."""
    return array_factor.geometric(2 * np.pi * STEP * times(), N_TONES)


def test_a_rectangular_pulse_has_its_closed_form():
    n = 128
    made = sarcl.ambiguity(np.ones(n), RATE)
    lag, nu = np.rint(made.delays * RATE)[:, None], made.dopplers / RATE
    overlap = (n - np.abs(lag)).astype(int)
    x = np.broadcast_to(2 * np.pi * nu, made.magnitude.shape)
    for m in (1, 7, 64, 128):
        rows = overlap[:, 0] == m
        assert made.magnitude[rows] == pytest.approx(np.abs(array_factor.dirichlet(x[rows], m)) / n, abs=1e-12)
    assert made.magnitude[:, made.dopplers == 0][:, 0] == pytest.approx(overlap[:, 0] / n)


@pytest.mark.parametrize("sign", [1, -1])
def test_a_chirp_has_its_ridge_and_its_closed_form(sign):
    made = sarcl.ambiguity(chirp(sign), RATE, max_doppler=BAND)
    tau, nu = made.delays[:, None], made.dopplers
    rest = LENGTH - np.abs(tau)
    wanted = rest / LENGTH * np.abs(np.sinc((nu - sign * SLOPE * tau) * rest))
    assert np.abs(made.magnitude - wanted).max() < 0.02  # the sinc is the integral, this its sum
    ridge = np.abs(made.delays) < 0.4 * LENGTH
    along = made.dopplers[made.magnitude[ridge].argmax(axis=1)]
    assert along == pytest.approx(sign * SLOPE * made.delays[ridge], abs=RATE / 128)
    shifts = np.abs(made.dopplers) < 3e9
    assert made.delay_of_peak()[shifts] == pytest.approx(sign * made.dopplers[shifts] / SLOPE, abs=1.01 / RATE)


def test_tones_do_not_couple_delay_and_doppler():
    """Farooq, figure 4.7: the matched filter peaks at the true delay even under severe Doppler shifts."""
    made = sarcl.ambiguity(tones(), RATE, max_doppler=4.5e9)
    shifts = np.abs(made.dopplers) < 3e9
    assert np.abs(made.delay_of_peak()[shifts]).max() <= 1.01 / RATE
    delay, nu = made.delays[:, None], made.dopplers
    on_ridge = (
        (np.abs(nu - SLOPE * delay) < STEP / 4) & (np.abs(delay) > 0.2 * LENGTH) & (np.abs(delay) < 0.45 * LENGTH)
    )
    of_chirp = sarcl.ambiguity(chirp(), RATE, max_doppler=4.5e9).magnitude
    assert on_ridge.sum() > 10
    assert made.magnitude[on_ridge].max() < 0.2 and of_chirp[on_ridge].min() > 0.5


def test_tones_shifted_by_whole_steps_lose_a_tone_each():
    """At no delay and nu = m df, N - m of N orthogonal tones fall on each other."""
    made = sarcl.ambiguity(tones(), RATE, max_delay=0)
    for m in range(-4, 5):
        at = np.argmin(np.abs(made.dopplers - m * STEP))
        assert made.dopplers[at] == pytest.approx(m * STEP)
        assert made.magnitude[0, at] == pytest.approx(1 - abs(m) / N_TONES, abs=1e-9)


@pytest.mark.parametrize("n", [1, 2, 63, 200])
def test_the_volume_is_one_and_the_origin_the_peak(n):
    random = np.random.default_rng(n)
    noise = random.normal(size=n) + 1j * random.normal(size=n)
    for signal in (noise, 1e200 * noise, 1e-200 * noise) + ((chirp(), tones()) if n == 63 else ()):
        made = sarcl.ambiguity(signal, RATE)
        origin = made.magnitude[made.delays == 0][:, made.dopplers == 0]
        assert origin == pytest.approx(1, abs=1e-12) and made.magnitude.max() <= 1 + 1e-12
        if n > 1:
            assert made.volume == pytest.approx(1, rel=1e-12)


def test_parts_are_parts_of_the_whole():
    whole = sarcl.ambiguity(chirp(), RATE)
    part = sarcl.ambiguity(chirp(), RATE, max_delay=10 / RATE, max_doppler=2e9)
    assert len(part.delays) == 21
    rows, columns = np.isin(whole.delays, part.delays), np.isin(whole.dopplers, part.dopplers)
    assert np.array_equal(whole.magnitude[np.ix_(rows, columns)], part.magnitude)


@pytest.mark.parametrize(
    "signal, options, message",
    [
        ([1, np.nan], {}, r"signal\[1\] is"),
        ([], {}, "signal is empty"),
        ([[1, 2]], {}, "signal has shape"),
        ([0, 0], {}, "zero everywhere"),
        ([1, 2], {"rate": 0}, "rate is 0"),
        ([1, 2], {"max_delay": -1}, "max_delay is -1"),
        ([1, 2], {"max_doppler": float("inf")}, "max_doppler is inf"),
    ],
)
def test_bad_input_is_named(signal, options, message):
    with pytest.raises(ValueError, match=message):
        sarcl.ambiguity(signal, **{"rate": 1.0, **options})


def test_too_large_a_plane_says_how_to_cut_it():
    with pytest.raises(MemoryError, match="max_delay"):
        sarcl.ambiguity(np.ones(20_000), 1.0)
    assert sarcl.ambiguity(np.ones(20_000), 1.0, max_delay=3).magnitude.shape[0] == 7
