"""Angles, ranges and Doppler frequencies of positions seen from an antenna above the Earth."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..base import wgs84
from ..base.constants import SPEED_OF_LIGHT
from ..base.vectors import Floats


@dataclass(frozen=True, eq=False)
class View:
    """Angles, ranges and their derivatives of positions seen from an antenna, one value for each (...).

    slant_range   m;  ground_range  m, along the ellipsoid from the point below the antenna
    incidence     rad, at the position, from the ellipsoid's normal to the antenna
    look          rad, at the antenna, from the ellipsoid's normal downwards to the position
    squint        rad, at the antenna, from the plane across its Earth-fixed velocity, positive ahead
    range_rate, range_acceleration   m/s, m/s^2: derivatives of the slant range
    """

    slant_range: Floats
    ground_range: Floats
    incidence: Floats
    look: Floats
    squint: Floats
    range_rate: Floats
    range_acceleration: Floats

    def doppler(self, frequency: float) -> Floats:
        """Doppler frequencies of echoes, Hz, at a carrier, Hz: -2 f/c times the range rate."""
        return -2 * frequency / SPEED_OF_LIGHT * self.range_rate

    def doppler_rate(self, frequency: float) -> Floats:
        """Rates of the Doppler frequency, Hz/s, at a carrier, Hz: -2 f/c times the range acceleration."""
        return -2 * frequency / SPEED_OF_LIGHT * self.range_acceleration


def view(positions: Floats, velocities: Floats, accelerations: Floats, points: Floats) -> View:
    """The view of points, m (..., 3), by antennas: m, m/s, m/s^2 (..., 3), all Earth-fixed."""
    path = points - positions
    distance = np.linalg.norm(path, axis=-1)
    towards = path / distance[..., None]
    speed = np.linalg.norm(velocities, axis=-1)
    ahead = (towards * velocities).sum(axis=-1)
    return View(
        slant_range=distance,
        ground_range=ground_range(positions, points),
        incidence=_angle(normal(points), -towards),
        look=_angle(-normal(positions), towards),
        squint=np.arcsin(np.clip(ahead / speed, -1, 1)),
        range_rate=-ahead,
        range_acceleration=(speed**2 - ahead**2) / distance - (towards * accelerations).sum(axis=-1),
    )


def normal(positions: Floats) -> Floats:
    """The ellipsoid's unit normal (..., 3) through positions, m (..., 3)."""
    longitude, latitude, _ = wgs84.geodetic(positions)
    return wgs84.up(longitude, latitude)


def hidden(positions: Floats, points: Floats) -> NDArray[np.bool_]:
    """Whether the ellipsoid stands between antennas and points, m (..., 3) each."""
    axes = wgs84.SEMI_MAJOR * np.array([1, 1, 1 - wgs84.FLATTENING])
    start, path = points / axes, (positions - points) / axes
    along, length = (start * path).sum(axis=-1), (path**2).sum(axis=-1)
    share = np.clip(-along / np.where(length == 0, 1, length), 0, 1)  # of the path, where it is closest to the centre
    nearest = ((start + share[..., None] * path) ** 2).sum(axis=-1)
    return np.asarray((share > 0) & (nearest < 1))


def ground_range(positions: Floats, points: Floats) -> Floats:
    """Lengths of arcs, m (...), on the ellipsoid from below antennas to below points, m (..., 3) each.

    The arc lies in the plane through both ends and the Earth's centre. The geodesic is shorter by less than a
    millimetre within 1000 km.
    """
    ends = [wgs84.ecef(lon, lat, 0.0) for lon, lat, _ in (wgs84.geodetic(positions), wgs84.geodetic(points))]
    first, last = (e / np.linalg.norm(e, axis=-1, keepdims=True) for e in ends)
    across = np.cross(first, last)
    angle = np.arctan2(np.linalg.norm(across, axis=-1), (first * last).sum(axis=-1))
    side = np.cross(across, first)
    length = np.linalg.norm(side, axis=-1, keepdims=True)
    side = side / np.where(length == 0, 1, length)
    nodes, weights = np.polynomial.legendre.leggauss(12)
    total = np.zeros(angle.shape)
    squares = 1 / (wgs84.SEMI_MAJOR * np.array([1, 1, 1 - wgs84.FLATTENING])) ** 2
    for node, weight in zip(nodes, weights, strict=True):
        arc = (angle * (1 + node) / 2)[..., None]
        ray, tangent = np.cos(arc) * first + np.sin(arc) * side, np.cos(arc) * side - np.sin(arc) * first
        density = (ray**2 * squares).sum(axis=-1)
        radius = 1 / np.sqrt(density)
        slope = -((ray * tangent * squares).sum(axis=-1)) / density * radius
        total = total + weight * np.hypot(radius, slope)
    return np.asarray(total * angle / 2)


def _angle(a: Floats, b: Floats) -> Floats:
    """Angles between unit vectors (..., 3), rad, accurate near 0 too."""
    return np.asarray(2 * np.arctan2(np.linalg.norm(a - b, axis=-1), np.linalg.norm(a + b, axis=-1)))
