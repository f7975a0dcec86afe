"""The tiling of a grid: by one class for each kind of grid."""

from __future__ import annotations

from ...model.image_grid import ImageGrid
from ._points import PointTiling
from .plane import PlaneTiling
from .tiling import Tiling


def tiling_of(grid: ImageGrid, side: int) -> Tiling:
    """The tiling of a grid in tiles of side x side pixels."""
    return (PlaneTiling if grid.is_plane else PointTiling)(grid, side)
