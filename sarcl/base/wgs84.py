"""WGS84: longitude, latitude and height to Earth-centred coordinates and back, and to local axes."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from . import validation
from .vectors import Floats

SEMI_MAJOR = 6_378_137.0  # m, defining
FLATTENING = 1 / 298.257223563  # defining
ECCENTRICITY_SQUARED = FLATTENING * (2 - FLATTENING)


ANTENNAS = 6.3e6, 5e7  # m: antennas at such distances from the origin are in Earth-fixed coordinates


def is_earth_fixed(antenna: Floats) -> bool:
    """Whether the position of an antenna, m (3,), is Earth-fixed: told by its distance from the origin."""
    position = validation.array("antenna", antenna, np.float64, (3,))
    return ANTENNAS[0] < float(np.hypot(np.hypot(*position[:2]), position[2])) < ANTENNAS[1]


def ecef(longitude: ArrayLike, latitude: ArrayLike, height: ArrayLike) -> Floats:
    """Earth-centred, Earth-fixed positions, m (..., 3), of degrees and heights above the ellipsoid, m.

    Source: NGA.STND.0036 (WGS84), eq. (4-14): x = (N + h) cos(lat) cos(lon), ..., z = (N (1 - e^2) + h) sin(lat).

    >>> sarcl.wgs84.ecef(0.0, 0.0, 100.0)
    array([6378237.,       0.,       0.])
    """
    longitude, latitude = _radians(longitude, latitude)
    height = validation.values("height", height)
    with np.errstate(invalid="ignore"):  # infinite angles have no position: NaN, as of NaN
        s, c, sine, cosine = np.sin(latitude), np.cos(latitude), np.sin(longitude), np.cos(longitude)
    normal = SEMI_MAJOR / np.sqrt(1 - ECCENTRICITY_SQUARED * s**2)  # radius of curvature in the prime vertical
    across = (normal + height) * c
    return np.stack(
        np.broadcast_arrays(across * cosine, across * sine, (normal * (1 - ECCENTRICITY_SQUARED) + height) * s), axis=-1
    )


def up(longitude: ArrayLike, latitude: ArrayLike) -> Floats:
    """Unit normal of the ellipsoid, outwards (..., 3), at degrees.

    >>> np.allclose(sarcl.wgs84.up(0.0, 90.0), (0, 0, 1))
    True
    """
    longitude, latitude = _radians(longitude, latitude)
    with np.errstate(invalid="ignore"):  # infinite angles have no normal: NaN, as of NaN
        c = np.cos(latitude)
        return np.stack(np.broadcast_arrays(c * np.cos(longitude), c * np.sin(longitude), np.sin(latitude)), axis=-1)


def local_axes(longitude: float, latitude: float) -> Floats:
    """Rows east, north, up (3, 3) in Earth-centred coordinates: local = axes @ (position - origin).

    >>> east, north, up = sarcl.wgs84.local_axes(90.0, 0.0)
    >>> np.allclose(up, (0, 1, 0))
    True
    """
    lon, lat = (
        np.radians(validation.number("longitude", longitude)),
        np.radians(validation.number("latitude", latitude)),
    )
    east = np.array([-np.sin(lon), np.cos(lon), 0.0])
    north = np.array([-np.sin(lat) * np.cos(lon), -np.sin(lat) * np.sin(lon), np.cos(lat)])
    return np.stack([east, north, up(longitude, latitude)])


def vertical_at(position: np.ndarray) -> np.ndarray | None:
    """Unit normal of the ellipsoid (3,) at an Earth-centred position, m (3,); None farther than 32 km from it."""
    position = validation.array("position", position, np.float64, (3,))
    axes = SEMI_MAJOR * np.array([1, 1, 1 - FLATTENING])
    if np.abs(position).max() > 2 * SEMI_MAJOR:
        return None
    if abs(np.linalg.norm(position / axes) - 1) > 0.005:
        return None
    normal = position / axes**2
    return np.asarray(normal / np.linalg.norm(normal))


def geodetic(positions: ArrayLike) -> tuple[Floats, Floats, Floats]:
    """Longitude, latitude, degrees, and height above the ellipsoid, m, each (...), of positions, m (..., 3).

    The inverse of `ecef`, in closed form, at any distance from the centre: heights to 1e-9 m near the Earth, angles to
    the rounding of degrees (2e-9 m on the ground). Below 43 km from the centre several points of
    the ellipsoid have their normal through a position: the nearest is taken, and the northern one of two that are
    equally near. The longitude on the axis is 0.
    Source: C. F. F. Karney, Geodesics on an ellipsoid of revolution, arXiv:1102.1215, appendix B.

    >>> [float(value) for value in sarcl.wgs84.geodetic([6378237.0, 0, 0])]
    [0.0, 0.0, 100.0]
    """
    x, y, z = np.moveaxis(validation.vectors("positions", positions), -1, 0)
    e2, e4, rest = ECCENTRICITY_SQUARED, ECCENTRICITY_SQUARED**2, 1 - ECCENTRICITY_SQUARED
    across = np.hypot(x, y)
    p, q = (across / SEMI_MAJOR) ** 2, rest * (z / SEMI_MAJOR) ** 2
    r = (p + q - e4) / 6
    s = e4 * p * q / 4
    disc = s * (2 * r**3 + s)
    cubed = s + r**3
    t = np.cbrt(cubed + np.copysign(np.sqrt(np.maximum(disc, 0)), cubed))
    angle = np.arctan2(np.sqrt(np.maximum(-disc, 0)), -cubed)
    with np.errstate(invalid="ignore", divide="ignore"):  # both branches are computed, the valid one is taken
        u = r + np.where(disc >= 0, t + np.where(t != 0, r**2 / t, 0), 2 * r * np.cos(angle / 3))
        v = np.sqrt(u**2 + e4 * q)
        uv = np.where(u < 0, e4 * q / (v - u), u + v)
        w = np.maximum(e2 * (uv - q) / (2 * v), 0)
        k = uv / (np.sqrt(uv + w**2) + w)
        sine, cosine = z / k, across / (k + e2)
    inside = (e4 * q == 0) & (r <= 0)  # the disc of radius a e^2 in the equatorial plane
    sine = np.where(inside, np.copysign(np.sqrt(np.maximum(e4 - p, 0) / rest), z), sine)
    cosine = np.where(inside, np.sqrt(p), cosine)
    latitude = np.degrees(np.arctan2(sine, cosine))
    # a difference of lengths: in extended precision, where the machine has it
    long = [np.asarray(v, np.longdouble) for v in (x, y, z, sine, cosine)]
    length = np.sqrt(long[3] ** 2 + long[4] ** 2)
    sine, cosine = long[3] / length, long[4] / length
    height = np.sqrt(long[0] ** 2 + long[1] ** 2) * cosine + long[2] * sine - SEMI_MAJOR * np.sqrt(1 - e2 * sine**2)
    return np.degrees(np.arctan2(y, x)), latitude, height.astype(np.float64)


def _radians(longitude: ArrayLike, latitude: ArrayLike) -> tuple[Floats, Floats]:
    """Degrees as radians in float64: in float32, as files hold them, sines are off by half a metre on the ground."""
    return np.radians(validation.values("longitude", longitude)), np.radians(validation.values("latitude", latitude))
