"""Scenarios on the Earth: tables in local coordinates of [place], and the pass of an orbit over it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from ..base import wgs84

if TYPE_CHECKING:
    from ..earth.place import Place
    from ..model.orbit import Orbit
    from ..model.trajectory import Trajectory

# Keys whose values are positions, m (..., 3), or directions (..., 3), outside [scene] and [grid]
POSITIONS, DIRECTIONS = ("point", "reference"), ("direction", "up", "vertical")


def earth_fixed(place: Place | None, table: Mapping[str, Any]) -> dict[str, Any]:
    """A table with the positions and directions in it, local to a place, in Earth-fixed coordinates."""
    if place is None:
        return dict(table)
    out: dict[str, Any] = {}
    for key, value in table.items():
        vector = isinstance(value, list) and np.shape(value)[-1:] == (3,)
        if vector and key in POSITIONS:
            value = place.positions(np.asarray(value, np.float64))
        elif vector and key in DIRECTIONS:
            value = np.asarray(value, np.float64) @ place.axes
        out[key] = value
    return out


def on_terrain(place: Place, table: Mapping[str, Any]) -> dict[str, Any]:
    """A table of from_dem or on_terrain, whose local frame is that of the place. ValueError for another frame."""
    for key, allowed in (("frame", "local"), ("center", None)):
        if key in table and table[key] != allowed:
            raise ValueError(
                f"{key} is {table[key]!r}, but [place] is the frame of the whole scenario; leave {key} out"
            )
    return {**table, "center": [place.longitude, place.latitude, place.height]}


def time_over(orbit: Orbit, place: Place) -> float:
    """Zero-Doppler time of the place, s since the orbit's epoch. ValueError where the satellite never sees it."""
    return float(orbit.locate(place.origin)[0])


def side_of(orbit: Orbit, place: Place, t: float) -> str:
    """ "right" or "left" of the velocity at a time, s, seen from above: where the place is."""
    position, velocity = orbit.positions(t), orbit.velocities(t)
    right = np.cross(velocity, wgs84.up(*wgs84.geodetic(position)[:2]))
    return "right" if (place.origin - position) @ right > 0 else "left"


def pass_text(orbit: Orbit, track: Trajectory, place: Place | None) -> str:
    """The pulses of an orbit, and how it sees the place, in words."""
    first, last = float(track.known_times[0]), float(track.known_times[-1])
    lines = [f"orbit: {orbit.describe()}", f"pulses: {len(track)} from {_time(orbit, first)} to {_time(orbit, last)}"]
    if place is not None:
        t = time_over(orbit, place)
        seen = orbit.view(t, place.origin)
        lines.append(
            f"place: zero Doppler at {_time(orbit, t)}, {side_of(orbit, place, t)} of the track, slant range "
            f"{float(seen.slant_range):.7g} m, look {np.degrees(float(seen.look)):.4g} and incidence "
            f"{np.degrees(float(seen.incidence)):.4g} degrees"
        )
    return "\n".join(lines)


def _time(orbit: Orbit, t: float) -> str:
    if orbit.epoch is None:
        return f"{t:.6g} s"
    return f"{t:.6g} s ({orbit.epoch + np.timedelta64(round(t * 1e6), 'us'):.23})".replace("T", " ")
