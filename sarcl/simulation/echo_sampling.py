"""Rows of echoes: positions of the antennas, range window, frequencies of the samples."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from ..base import wgs84
from ..base.boxes import corners
from ..base.constants import LEAST_STEP, SPEED_OF_LIGHT, WIDEST_SWATH
from ..base.errors import warn
from ..base.validation import converted, finite
from ..earth.light_time import antennas_in_flight, receivers, transmitters
from ..earth.viewing import hidden
from ..model.trajectory import Trajectory
from ..model.waveform import Waveform
from ..numerics.pulse_geometry import half_path
from ..scene.scene import Scene

SOME_PULSES = 33  # at which the error of the receiver's positions over the scene is computed
DEEPEST = -12e3  # m: lower than any ground, the bottom of the sea included
WIDE = -1e-6  # cosine of the bistatic angle below which forward scatter matters; 90 deg itself is not beyond
LEAST_SAMPLES = 64  # in the default range window, so that a single point has a profile, too


def warn_of_wide_angles(to_tx: np.ndarray, to_rx: np.ndarray, forward: bool) -> None:
    """Warn of bistatic angles beyond 90 deg, between vectors (n, 3) to the antennas, without forward scatter."""
    lengths = np.linalg.norm(to_tx, axis=1) * np.linalg.norm(to_rx, axis=1)
    cosine = (to_tx * to_rx).sum(axis=1) / np.where(lengths > 0, lengths, 1)
    wide = int((cosine < WIDE).sum())
    if wide and not forward:
        largest = np.degrees(np.arccos(max(float(cosine.min()), -1.0)))
        warn(
            f"bistatic angles reach {largest:.0f} deg, and exceed 90 deg {wide} times: the field of a body's shadow, "
            "which these directions see, is left out; pass forward=True",
            "wide angles",
        )


def in_flight(
    track: Trajectory, receiver: Trajectory | None, scene: Scene, point: np.ndarray
) -> tuple[Trajectory, Trajectory | None, dict[str, object]]:
    """Tracks of the antennas while pulses travel to the reference point, m (3,), and back; and entries of the report.

    A track that is not stop-and-go, without a receiver of its own, becomes two: the transmitter's and, at the echo's
    arrival, the receiver's, both in the frame of the Earth when the pulse meets the point (sarcl/earth/light_time.py).
    All others stay as they are. The entries are

        receiver             "at the echo's arrival", "stop and go", or "a track of its own"
        stop_and_go_error_m  largest half path, m, that stop and go leaves out (or would) for the reference point
        arrival_error_m      the same that positions at arrival leave out, over the box of the scene
    """
    if receiver is not None:
        return track, receiver, {"receiver": "a track of its own"}
    still = half_path(track.positions, track.positions, point)
    if track.stop_and_go:
        said: dict[str, object] = {"receiver": "stop and go"}
        if track.times is None:
            said["stop_and_go_error_m"] = "unknown: the track has no times"
        elif track.velocities is not None:
            after = track.positions + 2 * still[:, None] / SPEED_OF_LIGHT * track.velocities
            said["stop_and_go_error_m"] = _rounded(half_path(track.positions, after, point) - still)
        return track, None, said
    assert track.velocities is not None and track.accelerations is not None
    p, v, a = track.positions, track.velocities, track.accelerations
    _check_seen(p, point)
    tx, rx, down, up = antennas_in_flight(p, v, a, point)
    sends = replace(track, positions=tx, velocities=transmitters(p, v, down)[1], stop_and_go=True)
    hears = replace(track, positions=rx, velocities=receivers(p, v, a, down, up)[1], stop_and_go=True)
    some = np.linspace(0, len(track) - 1, min(SOME_PULSES, len(track))).round().astype(np.intp)
    box = corners(scene.bounds)
    _, _, down_there, up_there = antennas_in_flight(p[some, None], v[some, None], a[some, None], box)
    off = SPEED_OF_LIGHT * (down_there + up_there) / 2 - half_path(tx[some, None], rx[some, None], box)
    return (
        sends,
        hears,
        {
            "receiver": "at the echo's arrival",
            "stop_and_go_error_m": _rounded(SPEED_OF_LIGHT * (down + up) / 2 - still),
            "arrival_error_m": _rounded(off),
        },
    )


def _check_seen(antennas: np.ndarray, point: np.ndarray) -> None:
    """Raise ValueError where the reference point, m (3,), of an orbit's echoes is inside the Earth, or never seen."""
    longitude, latitude, height = wgs84.geodetic(point)
    if height < DEEPEST:
        raise ValueError(
            f"the reference point of the scene is {-height:.4g} m under the ellipsoid, but tracks of Orbit.trajectory "
            "are in Earth-fixed coordinates; place the scene there (Scene.on_earth, in scenario files "
            "[place]; or sarcl.wgs84.ecef, Scene.from_dem(frame='ecef'))"
        )
    if hidden(antennas, point).all():
        raise ValueError(
            f"the scene (longitude {longitude:.4f}, latitude {latitude:.4f}) is behind the horizon at every pulse; "
            "Orbit.locate gives the times at which the satellite passes it"
        )


