"""Pixels on a regular grid of a map, whose axes are x eastwards and y northwards of a coordinate reference system."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ...base import validation, wgs84
from ...base.vectors import Floats
from ...earth.elevation import HIGHEST, ElevationModel
from ...earth.map_projection import MapProjection


class MapAxes(NamedTuple):
    """Axes of a map: pixel [i, j] lies at x + j dx, y + i dy, in units of its CRS; shape (rows, columns)."""

    x: float
    y: float
    dx: float
    dy: float
    shape: tuple[int, int]

    @classmethod
    def within(cls, bounds: ArrayLike, spacing: ArrayLike, unit: str) -> MapAxes:
        """The pixels whose areas cover bounds, (west, south, east, north); spacing (row, column)."""
        west, south, east, north = validation.array("bounds", bounds, np.float64, (4,)).tolist()
        dy, dx = (
            validation.number(f"spacing[{i}]", d, above=0) for i, d in enumerate(validation.pair("spacing", spacing))
        )
        if not (west < east and south < north):
            raise ValueError(
                f"bounds is ({west:g}, {south:g}, {east:g}, {north:g}); give (west, south, east, north) in units of "
                f"the CRS ({unit}), west < east and south < north"
            )
        rows, columns = (max(1, int(np.ceil(n - 1e-6))) for n in ((north - south) / dy, (east - west) / dx))
        if (north - south < dy and east - west < dx) or rows * columns > 2**40:
            raise ValueError(
                f"spacing ({dy:g}, {dx:g}) and bounds ({west:g}, {south:g}, {east:g}, {north:g}) give {rows} x "
                f"{columns} pixels; give both in units of the CRS ({unit}), for 2 to 1e12 pixels"
            )
        return cls(west + dx / 2, south + dy / 2, dx, dy, (rows, columns))

    @property
    def bounds(self) -> tuple[float, float, float, float]:
        """Edges of the pixels: (west, south, east, north)."""
        west, south = self.x - self.dx / 2, self.y - self.dy / 2
        return west, south, west + self.shape[1] * self.dx, south + self.shape[0] * self.dy

    def at(self, row: np.ndarray, column: np.ndarray) -> tuple[Floats, Floats]:
        """x and y of fractional indices, which are broadcast together."""
        x, y = np.broadcast_arrays(self.x + column * self.dx, self.y + row * self.dy)
        return x, y

    def rows(self, start: int, stop: int) -> tuple[Floats, Floats]:
        """x and y of all pixels of some rows (n, columns)."""
        return self.at(np.arange(start, stop)[:, None], np.arange(self.shape[1]))


def on_map(
    crs: str | int, bounds: ArrayLike | None, spacing: ArrayLike | None, heights: ArrayLike | ElevationModel
) -> tuple[str, Floats, Floats]:
    """The CRS as text, map axes (x, y, dx, dy), and Earth-fixed positions of the pixels, m (rows, columns, 3): as
    `ImageGrid.on_map` describes them."""
    projection = MapProjection.of(crs)
    model = heights if isinstance(heights, ElevationModel) else None
    if bounds is None:
        if model is None:
            raise ValueError(
                f"on_map needs bounds=(west, south, east, north), in units of the CRS ({projection.unit}), unless "
                "heights are an elevation model"
            )
        projection.check_reach(_border(model.longitude), _border(model.latitude))
        x, y = projection.transformer.transform(_border(model.longitude), _border(model.latitude))
        bounds = x.min(), y.min(), x.max(), y.max()
    if spacing is None:
        if model is None:
            raise ValueError(
                f"on_map needs spacing=, in units of the CRS ({projection.unit}), unless heights are an elevation model"
            )
        west, south, east, north = np.asarray(bounds, np.float64)
        spacing = [model.spacing / metres for metres in projection.scale((west + east) / 2, (south + north) / 2)]
    axes = MapAxes.within(bounds, spacing, projection.unit)
    largest = np.abs(axes.bounds).max()
    if (largest > 720) if projection.is_degrees else (largest <= 360 and projection.crs.to_authority() is not None):
        raise ValueError(
            f"bounds is {axes.bounds}; give them in units of the CRS {projection.text} ({projection.unit})"
        )
    validation.room(
        f"positions of {axes.shape[0]} x {axes.shape[1]} pixels",
        24.0 * axes.shape[0] * axes.shape[1],
        "give a larger spacing, or smaller bounds",
    )
    x, y = axes.rows(0, axes.shape[0])
    longitude, latitude = projection.places(x, y)
    projection.check_reach(_border(longitude), _border(latitude))
    if isinstance(heights, ElevationModel):
        heights = heights.heights_at(longitude, latitude)
        if np.isnan(heights).all():
            raise ValueError("heights: the elevation model has no data within bounds; check the CRS and its units")
    elif validation.ndim("heights", heights) == 0:
        heights = validation.number("heights", heights)
    else:
        heights = validation.converted("heights", heights, np.float64)
        if heights.shape != axes.shape:
            raise ValueError(
                f"heights has shape {heights.shape}, but the map {axes.shape}; give a number, a height for each pixel "
                "(row 0 in the south), or an ElevationModel"
            )
    highest = float(np.nanmax(np.abs(heights)))
    if highest > HIGHEST:
        raise ValueError(f"heights reach {highest:.6g} m, which no land has; give metres")
    return projection.text, np.array(axes[:4]), wgs84.ecef(longitude, latitude, heights)


def placed(crs: str, map_axes: np.ndarray, shape: tuple[int, int], height: float | Floats) -> tuple[str, Floats]:
    """The CRS as text, and Earth-fixed positions, m (rows, columns, 3), of the pixels of a map.

    height  above the ellipsoid, m: of all, or of each pixel (rows, columns), NaN where there is none
    """
    projection = MapProjection.of(crs)
    validation.room(f"positions of {shape[0]} x {shape[1]} pixels", 24.0 * shape[0] * shape[1], "read a smaller map")
    west, south, dx, dy = map_axes.tolist()
    x, y = MapAxes(west, south, dx, dy, shape).rows(0, shape[0])
    longitude, latitude = projection.places(x, y)
    projection.check_reach(_border(longitude), _border(latitude))
    return projection.text, wgs84.ecef(longitude, latitude, height)


def _border(values: Floats) -> Floats:
    return np.concatenate([values[0], values[-1], values[:, 0], values[:, -1]])
