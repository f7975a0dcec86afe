"""Strip maps on an equivalent straight track: their Doppler centroid, and the speed of that track.

A point of slant range r and zero-Doppler time t has R(t')^2 = r^2 + v^2 (t' - t)^2, v the effective velocity. So a
satellite over the rotating Earth, or data that come with an effective velocity alone, are focused as if the antenna
flew along y at v, and the point were at (r, v t, 0): Trajectory.line(start=(0, v t0, 0), velocity=(0, v, 0), ...)
The Doppler frequency is f_d = -(2/lambda) dR/dt, positive for a beam that looks forward:
f_d = (2 v/lambda) sin(squint).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ..base.constants import SPEED_OF_LIGHT
from ..base.validation import array, instance, number
from ..model.phase_history import PhaseHistory
from ..model.trajectory import Trajectory

MOST_ROWS = 4096  # rows about the middle that the Doppler centroid is taken from


class EffectiveVelocity(NamedTuple):
    """The straight track that sees a point as the true one does.

    speed  m/s;  time  s, of the closest approach;  range  m, there;  residual  m, largest error of the hyperbola

    >>> straight = sarcl.Trajectory.line(start=(-5e3, -50, 4e3), velocity=(0, 100, 0), prf=100, n_pulses=101)
    >>> round(sarcl.effective_velocity(straight, (0, 0, 0)).speed, 3)
    100.0
    """

    speed: float
    time: float
    range: float
    residual: float


def effective_velocity(track: Trajectory, point: ArrayLike) -> EffectiveVelocity:
    """Speed of the straight track from which a point, m (3,), has the ranges that it has from `track`.

    R(t)^2 = range^2 + speed^2 (t - time)^2, fitted over all pulses by least squares. Take pulses about the closest
    approach, as many as an aperture has. ValueError: fewer than 3 pulses, a track without times, or one whose range
    does not grow on both sides of a closest approach.

    >>> orbit = sarcl.Orbit.kepler(semi_major_axis=7.07e6, eccentricity=0, inclination=1.71)
    >>> pulses = orbit.trajectory(center=0.0, prf=500, n_pulses=501)
    >>> round(sarcl.effective_velocity(pulses, orbit.geolocate(0.0, 900e3, heights=0.0)).speed)
    7203
    """
    instance("track", track, Trajectory)
    x = array("point", point, np.float64, (3,))
    if len(track) < 3:
        raise ValueError(f"the track has {len(track)} pulses; the ranges of at least 3 determine a velocity")
    t = track.known_times
    middle, scale = float(t.mean()), float(np.ptp(t)) / 2
    u = (t - middle) / scale
    path = np.linalg.norm(track.positions - x, axis=1)
    # less the range at the middle, so that the squares lose no digits
    base = float(path[len(path) // 2])
    square = (path - base) * (path + base)
    c, b, a = np.polyfit(u, square, 2)
    if not c > 0:
        raise ValueError(
            "the range does not grow on both sides of a closest approach: the track turns about the point, and no "
            "straight track sees it so; use backproject with the positions themselves"
        )
    shift, nearest = -b / (2 * c), base**2 + a - b**2 / (4 * c)
    if not nearest > 0:
        raise ValueError("the ranges are those of no straight track; check positions and times")
    residual = np.sqrt(nearest + c * (u - shift) ** 2) - path
    return EffectiveVelocity(
        float(np.sqrt(c) / scale), middle + shift * scale, float(np.sqrt(nearest)), float(np.abs(residual).max())
    )


def doppler_centroid(raw: PhaseHistory, *, near: float = 0.0) -> float:
    """Mean Doppler frequency of the echoes, Hz, about the centre frequency; positive where the antennas approach.

    raw   rows of one channel in the order of time, evenly spaced, compressed or not; changes of the reference range
          between rows are taken into account
    near  Hz: the data determine the centroid but for multiples of the pulse rate; the one nearest to this is returned

    From the phase between neighbouring rows, summed over all samples. ValueError: no times, one row, uneven times,
    several channels (a time occurs twice), or echoes that are zero.
    Source: Madsen, IEEE Trans. AES-25, 1989, pp. 134-140.

    >>> flight = sarcl.Trajectory.line(start=(-5e3, -950, 4e3), velocity=(0, 100, 0), prf=500, n_pulses=100)
    >>> round(sarcl.doppler_centroid(sarcl.echo(scene, chirp, flight), near=900))
    928
    """
    instance("raw", raw, PhaseHistory)
    near = number("near", near)
    if raw.time is None or raw.n_rows < 2:
        raise ValueError("the Doppler centroid needs at least 2 rows and their times; give PhaseHistory(..., time=)")
    steps = np.diff(raw.time)
    if not (steps > 0).all() or np.ptp(steps) > 1e-3 * steps.mean():
        raise ValueError(
            "raw.time does not increase in even steps; give the rows of one channel in the order of time, such as "
            "raw.select(polarization=...)"
        )
    first = max(0, (raw.n_rows - MOST_ROWS) // 2)
    last = min(first + MOST_ROWS, raw.n_rows)
    total, before = 0j, raw.read(first, first + 1)[0].astype(np.complex128)
    n = np.arange(raw.n_samples)
    for row in range(first + 1, last):
        samples = raw.read(row, row + 1)[0].astype(np.complex128)
        moved = raw.reference_range[row] - raw.reference_range[row - 1]
        frequency = raw.frequency[row] + n * raw.frequency_step[row]
        total += complex(np.vdot(before, samples * np.exp(-4j * np.pi * moved / SPEED_OF_LIGHT * frequency)))
        before = samples
    if total == 0:
        raise ValueError("the echoes are zero, and have no Doppler centroid")
    rate = float(1 / steps.mean())
    centroid = float(np.angle(total)) / (2 * np.pi) * rate
    return centroid + rate * float(np.rint((near - centroid) / rate))
