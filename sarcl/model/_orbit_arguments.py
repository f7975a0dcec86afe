"""Arguments of Orbit: positions on the Earth, spans of time, arrays of one shape, attitudes and edges of beams."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from ..base import validation, wgs84
from ..base.vectors import Floats
from ..earth import rotation, viewing
from . import pointing
from .trajectory import Trajectory

Attitude = Literal["zero-doppler", "yaw", "orbital"]
ATTITUDES = ("zero-doppler", "yaw", "orbital")
DEEPEST = -20e3  # m: positions farther below the ellipsoid are refused


def places(positions: ArrayLike) -> Floats:
    """Earth-fixed positions, m (..., 3). ValueError for positions deep inside the Earth."""
    x = validation.converted("positions", positions, np.float64)
    if x.shape[-1:] != (3,):
        raise ValueError(f"positions has shape {x.shape}, wanted (..., 3): Earth-fixed, m")
    validation.finite("positions", x)
    height = wgs84.geodetic(x)[2]
    if (height < DEEPEST).any():
        index, place = validation.first(height == height.min())
        raise ValueError(
            f"positions{place} is {-height[index]:.4g} m under the ellipsoid; wanted Earth-fixed positions in m "
            "(local ones: see sarcl.wgs84.ecef and local_axes)"
        )
    return x


def together(**arrays: Floats) -> list[Floats]:
    """Arrays of one shape; ValueError names those whose shapes do not fit together."""
    try:
        return list(np.broadcast_arrays(*arrays.values()))
    except ValueError:
        shapes = ", ".join(f"{name} {array.shape}" for name, array in arrays.items())
        raise ValueError(f"shapes do not fit together: {shapes}; give equal shapes, or axes of length 1") from None


def span_of(value: Sequence[float]) -> tuple[float, float]:
    """(first, last) time, s. ValueError where they are not in this order."""
    pair = validation.array("span", value, np.float64, (2,))
    if not pair[0] < pair[1]:
        raise ValueError(f"span is ({pair[0]:g}, {pair[1]:g}); the first time must be before the last")
    return float(pair[0]), float(pair[1])


def axes_of(p: Floats, v: Floats, attitude: Attitude, look: float, side: Literal["right", "left"]) -> Floats:
    """Rotations from body to Earth-fixed axes (n, 3, 3) of antennas at p, m, that move with v, m/s: (n, 3) each.

    Arguments as in `Orbit.trajectory`; columns as in `sarcl.pointing`: boresight, azimuth, elevation.
    """
    validation.choice("attitude", attitude, ATTITUDES)
    up = viewing.normal(p)
    if attitude == "yaw":
        v = v - (v * up).sum(axis=1, keepdims=True) * up
    elif attitude == "orbital":
        v = v + rotation.spin(p)
    axes = pointing.stripmap(Trajectory(np.arange(len(p)), p, v), look, side=side, up=up).attitude
    assert axes is not None
    return axes


def ellipse(azimuth: float, elevation: float, n: int) -> Floats:
    """n unit vectors in body axes (n, 3) around the edge of an elliptic beam of full angles, rad."""
    around = 2 * np.pi * np.arange(n) / n
    a, e = azimuth / 2 * np.cos(around), elevation / 2 * np.sin(around)
    off = np.hypot(a, e)
    return np.stack([np.cos(off), np.sin(off) * a / off, np.sin(off) * e / off], axis=1)
