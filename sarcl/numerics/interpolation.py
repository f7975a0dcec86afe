"""Short interpolation kernels for range profiles in float32 and float64: weights, transforms, errors.

docs/theory/accuracy.md derives the errors; tests/numerics/test_accuracy.py measures them.
"""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import DTypeLike

from .polynomials import chebyshev

MARGIN = 1.06  # factor on errors that are taken on a grid of frequencies and positions
# Polynomial terms of each half (even, odd) of a tap's weight, by taps: the error of the fit is below the kernel's.
TERMS = {2: 1, 4: 4, 6: 5, 8: 6}
FITS = 12  # of the polynomials with as few terms as taps allow: their error no longer falls
# The same for lines of pixels, whose weights are not deconvolved.
LINE_TERMS = {2: 2, 4: 3, 6: 4, 8: 5}
FLOAT64_TERMS = (3, 4, 5, 6, 7)  # in float64 each kernel takes as few of these as its error allows


@dataclass(frozen=True, eq=False)
class Interpolator:
    """An interpolation kernel of `taps` samples for profiles `oversample` times finer than 1/bandwidth.

    table   coefficients (taps/2, 2, terms) as kernels/interp.clh reads them, in the number type of the profiles
    error   largest relative error at any frequency in the band and any position between samples
    """

    taps: int
    oversample: float
    table: np.ndarray
    error: float

    @property
    def dtype(self) -> np.dtype[Any]:
        """The number type of the profiles: float32 or float64."""
        return self.table.dtype

    @property
    def terms(self) -> int:
        """Coefficients of each half of a tap's polynomial."""
        return int(self.table.shape[-1])

    @property
    def edge_gain(self) -> float:
        """Factor by which deconvolution raises the band's edge over its middle."""
        middle, edge = self.transform(np.array([0, 0.5 / self.oversample]))
        return float(middle / edge)

    def weights(self, z: np.ndarray) -> np.ndarray:
        """Weights of all taps at z in [-1/2, 1/2]: (..., taps), float64."""
        return _weights(self.table, z)

    def transform(self, nu: np.ndarray) -> np.ndarray:
        """Fourier transform of the kernel at nu cycles per sample; spectra are divided by it."""
        return _transform(self.table, nu)


def interpolator(taps: int, oversample: float) -> Interpolator:
    """The interpolation kernel for float32 profiles: the hat (2 taps) or a Kaiser-Bessel kernel."""
    return deconvolved(taps, oversample, TERMS[taps])


@functools.cache
def interpolator_float64(taps: int, oversample: float) -> Interpolator:
    """The interpolation kernel for float64 profiles: as few terms as bring its error near that of many."""
    best = deconvolved(taps, oversample, FLOAT64_TERMS[-1], np.float64)
    candidates = (deconvolved(taps, oversample, terms, np.float64) for terms in FLOAT64_TERMS)
    return next(candidate for candidate in candidates if candidate.error <= 1.3 * best.error + 1e-15)


@functools.lru_cache(maxsize=1024)
def deconvolved(taps: int, oversample: float, terms: int, dtype: DTypeLike = np.float32) -> Interpolator:
    """The hat (2 taps) or a Kaiser-Bessel kernel, deconvolved: a type-2 nonuniform FFT in range.

    The Kaiser-Bessel shape is pi taps (1 - 1/(2 oversample)), the transform's edge at the first alias. Spectra are
    divided by the transform of the polynomials themselves, so that the error of their fit is that of its aliases alone.
    """
    table = HAT if taps == 2 else _kaiser_bessel(taps, oversample, terms)
    return _of_table(table.astype(dtype), oversample)


def _of_table(table: np.ndarray, oversample: float) -> Interpolator:
    """The interpolation kernel of a table, whose transform spectra are divided by."""
    nu = np.linspace(0, 0.5 / oversample, 33)
    return Interpolator(2 * len(table), oversample, table, _largest_error(table, nu, _transform(table, nu)))


