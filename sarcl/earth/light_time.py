"""Positions of antennas while a pulse is on its way: to a point of the rotating Earth and back.

In an inertial frame that coincides with the Earth-fixed one when the pulse is sent, the point and the receiver have
moved when the pulse arrives at them: c tau_1 = |T - x(t + tau_1)| and c tau_2 = |x(t + tau_1) - R(t + tau_1 + tau_2)|.
Seen from the Earth, with D(a) a rotation by the angle a about its axis, both paths begin or end at the resting point:

    c tau_1 = |D(-w tau_1) T - x|,  c tau_2 = |x - D(w tau_2) R(t + tau_1 + tau_2)|

so that the half path of two antennas at D(-w tau_1) T and D(w tau_2) R is exact for the point.
"""

from __future__ import annotations

import numpy as np

from ..base.constants import SPEED_OF_LIGHT
from ..base.vectors import Floats
from .rotation import RATE, rotated

ITERATIONS = 6  # each reduces the error by a factor of c over the speed: 2e4 or more


def antennas_in_flight(
    positions: Floats, velocities: Floats, accelerations: Floats, point: Floats
) -> tuple[Floats, Floats, Floats, Floats]:
    """Antennas of exact paths to a point, from states when pulses are sent: m, m/s, m/s^2 (n, 3), Earth-fixed.

    point  m (3,), or (n, 3). Returns the transmitter's and the receiver's positions, m (n, 3), and the delays tau_1 and
    tau_2, s (n,). In between, the receiver moves with constant acceleration: after 10 ms that is wrong by a nanometre.
    """
    down = np.linalg.norm(positions - point, axis=-1) / SPEED_OF_LIGHT
    for _ in range(ITERATIONS):
        tx = rotated(-RATE * down, positions)
        down = np.linalg.norm(tx - point, axis=-1) / SPEED_OF_LIGHT
    up = down
    for _ in range(ITERATIONS):
        rx, _ = receivers(positions, velocities, accelerations, down, up)
        up = np.linalg.norm(rx - point, axis=-1) / SPEED_OF_LIGHT
    return tx, rx, down, up


def receivers(
    positions: Floats, velocities: Floats, accelerations: Floats, down: Floats, up: Floats
) -> tuple[Floats, Floats]:
    """Positions D(w tau_2) R, m, and velocities, m/s (..., 3), of receivers at delays tau_1 and tau_2, s (...)."""
    after = (down + up)[..., None]
    later = positions + after * (velocities + after / 2 * accelerations)
    return rotated(RATE * up, later), rotated(RATE * up, velocities + after * accelerations)


def transmitters(positions: Floats, velocities: Floats, down: Floats) -> tuple[Floats, Floats]:
    """Positions D(-w tau_1) T, m, and velocities, m/s (..., 3), of transmitters at delays tau_1, s (...)."""
    return rotated(-RATE * down, positions), rotated(-RATE * down, velocities)
