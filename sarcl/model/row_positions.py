"""Positions of the antennas in the rows of a phase history, from a track; of satellites where echoes arrive."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from ..base import validation
from ..base.constants import SPEED_OF_LIGHT
from ..base.errors import warn
from ..earth.light_time import receivers, transmitters
from .trajectory import Trajectory

if TYPE_CHECKING:
    from .phase_history import PhaseHistory

FARTHEST, FASTEST = 6e6, 1e3  # m from the origin and m/s from which on positions are those of a satellite
OF_TRACK = ("time", "tx_velocity", "rx_velocity")  # fields of rows that a track has


def at_arrival(track: Trajectory, pulses: np.ndarray, reference_range: np.ndarray) -> dict[str, np.ndarray]:
    """Places and velocities of both antennas at some pulses (n,) of an orbit's track, in the Earth-fixed frame of the
    time between: of the transmitter when the pulse leaves, of the receiver when the echo arrives.

    reference_range  m (n,): half of the path, which gives the delays
    """
    assert track.velocities is not None and track.accelerations is not None
    delay = reference_range / SPEED_OF_LIGHT
    p, v, a = track.positions[pulses], track.velocities[pulses], track.accelerations[pulses]
    tx, tx_velocity = transmitters(p, v, delay)
    rx, rx_velocity = receivers(p, v, a, delay, delay)
    return {"tx": tx, "rx": rx, "tx_velocity": tx_velocity, "rx_velocity": rx_velocity}


def rows_of_track(
    track: Trajectory, rx: ArrayLike | None, reference_range: np.ndarray, rows: Mapping[str, Any]
) -> dict[str, Any]:
    """Fields of a phase history whose rows are the pulses of a track. ValueError for another number of them."""
    validation.instance("track", track, Trajectory)
    duplicates = [name for name in OF_TRACK if rows.get(name) is not None] + ["rx"] * (rx is not None)
    if duplicates:
        raise ValueError(f"{duplicates[0]} is given, and so is track, which has its own; leave one out, or give tx=")
    if len(track) != len(reference_range):
        raise ValueError(
            f"samples has {len(reference_range)} rows but track {len(track)} pulses; give a track with a pulse per row"
        )
    fields: dict[str, Any] = {**rows, "time": track.times}
    if not track.stop_and_go:
        return {**fields, **at_arrival(track, np.arange(len(track)), reference_range)}
    return {**fields, "tx": track.positions, "tx_velocity": track.velocities, "rx_velocity": track.velocities}


def check_orbit(raw: PhaseHistory) -> None:
    """Warn of positions of a satellite as if it stood still while its pulse is on its way."""
    if raw.time is None or raw.n_rows < 2 or not raw.is_monostatic:
        return
    first, last = int(np.argmin(raw.time)), int(np.argmax(raw.time))
    elapsed = float(raw.time[last] - raw.time[first])
    if elapsed <= 0 or np.linalg.norm(raw.tx, axis=1).min() < FARTHEST:
        return
    speed = float(np.linalg.norm(raw.tx[last] - raw.tx[first])) / elapsed
    if speed > FASTEST:
        shift = speed * float(np.median(raw.reference_range)) / SPEED_OF_LIGHT
        warn(
            f"tx moves at {speed / 1e3:.3g} km/s, {np.linalg.norm(raw.tx[first]) / 1e3:.5g} km from the origin, as a "
            "satellite does, and rx is the same: without the way that it goes while an echo is under way the image "
            f"lies {shift:.3g} m off along the track. Give track=orbit.trajectory(...) in place of tx, which takes "
            "that and the rotation of the Earth into account"
        )
