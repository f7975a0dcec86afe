"""Layover, shadow and incidence of terrain, from the antennas' positions.

    shadow     the straight path from a point to an antenna meets the terrain
    layover    another point of the terrain has the same path length P = |T - x| + |R - x| and the same rate of it: the
               curve of equal P and dP/dt through the point meets the terrain again. For one antenna on a straight track
               it is a circle about the track. Without velocities it stays in the vertical plane of the look
    incidence  angle between the terrain's normal and the direction to the antenna, or the middle of both directions

Paths are followed from one line between the model's points to the next, where terrain that is bilinear has its crests.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple, Protocol

import numpy as np

from ..base import wgs84
from ..base.vectors import Floats, dot
from .elevation import ElevationModel

STEP = 0.25  # of the model's spacing, over which slopes are taken
LONGEST = 4.0  # most length of a step along a path, in spacings of the model: paths are curved
BEHIND = 1e-6  # cells: a line that lies nearer ahead has been reached already
CLEAR = 1e-3  # m: heights above the terrain below it are rounding
MOST_STEPS = 20_000
STANDING = 1e-12  # 1/s: a turn of the look that is slower is that of antennas which stand still


class Layers(NamedTuple):
    """layover, shadow: bool (n,), False where the model has no heights; incidence, rad (n,), NaN there."""

    layover: np.ndarray
    shadow: np.ndarray
    incidence: Floats


def layers(
    model: ElevationModel, points: Floats, ends: tuple[Floats, Floats], speeds: tuple[Floats, Floats] | None
) -> Layers:
    """The layers of the terrain above or below points, Earth-fixed, m (n, 3).

    ends, speeds  transmitter and receiver of each point, m (n, 3), and their velocities, m/s (3,) each
    """
    longitude, latitude, _ = wgs84.geodetic(points)
    height = model.heights_at(longitude, latitude)
    full = np.isfinite(height)
    out = Layers(np.zeros(len(points), bool), np.zeros(len(points), bool), np.full(len(points), np.nan))
    if not full.any():
        return out
    ground = _Ground.of(model, longitude[full], latitude[full], height[full])
    tx, rx = (ground.turned(end[full] - ground.origin) for end in ends)
    normal, towards = ground.normals(), [_unit(tx), _unit(rx)]
    out.incidence[full] = np.arccos(np.clip(dot(normal, _unit(towards[0] + towards[1])), -1, 1))
    is_dark = np.zeros(len(normal), bool)
    for direction in towards[: 1 if np.array_equal(tx, rx) else 2]:
        is_dark |= (dot(normal, direction) <= 0) | _meets(ground, _Ray(direction), 1)
    out.shadow[full] = is_dark
    turned = [ground.turned(np.broadcast_to(v, tx.shape)) for v in speeds or ()]
    curve = _Curve(tx, rx, *(turned or [np.zeros_like(tx)] * 2))
    out.layover[full] = _meets(ground, curve, 1) | _meets(ground, curve, -1)
    return out


@dataclass(frozen=True, eq=False)
class _Ground:
    """Points of the terrain, each with a frame east, north, up: rows of axes (n, 3, 3). Positions d, m (n, 3), are in
    the frame of their point."""

    model: ElevationModel
    longitude: Floats
    latitude: Floats
    height: Floats
    origin: Floats
    axes: Floats

    @classmethod
    def of(cls, model: ElevationModel, longitude: Floats, latitude: Floats, height: Floats) -> _Ground:
        lon, up = np.radians(longitude), wgs84.up(longitude, latitude)
        east = np.stack([-np.sin(lon), np.cos(lon), np.zeros_like(lon)], axis=-1)
        axes = np.stack([east, np.cross(up, east), up], axis=1)
        return cls(model, longitude, latitude, height, wgs84.ecef(longitude, latitude, height), axes)

    def turned(self, vectors: Floats) -> Floats:
        """Vectors (n, 3), Earth-fixed, in the frames of the points."""
        return np.einsum("nij,nj->ni", self.axes, vectors)

    def below(self, points: np.ndarray, d: Floats) -> tuple[Floats, Floats]:
        """Heights above the ellipsoid, m (k,), of positions d, m (k, 3), about some points (k,), and rows and columns
        of the model there (2, k). To second order in d over the Earth's radius: a few centimetres at 10 km."""
        latitude = np.radians(self.latitude[points])
        e, n, u = d.T
        sine, tangent = np.sin(latitude), np.tan(latitude)
        bend = 1 - wgs84.ECCENTRICITY_SQUARED * sine**2
        across = wgs84.SEMI_MAJOR / np.sqrt(bend) + self.height[points]  # radii of curvature, to east and to north
        along = across * (1 - wgs84.ECCENTRICITY_SQUARED) / bend
        lon = self.longitude[points] + np.degrees(e * (1 + n * tangent / across) / ((across + u) * np.cos(latitude)))
        lat = self.latitude[points] + np.degrees(n / (along + u) - e**2 * tangent / (2 * across * along))
        rise = e**2 / (2 * across) + n**2 / (2 * along)
        return self.height[points] + u + rise, self.model.cells_at(lon, lat)

    def normals(self) -> Floats:
        """Unit normals of the terrain (n, 3), from heights a quarter of the model's spacing away."""
        points, step, slopes = np.arange(len(self.height)), STEP * self.model.spacing, []
        for axis in (0, 1):
            ends = []
            for sign in (1, -1):
                d = np.zeros((len(points), 3))
                d[:, axis] = sign * step
                height, cells = self.below(points, d)
                terrain = self.model.heights_in(cells)
                ends.append(np.where(np.isnan(terrain), 0.0, terrain - height) * sign)
            slopes.append((ends[0] + ends[1]) / (2 * step))
        return _unit(np.stack([-slopes[0], -slopes[1], np.ones(len(points))], axis=-1))


