"""Samples in time as samples over frequency: range-compressed, dechirped and raw chirped records.

A point of delay tau gives s(f) = a exp(-j 2 pi f (tau - tau_ref)), tau_ref = 2 reference_range/c. In time:

    compressed  y(t) = a g(t - tau) exp(-j 2 pi fc tau)                          g: of peak 1, the band's transform
    chirped     y(t) = a p(t - tau) exp(-j 2 pi fc tau)                          p: the pulse
    rf          Re(y(t) exp(j 2 pi fc t)), y one of these two, t from the transmission
    dechirped   y(t) = a exp(-j 2 pi (fc + K t) (tau - tau_ref) + j pi K (tau - tau_ref)^2)   or its conjugate, or
                its real part; K: sweep rate, t: from the instant at which the reference sweep passes fc

The last follows from p(t) = exp(j 2 pi (fc t + K t^2/2)): the echo p(t - tau) times the conjugate of the reference
sweep, p(t - tau_ref). Its term in K (tau - tau_ref)^2 is the residual video phase. With tau - tau_ref = d + e, d known,
the record is

    exp(-j 2 pi (fc + K t) d + j pi K d^2) exp(-j 2 pi (fc + K (t - d)) e + j pi K e^2)

so that the factor in d alone, and frequencies shifted by K d, remove it exactly for e = 0. Without a d, a filter of
phase -pi f_b^2/K over the beat frequency f_b = -K (tau - tau_ref) removes it for every echo; it delays each by its own
tau - tau_ref, which disturbs the ends of the record.
"""

from __future__ import annotations

from collections.abc import Callable
from fractions import Fraction
from typing import NamedTuple

import numpy as np

from ..base import validation
from ..base.constants import LEAST_STEP, SPEED_OF_LIGHT
from ..base.errors import warn
from ..base.rows import spread_over
from ..base.types import LazyRows
from ._time_record import ROUNDING, Signal, Sweep, TimeRecord, signal_of
from .waveform import Waveform

BLOCK = 2**20  # samples per block of rows
BEAT_ROWS = 16  # rows in which the sign of the beat is checked
BAND_STEPS = 2**16  # frequencies at which the spectrum of a chirp is taken
LIGHT = Fraction(SPEED_OF_LIGHT)


class Spectra(NamedTuple):
    """Fields of a PhaseHistory: samples (n_rows, n); frequency, Hz (n_rows,); its step, Hz; reference, m (n_rows,)."""

    samples: np.ndarray
    frequency: np.ndarray
    frequency_step: float
    reference_range: np.ndarray


def spectra_of(record: TimeRecord) -> Spectra:
    """The samples of a record over frequency; ValueError names a wrong argument, or one of another kind."""
    signal = signal_of(record)
    if signal.sweep is not None:
        return _dechirped(signal, signal.sweep)
    if signal.kind == "chirped":
        return _chirped(signal, record.waveform, record.pulse_time)
    return _compressed(signal, record.waveform)


def _check_step(step: float, values: str) -> None:
    if step < LEAST_STEP:
        raise ValueError(f"{values}: {step:g} Hz from frequency to frequency, wanted {LEAST_STEP:g} Hz; is it in MHz?")


def _check_rate(rate: float, bandwidth: float, name: str) -> None:
    if bandwidth > rate * (1 + ROUNDING):
        raise ValueError(f"{name} is {bandwidth:g} Hz, but samples at {rate:g} Hz hold no more than that; check both")


def _chirped(signal: Signal, waveform: Waveform | None, pulse_time: str) -> Spectra:
    """Spectra of echoes of the pulse as it was sent; the record is extended by zeros as long as the pulse, so that
    pulses cut off by its ends do not wrap."""
    if waveform is None:
        raise ValueError("chirped samples need waveform=, the pulse that was sent: Waveform.chirp or .sampled")
    _check_rate(signal.rate, waveform.bandwidth, "waveform.bandwidth")
    delay = signal.start - waveform.duration / 2 if pulse_time == "start" else signal.start
    factor: complex = 1 / (signal.rate * float(np.sqrt(waveform.peak_energy_density)))
    if waveform.sweep_rate is not None:  # that of exp(j pi K t^2) has a phase of pi/4 beside P
        factor *= np.exp(-0.25j * np.pi * np.sign(waveform.sweep_rate)) / _in_band(waveform)
    n_pulse = waveform.duration * signal.rate
    validation.room(f"a pulse of {n_pulse:.3g} samples", 32 * n_pulse, "check rate, Hz, and waveform.duration, s")
    return _of_pulses(signal, delay, waveform.bandwidth, factor, n_zeros=int(np.ceil(n_pulse)))


