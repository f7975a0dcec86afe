"""Scattering by a sphere, by Mie's series.

Both functions give echo amplitudes at wavenumber k, the sphere's centre at zero phase: complex128 (2, *angle.shape), m.

angle  between the directions of travel of the incident and the scattered wave, rad; pi: back to the transmitter

First for electric fields across the plane of both directions, which keep their sense; then for fields in that plane,
along (unit vector across) x direction, so that at pi both senses are opposite. |a|^2 = RCS, m^2. The phase is that of
physical optics: a conductor's monostatic a -> -j sqrt(pi) radius exp(2j k radius) for k radius -> infinity.

Source: C. F. Bohren and D. R. Huffman, Absorption and Scattering of Light by Small Particles (1983), (4.47), (4.52),
(4.53), (4.74); their time dependence exp(-j omega t) is conjugated.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.special import spherical_jn, spherical_yn


def conducting_sphere(radius: float, k: float, angle: np.ndarray | float = np.pi) -> np.ndarray:
    """Amplitudes of a perfect conductor."""
    psi, slope, xi, xi_slope = _riccati(k * radius)
    return _amplitudes(slope / xi_slope, psi / xi, k, angle)


def dielectric_sphere(radius: float, k: float, permittivity: complex, angle: np.ndarray | float = np.pi) -> np.ndarray:
    """Amplitudes of a sphere of a relative permittivity eps' - j eps''."""
    m = np.conj(np.sqrt(complex(permittivity)))
    psi, slope, xi, xi_slope = _riccati(k * radius)
    n = np.arange(1, len(psi) + 1)
    inner = m * k * radius * spherical_jn(n, m * k * radius)
    inner_slope = spherical_jn(n, m * k * radius) + m * k * radius * spherical_jn(n, m * k * radius, derivative=True)
    a = (m * inner * slope - psi * inner_slope) / (m * inner * xi_slope - xi * inner_slope)
    b = (inner * slope - m * psi * inner_slope) / (inner * xi_slope - m * xi * inner_slope)
    return _amplitudes(a, b, k, angle)


def _riccati(x: float) -> tuple[Any, Any, Any, Any]:
    """psi_n = x j_n(x), its derivative, xi_n = x h_n(x), its derivative, for n = 1, 2, ... as far as they matter."""
    n = np.arange(1, int(x + 4.05 * x ** (1 / 3) + 20))
    psi = x * spherical_jn(n, x)
    slope = spherical_jn(n, x) + x * spherical_jn(n, x, derivative=True)
    xi = psi + 1j * x * spherical_yn(n, x)
    return psi, slope, xi, slope + 1j * (spherical_yn(n, x) + x * spherical_yn(n, x, derivative=True))


def _amplitudes(a: np.ndarray, b: np.ndarray, k: float, angle: np.ndarray | float) -> np.ndarray:
    cosine = np.cos(np.asarray(angle))
    across, along = np.zeros(cosine.shape, complex), np.zeros(cosine.shape, complex)
    before, pi_n = np.zeros_like(cosine), np.ones_like(cosine)
    for m in range(1, len(a) + 1):
        tau_n = m * cosine * pi_n - (m + 1) * before
        across += (2 * m + 1) / (m * (m + 1)) * (a[m - 1] * pi_n + b[m - 1] * tau_n)
        along += (2 * m + 1) / (m * (m + 1)) * (a[m - 1] * tau_n + b[m - 1] * pi_n)
        before, pi_n = pi_n, ((2 * m + 1) * cosine * pi_n - (m + 1) * before) / m
    return np.asarray(2 * np.sqrt(np.pi) / k * np.conj(np.stack([across, along])))
