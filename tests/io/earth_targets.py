"""Echoes of known targets on the Earth, from an aircraft and from an orbit, by one platform and by two."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

import sarcl

C = 299792458.0
ORIGIN = 47.2, 8.5, 420.0  # latitude, longitude, height
OFFSETS = np.array([[0.0, 0.0], [5.0, -4.0], [-7.0, 6.0]])  # m, of targets on the plane: x, y
AMPLITUDES = np.array([1.0, 0.8, 1.2])


@dataclass(frozen=True)
class Case:
    """Echoes of known targets, in local coordinates where there is an origin."""

    raw: sarcl.PhaseHistory
    targets: np.ndarray  # Earth-fixed, m (n, 3); the first is the reference point
    origin: tuple[float, float, float] | None = None

    @property
    def resolution(self) -> float:
        return C / 2 / float(self.raw.bandwidth[0])  # m, of range; the arcs are as long as the azimuth needs


def two_way(tx, rx, x):
    """Path from the sender to a point and on to the receiver, m (n,)."""
    return np.linalg.norm(tx - x, axis=1) + np.linalg.norm(rx - x, axis=1)


def echoes(tx, rx, targets, reference, time, velocities):
    """The sum over targets, term by term, in float64."""
    n, bandwidth, center = 96, 150e6, 9.6e9
    f = center - bandwidth / 2 + (np.arange(n) + 0.5) * bandwidth / n
    ranges = two_way(tx, rx, reference) / 2
    delays = [2 * np.pi / C * (two_way(tx, rx, x) - 2 * ranges)[:, None] for x in targets]
    samples = sum(a * np.exp(-1j * delay * f) for a, delay in zip(AMPLITUDES, delays, strict=True))
    return sarcl.PhaseHistory(
        samples.astype(np.complex64),
        frequency=f[0],
        frequency_step=bandwidth / n,
        tx=tx,
        rx=rx,
        reference_range=ranges,
        time=time,
        tx_velocity=velocities[0],
        rx_velocity=velocities[1],
        polarization=np.full(len(tx), "VH"),
    )


def aircraft(is_bistatic):
    """10 km away on a straight line, in local coordinates; a receiver on another aircraft."""
    time = np.linspace(-1.0, 1.0, 161)
    velocity = np.array([10.0, 100.0, 1.0])
    tx = np.array([-8e3, 500.0, 6e3]) + time[:, None] * velocity
    other = np.array([-5.0, 90.0, 0.0])
    rx = np.array([-6e3, -4e3, 5e3]) + time[:, None] * other if is_bistatic else None
    corner, axes = sarcl.wgs84.ecef(ORIGIN[1], ORIGIN[0], ORIGIN[2]), sarcl.wgs84.local_axes(ORIGIN[1], ORIGIN[0])
    local = np.pad(OFFSETS, ((0, 0), (0, 1)))
    velocities = np.tile(velocity, (161, 1)), np.tile(other if is_bistatic else velocity, (161, 1))
    raw = echoes(tx, tx if rx is None else rx, local, np.zeros(3), time, velocities)
    return Case(raw, corner + local @ axes, ORIGIN)


def orbit(is_bistatic):
    """800 km high, Earth-fixed, the receiver where the echo arrives; or on a second satellite, behind the first."""
    path = sarcl.Orbit.kepler(semi_major_axis=7178e3, eccentricity=0.001, inclination=1.7)
    track = path.trajectory(start=10.0, prf=60.0, n_pulses=121)
    center = path.geolocate([11.0], [950e3], side="right")[0]
    longitude, latitude, _ = (float(v) for v in sarcl.wgs84.geodetic(center))
    axes = sarcl.wgs84.local_axes(longitude, latitude)
    targets = center + np.pad(OFFSETS, ((0, 0), (0, 1))) @ axes
    time = track.times
    delay = 2 * np.linalg.norm(track.positions - center, axis=1) / C
    late = time + delay - (12.0 if is_bistatic else 0.0)
    rx, rx_velocity = path.positions(late), path.velocities(late)
    raw = echoes(track.positions, rx, targets, center, time, (track.velocities, rx_velocity))
    return Case(raw, targets)


CASES = {"aircraft": aircraft, "orbit": orbit}