def _compressed(signal: Signal, waveform: Waveform | None) -> Spectra:
    """Spectra of compressed pulses of peak 1."""
    band = signal.rate if waveform is None else waveform.bandwidth
    if signal.bandwidth is not None:
        band = validation.number("bandwidth", signal.bandwidth, above=0)
    _check_rate(signal.rate, band, "bandwidth")
    factor = band / signal.rate
    if waveform is not None:  # the peak of the compressed pulse is the integral of its spectrum
        n = 4 * signal.n
        f = waveform.center + (np.arange(n) + 0.5 - n / 2) * band / n
        factor *= float(waveform.matched_spectrum(f).mean())
    return _of_pulses(signal, signal.start, band, factor)


def _of_pulses(signal: Signal, delay: np.ndarray, bandwidth: float, factor: complex, n_zeros: int = 0) -> Spectra:
    """Spectra of records in which every echo is a pulse: compressed or chirped.

    delay      of sample 0, s (n_rows,), at which the middle of a pulse counts
    bandwidth  Hz, of the frequencies to keep, about the carrier;  factor  of the spectra
    n_zeros    samples by which the record is extended with zeros

    The reference lies at the middle of the record, and is the same for rows of one start to the last bit.
    """
    n, rate, carrier = signal.n, signal.rate, signal.carrier
    length = n + n_zeros
    step = rate / length
    _check_step(step, f"rate is {rate:g} Hz")
    n_bins = int(np.clip(round(bandwidth / step), 1, length))
    lowest = -(n_bins - 1) / 2  # in steps, of the first frequency, from the carrier
    reference = SPEED_OF_LIGHT / 2 * (delay + (n - 1) / (2 * rate))
    carrier_cycles, offset = _carrier_phase(delay, carrier, reference)
    shift = np.exp(-2j * np.pi * lowest / length * np.arange(n))

    def spectra(block: np.ndarray, rows: slice) -> np.ndarray:
        if signal.are_rf:
            block = _mix_down(block, rate, signal.start[rows], carrier[rows])
        bins = np.fft.fft(block * shift, length, axis=1)[:, :n_bins]
        cycles = carrier_cycles[rows, None] - step * (lowest + np.arange(n_bins)) * offset[rows, None]
        return np.asarray(factor * bins * np.exp(2j * np.pi * cycles))

    frequency = carrier + lowest * step
    _check_positive(
        frequency, "the band reaches half the bandwidth below carrier; check bandwidth, rate and carrier, in Hz"
    )
    return Spectra(_by_rows(signal.samples, n_bins, spectra), frequency, step, reference)


def _dechirped(signal: Signal, sweep: Sweep) -> Spectra:
    """Spectra of dechirped records: their samples, in the order of frequency, without the residual video phase."""
    n, rate, start, carrier = signal.n, signal.rate, signal.start, signal.carrier
    is_rising = sweep.rate > 0
    # receiver times conjugate reference has the beat frequency -K tau: the form of a phase history
    is_conjugate = (sweep.beat != "negative") == is_rising
    f = np.fft.fftfreq(n, 1 / rate)
    one_side = _one_side(n)
    video = np.exp(-1j * np.pi * f**2 / sweep.rate)
    reference = sweep.reference if sweep.scene is None else sweep.scene
    delay = np.zeros(len(start)) if sweep.scene is None else 2 * (sweep.scene - sweep.reference) / SPEED_OF_LIGHT
    cycles, _ = _carrier_phase(start, carrier, reference)
    sweep_cycles, _ = _carrier_phase(start, carrier, sweep.reference)
    t = np.arange(n) / rate

    def spectra(block: np.ndarray, rows: slice) -> np.ndarray:
        if sweep.beat is None:
            block = np.fft.ifft(np.fft.fft(block, axis=1) * one_side, axis=1)
        if is_conjugate:
            block = np.conj(block)
        if sweep.scene is None:
            block = np.fft.ifft(np.fft.fft(block, axis=1) * video, axis=1)
        else:
            d = delay[rows, None]
            shift = (cycles - sweep_cycles)[rows, None] + sweep.rate * d * (start[rows, None] + t - d / 2)
            block = block * np.exp(2j * np.pi * shift)
        return block if is_rising else block[:, ::-1]

    first_time = start - delay + (0.0 if is_rising else (n - 1) / rate)
    frequency = carrier + sweep.rate * first_time
    remedy = "start= and scene_range= are counted; check these, carrier (Hz) and sweep_rate (Hz/s)"
    _check_positive(frequency, f"the sweep passes carrier at a time of 0, of which {remedy}")
    spectrum = _by_rows(signal.samples, n, spectra)
    if sweep.beat is not None and not sweep.reference.any():
        _check_beat(spectrum, sweep.beat, float(np.median(delay)) * abs(sweep.rate) / rate)
    _check_step(abs(sweep.rate) / rate, f"sweep_rate is {sweep.rate:g} Hz/s and rate {rate:g} Hz")
    return Spectra(spectrum, frequency, abs(sweep.rate) / rate, reference)