def _rounded(errors: np.ndarray) -> float:
    """The largest modulus, to three digits."""
    return float(f"{np.abs(errors).max():.3g}")


def row_fields(
    track: Trajectory, receiver: Trajectory | None, reference_range: np.ndarray, polarizations: Sequence[str]
) -> dict[str, Any]:
    """Fields of a PhaseHistory that has a row per pulse and polarisation, pulse by pulse."""
    n, back = len(polarizations), track if receiver is None else receiver

    def every(values: np.ndarray | None) -> np.ndarray | None:
        return values if n == 1 or values is None else np.repeat(values, n, axis=0)

    return {
        "tx": every(track.positions),
        "rx": None if receiver is None else every(back.positions),
        "reference_range": every(reference_range),
        "time": every(track.times),
        "polarization": np.tile(polarizations, len(track)),
        "tx_velocity": every(track.velocities),
        "rx_velocity": every(back.velocities),
    }


def window(
    scene: Scene, waveform: Waveform, tx: np.ndarray, rx: np.ndarray, reference_range: np.ndarray, asked: object
) -> tuple[float, float]:
    """The range gate (near, far) about the reference, m: as asked, or that which holds the scene's box plus 10 %."""
    if asked is not None:
        pair = converted("range_window", asked, np.float64)
        if pair.shape != (2,):
            raise ValueError(f"range_window is {asked!r}; give (near, far) in metres about the reference")
        finite("range_window", pair)
        if 2 * np.abs(pair).max() > WIDEST_SWATH:
            raise ValueError(
                f"range_window reaches {np.abs(pair).max():g} m on a side of the reference, and swaths, as wide on "
                f"either side, {WIDEST_SWATH:g} m at most: give (near, far) in metres"
            )
        if not pair[0] < pair[1]:
            raise ValueError(f"range_window ({pair[0]:g}, {pair[1]:g}) is empty; near must be less than far")
        return float(pair[0]), float(pair[1])
    low, high = scene.bounds
    # distance is convex: the farthest point of a box is a corner, the nearest is the antenna clipped to the box
    farthest = half_path(tx, rx, corners(scene.bounds)[:, None]).max(axis=0) - reference_range
    clipped = [np.linalg.norm(e - np.clip(e, low, high), axis=1) for e in (tx, rx)]
    nearest = (clipped[0] + clipped[1]) / 2 - reference_range
    least = LEAST_SAMPLES * SPEED_OF_LIGHT / (4 * waveform.bandwidth)
    half = max(1.1 * float(farthest.max()), -1.1 * float(nearest.min()), least)
    return -half, half


def sampling(waveform: Waveform, near: float, far: float, compressed: bool) -> tuple[float, float, int]:
    """Frequency of sample 0, step, and number: f_n = fc - B/2 + (n + 1/2) df with n_samples df = B."""
    period = 4 * max(abs(near), abs(far)) / SPEED_OF_LIGHT
    if not compressed:
        period += waveform.duration  # so that pulses at the window's ends do not wrap
    n_samples = max(1, int(np.ceil(period * waveform.bandwidth * (1 - 1e-12))))
    step = waveform.bandwidth / n_samples
    if step < min(LEAST_STEP, waveform.bandwidth):
        raise ValueError(
            f"the range window of {near:g} to {far:g} m and the pulse need a swath of {SPEED_OF_LIGHT / 2 / step:g} m, "
            f"and swaths are at most {WIDEST_SWATH:g} m: give range_window=(near, far) in metres, or a nearer reference"
        )
    return waveform.center - waveform.bandwidth / 2 + step / 2, step, n_samples
