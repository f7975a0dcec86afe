"""Ambiguity functions: response of a waveform's matched filter to a delayed and Doppler-shifted echo."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..base import validation
from ..base.text import size_text

ROWS = 64  # delays per FFT call: bounds the memory
MOST_BYTES = 4e9  # largest size of an ambiguity function


@dataclass(frozen=True, eq=False)
class Ambiguity:
    """|chi| (n_delays, n_dopplers), 1 at the origin, at evenly spaced, increasing delays, s, and Doppler shifts, Hz.

    >>> chi = sarcl.ambiguity(np.ones(64), rate=64e6)
    >>> chi.magnitude.shape, round(float(chi.volume), 3)
    ((127, 128), 1.0)
    >>> float(chi.delay_of_peak()[64])  # s, without Doppler shift
    0.0
    """

    delays: NDArray[np.float64]
    dopplers: NDArray[np.float64]
    magnitude: NDArray[np.float64]

    @property
    def volume(self) -> float:
        """Integral of |chi|^2 over delay and Doppler: 1 for every waveform if neither axis was limited."""
        cell = np.diff(self.delays[:2]).sum() * np.diff(self.dopplers[:2]).sum()
        return float((self.magnitude**2).sum() * cell)

    def delay_of_peak(self) -> np.ndarray:
        """Delay of the peak at each Doppler shift, s (n_dopplers,): range-Doppler coupling."""
        return np.asarray(self.delays[self.magnitude.argmax(axis=0)])


def ambiguity(
    signal: ArrayLike, rate: float, *, max_delay: float | None = None, max_doppler: float | None = None
) -> Ambiguity:
    """|chi(tau, nu)| = |integral of s(t - tau) conj(s(t)) exp(+j 2 pi nu t) dt|/integral of |s|^2, by FFT.

    signal       complex samples s (n,) at `rate` Hz;  delays are whole samples, Doppler shifts rate/(2 n) or less apart
    max_delay    s, largest |delay| that is returned; None: the length of the pulse
    max_doppler  Hz, largest |Doppler shift| that is returned; None: half the rate, which must be high enough for that

    A chirp of rate K has its ridge along nu = + K tau. Source: Farooq 2009, equations 4.22, 4.23 (without the square).

    >>> times = np.arange(-128, 128) / 256e6
    >>> chi = sarcl.ambiguity(np.exp(1j * np.pi * 100e12 * times**2), rate=256e6, max_delay=5e-8)
    >>> chi.magnitude.shape
    (25, 512)
    """
    from scipy import fft

    s = validation.array("signal", signal, np.complex128, ("n",))
    rate = validation.number("rate", rate, above=0)
    n = len(s)
    largest = max(np.abs(s.real).max(), np.abs(s.imag).max())
    if largest == 0:
        raise ValueError("signal is zero everywhere; it must carry energy")
    s = s / largest  # so that squares neither overflow nor vanish
    energy = float((np.abs(s) ** 2).sum())
    length = fft.next_fast_len(2 * n)
    lags = np.arange(1 - n, n)
    if max_delay is not None:
        lags = lags[np.abs(lags) <= validation.number("max_delay", max_delay, least=0) * rate * (1 + 1e-12)]
    dopplers = fft.fftshift(fft.fftfreq(length, 1 / rate))
    in_band = np.ones(length, bool)
    if max_doppler is not None:
        in_band = np.abs(dopplers) <= validation.number("max_doppler", max_doppler, least=0) * (1 + 1e-12)
    need = 8.0 * len(lags) * int(in_band.sum())
    if need > MOST_BYTES:
        raise MemoryError(f"the ambiguity of {n} samples takes {size_text(need)}; give max_delay and max_doppler")
    out = np.empty((len(lags), int(in_band.sum())))
    padded = np.concatenate([np.zeros(n - 1), s, np.zeros(n - 1)])
    late = np.lib.stride_tricks.sliding_window_view(padded, n)  # row n - 1 - lag is s(t - lag)
    for i in range(0, len(lags), ROWS):
        products = late[n - 1 - lags[i : i + ROWS]] * s.conj()
        spectra = fft.fftshift(fft.ifft(products, length, axis=1), axes=1) * length
        out[i : i + ROWS] = np.abs(spectra[:, in_band]) / energy
    return Ambiguity(validation.sealed(lags / rate), validation.sealed(dopplers[in_band]), validation.sealed(out))
