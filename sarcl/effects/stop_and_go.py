"""Errors of the stop-and-go approximation: antennas move while a pulse travels, and while it is transmitted."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..base import constants, validation
from ..model.lazy_rows import RowsOnDemand
from ..model.phase_history import PhaseHistory
from ..model.trajectory import Trajectory
from ..model.waveform import Waveform

ITERATIONS = 60  # half the change after each: 1e-18 of the first remains
ROUNDING = 1e-14  # relative change of coordinates and delays that is rounding, which iterations need not reduce


@dataclass(frozen=True, eq=False)
class StopAndGo:
    """Errors of the stop-and-go approximation per pulse and point (n_pulses, n_points), from `stop_and_go_error`.

    flight      m: half the true path, to the receiver's position when the echo arrives, minus the half path of `echo`
    chirp       m: apparent range minus half the path: the Doppler shift of a chirp acts as a delay
    phase       rad: 4 pi fc flight/c + pi doppler^2/rate, the phase (of exp(-j phase)) at the centre of the band
    smear       rad: phase at the edges of the band beyond `phase` and `chirp`
    doppler     Hz, Doppler frequency of the echo

    A phase that is constant or linear in time only displaces the image; `defocus` is the rest.
    """

    flight: NDArray[np.float64]
    chirp: NDArray[np.float64]
    phase: NDArray[np.float64]
    smear: NDArray[np.float64]
    doppler: NDArray[np.float64]
    times: NDArray[np.float64]

    @property
    def defocus(self) -> np.ndarray:
        """Largest deviation of the phase from its best straight line over the pulses, rad (n_points,)."""
        t = self.times - self.times.mean()
        line = np.stack([np.ones_like(t), t / max(float(np.abs(t).max()), 1e-300)], axis=-1)
        return np.asarray(np.abs(self.phase - line @ np.linalg.lstsq(line, self.phase, rcond=None)[0]).max(axis=0))


def stop_and_go_error(
    track: Trajectory,
    points: ArrayLike,
    waveform: Waveform,
    *,
    receiver: Trajectory | None = None,
    used: Trajectory | None = None,
) -> StopAndGo:
    """Errors of a stop-and-go echo at points, m (m, 3), of a transmitter on `track` and a receiver on `receiver`.

    used  the receiver's track that `echo` is given, default `receiver` itself (or `track`): with
          `receiver_at_arrival(...)` the result is the remaining error.

    flight: c tau = |T(t) - x| + |x - R(t + tau)| is solved. chirp: the echo of p(t) is p((t - tau)/(1 + tau')), whose
    spectrum is P(f (1 + tau')). For a chirp of rate k = waveform.sweep_rate, P = exp(-j pi (f - fc)^2/k), that is
    an additional delay of tau' fc/k, and little else (docs/theory/radar.md). ValueError for pulses that are not chirps.

    >>> flight = sarcl.Trajectory.line(start=(-5e3, -50, 4e3), velocity=(0, 100, 0), prf=100, n_pulses=101)
    >>> error = sarcl.stop_and_go.stop_and_go_error(flight, [[0, 0, 0]], chirp)
    >>> round(float(abs(error.phase).max()), 4)  # rad
    0.0067
    """
    validation.instance("track", track, Trajectory)
    validation.instance("waveform", waveform, Waveform)
    for name, other in (("receiver", receiver), ("used", used)):
        if other is not None:
            validation.instance(name, other, Trajectory)
    if waveform.sweep_rate is None:
        raise ValueError(f"the error of stop and go is known for chirps, not for a {waveform.kind!r} waveform")
    x = validation.array("points", points, np.float64, ("n", 3))
    moving = track if receiver is None else receiver
    tau, slope = _delays(track, moving, x)
    positions_used = moving if used is None else used
    if len(positions_used) != len(track):
        raise ValueError(f"used has {len(positions_used)} positions but track has {len(track)}; give one per pulse")
    path = _distance(track.positions[:, None], x) + _distance(positions_used.positions[:, None], x)
    c, fc, rate = constants.SPEED_OF_LIGHT, waveform.center, waveform.sweep_rate
    flight = (c * tau - path) / 2
    return StopAndGo(
        flight=flight,
        chirp=c * slope * (1 + slope) * fc / (2 * rate),
        phase=4 * np.pi * fc / c * flight + np.pi * (fc * slope) ** 2 / rate,
        smear=np.abs(np.pi * slope * waveform.bandwidth * waveform.duration / 2 * (1 + slope / 2)),
        doppler=-fc * slope,
        times=track.known_times,
    )


def receiver_at_arrival(track: Trajectory, point: ArrayLike, *, receiver: Trajectory | None = None) -> Trajectory:
    """The receiver's positions when echoes from `point`, m (3,), arrive: a receiver track for exact paths to the point.

    sarcl.echo(scene, chirp, track, receiver=receiver_at_arrival(track, center)) has the true two-way path of the point
    `center`; `stop_and_go_error(..., used=...)` gives its error elsewhere. The frame must be inertial: on the rotating
    Earth, give positions in a frame that does not rotate (the Sagnac effect is of the same size).

    >>> flight = sarcl.Trajectory.line(start=(-5e3, -50, 4e3), velocity=(0, 100, 0), prf=100, n_pulses=101)
    >>> later = sarcl.stop_and_go.receiver_at_arrival(flight, (0, 0, 0))
    >>> round(float(later.positions[50, 1] - flight.positions[50, 1]), 4)  # m
    0.0043
    """
    validation.instance("track", track, Trajectory)
    if receiver is not None:
        validation.instance("receiver", receiver, Trajectory)
    x = validation.array("point", point, np.float64, (3,))
    moving = track if receiver is None else receiver
    tau, _ = _delays(track, moving, x[None])
    path = _Path(moving)
    arrivals = track.known_times + tau[:, 0]
    return replace(moving, times=track.known_times, positions=path(arrivals), velocities=path(arrivals, 1))


def pulse_motion(raw: PhaseHistory, point: ArrayLike, *, undo: bool = False) -> PhaseHistory:
    """Echoes with the phase that motion during the pulse causes for `point`, m (3,); undo removes it.

    exp(-j pi ((f (1 + tau') - fc)^2 - (f - fc)^2)/k): range-Doppler coupling, exact for the point; the error at
    other points is the difference of their `StopAndGo.chirp`. Samples are changed when they are read. ValueError where
    raw has no velocities, or no chirp.
    """
    validation.instance("raw", raw, PhaseHistory)
    undo = validation.flag("undo", undo)
    if raw.waveform is None or raw.waveform.sweep_rate is None:
        raise ValueError("raw names no chirp, so its rate is unknown; set raw.waveform to the chirp that was sent")
    speeds = raw.tx_velocity, raw.tx_velocity if raw.rx_velocity is None and raw.is_monostatic else raw.rx_velocity
    if speeds[0] is None or speeds[1] is None:
        raise ValueError("raw has no velocities of its antennas; give tracks with velocities, or set raw.tx_velocity")
    x = validation.array("point", point, np.float64, (3,))
    slope = _slope(raw.tx - x, speeds[0], raw.rx - x, speeds[1])
    return replace(raw, samples=_Chirped(raw, slope, -1.0 if undo else 1.0))


class _Chirped(RowsOnDemand):
    """Rows times the phase of motion during the pulse, computed for the rows of a slice."""

    def __init__(self, raw: PhaseHistory, slope: np.ndarray, sign: float) -> None:
        assert raw.waveform is not None and raw.waveform.sweep_rate is not None
        self.source, self.slope, self.sign = raw.samples, slope, sign
        self.first, self.step = raw.frequency, raw.frequency_step
        self.center, self.rate = raw.waveform.center, raw.waveform.sweep_rate
        self.shape, self.dtype = raw.samples.shape, np.dtype(raw.samples.dtype)

    def rows(self, rows: slice) -> np.ndarray:
        f = self.first[rows, None] + self.step[rows, None] * np.arange(self.shape[1])
        moved = f * self.slope[rows, None]
        phase = np.pi * moved * (2 * (f - self.center) + moved) / self.rate
        block = np.asarray(self.source[rows])
        return (block * np.exp(-1j * self.sign * phase)).astype(self.dtype.newbyteorder("="))


class _Path:
    """Positions (derivative 0) and velocities (1) of a track at any time near its own, m (..., 3)."""

    def __init__(self, track: Trajectory) -> None:
        from scipy.interpolate import CubicHermiteSpline, CubicSpline

        self.track, self.spline = track, None
        if track.velocities is not None and len(track) > 1:
            self.spline = CubicHermiteSpline(track.known_times, track.positions, track.velocities)
        elif len(track) > 3:
            self.spline = CubicSpline(track.known_times, track.positions)
        elif track.velocities is None:
            raise ValueError(f"a track of {len(track)} pulses has no velocity; give Trajectory(..., velocities=...)")

    def __call__(self, times: np.ndarray, derivative: int = 0) -> np.ndarray:
        if self.spline is not None:
            return np.asarray(self.spline(times, derivative))
        assert self.track.velocities is not None  # one pulse
        if derivative:
            return np.broadcast_to(self.track.velocities[0], (*times.shape, 3))
        since = (times - self.track.known_times[0])[..., None]
        return np.asarray(self.track.positions[0] + since * self.track.velocities[0])


def _delays(track: Trajectory, moving: Trajectory, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """tau of c tau = |T(t) - x| + |x - R(t + tau)|, s, and its rate of change with t: (n_pulses, n_points)."""
    c, path, from_tx = constants.SPEED_OF_LIGHT, _Path(moving), _Path(track)
    tx_range = _distance(track.positions[:, None], points)
    sent = np.broadcast_to(track.known_times[:, None], tx_range.shape)
    tau, change = (tx_range + _distance(path(sent), points)) / c, np.inf
    for _ in range(ITERATIONS):  # each divides the change by c/speed
        rx = path(sent + tau)
        last, tau = tau, (tx_range + _distance(rx, points)) / c
        before, change = change, float(np.abs(tau - last).max())
        if change <= 4e-16 * tau.max():
            break
        rounding = np.spacing(np.abs(sent + last).max()) + ROUNDING * (tau.max() + np.abs(rx).max() / c)
        if change > max(before / 2, rounding):
            raise _too_fast(moving, sent + last, path)
    speed = from_tx(track.known_times, 1)[:, None]
    return tau, _slope(track.positions[:, None] - points, speed, rx - points, path(sent + tau, 1))


def _too_fast(moving: Trajectory, arrivals: np.ndarray, path: _Path) -> ValueError:
    """The error of a receiver whose positions change by half as much as light travels, or more."""
    speed = float(np.linalg.norm(path(arrivals, 1), axis=-1).max())
    return ValueError(
        f"the receiver would move at {speed:.3g} m/s when echoes arrive, at up to {arrivals.max():.6g} s: its track of "
        f"{len(moving)} pulses ends at {moving.known_times[-1]:.6g} s, and is continued by a polynomial from there. "
        "Give Trajectory(..., velocities=...), times that fit the positions, or a longer track as receiver="
    )


def _slope(to_tx: np.ndarray, tx_velocity: np.ndarray, to_rx: np.ndarray, rx_velocity: np.ndarray) -> np.ndarray:
    """tau' = (u_t.V_t + u_r.V_r)/(c - u_r.V_r), from vectors from points to antennas (..., 3)."""
    closing = []
    for d, v in ((to_tx, tx_velocity), (to_rx, rx_velocity)):
        length = np.linalg.norm(d, axis=-1)
        if not length.all():
            raise ValueError("an antenna stands on the point, where its range has no rate of change; move one of them")
        closing.append((d * v).sum(axis=-1) / length)
    return np.asarray((closing[0] + closing[1]) / (constants.SPEED_OF_LIGHT - closing[1]))


def _distance(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return np.asarray(np.linalg.norm(a - b, axis=-1))
