"""Motion of antennas and targets: errors of the track, known to the processor or not, and moving targets.

Intra-pulse motion is in stop_and_go.py.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from ..base import constants, validation
from ..base.vectors import unit
from ..model.phase_history import PhaseHistory
from ..model.pointing import turned, velocities
from ..model.row_positions import at_arrival
from ..model.trajectory import Trajectory
from ._random_motion import deviation, frequencies, random_process

WRAPPED = 0.01  # largest fraction of a row's energy that a shift may wrap around: side lobes hold less
FRAMES = ("scene", "track")


def perturbed(
    track: Trajectory,
    *,
    rms: ArrayLike = 0.0,
    correlation_time: float | None = None,
    spectrum: tuple[ArrayLike, ArrayLike] | None = None,
    attitude_rms: ArrayLike = 0.0,
    frame: Literal["scene", "track"] = "scene",
    seed: int = 0,
) -> Trajectory:
    """The track with smooth random errors of its positions, and of its attitude where attitude_rms is not zero.

    rms               m, one or per axis (3,): standard deviation of the errors
    correlation_time  s: the errors' autocorrelation is rms^2 exp(-(t/correlation_time)^2), or
    spectrum          (frequencies Hz (k,), densities (k,)): their one-sided power spectrum, of any scale, linear
                      between frequencies
    attitude_rms      rad, one or about each body axis (3,)
    frame             axes of the "scene", or of the "track": along it, to its left, up
    seed              errors depend on it and on each pulse's time alone: parts of a track, and tracks of another prf,
                      have the same motion

    The errors are sums of 256 cosines of random phase, with frequencies drawn from the spectrum (Shinozuka and
    Deodatis, Appl. Mech. Rev. 44, 1991). The deviation is that of the ensemble: errors that change slowly over the
    track are mostly a constant offset.

    >>> flown = sarcl.motion.perturbed(track, rms=0.01, correlation_time=0.2, seed=3)
    >>> bool(abs(flown.positions - track.positions).max() < 0.06)
    True
    """
    validation.instance("track", track, Trajectory)
    seed = validation.count("seed", seed, 0)
    with np.errstate(over="ignore", invalid="ignore"):  # positions that are not finite are refused by their name
        hertz = frequencies(correlation_time, spectrum, seed)
        offset, rate = random_process(track.known_times, deviation("rms", rms), hertz, seed, 0)
        moved = _move(track, offset, rate, frame)
        angles = deviation("attitude_rms", attitude_rms)
        return turned(moved, random_process(track.known_times, angles, hertz, seed, 1)[0]) if angles.any() else moved


def sinusoidal(
    track: Trajectory,
    *,
    amplitude: ArrayLike,
    frequency: float,
    phase: ArrayLike = 0.0,
    frame: Literal["scene", "track"] = "scene",
) -> Trajectory:
    """The track moved by amplitude sin(2 pi frequency t + phase): m (3,), Hz, rad, one or per axis.

    frame  "scene": the amplitude is along its axes; "track": along those of the track

    A motion of amplitude a along the line of sight causes paired echoes of amplitude J_1(4 pi a/lambda) beside a point.

    >>> flown = sarcl.motion.sinusoidal(track, amplitude=(0, 0, 0.02), frequency=2.0)
    >>> bool(abs(flown.positions - track.positions).max() <= 0.02)
    True
    """
    validation.instance("track", track, Trajectory)
    size = validation.array("amplitude", amplitude, np.float64, (3,))
    rate = 2 * np.pi * validation.number("frequency", frequency, above=0)
    phase = validation.each("phase", phase, 3)
    with np.errstate(over="ignore", invalid="ignore"):  # positions that are not finite are refused by their name
        angle = rate * track.known_times[:, None] + phase
        return _move(track, size * np.sin(angle), size * rate * np.cos(angle), frame)


def with_positions(raw: PhaseHistory, track: Trajectory, *, receiver: Trajectory | None = None) -> PhaseHistory:
    """Echoes with the positions that a processor assumes: `raw` with those of `track`.

    Samples and reference ranges stay as they were recorded. The track has as many pulses as raw has rows, or as many as
    it has times (rows of one time, such as polarisations, share a position). receiver: likewise; default
    the track where raw has one antenna, raw's own receiver where it has two. A track of `Orbit.trajectory` gives both
    antennas, at the delays of the reference ranges. ValueError where times do not match.

    >>> flown = sarcl.motion.perturbed(track, rms=0.01, correlation_time=0.2)
    >>> assumed = sarcl.motion.with_positions(sarcl.echo(scene, chirp, flown), track)
    >>> bool(np.array_equal(assumed.tx, track.positions))
    True
    """
    validation.instance("raw", raw, PhaseHistory)
    validation.instance("track", track, Trajectory)
    changes: dict[str, Any] = {}
    for side, antenna_track in (("tx", track), ("rx", receiver)):
        if antenna_track is None:
            continue
        validation.instance("track" if side == "tx" else "receiver", antenna_track, Trajectory)
        row = _pulse_of_row(raw, antenna_track)
        changes[side] = antenna_track.positions[row]
        changes[f"{side}_velocity"] = None if antenna_track.velocities is None else antenna_track.velocities[row]
    if receiver is None and not track.stop_and_go:
        changes |= at_arrival(track, _pulse_of_row(raw, track), raw.reference_range)
    elif receiver is None:
        changes["rx"] = None if raw.is_monostatic else raw.rx
        changes["rx_velocity"] = changes["tx_velocity"] if raw.is_monostatic else raw.rx_velocity
    return replace(raw, **changes)


def relative(
    track: Trajectory,
    *,
    velocity: ArrayLike = (0.0, 0.0, 0.0),
    acceleration: ArrayLike = (0.0, 0.0, 0.0),
    rotation: ArrayLike = (0.0, 0.0, 0.0),
    center: ArrayLike = (0.0, 0.0, 0.0),
    epoch: float = 0.0,
) -> Trajectory:
    """The track relative to a moving rigid body: from it, the body at rest has the echoes of the moving body.

    A point of the body is at x at `epoch`, s, and at time t at
        x(t) = c + R(t) (x - c) + v (t - epoch) + a (t - epoch)^2/2,   R(t) a rotation by rotation (t - epoch)
    velocity m/s, acceleration m/s^2, rotation rad/s about `center` c, m: each (3,). Distances, incidence and beams are
    exact, pulse by pulse. Polarisation is exact unless the body rotates about another axis than the vertical that
    defines H and V. Shadows between the body and the rest of the scene are not modelled. Add echoes with `combined`.

    >>> moving = sarcl.motion.relative(track, velocity=(3.0, 0, 0))
    >>> raw = sarcl.echo(scene, chirp, moving, range_window=(-40, 40))
    """
    validation.instance("track", track, Trajectory)
    from scipy.spatial.transform import Rotation

    v, a, w, c = (
        validation.array(name, value, np.float64, (3,))
        for name, value in (
            ("velocity", velocity),
            ("acceleration", acceleration),
            ("rotation", rotation),
            ("center", center),
        )
    )
    t = (track.known_times - validation.number("epoch", epoch))[:, None]
    back = np.swapaxes(Rotation.from_rotvec(w * t).as_matrix(), 1, 2)
    with np.errstate(over="ignore", invalid="ignore"):  # positions that are not finite are refused by their name
        positions = c + np.einsum("nij,nj->ni", back, track.positions - c - v * t - a * t**2 / 2)
        changes: dict[str, Any] = {"positions": positions}
        if track.velocities is not None:
            seen = np.einsum("nij,nj->ni", back, track.velocities - v - a * t)
            changes["velocities"] = seen - np.cross(w, positions - c)
            if track.accelerations is not None:
                inertia = 2 * np.cross(w, changes["velocities"]) + np.cross(w, np.cross(w, positions - c))
                changes["accelerations"] = np.einsum("nij,nj->ni", back, track.accelerations - a) - inertia
    if track.attitude is not None:
        changes["attitude"] = back @ track.attitude
    return replace(track, **changes)


def combined(parts: Sequence[PhaseHistory]) -> PhaseHistory:
    """The sum of echoes of several parts of a scene, with the geometry of the first.

    The phases of the other parts are changed from their reference ranges to those of the first. Parts need the same
    rows, frequencies and polarisations: give `sarcl.echo` the same range_window for all, wide enough for the true
    ranges of each part. ValueError names what differs, or the row where a part lies outside the window of the first.

    >>> moving = sarcl.motion.relative(track, velocity=(3.0, 0, 0))
    >>> parts = [sarcl.echo(scene, chirp, seen, range_window=(-40, 40)) for seen in (track, moving)]
    >>> both = sarcl.motion.combined(parts)
    """
    if isinstance(parts, PhaseHistory) or not isinstance(parts, Iterable):
        raise TypeError(f"parts is a {type(parts).__name__}; give a list of phase histories")
    parts = list(parts)
    if not parts:
        raise ValueError("combined was given no echoes; give at least one")
    for part in parts:
        validation.instance("each part", part, PhaseHistory)
    first = parts[0]
    total = np.zeros(first.samples.shape, np.result_type(*(p.samples.dtype for p in parts)))
    for i, part in enumerate(parts):
        _check_same_rows(first, part, i)
        shift = (
            2
            / np.longdouble(constants.SPEED_OF_LIGHT)
            * (part.reference_range.astype(np.longdouble) - first.reference_range)
        )
        for start in range(0, first.n_rows, 256):
            rows = slice(start, min(start + 256, first.n_rows))
            block = part.read(rows.start, rows.stop)
            if shift.any():
                _check_window(block, np.asarray(shift[rows] * part.frequency_step[rows], np.float64), i, start)
                f = part.frequency[rows, None] + part.frequency_step[rows, None] * np.arange(part.n_samples)
                block = block * np.exp(-2j * np.pi * ((f * shift[rows, None]) % 1).astype(np.float64))
            total[rows] += block
    return replace(first, samples=validation.sealed(total), report=None)


def _check_same_rows(first: PhaseHistory, part: PhaseHistory, i: int) -> None:
    if part.samples.shape != first.samples.shape:
        raise ValueError(
            f"part {i} has samples {part.samples.shape}, part 0 {first.samples.shape}; make both with the same track "
            "length, polarisations and range_window"
        )
    for name in ("frequency", "frequency_step", "polarization", "tx_channel", "rx_channel", "compressed"):
        a, b = getattr(first, name), getattr(part, name)
        if not np.array_equal(a, b):
            raise ValueError(f"part {i} and part 0 differ in {name}; make both with the same waveform and range_window")


def _check_window(block: np.ndarray, shift: np.ndarray, i: int, start: int) -> None:
    """Raise ValueError where echoes of a row, shifted by `shift` periods, would wrap to the window's other end."""
    n = block.shape[1]
    power = np.abs(np.fft.ifft(block, axis=1)) ** 2
    delay = np.fft.fftfreq(n) + shift[:, None]
    # an echo within half a sample of a limit may lie at either end
    is_lost = (power * (np.abs(delay) > 0.5 + 1 / n)).sum(axis=1) > WRAPPED * power.sum(axis=1)
    if is_lost.any():
        row = start + int(np.argmax(is_lost))
        raise ValueError(
            f"part {i} lies outside part 0's range window at row {row}; give both echoes a wider range_window, or "
            "leave out the pulses at which it lies outside"
        )


