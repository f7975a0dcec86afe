"""The tiling of planes for lines of pixels."""

from __future__ import annotations

import numpy as np

from ...model.image_grid import ImageGrid
from ...numerics.tiles import Tiles
from .plane import PlaneTiling


class LineTiling(PlaneTiling):
    """Square tiles of a plane about one of their pixels, (side/2, side/2), so that offsets are whole pixels."""

    def __init__(self, grid: ImageGrid, side: int) -> None:
        super().__init__(grid, side)
        self._cut(side, side)
        self.radius = side / 2 * self.pixel

    def band(self, index: int) -> tuple[Tiles, np.ndarray | None]:
        half = self.side // 2
        columns = np.arange(self.across) * self.side + half
        references = self.grid.at(np.full(self.across, index * self.side + half), columns) - self.center
        radius = np.full(self.across, self.radius)
        return Tiles(self.per_tile, references, radius, np.zeros((6, 0), np.float32), shared=True), None