@functools.lru_cache(maxsize=256)
def fitted(taps: int, oversample: float) -> Interpolator:
    """The interpolation kernel of taps/2 terms with the smallest mean square error in the band, for float32 profiles.

    Polynomials of degree taps - 1, fitted together with the transform by which spectra are divided: each step fits the
    polynomials to waves times the transform of those before, beginning with the Kaiser-Bessel kernel.
    """
    if taps == 2:
        return interpolator(taps, oversample)
    terms = taps // 2
    nu = 0.5 / oversample * np.cos(np.pi * (np.arange(40) + 0.5) / 80)  # denser at the band's edge, where errors are
    z = 0.5 * np.cos(np.pi * (np.arange(24) + 0.5) / 48)[:, None]
    powers = z ** (2 * np.arange(terms))
    angle = 2 * np.pi * nu[:, None] * _positions(taps)[: taps // 2]
    wave = 2 * np.pi * nu * z
    table = _kaiser_bessel(taps, oversample, terms)
    for _ in range(FITS):
        correction = _transform(table, nu) / _transform(table, np.zeros(1))
        halves = (np.cos(angle), powers, np.cos(wave)), (np.sin(angle), powers * z, np.sin(wave))
        for i, (turns, parts, target) in enumerate(halves):
            # waves of taps k and taps - 1 - k together: (z, nu, tap, term)
            waves = 2 * (turns / correction[:, None])[:, :, None] * parts[:, None, None, :]
            coefficients = np.linalg.lstsq(waves.reshape(target.size, -1), target.ravel(), rcond=None)[0]
            table[:, i] = coefficients.reshape(taps // 2, terms)
    return _of_table(table.astype(np.float32), oversample)


def lower_bound(taps: int, oversample: float) -> float:
    """A lower bound on the error of `interpolator`, known before its table: most candidates need no table.

    The kernel's transform at the first alias of the band's edge, over that at the edge itself: of the hat
    (nu/(1 - nu))^2 with nu = 1/(2 oversample), of a Kaiser-Bessel kernel s/sinh(s), s = pi taps sqrt(1 - 1/oversample).
    """
    if taps == 2:
        return float(1 / (2 * oversample - 1) ** 2)
    s = np.pi * taps * np.sqrt(1 - 1 / oversample)
    return float(s / np.sinh(s))


def fitted_lower_bound(taps: int, oversample: float) -> float:
    """A lower bound on the error of `fitted`, as `lower_bound`.

    The even part approximates cos(w z), |z| <= 1/2, w = pi/oversample at the band's edge, by a polynomial of degree
    n - 1, n = taps. The error of the best is at least the smallest n-th derivative, w^n cos(w/2), over n!, times 2/4^n,
    the largest value of the smallest monic polynomial of degree n (de la Vallee Poussin; Chebyshev).
    """
    if taps == 2:
        return lower_bound(taps, oversample)
    w = np.pi / oversample
    return float(2 * (w / 4) ** taps / math.factorial(taps) * np.cos(w / 2))


@functools.lru_cache(maxsize=4096)  # searches of plans ask for the same spacings again and again
def line_interpolator(taps: int, oversample: float) -> Interpolator:
    """Least-squares weights between samples `oversample` times finer than 1/bandwidth, without deconvolution.

    For profiles whose sample spacing differs from pulse to pulse, so that no one spectrum could be corrected.
    """
    steps = 2.0 ** (np.floor(8 * np.log2(min(oversample, 64.0))) / 8)  # few tables serve all spacings
    return _least_squares(taps, float(steps))


@functools.lru_cache(maxsize=256)
def slope_error(kernel: Interpolator) -> float:
    """Largest error of the weights' derivatives by position, over the derivative at the band's edge."""
    z, nu = np.linspace(-0.5, 0.5, 65), np.linspace(0, 0.5 / kernel.oversample, 33)
    waves = np.exp(2j * np.pi * nu[:, None, None] * (_positions(kernel.taps) - z[:, None]))
    slopes = (waves * _slopes(kernel.table, z)).sum(axis=-1)
    exact = 2j * np.pi * nu[:, None]
    return MARGIN * float(np.abs(slopes - exact).max() / np.abs(exact).max())


@functools.lru_cache(maxsize=256)
def _least_squares(taps: int, oversample: float) -> Interpolator:
    z = chebyshev(0, 1, 48)
    weights = least_squares_weights(taps, oversample, z).T
    w, mirrored = weights[: taps // 2], weights[: taps // 2 - 1 : -1]  # w_{taps-1-k}(z) = w_k(-z)
    table = _fitted(z, (w + mirrored) / 2, (w - mirrored) / 2, LINE_TERMS[taps]).astype(np.float32)
    nu = np.linspace(0, 0.5 / oversample, 33)
    return Interpolator(taps, oversample, table, _largest_error(table, nu, np.ones(len(nu))))


def least_squares_weights(taps: int, oversample: float, z: np.ndarray) -> np.ndarray:
    """Weights (n, taps) of the best interpolation at z (n,) of signals below 1/(2 oversample) cycles per sample."""
    nu = 0.5 / oversample * np.cos(np.pi * (np.arange(40) + 0.5) / 80)  # denser at the band's edge, where errors are
    angle, phase = 2 * np.pi * nu[:, None] * _positions(taps), 2 * np.pi * nu[:, None] * z
    waves = np.concatenate([np.cos(angle), np.sin(angle)])
    return np.linalg.lstsq(waves, np.concatenate([np.cos(phase), np.sin(phase)]), rcond=None)[0].T


HAT = np.array([[[0.5], [-1.0]]])  # the table of the hat: weights 1/2 - z and 1/2 + z


def _kaiser_bessel(taps: int, oversample: float, terms: int) -> np.ndarray:
    beta = np.pi * taps * (1 - 0.5 / oversample)
    z = chebyshev(0, 1, 200)  # a fit at them is near minimax

    def psi(z: np.ndarray) -> np.ndarray:
        x = 2 * (z + (taps - 1) / 2 - np.arange(taps // 2)[:, None]) / taps
        return np.asarray(np.i0(beta * np.sqrt(np.maximum(1 - x * x, 0))) / np.i0(beta))

    w, mirrored = psi(z), psi(-z)
    # the odd part over z, times z: so the last bits of float32 tables are those of earlier versions
    return _fitted(z, (w + mirrored) / 2, (w - mirrored) / (2 * z) * z, terms)


def _fitted(z: np.ndarray, even: np.ndarray, odd: np.ndarray, terms: int) -> np.ndarray:
    """Coefficients (taps/2, 2, terms) of weights whose even and odd parts at z (n,) are given, (taps/2, n) each."""
    powers = (z[:, None] ** 2) ** np.arange(terms)
    out = np.empty((len(even), 2, terms))
    for k in range(len(even)):
        out[k, 0] = np.linalg.lstsq(powers, even[k], rcond=None)[0]
        out[k, 1] = np.linalg.lstsq(powers * z[:, None], odd[k], rcond=None)[0]
    return out


def _positions(taps: int) -> np.ndarray:
    """Positions of the taps in samples, from the middle of all."""
    return np.arange(taps) - (taps - 1) / 2


def _weights(table: np.ndarray, z: np.ndarray) -> np.ndarray:
    powers = (z[..., None] ** 2) ** np.arange(table.shape[-1])
    even, odd = (np.tensordot(powers, table[:, i].astype(np.float64), axes=(-1, -1)) for i in (0, 1))
    odd = odd * z[..., None]
    return np.concatenate([even + odd, (even - odd)[..., ::-1]], axis=-1)


def _slopes(table: np.ndarray, z: np.ndarray) -> np.ndarray:
    """Derivatives of `_weights` by z."""
    n = np.arange(table.shape[-1])
    z = z[..., None]
    even = np.tensordot(2 * n * z ** np.maximum(2 * n - 1, 0), table[:, 0].astype(np.float64), axes=(-1, -1))
    odd = np.tensordot((2 * n + 1) * z ** (2 * n), table[:, 1].astype(np.float64), axes=(-1, -1))
    return np.concatenate([even + odd, (even - odd)[..., ::-1]], axis=-1)


def _largest_error(table: np.ndarray, nu: np.ndarray, transform: np.ndarray) -> float:
    """Largest error of exp(j 2 pi nu t) interpolated by a table, relative, at any nu and position."""
    z = np.linspace(-0.5, 0.5, 65)
    waves = np.exp(2j * np.pi * nu[:, None, None] * (_positions(2 * len(table)) - z[:, None]))
    interpolated = (waves * _weights(table, z)).sum(axis=-1) / transform[:, None]
    return MARGIN * float(np.abs(interpolated - 1).max())


@functools.cache
def _gauss(n: int) -> tuple[np.ndarray, np.ndarray]:
    """n nodes and weights of Gauss-Legendre quadrature over [-1/2, 1/2]."""
    nodes, weights = np.polynomial.legendre.leggauss(n)
    return nodes / 2, weights / 2


def _transform(table: np.ndarray, nu: np.ndarray) -> np.ndarray:
    """Integral of the kernel times cos(2 pi nu x), by quadrature over each tap's stretch."""
    nu = np.asarray(nu, np.float64)
    if len(table) == 1:
        return np.sinc(nu) ** 2
    z, gauss = _gauss(12 if np.abs(nu).max(initial=0.0) <= 1 else 24)
    kernel = _weights(table, z) * gauss[:, None]
    taps = 2 * len(table)
    distance = z[:, None] + (taps - 1) / 2 - np.arange(taps)
    waves = np.cos(2 * np.pi * nu[..., None, None] * distance)
    return np.asarray((waves * kernel).sum(axis=(-1, -2)))
