"""Kepler orbits about the rotating Earth, with the secular drift that the Earth's oblateness causes where asked for."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..base import validation, wgs84
from ..base.vectors import Floats
from .rotation import GM, J2, RATE, to_earth_fixed

FARTHEST = 1e11  # m: what is farther from the Earth is in no orbit about it


# angles by their names as arguments of Orbit.kepler
ANGLES = {"inclination": "inclination", "node": "node", "perigee": "argument_of_perigee", "anomaly": "mean_anomaly"}


@dataclass(frozen=True, eq=False)
class KeplerElements:
    """Elements at time 0, and their rates.

    semi_major_axis  m;  eccentricity;  inclination, node, perigee, anomaly  rad (the anomaly is the mean one)
    greenwich        angle from the direction that the node is counted from to the Greenwich meridian at time 0, rad
    with_j2          node, perigee and anomaly drift as the second zonal harmonic makes them on average. What it does
                     within a revolution (about 10 km in a low orbit) is left out
    """

    semi_major_axis: float
    eccentricity: float
    inclination: float
    node: float
    perigee: float
    anomaly: float
    greenwich: float
    with_j2: bool

    def __post_init__(self) -> None:
        """ValueError for elements that are no ellipse above the Earth's surface, by the names of Orbit.kepler."""
        a = validation.number("semi_major_axis", self.semi_major_axis, above=0)
        e = validation.number("eccentricity", self.eccentricity, least=0)
        if a > FARTHEST:
            raise ValueError(f"semi_major_axis is {a:g} m, farther than the Sun; give m, from the Earth's centre")
        if e >= 1:
            raise ValueError(f"eccentricity is {e:g}; an ellipse has less than 1")
        if a * (1 - e) < wgs84.SEMI_MAJOR * (1 - wgs84.FLATTENING):
            raise ValueError(
                f"the perigee is {a * (1 - e):.7g} m from the Earth's centre, below its surface; give a larger "
                "semi_major_axis (m, from the centre), or a smaller eccentricity"
            )
        numbers = {"semi_major_axis": a, "eccentricity": e}
        for name, argument in ANGLES.items():
            numbers[name] = validation.number(argument, getattr(self, name))
        if not 0 <= numbers["inclination"] <= np.pi:
            raise ValueError(f"inclination is {numbers['inclination']:g} rad, outside 0 to pi: was it in degrees?")
        for name, number in numbers.items():
            object.__setattr__(self, name, number)
        object.__setattr__(self, "with_j2", validation.flag("j2", self.with_j2))

    @property
    def mean_motion(self) -> float:
        """Mean motion without drift, rad/s: Kepler's third law."""
        return float(np.sqrt(GM / self.semi_major_axis**3))

    @property
    def rates(self) -> tuple[float, float, float]:
        """Rates of node, argument of perigee and mean anomaly, rad/s.

        Source: Vallado, Fundamentals of Astrodynamics, eqs (9-38) to (9-40): secular terms of first order in J2.
        """
        n = self.mean_motion
        if not self.with_j2:
            return 0.0, 0.0, n
        shape = 1 - self.eccentricity**2
        factor = 1.5 * n * J2 * (wgs84.SEMI_MAJOR / (self.semi_major_axis * shape)) ** 2
        s2 = np.sin(self.inclination) ** 2
        drift = factor * np.sqrt(shape) * (1 - 1.5 * s2)
        return float(-factor * np.cos(self.inclination)), float(factor * (2 - 2.5 * s2)), float(n + drift)

    def at(self, times: Floats) -> tuple[Floats, Floats]:
        """Earth-fixed positions, m, and velocities, m/s (n, 3), at times, s (n,)."""
        positions, velocities = self.inertial(times)
        return to_earth_fixed(self.greenwich + RATE * times, RATE, positions, velocities)

    def inertial(self, times: Floats) -> tuple[Floats, Floats]:
        """Inertial positions, m, and velocities, m/s (n, 3); x points to where the node is counted from."""
        a, e = self.semi_major_axis, self.eccentricity
        node_rate, perigee_rate, anomaly_rate = self.rates
        eccentric = eccentric_anomaly(self.anomaly + anomaly_rate * times, e)
        c, s, b = np.cos(eccentric), np.sin(eccentric), np.sqrt(1 - e**2)
        speed = a * anomaly_rate / (1 - e * c)
        x, y, vx, vy = a * (c - e), a * b * s, -speed * s, speed * b * c  # in the plane of the orbit, x to perigee
        cw, sw = np.cos(self.perigee + perigee_rate * times), np.sin(self.perigee + perigee_rate * times)
        x, y, vx, vy = cw * x - sw * y, sw * x + cw * y, cw * vx - sw * vy, sw * vx + cw * vy  # x to the node
        vx, vy = vx - perigee_rate * y, vy + perigee_rate * x
        cn, sn = np.cos(self.node + node_rate * times), np.sin(self.node + node_rate * times)
        ci, si = np.cos(self.inclination), np.sin(self.inclination)

        def turned(u: Floats, v: Floats) -> Floats:
            return np.stack([cn * u - sn * ci * v, sn * u + cn * ci * v, si * v], axis=-1)

        positions, velocities = turned(x, y), turned(vx, vy)
        velocities[..., :2] += node_rate * np.stack([-positions[..., 1], positions[..., 0]], axis=-1)
        return positions, velocities

    def describe(self) -> str:
        """Words for the computation of positions."""
        drift = "with the secular drift of J2" if self.with_j2 else "without perturbations"
        return f"Kepler elements {drift}, in closed form"


def eccentric_anomaly(mean: Floats, eccentricity: float) -> Floats:
    """Eccentric anomalies E, rad, of E - e sin E = M: Newton's iteration within bounds that hold the root."""
    turn = 2 * np.pi * np.round(mean / (2 * np.pi))
    m = mean - turn
    low, high = m - eccentricity, m + eccentricity
    e = m + eccentricity * np.sin(m) / (1 - eccentricity * np.cos(m)) if eccentricity < 0.3 else np.sign(m) * np.pi
    for _ in range(100):
        e = np.where((e >= low) & (e <= high), e, (low + high) / 2)
        excess = e - eccentricity * np.sin(e) - m
        low, high = np.where(excess <= 0, e, low), np.where(excess >= 0, e, high)
        step = excess / (1 - eccentricity * np.cos(e))
        e = e - step
        if np.abs(step).max(initial=0.0) <= 4e-16:
            break
    return np.asarray(e + turn)
