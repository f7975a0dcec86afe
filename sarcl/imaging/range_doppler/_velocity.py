"""Ranges from a track to points as hyperbolas of time, with an effective velocity that depends on the slant range.

R(t) = offset + sqrt(r^2 + v^2 (t - u - shift)^2),   u the zero-Doppler time and r the slant range of a point
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.polynomial import chebyshev
from scipy import optimize

from ...base.constants import SPEED_OF_LIGHT
from ...base.rows import spread_over
from ...model.phase_history import PhaseHistory
from ._track import Track

RANGES = 7  # slant ranges at which hyperbolas are fitted
DEGREE = 4  # degree of the polynomials of range through their parameters
MOST_FACTOR = 4.0  # largest ratio of the squares of velocities for a Doppler rate that is given and the geometry's
MOST_ROWS = 129  # rows from which they are fitted, and their error is measured
Positions = Callable[[np.ndarray, np.ndarray], np.ndarray]  # m (n, m, 3) of times (n,) and ranges (m,)


@dataclass(frozen=True, eq=False)
class Hyperbolas:
    """Effective velocity, m/s, offset, m, and shift, s: Chebyshev polynomials of slant range from near to far, m."""

    near: float
    far: float
    coefficients: np.ndarray  # (degree + 1, 3)

    def at(self, ranges: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Effective velocity, offset and shift at slant ranges, (n,) each."""
        x = (2 * np.asarray(ranges) - self.near - self.far) / max(self.far - self.near, 1e-300)
        v, offset, shift = np.broadcast_to(chebyshev.chebval(x, self.coefficients).T, (len(x), 3)).T
        return v, offset, shift

    def scaled(self, factor: float) -> Hyperbolas:
        """These hyperbolas with the squares of their velocities, and so their Doppler rates, times `factor`."""
        return replace(self, coefficients=self.coefficients * np.array([np.sqrt(factor), 1.0, 1.0]))

    def range(self, u: np.ndarray, ranges: np.ndarray, t: np.ndarray) -> np.ndarray:
        """R(t), m, of arrays of zero-Doppler times, slant ranges (m,) and times that broadcast, ranges last."""
        v, offset, shift = self.at(ranges)
        return np.asarray(offset + np.sqrt(ranges**2 + (v * (t - u - shift)) ** 2))


