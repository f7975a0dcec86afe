"""Antenna patterns of kernels/pattern.clh in float64."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ..check import SPEED_OF_LIGHT

if TYPE_CHECKING:
    from ..antenna import Antenna


def pattern_gain(antenna: Antenna, directions: np.ndarray, frequency: float) -> np.ndarray:
    """Complex amplitude gain (...) at directions in antenna axes (..., 3), of any length."""
    x, y, z = np.moveaxis(directions / np.linalg.norm(directions, axis=-1, keepdims=True), -1, 0)
    shape = {"isotropic": _isotropic, "aperture": _aperture, "gaussian": _gaussian, "table": _table}[antenna.kind]
    return np.asarray(antenna.amplitude * shape(antenna, x, y, z, frequency), np.complex128)


def _isotropic(antenna: Antenna, x: np.ndarray, y: np.ndarray, z: np.ndarray, frequency: float) -> np.ndarray:
    return np.ones_like(x)


def _aperture(antenna: Antenna, x: np.ndarray, y: np.ndarray, z: np.ndarray, frequency: float) -> np.ndarray:
    """Transform of the illumination (1 + b) /2 ... in each axis: sinc u + (b/2) (sinc(u - 1) + sinc(u + 1))."""
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
    from ..antenna import SLACK

    angles = [np.arctan2(y, x), np.arctan2(z, np.hypot(x, y))]
    inside = np.ones(x.shape, bool)
    for i, axis in enumerate((antenna.azimuth, antenna.elevation)):
        angles[i] = angles[i] * antenna.ratio(frequency)
        slack = SLACK * (axis[1] - axis[0])
        inside &= (angles[i] >= axis[0] - slack) & (angles[i] <= axis[-1] + slack)
        angles[i] = np.clip(angles[i], axis[0], axis[-1])
    real, imag = (s.ev(*angles) for s in splines(antenna))
    return np.asarray((real + 1j * imag) * inside)


def splines(antenna: Antenna) -> tuple[Any, Any]:
    """Bicubic (not-a-knot) splines of a table's real and imaginary parts over azimuth and elevation."""
    from scipy.interpolate import RectBivariateSpline

    real, imag = (RectBivariateSpline(antenna.azimuth, antenna.elevation, v) for v in _parts(antenna.values))
    return real, imag


def _parts(values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    return values.real, values.imag


def two_way_gain(
    antennas: tuple[Antenna, Antenna | None], axes: tuple[np.ndarray, np.ndarray], tx: np.ndarray, rx: np.ndarray,
    points: np.ndarray, frequency: float,
) -> np.ndarray:  # fmt: skip
    """Transmit times receive gain (n_points,), one antenna pair: positions m (3,), axes (3, 3), points m (n, 3).

    antennas as `antenna.pair_of` gives them; v = d @ axes are a direction's components along the axes' columns.
    """
    out = pattern_gain(antennas[0], (points - tx) @ axes[0], frequency)
    return out if antennas[1] is None else out * pattern_gain(antennas[1], (points - rx) @ axes[1], frequency)
