"""Positions of an image's pixels on a map, and the places of a map in the image."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from ...base import wgs84
from ...base.vectors import Floats
from ...earth.grid_index import FOUND, newton
from ...earth.map_projection import MapProjection
from .map_grid import MapAxes

if TYPE_CHECKING:
    from ..image_grid import ImageGrid

EVERY = 16  # pixels from node to node of the lattice that finds the part of an image under a part of the map
DIGITS = 3  # of a spacing that is chosen here


@dataclass(frozen=True, eq=False)
class Part:
    """Pixels rows x columns of an image: their positions, m (n_rows, n_columns, 3), and map coordinates (2, ...)."""

    rows: slice
    columns: slice
    positions: Floats
    coordinates: Floats


@dataclass(frozen=True, eq=False)
class Source:
    """The grid of an image on a map, with the coordinates (2, n, m) of a lattice of its pixels.

    near  longitude about which longitudes are counted, degrees;  rows, columns  indices of the lattice (n,), (m,)
    """

    grid: ImageGrid
    projection: MapProjection
    near: float
    rows: np.ndarray
    columns: np.ndarray
    nodes: Floats

    @classmethod
    def of(cls, grid: ImageGrid, crs: str | int | None) -> Source:
        """On the map of a CRS; None: of the UTM zone, or of UPS. ValueError: the CRS does not reach the image."""
        rows, columns = (np.unique(np.append(np.arange(0, n, EVERY), n - 1)) for n in grid.shape)
        index = tuple(np.broadcast_arrays(rows[:, None], columns))
        positions = grid.positions_of(index)
        longitude, latitude, _ = wgs84.geodetic(positions[np.isfinite(positions[..., 0])])
        if not len(longitude):
            raise ValueError("the image has hardly any pixels that are not empty; a map needs more of them")
        projection = MapProjection.at(longitude[0], latitude[0]) if crs is None else MapProjection.of(crs)
        projection.check_reach(longitude, latitude)
        nodes = np.moveaxis(projection.coordinates(positions, float(longitude[0])), -1, 0)
        return cls(grid, projection, float(longitude[0]), rows, columns, nodes)

    def axes(self, spacing: object) -> MapAxes:
        """Axes of the map that holds all pixels, at multiples of the spacing, (row, column) or one number; None: the
        closer spacing of the image's rows and columns."""
        low, high = (f(self.nodes, axis=(1, 2)) for f in (np.nanmin, np.nanmax))
        scale = self.projection.scale(*(low + high) / 2)
        if spacing is None:
            finest = min(self.steps(*scale))
            spacing = [float(f"{finest / metres:.{DIGITS}g}") for metres in scale]
        dy, dx = np.broadcast_to(np.asarray(spacing, np.float64), 2).tolist()
        if np.isnan(self.nodes).any():  # pixels with data may lie between empty nodes and full ones
            low, high = low - self.reach, high + self.reach
        edges = [np.floor(low[0] / dx) * dx, np.floor(low[1] / dy) * dy, high[0] + dx / 2, high[1] + dy / 2]
        return MapAxes.within(edges, (dy, dx), self.projection.unit)

    def steps(self, up: float, across: float) -> tuple[float, float]:
        """Median distances from row to row and from column to column, m, on a map of this scale, m per unit."""
        metres = self.nodes * np.array([across, up])[:, None, None]
        steps = []
        for axis, index in ((1, self.rows), (2, self.columns)):
            length = np.linalg.norm(np.diff(metres, axis=axis), axis=0)
            steps.append(float(np.nanmedian(length / np.expand_dims(np.diff(index), 2 - axis))))
        return steps[0], steps[1]

    @cached_property
    def reach(self) -> Floats:
        """Largest distances of x and y from node to node (2,)."""
        steps = [[np.abs(np.diff(c, axis=axis)) for axis in (0, 1)] for c in self.nodes]
        return np.array([max(float(np.nanmax(s, initial=0.0)) for s in both) for both in steps])

    def part(self, x: Floats, y: Floats) -> Part | None:
        """The pixels around map coordinates (n,), as far as the lattice shows where they are; None where none are."""
        is_near = np.ones(self.nodes.shape[1:], bool)
        for nodes, values, most in zip(self.nodes, (x, y), self.reach, strict=True):
            is_near &= (nodes >= values.min() - most) & (nodes <= values.max() + most)
        if not is_near.any():
            return None
        rows, columns = (
            slice(max(int(index[near][0]) - EVERY, 0), int(index[near][-1]) + EVERY + 1)
            for index, near in ((self.rows, is_near.any(axis=1)), (self.columns, is_near.any(axis=0)))
        )
        rows, columns = (slice(s.start, min(s.stop, n)) for s, n in zip((rows, columns), self.grid.shape, strict=True))
        positions = self.positions(rows, columns)
        return Part(rows, columns, positions, np.moveaxis(self.projection.coordinates(positions, self.near), -1, 0))

    def positions(self, rows: slice, columns: slice) -> Floats:
        """Positions of pixels, m (n_rows, n_columns, 3); NaN of empty cells."""
        if self.grid.listed is not None:
            return self.grid.listed[rows, columns]
        return self.grid.at(np.arange(rows.start, rows.stop)[:, None], np.arange(columns.start, columns.stop))

    def index(self, part: Part, x: Floats, y: Floats) -> Floats:
        """Fractional indices (2, n) in the image of map coordinates (n,); NaN outside the image and in empty cells."""
        target = np.stack([x, y])
        shape = part.coordinates.shape[1:]
        i, j = (np.unique(np.linspace(0, n - 1, 9).astype(int)) for n in shape)
        near = part.coordinates[:, i[:, None], j].reshape(2, -1)
        at = np.stack(np.broadcast_arrays(i[:, None], j)).reshape(2, -1)
        full = np.asarray(np.isfinite(near).all(axis=0))
        middle = near[:, full].mean(axis=1, keepdims=True) if full.any() else np.zeros((2, 1))
        fit = np.linalg.lstsq(np.vstack([near - middle, np.ones(len(full))])[:, full].T, at[:, full].T, rcond=None)[0]
        index, step, _ = newton(part.coordinates, target, fit.T @ np.vstack([target - middle, np.ones(len(x))]))
        first = np.array([[part.rows.start], [part.columns.start]])
        size = np.array(self.grid.shape)[:, None]
        is_inside = ((index >= -0.5) & (index <= np.array(shape)[:, None] - 0.5)).all(axis=0)
        index = index + first
        is_inside &= (np.abs(step) <= FOUND).all(axis=0) & ((index >= -0.5) & (index <= size - 0.5)).all(axis=0)
        return np.where(is_inside, index, np.nan)