def _check_positive(frequency: np.ndarray, why: str) -> None:
    """ValueError for rows whose lowest frequency, Hz (n_rows,), is not positive."""
    if not (frequency > 0).all():
        row = int(np.argmin(frequency))
        raise ValueError(f"row {row} would have frequencies from {frequency[row]:g} Hz; they must be positive: {why}")


def _check_beat(samples: np.ndarray, beat: str, zero: float) -> None:
    """Warn where most of the energy lies in front of the radar: the beat has the other sign.

    zero  delay of the reference in periods of the window: echoes at no delay lie that far before it
    """
    n = samples.shape[1]
    profiles = np.fft.ifft(samples[spread_over(len(samples), BEAT_ROWS)], axis=1)
    power = np.roll((np.abs(profiles) ** 2).sum(axis=0), round(zero * n))
    behind, before = float(power[2 : n // 2].sum()), float(power[n // 2 + 1 : -1].sum())  # without the leak at 0
    if before > 4 * behind:
        other = "negative" if beat == "positive" else "positive"
        warn(
            f"{before / (before + behind):.0%} of the energy lies at negative ranges, with beat={beat!r} and this sign "
            f"of the sweep rate: give beat={other!r}, or the other sign of sweep_rate, unless the data show no echo"
        )


def _mix_down(block: np.ndarray, rate: float, start: np.ndarray, carrier: np.ndarray) -> np.ndarray:
    """The analytic signal of real rows (n_rows, n), its carrier, Hz (n_rows,), mixed to 0.

    start  s (n_rows,), of sample 0 after the transmission
    """
    n = block.shape[1]
    cycles = (carrier * start)[:, None] % 1 + (carrier / rate)[:, None] * np.arange(n)
    return np.asarray(np.fft.ifft(np.fft.fft(block.real, axis=1) * _one_side(n), axis=1) * np.exp(-2j * np.pi * cycles))


def _one_side(n: int) -> np.ndarray:
    """Weights (n,) of an FFT of real samples that leave the positive frequencies, twice: the analytic signal."""
    weights = 1.0 + np.sign(np.fft.fftfreq(n))
    if n % 2 == 0:
        weights[n // 2] = 1.0
    return np.asarray(weights)


def _in_band(chirp: Waveform) -> complex:
    """Peak of a compressed chirp over that of the spectrum P of `Waveform.pulse_spectrum`, which has modulus 1 in the
    band: a pulse with sharp ends has lost the energy outside of it.

    The mean over the band of S conj(P), S the spectrum of exp(j pi K t^2), |t| <= T/2, from Fresnel's integrals:
    1 - (1 + j)/(pi sqrt(2 T B)) for large T B, and the conjugate for a frequency that falls.
    """
    from scipy.special import fresnel

    # in units of time sqrt(T/B): S conj(P) over the stationary value is (F(a) + F(b))/(1 + j), F = C + j S
    product = chirp.duration * chirp.bandwidth
    f = (np.arange(BAND_STEPS) + 0.5) / BAND_STEPS - 0.5
    (s1, c1), (s2, c2) = (fresnel(np.sqrt(2 * product) * (0.5 + side * f)) for side in (-1, 1))
    peak = complex((((c1 + c2) + 1j * (s1 + s2)) / (1 + 1j)).mean())
    return peak if chirp.kind == "chirp" else peak.conjugate()


def _carrier_phase(start: np.ndarray, carrier: np.ndarray, reference: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """fc tau_ref less whole cycles, and start - tau_ref, s, (n_rows,) each; exact until they are rounded to float64."""
    phases: dict[tuple[float, float, float], tuple[float, float]] = {}
    rows = list(zip(start.tolist(), carrier.tolist(), reference.tolist(), strict=True))
    for t, f, r in set(rows):
        delay = 2 * Fraction(r) / LIGHT
        phases[t, f, r] = float(Fraction(f) * delay % 1), float(Fraction(t) - delay)
    cycles, offset = np.array([phases[row] for row in rows]).T
    return cycles, offset


def _by_rows(samples: LazyRows, n: int, spectra: Callable[[np.ndarray, slice], np.ndarray]) -> np.ndarray:
    """The spectra (n_rows, n) of samples that are read in blocks of rows, complex128 where these are of 64 bits."""
    dtype, (n_rows, n_times) = np.dtype(samples.dtype), samples.shape
    is_single = dtype.kind in "iu" or dtype.itemsize <= (8 if dtype.kind == "c" else 4)
    spectrum = np.empty((n_rows, n), np.complex64 if is_single else np.complex128)
    step = max(1, BLOCK // n_times)
    for a in range(0, n_rows, step):
        block = np.asarray(samples[a : a + step])
        validation.finite("samples", block, first_row=a)
        spectrum[a : a + step] = spectra(block.astype(np.complex128), slice(a, a + step))
    return validation.sealed(spectrum)
