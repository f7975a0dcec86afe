"""Antenna patterns in float64: gain in a direction, steepest slope, limits of a level, spline coefficients."""

from __future__ import annotations

import functools
from typing import TYPE_CHECKING, Any

import numpy as np

from ..base.constants import SPEED_OF_LIGHT
from ..base.vectors import unit

if TYPE_CHECKING:
    from .antenna import Antenna

SLACK = 1e-3  # distance to a table, in its steps, within which directions get the value at its edge


def uniform_spline(values: np.ndarray) -> np.ndarray:
    """Coefficients (n + 2, m) of uniform cubic B-splines whose sum is the not-a-knot spline through values (n, m).

    c_j = s_j - s''_j/6 with unit steps, for any cubic spline with its breaks at the samples; the two at the ends
    follow from s = (c_-1 + 4 c_0 + c_1)/6. (De Boor, A Practical Guide to Splines, 1978.)
    """
    from scipy.interpolate import make_interp_spline

    n = np.arange(len(values), dtype=np.float64)
    inner = values - make_interp_spline(n, values, k=3)(n, nu=2) / 6
    first = 6 * values[0] - 4 * inner[0] - inner[1]
    last = 6 * values[-1] - 4 * inner[-1] - inner[-2]
    return np.concatenate([first[None], inner, last[None]])


def _fine(axis: np.ndarray) -> np.ndarray:
    return np.linspace(axis[0], axis[-1], 4 * (len(axis) - 1) + 1)


def table_slope(antenna: Antenna) -> float:
    """Largest gradient of a table on a grid four times finer, 1/rad."""
    a, e = _fine(antenna.azimuth), _fine(antenna.elevation)
    squares = np.zeros((len(a), len(e)))
    for s in splines(antenna):
        squares += (s(a, e, dx=1) / np.maximum(np.cos(e), 1e-3)) ** 2 + s(a, e, dy=1) ** 2
    return float(np.sqrt(squares.max()))


def table_limits(antenna: Antenna, level: float, ratio: float) -> tuple[float, float, float]:
    """Largest direction cosines along azimuth and elevation where a table reaches `level`; and -1 if never behind."""
    a, e = _fine(antenna.azimuth), _fine(antenna.elevation)
    power = sum(s(a, e) ** 2 for s in splines(antenna))
    is_above = power >= level**2
    if not is_above.any():
        return 0.0, 0.0, -1.0
    # margin: half a cell of the finer grid, between its samples, and rounding
    azimuth = np.minimum(np.abs(a) / ratio + (a[1] - a[0]) / ratio, np.pi)[is_above.any(axis=1)].max()
    elevation = np.minimum(np.abs(e) / ratio + (e[1] - e[0]) / ratio, np.pi / 2)[is_above.any(axis=0)].max()
    return float(np.sin(min(azimuth, np.pi / 2))), float(np.sin(elevation)), -float(azimuth < np.pi / 2)


def factor_reach(antenna: Antenna, axis: int, level: float, frequency: float) -> float:
    """Direction cosine beyond which one factor of an aperture's pattern stays below `level`.

    The factor is below ((1 - b) + b/(u^2 - 1))/(pi u) for u = size cosine/lambda > 1, b = (1 - taper)/(1 + taper).
    """
    from scipy.optimize import brentq

    b = (1 - antenna.taper[axis]) / (1 + antenna.taper[axis])
    end = float(antenna.size[axis] * frequency / SPEED_OF_LIGHT)

    def over(u: float) -> float:
        return float(((1 - b) + b / (u * u - 1)) / (np.pi * u) - level)

    if end <= 1.001 or over(end) >= 0:
        return 1.0
    return float((brentq(over, 1.001, end) if over(1.001) > 0 else 1.001) / end)


def pattern_gain(antenna: Antenna, directions: np.ndarray, frequency: float) -> np.ndarray:
    """Complex amplitude gain (...) at directions in antenna axes (..., 3), of any length."""
    x, y, z = np.moveaxis(unit(directions), -1, 0)
    shape = {"isotropic": _isotropic, "aperture": _aperture, "gaussian": _gaussian, "table": _table}[antenna.kind]
    return np.asarray(antenna.amplitude * shape(antenna, x, y, z, frequency), np.complex128)


def _isotropic(antenna: Antenna, x: np.ndarray, y: np.ndarray, z: np.ndarray, frequency: float) -> np.ndarray:
    return np.ones_like(x)


def _aperture(antenna: Antenna, x: np.ndarray, y: np.ndarray, z: np.ndarray, frequency: float) -> np.ndarray:
    """Fourier transform of the illumination along each axis: sinc u + (b/2) (sinc(u - 1) + sinc(u + 1))."""
    out = (x > 0).astype(np.float64)
    for size, taper, cosine in zip(antenna.size, antenna.taper, (y, z), strict=True):
        u, b = size * frequency / SPEED_OF_LIGHT * cosine, (1 - taper) / (1 + taper)
        out = out * (np.sinc(u) + b / 2 * (np.sinc(u - 1) + np.sinc(u + 1)))
    return out


def _gaussian(antenna: Antenna, x: np.ndarray, y: np.ndarray, z: np.ndarray, frequency: float) -> np.ndarray:
    across = np.hypot(y, z)
    off = np.arctan2(across, x) * antenna.ratio(frequency)
    safe = np.where(across > 0, across, 1)
    a, e = off * np.where(across > 0, y / safe, 1), off * z / safe
    return np.asarray(np.exp(-2 * np.log(2) * ((a / antenna.width[0]) ** 2 + (e / antenna.width[1]) ** 2)))


def _table(antenna: Antenna, x: np.ndarray, y: np.ndarray, z: np.ndarray, frequency: float) -> np.ndarray:
    angles = [np.arctan2(y, x), np.arctan2(z, np.hypot(x, y))]
    inside = np.ones(x.shape, bool)
    for i, axis in enumerate((antenna.azimuth, antenna.elevation)):
        angles[i] = angles[i] * antenna.ratio(frequency)
        slack = SLACK * (axis[1] - axis[0])
        inside &= (angles[i] >= axis[0] - slack) & (angles[i] <= axis[-1] + slack)
        angles[i] = np.clip(angles[i], axis[0], axis[-1])
    real, imag = (s.ev(*angles) for s in splines(antenna))
    return np.asarray((real + 1j * imag) * inside)


@functools.lru_cache(maxsize=4)  # antennas are compared as objects: planners evaluate one thousands of times
def splines(antenna: Antenna) -> tuple[Any, Any]:
    """Bicubic (not-a-knot) splines of a table's real and imaginary parts over azimuth and elevation."""
    from scipy.interpolate import RectBivariateSpline

    real, imag = (
        RectBivariateSpline(antenna.azimuth, antenna.elevation, v) for v in (antenna.values.real, antenna.values.imag)
    )
    return real, imag


def two_way_gain(
    antennas: tuple[Antenna, Antenna | None],
    axes: tuple[np.ndarray, np.ndarray],
    tx: np.ndarray,
    rx: np.ndarray,
    points: np.ndarray,
    frequency: float,
) -> np.ndarray:
    """Transmit times receive gain (n_points,), one antenna pair: positions m (3,), axes (3, 3), points m (n, 3).

    antennas  from `antenna.pair_of`; d @ axes are the components of a direction d along the columns of axes
    """
    out = pattern_gain(antennas[0], (points - tx) @ axes[0], frequency)
    return out if antennas[1] is None else out * pattern_gain(antennas[1], (points - rx) @ axes[1], frequency)
