"""Attitudes of antennas in orbit, and directions around a beam."""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import NDArray

from ..base import validation
from ..earth import rotation, viewing
from . import pointing
from .trajectory import Trajectory

Attitude = Literal["zero-doppler", "yaw", "orbital"]
ATTITUDES = ("zero-doppler", "yaw", "orbital")


def axes_of(
    p: NDArray[np.float64], v: NDArray[np.float64], attitude: Attitude, look: float, side: Literal["right", "left"]
) -> NDArray[np.float64]:
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


def ellipse(azimuth: float, elevation: float, n: int) -> NDArray[np.float64]:
    """n unit vectors in body axes (n, 3) around the edge of an elliptic beam of full angles, rad."""
    around = 2 * np.pi * np.arange(n) / n
    a, e = azimuth / 2 * np.cos(around), elevation / 2 * np.sin(around)
    off = np.hypot(a, e)
    return np.stack([np.cos(off), np.sin(off) * a / off, np.sin(off) * e / off], axis=1)
