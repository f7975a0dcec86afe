"""Rows and columns of longitudes and latitudes in a grid: of axes, or of any curvilinear grid.

Grids whose rows are parallels and whose columns are meridians are read axis by axis. Others (projected maps) are read
by Newton's iteration, with bilinear interpolation between the four points of a cell: of degrees, or near a pole and
around it of stereographic coordinates about the middle of the grid, which are smooth everywhere but at the antipode.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..base import wgs84
from ..base.vectors import Floats

ITERATIONS = 30
FOUND = 1e-6  # step of the iteration, in cells, at which a position is found; others lie outside the grid
SAME = 1.2e-13  # degrees, 1.3e-8 m, twice the rounding of longitudes up to 360: positions nearer to a point are at it
ANTIPODE = -1 + 1e-9  # cosine of the angle from the middle: beyond, stereographic coordinates are set to 1e6
POLAR = 80.0  # degrees of latitude
BLOCK = 2**20  # points of a grid that are projected at once


@dataclass(frozen=True, eq=False)
class Axes:
    """A grid of meridians, degrees (n_columns,), and parallels (n_rows,), both monotonic, in either direction."""

    longitude: Floats
    latitude: Floats

    @classmethod
    def of(cls, longitude: Floats, latitude: Floats) -> Axes | None:
        """The axes of longitudes and latitudes (n_rows, n_columns), or None for a grid of other lines.

        ValueError for axes that go back, or jump over the antimeridian.
        """
        if (longitude != longitude[0]).any() or (latitude != latitude[:, :1]).any():
            return None
        grid_axes = cls(longitude[0].copy(), latitude[:, 0].copy())
        if np.abs(np.diff(grid_axes.longitude)).max() >= 180:
            raise ValueError(
                "longitude jumps by 180 degrees or more between neighbours; across the antimeridian let it go on "
                "beyond 180 (179, 180, 181)"
            )
        for name, axis in (("longitude", grid_axes.longitude), ("latitude", grid_axes.latitude)):
            steps = np.diff(axis)
            if not ((steps > 0).all() or (steps < 0).all()):
                i = int(np.argmax(steps * np.sign(axis[-1] - axis[0]) <= 0)) + 1
                raise ValueError(
                    f"{name} {axis[i]:.9g} at {i} follows {axis[i - 1]:.9g}; it must increase or decrease along the "
                    "grid: sort it, with the heights"
                )
        return grid_axes

    @property
    def is_around(self) -> bool:
        """Whether the first column follows the last one: the grid goes around the Earth."""
        step = float(np.diff(self.longitude).mean())
        return abs(abs(self.longitude[-1] + step - self.longitude[0]) - 360) < 1e-3 * abs(step)

    def at(self, longitude: Floats, latitude: Floats) -> Floats:
        """Fractional (row, column) (2, n) of degrees (n,); beyond the ends outside the grid."""
        axis = self.longitude
        if self.is_around:
            axis = np.append(axis, axis[0] + 360 * np.sign(axis[-1] - axis[0]))
        turns = np.rint((longitude - (axis[0] + axis[-1]) / 2) / 360)
        return np.stack([_place(self.latitude, latitude), _place(axis, longitude - 360 * turns)])


def _place(axis: Floats, values: Floats) -> Floats:
    """Fractional indices (n,) of values in a monotonic axis, by linear inter- and extrapolation; whole ones of its
    own values."""
    if axis[-1] < axis[0]:
        return len(axis) - 1 - _place(axis[::-1], values)
    low = np.clip(np.searchsorted(axis, values, side="right") - 1, 0, len(axis) - 2)
    beyond, step = values - axis[low], axis[low + 1] - axis[low]
    part = np.where(np.abs(beyond) <= SAME, 0.0, np.where(np.abs(beyond - step) <= SAME, 1.0, beyond / step))
    return np.asarray(low + part)


@dataclass(frozen=True, eq=False)
class Curvilinear:
    """A grid of any lines, by coordinates of its points (2, n_rows, n_columns): degrees from the middle meridian and
    degrees of latitude, or stereographic ones.

    is_polar  whether coordinates are stereographic;  middle  longitude of the middle, degrees
    axes    (3, 3): the middle of the grid, seen from the Earth's centre, and two directions across
    affine  (2, 3): about rows and columns of the coordinates, by least squares over the corners
    """

    is_polar: bool
    middle: float
    axes: Floats
    points: Floats
    affine: Floats

    @classmethod
    def of(cls, longitude: Floats, latitude: Floats) -> Curvilinear:
        """ValueError for a grid that is folded, or has empty cells."""
        i, j = (n // 2 for n in longitude.shape)
        middle = float(longitude[i, j])
        widest = max(float(np.abs(_around(longitude[rows], middle)).max()) for rows in _blocks(longitude.shape))
        is_polar = max(abs(float(latitude.min())), abs(float(latitude.max()))) > POLAR or widest > 90
        axes = np.roll(wgs84.local_axes(float(longitude[i, j]), float(latitude[i, j])), 1, axis=0)
        points = np.empty((2, *longitude.shape))
        for rows in _blocks(longitude.shape):
            points[:, rows] = _coordinates(is_polar, middle, axes, longitude[rows], latitude[rows])
        signs = []
        for rows in _blocks((longitude.shape[0] - 1, longitude.shape[1])):
            part = points[:, rows.start : rows.stop + 1]
            down, right = np.diff(part, axis=1)[:, :, :-1], np.diff(part, axis=2)[:, :-1]
            area = down[0] * right[1] - down[1] * right[0]
            signs += [area.min(), area.max()]
        if not (min(signs) > 0 or max(signs) < 0):
            raise ValueError(
                "longitude and latitude make a grid that is folded, or has cells without area; neighbours in the grid "
                "must be neighbours on the Earth"
            )
        size = np.array(longitude.shape) - 1
        corner = np.array([[0, 0], [0, size[1]], [size[0], 0], size])
        coordinates = np.column_stack([points[:, corner[:, 0], corner[:, 1]].T, np.ones(4)])
        affine = np.linalg.lstsq(coordinates, corner.astype(np.float64), rcond=None)[0].T
        return cls(is_polar, middle, axes, points, affine)

    def at(self, longitude: Floats, latitude: Floats) -> Floats:
        """Fractional (row, column) (2, n) of degrees (n,), whole at the points; NaN where there is none."""
        target = _coordinates(self.is_polar, self.middle, self.axes, longitude, latitude)
        size = np.array(self.points.shape[1:])[:, None]
        index, step, off = newton(self.points, target, self.affine[:, :2] @ target + self.affine[:, 2:])
        same = np.radians(SAME) if self.is_polar else SAME
        is_found = (np.abs(step) <= FOUND).all(axis=0) | (np.abs(off) <= same).all(axis=0)
        nearest = np.clip(np.rint(np.nan_to_num(index)).astype(np.int64), 0, size - 1)
        is_point = (np.abs(target - self.points[:, nearest[0], nearest[1]]) <= same).all(axis=0)
        return np.where(is_point, nearest, np.where(is_found, index, np.nan))


def _blocks(shape: tuple[int, ...]) -> list[slice]:
    """Rows of a grid, some at a time."""
    count = max(1, BLOCK // shape[1])
    return [slice(first, min(first + count, shape[0])) for first in range(0, shape[0], count)]


def _around(longitude: Floats, middle: float) -> Floats:
    """Longitudes from a middle one, from -180 to 180 degrees."""
    return np.asarray((longitude - middle + 180) % 360 - 180)


def _coordinates(is_polar: bool, middle: float, axes: Floats, longitude: Floats, latitude: Floats) -> Floats:
    """Coordinates (2, ...) of degrees (...): as `Curvilinear` has them."""
    if not is_polar:
        return np.stack([_around(longitude, middle), latitude])
    along, x, y = np.moveaxis(wgs84.up(longitude, latitude) @ axes.T, -1, 0)
    return np.asarray(np.where(along > ANTIPODE, 2 / np.maximum(1 + along, 1e-9) * np.stack([x, y]), 1e6))


def newton(points: Floats, target: Floats, index: Floats) -> tuple[Floats, Floats, Floats]:
    """Fractional (row, column) (2, n) of coordinates (2, n) in a grid of points (2, n_rows, n_columns), bilinear in
    its cells, from a first guess; the last steps (2, n), which are large where there is no such place; and what
    is left between coordinates and target (2, n) before that step."""
    size = np.array(points.shape[1:])[:, None]
    for _ in range(ITERATIONS):
        index = np.clip(index, -2.0, size + 1.0)
        low = np.clip(np.floor(np.nan_to_num(index)).astype(np.int64), 0, size - 2)
        (i, j), (u, v) = low, index - low
        a, b, c, d = (points[:, i + m, j + n] for m in (0, 1) for n in (0, 1))
        down, right = (1 - v) * (c - a) + v * (d - b), (1 - u) * (b - a) + u * (d - c)
        off = target - ((1 - v) * a + v * b + u * down)
        area = down[0] * right[1] - down[1] * right[0]
        with np.errstate(divide="ignore", invalid="ignore"):
            step = np.stack([off[0] * right[1] - off[1] * right[0], down[0] * off[1] - down[1] * off[0]]) / area
        index = index + step
        inside = ((index > -0.5) & (index < size - 0.5)).all(axis=0)
        if not (np.abs(step[:, inside]) > 1e-3 * FOUND).any():
            break
    return index, step, off
