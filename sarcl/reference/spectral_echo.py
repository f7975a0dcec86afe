"""The steps of a spectral echo, term by term: kernels/spectral_echo.cl, and the sum that they compute together."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ..numerics.interpolation import Interpolator
from ..numerics.polynomials import lagrange


def map_spectrum(
    amplitudes: np.ndarray, azimuth: np.ndarray, offset: np.ndarray, u: np.ndarray, kappa: np.ndarray
) -> np.ndarray:
    """sum_k b_k exp(-j u x_k - j kappa (r_k - r_c)) at wavenumbers u and kappa (n,): complex128 (n,)."""
    return np.asarray(np.exp(-1j * (np.outer(u, azimuth) + np.outer(kappa, offset))) @ amplitudes)


def spread(
    amplitudes: np.ndarray, first: np.ndarray, rest: np.ndarray, kernel: Interpolator, shape: tuple[int, int]
) -> np.ndarray:
    """Scatterers (n,) over TAPS x TAPS cells from `first` (n, 2) on, on a grid complex128 whose columns repeat."""
    out = np.zeros(shape, np.complex128)
    weights = kernel.weights(rest)
    for i in range(kernel.taps):
        for j in range(kernel.taps):
            at = first[:, 0] + i, (first[:, 1] + j) % shape[1]
            np.add.at(out, at, amplitudes * weights[:, 0, i] * weights[:, 1, j])
    return out


def migrate(
    grid: np.ndarray, first: np.ndarray, rest: np.ndarray, cycles: np.ndarray, cell: np.ndarray, cell_rest: np.ndarray,
    tables: np.ndarray, basis: np.ndarray, kernel: Interpolator,
) -> np.ndarray:  # fmt: skip
    """y(u, f), complex128 (n_u, n_f), of a grid (n_u, n_range); coordinates (n_u, n_f), basis (n_tables, n_f)."""
    n_range, rows = grid.shape[1], np.arange(len(grid))[:, None]
    weights, made = kernel.weights(rest), np.zeros(first.shape, np.complex128)
    for t in range(kernel.taps):
        made += weights[..., t] * grid[rows, (first + t) % n_range]
    made /= kernel.transform((first + rest + (kernel.taps - 1) / 2) / n_range)
    table = np.einsum("qf,qn->fn", basis, tables)
    shares = lagrange(np.array([-1.0, 0, 1, 2]), cell_rest.ravel()).reshape(4, *cell.shape)
    amplitude = sum(shares[i] * table[np.arange(len(table)), np.maximum(cell, 0) + i] for i in range(4))
    return np.asarray(np.where(cell < 0, 0, amplitude * made * np.exp(2j * np.pi * cycles)))


def beam_edge(
    amplitudes: np.ndarray, azimuth: np.ndarray, slant_range: np.ndarray, first: np.ndarray, side: int,
    places: np.ndarray, weight: Callable[[np.ndarray], np.ndarray], wavenumber: float, middle_range: float,
) -> np.ndarray:  # fmt: skip
    """Samples at places on the track, m (n_p,), of scatterers seen from pulse `first` (n,) on, up to it if side is -1.

    sum_k b_k weight(s) exp(-j 2 k (R - r_c)), complex128 (n_p,);  k the wavenumber, rad/m, r_c the middle range, m
    """
    lag = places[:, None] - azimuth
    distance = np.hypot(lag, slant_range)
    seen = side * (np.arange(len(places))[:, None] - first) >= 0
    wave = np.exp(-2j * wavenumber * (distance - middle_range)) * weight((lag / distance).ravel()).reshape(lag.shape)
    return np.asarray((wave * seen) @ amplitudes)


def saras_transfer(
    xi: np.ndarray, eta: np.ndarray, a2: float, b2: float, eps: float, gamma2: float, beta_r: float, chi: float,
    pattern: Callable[[np.ndarray], np.ndarray],
) -> np.ndarray:  # fmt: skip
    """G of SARAS, equations (26) and (27), with d = 1; the azimuth terms have the sign of a numerical transform.

    Variables are normalised as in (28) to (30): chi is the Doppler centroid over 2 a^2, pattern is w^2.
    """
    coupling = 1 + eps * eta / (2 * b2)
    root = np.sqrt(coupling - 1.5 * gamma2 * xi**2 / (4 * a2**2))
    phase = -(eta**2) / (4 * b2) + chi * xi + xi**2 * (1 + beta_r) / (4 * a2 * coupling)
    return np.asarray(pattern(-(2 * chi * a2 + xi) / (2 * a2)) * np.sqrt(1 + beta_r) / root * np.exp(1j * phase))
