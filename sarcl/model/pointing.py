"""Pointing of antennas: tracks with an attitude that directs the beam.

Every function returns the track with `attitude` set: columns are body axes in the scene, x along the beam (an
antenna's boresight, unless it is mounted otherwise), y azimuth, z elevation, which is as vertical as possible. The
vertical, `up`, is z, and for tracks of orbits the ellipsoid's normal.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from ..base import validation, wgs84
from .trajectory import Trajectory

UP = (0.0, 0.0, 1.0)


def fixed(track: Trajectory, direction: ArrayLike, *, up: ArrayLike | None = None) -> Trajectory:
    """Boresight along one direction, (3,) or (n, 3), at every pulse. up: vertical, (3,) or (n, 3).

    >>> sarcl.pointing.fixed(track, (-1, 0, -1)).attitude[0, :, 0].round(3)
    array([-0.707,  0.   , -0.707])
    """
    validation.instance("track", track, Trajectory)
    look = _units("direction", direction, len(track))
    return _looking(track, look, _vertical(track, up))


def spotlight(track: Trajectory, point: ArrayLike, *, up: ArrayLike | None = None) -> Trajectory:
    """Boresight towards a point, m (3,), or (n, 3) if it moves. ValueError where an antenna stands on it.

    >>> aimed = sarcl.pointing.spotlight(track, (0, 0, 0))
    >>> dish = sarcl.Antenna.gaussian(width=(0.02, 0.02))
    >>> raw = sarcl.echo(scene, chirp, aimed, antenna=dish)
    """
    validation.instance("track", track, Trajectory)
    target = _vectors("point", point, len(track))
    return _looking(track, _units("point - position", target - track.positions, len(track)), _vertical(track, up))


def stripmap(
    track: Trajectory,
    look: float,
    *,
    squint: float = 0.0,
    side: Literal["right", "left"] = "right",
    up: ArrayLike | None = None,
) -> Trajectory:
    """Boresight across the track, `look` rad from straight down, rotated by `squint` rad towards the velocity.

    side  "right" or "left" of the velocity, seen from above. The azimuth axis is in the plane of boresight and
    velocity, so that rows of an aperture lie along the track; its sense follows from z, which points up.

    >>> sarcl.pointing.stripmap(track, look=np.pi / 4, side="left").attitude[0, :, 0].round(3)
    array([-0.707,  0.   , -0.707])
    """
    validation.instance("track", track, Trajectory)
    look = validation.number("look", look, least=0)
    squint = validation.number("squint", squint)
    if look > np.pi or abs(squint) >= np.pi / 2:
        raise ValueError(f"look is {look:g} and squint {squint:g} rad, beyond pi or pi/2: were they in degrees?")
    sign = {"right": 1.0, "left": -1.0}[validation.choice("side", side, ("right", "left"))]
    along = _units("velocity", velocities(track), len(track))
    vertical = _vertical(track, up)
    right = np.cross(along, vertical)
    length = np.linalg.norm(right, axis=1, keepdims=True)
    if length.min() < 1e-6:
        raise ValueError(
            f"the track goes straight up at pulse {int(np.argmin(length))}; it has no right side: give up="
        )
    right /= length
    over = np.cross(right, along)
    across = sign * np.sin(look) * right - np.cos(look) * over
    boresight = np.cos(squint) * across + np.sin(squint) * along
    azimuth = sign * (np.cos(squint) * along - np.sin(squint) * across)
    return replace(track, attitude=np.stack([boresight, azimuth, np.cross(boresight, azimuth)], axis=-1))


def steered(track: Trajectory, azimuth: ArrayLike, elevation: ArrayLike = 0.0) -> Trajectory:
    """The track's attitude rotated to (azimuth, elevation) rad, one or per pulse, in its own axes.

    The pattern rotates as a whole, as if the antenna did: sliding spotlight, scans, platform errors.

    >>> aimed = sarcl.pointing.steered(sarcl.pointing.spotlight(track, (0, 0, 0)), azimuth=0.01)
    >>> aimed.attitude.shape
    (64, 3, 3)
    """
    validation.instance("track", track, Trajectory)
    axes = _attitude(track)
    a, e = (validation.each(n, v, len(track)) for n, v in (("azimuth", azimuth), ("elevation", elevation)))
    zero = np.zeros(len(track))
    ahead = [np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)]
    side = [-np.sin(a), np.cos(a), zero]
    over = [-np.sin(e) * np.cos(a), -np.sin(e) * np.sin(a), np.cos(e)]
    rotation = np.stack([np.stack(column, axis=-1) for column in (ahead, side, over)], axis=-1)
    return replace(track, attitude=axes @ rotation)


def turned(track: Trajectory, angles: ArrayLike) -> Trajectory:
    """The track's attitude rotated by `angles`, rotation vectors, rad (3,) or (n, 3), in its own axes x, y, z.

    >>> aimed = sarcl.pointing.turned(sarcl.pointing.spotlight(track, (0, 0, 0)), (0.0, 0.0, 0.01))
    >>> aimed.attitude.shape
    (64, 3, 3)
    """
    validation.instance("track", track, Trajectory)
    from scipy.spatial.transform import Rotation

    rotation = Rotation.from_rotvec(_vectors("angles", angles, len(track)).copy()).as_matrix()
    return replace(track, attitude=_attitude(track) @ rotation)


def from_quaternions(track: Trajectory, quaternions: ArrayLike, *, scalar_first: bool = True) -> Trajectory:
    """Attitude from unit quaternions (n, 4), rotations from body to scene axes: w, x, y, z if scalar_first,
    else x, y, z, w.

    >>> level = np.tile([1.0, 0, 0, 0], (len(track.positions), 1))
    >>> sarcl.pointing.from_quaternions(track, level).attitude[0]
    array([[1., 0., 0.],
           [0., 1., 0.],
           [0., 0., 1.]])
    """
    from scipy.spatial.transform import Rotation

    validation.instance("track", track, Trajectory)
    scalar_first = validation.flag("scalar_first", scalar_first)
    q = validation.array("quaternions", quaternions, np.float64, (len(track), 4))
    length = np.linalg.norm(q, axis=1)
    if np.abs(length - 1).max() > 1e-3:
        bad = int(np.argmax(np.abs(length - 1)))
        raise ValueError(f"quaternions[{bad}] has length {length[bad]:g}; a rotation's is 1")
    return replace(track, attitude=Rotation.from_quat(np.roll(q, -1 if scalar_first else 0, axis=1)).as_matrix())


def velocities(track: Trajectory) -> np.ndarray:
    """The track's velocities, m/s (n, 3), or the derivative of its positions."""
    if track.velocities is not None:
        return track.velocities
    if len(track) < 2:
        raise ValueError("a track of one pulse has no velocity; give Trajectory(..., velocities=...)")
    return np.asarray(np.gradient(track.positions, track.known_times, axis=0))


