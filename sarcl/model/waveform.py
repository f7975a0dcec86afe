"""Waveforms: the spectrum of the transmitted pulse and of its matched filter."""

from __future__ import annotations

import functools
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..base import validation

NEAR_PEAK = 0.98  # ratio to the largest sample of a spectrum: lower samples lie by no higher peak
MOST_PEAKS = 16  # peaks of a spectrum that are examined
ORDERS = 13  # terms of the power series about a peak: the next is below 1e-15
Kind = Literal["chirp", "down-chirp", "tone", "sampled"]


@dataclass(frozen=True, eq=False)
class Waveform:
    """A transmitted pulse, complex baseband about `center`. Build one with `chirp`, `tone` or `sampled`.

    center     carrier, Hz
    bandwidth  width of the band in which echoes are sampled, Hz: [center - bandwidth/2, center + bandwidth/2]
    duration   length of the pulse, s
    kind       "chirp", "down-chirp" (its frequency falls), "tone" or "sampled"
    signal     complex baseband samples (n,), kind "sampled" only;  rate  their sampling rate, Hz

    The pulse is centred on t = 0. Raises ValueError when a value is not finite or positive, or the band reaches 0 Hz.

    >>> chirp = sarcl.Waveform.chirp(center=9.6e9, bandwidth=300e6, duration=1e-6)
    >>> chirp.sweep_rate, abs(chirp.matched_spectrum(np.array([9.6e9])))
    (300000000000000.0, array([1.]))
    >>> tone = sarcl.Waveform.tone(center=9.6e9, duration=1e-6)
    >>> code = sarcl.Waveform.sampled(np.repeat([1, 1, 1, -1, 1], 8), rate=400e6, center=9.6e9)  # Barker, 5 chips
    >>> tone.pulse_spectrum(np.array([9.6e9, 9.601e9])).round(2)
    array([1.+0.j, 0.+0.j])
    """

    center: float
    bandwidth: float
    duration: float
    kind: Kind
    signal: NDArray[np.complex128] | None = None
    rate: float | None = None

    if TYPE_CHECKING:  # types of the arguments; the fields above have the types after conversion

        def __init__(
            self,
            center: float,
            bandwidth: float,
            duration: float,
            kind: Kind,
            signal: ArrayLike | None = None,
            rate: float | None = None,
        ) -> None: ...

    def __post_init__(self) -> None:
        object.__setattr__(self, "center", validation.carrier("waveform center", self.center))
        for name in ("bandwidth", "duration"):
            object.__setattr__(self, name, validation.number(f"waveform {name}", getattr(self, name), above=0))
        validation.choice("waveform kind", self.kind, ("chirp", "down-chirp", "tone", "sampled"))
        if self.bandwidth >= 2 * self.center:
            raise ValueError(
                f"waveform bandwidth {self.bandwidth:g} Hz about center {self.center:g} Hz reaches "
                "0 Hz; the band must stay positive: raise center or lower bandwidth"
            )
        if self.kind == "sampled":
            signal = validation.array("waveform signal", self.signal, np.complex128, ("n",))
            if not signal.any():
                raise ValueError("waveform signal is zero everywhere; it must carry energy")
            object.__setattr__(self, "signal", signal)
            object.__setattr__(self, "rate", validation.number("waveform rate", self.rate, above=0))
        elif self.signal is not None or self.rate is not None:
            raise ValueError(
                f"waveform signal and rate go with kind 'sampled', not {self.kind!r}; use Waveform.sampled"
            )

    @classmethod
    def chirp(cls, *, center: float, bandwidth: float, duration: float, down: bool = False) -> Waveform:
        """Linear frequency modulation, rate bandwidth/duration; its matched spectrum is 1 in the band.

        down  True: the frequency falls, at the same rate; bandwidth is positive then too
        """
        if not isinstance(down, (bool, np.bool_)):
            raise TypeError(f"down is {down!r}; give True for a frequency that falls, else False")
        if validation.number("waveform bandwidth", bandwidth) < 0:
            raise ValueError(
                f"waveform bandwidth is {bandwidth:g}; it must be greater than 0: for a chirp whose frequency falls "
                f"give bandwidth={-bandwidth:g}, down=True"
            )
        return cls(center, bandwidth, duration, "down-chirp" if down else "chirp")

    @classmethod
    def tone(cls, *, center: float, duration: float, bandwidth: float | None = None) -> Waveform:
        """A rectangular pulse of one frequency; its matched spectrum is sinc^2((f - center) duration).

        bandwidth is the sampled band, default 4/duration: the main lobe and one side lobe on each side.
        """
        duration = validation.number("waveform duration", duration, above=0)
        return cls(center, 4 / duration if bandwidth is None else bandwidth, duration, "tone")

    @classmethod
    def sampled(cls, signal: ArrayLike, rate: float, center: float) -> Waveform:
        """A pulse given by complex baseband samples (n,) at `rate`, Hz; its bandwidth is `rate`."""
        signal = validation.array("waveform signal", signal, np.complex128, ("n",))
        rate = validation.number("waveform rate", rate, above=0)
        return cls(center, rate, len(signal) / rate, "sampled", signal, rate)

    def pulse_spectrum(self, frequency: ArrayLike) -> np.ndarray:
        """Spectrum P of the pulse at `frequency` Hz (n,), complex128, largest modulus 1.

        A chirp has its stationary-phase form exp(-j pi (f - fc)^2 duration/bandwidth), of modulus 1 in the
        band and 0 outside; a down-chirp has the conjugate.
        """
        f = validation.values("frequency", frequency) - self.center
        if self.sweep_rate is not None:
            is_inside = np.abs(f) <= self.bandwidth / 2 * (1 + 1e-12)
            f = np.clip(f, -self.bandwidth, self.bandwidth)  # squares of frequencies far outside would overflow
            spectrum = np.exp(-1j * np.pi * f**2 * (self.duration / self.bandwidth)) * is_inside
            return np.conj(spectrum) if self.kind == "down-chirp" else spectrum
        if self.kind == "tone":
            return np.sinc(f * self.duration).astype(np.complex128)
        return self._sampled_spectrum(f) / self._sampled_peak

    @property
    def sweep_rate(self) -> float | None:
        """Rate of the frequency of a chirp, Hz/s, negative for a down-chirp; None for other waveforms."""
        if self.kind not in ("chirp", "down-chirp"):
            return None
        rate = self.bandwidth / self.duration
        return rate if self.kind == "chirp" else -rate

    @property
    def peak_energy_density(self) -> float:
        """Largest |integral of p(t) exp(-j 2 pi f t) dt|^2, s^2, of the pulse p of peak modulus 1.

        duration/bandwidth of a chirp (its stationary-phase spectrum), duration^2 of a tone.
        """
        if self.sweep_rate is not None:
            return self.duration / self.bandwidth
        if self.kind == "tone":
            return self.duration**2
        assert self.rate is not None
        return float((self._sampled_peak / np.abs(self._unit).max() / self.rate) ** 2)

    def matched_spectrum(self, frequency: ArrayLike) -> NDArray[np.float64]:
        """Spectrum W = |P|^2 after the matched filter at `frequency` Hz (n,), float64, peak 1."""
        return np.abs(self.pulse_spectrum(frequency)) ** 2

    def _sampled_spectrum(self, f: np.ndarray) -> np.ndarray:
        """sum_m signal_m exp(-j 2 pi f t_m), t_m centred on 0; computed in blocks, which bounds the memory."""
        assert self.signal is not None and self.rate is not None
        t = (np.arange(len(self.signal)) - (len(self.signal) - 1) / 2) / self.rate
        out = np.empty(f.shape, np.complex128)
        step = max(1, 2**22 // len(t))
        for i in range(0, f.size, step):
            out.flat[i : i + step] = np.exp(-2j * np.pi * np.outer(f.ravel()[i : i + step], t)) @ self._unit
        return out

    @property
    def _unit(self) -> np.ndarray:
        """The signal over its largest real or imaginary part, so that sums of huge values do not overflow."""
        assert self.signal is not None
        return self.signal / max(np.abs(self.signal.real).max(), np.abs(self.signal.imag).max())

    @functools.cached_property
    def _sampled_peak(self) -> float:
        """Largest modulus of the signal's spectrum."""
        return _largest_modulus(self._unit)


def _largest_modulus(signal: np.ndarray) -> float:
    """Largest |sum_n s_n exp(-2 pi j n x)| of all x, for signals (n,).

    An FFT samples it 8 times as finely as its length requires: at most 2 % are between, cos(pi/16). About each of the
    largest samples the sum is a power series over a step to either side, whose phases are at most pi/8.
    """
    n = len(signal)
    level = np.abs(np.fft.fft(signal, 8 * n))
    top = np.flatnonzero(
        (level >= NEAR_PEAK * level.max()) & (level >= np.roll(level, 1)) & (level >= np.roll(level, -1))
    )
    largest = float(level.max())
    turn = -2j * np.pi / (8 * n) * (np.arange(n) - (n - 1) / 2)
    for number in top[np.argsort(-level[top])][:MOST_PEAKS]:
        term, series = signal * np.exp(number * turn), []
        for order in range(ORDERS):
            series.append(term.sum())
            term = term * turn / (order + 1)
        x, width = 0.0, 1.0
        for _ in range(4):
            steps = x + width * np.linspace(-1, 1, 65)
            values = np.abs(np.polynomial.polynomial.polyval(steps, series))
            x, width = float(steps[int(values.argmax())]), width / 32
            largest = max(largest, float(values.max()))
    return largest
