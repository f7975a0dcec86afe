"""Geometry of triangles: lengths, areas, normals, cutting; and rotations. Functions of plain arrays."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..base import validation
from ..base.vectors import dot

MOST_TURN = 1e12  # rad, of a rotation: float64 resolves 1e-4 rad there
BLOCK = 2**15  # triangles that are cut together
FARTHEST = 1e70  # m, of corners: the square of an area stays finite


def edges(triangles: np.ndarray) -> np.ndarray:
    """Lengths of the edges of triangles (k, 3, 3), corner i to i + 1: (3, k)."""
    d = (triangles[:, (i + 1) % 3] - triangles[:, i] for i in range(3))
    return np.stack([np.sqrt(dot(e, e)) for e in d])


def areas(triangles: np.ndarray) -> np.ndarray:
    """Area of each triangle (k, 3, 3), m^2 (k,)."""
    n = _cross(triangles)
    return np.sqrt(dot(n, n)) / 2


def centroids(triangles: np.ndarray) -> np.ndarray:
    """Centroid of each triangle (k, 3, 3), m (k, 3)."""
    return (triangles[:, 0] + triangles[:, 1] + triangles[:, 2]) / 3


def normals(triangles: np.ndarray) -> np.ndarray:
    """Outward unit normal of each triangle (k, 3, 3): (k, 3)."""
    n = _cross(triangles)
    return n / np.sqrt(dot(n, n))[:, None]


def solid(triangles: np.ndarray) -> np.ndarray:
    """True (k,) for triangles with an area that float64 resolves: at least 1e-12 of their length wide."""
    longest = np.maximum.reduce(edges(triangles))
    return 2 * areas(triangles) > 1e-12 * longest**2


def of_grid(points: np.ndarray) -> np.ndarray:
    """Two triangles for each cell of a grid of points (n, m, ...): (2 (n - 1) (m - 1), 3, ...).

    Counter-clockwise where the second index grows to the right and the first upwards.
    """
    sw, se, nw, ne = points[:-1, :-1], points[:-1, 1:], points[1:, :-1], points[1:, 1:]
    both = np.stack([np.stack([sw, se, ne], axis=2), np.stack([sw, ne, nw], axis=2)], axis=2)
    return both.reshape(-1, 3, *points.shape[2:])


def cut(triangles: np.ndarray, max_edge: float, max_facets: int) -> tuple[np.ndarray, np.ndarray]:
    """Triangles (k, 3, 3) bisected at their longest edge until none is longer than max_edge, m.

    Returns them (n, 3, 3), and which of the given triangles each is a part of (n,). MemoryError where n would exceed
    max_facets.
    """
    too_many = (
        f"facets no longer than {max_edge:g} m would number more than {max_facets:,}; "
        "take a smaller scene, a larger max_edge or a coarser resolution"
    )
    # no facet is larger than the equilateral one: most hopeless cuts end here, before they fill the memory
    if np.sqrt(areas(triangles).sum() / (max_facets * np.sqrt(3) / 4)) > max_edge:
        raise MemoryError(too_many)
    parts, rows, n = [triangles[:0]], [np.zeros(0, np.int64)], 0
    for first in range(0, len(triangles), BLOCK):  # so few at a time stay in the processor's cache
        block = triangles[first : first + BLOCK]
        row = np.arange(first, first + len(block))
        while len(block):
            lengths = edges(block)
            long = np.maximum.reduce(lengths) > max_edge
            parts.append(block[~long])
            rows.append(row[~long])
            n += len(parts[-1])
            if n + 2 * long.sum() > max_facets:
                raise MemoryError(too_many)
            block = np.concatenate(bisect(block[long], lengths[:, long]))
            row = np.tile(row[long], 2)
    return np.concatenate(parts), np.concatenate(rows)


def bisect(triangles: np.ndarray, lengths: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Both halves of every triangle, cut at the middle of its longest edge.

    The cut of an edge depends on its ends alone, so triangles that share it stay joined.
    """
    start = lengths.argmax(axis=0)
    first = 3 * np.arange(len(start))
    corners = triangles.reshape(-1, 3)
    a, b, c = (corners[first + (start + i) % 3] for i in range(3))
    one, two = np.empty_like(triangles), np.empty_like(triangles)
    middle = (a + b) / 2
    for half, places in ((one, (a, middle, c)), (two, (middle, b, c))):
        for i, place in enumerate(places):
            half[:, i] = place
    return one, two