def rotations(name: str, value: ArrayLike, lead: tuple[int, ...]) -> np.ndarray:
    """`value` as rotation matrices lead + (3, 3); ValueError where one is not, to 1e-6."""
    matrices = validation.array(name, value, np.float64, (*lead, 3, 3))
    error = np.abs(np.swapaxes(matrices, -1, -2) @ matrices - np.eye(3)).max(axis=(-1, -2))
    bad = np.atleast_1d((error > 1e-6) | (np.linalg.det(matrices) < 0))
    if bad.any():
        place = f"[{int(np.argmax(bad))}]" if lead else ""
        raise ValueError(f"{name}{place} is no rotation; its columns are right-handed unit vectors at right angles")
    return matrices


def _vertical(track: Trajectory, up: ArrayLike | None) -> np.ndarray:
    """Unit vectors (n, 3): as asked, z, or the ellipsoid's normals along the track of an orbit."""
    if up is None and not track.stop_and_go:
        return wgs84.up(*wgs84.geodetic(track.positions)[:2])
    return _units("up", UP if up is None else up, len(track))


def _attitude(track: Trajectory) -> np.ndarray:
    if track.attitude is None:
        raise ValueError("the track has no attitude to turn; aim it first: pointing.fixed, spotlight or stripmap")
    return rotations("trajectory attitude", track.attitude, (len(track),))


def _looking(track: Trajectory, look: np.ndarray, up: np.ndarray) -> Trajectory:
    """Axes with x along `look` and z up; if `look` is vertical, z is the scene's y (x, where y is vertical)."""
    side = np.cross(up, look)
    length = np.linalg.norm(side, axis=1, keepdims=True)
    other = np.where(np.abs(look[:, 1:2]) < 0.9, [[0.0, 1.0, 0.0]], [[1.0, 0.0, 0.0]])
    level = np.cross(other, look)
    side = np.where(
        length < 1e-6, level / np.linalg.norm(level, axis=1, keepdims=True), side / np.maximum(length, 1e-6)
    )
    return replace(track, attitude=np.stack([look, side, np.cross(look, side)], axis=-1))


def _vectors(name: str, value: ArrayLike, n: int) -> np.ndarray:
    """`value` (3,) or (n, 3) as (n, 3)."""
    vectors = validation.array(name, value, np.float64, (3,) if validation.ndim(name, value) == 1 else (n, 3))
    return np.broadcast_to(vectors, (n, 3))


def _units(name: str, value: ArrayLike, n: int) -> np.ndarray:
    vectors = _vectors(name, value, n)
    length = np.linalg.norm(vectors, axis=1, keepdims=True)
    if not length.all():
        raise ValueError(f"{name} is (0, 0, 0) at pulse {int(np.argmin(length))}; a direction needs a length")
    return vectors / length
