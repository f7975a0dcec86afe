"""Blocks of pulses that share one illumination: as short as the change of aspect angle requires."""

from __future__ import annotations

import numpy as np

from ..base.vectors import dot
from ..scene.triangles import areas, edges, normals

DRAWN = 100_000  # facets whose widths are computed: their median is within a percent of that of all
STRIDE = 128  # blocks from one viewpoint to the next, before refinement


def shadow_length(bounds: np.ndarray, antennas: np.ndarray) -> float:
    """Largest distance, m, from a facet along a line of sight to what occludes it, inside a scene's box (2, 3).

    The height of the box over the sine of the lowest elevation at which any antenna, m (n, 3), is seen from a point in
    the box; at most its diagonal.
    """
    size = bounds[1] - bounds[0]
    diagonal = float(np.linalg.norm(size))
    furthest = np.linalg.norm(np.maximum(np.abs(antennas - bounds[0]), np.abs(antennas - bounds[1])), axis=1)
    sine = float(((antennas[:, 2] - bounds[1, 2]) / furthest).min())
    return min(diagonal, float(size[2]) / sine) if sine > 0 else diagonal


def projected_width(triangles: np.ndarray, viewpoint: np.ndarray) -> float:
    """Projected area over longest edge, m: the median of triangles (k, 3, 3) that are not seen edge-on.

    A shadow edge that moves by d m across the line of sight changes a facet's share by at most d over this.
    """
    if len(triangles) > DRAWN:
        triangles = triangles[np.random.default_rng(0).integers(0, len(triangles), DRAWN)]
    ahead = viewpoint - triangles[:, 0]
    ahead /= np.maximum(np.linalg.norm(ahead, axis=1, keepdims=True), 1e-300)
    facing = np.abs(dot(normals(triangles), ahead))
    ratio = areas(triangles) * facing / np.maximum.reduce(edges(triangles))
    usual = ratio[facing > 0.1]
    return float(np.median(usual if len(usual) else ratio))


def pulse_blocks(
    ends: list[np.ndarray], bounds: np.ndarray, limits: list[float]
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Blocks of pulses in each of which antenna directions differ by no more than a limit.

    ends    positions of each antenna, m (n_pulses, 3);  limits  rad, one for each antenna
    Returns first and last + 1 of the pulses of each block (n, 2), its viewpoint, which is one of its pulses (n,), and a
    bound (n,), rad, on how much directions differ between the viewpoint and any pulse of the block, as seen from
    anywhere in the box `bounds`, m (2, 3).
    """
    distance = [np.linalg.norm(e - np.clip(e, *bounds), axis=1) for e in ends]

    def turn(which: int, pulses: np.ndarray, start: int) -> np.ndarray:
        # |a/|a| - b/|b|| <= 2 |a - b|/(|a| + |b|): Dunkl and Williams 1964
        move = 2 * np.linalg.norm(ends[which][pulses] - ends[which][start], axis=1)
        away = distance[which][pulses] + distance[which][start]
        return np.minimum(np.divide(move, away, out=np.where(move > 0, 2.0, 0.0), where=away > 0), 2.0)

    def run(start: int, step: int, stop: int) -> int:
        """The last pulse, from `start` on, up to which directions stay within the limits of that at `start`."""
        at, width = start, 64
        while at != stop:
            to = min(at + width, stop) if step > 0 else max(at - width, stop)
            pulses = np.arange(at + step, to + step, step)
            good = np.all([turn(i, pulses, start) <= limit for i, limit in enumerate(limits)], axis=0)
            if not good.all():
                return at + step * int(np.argmin(good))
            at, width = int(pulses[-1]), 2 * width
        return at

    n, first = len(ends[0]), 0
    blocks, viewpoints, turns = [], [], []
    while first < n:
        viewpoint = run(first, 1, n - 1)
        # tracks may turn back: all pulses from the first on must be within the limits of the viewpoint
        while run(viewpoint, -1, first) != first:
            viewpoint = first + (viewpoint - first) // 2
        last = run(viewpoint, 1, n - 1)
        blocks.append((first, last + 1))
        viewpoints.append(viewpoint)
        turns.append(max(turn(i, np.arange(first, last + 1), viewpoint).max() for i in range(len(ends))))
        first = last + 1
    return np.array(blocks, np.int64), np.array(viewpoints, np.int64), np.array(turns)


def blocks_around(viewpoints: np.ndarray, n_pulses: int) -> np.ndarray:
    """First and last + 1, int64 (n, 2), of the pulses nearest each viewpoint, increasing pulses (n,)."""
    ends = np.concatenate([[0], (viewpoints[:-1] + viewpoints[1:]) // 2 + 1, [n_pulses]])
    return np.stack([ends[:-1], ends[1:]], axis=1)
