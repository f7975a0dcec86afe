"""Terrain: facets over grids of points, and heights above it."""

from __future__ import annotations

import logging
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, DTypeLike

from ..base import boxes, validation
from . import triangles as geometry
from .material_arguments import FacetMaterials, MaterialLike, resolve

log = logging.getLogger(__name__)

Heights = tuple[np.ndarray, np.ndarray, np.ndarray]  # x (n_x,), y (n_y,), both increasing, and z (n_y, n_x), m
ON = 1e-9  # distance to a terrain over its size, within which corners lie on it


def grid(x: ArrayLike, y: ArrayLike, z: ArrayLike | Callable[[np.ndarray, np.ndarray], ArrayLike]) -> np.ndarray:
    """Points, m (n_y, n_x, 3), of heights z (n_y, n_x), or a function z(x, y), over increasing x (n_x,), y (n_y,)."""
    x = validation.array("x", x, np.float64, ("n_x",))
    y = validation.array("y", y, np.float64, ("n_y",))
    over = np.meshgrid(x, y)
    if callable(z):
        z = z(*over)
        z = np.full(over[0].shape, z) if np.ndim(z) == 0 else z
    z = validation.array("z", z, np.float64, (len(y), len(x)))
    for name, axis in (("x", x), ("y", y)):
        if len(axis) < 2 or not (np.diff(axis) > 0).all():
            raise ValueError(
                f"{name} must hold at least two increasing values: a cell needs an extent; reverse a falling "
                "axis together with z"
            )
    return np.stack([*over, z], axis=-1)


def heights(points: np.ndarray) -> Heights:
    """The (x, y, z) from which `grid` made points."""
    x, y, z = points[0, :, 0], points[:, 0, 1], points[..., 2]
    return validation.sealed(x.copy()), validation.sealed(y.copy()), validation.sealed(z.copy())


