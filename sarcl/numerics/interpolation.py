"""Short interpolation kernels for range profiles in float32: weights, transforms, largest errors, cheapest choice.

docs/theory/accuracy.md derives the errors; tests/numerics/test_accuracy.py measures them.
"""

from __future__ import annotations

import functools
from dataclasses import dataclass

import numpy as np

from ..base.errors import ToleranceUnreachable
from ..base.tolerances import rounded_up
from . import cost_model

MARGIN = 1.06  # of errors that are taken on a grid of frequencies and places
OVERSAMPLE = (1.5, 2, 2.5, 3, 4, 5, 6, 8, 10, 12, 16, 20, 24, 32, 48, 64)
LONGEST = 2**18  # samples of a profile that is oversampled to spare taps
# Polynomial terms of each half (even, odd) of a tap's weight: enough that the fit errs less than the kernel.
TERMS = {2: 1, 4: 4, 6: 5, 8: 6}
# The same for lines of pixels, whose weights are not deconvolved.
LINE_TERMS = {2: 2, 4: 3, 6: 4, 8: 5}


@dataclass(frozen=True, eq=False)
class Interpolator:
    """A kernel of `taps` samples for profiles `oversample` times finer than 1/bandwidth.

    table   coefficients (taps/2, 2, terms) float32 as kernels/interp.clh reads them
    error   largest relative error at any frequency in the band and any place between samples
    """

    taps: int
    oversample: float
    table: np.ndarray
    error: float

    def weights(self, z: np.ndarray) -> np.ndarray:
        """Weights of all taps at z in [-1/2, 1/2]: (..., taps), float64."""
        return _weights(self.taps, self.table, z)

    def transform(self, nu: np.ndarray) -> np.ndarray:
        """Fourier transform of the kernel at nu cycles a sample; spectra are divided by it."""
        return _transform(self.taps, self.table, nu)


@functools.lru_cache(maxsize=256)
def interpolator(taps: int, oversample: float) -> Interpolator:
    """The hat (2 taps) or a Kaiser-Bessel kernel, deconvolved: a type-2 nonuniform FFT in range.

    The Kaiser-Bessel shape is pi taps (1 - 1/(2 oversample)), the transform's edge at the first alias.
    """
    table = np.zeros((1, 2, 1), np.float32) if taps == 2 else _kaiser_bessel(taps, oversample)
    nu = np.linspace(0, 0.5 / oversample, 33)
    z = np.linspace(-0.5, 0.5, 65)
    # what the taps make of exp(j 2 pi nu t), over what they should: worst at the band's edge
    place = np.arange(taps) - (taps - 1) / 2
    waves = np.exp(2j * np.pi * nu[:, None, None] * (place - z[:, None]))
    made = (waves * _weights(taps, table, z)).sum(axis=-1) / _transform(taps, table, nu)[:, None]
    return Interpolator(taps, oversample, table, MARGIN * float(np.abs(made - 1).max()))


def line_interpolator(taps: int, oversample: float) -> Interpolator:
    """Least-squares weights between samples `oversample` times finer than 1/bandwidth, without deconvolution.

    For profiles whose sample spacing differs from pulse to pulse, so that no one spectrum could be corrected.
    """
    steps = 2.0 ** (np.floor(8 * np.log2(min(oversample, 64.0))) / 8)  # few tables serve all spacings
    return _least_squares(taps, float(steps))


