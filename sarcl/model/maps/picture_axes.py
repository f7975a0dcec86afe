"""Axes of pictures of images: in metres, or of a map. Imported late: it loads what draws them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ...figures.decibels import PixelAxes

if TYPE_CHECKING:
    from ..image_grid import ImageGrid


def picture_axes(grid: ImageGrid) -> PixelAxes:
    """Axes of a picture of pixels of two axes: see `Image.show`."""
    origin, names = (0.0, 0.0), ("y", "x")
    if grid.map_axes is not None and grid.crs is not None:
        return _map_picture_axes(grid.crs, grid.map_axes, grid.shape)
    spacing = grid.spacing
    if grid.center is not None and grid.y_axis is not None and grid.x_axis is not None:
        origin = float(grid.center @ grid.y_axis), float(grid.center @ grid.x_axis)
        # axes parallel to the scene's show its coordinates, other axes the distance along themselves
        along = np.eye(3)[1], np.eye(3)[0]
        if not all(np.allclose(a, b, atol=1e-9) for a, b in zip((grid.y_axis, grid.x_axis), along, strict=True)):
            names = ("along y_axis", "along x_axis")
    elif grid.ranges is not None and min(grid.shape) > 1:
        middle = grid.shape[0] // 2, grid.shape[1] // 2
        spacing = grid.spacing_at(*middle)[0], float(grid.ranges[1] - grid.ranges[0])
        near = float(np.round(grid.ranges[middle[1]]))  # labels of seven digits would leave room for one tick
        origin = 0.0, float(grid.ranges[middle[1]]) - near
        names = "along the track", f"slant range less {near:.0f} m"
    return PixelAxes(spacing, origin, names)


def _map_picture_axes(crs: str, map_axes: NDArray[np.float64], shape: tuple[int, ...]) -> PixelAxes:
    """Axes of a map: longitude and latitude, or metres less whole thousands. Without pyproj, pixels are counted."""
    from ...earth.map_projection import MapProjection

    try:
        projection = MapProjection.of(crs)
    except ImportError:
        return PixelAxes()
    x, y, dx, dy = map_axes.tolist()
    middle = [y + shape[0] // 2 * dy, x + shape[1] // 2 * dx]
    origin, names = list(middle), list(projection.names)
    if not projection.is_degrees:  # labels of seven digits would leave room for few ticks
        near = [1000.0 * np.floor(value / 1000) for value in middle]
        origin = [value - less for value, less in zip(middle, near, strict=True)]
        names = [f"{name} less {less:.0f} {projection.unit}" for name, less in zip(names, near, strict=True)]
    metres = projection.scale(middle[1], middle[0])
    return PixelAxes((dy, dx), (origin[0], origin[1]), (names[0], names[1]), projection.unit, metres)
