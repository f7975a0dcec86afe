"""Orbit: where a satellite is, Earth-fixed, and what it sees."""

from __future__ import annotations

import datetime
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..base import arguments, validation
from ..base.types import PathLike
from ..earth import rotation, viewing, zero_doppler
from ..earth.dates import Date, date, seconds
from ..earth.elevation import ElevationModel
from ..earth.kepler import KeplerElements
from ..earth.state_vectors import StateVectors
from ..earth.two_line import TwoLineElements
from ..io import orbit_files
from ._orbit_arguments import Attitude, axes_of, ellipse, places, span_of, together
from .trajectory import BYTES_PER_PULSE, Trajectory

LINES_DAYS = 1.0  # days before and after the epoch of two-line elements, whose error grows by kilometres per day
ROUNDING = 1e-9  # s: a time outside the span by less counts as its end
DIFFERENCE = 0.5  # s: of velocities to accelerations, accurate to 1e-6 m/s^2


@dataclass(frozen=True, eq=False)
class Orbit:
    """Positions of a satellite in Earth-fixed WGS84 coordinates (ECEF): make it with states, kepler, tle or read.

    path   how positions are computed: state vectors, Kepler elements or two-line elements
    span   (first, last) time, s: other times are refused
    epoch  UTC of time 0, or None where it is unknown

    Times are seconds since the epoch, where a day has 86 400 s.

    >>> orbit = sarcl.Orbit.kepler(semi_major_axis=7.07e6, eccentricity=0, inclination=1.71)
    >>> place = orbit.geolocate(10.0, 900e3, heights=0.0)  # zero-Doppler time, s, and slant range, m
    >>> [round(float(value), 3) for value in orbit.locate(place)]
    [10.0, 900000.0]
    >>> times = np.arange(0.0, 100, 10)  # s
    >>> sampled = sarcl.Orbit.states(
    ...     times, orbit.positions(times), orbit.velocities(times), epoch="2026-05-01T12:00:00"
    ... )
    >>> sampled.describe()[:25]
    '10 state vectors every 10'
    >>> t = round(float(sampled.seconds("2026-05-01T12:00:30")), 6)  # s since the epoch
    >>> t, round(float(np.linalg.norm(sampled.accelerations(t))), 2)  # over the rotating Earth
    (30.0, 8.16)
    >>> pulses = orbit.trajectory(center=10.0, prf=1500, n_pulses=64)
    >>> view = orbit.view(10.0, place)
    >>> center, edge = orbit.boresight(10.0, look=0.5), orbit.footprint(10.0, look=0.5, width=(0.005, 0.03))
    >>> station = sarcl.Orbit.tle(  # needs sarcl[orbits]
    ...     "1 25544U 98067A   19343.69339541  .00001764  00000-0  38792-4 0  9991",
    ...     "2 25544  51.6439 211.2001 0007417  17.6667  85.6398 15.50103472202482",
    ... )
    >>> precise = sarcl.Orbit.read("S1A_POEORB.EOF")
    """

    path: StateVectors | KeplerElements | TwoLineElements
    span: tuple[float, float]
    epoch: np.datetime64 | None = None

    def __post_init__(self) -> None:
        if not isinstance(self.path, (StateVectors, KeplerElements, TwoLineElements)):
            raise TypeError(
                f"path is a {type(self.path).__name__}; make an orbit by Orbit.states, Orbit.kepler, Orbit.tle or "
                "Orbit.read"
            )
        object.__setattr__(self, "span", span_of(self.span))
        if self.epoch is not None:
            object.__setattr__(self, "epoch", date(self.epoch))

    @classmethod
    def states(
        cls, times: ArrayLike, positions: ArrayLike, velocities: ArrayLike | None = None, epoch: Date | None = None
    ) -> Orbit:
        """The orbit through state vectors: s (n,), m (n, 3), m/s (n, 3), Earth-fixed, at least 4.

        velocities  None: those of the positions, by polynomials through up to 8 of them

        Positions in between are interpolated: by Hermite polynomials through positions and velocities, or Lagrange
        polynomials through positions, whichever predicts states that are left out best. `describe` says which, and the
        error. ValueError for NaN, times that do not increase, gaps (twice the usual spacing and more), velocities that
        are not the derivative of the positions (inertial ones), states more than 1 m off their neighbours' curve, and
        states that do not fall as satellites do over the rotating Earth (inertial ones, km, wrong units of time).
        """
        p = validation.array("positions", positions, np.float64, ("n_states", 3))
        t = validation.array("times", times, np.float64, (len(p),))
        v = None if velocities is None else validation.array("velocities", velocities, np.float64, (len(p), 3))
        return cls(StateVectors.fitted(t, p, v), (float(t[0]), float(t[-1])), None if epoch is None else date(epoch))

    @classmethod
    def kepler(
        cls,
        semi_major_axis: float,
        eccentricity: float,
        inclination: float,
        node: float = 0.0,
        argument_of_perigee: float = 0.0,
        mean_anomaly: float = 0.0,
        *,
        epoch: Date | None = None,
        j2: bool = False,
        span: Sequence[float] | None = None,
    ) -> Orbit:
        """An elliptic orbit about the rotating Earth; its elements hold at time 0.

        semi_major_axis  m;  inclination, argument_of_perigee, mean_anomaly  rad
        node   of the ascending node, rad. With an epoch (UTC): right ascension, from the mean equinox of date;
               Greenwich mean sidereal time leads to the Earth-fixed frame. Without one: its longitude from Greenwich
               at time 0
        j2     with the secular drift of node, perigee and anomaly that the Earth's oblateness causes
        span   (first, last) time, s, default half a revolution before and after time 0

        ValueError for an eccentricity outside [0, 1), and a perigee below the Earth's surface.
        """
        zero = None if epoch is None else date(epoch)
        path = KeplerElements(
            semi_major_axis=semi_major_axis,
            eccentricity=eccentricity,
            inclination=inclination,
            node=node,
            perigee=argument_of_perigee,
            anomaly=mean_anomaly,
            greenwich=0.0 if zero is None else rotation.sidereal_time(zero),
            with_j2=j2,
        )
        half = np.pi / path.mean_motion
        return cls(path, (-half, half) if span is None else span_of(span), zero)

    @classmethod
    def tle(cls, line1: str, line2: str, *, span: Sequence[float] | None = None) -> Orbit:
        """The orbit of two-line elements, line1 and line2, by SGP4 (WGS72 constants): pip install sarcl[orbits].

        SGP4's frame (TEME) is rotated by Greenwich mean sidereal time. The elements themselves are good to about 1 km
        at their epoch. span: (first, last) s from that epoch, default a day before and after.
        ValueError for damaged lines; ImportError where sgp4 is missing.
        """
        path = TwoLineElements.parsed(line1, line2)
        seconds = LINES_DAYS * rotation.DAY
        return cls(path, (-seconds, seconds) if span is None else span_of(span), path.epoch)

    @classmethod
    def read(cls, path: PathLike) -> Orbit:
        """The orbit of a file of state vectors; its epoch is the first state's time (UTC).

        Sentinel-1 orbit files (EOF: POEORB, RESORB), Sentinel-1 annotations (their state vectors) and orbits in the XML
        of ISCE3 are known. FileNotFoundError, and ValueError for other files and for states that `states` refuses.
        """
        path = arguments.path("path", path)
        epoch, times, positions, velocities = orbit_files.load(path)
        try:
            return cls.states(times, positions, velocities, epoch)
        except ValueError as exc:
            raise ValueError(f"orbit file {path.name!r}: {exc}") from None

    def describe(self) -> str:
        """Words for the computation of positions: order and measured error of the interpolation, span of time."""
        start, stop = self.span
        since = "an unknown epoch" if self.epoch is None else f"{self.epoch} UTC"
        return f"{self.path.describe()}; from {start:.9g} to {stop:.9g} s after {since}"

    def __repr__(self) -> str:
        return f"Orbit({self.describe()})"

    def seconds(self, dates: Date | Sequence[Date] | NDArray[np.datetime64]) -> NDArray[np.float64]:
        """Seconds since the epoch (...) of dates, UTC (...): strings, datetimes or numpy's datetime64."""
        if self.epoch is None:
            raise ValueError("the orbit has no epoch, so dates have no time in it; give Orbit.states(..., epoch=...)")
        return seconds(dates, self.epoch)

    def positions(self, t: ArrayLike) -> NDArray[np.float64]:
        """Positions, m (..., 3), at times `t`, s (...). ValueError for times outside the span."""
        return self._states(t)[0]

    def velocities(self, t: ArrayLike) -> NDArray[np.float64]:
        """Velocities over the rotating Earth, m/s (..., 3), at times `t`, s (...): derivatives of the positions."""
        return self._states(t)[1]

    def accelerations(self, t: ArrayLike) -> NDArray[np.float64]:
        """Derivatives of the velocities, m/s^2 (..., 3), at times `t`, s (...), by differences over a second."""
        t = self._times(t)
        before, after = (np.clip(t + d, *self.span) for d in (-DIFFERENCE, DIFFERENCE))
        return np.asarray((self.velocities(after) - self.velocities(before)) / (after - before)[..., None])

    def trajectory(
        self,
        *,
        start: float | Date | None = None,
        prf: float,
        n_pulses: int | None = None,
        center: float | Date | None = None,
        duration: float | None = None,
        attitude: Attitude | None = None,
        look: float | None = None,
        side: Literal["right", "left"] = "right",
    ) -> Trajectory:
        """The track of n_pulses pulses from time `start`, s, at `prf`, Hz, with velocities and accelerations.

        start     or center, the time in the middle of the pulses: s since the epoch, or a date in UTC
        n_pulses  or duration, s: so many pulses as it has pulse intervals, rounded
        attitude  of the antenna, whose boresight looks `look` rad from straight down (against the ellipsoid's normal):
                  "zero-doppler": across the Earth-fixed velocity; "yaw": across its horizontal part (yaw steering: what
                  is left is the Doppler frequency of the vertical velocity); "orbital": across the velocity in space,
                  so that the Earth's rotation shifts the Doppler centroid. None: not aimed
        side      "right" or "left" of the velocity, seen from above

        The track is not stop-and-go: `echo` takes the receiver's positions when echoes arrive.
        """
        prf = validation.number("prf", prf, above=0)
        if (n_pulses is None) == (duration is None):
            raise ValueError("the length of the track is n_pulses or duration (s); give one of them")
        if duration is not None:
            n_intervals = validation.number("duration", duration, above=0) * prf
            what = f"a track of duration {duration:g} s with {n_intervals:.3g} pulses"
            validation.room(what, BYTES_PER_PULSE * n_intervals, "give a shorter duration or a lower prf")
            n_pulses = max(1, round(n_intervals))
        n_pulses = validation.count("n_pulses", n_pulses)
        validation.room(f"a track of {n_pulses:.3g} pulses", BYTES_PER_PULSE * float(n_pulses), "give fewer pulses")
        if (start is None) == (center is None):
            raise ValueError("the time of the track is start or center (s since the epoch, or a date); give one")
        first = self._time("start", start) if center is None else self._time("center", center)
        if center is not None:
            first -= (n_pulses - 1) / 2 / prf
        t = first + np.arange(n_pulses) / prf
        p, v = self._states(t)
        validation.choice("side", side, ("right", "left"))
        track = Trajectory(t, p, v, accelerations=self.accelerations(t), stop_and_go=False)
        if attitude is None:
            if look is not None:
                raise ValueError("look aims the antenna, which needs attitude='zero-doppler', 'yaw' or 'orbital'")
            return track
        if look is None:
            raise ValueError(f"attitude={attitude!r} needs look=, rad from straight down to the boresight")
        return replace(track, attitude=axes_of(p, v, attitude, look, side))

    def locate(
        self, positions: ArrayLike, *, span: Sequence[float] | None = None
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Zero-Doppler times, s (...), and slant ranges, m (...), of Earth-fixed positions, m (..., 3).

        span  (first, last) time to search, s, default the orbit's. Of several passes the closest counts.
        ValueError names the first position that the satellite never sees.
        """
        x = places(positions)
        within = self.span if span is None else span_of(span)
        self._times(np.array(within))
        t, r = zero_doppler.locate(self._at, within, x.reshape(-1, 3))
        return t.reshape(x.shape[:-1]), r.reshape(x.shape[:-1])

    def geolocate(
        self,
        t: ArrayLike,
        r: ArrayLike,
        heights: ArrayLike | ElevationModel = 0.0,
        side: Literal["right", "left"] = "right",
    ) -> NDArray[np.float64]:
        """Earth-fixed positions, m (..., 3), at zero-Doppler times `t`, s (...), and slant ranges `r`, m (...).

        heights  above the ellipsoid, m: a number, an array (...), or a `sarcl.ElevationModel`; where terrain has
                 several positions of one range (layover), the one closest to the point below the satellite is taken
        side     "right" or "left" of the velocity, seen from above

        ValueError names the first range that does not reach the ground, meets it behind the horizon, or meets no height
        of the model.
        """
        sign = {"right": 1.0, "left": -1.0}[validation.choice("side", side, ("right", "left"))]
        times = self._times(t)
        ranges = validation.converted("r", r, np.float64)
        validation.finite("r", ranges)
        if (ranges <= 0).any():
            raise ValueError(f"r reaches {ranges.min():g} m; slant ranges are positive, one way, in m")
        model = heights if isinstance(heights, ElevationModel) else None
        levels = np.zeros(()) if model is not None else validation.converted("heights", heights, np.float64)
        validation.finite("heights", levels)
        times, ranges, levels = together(t=times, r=ranges, heights=levels)
        p, v = self._at(times.ravel())
        x = zero_doppler.geolocate(p, v, ranges.ravel(), levels.ravel() if model is None else model, sign)
        return x.reshape(*times.shape, 3)

    def view(self, t: ArrayLike, positions: ArrayLike) -> viewing.View:
        """View of Earth-fixed positions, m (..., 3), from the satellite at times `t`, s (...): angles, ranges,
        Doppler."""
        x = places(positions)
        times, _ = together(t=self._times(t), positions=x[..., 0])
        p, v = self._states(times)
        x = np.broadcast_to(x, p.shape)
        if (p == x).all(axis=-1).any():
            raise ValueError("positions has the satellite's own position, which is in no direction from it")
        return viewing.view(p, v, self.accelerations(times), x)

    def boresight(
        self,
        t: ArrayLike,
        *,
        look: float,
        side: Literal["right", "left"] = "right",
        attitude: Attitude = "zero-doppler",
        height: float = 0.0,
    ) -> NDArray[np.float64]:
        """Positions, Earth-fixed, m (..., 3), that the boresight meets at a height, m, at times `t`, s (...).

        look, side, attitude  as in `trajectory`. The Doppler centroid and rate are those of `view` there.
        ValueError where the boresight passes over the horizon.
        """
        p, v = self._states(t)
        axes = axes_of(p.reshape(-1, 3), v.reshape(-1, 3), attitude, look, side)
        return zero_doppler.ray_ends(p.reshape(-1, 3), axes[:, :, 0], validation.number("height", height)).reshape(
            p.shape
        )

    def footprint(
        self,
        t: float,
        *,
        look: float,
        width: tuple[float, float],
        side: Literal["right", "left"] = "right",
        attitude: Attitude = "zero-doppler",
        height: float = 0.0,
        n: int = 64,
    ) -> NDArray[np.float64]:
        """Edge of a beam on the ground at a time `t`, s: n positions around it, Earth-fixed, m (n, 3), at a height, m.

        look, side, attitude  of the boresight, as in `trajectory`;  width  (azimuth, elevation) full angles between the
        edges, rad, of an elliptic beam. ValueError where the edge passes over the horizon.
        """
        p, v = self._states(validation.number("t", t))
        axes = axes_of(p[None], v[None], attitude, look, side)[0]
        widths = validation.array("width", width, np.float64, (2,))
        if not ((widths > 0) & (widths < np.pi)).all():
            raise ValueError(f"width is ({widths[0]:g}, {widths[1]:g}) rad; wanted two angles from 0 to pi")
        n = validation.count("n", n, 3)
        validation.room(f"an edge of {float(n):.3g} positions", 500.0 * n, "give a smaller n")
        body = ellipse(float(widths[0]), float(widths[1]), n)
        return zero_doppler.ray_ends(np.broadcast_to(p, (n, 3)), body @ axes.T, validation.number("height", height))

    def _time(self, name: str, value: object) -> float:
        """A time, s since the epoch: a number, or a date."""
        if isinstance(value, (str, datetime.date, np.datetime64)):
            return float(self.seconds(value))
        return validation.number(name, value)

    def _times(self, t: ArrayLike) -> NDArray[np.float64]:
        """Times, s (...), all within the span."""
        times = validation.converted("t", t, np.float64)
        validation.finite("t", times)
        start, stop = self.span
        outside = (times < start - ROUNDING) | (times > stop + ROUNDING)
        if outside.any():
            index, place = validation.first(outside)
            raise ValueError(
                f"t{place} = {times[index]:.9g} s is outside the orbit, which reaches from {start:.9g} to {stop:.9g} s "
                f"after {'its epoch' if self.epoch is None else self.epoch}; give times within it"
            )
        return np.asarray(np.clip(times, start, stop))

    def _states(self, t: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        times = self._times(t)
        p, v = self._at(times.ravel())
        return p.reshape(*times.shape, 3), v.reshape(*times.shape, 3)

    def _at(self, times: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Positions and velocities (n, 3) at times (n,) within the span."""
        return self.path.at(times)
