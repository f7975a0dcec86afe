"""Waveforms: spectra in closed form, one normalisation, and what is refused."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.special import fresnel

import sarcl

TOLERANCE = {
    "closed form": 1e-12,  # float64 formula against the same formula
    "carrier": 1e-8,  # frequencies near 10 GHz are multiples of 2e-6 Hz: 2e-6 Hz x 2e-6 s x 2 pi, and sums of them
    "gaussian": 1e-9,  # its tails beyond the sampled time and band are below exp(-25)
    "fresnel": 2e-3,  # a rectangular pulse has tails that sampling at 16 times its band folds back
    "stationary phase": 0.1,  # rad: ripples of a chirp of time-bandwidth product 400, in its middle half
}
CENTER, BAND, LENGTH = 9.6e9, 600e6, 2e-6
CHIRP = sarcl.Waveform.chirp(center=CENTER, bandwidth=BAND, duration=LENGTH)


def fresnel_chirp(f, bandwidth, duration):
    """Spectrum of exp(+j pi k t^2), |t| <= duration/2, k = bandwidth/duration, at f Hz, times sqrt(k)."""
    k = bandwidth / duration
    s = [fresnel((bandwidth / 2 + sign * f) * np.sqrt(2 / k)) for sign in (-1, 1)]
    sine, cosine = (sum(part) for part in zip(*s, strict=True))
    return np.exp(-1j * np.pi * f**2 / k) * (cosine + 1j * sine) / np.sqrt(2)


def sampled_chirp(bandwidth, duration, rate):
    n = round(rate * duration)
    t = (np.arange(n) - (n - 1) / 2) / rate
    return np.exp(1j * np.pi * bandwidth / duration * t**2)


def test_a_chirps_matched_spectrum_is_one_in_its_band_and_zero_outside():
    inside = CENTER + np.linspace(-BAND / 2, BAND / 2, 1001)
    outside = CENTER + np.array([-2, -0.51, -0.500001, 0.500001, 0.51, 2]) * BAND
    assert np.abs(CHIRP.matched_spectrum(inside) - 1).max() <= TOLERANCE["closed form"]
    assert (CHIRP.matched_spectrum(outside) == 0).all()


def test_a_chirps_spectrum_has_the_quadratic_phase_of_stationary_phase():
    f = CENTER + np.linspace(-BAND / 2, BAND / 2, 101)
    wanted = np.exp(-1j * np.pi * (f - CENTER) ** 2 * LENGTH / BAND)
    assert np.abs(CHIRP.pulse_spectrum(f) - wanted).max() <= TOLERANCE["closed form"]


def test_a_tones_matched_spectrum_is_sinc_squared():
    f = CENTER + np.linspace(-3, 3, 1001) / LENGTH
    tone = sarcl.Waveform.tone(center=CENTER, duration=LENGTH)
    wanted = np.sinc((f - CENTER) * LENGTH) ** 2
    assert np.abs(tone.matched_spectrum(f) - wanted).max() <= TOLERANCE["carrier"]


def test_a_tones_band_holds_one_side_lobe_on_each_side_unless_given():
    assert sarcl.Waveform.tone(center=CENTER, duration=LENGTH).bandwidth == 4 / LENGTH
    assert sarcl.Waveform.tone(center=CENTER, duration=LENGTH, bandwidth=7e6).bandwidth == 7e6


def test_a_sampled_gaussian_chirp_has_its_spectrum_in_closed_form_phase_included():
    # exp(-a t^2), a complex <-> sqrt(pi/a) exp(-pi^2 f^2/a): centred in time, so that no linear phase is left
    a, rate, n = (1 + 20j) / (2 * 50e-9**2), 4e9, 4001
    t = (np.arange(n) - (n - 1) / 2) / rate
    wave = sarcl.Waveform.sampled(np.exp(-a * t**2), rate, CENTER)
    f = np.linspace(-200e6, 200e6, 501)
    wanted = np.sqrt(np.abs(a) / a) * np.exp(-(np.pi**2) * f**2 / a)
    assert np.abs(wave.pulse_spectrum(CENTER + f) - wanted).max() <= TOLERANCE["gaussian"]


def test_a_sampled_chirp_has_the_fresnel_spectrum():
    bandwidth, duration = 100e6, 4e-6
    wave = sarcl.Waveform.sampled(sampled_chirp(bandwidth, duration, 16 * bandwidth), 16 * bandwidth, CENTER)
    fine = np.linspace(-bandwidth, bandwidth, 4001)
    wanted = fresnel_chirp(fine, bandwidth, duration)
    wanted /= np.abs(wanted).max()
    assert np.abs(wave.pulse_spectrum(CENTER + fine) - wanted).max() <= TOLERANCE["fresnel"]


def test_the_chirps_formula_is_the_sampled_chirps_spectrum_but_for_a_constant_phase():
    bandwidth, duration = 100e6, 4e-6
    f = CENTER + np.linspace(-bandwidth / 4, bandwidth / 4, 501)
    formula = sarcl.Waveform.chirp(center=CENTER, bandwidth=bandwidth, duration=duration)
    wave = sarcl.Waveform.sampled(sampled_chirp(bandwidth, duration, 4 * bandwidth), 4 * bandwidth, CENTER)
    turned = wave.pulse_spectrum(f) * np.conj(formula.pulse_spectrum(f))
    assert np.abs(np.angle(turned) - np.pi / 4).max() <= TOLERANCE["stationary phase"]


WAVES = {
    "chirp": CHIRP,
    "tone": sarcl.Waveform.tone(center=CENTER, duration=LENGTH),
    "one sample": sarcl.Waveform.sampled([3 - 4j], 1e8, CENTER),
    "odd": sarcl.Waveform.sampled([1, 2j, -1], 1e8, CENTER),
    "even": sarcl.Waveform.sampled(np.ones(64, np.float32), 1e8, CENTER),
    "tiny": sarcl.Waveform.sampled(np.full(64, 1e-300), 1e8, CENTER),
    "huge": sarcl.Waveform.sampled(np.full(64, 1e308 + 1e308j), 1e8, CENTER),
    "low frequency": sarcl.Waveform.chirp(center=1e6, bandwidth=1.9e6, duration=1e-3),
}


@pytest.mark.parametrize("name", WAVES)
def test_every_spectrum_has_peak_one(name):
    wave = WAVES[name]
    f = wave.center + np.linspace(-wave.bandwidth / 2, wave.bandwidth / 2, 20001)
    assert wave.matched_spectrum(f).max() == pytest.approx(1, abs=1e-3)  # the peak lies between two of these f
    assert wave.matched_spectrum(f).max() <= 1 + 1e-3  # and the spectrum's own grid has 8 points a lobe


@pytest.mark.parametrize("name", WAVES)
def test_the_matched_spectrum_is_the_pulse_spectrums_modulus_squared(name):
    wave = WAVES[name]
    f = wave.center + np.linspace(-wave.bandwidth, wave.bandwidth, 301)
    matched = wave.matched_spectrum(f)
    assert matched.dtype == np.float64
    assert np.abs(matched - np.abs(wave.pulse_spectrum(f)) ** 2).max() <= TOLERANCE["closed form"]


def test_a_real_even_pulse_has_a_real_spectrum_because_it_is_centred_on_time_zero():
    for n in (8, 9):
        wave = sarcl.Waveform.sampled(np.hanning(n + 2)[1:-1], 1e8, CENTER)
        f = CENTER + np.linspace(-50e6, 50e6, 101)
        assert np.abs(wave.pulse_spectrum(f).imag).max() <= TOLERANCE["carrier"]


def test_a_sampled_pulse_lasts_its_samples_and_its_band_is_its_rate():
    wave = sarcl.Waveform.sampled(np.ones(50), 2e8, CENTER)
    assert (wave.duration, wave.bandwidth, wave.rate) == (50 / 2e8, 2e8, 2e8)


@pytest.mark.parametrize("frequency", [CENTER, [CENTER, CENTER], np.full((2, 3), CENTER), []], ids=str)
@pytest.mark.parametrize("name", ["chirp", "tone", "odd"])
def test_spectra_have_the_shape_of_the_frequencies(name, frequency):
    assert np.shape(WAVES[name].matched_spectrum(frequency)) == np.shape(frequency)
    assert np.shape(WAVES[name].pulse_spectrum(frequency)) == np.shape(frequency)


def test_the_callers_signal_is_neither_frozen_nor_followed():
    signal = np.ones(16, np.complex128)
    wave = sarcl.Waveform.sampled(signal, 1e8, CENTER)
    signal[:] = 0
    assert (wave.signal == 1).all() and signal.flags.writeable and not wave.signal.flags.writeable


def test_a_waveform_cannot_be_changed():
    with pytest.raises(AttributeError):
        CHIRP.center = 1e9
    with pytest.raises(ValueError, match="read-only"):
        WAVES["odd"].signal[0] = 0


def chirp(**changed):
    return sarcl.Waveform.chirp(**{"center": CENTER, "bandwidth": BAND, "duration": LENGTH, **changed})


def sampled(signal, rate=1e8, center=CENTER):
    return sarcl.Waveform.sampled(signal, rate, center)


BAD = {
    "no duration": (lambda: chirp(duration=0), "waveform duration is 0; it must be greater than 0"),
    "negative duration": (lambda: sarcl.Waveform.tone(center=1e9, duration=-1), "waveform duration is -1"),
    "no bandwidth": (lambda: chirp(bandwidth=0), "waveform bandwidth is 0"),
    "negative center": (lambda: chirp(center=-1e9), "waveform center is -1e[+]09"),
    "not finite": (lambda: chirp(center=np.nan), "waveform center is nan; it must be finite"),
    "too large a number": (lambda: chirp(center=10**400), "waveform center must be a number"),
    "a word": (lambda: chirp(bandwidth="600e6"), "waveform bandwidth must be a number, got '600e6'"),
    "a truth": (lambda: chirp(duration=True), "waveform duration must be a number, got True"),
    "band reaching 0 Hz": (lambda: chirp(center=3e8), "reaches 0 Hz; .* raise center or lower bandwidth"),
    "tone reaching 0 Hz": (lambda: sarcl.Waveform.tone(center=1e9, duration=1e-9), "reaches 0 Hz"),
    "empty signal": (lambda: sampled([]), "waveform signal is empty"),
    "signal of zeros": (lambda: sampled(np.zeros(9)), "waveform signal is zero everywhere"),
    "signal not finite": (lambda: sampled([1, 2, np.nan, np.inf]), r"waveform signal\[2\] is .*nan"),
    "signal of two axes": (lambda: sampled(np.ones((2, 3))), r"waveform signal has shape \(2, 3\), wanted \(n,\)"),
    "signal of one number": (lambda: sampled(3), r"waveform signal has shape \(\), wanted \(n,\)"),
    "signal of words": (lambda: sampled(["1", "2"]), "waveform signal must be numbers"),
    "signal with gaps": (lambda: sampled(np.ma.array([1.0, 2], mask=[0, 1])), "1 values are masked"),
    "no rate": (lambda: sampled([1, 2], rate=0), "waveform rate is 0"),
    "no signal": (lambda: sarcl.Waveform(1e9, 1e8, 1e-6, "sampled"), "waveform signal must be numbers"),
    "signal of a chirp": (lambda: sarcl.Waveform(1e9, 1e8, 1e-6, "chirp", [1, 2]), "go with kind 'sampled'"),
    "unknown kind": (
        lambda: sarcl.Waveform(1e9, 1e8, 1e-6, "noise"),
        "'noise'; choose one of 'chirp', 'down-chirp', 'tone'",
    ),
}


@pytest.mark.parametrize("name", BAD)
def test_bad_waveforms_say_what_was_wanted(name):
    make, message = BAD[name]
    with pytest.raises(ValueError, match=message):
        make()


def test_a_down_chirp_is_the_conjugate_of_a_chirp_and_a_negative_bandwidth_says_so():
    down = sarcl.Waveform.chirp(center=CENTER, bandwidth=BAND, duration=LENGTH, down=True)
    f = CENTER + np.linspace(-0.6, 0.6, 101) * BAND
    assert (down.pulse_spectrum(f) == CHIRP.pulse_spectrum(f).conj()).all()
    assert down.sweep_rate == -CHIRP.sweep_rate == -BAND / LENGTH
    assert sarcl.Waveform.tone(center=CENTER, duration=LENGTH).sweep_rate is None
    with pytest.raises(ValueError, match=r"bandwidth is -6e\+08; .* give bandwidth=6e\+08, down=True"):
        sarcl.Waveform.chirp(center=CENTER, bandwidth=-BAND, duration=LENGTH)
    scenario = sarcl.scenario.loads(sarcl.Scenario(waveform=down).dumps())
    assert scenario.build_waveform().kind == "down-chirp"
