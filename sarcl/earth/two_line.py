"""Orbits of two-line elements, by SGP4: pip install sarcl[orbits]."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ..base.vectors import Floats
from .rotation import SIDEREAL_RATE, rotated, sidereal_time
from .state_vectors import interpolate

if TYPE_CHECKING:
    from sgp4.api import Satrec

# Name, columns and limits (first included, last not) of the numbers that SGP4 needs, by line
FIELDS = {
    1: (("year of the epoch", slice(18, 20), 0, 100), ("day of the epoch", slice(20, 32), 1, 367)),
    2: (
        ("inclination, degrees,", slice(8, 16), 0, 180.0001),
        ("right ascension of the node, degrees,", slice(17, 25), 0, 360.0001),
        ("eccentricity, its decimal point left out,", slice(26, 33), 0, 1e7),
        ("argument of perigee, degrees,", slice(34, 42), 0, 360.0001),
        ("mean anomaly, degrees,", slice(43, 51), 0, 360.0001),
        ("mean motion, revolutions per day,", slice(52, 63), 1e-9, 20),
    ),
}
STEP, NODES = 10.0, 12  # s, and number of positions of SGP4 per interpolation: below the rounding of float64


@dataclass(frozen=True, eq=False)
class TwoLineElements:
    """Two-line elements; times are in seconds since their epoch.

    satellite  sgp4.api.Satrec;  epoch  UTC;  greenwich  mean sidereal time at the epoch, rad;  lines  as given

    Velocities are the derivative of the positions. Those that SGP4 itself gives differ from it by metres per second,
    because they leave out rates of small terms: zero-Doppler times would not be times of closest approach.
    """

    satellite: Satrec
    epoch: np.datetime64
    greenwich: float
    lines: tuple[str, str]

    @classmethod
    def parsed(cls, line1: str, line2: str) -> TwoLineElements:
        """The elements of two lines. ValueError names the line and what is wrong with it."""
        for number, line in ((1, line1), (2, line2)):
            _check(number, line)
        _check_fields(line1, line2)
        if line1[2:7] != line2[2:7]:
            raise ValueError(f"line1 is of satellite {line1[2:7]} and line2 of {line2[2:7]}; give lines of one")
        try:
            from sgp4.api import WGS72, Satrec
        except ImportError as exc:
            raise ImportError("two-line elements need the package sgp4: pip install sarcl[orbits]") from exc
        satellite = Satrec.twoline2rv(line1, line2, WGS72)
        year, day = int(line1[18:20]), line1[20:32].strip()
        day_number, _, fraction = day.partition(".")
        epoch = np.datetime64(f"{year + (1900 if year >= 57 else 2000)}-01-01", "ns")
        nanoseconds = (int(day_number) - 1) * 86_400 * 10**9 + int(fraction.ljust(8, "0")[:8]) * 864_000
        epoch = epoch + np.timedelta64(nanoseconds, "ns")
        return cls(satellite, epoch, sidereal_time(epoch), (line1, line2))

    def __reduce__(self) -> tuple[object, tuple[str, str]]:
        """By the lines: sgp4's own object cannot be copied."""
        return type(self).parsed, self.lines

    def teme(self, times: Floats) -> tuple[Floats, Floats]:
        """Positions, m, and velocities, m/s (n, 3), as SGP4 gives them: true equator, mean equinox of date (TEME)."""
        positions, velocities = np.empty((len(times), 3)), np.empty((len(times), 3))
        for i, t in enumerate(times.tolist()):
            error, positions[i], velocities[i] = self.satellite.sgp4_tsince(t / 60)
            if error or not np.isfinite(positions[i]).all():
                from sgp4.api import SGP4_ERRORS

                raise ValueError(
                    f"the two-line elements give no position at {t:g} s from their epoch {self.epoch}: "
                    f"{SGP4_ERRORS.get(error, 'not finite')}; use elements of a date that is closer"
                )
        return positions * 1e3, velocities * 1e3

    def at(self, times: Floats) -> tuple[Floats, Floats]:
        """Earth-fixed positions, m, and velocities, m/s (n, 3), at times, s (n,)."""
        steps = np.floor(times / STEP).astype(np.int64)[:, None] + np.arange(1 - NODES // 2, NODES // 2 + 1)
        nodes, inverse = np.unique(steps, return_inverse=True)
        inverse = inverse.reshape(steps.shape)
        inertial, _ = self.teme(nodes * STEP)
        fixed = rotated(-(self.greenwich + SIDEREAL_RATE * (nodes * STEP)), inertial)
        return interpolate(np.asarray(steps * STEP), fixed[inverse], None, times)

    def describe(self) -> str:
        """Words for the computation of positions."""
        return (
            f"SGP4 of the two-line elements of {self.epoch} (TEME), rotated by Greenwich mean sidereal time; "
            f"interpolated between positions {STEP:g} s apart"
        )


def _check(number: int, line: object) -> None:
    """ValueError unless `line` is line 1 or 2 of two-line elements, with the right check sum."""
    name = f"line{number}"
    if not isinstance(line, str) or len(line) < 69 or line[:2] != f"{number} ":
        raise ValueError(f"{name} is {line!r:.90}; wanted the 69 characters of line {number}, from '{number} ' on")
    total = sum(int(c) if c.isdigit() else c == "-" for c in line[:68]) % 10
    if str(total) != line[68]:
        raise ValueError(f"{name} has check sum {line[68]!r}, but its characters add up to {total}; copy it again")


def _check_fields(line1: str, line2: str) -> None:
    """ValueError where a number that SGP4 needs is missing, or outside its limits."""
    for number, line in ((1, line1), (2, line2)):
        for name, columns, low, high in FIELDS[number]:
            text = line[columns]
            try:
                value = float(text) if text.strip("0123456789. ") == "" else np.nan
            except ValueError:
                value = np.nan
            if not low <= value < high:
                raise ValueError(
                    f"line{number} has {text!r} in columns {columns.start + 1} to {columns.stop}; the {name} is a "
                    f"number from {low:g} to {high:g}: copy the damaged line again"
                )
