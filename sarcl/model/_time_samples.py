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
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import numpy as np

from ..base import validation
from ..base.constants import SPEED_OF_LIGHT
from ..base.errors import warn
from ..base.rows import spread_over
from .waveform import Waveform

BLOCK = 2**20  # samples per block of rows
SOME_ROWS = 16  # rows in which the sign of the beat is checked
BAND_STEPS = 2**16  # frequencies at which the spectrum of a chirp is taken
LONGEST_DELAY = 1e9  # s
KINDS = ("compressed", "dechirped", "chirped", "rf")
LIGHT = Fraction(SPEED_OF_LIGHT)


@dataclass(frozen=True, eq=False)
class Spectra:
    """samples (n_rows, n); frequency of sample 0, Hz (n_rows,); step, Hz; reference_range, m (n_rows,)."""

    samples: np.ndarray
    frequency: np.ndarray
    step: float
    reference_range: np.ndarray


def spectra_of(
    samples: Any, kind: Any, rate: Any, start: Any, carrier: Any, bandwidth: Any, waveform: Any, pulse_time: Any,
    sweep_rate: Any, beat: Any, reference_range: Any, scene_range: Any,
) -> tuple[Spectra, Waveform | None]:  # fmt: skip
    """The arguments of PhaseHistory.from_time checked, and its samples over frequency; the waveform, or None."""
    validation.choice("kind", kind, KINDS)
    samples = _records(samples, kind)
    n_rows, n = samples.shape
    rate = validation.number("rate", rate, above=0)
    if waveform is not None:
        validation.instance("waveform", waveform, Waveform)
    _check_meant(kind, bandwidth, pulse_time, sweep_rate, reference_range, scene_range)
    band = None
    if kind == "rf":
        band = _rf_band(samples, rate, carrier, bandwidth, waveform, pulse_time)
        carrier, bandwidth = sum(band) / 2, band[1] - band[0]
        kind = "compressed" if waveform is None else "chirped"
    if carrier is None and waveform is None:
        raise ValueError("carrier is None and there is no waveform to take it from; give carrier=, Hz")
    carrier = _each("carrier", waveform.center if carrier is None else carrier, n_rows)
    if not (carrier > 0).all():
        raise ValueError(f"carrier[{int(np.argmin(carrier))}] is {carrier.min():g} Hz; it must be positive")
    start = _each("start", start, n_rows)
    if np.abs(start).max() > LONGEST_DELAY:
        raise ValueError(f"start reaches {np.abs(start).max():g} s, longer than any echo takes; give seconds")
    if kind == "dechirped":
        if sweep_rate is None or not (sweep_rate := validation.number("sweep_rate", sweep_rate)):
            raise ValueError("dechirped samples need sweep_rate=, Hz/s, not 0: negative where the frequency falls")
        real = np.dtype(samples.dtype).kind != "c"
        if real and beat is not None:
            raise ValueError(f"beat is {beat!r}, but real samples have beats of both signs; leave it out")
        if not real:
            if beat is None:
                raise ValueError(
                    'complex dechirped samples need beat="positive" or "negative": the sign of the beat frequency of '
                    "echoes behind the reference"
                )
            validation.choice("beat", beat, ("positive", "negative"))
        reference = _each("reference_range", reference_range, n_rows)
        scene = None if scene_range is None else _each("scene_range", scene_range, n_rows)
        return of_beats(samples, rate, start, carrier, sweep_rate, beat, reference, scene), waveform
    if beat is not None:
        raise ValueError(f"beat is {beat!r}, but {kind} samples have no beat; leave it out")
    if np.dtype(samples.dtype).kind != "c" and band is None:
        raise ValueError(
            f'{kind} samples must be complex, got {samples.dtype}; real samples of the received signal are kind="rf", '
            "with bandwidth=(low, high), Hz"
        )
    if waveform is not None and np.ptp(carrier) == 0 and abs(waveform.center - carrier[0]) > 1e-9 * carrier[0]:
        raise ValueError(
            f"carrier is {carrier[0]:.9g} Hz but waveform.center {waveform.center:.9g} Hz; they must be one frequency"
        )
    if kind == "chirped":
        if waveform is None:
            raise ValueError("chirped samples need waveform=, the pulse that was sent: Waveform.chirp or .sampled")
        _check_rate(rate, waveform.bandwidth, "waveform.bandwidth")
        sent = None if band is None else start
        if pulse_time == "start":
            start = start - waveform.duration / 2
        factor: complex = 1 / (rate * float(np.sqrt(waveform.peak_energy_density)))
        if waveform.sweep_rate is not None:  # that of exp(j pi K t^2) has a phase of pi/4 beside P
            factor *= np.exp(-0.25j * np.pi * np.sign(waveform.sweep_rate)) / _in_band(waveform)
        wanted = waveform.duration * rate
        validation.room(f"a pulse of {wanted:.3g} samples", 32 * wanted, "check rate, Hz, and waveform.duration, s")
        pad = int(np.ceil(wanted))
        return of_pulses(samples, rate, start, carrier, waveform.bandwidth, factor, pad, sent), waveform
    kept = rate if waveform is None else waveform.bandwidth
    if bandwidth is not None:
        kept = validation.number("bandwidth", bandwidth, above=0)
    _check_rate(rate, kept, "bandwidth")
    factor = kept / rate
    if waveform is not None:  # the peak of the compressed pulse is the integral of its spectrum
        f = waveform.center + (np.arange(4 * n) + 0.5 - 2 * n) * kept / (4 * n)
        factor *= float(waveform.matched_spectrum(f).mean())
    return of_pulses(samples, rate, start, carrier, kept, factor, sent=None if band is None else start), waveform


