"""Error formulas of float64 backprojection: numbers in, numbers out. Every bound is a worst case, and errors add.

docs/theory/accuracy.md derives each; tests/imaging/test_precise.py measures each.
"""

from __future__ import annotations

import numpy as np

from ..base.constants import SPEED_OF_LIGHT

U64 = 2.0**-53  # unit roundoff of float64
# Phase, rad, that rounding turns to [-1/2, 1/2] and the sine and cosine polynomials add.
ANGLE = 2e-14
# Largest |P_(n-2) - P_n|/(2n - 1): the n-th term of the range series over rho (rho/R)^(n - 1), for n = 3, 4, 5; later
# ones are smaller.
SERIES = {2: 0.193, 3: 0.125, 4: 0.0824}


def phase_rounding(radius: float, frequency: float) -> float:
    """Phase error, rad, of differential ranges in float64 over a tile of `radius` m, for at most `frequency` Hz.

    Offset, direction, three products, series or quotient, and the product with kappa (for the place among samples:
    with sigma) are together at most 10 u on a range of at most `radius`; ANGLE is added.
    """
    return 4 * np.pi * frequency / SPEED_OF_LIGHT * radius * 10 * U64 + ANGLE


def series_error(radius: float, distance: float, frequency: float, order: int) -> float:
    """Phase error, rad, of the range series cut after `order` (2, 3 or 4) for points within `radius` m; 0: no series.

    The terms of |T - x| are R C_n (rho/R)^n, C_n the Gegenbauer polynomials of index -1/2: (P_(n-2) - P_n)/(2n - 1).
    """
    if order == 0:
        return 0.0
    ratio = radius / distance
    k = 4 * np.pi * frequency / SPEED_OF_LIGHT
    return k * radius * SERIES[order] * ratio**order / (1 - ratio)  # the later terms as a geometric series


def range_error(radius: float, distance: float, frequency: float, order: int) -> float:
    """Phase error, rad, of paths in a tile of `radius` m, no antenna nearer than `distance` m; orders as of the plan.

    Infinite where an antenna is so near that differences from the tile's reference would cancel. Order -1 is pairs
    of float64, whose error is beyond float64 for any path below 1e12 m.
    """
    if order < 0:
        return ANGLE
    if distance <= 2 * radius:
        return np.inf
    return phase_rounding(radius, frequency) + series_error(radius, distance, frequency, order)


def sum_rounding(n_chunk: int, length: int, gain: float) -> float:
    """Relative rms error of float64 sums of n_chunk terms and of the FFT of `length`.

    gain  by how much deconvolution raises the band's edge over its middle: what the FFT's rounding is raised by
    """
    return U64 * (np.sqrt(n_chunk) + 2 * gain * np.sqrt(np.log2(max(length, 2))) + 4)


def darkness(cells: float, chance: float = 1e-6) -> float:
    """By how much a row's energy may exceed what `cells` places of it see, with that chance for noise.

    Interpolation errs with a row's energy, the contract is relative to what the pixels see. Over many resolution
    cells the two are alike; a single one may lie where noise is dark: the mean of `cells` squared moduli is
    gamma distributed.
    """
    from scipy.special import gammaincinv

    return float(1 / np.sqrt(gammaincinv(cells, chance) / cells))
