"""What is known of an antenna's pattern as a whole: its steepest slope, how far it reaches, its spline's numbers."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from .check import SPEED_OF_LIGHT

if TYPE_CHECKING:
    from .antenna import Antenna


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
    from .reference.antenna import splines

    a, e = _fine(antenna.azimuth), _fine(antenna.elevation)
    squares = np.zeros((len(a), len(e)))
    for s in splines(antenna):
        squares += (s(a, e, dx=1) / np.maximum(np.cos(e), 1e-3)) ** 2 + s(a, e, dy=1) ** 2
    return float(np.sqrt(squares.max()))


def table_limits(antenna: Antenna, level: float, ratio: float) -> tuple[float, float, float]:
    """Largest direction cosines along azimuth and elevation where a table reaches `level`; -1 if nowhere behind."""
    from .reference.antenna import splines

    a, e = _fine(antenna.azimuth), _fine(antenna.elevation)
    power = sum(s(a, e) ** 2 for s in splines(antenna))
    seen = power >= level**2
    if not seen.any():
        return 0.0, 0.0, -1.0
    # half a cell of the finer grid between samples that were looked at, and what may lie outside by rounding
    azimuth = np.minimum(np.abs(a) / ratio + (a[1] - a[0]) / ratio, np.pi)[seen.any(axis=1)].max()
    elevation = np.minimum(np.abs(e) / ratio + (e[1] - e[0]) / ratio, np.pi / 2)[seen.any(axis=0)].max()
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