@functools.lru_cache(maxsize=256)
def _least_squares(taps: int, oversample: float) -> Interpolator:
    terms = LINE_TERMS[taps]
    z = np.cos(np.pi * (np.arange(48) + 0.5) / 48) / 2
    weights = least_squares_weights(taps, oversample, z)
    powers = (z[:, None] ** 2) ** np.arange(terms)
    out = np.empty((taps // 2, 2, terms))
    for k in range(taps // 2):
        mirrored = weights[:, taps - 1 - k]  # w_{taps-1-k}(z) = w_k(-z)
        out[k, 0] = np.linalg.lstsq(powers, (weights[:, k] + mirrored) / 2, rcond=None)[0]
        out[k, 1] = np.linalg.lstsq(powers * z[:, None], (weights[:, k] - mirrored) / 2, rcond=None)[0]
    table = out.astype(np.float32)
    nu = np.linspace(0, 0.5 / oversample, 33)
    z = np.linspace(-0.5, 0.5, 65)
    waves = np.exp(2j * np.pi * nu[:, None, None] * (np.arange(taps) - (taps - 1) / 2 - z[:, None]))
    made = (waves * _polynomials(table, z)).sum(axis=-1)
    return Interpolator(taps, oversample, table, MARGIN * float(np.abs(made - 1).max()))


def least_squares_weights(taps: int, oversample: float, z: np.ndarray) -> np.ndarray:
    """Weights (n, taps) that interpolate best at z (n,) what has no frequency above 1/(2 oversample) a sample."""
    place = np.arange(taps) - (taps - 1) / 2
    nu = 0.5 / oversample * np.cos(np.pi * (np.arange(40) + 0.5) / 80)  # denser at the band's edge, where errors are
    angle, wanted = 2 * np.pi * nu[:, None] * place, 2 * np.pi * nu[:, None] * z
    waves = np.concatenate([np.cos(angle), np.sin(angle)])
    return np.linalg.lstsq(waves, np.concatenate([np.cos(wanted), np.sin(wanted)]), rcond=None)[0].T


def _kaiser_bessel(taps: int, oversample: float) -> np.ndarray:
    beta = np.pi * taps * (1 - 0.5 / oversample)
    terms = TERMS[taps]
    z = np.cos(np.pi * (np.arange(200) + 0.5) / 200) / 2  # Chebyshev points: a fit near minimax
    out = np.empty((taps // 2, 2, terms))
    for k in range(taps // 2):

        def psi(z: np.ndarray, k: int = k) -> np.ndarray:
            x = 2 * (z + (taps - 1) / 2 - k) / taps
            return np.i0(beta * np.sqrt(np.maximum(1 - x * x, 0))) / np.i0(beta)

        even, odd = (psi(z) + psi(-z)) / 2, (psi(z) - psi(-z)) / (2 * z)
        powers = (z[:, None] ** 2) ** np.arange(terms)
        out[k, 0] = np.linalg.lstsq(powers, even, rcond=None)[0]
        out[k, 1] = np.linalg.lstsq(powers * z[:, None], odd * z, rcond=None)[0]
    return out.astype(np.float32)


def _weights(taps: int, table: np.ndarray, z: np.ndarray) -> np.ndarray:
    if taps == 2:
        return np.stack([0.5 - z, 0.5 + z], axis=-1)
    return _polynomials(table, z)


def _polynomials(table: np.ndarray, z: np.ndarray) -> np.ndarray:
    powers = (z[..., None] ** 2) ** np.arange(table.shape[-1])
    even, odd = (np.tensordot(powers, table[:, i].astype(np.float64), axes=(-1, -1)) for i in (0, 1))
    odd = odd * z[..., None]
    return np.concatenate([even + odd, (even - odd)[..., ::-1]], axis=-1)


def _transform(taps: int, table: np.ndarray, nu: np.ndarray) -> np.ndarray:
    """Integral of the kernel times cos(2 pi nu x), by Gauss-Legendre over each tap's stretch."""
    nu = np.asarray(nu, np.float64)
    if taps == 2:
        return np.sinc(nu) ** 2
    x, gauss = np.polynomial.legendre.leggauss(12)
    z = x / 2
    distance = z[:, None] + (taps - 1) / 2 - np.arange(taps)
    kernel = _weights(taps, table, z) * (gauss / 2)[:, None]
    waves = np.cos(2 * np.pi * nu[..., None, None] * distance)
    return (waves * kernel).sum(axis=(-1, -2))


@functools.lru_cache(maxsize=256)
def _candidates(n_samples: int, carrier: float) -> tuple[tuple[int, float, int], ...]:
    """Taps, oversampling and profile length of every interpolator for rows of n_samples."""
    from ..opencl import fft

    out = []
    for taps in TERMS:
        for oversample in OVERSAMPLE:
            # one sample has no bandwidth, but a profile of a few samples keeps its taps apart
            # and an even length puts delay 0 on a sample
            length = 2 * fft.good_length(max(int(np.ceil(oversample * n_samples / 2)), 2 * taps))
            while not off_carrier(length, carrier):
                length = 2 * fft.good_length(length // 2 + 1)
            if length <= max(LONGEST, 2 * n_samples * taps):
                out.append((taps, float(oversample), length))
    return tuple(out)


def lower_bound(taps: int, oversample: float) -> float:
    """A lower bound on the error of `interpolator`, known before its table: most candidates need no table.

    The kernel's transform at the first alias of the band's edge, over that at the edge itself: of the hat
    (nu/(1 - nu))^2 with nu = 1/(2 oversample), of a Kaiser-Bessel kernel s/sinh(s), s = pi taps sqrt(1 - 1/oversample).
    """
    if taps == 2:
        return float(1 / (2 * oversample - 1) ** 2)
    s = np.pi * taps * np.sqrt(1 - 1 / oversample)
    return float(s / np.sinh(s))


@functools.lru_cache(maxsize=256)
def least_error(n_samples: int, carrier: float = 0.0) -> float:
    """The smallest error that `choose_interpolator` can meet, for rows of n_samples."""
    least = np.inf
    for bound, taps, oversample in sorted((lower_bound(t, s), t, s) for t, s, _ in _candidates(n_samples, carrier)):
        if bound < least:
            least = min(least, interpolator(taps, oversample).error)
    return least


@functools.lru_cache(maxsize=4096)
def choose_interpolator(
    error: float, n_samples: int, pairs_per_row: float, carrier: float = 0.0
) -> tuple[Interpolator, int, float]:
    """The cheapest interpolator whose error is at most `error`, the profile length it needs, and its cost.

    The cost of a contribution is in units of one with the hat; making profiles is counted in.

    n_samples      of a row before oversampling
    pairs_per_row  contributions read from a row: they weigh taps against the length of the FFT
    carrier        centre frequency in steps between samples, for scatterers that lie evenly: see off_carrier
    The choice never depends on memory, so that results do not.
    ToleranceUnreachable names the smallest error there is when none is small enough.
    """

    def cost(candidate: tuple[int, float, int]) -> float:
        taps, _, length = candidate
        return pairs_per_row * cost_model.TAPS[taps] + cost_model.profile(length)

    for taps, oversample, length in sorted(_candidates(n_samples, carrier), key=cost):
        if lower_bound(taps, oversample) <= error:
            made = interpolator(taps, oversample)
            if made.error <= error:
                return made, length, cost((taps, oversample, length)) / pairs_per_row
    least = rounded_up(least_error(n_samples, carrier))
    raise ToleranceUnreachable(error, least, "interpolation of float32 range profiles")


def off_carrier(length: int, carrier: float) -> bool:
    """Whether no image of a kernel, one profile rate from the next, lies within a quarter of that from the carrier.

    There scatterers that lie evenly, as the pieces of a plate, all add up, however they cancel at the carrier itself.
    """
    images = carrier / length
    return abs(images - max(round(images), 1)) >= 0.25
