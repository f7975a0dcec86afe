"""Samples by time of arrival (TOA) as samples by frequency (FX), and back. Both have the phase of SGN = -1.

A point of amplitude a at the delay D after the reference point gives (NGA.STND.0068-1, Global/SGN)

    FX    S(f) = a exp(-j 2 pi f D)                                    FX1 <= f <= FX2
    TOA   s(t) = a sinc(B (t - D)) exp(-j 2 pi fc D)                   B = FX2 - FX1, fc = (FX1 + FX2)/2

The second is the inverse Fourier transform of the first about fc, divided by B,

    s(t) = 1/B int S(f) exp(+j 2 pi (f - fc) t) df

so that, of N samples at t_i = t_0 + i dt,

    S(f) = B dt sum_i s(t_i) exp(-j 2 pi (f - fc) t_i)

The frequencies are f_k = fc + (k - (K - 1)/2)/(N dt), k = 0 ... K - 1, with K the least number that covers B.
"""

from __future__ import annotations

import numpy as np

MARGIN = 1e-6  # of a frequency step, by which a band may exceed a number of steps: rounding of its limits in float64


def n_frequencies(bandwidth: np.ndarray, times: np.ndarray) -> int:
    """K: frequencies that cover the bands, Hz (n,), of records that last `times`, s (n,)."""
    return max(1, int(np.ceil((bandwidth * times).max() - MARGIN)))


def baseband(n: int, step: np.ndarray) -> np.ndarray:
    """Frequencies f_k - fc, Hz (n_rows, n), of steps in Hz (n_rows,)."""
    return (np.arange(n) - (n - 1) / 2) * step[:, None]


def spectra(samples: np.ndarray, first: np.ndarray, step: np.ndarray, bandwidth: np.ndarray, n: int) -> np.ndarray:
    """S (n_rows, n) of s (n_rows, N) in TOA.

    first, step  t_0 and dt, s (n_rows,);  bandwidth  B, Hz (n_rows,)
    """
    n_times = samples.shape[1]
    lowest = np.exp(1j * np.pi * (n - 1) * np.arange(n_times) / n_times)  # mixes the lowest frequency to 0
    transform = np.fft.fft(samples * lowest, axis=1)[:, :n]
    delay = np.exp(-2j * np.pi * baseband(n, 1 / (n_times * step)) * first[:, None])
    return np.asarray(transform * delay * (bandwidth * step)[:, None])


def records(spectrum: np.ndarray, frequency_step: np.ndarray, advance: np.ndarray, n_times: int) -> np.ndarray:
    """s (n_rows, n_times) in TOA of S (n_rows, n): as long as the spectrum determines, 1/frequency_step, s.

    s(t_i) = 1/n sum_k S(f_k) exp(+j 2 pi (f_k - fc) t_i);  advance  s (n_rows,), of sample n_times//2
    """
    n = spectrum.shape[1]
    first = advance - n_times // 2 / (n_times * frequency_step)
    shifted = spectrum * np.exp(2j * np.pi * baseband(n, frequency_step) * first[:, None])
    lowest = np.exp(-1j * np.pi * (n - 1) * np.arange(n_times) / n_times)
    return np.asarray(np.fft.ifft(shifted, n_times, axis=1) * lowest * (n_times / n))
