"""Two looks of an image along the track: their correlation, and how a wrong velocity displaces them."""

from __future__ import annotations

import numpy as np


def correlation(first: np.ndarray, second: np.ndarray, lag: float) -> float:
    """Sum over rows n and columns of first[n] second[n + lag], both float (rows, columns) less their columns' means.

    lag, rows, need not be whole: the second look, zero beyond its ends, is read by its Fourier sum.
    """
    n = len(first)
    a, b = (np.pad(look - look.mean(axis=0), ((0, n), (0, 0))) for look in (first, second))
    frequencies = np.fft.fftfreq(2 * n)
    moved = np.fft.ifft(np.fft.fft(b, axis=0) * np.exp(2j * np.pi * frequencies * lag)[:, None], axis=0).real
    return float((a * moved).sum())


def displacement(
    assumed: float, true: float, distance: float, wavelength: float, doppler: tuple[float, float]
) -> float:
    """Second look less first look, s, of a point at closest range `distance`, m, along a straight line.

    assumed, true  velocities, m/s;  doppler  Hz (2,), of the looks' middles. A processor puts echoes of Doppler
    frequency q, received at time t, to the time t + h at which its own range sqrt(r^2 + v^2 h^2) has that frequency.
    """

    def ahead(speed: float, q: float) -> float:
        h = np.linspace(-distance, distance, 200_001) / speed  # within 45 degrees of broadside
        return float(np.interp(q, 2 / wavelength * speed**2 * h / np.sqrt(distance**2 + (speed * h) ** 2), h))

    first, second = (ahead(assumed, q) - ahead(true, q) for q in doppler)
    return second - first
