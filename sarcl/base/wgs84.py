"""WGS84: longitude, latitude and height to Earth-centred coordinates and to local axes."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

SEMI_MAJOR = 6_378_137.0  # m, defining
FLATTENING = 1 / 298.257223563  # defining
ECCENTRICITY_SQUARED = FLATTENING * (2 - FLATTENING)


def ecef(longitude: ArrayLike, latitude: ArrayLike, height: ArrayLike) -> NDArray[np.float64]:
    """Earth-centred, Earth-fixed positions, m (..., 3), of degrees and heights above the ellipsoid, m.

    Source: NGA.STND.0036 (WGS84), eq. (4-14): x = (N + h) cos(lat) cos(lon), ..., z = (N (1 - e^2) + h) sin(lat).
    """
    longitude, latitude, height = np.radians(longitude), np.radians(latitude), np.asarray(height)
    s, c = np.sin(latitude), np.cos(latitude)
    normal = SEMI_MAJOR / np.sqrt(1 - ECCENTRICITY_SQUARED * s**2)  # radius of curvature in the prime vertical
    across = (normal + height) * c
    return np.stack(
        np.broadcast_arrays(
            across * np.cos(longitude), across * np.sin(longitude), (normal * (1 - ECCENTRICITY_SQUARED) + height) * s
        ),
        axis=-1,
    )


def up(longitude: ArrayLike, latitude: ArrayLike) -> NDArray[np.float64]:
    """Unit normal of the ellipsoid, outwards (..., 3), at degrees."""
    longitude, latitude = np.radians(longitude), np.radians(latitude)
    c = np.cos(latitude)
    return np.stack(np.broadcast_arrays(c * np.cos(longitude), c * np.sin(longitude), np.sin(latitude)), axis=-1)


def local_axes(longitude: float, latitude: float) -> NDArray[np.float64]:
    """Rows east, north, up (3, 3) in Earth-centred coordinates: local = axes @ (position - origin)."""
    lon, lat = np.radians(longitude), np.radians(latitude)
    east = np.array([-np.sin(lon), np.cos(lon), 0.0])
    north = np.array([-np.sin(lat) * np.cos(lon), -np.sin(lat) * np.sin(lon), np.cos(lat)])
    return np.stack([east, north, up(longitude, latitude)])


def vertical_at(position: np.ndarray) -> np.ndarray | None:
    """Unit normal of the ellipsoid (3,) at an Earth-centred position, m (3,); None farther than 32 km from it."""
    axes = SEMI_MAJOR * np.array([1, 1, 1 - FLATTENING])
    if abs(np.linalg.norm(position / axes) - 1) > 0.005:
        return None
    normal = position / axes**2
    return np.asarray(normal / np.linalg.norm(normal))
