"""Geometry of triangles: lengths, areas, normals, cutting; and rotations. Functions of plain arrays."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from ..base import validation
from ..base.vectors import cross, dot

MOST_TURN = 1e12  # rad, of a rotation: float64 resolves 1e-4 rad there
BLOCK = 2**13  # triangles that are looked at together: so few stay in the processor's cache
FARTHEST = 1e70  # m, of corners: the square of an area stays finite


def edges(triangles: np.ndarray) -> np.ndarray:
    """Lengths of the edges of triangles (k, 3, 3), corner i to i + 1: (3, k)."""
    out = np.empty((3, len(triangles)))
    for block, (a, b, c) in _blocks(triangles):
        for i, (start, end) in enumerate(((a, b), (b, c), (c, a))):
            out[i, block] = _length(end - start)
    return out


def areas(triangles: np.ndarray) -> np.ndarray:
    """Area of each triangle (k, 3, 3), m^2 (k,)."""
    out = np.empty(len(triangles))
    for block, corners in _blocks(triangles):
        out[block] = _length(_cross(*corners))
    return out / 2


def centroids(triangles: np.ndarray) -> np.ndarray:
    """Centroid of each triangle (k, 3, 3), m (k, 3)."""
    return (triangles[:, 0] + triangles[:, 1] + triangles[:, 2]) / 3


def normals(triangles: np.ndarray) -> np.ndarray:
    """Outward unit normal of each triangle (k, 3, 3): (k, 3)."""
    out = np.empty((len(triangles), 3))
    for block, corners in _blocks(triangles):
        n = _cross(*corners)
        out[block] = (n / _length(n)).T
    return out


def cosines_to(triangles: np.ndarray, place: np.ndarray) -> np.ndarray:
    """Cosine of the angle between the outward normal of each triangle (k, 3, 3) and the direction from its centroid to
    a place (3,): (k,); 0 of triangles without an area."""
    out = np.empty(len(triangles))
    for block, (a, b, c) in _blocks(triangles):
        n, ahead = _cross(a, b, c), place[:, None] - (a + b + c) / 3
        out[block] = (n * ahead).sum(axis=0) / np.maximum(_length(n) * _length(ahead), 1e-300)
    return out


def solid(triangles: np.ndarray) -> np.ndarray:
    """True (k,) for triangles with an area that float64 resolves: at least 1e-12 of their length wide."""
    longest = np.maximum.reduce(edges(triangles))
    return 2 * areas(triangles) > 1e-12 * longest**2


def of_grid(points: np.ndarray) -> np.ndarray:
    """Two triangles for each cell of a grid of points (n, m, ...): (2 (n - 1) (m - 1), 3, ...).

    Counter-clockwise where the second index grows to the right and the first upwards.
    """
    sw, se, nw, ne = points[:-1, :-1], points[:-1, 1:], points[1:, :-1], points[1:, 1:]
    out = np.empty((*sw.shape[:2], 2, 3, *points.shape[2:]), points.dtype)
    for number, corners in enumerate(((sw, se, ne), (sw, ne, nw))):
        for corner, places in enumerate(corners):
            out[:, :, number, corner] = places
    return out.reshape(-1, 3, *points.shape[2:])


def cut(triangles: np.ndarray, max_edge: float, max_facets: int) -> tuple[np.ndarray, np.ndarray]:
    """Triangles (k, 3, 3) bisected at their longest edge until none is longer than max_edge, m.

    Returns them (n, 3, 3), and which of the given triangles each is a part of (n,). MemoryError where n would exceed
    max_facets.
    """
    parts, _, rows = cut_lengths(triangles, max_edge, max_facets)
    return parts, rows


def cut_lengths(triangles: np.ndarray, max_edge: float, max_facets: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """As `cut`, with the lengths of the parts' edges, m (n, 3), by which further cuts choose the longest.

    Halves of an edge have half its length to the last bit, which lengths between corners may not have: of edges alike,
    rounding would decide.
    """
    refuse_many(triangles, max_edge, max_facets)
    parts, sizes, rows, n = [triangles[:0]], [np.zeros((0, 3))], [np.zeros(0, np.int64)], 0
    for block, corners in _blocks(triangles):
        row, lengths = np.arange(block.start, block.stop), edges(triangles[block])
        while len(row):
            is_long = np.maximum.reduce(lengths) > max_edge
            long, short = np.flatnonzero(is_long), np.flatnonzero(~is_long)
            parts.append(np.ascontiguousarray(corners.take(short, axis=2).transpose(2, 0, 1)))
            sizes.append(lengths.take(short, axis=1).T)
            rows.append(row[short])
            n += len(short)
            if n + 2 * len(long) > max_facets:
                raise too_many(triangles, max_edge, max_facets)
            corners, lengths = _halves(corners.take(long, axis=2), lengths.take(long, axis=1))
            row = np.tile(row[long], 2)
    return np.concatenate(parts), np.concatenate(sizes), np.concatenate(rows)


def too_many(triangles: np.ndarray, max_edge: float, max_facets: int) -> MemoryError:
    """The error of a cut of triangles (k, 3, 3) that would make too many facets."""
    return MemoryError(
        f"facets no longer than {max_edge:g} m would number more than {max_facets:,}; take a smaller scene "
        f"(this one is {longest_side(triangles):.4g} m long), a larger max_edge or a coarser resolution"
    )


def longest_side(triangles: np.ndarray) -> float:
    """Longest side of the box about triangles (k, 3, 3), m, by which refusals show a mesh in another unit."""
    return float(np.ptp(triangles.reshape(-1, 3), axis=0).max(initial=0.0))


def refuse_many(triangles: np.ndarray, max_edge: float, max_facets: int) -> None:
    """MemoryError for most hopeless cuts, before they fill the memory: no facet is larger than the equilateral one."""
    if np.sqrt(areas(triangles).sum() / (max_facets * np.sqrt(3) / 4)) > max_edge:
        raise too_many(triangles, max_edge, max_facets)


def bisect(triangles: np.ndarray, lengths: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Both halves of every triangle (k, 3, 3), cut at the middle of its longest edge; lengths  (3, k) of the edges.

    The cut of an edge depends on its ends alone, so triangles that share it stay joined.
    """
    halves = _halves(triangles.transpose(1, 2, 0), lengths)[0].transpose(2, 0, 1)
    return halves[: len(triangles)], halves[len(triangles) :]