def true_range(raw: PhaseHistory, rows: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Half the two-way path, m (rows, ...), of some rows to points, m (..., 3)."""
    shape = (-1, *(1,) * (points.ndim - 1), 3)
    tx, rx = raw.tx[rows].reshape(shape), raw.rx[rows].reshape(shape)
    return np.asarray((np.linalg.norm(tx - points, axis=-1) + np.linalg.norm(rx - points, axis=-1)) / 2)


def hyperbolas(
    raw: PhaseHistory, track: Track, positions: Positions, u: float, near: float, far: float, rows: np.ndarray
) -> Hyperbolas:
    """The hyperbolas of points at zero-Doppler time u, s, and slant ranges near ... far, m, through some rows.

    A straight track has one velocity, and needs no fit.
    """
    if track.is_line:
        return Hyperbolas(near, far, np.array([[track.speed, 0.0, 0.0]]))
    nodes = np.cos(np.pi * (np.arange(RANGES) + 0.5) / RANGES)
    ranges = (near + far) / 2 + (far - near) / 2 * nodes
    points = positions(np.array([u]), ranges)[0]
    rows = rows[spread_over(len(rows), MOST_ROWS)]
    t = track.times[rows]
    truth = true_range(raw, rows, points)
    parameters = np.empty((RANGES, 3))
    for i, r in enumerate(ranges):
        square, offset, shift = track.speed**2, 0.0, 0.0
        scale = float(np.abs(t - u).max())
        for _ in range(8):  # Gauss-Newton: the hyperbola is nearly linear in its parameters
            tau = t - u - shift
            path = np.sqrt(r**2 + square * tau**2)
            slopes = np.stack([tau**2 / (2 * path), np.ones(len(t)), -square * tau / path], axis=1)
            size = np.array([scale**2 / r, 1.0, track.speed**2 * scale / r])
            step = np.linalg.lstsq(slopes / size, truth[:, i] - offset - path, rcond=1e-11)[0] / size
            square, offset, shift = square + step[0], offset + step[1], shift + step[2]
            if not square > 1e-6 * track.speed**2:
                raise ValueError(
                    f"at slant range {r:.7g} m the track's ranges do not grow on both sides of a closest approach: it "
                    "turns about the scene, and there is no Doppler; use backproject, or polar_format"
                )
        parameters[i] = np.sqrt(square), offset, shift
    return Hyperbolas(near, far, chebyshev.chebfit(nodes, parameters, DEGREE))


def effective_speed(raw: PhaseHistory, track: Track, positions: Positions, distance: float) -> float:
    """Effective velocity, m/s, at one slant range, m, of points at broadside of the middle of the track.

    Of an orbit it is 5 to 10 % below the speed of the antenna, since the ground turns below it.
    """
    u, rows = track.stop / 2, np.arange(track.n_rows)
    fit = hyperbolas(raw, track, positions, u, distance, distance, rows)
    return float(fit.at(np.array([distance]))[0][0])


def rate_of(fit: Hyperbolas, distance: float, closing: float, wavelength: float) -> float:
    """Doppler rate, Hz/s, at a slant range, m, where half the path shortens by `closing` m/s: wavelength/2 times the
    Doppler centroid."""
    speed = float(fit.at(np.array([distance]))[0][0])
    return -2 * speed**2 / (wavelength * distance) * max(1 - (closing / speed) ** 2, 1e-6) ** 1.5


def factor_of_rate(rate: float, fit: Hyperbolas, distance: float, closing: float, wavelength: float) -> float:
    """The factor of the squares of velocities that makes `rate_of` equal to `rate`; ValueError where none does."""
    natural = rate_of(fit, distance, closing, wavelength)

    def less(exponent: float) -> float:
        return rate_of(fit.scaled(np.exp(exponent)), distance, closing, wavelength) / rate - 1 if rate else np.inf

    most = np.log(MOST_FACTOR)
    if not less(-most) < 0 < less(most):
        raise ValueError(
            f"doppler_rate is {rate:.6g} Hz/s, but the geometry has {natural:.6g} Hz/s: they differ by more than a "
            f"factor of about {MOST_FACTOR:g}; give a negative rate in Hz/s at the centre frequency"
        )
    return float(np.exp(optimize.brentq(less, -most, most, xtol=1e-12)))


def phase_error(
    raw: PhaseHistory,
    track: Track,
    positions: Positions,
    fit: Hyperbolas,
    u: np.ndarray,
    rows_of: Callable[[float], np.ndarray],
    n_ranges: int,
) -> tuple[float, float]:
    """Root mean square and largest phase error, rad, of hyperbolas at zero-Doppler times u, s (n,), and some ranges.

    rows_of(u)  the rows that points at a zero-Doppler time are focused from
    """
    ranges = np.linspace(fit.near, fit.far, n_ranges)
    wavenumber = 4 * np.pi / SPEED_OF_LIGHT * float(raw.center_frequency.max())
    worst, mean = 0.0, []
    for one in u:
        rows = rows_of(float(one))
        if len(rows) == 0:
            continue
        rows = rows[spread_over(len(rows), MOST_ROWS)]
        points = positions(np.array([one]), ranges)[0]
        error = true_range(raw, rows, points) - fit.range(one, ranges, track.times[rows][:, None])
        worst = max(worst, wavenumber * float(np.abs(error).max()))
        mean.append(wavenumber**2 * float((error**2).mean(axis=0).max()))
    return float(np.sqrt(max(mean, default=0.0))), worst
