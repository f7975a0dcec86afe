"""Surfaces over grids of points, as facets."""

from __future__ import annotations

import logging
from typing import Any

import numpy as np

from . import check
from . import triangles as geometry
from .material import resolve

log = logging.getLogger(__name__)


def grid(x: Any, y: Any, z: Any) -> np.ndarray:
    """Points, m (n_y, n_x, 3), of heights z (n_y, n_x), or a function z(x, y), over increasing x (n_x,), y (n_y,)."""
    x = check.array("x", x, np.float64, ("n_x",))
    y = check.array("y", y, np.float64, ("n_y",))
    over = np.meshgrid(x, y)
    if callable(z):
        z = z(*over)
        z = np.full(over[0].shape, z) if np.ndim(z) == 0 else z
    z = check.array("z", z, np.float64, (len(y), len(x)))
    for name, axis in (("x", x), ("y", y)):
        if len(axis) < 2 or not (np.diff(axis) > 0).all():
            raise ValueError(
                f"{name} must hold at least two increasing values: a cell needs an extent; turn a falling axis "
                "round together with z"
            )
    return np.stack([*over, z], axis=-1)


def surface(
    points: np.ndarray, up: np.ndarray, material: Any, materials: Any, roughness: Any, point_roughness: Any
) -> dict[str, Any]:
    """Arguments of Scene.facets for a grid of points, m (n, m, 3): two facets a cell, none where a point is NaN.

    They face `up`, unit vectors (3,) or (n, m, 3), along which point_roughness, m, one or (n, m), moves points.
    material, materials, roughness   one, or one a cell (n - 1, m - 1)
    """
    cells = (points.shape[0] - 1, points.shape[1] - 1)
    index, factor, table = resolve(material, materials, cells)
    roughness = spread("roughness", roughness, cells)
    deviation = spread("point_roughness", point_roughness, points.shape[:2])
    if (deviation < 0).any():
        raise ValueError(f"point_roughness reaches {deviation.min():g} m; a standard deviation cannot be negative")
    triangles = geometry.of_grid(points)
    up = np.broadcast_to(up, points.shape)
    good = np.isfinite(triangles).all(axis=(1, 2))
    if not good.any():
        raise ValueError("no cell has heights at all its corners; nothing would reflect")
    if not good.all():
        log.info("left out %d of %d facets: no data", len(good) - good.sum(), len(good))
    moves = geometry.of_grid(deviation[..., None] * up)[good] if deviation.any() else None
    triangles = triangles[good]
    row, column = np.divmod(np.argmax(good) // 2, cells[1])
    a, b, c = triangles[0]
    if np.cross(b - a, c - a) @ up[row, column] < 0:  # rows run down the map: turn facets round
        triangles = triangles[:, ::-1]
        moves = None if moves is None else moves[:, ::-1]
    index, factor, roughness = (np.repeat(v.reshape(-1), 2)[good] for v in (index, factor, roughness))
    return {
        "triangles": triangles,
        "material": index,
        "materials": table,
        "reflectivity": factor,
        "roughness": roughness,
        "point_roughness": moves,
        "two_sided": False,
    }


def spread(name: str, value: Any, shape: tuple[int, ...], dtype: Any = np.float64) -> np.ndarray:
    """`value` for every facet, cell or point: one number for all, or an array of `shape`; read-only."""
    if np.ndim(value) == 0:
        return np.broadcast_to(check.array(name, value, dtype, ()), shape)
    return check.array(name, value, dtype, shape)
