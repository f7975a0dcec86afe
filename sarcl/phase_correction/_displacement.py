"""Displacements: by how much a phase moves bright places across range.

A scatterer at x that is moved by d u, u a unit vector, changes the phase of pulse p by -(2 pi f/c) d g_p.u, where g_p
is the sum of the unit vectors from both antennas to x. A phase that is linear in g_p.u over the pulses that see x is
therefore a displacement of x across range, and nothing in the image of x alone shows it.
"""

from __future__ import annotations

import numpy as np

from ..base.constants import SPEED_OF_LIGHT
from ..base.vectors import unit
from . import _bright_points
from ._aperture_view import ApertureView

BRIGHT = 10  # brightest points of an image
FAINT = 0.1  # of the power of the brightest: fainter points may be side lobes


def bright_places(view: ApertureView, power: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Positions, m (k, 3), of the brightest points of an image, and their power (k,)."""
    pixels, levels = _bright_points.pixels_and_levels(power, view.grid, _bright_points.CANDIDATES)
    places = _bright_points.brightest(view.raw[:: view.channels], power, view.grid, 8.0, BRIGHT)
    level = np.array([levels[np.linalg.norm(pixels - place, axis=1).argmin()] for place in places])
    bright = level >= FAINT * levels[0]
    return places[bright], level[bright]


def shift_phase(view: ApertureView, place: np.ndarray, weight: np.ndarray) -> np.ndarray:
    """rad/m (n,): change of a pulse's phase per displacement of a place, m (3,), across range, in the image plane.

    weight  (n,), of the pulses: across range is the direction in which they turn most, as the place sees them
    """
    rows = slice(None, None, view.channels)
    look = unit(place - view.raw.tx[rows]) + unit(place - view.raw.rx[rows])
    if view.grid.x_axis is not None and view.grid.y_axis is not None:
        look = look @ np.stack([view.grid.x_axis, view.grid.y_axis], axis=1)
    look = look - weight @ look / weight.sum()
    across = np.linalg.svd(look * np.sqrt(weight)[:, None], full_matrices=False)[2][0]
    turn = look @ across
    # the place lies ahead: where an antenna moves forwards, the direction to the place turns backwards
    forwards = -np.sign(weight @ (turn * (np.arange(view.n) - weight @ np.arange(view.n) / weight.sum())))
    return np.asarray(2 * np.pi * view.frequency / SPEED_OF_LIGHT * turn * (forwards or 1.0))
