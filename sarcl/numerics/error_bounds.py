"""Error formulas: numbers in, numbers out. Every bound is a worst case, relative, and small errors add.

docs/theory/accuracy.md derives each; tests/numerics/test_accuracy.py measures each.
"""

from __future__ import annotations

import numpy as np

from ..base.constants import SPEED_OF_LIGHT

U32 = 2.0**-24  # unit roundoff of float32
# Root mean square of what rounding turns to float32 (twice) and the sine and cosine polynomials add, rad.
ANGLE = 3e-7


def phase_rounding(radius: float, frequency: float, wide: bool) -> float:
    """Phase error, rad, of differential ranges in float32 over a tile.

    radius     largest distance of a point from its tile's reference, m
    frequency  largest carrier, Hz
    wide       the linear term is computed in wide numbers; only its curvature stays float32
    Five roundings (three products, the series, the product with kappa) of at most u each, on a range of at most
    `radius`; ANGLE is added.
    """
    turns = 2 * frequency / SPEED_OF_LIGHT * radius
    return (0.0 if wide else 2 * np.pi * turns * 5 * U32) + ANGLE


def place_rounding(radius: float, bandwidth: float, wide: bool) -> float:
    """Phase error, rad, at the band's edge from rounding the place among samples; as `phase_rounding`."""
    turns = bandwidth / SPEED_OF_LIGHT * radius
    return 0.0 if wide else 2 * np.pi * turns * 6 * U32


def series_error(radius: float, distance: float, frequency: float, order: int) -> float:
    """Phase error, rad, of the range series cut after `order` (2 or 3; 0 is exact) for points within `radius`.

    The first term left out is a w/(2 R^2) for order 2 and w (4 a^2 - w)/(8 R^3) for order 3, with a^2 + w <= radius^2.
    """
    if order == 0:
        return 0.0
    if distance <= 2 * radius:
        return np.inf
    k = 4 * np.pi * frequency / SPEED_OF_LIGHT
    ratio = radius / distance
    rest = 1 / (1 - ratio)  # the later terms, as a geometric series
    if order == 2:
        return k * radius * 0.193 * ratio**2 * rest
    return k * radius * 0.125 * ratio**3 * rest


def curvature_rounding(radius: float, distance: float, frequency: float) -> float:
    """Phase error, rad, of the float32 curvature term, at most radius^2/(2 distance) with four roundings."""
    k = 4 * np.pi * frequency / SPEED_OF_LIGHT
    return k * min(radius**2 / (2 * max(distance, 1e-300)), radius) * 4 * U32


def root_rounding(radius: float, distance: float, frequency: float) -> float:
    """Phase error, rad, of the exact root in float32 near an antenna.

    What lies across the line of sight is |p|^2 - a^2, rounded to 3 u |p|^2, over a range of at least `distance`.
    """
    k = 4 * np.pi * frequency / SPEED_OF_LIGHT
    return k * 3 * U32 * radius**2 / max(distance, 1e-300)


def range_error(radius: float, distance: float, frequency: float, bandwidth: float, mode: int, order: int) -> float:
    """Phase error, rad, of differential ranges in range mode 0, 1 or 2 of kernels/range_phase.clh."""
    if mode == 2:
        return phase_rounding(0.0, frequency, True)
    error = phase_rounding(radius, frequency, mode == 1) + place_rounding(radius, bandwidth, mode == 1)
    error += series_error(radius, distance, frequency, order)
    if order == 0:
        error += root_rounding(radius, distance, frequency)
    return error + (curvature_rounding(radius, distance, frequency) if mode == 1 else 0.0)


def sum_rounding(n_chunk: int, length: int) -> float:
    """Relative rms error of a float32 sum of n_chunk terms, of complex64 samples and of their FFT of `length`."""
    return U32 * (np.sqrt(n_chunk) / 4 + 1.5 * np.sqrt(np.log2(max(length, 2))) + 1)
