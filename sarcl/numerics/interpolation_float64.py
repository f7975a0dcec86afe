"""Kaiser-Bessel interpolation kernels for range profiles in float64: their weights, transforms and largest errors."""

from __future__ import annotations

import functools
from dataclasses import dataclass

import numpy as np

TAPS = (4, 6, 8, 10, 12, 14)
TERMS = (3, 4, 5, 6, 7)
OVERSAMPLE = (1.5, 2, 2.5, 3, 4, 5, 6, 8, 12, 16)
LONGEST = 2**18  # samples of a profile that is oversampled to spare taps


@dataclass(frozen=True, eq=False)
class Kernel:
    """Interpolation by `taps` samples for profiles `oversample` times finer than 1/bandwidth.

    table   coefficients (taps/2, 2, terms) float64 as backproject_float64.cl has them: in y = 2 z, even and odd powers
    error   largest relative error at any frequency in the band and any place between samples
    """

    taps: int
    oversample: float
    table: np.ndarray
    error: float

    @property
    def terms(self) -> int:
        """Coefficients of each half of a tap's polynomial."""
        return int(self.table.shape[-1])

    @property
    def edge_gain(self) -> float:
        """By how much deconvolution raises the band's edge over its middle."""
        middle, edge = self.transform(np.array([0, 0.5 / self.oversample]))
        return float(middle / edge)

    def weights(self, z: np.ndarray) -> np.ndarray:
        """Weights of all taps at z in [-1/2, 1/2]: (..., taps)."""
        return _weights(self.table, z)

    def transform(self, nu: np.ndarray) -> np.ndarray:
        """Fourier transform of the kernel at nu cycles a sample; spectra are divided by it."""
        return _transform(self.table, nu)


@functools.cache
def cheapest_kernel(taps: int, oversample: float) -> Kernel:
    """The kernel with the fewest terms that errs little more than with many."""
    best = kernel(taps, oversample, TERMS[-1])
    return next(k for k in (kernel(taps, oversample, t) for t in TERMS) if k.error <= 1.3 * best.error + 1e-15)


@functools.cache
def kernel(taps: int, oversample: float, terms: int) -> Kernel:
    """A Kaiser-Bessel kernel as polynomials of 2 terms coefficients, deconvolved: a type-2 nonuniform FFT in range.

    Its shape is pi taps (1 - 1/(2 oversample)), the transform's edge at the first alias. What is deconvolved is
    the transform of the polynomials themselves, so their fit costs only what it aliases.
    """
    table = _kaiser_bessel(taps, oversample, terms)
    nu = np.linspace(0, 0.5 / oversample, 17)
    z = np.linspace(-0.5, 0.5, 65)
    # what the taps make of exp(j 2 pi nu t), over what they should
    place = np.arange(taps) - (taps - 1) / 2
    waves = np.exp(2j * np.pi * nu[:, None, None] * (place - z[:, None]))
    made = (waves * _weights(table, z)).sum(axis=-1) / _transform(table, nu)[:, None]
    return Kernel(taps, oversample, table, float(np.abs(made - 1).max()))


def _kaiser_bessel(taps: int, oversample: float, terms: int) -> np.ndarray:
    from scipy.special import i0e

    beta = np.pi * taps * (1 - 0.5 / oversample)
    y = np.cos(np.pi * (np.arange(48) + 0.5) / 48)  # Chebyshev points: a fit near minimax
    out = np.empty((taps // 2, 2, terms))
    for k in range(taps // 2):
        x = (y + taps - 1 - 2 * k) / taps
        root = np.sqrt(np.maximum(1 - x * x, 0))
        psi = i0e(beta * root) * np.exp(beta * (root - 1)) / i0e(beta)
        power = np.polynomial.chebyshev.cheb2poly(np.polynomial.chebyshev.chebfit(y, psi, 2 * terms - 1))
        out[k] = power[0::2], power[1::2]
    return out


def _weights(table: np.ndarray, z: np.ndarray) -> np.ndarray:
    y = 2 * np.asarray(z, np.float64)
    powers = (y[..., None] ** 2) ** np.arange(table.shape[-1])
    even, odd = (np.tensordot(powers, table[:, i], axes=(-1, -1)) for i in (0, 1))
    odd = odd * y[..., None]
    return np.concatenate([even + odd, (even - odd)[..., ::-1]], axis=-1)


def _transform(table: np.ndarray, nu: np.ndarray) -> np.ndarray:
    """Integral of the kernel times cos(2 pi nu x), by Gauss-Legendre over each tap's stretch."""
    taps = 2 * len(table)
    x, gauss = np.polynomial.legendre.leggauss(20)
    z = x / 2
    distance = (z[:, None] + (taps - 1) / 2 - np.arange(taps)).ravel()
    weights = (_weights(table, z) * (gauss / 2)[:, None]).ravel()
    return np.cos(2 * np.pi * np.asarray(nu, np.float64)[..., None] * distance) @ weights
