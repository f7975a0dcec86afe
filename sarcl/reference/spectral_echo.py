"""The steps of a spectral echo, term by term: kernels/spectral_echo.cl, and the sum that they compute together."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

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


class Coordinates(NamedTuple):
    """Places (n_u, n_f) that `migrate` reads: first tap and rest on the grid, cycles, a table's cell and rest."""

    first: np.ndarray
    rest: np.ndarray
    cycles: np.ndarray
    cell: np.ndarray
    cell_rest: np.ndarray


def migrate(
    grid: np.ndarray, coordinates: Coordinates, tables: np.ndarray, basis: np.ndarray, kernel: Interpolator
) -> np.ndarray:
    """y(u, f), complex128 (n_u, n_f), of a grid (n_u, n_range), and tables whose basis is (n_tables, n_f)."""
    first, rest, cycles, cell, cell_rest = coordinates
    n_range, rows = grid.shape[1], np.arange(len(grid))[:, None]
    weights, profile = kernel.weights(rest), np.zeros(first.shape, np.complex128)
    for t in range(kernel.taps):
        profile += weights[..., t] * grid[rows, (first + t) % n_range]
    profile /= kernel.transform((first + rest + (kernel.taps - 1) / 2) / n_range)
    table = np.einsum("qf,qn->fn", basis, tables)
    shares = lagrange(np.array([-1.0, 0, 1, 2]), cell_rest.ravel()).reshape(4, *cell.shape)
    amplitude = sum(shares[i] * table[np.arange(len(table)), np.maximum(cell, 0) + i] for i in range(4))
    return np.asarray(np.where(cell < 0, 0, amplitude * profile * np.exp(2j * np.pi * cycles)))


class EdgeScatterers(NamedTuple):
    """Scatterers (n,): amplitude b, azimuth and slant range, m, and the pulse at which a beam's edge passes."""

    amplitude: np.ndarray
    azimuth: np.ndarray
    slant_range: np.ndarray
    pulse: np.ndarray


def beam_edge(
    scatterers: EdgeScatterers,
    side: int,
    places: np.ndarray,
    weight: Callable[[np.ndarray], np.ndarray],
    wavenumber: float,
    middle_range: float,
) -> np.ndarray:
    """Samples at places on the track, m (n_p,), of scatterers seen from their pulse on, up to it if side is -1.

    sum_k b_k weight(s) exp(-j 2 k (R - r_c)), complex128 (n_p,);  k the wavenumber, rad/m, r_c the middle range, m
    """
    lag = places[:, None] - scatterers.azimuth
    distance = np.hypot(lag, scatterers.slant_range)
    is_seen = side * (np.arange(len(places))[:, None] - scatterers.pulse) >= 0
    wave = np.exp(-2j * wavenumber * (distance - middle_range)) * weight((lag / distance).ravel()).reshape(lag.shape)
    return np.asarray((wave * is_seen) @ scatterers.amplitude)


class SarasNumbers(NamedTuple):
    """Numbers of SARAS, equations (28) to (30); chi is the Doppler centroid over 2 a^2."""

    a2: float
    b2: float
    eps: float
    gamma2: float
    beta_r: float
    chi: float


def saras_transfer(
    xi: np.ndarray, eta: np.ndarray, numbers: SarasNumbers, pattern: Callable[[np.ndarray], np.ndarray]
) -> np.ndarray:
    """G of SARAS, equations (26) and (27), with d = 1; the azimuth terms have the sign of a numerical transform.

    xi, eta  normalised as in (28) to (30);  pattern  w^2
    """
    a2, b2, eps, gamma2, beta_r, chi = numbers
    coupling = 1 + eps * eta / (2 * b2)
    root = np.sqrt(coupling - 1.5 * gamma2 * xi**2 / (4 * a2**2))
    phase = -(eta**2) / (4 * b2) + chi * xi + xi**2 * (1 + beta_r) / (4 * a2 * coupling)
    return np.asarray(pattern(-(2 * chi * a2 + xi) / (2 * a2)) * np.sqrt(1 + beta_r) / root * np.exp(1j * phase))