def distances(triangles: np.ndarray, point: np.ndarray) -> np.ndarray:
    """Distance of each triangle (k, 3, 3) from a point (3,), m (k,)."""
    ahead, normal = triangles - point, _cross(triangles)
    squared = dot(normal, normal)
    nearest = np.full(len(triangles), np.inf)
    inside = np.ones(len(triangles), bool)
    for i in range(3):
        a, b = ahead[:, i], ahead[:, (i + 1) % 3]
        along = b - a
        part = np.clip(-dot(a, along) / np.maximum(dot(along, along), 1e-300), 0, 1)[:, None]
        foot = a + part * along
        nearest = np.minimum(nearest, dot(foot, foot))
        inside &= dot(np.cross(a, b), normal) >= 0  # the foot of the perpendicular is on the inner side of this edge
    height = dot(ahead[:, 0], normal) ** 2 / np.maximum(squared, 1e-300)
    return np.sqrt(np.where(inside & (squared > 0), height, nearest))


def highest(triangles: np.ndarray, x: float, y: float) -> float | None:
    """Largest z of triangles (k, 3, 3) at (x, y); None where there is no triangle."""
    if len(triangles) == 0:
        return None
    px, py = (triangles[:, :, i] - v for i, v in enumerate((x, y)))
    inside = (px.min(axis=1) <= 0) & (px.max(axis=1) >= 0) & (py.min(axis=1) <= 0) & (py.max(axis=1) >= 0)
    px, py, pz = px[inside], py[inside], triangles[inside, :, 2]
    # area of the triangle that (x, y) makes with the edge opposite each corner
    opposite = np.roll(px, -1, 1) * np.roll(py, -2, 1) - np.roll(px, -2, 1) * np.roll(py, -1, 1)
    total = opposite.sum(axis=1)
    reach = 1e-12 * np.abs(opposite).max(axis=1, initial=0)  # on an edge, rounding must not leave a gap
    same = (opposite >= -reach[:, None]).all(axis=1) | (opposite <= reach[:, None]).all(axis=1)
    good = same & (np.abs(total) > reach)
    if not good.any():
        return None
    return float(((opposite[good] * pz[good]).sum(axis=1) / total[good]).max())


def check_reach(name: str, corners: np.ndarray) -> None:
    """ValueError for coordinates, m, at which products of areas overflow: their facets would be left out."""
    if not max(corners.max(initial=0), -corners.min(initial=0)) <= FARTHEST:
        raise ValueError(f"{name}: lengths up to {np.abs(corners).max():g} m, whose areas overflow; give metres")


def rotation(given: Any) -> np.ndarray:
    """Matrix (3, 3) of a rotation, given as a matrix, a rotation vector in rad, an angle about z, or None."""
    if given is None:
        return np.eye(3)
    if hasattr(given, "as_matrix"):
        given = given.as_matrix()
    if validation.ndim("rotation", given) == 0:
        given = (0.0, 0.0, validation.number("rotation", given))
    if np.ndim(given) == 1:
        angles = validation.array("rotation", given, np.float64, (3,)).copy()
        if np.abs(angles).max() > MOST_TURN:
            raise ValueError(
                f"rotation reaches {np.abs(angles).max():g} rad, which float64 does not resolve; give less"
            )
        from scipy.spatial.transform import Rotation

        return Rotation.from_rotvec(angles).as_matrix()
    matrix = validation.array("rotation", given, np.float64, (3, 3))
    # float32 matrices are orthonormal to 1e-7 only
    if not np.allclose(matrix @ matrix.T, np.eye(3), rtol=0, atol=1e-6) or np.linalg.det(matrix) < 0:
        raise ValueError("rotation is a matrix that does not rotate: its rows must be orthonormal, its determinant +1")
    left, _, right = np.linalg.svd(matrix)
    return left @ right


def _cross(t: np.ndarray) -> np.ndarray:
    return np.cross(t[:, 1] - t[:, 0], t[:, 2] - t[:, 0])
