"""The tiling of a grid: by one class for each kind of grid."""

from __future__ import annotations

from ...model.image_grid import ImageGrid
from ._points import LISTED, PointTiling
from .plane import PlaneTiling
from .tiling import Tiling


def tiling_of(grid: ImageGrid, side: int, listed: int = LISTED) -> Tiling:
    """The tiling of a grid in tiles of side x side pixels; listed  points of a band, where the grid lists its points"""
    return PlaneTiling(grid, side) if grid.is_plane else PointTiling(grid, side, listed)
