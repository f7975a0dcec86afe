"""Error formulas: numbers in, numbers out. Every bound is a worst case, relative, and small errors add.

docs/theory/accuracy.md derives each; tests/numerics/test_accuracy.py and tests/imaging/test_float64.py measure each.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..base.constants import SPEED_OF_LIGHT


@dataclass(frozen=True)
class NumberType:
    """Rounding in one number type, as the kernels compute in it.

    unit       unit roundoff
    angle      phase error, rad, of the reduction to [-1/2, 1/2] cycles and of the sine and cosine polynomials
    roundings  units of a differential range, and of its product with the wavenumber: so many roundings at most
    sums       units of a sum: per square root of its terms, per square root of the FFT's doublings, and in any case
    """

    unit: float
    angle: float
    roundings: int
    sums: tuple[float, float, float]


# Five roundings: three products, the series, the product with kappa. The angle is the root mean square.
FLOAT32 = NumberType(2.0**-24, 3e-7, 5, (0.25, 1.5, 1.0))
# Offset, direction, three products, series or quotient and the product with kappa are together at most 10 units.
FLOAT64 = NumberType(2.0**-53, 2e-14, 10, (1.0, 2.0, 4.0))
# Largest |P_(n-2) - P_n|/(2n - 1): the n-th term of the range series over rho (rho/R)^(n - 1), for n = 3, 4, 5; later
# ones are smaller.
SERIES = {2: 0.193, 3: 0.125, 4: 0.0824}


def phase_rounding(radius: float, frequency: float, wide: bool = False, number: NumberType = FLOAT32) -> float:
    """Phase error, rad, of differential ranges over a tile.

    radius     largest distance of a point from its tile's reference, m
    frequency  largest carrier, Hz
    wide       the linear term is computed in wide numbers; only its curvature stays in `number`
    """
    cycles = 2 * frequency / SPEED_OF_LIGHT * radius
    return (0.0 if wide else 2 * np.pi * cycles * number.roundings * number.unit) + number.angle


def coordinate_rounding(farthest: float, frequency: float) -> float:
    """Phase error, rad, root mean square over pixels, of a plane whose coordinates reach `farthest`, m.

    A pixel's position and its tile's reference are each the sum of three float64 numbers: four roundings per
    coordinate, of spacing/sqrt(12) each. The kernels add exact offsets to the reference.
    """
    return float(4 * np.pi * frequency / SPEED_OF_LIGHT * np.spacing(farthest) / np.sqrt(3))


def position_rounding(radius: float, bandwidth: float, wide: bool) -> float:
    """Phase error, rad, at the band's edge from rounding positions among samples in float32; as `phase_rounding`."""
    cycles = bandwidth / SPEED_OF_LIGHT * radius
    return 0.0 if wide else 2 * np.pi * cycles * 6 * FLOAT32.unit


def two_part_position_rounding(radius: float, distance: float, bandwidth: float) -> float:
    """Phase error, rad, at the band's edge where steps of a line are products of whole numbers and two float32 parts.

    Only fractions of a sample of the range profile and of the line's profile are rounded, by four units each; the
    band's edge is at most half a cycle per sample. The curvature, at most radius^2/(2 distance), is rounded as any
    position.
    """
    bend = min(radius**2 / (2 * max(distance, 1e-300)), radius)
    return 2 * 4 * np.pi * FLOAT32.unit + position_rounding(bend, bandwidth, False)


def two_part_steps(radius: float, frequency: float) -> tuple[float, float]:
    """Steps of the high parts of kappa u, cycles/m, and of offsets, m, in range mode 3: powers of two.

    Products of high parts are multiples of the product of both steps, and their sum is at most kappa radius, with what
    rounding the parts adds: 2^24 of them at most, so that float32 sums are exact. Both low parts matter alike.
    """
    kappa = 2 * frequency / SPEED_OF_LIGHT
    radius = max(radius, 1e-3 / kappa)  # that of one point is 0
    both = np.ceil(np.log2(1.01 * kappa * radius)) - 24
    offset = np.round((both + np.log2(radius / kappa)) / 2)
    return float(2.0 ** (both - offset)), float(2.0**offset)


