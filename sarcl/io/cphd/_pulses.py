"""Compressed spectra as records of a received chirp, and back.

A point of amplitude a at the delay tau gives, relative to the delay tau_ref of a reference,

    S(f) = a exp(-j 2 pi f (tau - tau_ref))

An antenna that sends exp(j pi K t^2), |t| < T/2, on the carrier fc receives of it a chirp of modulus |a|, mixed with
exp(-j 2 pi fc (t - tau_ref)). Its spectrum is that of S, by the principle of stationary phase, times

    P(g) = exp(-j pi g^2/K) exp(+-j pi/4)/sqrt(|K|)        g = f - fc; the sign of pi/4 is that of K

The spectrum S, of N frequencies df apart, determines the profile c(u), u = t - tau_ref, on an interval of 1/df:

    c(u) = df sum_k S(f_k) exp(j 2 pi (f_k - fc) u)

There it has samples at the rate Fs; zeros before and after it, as many as the pulse has samples, leave the pulse room.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

MARGIN = 1e-6  # samples, by which the pulse may exceed a number of them: rounding of its length in float64


@dataclass(frozen=True, eq=False)
class Records:
    """Records of one channel; arrays have one entry per row.

    rate, n         of the samples: Hz, and how many
    pulse           T, s;  sweep  K, Hz/s
    start           of sample 0 after the reference delay, s
    offset          of the lowest frequency of the spectrum from the carrier, Hz
    """

    rate: float
    n: int
    pulse: float
    sweep: float
    start: np.ndarray
    offset: np.ndarray

    @property
    def n_zeros(self) -> int:
        """Samples of the pulse."""
        return int(np.ceil(self.pulse * self.rate - MARGIN))

    @property
    def n_profile(self) -> int:
        """Samples of the profile; their number over the rate is 1/df."""
        return self.n - self.n_zeros

    @property
    def step(self) -> float:
        """df, Hz."""
        return self.rate / self.n_profile

    def received(self, spectra: np.ndarray, rows: slice) -> np.ndarray:
        """Records (k, n) of spectra (k, N) of some rows."""
        mixer, advance = self._phases(spectra.shape[1], rows)
        profile = np.fft.ifft(spectra * advance, self.n_profile, axis=1) * mixer * self.rate
        before = self.n_zeros // 2
        padded = np.pad(profile, ((0, 0), (before, self.n_zeros - before)))
        return np.asarray(np.fft.ifft(np.fft.fft(padded, axis=1) * self._chirp, axis=1))

    def compressed(self, records: np.ndarray, rows: slice, n: int) -> np.ndarray:
        """Spectra (k, n) of records (k, self.n) of some rows."""
        mixer, advance = self._phases(n, rows)
        first = self.n_zeros // 2
        profile = np.fft.ifft(np.fft.fft(records, axis=1) / self._chirp, axis=1)[:, first : first + self.n_profile]
        return np.asarray(np.fft.fft(profile * mixer.conj(), axis=1)[:, :n] * advance.conj() / self.rate)

    @property
    def _chirp(self) -> np.ndarray:
        g = np.fft.fftfreq(self.n, 1 / self.rate)
        constant = np.exp(1j * np.pi / 4 * np.sign(self.sweep)) / np.sqrt(abs(self.sweep))
        return np.asarray(constant * np.exp(-1j * np.pi * g**2 / self.sweep))

    def _phases(self, n: int, rows: slice) -> tuple[np.ndarray, np.ndarray]:
        """What mixes the lowest frequency to 0 (k, n_profile), and delays spectra to the profile's start (k, n)."""
        offset = self.offset[rows, None]
        mixer = np.exp(2j * np.pi * offset / self.rate * np.arange(self.n_profile))
        first = self.start[rows, None] + self.n_zeros // 2 / self.rate
        return mixer, np.exp(2j * np.pi * (offset + self.step * np.arange(n)) * first)
