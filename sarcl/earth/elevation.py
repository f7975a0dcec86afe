"""ElevationModel: heights of terrain above the ellipsoid, at any longitude and latitude in it."""

from __future__ import annotations

import functools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from ..base import validation, wgs84
from ..base.types import PathLike
from ..base.vectors import Floats
from ..io import elevation
from ..io.elevation import Geoid
from .grid_index import Axes, Curvilinear

FARTHEST = 1e6  # degrees: more is no place
SAME = 1e-9  # distance to a point, in cells, below which a position is at it
HIGHEST = 20e3  # m: the Earth's surface reaches from -10 935 to 8849


@dataclass(frozen=True, eq=False)
class ElevationModel:
    """Heights of terrain above the WGS84 ellipsoid, at the points of a grid; between these, bilinear interpolation.

    longitude  degrees (n_columns,), or (n_rows, n_columns);  latitude  degrees (n_rows,), or (n_rows, n_columns)
    height     m (n_rows, n_columns), above the ellipsoid (not above a geoid), NaN without data

    Longitudes (n_columns,) that cross the antimeridian go on beyond 180 degrees; grids (n_rows, n_columns) may jump
    there, and may cover a pole. Where the columns go around the Earth, the first follows the last. Raises ValueError
    for shapes that disagree, axes that go back or jump by 180 degrees, folded grids, and heights that are infinite, all
    NaN, or beyond +-20 km. `read` takes files.

    >>> model = sarcl.ElevationModel([7.0, 7.1, 7.2], [46.0, 46.1], [[500, 600, 700], [600, 700, 800]])
    >>> round(float(model.heights_at(7.05, 46.05)), 3)
    600.0
    >>> alps = sarcl.ElevationModel.read("terrain.tif", heights="ellipsoid")  # needs sarcl[maps]
    """

    longitude: Floats
    latitude: Floats
    height: Floats

    if TYPE_CHECKING:  # types of the arguments; the fields above have the types after conversion

        def __init__(self, longitude: ArrayLike, latitude: ArrayLike, height: ArrayLike) -> None: ...

    def __post_init__(self) -> None:
        height = validation.converted("height", self.height, np.float64)
        if height.ndim != 2 or min(height.shape) < 2:
            raise ValueError(f"height has shape {height.shape}; wanted (n_rows, n_columns), two of each at least")
        if np.isinf(height).any() or np.isnan(height).all():
            raise ValueError("height is infinite somewhere, or NaN everywhere; give metres, NaN where data is missing")
        if np.nanmax(np.abs(height)) > HIGHEST:
            raise ValueError(f"height reaches {np.nanmax(np.abs(height)):.6g} m, which no land has; give metres")
        for name, axis in (("longitude", 1), ("latitude", 0)):
            validation.ndim(name, getattr(self, name))
            degrees = np.asarray(getattr(self, name))
            shape = (height.shape[axis],) if degrees.ndim == 1 else height.shape
            values = validation.array(name, degrees, np.float64, shape)
            if degrees.ndim == 1:
                values = np.broadcast_to(values if axis else values[:, None], height.shape)
            object.__setattr__(self, name, values)
        if np.abs(self.latitude).max() > 90:
            raise ValueError(f"latitude reaches {np.abs(self.latitude).max():g}; give degrees from -90 to 90")
        Axes.of(self.longitude, self.latitude)
        object.__setattr__(self, "height", validation.sealed(height))

    @classmethod
    def read(
        cls,
        path: PathLike,
        *,
        bounds: Sequence[float] | np.ndarray | None = None,
        heights: str | None = None,
        geoid: Geoid = None,
        nodata: float | None = None,
        external: bool = False,
    ) -> ElevationModel:
        """The elevation model of a file that rasterio reads: path, bounds, heights, geoid, nodata, external, and
        errors, as in `Scene.from_dem`."""
        tile = elevation.load(path, bounds=bounds, heights=heights, geoid=geoid, nodata=nodata, external=external)
        try:
            return cls(tile.longitude, tile.latitude, tile.height)
        except ValueError as exc:  # of a damaged georeference
            raise ValueError(f"DEM {Path(path).name!r}: {exc}") from None

    @property
    def lowest(self) -> float:
        """Least height, m."""
        return float(np.nanmin(self.height))

    @property
    def highest(self) -> float:
        """Greatest height, m."""
        return float(np.nanmax(self.height))

    @property
    def spacing(self) -> float:
        """Least distance between neighbouring points along the middle row and column, m."""
        i, j = (n // 2 for n in self.height.shape)
        lines = [wgs84.ecef(self.longitude[at], self.latitude[at], 0.0) for at in (np.s_[i, :], np.s_[:, j])]
        return float(min(np.linalg.norm(np.diff(line, axis=0), axis=1).min() for line in lines))

    def heights_at(self, longitude: ArrayLike, latitude: ArrayLike) -> Floats:
        """Heights above the ellipsoid, m (...), at longitude, latitude, degrees (...); NaN outside the grid and in
        cells without data."""
        lon, lat = validation.values("longitude", longitude), validation.values("latitude", latitude)
        try:
            lon, lat = np.broadcast_arrays(lon, lat)
        except ValueError:
            raise ValueError(f"longitude has shape {lon.shape} and latitude {lat.shape}; give equal ones") from None
        return self.heights_in(self.cells_at(lon.ravel(), lat.ravel())).reshape(lon.shape)

    def cells_at(self, lon: Floats, lat: Floats) -> Floats:
        """Fractional (row, column) (2, n) of degrees (n,), NaN outside the grid."""
        index, height = self._index
        is_place = (np.abs(lon) < FARTHEST) & (np.abs(lat) < FARTHEST)
        degrees = ((lon, self.longitude[0, 0]), (lat, self.latitude[0, 0]))
        position = index.at(*(np.where(is_place, value, corner) for value, corner in degrees))
        nearest = np.rint(position)
        position = np.where(
            np.abs(position - nearest) < SAME, nearest, position
        )  # a point needs no neighbours' heights
        size = np.array(height.shape)[:, None] - 1
        is_inside = is_place & ((position >= -1e-6) & (position <= size + 1e-6)).all(axis=0)
        return np.where(is_inside, np.clip(position, 0, size), np.nan)

    def heights_in(self, cells: Floats) -> Floats:
        """Heights above the ellipsoid, m (n,), at fractional (row, column) (2, n) by `cells_at`."""
        return _bilinear(self._index[1], cells)

    @functools.cached_property
    def _index(self) -> tuple[Axes | Curvilinear, Floats]:
        """Rows and columns by degrees, and the heights there: the first column again after the last one around the
        Earth."""
        axes = Axes.of(self.longitude, self.latitude)
        if axes is None:
            return Curvilinear.of(self.longitude, self.latitude), self.height
        return axes, np.concatenate([self.height, self.height[:, :1]], axis=1) if axes.is_around else self.height

    def grid_positions(
        self, spacing: tuple[float, float], frame: str, center: Sequence[float] | np.ndarray | None
    ) -> Floats:
        """Positions on the terrain, m (n_rows, n_columns, 3), at even steps north (row) and east (column), m.

        They cover the box of the model in the local frame at `center`, and are NaN where it has no heights. frame and
        center as in `Scene.from_dem`. MemoryError for too many.
        """
        validation.choice("frame", frame, ("local", "ecef"))
        steps_m = validation.array("spacing", spacing, np.float64, (2,))
        if not (steps_m > 0).all():
            raise ValueError(f"spacing is {steps_m.tolist()} m; give two distances above 0, (north, east)")
        tile = elevation.Tile(self.longitude, self.latitude, self.height)
        origin, axes = elevation.local_frame(tile, center)
        corners = (wgs84.ecef(self.longitude, self.latitude, np.nan_to_num(self.height)) - origin) @ axes.T
        low, high = (f(corners.reshape(-1, 3), axis=0) for f in (np.min, np.max))
        steps = [int(np.floor((high[a] - low[a]) / d * (1 + 1e-9))) + 1 for a, d in ((1, steps_m[0]), (0, steps_m[1]))]
        if math.prod(steps) > elevation.MOST_POINTS:
            raise MemoryError(
                f"a grid of {steps[0]} x {steps[1]} points is more than {elevation.MOST_POINTS:,}; give a larger "
                "spacing, or bounds=(west, south, east, north) of the part that the radar sees"
            )
        y = (low[1] + high[1]) / 2 + (np.arange(steps[0]) - (steps[0] - 1) / 2) * steps_m[0]
        x = (low[0] + high[0]) / 2 + (np.arange(steps[1]) - (steps[1] - 1) / 2) * steps_m[1]
        positions = np.empty((*steps, 3))
        for row, north in enumerate(y):
            local = np.stack([x, np.full_like(x, north), np.full_like(x, corners[..., 2].mean())], axis=-1)
            for _ in range(10):  # the vertical of the frame is nearly the ellipsoid's normal: a step is nearly exact
                lon, lat, height = wgs84.geodetic(local @ axes + origin)
                step = self.heights_at(lon, lat) - height
                local[:, 2] += step
                if not (np.abs(step) > 1e-6).any():
                    break
            local[np.isnan(local[:, 2])] = np.nan
            positions[row] = local
        return positions @ axes + origin if frame == "ecef" else positions


def _bilinear(values: Floats, at: Floats) -> Floats:
    """A grid of values (n_rows, n_columns) at fractional (row, column) (2, n), extrapolated outside: (n,)."""
    size = np.array(values.shape)[:, None]
    low = np.clip(np.nan_to_num(np.floor(at)), 0, size - 2).astype(np.int64)  # NaN in, NaN out: by the weights
    (i, j), (u, v) = low, at - low
    total = np.zeros(at.shape[1])
    for weight, corner in (
        ((1 - u) * (1 - v), values[i, j]),
        ((1 - u) * v, values[i, j + 1]),
        (u * (1 - v), values[i + 1, j]),
        (u * v, values[i + 1, j + 1]),
    ):
        total += np.where(weight == 0, 0.0, weight * corner)
    return total
