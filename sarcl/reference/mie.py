"""Scattering by a conducting sphere, by Mie's series."""

from __future__ import annotations

import numpy as np
from scipy.special import spherical_jn, spherical_yn


def conducting_sphere(radius: float, k: float, angle: np.ndarray | float = np.pi) -> np.ndarray:
    """Echo amplitudes of a sphere at wavenumber k, its centre at zero phase: complex128 (2, *angle.shape), m.

    angle  between the directions of travel of the incident and the scattered wave, rad; pi: back to the transmitter
    First for electric fields across the plane of both directions, which keep their sense; then for fields in that
    plane, along (unit vector across) x direction, so that at pi both senses are opposite. |a|^2 = RCS, m^2. The phase
    is that of physical optics: monostatic a -> -j sqrt(pi) radius exp(2j k radius) for k radius -> infinity.
    Source: C. F. Bohren and D. R. Huffman, Absorption and Scattering of Light by Small Particles (1983), (4.47), (4.53)
    for an infinite index, (4.74); their time dependence exp(-j omega t) is conjugated.
    """
    x, cosine = k * radius, np.cos(np.asarray(angle))
    n = np.arange(1, int(x + 4.05 * x ** (1 / 3) + 20))
    psi = x * spherical_jn(n, x)
    slope = spherical_jn(n, x) + x * spherical_jn(n, x, derivative=True)
    xi = psi + 1j * x * spherical_yn(n, x)
    xi_slope = slope + 1j * (spherical_yn(n, x) + x * spherical_yn(n, x, derivative=True))
    a, b = slope / xi_slope, psi / xi
    across, along = np.zeros(cosine.shape, complex), np.zeros(cosine.shape, complex)
    before, pi_n = np.zeros_like(cosine), np.ones_like(cosine)
    for m in n:
        tau_n = m * cosine * pi_n - (m + 1) * before
        across += (2 * m + 1) / (m * (m + 1)) * (a[m - 1] * pi_n + b[m - 1] * tau_n)
        along += (2 * m + 1) / (m * (m + 1)) * (a[m - 1] * tau_n + b[m - 1] * pi_n)
        before, pi_n = pi_n, ((2 * m + 1) * cosine * pi_n - (m + 1) * before) / m
    return np.asarray(2 * np.sqrt(np.pi) / k * np.conj(np.stack([across, along])))