def surface(
    points: np.ndarray,
    up: np.ndarray,
    *,
    material: FacetMaterials,
    materials: Sequence[MaterialLike] | None,
    roughness: ArrayLike,
    point_roughness: ArrayLike,
) -> dict[str, Any]:
    """Arguments of Scene.facets for a grid of points, m (n, m, 3): two facets per cell, none where a point is NaN.

    They face `up`, unit vectors (3,) or (n, m, 3), along which point_roughness, m, one or (n, m), moves points.
    material, materials, roughness   one, or one per cell (n - 1, m - 1)
    """
    cells = (points.shape[0] - 1, points.shape[1] - 1)
    index, factor, table = resolve(material, materials, cells)
    roughness = spread("roughness", roughness, cells)
    deviation = spread("point_roughness", point_roughness, points.shape[:2])
    if (deviation < 0).any():
        raise ValueError(f"point_roughness reaches {deviation.min():g} m; a standard deviation cannot be negative")
    triangles = geometry.of_grid(points)
    up = np.broadcast_to(up, points.shape)
    has_data = np.isfinite(triangles).all(axis=(1, 2))
    if not has_data.any():
        raise ValueError("no cell has heights at all its corners; nothing would reflect")
    if not has_data.all():
        log.info("left out %d of %d facets: no data", len(has_data) - has_data.sum(), len(has_data))
        triangles = triangles[has_data]
    displacements = geometry.of_grid(deviation[..., None] * up)[has_data] if deviation.any() else None
    row, column = np.divmod(np.argmax(has_data) // 2, cells[1])
    a, b, c = triangles[0]
    if np.cross(b - a, c - a) @ up[row, column] < 0:  # rows run from north to south: reverse the winding
        triangles = triangles[:, ::-1]
        displacements = None if displacements is None else displacements[:, ::-1]
    index, factor, roughness = (np.repeat(v.reshape(-1), 2)[has_data] for v in (index, factor, roughness))
    return {
        "triangles": triangles,
        "material": index,
        "materials": table,
        "reflectivity": factor,
        "roughness": roughness,
        "point_roughness": displacements,
        "two_sided": False,
    }


def spread(name: str, value: object, shape: tuple[int, ...], dtype: DTypeLike = np.float64) -> np.ndarray:
    """`value` for every facet, cell or point: one number for all, or an array of `shape`; read-only."""
    if dtype == np.bool_:
        value = validation.flags(name, value)
    if validation.ndim(name, value) == 0:
        return np.broadcast_to(validation.array(name, value, dtype, ()), shape)
    return validation.array(name, value, dtype, shape)


def above(grid: Heights, points: np.ndarray) -> np.ndarray:
    """Heights of points, m (n, 3), above the terrain, m (n,); inf outside its grid."""
    x, y, z = grid
    px, py, pz = points.T
    inside = (px >= x[0]) & (px <= x[-1]) & (py >= y[0]) & (py <= y[-1])
    i = np.clip(np.searchsorted(x, px, side="right") - 1, 0, len(x) - 2)
    j = np.clip(np.searchsorted(y, py, side="right") - 1, 0, len(y) - 2)
    u, v = (px - x[i]) / (x[i + 1] - x[i]), (py - y[j]) / (y[j + 1] - y[j])
    # the cell's two triangles, as Scene.from_heights cuts it
    a, d = z[j, i], z[j + 1, i + 1]
    ground = np.where(u >= v, a + u * (z[j, i + 1] - a) + v * (d - z[j, i + 1]), a + v * (z[j + 1, i] - a))
    ground = np.where(u >= v, ground, ground + u * (d - z[j + 1, i]))
    return np.where(inside, pz - ground, np.inf)


def check_above(name: str, grid: Heights, ends: np.ndarray) -> None:
    """Raise ValueError for an antenna below the terrain, at positions `ends`, m (n, 3)."""
    high = above(grid, ends)
    if high.min() < 0:
        pulse = int(high.argmin())
        raise ValueError(
            f"{name}[{pulse}] stands {-high[pulse]:.3g} m under the terrain; raise the track, or check that track and "
            "heights refer to the same surface"
        )


def steepest(grid: Heights) -> float:
    """Largest slope of a terrain, m per m."""
    x, y, z = grid
    along, up = np.diff(z, axis=1) / np.diff(x), np.diff(z, axis=0) / np.diff(y)[:, None]
    # of the two triangles of each cell, as Scene.from_heights cuts it
    squares = along[:-1] ** 2 + up[:, 1:] ** 2, along[1:] ** 2 + up[:, :-1] ** 2
    return float(np.sqrt(max(square.max() for square in squares)))


def n_facets(grid: Heights) -> int:
    """Number of facets of a terrain: two for each cell."""
    x, y, _ = grid
    return 2 * (len(x) - 1) * (len(y) - 1)


def is_overlooked(grid: Heights, bounds: np.ndarray, ends: list[np.ndarray]) -> bool:
    """Whether lines of sight from antennas, m (n, 3) each, to a terrain and to all within bounds, m (2, 3), climb
    more steeply than the terrain anywhere."""
    x, y, z = grid
    slope = steepest(grid)
    low, high = np.minimum(bounds[0, :2], [x[0], y[0]]), np.maximum(bounds[1, :2], [x[-1], y[-1]])
    top = max(float(bounds[1, 2]), float(z.max()))
    for end in ends:
        away = np.linalg.norm(np.maximum(np.abs(end[:, :2] - low), np.abs(end[:, :2] - high)), axis=1)
        if not (end[:, 2] - top > slope * away).all():
            return False
    return True


def clear_of(grid: Heights, triangles: np.ndarray, on: np.ndarray, ends: list[np.ndarray]) -> np.ndarray:
    """True (k,) for facets, m (k, 3, 3), that a terrain hides from no antenna, m (n, 3) each.

    Lines of sight climb more steeply than the terrain anywhere, and the facets lie `on` it (k,), or so far above it
    that it cannot rise above them between their corners.
    """
    if not is_overlooked(grid, boxes.box(triangles.reshape(-1, 3)), ends):
        return np.zeros(len(triangles), bool)
    slope, is_clear = steepest(grid), np.array(on)
    others = np.flatnonzero(~is_clear)
    longest = np.maximum.reduce(geometry.edges(triangles[others]))
    heights = above(grid, triangles[others].reshape(-1, 3)).reshape(-1, 3)
    is_clear[others] = heights.min(axis=1) >= slope * longest
    return is_clear


def facets_on(grid: Heights, triangles: np.ndarray) -> np.ndarray | None:
    """True (k,) for facets, m (k, 3, 3), that lie on a terrain; None where these are not all of it."""
    x, y, z = grid
    surface = geometry.of_grid(np.stack([*np.meshgrid(x, y), z], axis=-1))
    n = len(surface) if np.array_equal(triangles[: len(surface)], surface) else 0  # as Scene.from_heights begins
    size = max(x[-1] - x[0], y[-1] - y[0], np.ptp(z))
    corners = triangles[n:].reshape(-1, 3).copy()
    # corners outside the border by rounding lie on it
    for axis, ends in enumerate((x, y)):
        near = np.clip(corners[:, axis], ends[0], ends[-1])
        corners[:, axis] = np.where(np.abs(near - corners[:, axis]) <= ON * size, near, corners[:, axis])
    is_on = np.ones(len(triangles), bool)
    is_on[n:] = (np.abs(above(grid, corners)) <= ON * size).reshape(-1, 3).all(axis=1)
    area = geometry.areas(surface).sum()
    return is_on if abs(geometry.areas(triangles[is_on]).sum() - area) <= 1e-6 * area else None


def stand_above(grid: Heights, corners: np.ndarray) -> np.ndarray:
    """True (k,) for sets of corners, m (k, n, 3), over a terrain that nowhere reaches higher below their boxes than the
    lowest corner."""
    x, y, z = grid
    low, high = corners.min(axis=1), corners.max(axis=1)
    is_above = (low[:, 0] >= x[0]) & (high[:, 0] <= x[-1]) & (low[:, 1] >= y[0]) & (high[:, 1] <= y[-1])
    ends = [
        (np.searchsorted(axis, low[:, i], side="right") - 1, np.searchsorted(axis, high[:, i]) + 1)
        for i, axis in enumerate((x, y))
    ]
    for k in np.flatnonzero(is_above).tolist():
        (left, right), (bottom, top) = ((first[k], stop[k]) for first, stop in ends)
        is_above[k] = z[bottom:top, left:right].max() <= low[k, 2]
    return is_above


def raised(grid: Heights, before: np.ndarray, after: np.ndarray) -> Heights | None:
    """The terrain after its corners, m (k, 3, 3), have moved up or down; None where they moved sideways too."""
    x, y, z = grid
    before, after = before.reshape(-1, 3), after.reshape(-1, 3)
    column, row = (np.clip(np.searchsorted(a, v), 0, len(a) - 1) for a, v in zip((x, y), before.T[:2], strict=True))
    is_grid_point = (x[column] == before[:, 0]) & (y[row] == before[:, 1]) & (z[row, column] == before[:, 2])
    if (before[is_grid_point, :2] != after[is_grid_point, :2]).any():
        return None
    heights = z.copy()
    heights[row[is_grid_point], column[is_grid_point]] = after[is_grid_point, 2]
    return x, y, validation.sealed(heights)
