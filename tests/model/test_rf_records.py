"""Real samples of the received signal itself, of impulse radars and of chirps, become samples over frequency."""

from __future__ import annotations

import numpy as np
import pytest

import sarcl
from sarcl.base.constants import SPEED_OF_LIGHT

LOW, HIGH, RATE, N = 3.4e9, 4.6e9, 13e9, 2048
MIDDLE, BAND = (LOW + HIGH) / 2, HIGH - LOW
RAIL = np.stack([np.zeros(101), np.linspace(-1, 1, 101), np.zeros(101)], axis=1)
CHIRP = sarcl.Waveform.chirp(center=3e6, bandwidth=1e6, duration=1e-6)
POINT, AMPLITUDE = np.array([9.0, 0.3, 0.0]), 0.8 * np.exp(0.7j)


def impulse(t):
    """Of a flat spectrum from LOW to HIGH, analytic, of peak 1."""
    return np.sinc(BAND * t) * np.exp(2j * np.pi * MIDDLE * t)


def record(shape, start=30e-9):
    tau = 2 * np.linalg.norm(RAIL - POINT, axis=1)[:, None] / SPEED_OF_LIGHT
    t = start + np.arange(N) / RATE
    return (AMPLITUDE * shape(t - tau)).real, tau


def exact(raw, tau):
    f = raw.frequency[:, None] + np.arange(raw.n_samples) * raw.frequency_step[:, None]
    return AMPLITUDE * np.exp(-2j * np.pi * f * (tau - 2 * raw.reference_range[:, None] / SPEED_OF_LIGHT))


@pytest.mark.parametrize("start", [30e-9, 0.0, np.linspace(30e-9, 33e-9, 101)])
def test_an_impulse_gives_the_samples_of_a_point(start):
    starts = np.broadcast_to(start, 101)
    tau = 2 * np.linalg.norm(RAIL - POINT, axis=1)[:, None] / SPEED_OF_LIGHT
    t = starts[:, None] + np.arange(N) / RATE
    samples = (AMPLITUDE * impulse(t - tau)).real
    raw = sarcl.PhaseHistory.from_time(samples, rate=RATE, start=start, tx=RAIL, kind="rf", bandwidth=(LOW, HIGH))
    assert raw.compressed and raw.center_frequency[0] == pytest.approx(MIDDLE, rel=1e-12)
    assert raw.bandwidth[0] == pytest.approx(BAND, rel=2e-2)
    # the record cuts off the sinc: ends of the band alone
    inner = slice(raw.n_samples // 20, -raw.n_samples // 20)
    wanted = exact(raw, tau)[:, inner]
    assert np.linalg.norm(raw.samples[:, inner] - wanted) < 0.02 * np.linalg.norm(wanted)


def test_a_point_is_focused_as_one_that_is_simulated_directly():
    samples, _ = record(lambda t: np.exp(-((np.pi * 0.25 * BAND * t) ** 2)) * np.exp(2j * np.pi * MIDDLE * t))
    raw = sarcl.PhaseHistory.from_time(samples, rate=RATE, start=30e-9, tx=RAIL, kind="rf", bandwidth=(LOW, HIGH))
    f = raw.frequency[0] + np.arange(raw.n_samples) * raw.frequency_step[0]
    spectrum = np.exp(-(((f - MIDDLE) / (0.25 * BAND)) ** 2))
    inside = 0.9953223  # erf(2): share of the spectrum's sum, the peak in time, that lies in the band
    direct = sarcl.PhaseHistory(
        exact(raw, 2 * np.linalg.norm(RAIL - POINT, axis=1)[:, None] / SPEED_OF_LIGHT)
        * spectrum / spectrum.mean() * inside,
        frequency=raw.frequency, frequency_step=raw.frequency_step, tx=RAIL, reference_range=raw.reference_range,
    )  # fmt: skip
    grid = sarcl.ImageGrid.plane(shape=(41, 41), spacing=0.02, center=POINT)
    one, two = (sarcl.backproject(r, grid, tolerance=1e-4).data for r in (raw, direct))
    assert np.linalg.norm(one - two) < 2e-3 * np.linalg.norm(two)
    assert np.unravel_index(np.abs(one).argmax(), one.shape) == (20, 20)


@pytest.mark.parametrize("pulse_time", ["start", "middle"])
def test_a_pulse_that_is_not_compressed_yet_awaits_compress(pulse_time):
    chirp = sarcl.Waveform.chirp(center=MIDDLE, bandwidth=BAND, duration=40e-9)
    late = 20e-9 if pulse_time == "start" else 0.0

    def sweep(t):
        t = t - late
        inside = np.abs(t) <= 20e-9
        return inside * np.exp(2j * np.pi * (MIDDLE * t + BAND / 40e-9 * t**2 / 2))

    samples, tau = record(sweep)
    raw = sarcl.PhaseHistory.from_time(
        samples, rate=RATE, start=30e-9, tx=RAIL, kind="rf", waveform=chirp, pulse_time=pulse_time
    )
    assert not raw.compressed
    t = 30e-9 + np.arange(N) / RATE
    baseband = AMPLITUDE * sweep(t - tau) * np.exp(-2j * np.pi * MIDDLE * t)
    mixed = sarcl.PhaseHistory.from_time(
        baseband, rate=RATE, start=30e-9, tx=RAIL, kind="chirped", waveform=chirp, pulse_time=pulse_time
    )
    # a sweep with sharp ends has a little power at negative frequencies, which the analytic signal has not
    assert np.linalg.norm(raw.samples - mixed.samples) < 2e-2 * np.linalg.norm(mixed.samples)
    assert (raw.frequency == mixed.frequency).all() and (raw.reference_range == mixed.reference_range).all()


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"samples": np.ones((3, 8), complex)}, "kind \"rf\" is for real ones"),
        ({"carrier": 1e9}, "carrier is the middle of bandwidth"),
        ({"bandwidth": None}, r"kind 'rf' needs bandwidth=\(low, high\), Hz"),
        ({"bandwidth": 1e6}, r"kind 'rf' needs bandwidth=\(low, high\), Hz"),
        ({"bandwidth": (2e6, 1e6)}, "wanted 0 < low < high, and high at most half of rate"),
        ({"bandwidth": (0, 1e6)}, "wanted 0 < low < high, and high at most half of rate"),
        ({"bandwidth": (1e6, 6e6)}, "high at most half of rate, 5e.06 Hz"),
        ({"sweep_rate": 1e9}, "sweep_rate is for dechirped samples"),
        ({"beat": "positive"}, "have no beat; leave it out"),
        ({"waveform": CHIRP}, "bandwidth and waveform are both given"),
        ({"waveform": CHIRP, "bandwidth": None, "rate": 5e6}, "high at most half of rate, 2.5e.06 Hz"),
        ({"pulse_time": "middle"}, "pulse_time is 'middle', and without waveform= samples are compressed"),
        ({"bandwidth": (1e6, 2e6, 3e6)}, "bandwidth has shape"),
        ({"kind": "compressed", "bandwidth": None, "carrier": 3e6}, 'real samples of the received .* kind="rf"'),
    ],
)  # fmt: skip
def test_what_rf_samples_do_not_have_is_refused(given, message):
    with pytest.raises(ValueError, match=message):
        sarcl.PhaseHistory.from_time(
            **{"samples": np.ones((3, 8)), "rate": 1e7, "tx": np.zeros((3, 3)), "kind": "rf", "bandwidth": (1e6, 2e6),
               **given}
        )  # fmt: skip
