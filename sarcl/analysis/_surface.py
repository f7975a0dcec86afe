"""The surface that a point is measured on, as rows and columns of positions, and the antennas that saw the point."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..model import listed_surface
from ..model.image import Image
from ..model.image_grid import ImageGrid

NEAR = 32  # pixels on each side of the pixel to which a plane is fitted
LEAST = 1e-4  # area of a cell over the square of its longer side
FIT = 2.0  # pixels: the plane follows pixels nearer than that most, which a response at half power covers


@dataclass(frozen=True, eq=False)
class LocalPlane:
    """The plane that touches a listed grid at fractional indices, with even steps of rows and columns.

    x(i, j) = origin + (i - row) down + (j - column) across: `origin` lies on the surface of the grid, and the steps fit
    those of the pixels about it by least squares, which count less the farther they are. Positions m (3,).
    """

    row: float
    column: float
    origin: np.ndarray
    down: np.ndarray
    across: np.ndarray

    @classmethod
    def about(cls, grid: ImageGrid, row: float, column: float) -> LocalPlane:
        """The plane at fractional indices. ValueError where cells about them are empty, or lie on no surface."""
        assert grid.listed is not None
        pixel = np.rint([row, column]).astype(int)
        low, high = np.maximum(pixel - NEAR, 0), np.minimum(pixel + NEAR + 1, grid.shape)
        origin = _between(grid.listed, row, column)
        listed = grid.listed[low[0] : high[0], low[1] : high[1]] - origin
        i = (np.arange(low[0], high[0]) - row)[:, None] + np.zeros(high[1] - low[1])
        j = np.arange(low[1], high[1]) - column + np.zeros(high[0] - low[0])[:, None]
        full = ~np.isnan(listed[..., 0])
        weight = np.exp(-0.5 * (i**2 + j**2) / FIT**2)[full][:, None]
        steps = np.linalg.lstsq(weight * np.stack([i[full], j[full]], axis=1), weight * listed[full], rcond=None)[0]
        if not np.linalg.norm(np.cross(*steps)) > LEAST * np.linalg.norm(steps, axis=1).max() ** 2:
            raise ValueError(
                f"rows and columns of the grid about pixel ({pixel[0]}, {pixel[1]}) span no plane; a point is "
                "measured on neighbouring rows and columns of a surface: list it so, or use ImageGrid.plane"
            )
        return cls(row, column, origin, *steps)

    def at(self, row: np.ndarray, column: np.ndarray) -> np.ndarray:
        """Position on the plane, m (..., 3), of fractional indices."""
        i, j = np.asarray(row) - self.row, np.asarray(column) - self.column
        return np.asarray(self.origin + i[..., None] * self.down + j[..., None] * self.across)

    def index(self, position: np.ndarray) -> np.ndarray:
        """Fractional (row, column) (..., 2) of positions, m (..., 3), projected on the plane along its normal."""
        steps = (np.asarray(position) - self.origin) @ np.linalg.pinv(np.stack([self.down, self.across]))
        return np.asarray(steps + np.array([self.row, self.column]))

    def normal_at(self, row: float, column: float) -> np.ndarray:
        """Unit normal (3,)."""
        normal = np.cross(self.across, self.down)
        return np.asarray(normal / np.linalg.norm(normal))

    def spacing_at(self, row: float, column: float) -> tuple[float, float]:
        """Distance to the next row and column, m."""
        return float(np.linalg.norm(self.down)), float(np.linalg.norm(self.across))


def _between(listed: np.ndarray, row: float, column: float) -> np.ndarray:
    """Position, m (3,), at fractional indices; of a whole index that of the pixel, whatever is around it."""
    if row == round(row) and column == round(column):
        return np.asarray(listed[round(row), round(column)])
    return listed_surface.at(listed, np.asarray(row), np.asarray(column))


Surface = ImageGrid | LocalPlane


def surface_at(image: Image, row: float, column: float) -> Surface:
    """The surface on which the response at fractional indices is measured: the grid itself where it is a plane or by
    range_doppler, else the plane that touches it there."""
    if has_surface(image.grid):
        return image.grid
    return LocalPlane.about(image.grid, row, column)


def has_surface(grid: ImageGrid) -> bool:
    """Whether the grid knows the positions between its pixels."""
    return grid.is_plane or grid.times is not None


def pixel_of(image: Image, position: np.ndarray) -> np.ndarray:
    """Fractional (row, column) of a position, m (3,); of a listed grid the nearest pixel.

    ValueError where a listed grid ends, or has no data, nearer to its nearest pixel than the position lies.
    """
    grid = image.grid
    if has_surface(grid):
        return grid.index(position)
    assert grid.listed is not None
    squares = ((grid.listed - position) ** 2).sum(axis=-1)
    row, column = np.unravel_index(int(np.nanargmin(squares)), squares.shape)
    return LocalPlane.about(grid, int(row), int(column)).index(position)


def place_of(image: Image, row: int, column: int) -> np.ndarray:
    """Position of a pixel, m (3,)."""
    return image.grid.at(row, column) if has_surface(image.grid) else image.grid.listed[row, column]  # type: ignore[index]