def _pulse_of_row(raw: PhaseHistory, track: Trajectory) -> np.ndarray:
    if len(track) == raw.n_rows:
        return np.arange(raw.n_rows)
    if raw.time is None:
        raise ValueError(f"raw has {raw.n_rows} rows and no times, the track {len(track)} pulses; give a pulse per row")
    row = np.clip(np.searchsorted(track.known_times, raw.time - 1e-9), 0, len(track) - 1)
    difference = np.abs(track.known_times[row] - raw.time)
    if (difference > 1e-9 * (1 + np.abs(raw.time))).any():
        i = int(np.argmax(difference))
        raise ValueError(
            f"row {i} was sent at {raw.time[i]:g} s, where the track has no pulse; give a position per row"
        )
    return row


def _move(track: Trajectory, offset: np.ndarray, rate: np.ndarray, frame: str) -> Trajectory:
    """The track moved by offsets, m (n, 3), along the axes of the frame; rate  of the offsets, m/s (n, 3)."""
    if validation.choice("frame", frame, FRAMES) == "track":
        along = velocities(track)
        leftward = np.cross((0.0, 0.0, 1.0), along)
        length = np.linalg.norm(leftward, axis=1, keepdims=True)
        if not (length > 1e-6 * np.linalg.norm(along, axis=1, keepdims=True)).all():
            pulse = int(np.argmin(length))
            raise ValueError(f"the track stands still or goes straight up at pulse {pulse}; use frame='scene'")
        along, leftward = unit(along), leftward / length
        axes = np.stack([along, leftward, np.cross(along, leftward)], axis=-1)
        turning = np.gradient(axes, track.known_times, axis=0) if len(track) > 1 else np.zeros_like(axes)
        rate = np.einsum("nij,nj->ni", axes, rate) + np.einsum("nij,nj->ni", turning, offset)
        offset = np.einsum("nij,nj->ni", axes, offset)
    speed = None if track.velocities is None else track.velocities + rate
    return replace(track, positions=track.positions + offset, velocities=speed)