def _rf_band(
    samples: Any, rate: float, carrier: Any, bandwidth: Any, waveform: Waveform | None, pulse_time: Any
) -> tuple[float, float]:
    """The band (low, high), Hz, of real samples of the signal itself."""
    if np.dtype(samples.dtype).kind == "c":
        raise ValueError(
            f'samples are {samples.dtype}, and kind "rf" is for real ones; complex ones are "compressed" or "chirped"'
        )
    if carrier is not None:
        raise ValueError("carrier is the middle of bandwidth=(low, high) where kind is 'rf'; leave it out")
    if waveform is None and pulse_time != "start":
        raise ValueError(f"pulse_time is {pulse_time!r}, and without waveform= samples are compressed; leave it out")
    if waveform is not None and bandwidth is not None:
        raise ValueError("bandwidth and waveform are both given, and the band is the waveform's; leave bandwidth out")
    if waveform is not None:
        bandwidth = waveform.center - waveform.bandwidth / 2, waveform.center + waveform.bandwidth / 2
    elif bandwidth is None or validation.ndim("bandwidth", bandwidth) != 1:
        raise ValueError(f"bandwidth is {bandwidth!r:.60}; kind 'rf' needs bandwidth=(low, high), Hz")
    low, high = (float(f) for f in validation.array("bandwidth", bandwidth, np.float64, (2,)))
    if not 0 < low < high <= rate / 2 * (1 + 1e-9):
        raise ValueError(
            f"bandwidth is ({low:g}, {high:g}) Hz; wanted 0 < low < high, and high at most half of rate, "
            f"{rate / 2:g} Hz"
        )
    return low, high


def _mixed(block: np.ndarray, rate: float, start: np.ndarray, carrier: np.ndarray) -> np.ndarray:
    """The analytic signal of real rows (n_rows, n), its carrier, Hz (n_rows,), mixed to 0.

    start  s (n_rows,), of sample 0 after the transmission
    """
    n = block.shape[1]
    cycles = (carrier * start)[:, None] % 1 + (carrier / rate)[:, None] * np.arange(n)
    return np.asarray(np.fft.ifft(np.fft.fft(block.real, axis=1) * _one_side(n), axis=1) * np.exp(-2j * np.pi * cycles))