def _halves(corners: np.ndarray, lengths: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """One half of every triangle, then the other: corners, m (3, 3, 2 n), of (3, 3, n), and lengths (3, 2 n)."""
    start = lengths.argmax(axis=0)
    (a, b, c), (longest, b_to_c, c_to_a) = _from(start, corners), _from(start, lengths)
    middle, half = (a + b) / 2, longest / 2
    cut_to_c = _length(c - middle)
    one, two = np.stack([a, middle, c]), np.stack([middle, b, c])
    return (
        np.concatenate([one, two], axis=-1),
        np.concatenate([np.stack([half, cut_to_c, c_to_a]), np.stack([half, b_to_c, cut_to_c])], axis=-1),
    )


def _from(start: np.ndarray, of: np.ndarray) -> tuple[np.ndarray, ...]:
    """The three corners (3, 3, n), or edges (3, n), of triangles from number `start` of each on (n,)."""
    first, second = start == 0, start == 1
    return tuple(np.where(first, of[i], np.where(second, of[(i + 1) % 3], of[(i + 2) % 3])) for i in range(3))


def shortest_edges(triangles: np.ndarray) -> np.ndarray:
    """Both shorter edges of triangles (k, 3, 3), m (2, 3, k), from the corner opposite the longest, anticlockwise."""
    out = np.empty((2, 3, len(triangles)))
    for block, corners in _blocks(triangles):
        a, b, c = _from(edges(triangles[block]).argmax(axis=0), corners)
        out[:, :, block] = a - c, b - c
    return out


def distances(triangles: np.ndarray, point: np.ndarray) -> np.ndarray:
    """Distance of each triangle (k, 3, 3) from a point (3,), m (k,)."""
    ahead, normal = triangles - point, cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    squared = dot(normal, normal)
    nearest = np.full(len(triangles), np.inf)
    inside = np.ones(len(triangles), bool)
    for i in range(3):
        a, b = ahead[:, i], ahead[:, (i + 1) % 3]
        along = b - a
        part = np.clip(-dot(a, along) / np.maximum(dot(along, along), 1e-300), 0, 1)[:, None]
        foot = a + part * along
        nearest = np.minimum(nearest, dot(foot, foot))
        inside &= dot(cross(a, b), normal) >= 0  # the foot of the perpendicular is on the inner side of this edge
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


def _blocks(triangles: np.ndarray) -> Iterator[tuple[slice, np.ndarray]]:
    """Triangles (k, 3, 3) in parts that stay in the processor's cache: which, and their corners by coordinates
    (3, 3, n)."""
    for first in range(0, len(triangles), BLOCK):
        block = slice(first, min(first + BLOCK, len(triangles)))
        yield block, np.ascontiguousarray(triangles[block].transpose(1, 2, 0))


def _cross(a: np.ndarray, b: np.ndarray, c: np.ndarray) -> np.ndarray:
    """Normals, twice as long as the area, of triangles with these corners, all (3, n)."""
    (x, y, z), (u, v, w) = b - a, c - a
    return np.stack([y * w - z * v, z * u - x * w, x * v - y * u])


def _length(vectors: np.ndarray) -> np.ndarray:
    """Lengths (n,) of vectors (3, n)."""
    x, y, z = vectors
    return np.asarray(np.sqrt(x * x + y * y + z * z))
