"""An evenly sampled smooth track."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.polynomial import chebyshev

from ...base import wgs84
from ...base.constants import SPEED_OF_LIGHT
from ...model.phase_history import PhaseHistory

EVEN = 1e-3  # pulse intervals, largest deviation of pulse times from even spacing
FINEST = 1e-3  # pulse intervals, coarsest resolution of times
DEGREES = 7  # highest degree of the polynomials of time through the positions
UP = np.array([0.0, 0.0, 1.0])
REMEDY = "use backproject, which takes any track"


@dataclass(frozen=True, eq=False)
class Track:
    """Positions of the phase centre, midway between transmitter and receiver, as polynomials of time.

    epoch         time of the first row, s, from which all other times of the room count: they may be absolute, of 2e9 s
    step          time between rows, s: the first has the time 0;  n_rows
    coefficients  (degree + 1, 3), m: Chebyshev polynomials over the rows' span
    is_line       whether the positions are a straight, evenly sampled line to within the accuracy asked for, and
                  transmitter and receiver are one antenna
    """

    step: float
    n_rows: int
    coefficients: np.ndarray
    is_line: bool
    epoch: float = 0.0

    @classmethod
    def of(cls, raw: PhaseHistory, accuracy: float) -> Track:
        """The track of echoes, to a phase error of `accuracy`, rad, if polynomials allow it.

        ValueError: fewer than 8 rows, no times, uneven times, rows of several channels, an antenna that rests.
        """
        if raw.n_rows < 8:
            raise ValueError(f"raw has {raw.n_rows} rows; the Doppler spectrum of range_doppler needs at least 8")
        if raw.time is None:
            raise ValueError("raw.time is None, and rows of the image are times: give dataclasses.replace(raw, time=)")
        _check_resolution(raw.time)
        steps = np.diff(raw.time)
        if not (steps > 0).all():
            i = int(np.argmin(steps > 0)) + 1
            raise ValueError(
                f"raw.time[{i}] is {raw.time[i]:.9g} s after {raw.time[i - 1]:.9g} s; range_doppler needs one row "
                "per pulse in the order of time: take one channel with raw.select(polarization=..., channel=...)"
            )
        step = float(raw.time[-1] - raw.time[0]) / (raw.n_rows - 1)
        off = np.abs(raw.time - raw.time[0] - step * np.arange(raw.n_rows)) / step
        if off.max() > EVEN:
            raise ValueError(
                f"pulses are not evenly spaced in time: raw.time[{int(off.argmax())}] is {off.max():.2g} pulse "
                f"intervals from even spacing, and the FFT of range_doppler allows {EVEN:g}; {REMEDY}"
            )
        x = np.linspace(-1, 1, raw.n_rows)
        middle = (raw.tx + raw.rx) / 2
        origin = middle.mean(axis=0)
        wavenumber = 4 * np.pi / SPEED_OF_LIGHT * float(raw.center_frequency.max())
        for degree in range(1, min(DEGREES, raw.n_rows // 2) + 1):
            fitted = chebyshev.chebfit(x, middle - origin, degree)
            rest = float(np.abs(middle - origin - chebyshev.chebval(x, fitted).T).max())
            if wavenumber * rest <= accuracy:
                break
        fitted[0] += origin
        track = cls(step, raw.n_rows, fitted, degree == 1 and raw.is_monostatic, float(raw.time[0]))
        if not np.linalg.norm(track.states(np.array([track.stop / 2]))[1]) * step > 0:
            raise ValueError(f"the antenna rests at {middle[0]}; a synthetic aperture needs a moving one")
        return track

    @property
    def times(self) -> np.ndarray:
        """Times of the rows, s (n_rows,)."""
        return self.step * np.arange(self.n_rows)

    @property
    def stop(self) -> float:
        """Time of the last row, s."""
        return self.step * (self.n_rows - 1)

    @property
    def speed(self) -> float:
        """Speed at the middle of the track, m/s."""
        return float(np.linalg.norm(self.states(np.array([self.stop / 2]))[1]))

    def states(self, times: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Positions, m, and velocities, m/s, (n, 3) at times, s (n,), also beyond the rows."""
        half = self.stop / 2
        x = np.asarray(times) / half - 1
        velocity = chebyshev.chebval(x, chebyshev.chebder(self.coefficients)).T / half
        return chebyshev.chebval(x, self.coefficients).T, np.broadcast_to(velocity, (len(x), 3))

    @property
    def is_earth_fixed(self) -> bool:
        """Whether coordinates are Earth-fixed: told by the distance from their origin."""
        return wgs84.is_earth_fixed(self.coefficients[0])

    def side(self, raw: PhaseHistory, asked: str | None) -> float:
        """1 right of the track, -1 left: as asked, or where the origin is if it lies in every row's range window."""
        if asked is not None:
            if not isinstance(asked, str) or asked not in ("left", "right"):
                raise ValueError(f"side is {asked!r:.60}; choose 'left' or 'right' of the track, seen from above")
            return 1.0 if asked == "right" else -1.0
        off = (np.linalg.norm(raw.tx, axis=1) + np.linalg.norm(raw.rx, axis=1)) / 2 - raw.reference_range
        position, velocity = self.states(np.array([self.stop / 2]))
        right = np.cross(velocity[0], UP)
        across = -float(position[0] @ right) / max(float(np.linalg.norm(right)), 1e-300)
        unseen = self.is_earth_fixed or bool((np.abs(off) > raw.swath / 2).any())
        if unseen or abs(across) < 1e-6 * float(np.linalg.norm(position)):
            raise ValueError(
                "side is None, and the echoes do not tell it: the origin is not in the range window of every row; "
                "give side='left' or side='right' of the track, seen from above"
            )
        return float(np.sign(across))


def _check_resolution(time: np.ndarray) -> None:
    """ValueError where times are so far from 0 that float64 does not resolve the pulse interval."""
    interval = float(abs(time[-1] - time[0])) / (len(time) - 1)
    rounding = float(np.spacing(np.abs(time).max()))
    if rounding > FINEST * interval > 0:
        raise ValueError(
            f"raw.time reaches {np.abs(time).max():.9g} s, where float64 resolves {rounding:.2g} s, "
            f"{rounding / interval:.2g} of the pulse interval, and {FINEST:g} is needed: give times from the first "
            "pulse on, as they were before an epoch was added, by dataclasses.replace(raw, time=)"
        )
