"""The Earth's rotation: sidereal time, and inertial positions to Earth-fixed ones.

Positions rotate about the z axis alone. Polar motion (below 0.6 seconds of arc, 18 m at the Earth's surface) is left
out, and UTC is used for UT1 (less than 0.9 s apart, 420 m along the equator): both shift a whole orbit alike.
"""

from __future__ import annotations

import numpy as np

from ..base.vectors import Floats

GM = 3.986004418e14  # m^3/s^2, WGS84, atmosphere included (NGA.STND.0036, table 3.1)
RATE = 7.292115e-5  # rad/s, WGS84, in an inertial frame (NGA.STND.0036, table 3.1)
J2 = 1.082629821e-3  # WGS84's dynamic form factor (NGA.STND.0036, section 3)
J2000 = np.datetime64("2000-01-01T12:00:00", "ns")
DAY = 86_400.0  # s
# seconds of sidereal time per century: IAU 1982 (Vallado, Fundamentals of Astrodynamics, eq. 3-47)
_SIDEREAL = (67_310.54841, 876_600 * 3600 + 8_640_184.812866, 0.093104, -6.2e-6)
SIDEREAL_RATE = 2 * np.pi * _SIDEREAL[1] / (36_525 * DAY) / DAY  # rad/s, against the mean equinox of date


def sidereal_time(date: np.datetime64) -> float:
    """Greenwich mean sidereal time at a date (UTC), rad: the angle from the mean equinox to the Greenwich meridian."""
    centuries = float((date - J2000) / np.timedelta64(1, "ns")) * 1e-9 / (36_525 * DAY)
    seconds = sum(c * centuries**n for n, c in enumerate(_SIDEREAL))
    return float(2 * np.pi * (seconds % DAY) / DAY)


def rotated(angle: Floats, vectors: Floats) -> Floats:
    """Vectors (..., 3) turned about z by angles, rad (...), from x towards y."""
    c, s = np.cos(angle), np.sin(angle)
    x, y, z = np.moveaxis(vectors, -1, 0)
    return np.stack(np.broadcast_arrays(c * x - s * y, s * x + c * y, z), axis=-1)


def spin(positions: Floats, rate: float = RATE) -> Floats:
    """Velocities, m/s (..., 3), at which the Earth's rotation moves Earth-fixed positions, m (..., 3)."""
    x, y, z = np.moveaxis(positions, -1, 0)
    return np.stack([-rate * y, rate * x, np.zeros_like(z)], axis=-1)


def to_earth_fixed(greenwich: Floats, rate: float, positions: Floats, velocities: Floats) -> tuple[Floats, Floats]:
    """Earth-fixed positions, m, and velocities, m/s (n, 3), of inertial ones.

    greenwich  angle from the inertial x axis to the Greenwich meridian, rad (n,);  rate  its derivative, rad/s
    """
    fixed = rotated(-greenwich, positions)
    return fixed, rotated(-greenwich, velocities) - spin(fixed, rate)
