"""Straight, evenly spaced tracks, and the coordinates of scatterers about them: azimuth and slant range."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...base.constants import SPEED_OF_LIGHT
from ...base.errors import NotApplicable
from ...model.trajectory import Trajectory


@dataclass(frozen=True, eq=False)
class StraightTrack:
    """Pulses at start + n spacing along, n = 0 ... n_pulses - 1.

    start      m (3,);  along  unit vector (3,);  spacing  m
    prf        Hz, mean pulse repetition frequency
    deviation  m, largest distance of a pulse from its place on this line
    """

    start: np.ndarray
    along: np.ndarray
    spacing: float
    n_pulses: int
    prf: float
    deviation: float

    @property
    def length(self) -> float:
        """Distance of the last pulse from the first, m."""
        return self.spacing * (self.n_pulses - 1)

    def coordinates(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Azimuth (n,), m from the first pulse, and slant range at closest approach (n,), m, of points, m (n, 3)."""
        offset = points - self.start
        azimuth = offset @ self.along
        offset -= azimuth[:, None] * self.along
        return azimuth, np.sqrt((offset**2).sum(axis=1))

    def across(self, points: np.ndarray) -> np.ndarray:
        """Unit vectors from the line to points, m (n, 3), at closest approach: (n, 3)."""
        offset = points - self.start
        offset -= (offset @ self.along)[:, None] * self.along
        return np.asarray(offset / np.linalg.norm(offset, axis=1, keepdims=True))

    def antennas(self, azimuth: np.ndarray, slant_range: np.ndarray, sine: float | np.ndarray) -> np.ndarray:
        """Positions on the line, m (n, 3), from which scatterers are seen at `sine`: (antenna - scatterer) . along over
        their distance."""
        return self.start + (azimuth + slant_range * tangent(sine))[:, None] * self.along


def tangent(sine: float | np.ndarray) -> np.ndarray:
    """Tangent of an angle within +-90 deg from its sine."""
    return np.asarray(sine / np.sqrt(1 - np.square(sine)))


def straight_track(track: Trajectory, frequency: float, allowed: float) -> StraightTrack:
    """The line of a track. NotApplicable for a track that is no straight, evenly spaced line.

    frequency  Hz, the highest;  allowed  phase error, rad, that deviations from the line may cause
    """
    n = len(track)
    if n < 2:
        raise NotApplicable("the track has one pulse; spectral_echo needs a line of them: use echo")
    step = (track.positions[-1] - track.positions[0]) / (n - 1)
    spacing = float(np.linalg.norm(step))
    line = track.positions[0] + np.arange(n)[:, None] * step
    if spacing == 0:
        raise NotApplicable(
            "the track ends where it begins, which gives no line of pulses; use echo, which takes any track"
        )
    off = track.positions - line
    away = np.linalg.norm(off, axis=1)
    worst = int(np.argmax(away))
    most = allowed * SPEED_OF_LIGHT / (4 * np.pi * frequency)
    if away[worst] > most:
        along = off @ (step / spacing)
        beside = float(np.sqrt(max(away[worst] ** 2 - along[worst] ** 2, 0.0)))
        what = "straight" if beside > abs(along[worst]) else "evenly spaced"
        raise NotApplicable(
            f"the pulses of the track are not {what}: pulse {worst} lies {beside:.3g} m beside the line from the first "
            f"to the last and {along[worst]:+.3g} m along it from its place among evenly spaced pulses, where this "
            f"tolerance allows {most:.2g} m; use echo, which takes any track, or Trajectory.line"
        )
    prf = (n - 1) / float(track.known_times[-1] - track.known_times[0])
    if track.attitude is not None:
        turn = np.abs(track.attitude - track.attitude[0]).max(axis=(1, 2))
        if turn.max() > 1e-9:
            raise NotApplicable(
                f"the antennas turn along the track (attitude of pulse {int(np.argmax(turn))}); spectral_echo needs "
                "the same attitude at all pulses, such as pointing.stripmap gives: use echo for others"
            )
    return StraightTrack(track.positions[0], step / spacing, spacing, n, prf, float(away[worst]))
