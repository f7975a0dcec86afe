"""Triangles of solids: surfaces of revolution, prisms, geodesic spheres. Functions of plain numbers.

All are closed, and counter-clockwise seen from outside.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..base import validation
from . import triangles as geometry

SECTIONS = 72  # default number of facets around an axis
MOST_FACETS = 50_000_000  # largest number of facets of a shape


def revolved(profile: Sequence[tuple[float, float]], edge: float | None, sections: int | None) -> np.ndarray:
    """The surface of revolution about the z axis of a line of (radius, z), m, from bottom to top: (k, 3, 3), m.

    edge  m, of facets, None: any;  sections  number of facets around the axis, None: SECTIONS, or as `edge` requires
    """
    n = SECTIONS if sections is None else validation.count("sections", sections, 3)
    line = np.array(profile, np.float64)
    if edge is not None:
        # rings and sections so dense that the diagonal of a cell is at most `edge`
        side = min(validation.number("edge", edge, above=0), geometry.FARTHEST) / np.sqrt(2)
        if float(np.abs(line).max()) > MOST_FACETS * side:
            raise MemoryError(f"edge {edge:g} m needs more than {MOST_FACETS:,} facets; take a larger one")
        if sections is None:
            n = max(n, int(np.ceil(2 * np.pi * line[:, 0].max() / side)))
        steps = np.ceil(np.linalg.norm(np.diff(line, axis=0), axis=1) / side).astype(int)
        if 2 * n * steps.sum() > MOST_FACETS:
            raise MemoryError(f"edge {edge:g} m needs {2 * n * steps.sum():,} facets; take a larger one")
        between = np.concatenate([[0.0], *(i + np.arange(1, m + 1) / m for i, m in enumerate(steps))])
        line = np.stack([np.interp(between, np.arange(len(line)), v) for v in line.T], axis=-1)
    if 2 * n * (len(line) - 1) > MOST_FACETS:
        raise MemoryError(f"sections is {n:.3g}, more than {MOST_FACETS:,} facets; take fewer")
    angle = 2 * np.pi * np.arange(n) / n
    circle = np.stack([np.cos(angle), np.sin(angle)], axis=-1)[np.arange(n + 1) % n]  # ends exactly where it begins
    rings = np.concatenate([line[:, None, :1] * circle, np.broadcast_to(line[:, None, 1:], (len(line), n + 1, 1))], -1)
    triangles = geometry.of_grid(rings)
    return triangles[geometry.solid(triangles)]


def prism(outline: Sequence[tuple[float, float]], low: float, high: float) -> np.ndarray:
    """A convex polygon of (x, z), m, from y = low to high: (k, 3, 3), m. Its corners turn from x to z."""
    corners = np.array(outline, np.float64)
    n = len(corners)
    near, far = (np.column_stack([corners[:, 0], np.full(n, y), corners[:, 1]]) for y in (low, high))
    after = np.roll(np.arange(n), -1)
    fan = np.stack([np.zeros(n - 2, int), np.arange(1, n - 1), np.arange(2, n)], axis=1)
    sides = [np.stack([near, far[after], near[after]], axis=1), np.stack([near, far, far[after]], axis=1)]
    return np.concatenate([near[fan], far[fan[:, ::-1]], *sides])


def geodesic(n: int) -> np.ndarray:
    """Triangles (20 n^2, 3, 3) of the unit sphere about the origin."""
    if 20 * n * n > MOST_FACETS:
        raise MemoryError(f"a sphere of {20 * n * n:,} facets is too fine; take a larger edge or fewer facets")
    # corners of the icosahedron are p + q g, g the golden section: sums of integers are equal to the last bit on both
    # sides of an edge, so that facets stay joined
    p = np.array([(-1, 0, 0), (1, 0, 0), (-1, 0, 0), (1, 0, 0), (0, -1, 0), (0, 1, 0), (0, -1, 0), (0, 1, 0),
                  (0, 0, -1), (0, 0, 1), (0, 0, -1), (0, 0, 1)])  # fmt: skip
    q = np.array([(0, 1, 0), (0, 1, 0), (0, -1, 0), (0, -1, 0), (0, 0, 1), (0, 0, 1), (0, 0, -1), (0, 0, -1),
                  (1, 0, 0), (1, 0, 0), (-1, 0, 0), (-1, 0, 0)])  # fmt: skip
    faces = np.array([(0, 11, 5), (0, 5, 1), (0, 1, 7), (0, 7, 10), (0, 10, 11), (1, 5, 9), (5, 11, 4), (11, 10, 2),
                      (10, 7, 6), (7, 1, 8), (3, 9, 4), (3, 4, 2), (3, 2, 6), (3, 6, 8), (3, 8, 9), (4, 9, 5),
                      (2, 4, 11), (6, 2, 10), (8, 6, 7), (9, 8, 1)])  # fmt: skip
    i, j = (a.ravel() for a in np.meshgrid(np.arange(n), np.arange(n), indexing="ij"))

    def steps(rows: np.ndarray, corners: tuple[tuple[int, int], ...]) -> np.ndarray:
        return np.stack([np.stack([i + a, j + b], axis=-1)[rows] for a, b in corners], axis=1)

    both = [steps(i + j < n, ((0, 0), (1, 0), (0, 1))), steps(i + j < n - 1, ((1, 0), (1, 1), (0, 1)))]
    s, t = np.moveaxis(np.concatenate(both), -1, 0)[..., None]
    corners = [((n - s - t) * m[a] + s * m[b] + t * m[c]) for m in (p, q) for a, b, c in faces]
    out = np.concatenate(corners[:20]) + np.concatenate(corners[20:]) * ((1 + np.sqrt(5)) / 2)
    return out / np.sqrt(out[..., :1] ** 2 + out[..., 1:2] ** 2 + out[..., 2:] ** 2)