class _Path(Protocol):
    """A way through the air from points of the terrain."""

    def direction(self, points: np.ndarray, d: Floats) -> Floats:
        """Unit vectors (k, 3) at positions d, m (k, 3), about some points (k,)."""

    def onto(self, points: np.ndarray, d: Floats) -> Floats:
        """Positions on the path beside those of a straight step, m (k, 3)."""


@dataclass(frozen=True, eq=False)
class _Ray:
    """The straight path to an antenna; unit vectors (n, 3)."""

    towards: Floats

    def direction(self, points: np.ndarray, d: Floats) -> Floats:
        return self.towards[points]

    def onto(self, points: np.ndarray, d: Floats) -> Floats:
        return d


@dataclass(frozen=True, eq=False)
class _Curve:
    """The curve of equal path and equal rate of path through points; antennas and velocities, m and m/s (n, 3) each.

    With u the unit vector to an antenna, r its distance, v its velocity: the path falls along k = sum u, its rate along
    k' = sum (v - (v.u) u)/r. Where antennas stand still, k' is the horizontal across k: a vertical plane.
    """

    tx: Floats
    rx: Floats
    tx_velocity: Floats
    rx_velocity: Floats

    def _gradients(self, points: np.ndarray, d: Floats) -> tuple[Floats, Floats, Floats, Floats]:
        """k and k' (k, 3), and path and rate of path (k,), at positions d."""
        path, rate, k, turn = np.zeros(len(d)), np.zeros(len(d)), np.zeros_like(d), np.zeros_like(d)
        for end, velocity in ((self.tx, self.tx_velocity), (self.rx, self.rx_velocity)):
            way, v = end[points] - d, velocity[points]
            r = np.sqrt(dot(way, way))
            u = way / r[:, None]
            along = dot(v, u)
            path, rate, k = path + r, rate + along, k + u
            turn += (v - along[:, None] * u) / r[:, None]
        rests = dot(turn, turn) < STANDING**2
        look = (self.tx + self.rx)[points]
        side = _unit(np.stack([-look[:, 1], look[:, 0], np.zeros(len(d))], axis=-1))
        turn = np.where(rests[:, None], side, turn)
        return k, turn, path, np.where(rests, -dot(side, d), rate)

    @cached_property
    def _first(self) -> tuple[Floats, Floats]:
        """Path and rate at the points themselves (n,)."""
        return self._gradients(np.arange(len(self.tx)), np.zeros_like(self.tx))[2:]

    def direction(self, points: np.ndarray, d: Floats) -> Floats:
        k, turn, _, _ = self._gradients(points, d)
        normal = _unit(np.cross(k, turn))
        return normal * np.where(normal[:, 2:] < 0, -1.0, 1.0)

    def onto(self, points: np.ndarray, d: Floats) -> Floats:
        k, turn, path, rate = self._gradients(points, d)
        kk, kt, tt = dot(k, k), dot(k, turn), dot(turn, turn)
        first_path, first_rate = self._first
        excess, drift = path - first_path[points], rate - first_rate[points]
        determinant = kk * tt - kt**2
        a, b = (excess * tt - drift * kt) / determinant, (drift * kk - excess * kt) / determinant
        return d + a[:, None] * k + b[:, None] * turn


def _meets(ground: _Ground, path: _Path, sign: int) -> np.ndarray:
    """Whether the terrain meets a path from each point, bool (n,), on its way up (sign 1) or down (-1).

    A path upwards ends above all terrain, and one downwards below it: it meets the terrain where it is on the other
    side before. Beyond the model there is no terrain.
    """
    model = ground.model
    meets = np.zeros(len(ground.height), bool)
    points, d = np.arange(len(meets)), np.zeros((len(meets), 3))
    longest, end = LONGEST * model.spacing, model.highest if sign > 0 else model.lowest
    _, cells = ground.below(points, d)
    probe = sign * STEP * model.spacing * path.direction(points, d)
    rates = (ground.below(points, probe)[1] - cells) / (STEP * model.spacing)
    for _ in range(MOST_STEPS):
        length = _to_next_line(cells, rates, longest)
        d = path.onto(points, d + sign * length[:, None] * path.direction(points, d))
        height, new_cells = ground.below(points, d)
        terrain = model.heights_in(new_cells)
        is_met = sign * (height - terrain) < -CLEAR
        meets[points[is_met]] = True
        goes_on = ~is_met & np.isfinite(terrain) & (sign * (end - height) > 0)
        rates = ((new_cells - cells) / length)[:, goes_on]
        points, d, cells = points[goes_on], d[goes_on], new_cells[:, goes_on]
        if not len(points):
            break
    return meets


def _to_next_line(cells: Floats, rates: Floats, longest: float) -> Floats:
    """Lengths, m (n,), after which paths at fractional (row, column) (2, n), which change by so many cells per metre,
    reach the next row or column of points."""
    ahead = np.where(rates > 0, np.floor(cells + BEHIND) + 1 - cells, cells - (np.ceil(cells - BEHIND) - 1))
    with np.errstate(divide="ignore", invalid="ignore"):
        lengths = np.where(np.abs(rates) > 0, ahead / np.abs(rates), np.inf)
    return np.minimum(np.nan_to_num(lengths, nan=np.inf).min(axis=0), longest)


def _unit(vectors: Floats) -> Floats:
    return np.asarray(vectors / np.sqrt(dot(vectors, vectors))[:, None])