def two_part_rounding(radius: float, frequency: float) -> float:
    """Phase error, rad, of the linear term in two parts: range mode 3.

    What the products of high parts leave over is at most sqrt(3)/2 (direction's step x radius + kappa x offset's step),
    in cycles, with eight roundings of float32.
    """
    steep, offset = two_part_steps(radius, frequency)
    cycles = np.sqrt(0.75) * (steep * radius + 2 * frequency / SPEED_OF_LIGHT * offset)
    return float(2 * np.pi * cycles * 8 * FLOAT32.unit)


def series_error(radius: float, distance: float, frequency: float, order: int) -> float:
    """Phase error, rad, of the range series cut after `order` (2, 3 or 4; 0 is exact) for points within `radius` m.

    The terms of |T - x| are R C_n (rho/R)^n, C_n the Gegenbauer polynomials of index -1/2: (P_(n-2) - P_n)/(2n - 1).
    Infinite where the nearest antenna, `distance` m off, is no farther than twice the radius.
    """
    if order == 0:
        return 0.0
    if distance <= 2 * radius:
        return np.inf
    k = 4 * np.pi * frequency / SPEED_OF_LIGHT
    ratio = radius / distance
    rest = 1 / (1 - ratio)  # the later terms, as a geometric series
    return k * radius * SERIES[order] * ratio**order * rest


def curvature_rounding(radius: float, distance: float, frequency: float) -> float:
    """Phase error, rad, of the float32 curvature term, at most radius^2/(2 distance) with four roundings."""
    k = 4 * np.pi * frequency / SPEED_OF_LIGHT
    return k * min(radius**2 / (2 * max(distance, 1e-300)), radius) * 4 * FLOAT32.unit


def root_rounding(radius: float, distance: float, frequency: float) -> float:
    """Phase error, rad, of the exact root in float32 near an antenna.

    The square across the line of sight is |p|^2 - a^2, rounded to 3 u |p|^2, over a range of at least `distance`.
    """
    k = 4 * np.pi * frequency / SPEED_OF_LIGHT
    return k * 3 * FLOAT32.unit * radius**2 / max(distance, 1e-300)


def range_error(radius: float, distance: float, frequency: float, bandwidth: float, mode: int, order: int) -> float:
    """Phase error, rad, of differential ranges in float32, in range mode 0 to 3 of kernels/range_phase.clh."""
    if mode == 2:
        return phase_rounding(0.0, frequency, True)
    error = phase_rounding(radius, frequency, mode > 0)
    if mode == 3:  # positions have the rests' rounding too, times half the bandwidth over the carrier: at most 1
        error += 2 * two_part_rounding(radius, frequency) + position_rounding(radius, bandwidth, False) / 2
    else:
        error += position_rounding(radius, bandwidth, mode == 1)
    error += series_error(radius, distance, frequency, order)
    if order == 0:
        error += root_rounding(radius, distance, frequency)
    return error + (curvature_rounding(radius, distance, frequency) if mode > 0 else 0.0)


def range_error_float64(radius: float, distance: float, frequency: float, order: int) -> float:
    """Phase error, rad, of paths in a tile of `radius` m by kernels/backproject_float64.cl, for its ORDER.

    distance  of the nearest antenna, m
    Infinite where an antenna is so near that differences from the tile's reference would cancel. Order -1 is
    double-double, whose error is beyond float64 for any path below 1e12 m.
    """
    if order < 0:
        return FLOAT64.angle
    if distance <= 2 * radius:
        return np.inf
    return phase_rounding(radius, frequency, number=FLOAT64) + series_error(radius, distance, frequency, order)


def sum_rounding(n_chunk: int, length: int, gain: float = 1.0, number: NumberType = FLOAT32) -> float:
    """Relative rms error of a sum of n_chunk terms, of the samples and of their FFT of `length`.

    gain  factor by which deconvolution raises the band's edge over its middle, and with it the FFT's rounding
    """
    terms, doublings, least = number.sums
    return number.unit * (np.sqrt(n_chunk) * terms + doublings * gain * np.sqrt(np.log2(max(length, 2))) + least)


def darkness(cells: float, chance: float = 1e-6) -> float:
    """Ratio, exceeded with that chance, of a row's amplitude to that of its profile at `cells` positions, for noise.

    Interpolation errors scale with a row's energy, the tolerance with the energy at the pixels. Over many resolution
    cells the two are nearly equal; a single cell may lie where the noise is weak: the mean of `cells` squared moduli is
    gamma distributed.
    """
    from scipy.special import gammaincinv

    return float(1 / np.sqrt(gammaincinv(cells, chance) / cells))