def _one_side(n: int) -> np.ndarray:
    """Weights (n,) of an FFT of real samples that leave the positive frequencies, twice: the analytic signal."""
    out = 1.0 + np.sign(np.fft.fftfreq(n))
    if n % 2 == 0:
        out[n // 2] = 1.0
    return np.asarray(out)


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
    made = complex((((c1 + c2) + 1j * (s1 + s2)) / (1 + 1j)).mean())
    return made if chirp.kind == "chirp" else made.conjugate()


def _check_meant(
    kind: str, bandwidth: Any, pulse_time: Any, sweep_rate: Any, reference_range: Any, scene_range: Any
) -> None:
    """Raise ValueError for arguments of another kind."""
    validation.choice("pulse_time", pulse_time, ("start", "middle"))
    validation.ndim("reference_range", reference_range)
    moved = np.any(np.asarray(reference_range) != 0)
    for name, given, only in (
        ("bandwidth", bandwidth is not None and kind != "rf", "compressed"),
        ("pulse_time", pulse_time != "start" and kind != "rf", "chirped"),
        ("sweep_rate", sweep_rate is not None, "dechirped"),
        ("reference_range", bool(moved), "dechirped"),
        ("scene_range", scene_range is not None, "dechirped"),
    ):
        if given and kind != only:
            raise ValueError(f"{name} is for {only} samples, and kind is {kind!r}; leave it out")


def _check_rate(rate: float, bandwidth: float, name: str) -> None:
    if bandwidth > rate * (1 + 1e-9):
        raise ValueError(f"{name} is {bandwidth:g} Hz, but samples at {rate:g} Hz hold no more than that; check both")


def _records(samples: Any, kind: str) -> Any:
    """Samples as an array, or as given where they are read row by row; ValueError for another shape or type."""
    if isinstance(samples, (list, tuple)):
        validation.ndim("samples", samples)
        samples = np.asarray(samples)
    if len(np.shape(samples)) != 2 or 0 in samples.shape:
        raise ValueError(f"samples has shape {np.shape(samples)}, wanted (n_rows, n_times), neither zero")
    if np.dtype(samples.dtype).kind not in "ciuf":
        raise ValueError(f"samples has type {samples.dtype}, wanted numbers")
    if samples.shape[1] < 2:
        raise ValueError(f"samples has one time per row; {kind} records need at least 2")
    return samples


def _each(name: str, value: Any, n_rows: int) -> np.ndarray:
    """A number, or one per row, as float64 (n_rows,)."""
    out = validation.converted(name, value, np.float64)
    if out.shape not in ((), (n_rows,)):
        raise ValueError(f"{name} has shape {out.shape}, wanted one number or one per row, ({n_rows},)")
    validation.finite(name, out)
    return np.array(np.broadcast_to(out, (n_rows,)))


def of_pulses(
    samples: Any, rate: float, start: np.ndarray, carrier: np.ndarray, bandwidth: float, factor: complex, pad: int = 0,
    sent: np.ndarray | None = None,
) -> Spectra:  # fmt: skip
    """Spectra of records in which every echo is a pulse: compressed or chirped.

    start      delay of sample 0, s (n_rows,), at which the middle of a pulse counts;  carrier  Hz (n_rows,)
    bandwidth  Hz, of the frequencies to keep, about the carrier;  factor  of the spectra
    pad        samples by which the record is extended with zeros, so that pulses cut off by its ends do not wrap
    sent       of real samples of the signal itself: s (n_rows,), of sample 0 after the transmission

    The reference lies at the middle of the record, and is the same for rows of one start to the last bit.
    """
    n = samples.shape[1]
    length = n + pad
    step = rate / length
    kept = int(np.clip(round(bandwidth / step), 1, length))
    lowest = -(kept - 1) / 2  # in steps, of the first frequency kept, from the carrier
    reference = SPEED_OF_LIGHT / 2 * (start + (n - 1) / (2 * rate))
    cycles, offset = _carrier_phase(start, carrier, reference)
    shift = np.exp(-2j * np.pi * lowest / length * np.arange(n))

    def spectra(block: np.ndarray, rows: slice) -> np.ndarray:
        if sent is not None:
            block = _mixed(block, rate, sent[rows], carrier[rows])
        made = np.fft.fft(block * shift, length, axis=1)[:, :kept]
        turns = cycles[rows, None] - step * (lowest + np.arange(kept)) * offset[rows, None]
        return np.asarray(factor * made * np.exp(2j * np.pi * turns))

    lows = carrier + lowest * step
    _check_positive(lows, "the band reaches half the bandwidth below carrier; check bandwidth, rate and carrier, in Hz")
    return Spectra(_by_rows(samples, kept, spectra), lows, step, reference)


def _check_positive(lowest: np.ndarray, why: str) -> None:
    """ValueError for rows whose lowest frequency, Hz (n_rows,), is not positive."""
    if not (lowest > 0).all():
        row = int(np.argmin(lowest))
        raise ValueError(f"row {row} would have frequencies from {lowest[row]:g} Hz; they must be positive: {why}")


def of_beats(
    samples: Any, rate: float, start: np.ndarray, carrier: np.ndarray, sweep_rate: float, beat: str | None,
    reference: np.ndarray, scene: np.ndarray | None,
) -> Spectra:  # fmt: skip
    """Spectra of dechirped records: their samples, in the order of frequency, without the residual video phase.

    start      s (n_rows,), of sample 0 after the reference sweep passed carrier, Hz (n_rows,)
    sweep_rate Hz/s, negative for a sweep that falls;  reference  m (n_rows,), half the path of the reference sweep
    beat       sign of the beat frequency of an echo behind the reference; None: real samples
    scene      m (n_rows,): the new reference, at which no video phase remains; None: the filter is applied
    """
    n = samples.shape[1]
    # receiver times conjugate reference has the beat frequency -K tau: the form of a phase history
    flipped = (1 if beat in (None, "positive") else -1) == (1 if sweep_rate > 0 else -1)
    f = np.fft.fftfreq(n, 1 / rate)
    one_side = _one_side(n)
    video = np.exp(-1j * np.pi * f**2 / sweep_rate) if scene is None else None
    late = np.zeros(len(start)) if scene is None else 2 * (scene - reference) / SPEED_OF_LIGHT
    cycles, _ = _carrier_phase(start, carrier, reference if scene is None else scene)
    before, _ = _carrier_phase(start, carrier, reference)
    t = np.arange(n) / rate

    def spectra(block: np.ndarray, rows: slice) -> np.ndarray:
        if beat is None:
            block = np.fft.ifft(np.fft.fft(block, axis=1) * one_side, axis=1)
        made = np.conj(block) if flipped else block
        if video is not None:
            made = np.fft.ifft(np.fft.fft(made, axis=1) * video, axis=1)
        else:
            d = late[rows, None]
            turns = (cycles - before)[rows, None] + sweep_rate * d * (start[rows, None] + t - d / 2)
            made = made * np.exp(2j * np.pi * turns)
        return made if sweep_rate > 0 else made[:, ::-1]

    first = start - late + (0.0 if sweep_rate > 0 else (n - 1) / rate)
    lows = carrier + sweep_rate * first
    _check_positive(
        lows, "the sweep passes carrier at a time of 0, of which start= and scene_range= are counted; check these, "
        "carrier (Hz) and sweep_rate (Hz/s)",
    )  # fmt: skip
    made = _by_rows(samples, n, spectra)
    if beat is not None and not reference.any():
        _check_beat(made, beat, 0 if scene is None else float(np.median(late)) * abs(sweep_rate) / rate)
    moved = reference if scene is None else scene
    return Spectra(made, lows, abs(sweep_rate) / rate, moved)


def _check_beat(samples: np.ndarray, beat: str, zero: float) -> None:
    """Warn where most of the energy lies in front of the radar: the beat has the other sign.

    zero  delay of the reference in periods of the window: echoes at no delay lie that far before it
    """
    n = samples.shape[1]
    some = samples[spread_over(len(samples), SOME_ROWS)]
    power = (np.abs(np.fft.ifft(some, axis=1)) ** 2).sum(axis=0)
    power = np.roll(power, round(zero * n))
    behind, before = float(power[2 : n // 2].sum()), float(power[n // 2 + 1 : -1].sum())  # without the leak at 0
    if before > 4 * behind:
        other = "negative" if beat == "positive" else "positive"
        warn(
            f"{before / (before + behind):.0%} of the energy lies at negative ranges, with beat={beat!r} and this sign "
            f"of the sweep rate: give beat={other!r}, or the other sign of sweep_rate, unless the data show no echo"
        )


def _carrier_phase(start: np.ndarray, carrier: np.ndarray, reference: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """fc tau_ref less whole cycles, and start - tau_ref, s, (n_rows,) each; exact until they are rounded to float64."""
    known: dict[tuple[float, float, float], tuple[float, float]] = {}
    out = np.empty((len(start), 2))
    for row, key in enumerate(zip(start.tolist(), carrier.tolist(), reference.tolist(), strict=True)):
        if key not in known:
            delay = 2 * Fraction(key[2]) / LIGHT
            known[key] = float(Fraction(key[1]) * delay % 1), float(Fraction(key[0]) - delay)
        out[row] = known[key]
    return out[:, 0], out[:, 1]


def _by_rows(samples: Any, n: int, spectra: Callable[[np.ndarray, slice], np.ndarray]) -> np.ndarray:
    """The spectra (n_rows, n) of samples that are read in blocks of rows, complex128 where these are of 64 bits."""
    given = np.dtype(samples.dtype)
    single = given.kind in "iu" or given.itemsize <= (8 if given.kind == "c" else 4)
    out = np.empty((len(samples), n), np.complex64 if single else np.complex128)
    step = max(1, BLOCK // samples.shape[1])
    for a in range(0, len(samples), step):
        block = np.asarray(samples[a : a + step])
        validation.finite("samples", block, first_row=a)
        out[a : a + step] = spectra(block.astype(np.complex128), slice(a, a + step))
    return validation.sealed(out)
