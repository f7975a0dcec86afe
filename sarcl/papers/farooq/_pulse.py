"""Farooq 2009, chapter 4: the pulse of diverse carriers, its spectrum, its ambiguity compared with a chirp."""

from __future__ import annotations

import numpy as np

from ...arrays import array_factor as closed
from ...arrays.ambiguity import Ambiguity, ambiguity
from ...arrays.beam import beam
from ...base.constants import SPEED_OF_LIGHT
from ...model.antenna_array import AntennaArray
from ..paper import Section
from ._lab import Lab, decibels

F0, N, STEP = 10e9, 9, 1e9  # table 4.1, scenario B
HALF_WAVE = SPEED_OF_LIGHT / F0 / 2
FAR = 1e7  # m
RATE = 64e9  # Hz, sampling rate of the pulses
BORESIGHT = ((1.0, 0.0, 0.0),)


def waveform(lab: Lab) -> Section:
    """Figures 4.1 to 4.5."""
    out = Section.of("farooq", "waveform")
    array = AntennaArray.linear(N, spacing=-HALF_WAVE, frequency_step=STEP)
    t = np.linspace(-0.5e-9, 1.5e-9, 4001)
    field = beam(array, F0, times=FAR / SPEED_OF_LIGHT + t, positions=FAR * np.array(BORESIGHT), device=lab.device)
    level = np.abs(field[:, 0])
    half = len(t) // 2
    first, second = t[level[:half].argmax()], t[half + int(level[half:].argmax())]
    out.number("period", 1e9 * (second - first))
    lobe = level[(t > 0) & (t < 0.5e-9)]
    null = t[t > 0][int((np.diff(lobe) > 0).argmax())]  # where it first rises again
    out.number("main lobe, null to null", 2e9 * null, expected=2 / (N * STEP) * 1e9)
    slow = AntennaArray.linear(N, spacing=-HALF_WAVE, frequency_step=1e3)
    flat = np.abs(
        beam(slow, F0, times=FAR / SPEED_OF_LIGHT + t, positions=FAR * np.array(BORESIGHT), device=lab.device)
    )
    ripple = float(np.ptp(flat) / N)
    out.states("1 kHz steps: modulation over 2 ns", ripple, ripple < 1e-3)
    f, channels, total = spectra()
    middle = float((f * total**2).sum() / (total**2).sum())
    out.number("centre frequency of the pulse", middle / 1e9)
    # Energy within a band of N df about the middle; the tails of the outer tones lie outside.
    inside = np.abs(f - 14e9) <= N * STEP / 2
    share = float((total[inside] ** 2).sum() / (total**2).sum())
    out.states("bandwidth", share, share > 0.95, percent=100 * share)
    crossing = 20 * np.log10(float(channels[0][np.isclose(f, F0 + STEP / 2, atol=2e6)].max()))
    out.states("neighbouring channels cross", crossing, crossing < -3)
    out.say()
    shown = (f >= 7e9) & (f <= 21e9)
    out.plot("The wave", [("1 GHz", 1e9 * t, field[:, 0].real)])
    out.plot("Its modulus", [("1 GHz", 1e9 * t, level), ("1 kHz", 1e9 * t, flat[:, 0])])
    out.plot(
        "Spectra of the channels",
        [(f"{(F0 + i * STEP) / 1e9:g} GHz", f[shown] / 1e9, decibels(c[shown])) for i, c in enumerate(channels)],
    )
    out.plot("Spectrum of the pulse", [("sum", f[shown] / 1e9, decibels(total[shown] / total.max()))])
    out.keep(modulus={"ns": 1e9 * t[::20], "modulus": level[::20]})
    return out


def spectra() -> tuple[np.ndarray, list[np.ndarray], np.ndarray]:
    """Frequencies, Hz (n,); spectra of the channels' pulses, peak 1, and of their sum, (n,) each."""
    t = (np.arange(-8192, 8192) + 0.5) * 2.5e-12
    f = np.fft.fftshift(np.fft.fftfreq(len(t), 2.5e-12))

    def spectrum(n: int, f0: float) -> np.ndarray:
        pulse = closed.waveform(f0, n, spacing=-HALF_WAVE, frequency_step=STEP, azimuth=0.0, retarded=t, pulsed=True)
        return np.abs(np.fft.fftshift(np.fft.fft(pulse))) * 2.5e-12 * STEP

    return f, [spectrum(1, F0 + i * STEP) for i in range(N)], spectrum(N, F0)


def ambiguities(lab: Lab) -> Section:
    """Figures 4.6 to 4.8."""
    out = Section.of("farooq", "ambiguity")
    length, band = 1 / STEP, N * STEP
    t = (np.arange(round(length * RATE)) - (round(length * RATE) - 1) / 2) / RATE
    chirp = ambiguity(np.exp(1j * np.pi * band / length * t**2), RATE, max_doppler=band / 2)
    tones = ambiguity(closed.geometric(2 * np.pi * STEP * t, N), RATE, max_doppler=band / 2)
    slope = band / length
    shifts = np.abs(chirp.dopplers) < band / 3
    moved, stays = (np.abs(a.delay_of_peak()[shifts]).max() * RATE for a in (chirp, tones))
    fit = float(np.polyfit(chirp.dopplers[shifts], chirp.delay_of_peak()[shifts], 1)[0] * slope)
    out.states("chirp: delay of the peak with Doppler", fit, abs(fit - 1) < 0.05, moved=moved)
    out.states("tones: delay of the peak, |nu| < 3 GHz", stays, stays <= 1.01, n=len(t))
    ridge = _ridge(tones, slope, length)
    out.states(
        "tones: largest value on the chirp's ridge", ridge, ridge < 0.25, least=_ridge(chirp, slope, length, np.min)
    )
    cuts = [(name, a.magnitude[:, int(np.abs(a.dopplers).argmin())]) for name, a in (("FDA", tones), ("LFM", chirp))]
    nulls = [1e9 * tones.delays[tones.delays > 0][int((np.diff(c[tones.delays > 0]) > 0).argmax())] for _, c in cuts]
    out.states("first nulls of both without Doppler", nulls, abs(nulls[0] - nulls[1]) < 0.03)
    out.say()
    for name, a, figure in (("LFM", chirp, "4.6"), ("FDA", tones, "4.7")):
        ends = (1e9 * a.delays[0], 1e9 * a.delays[-1]), (a.dopplers[0] / 1e9, a.dopplers[-1] / 1e9)
        out.words = {"name": name, "figure": figure}
        out.picture("Modulus of the ambiguity function", decibels(a.magnitude.T, -80), *ends, floor_db=-30)
    out.plot("Without Doppler", [(name, 1e9 * tones.delays, c) for name, c in cuts])
    return out


def _ridge(a: Ambiguity, slope: float, length: float, kind: object = np.max) -> float:
    """Largest (or least) |chi| along nu = slope tau, from 0.2 to 0.45 pulse lengths off."""
    delay, nu = a.delays[:, None], a.dopplers
    on = (np.abs(nu - slope * delay) < STEP / 4) & (np.abs(np.abs(delay) / length - 0.325) < 0.125)
    return float(kind(a.magnitude[on]))  # type: ignore[operator]
