"""Pulses that may share one shadow: blocks as fine as the change of aspect demands."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

from ..base.boxes import box
from ..scene.triangles import areas, edges, normals

STRIDE = 16  # blocks that may go without a look from the first
UNEVEN = 0.25  # of a facet: more is no even change, and more than counting samples errs
LEFT = 4e-4  # of the lit shares' squares: two hundredths of their norm


def lever(bounds: np.ndarray, antennas: np.ndarray) -> float:
    """Longest way, m, from a facet along any line of sight to what shadows it, inside a scene's box (2, 3).

    Its height over the sine of the lowest elevation under which any of the antennas, m (n, 3), is seen from anywhere in
    it, and never more than its diagonal.
    """
    size = bounds[1] - bounds[0]
    diagonal = float(np.linalg.norm(size))
    furthest = np.linalg.norm(np.maximum(np.abs(antennas - bounds[0]), np.abs(antennas - bounds[1])), axis=1)
    sine = float(((antennas[:, 2] - bounds[1, 2]) / furthest).min())
    return min(diagonal, float(size[2]) / sine) if sine > 0 else diagonal


def reach(triangles: np.ndarray, viewpoint: np.ndarray) -> float:
    """Area seen over longest edge, m, of the middle facet of triangles (k, 3, 3) that are not seen edge-on.

    A shadow's edge that moves by m across the line of sight changes a facet's lit share by at most m over this.
    """
    ahead = viewpoint - triangles[:, 0]
    ahead /= np.maximum(np.linalg.norm(ahead, axis=1, keepdims=True), 1e-300)
    facing = np.abs(np.einsum("ij,ij->i", normals(triangles), ahead))
    ratio = areas(triangles) * facing / np.maximum.reduce(edges(triangles))
    usual = ratio[facing > 0.1]
    return float(np.median(usual if len(usual) else ratio))


def pulse_blocks(
    ends: list[np.ndarray], bounds: np.ndarray, limits: list[float]
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Blocks of pulses, first and last + 1 (n, 2), one pulse of each (n,) to look from, and how far it is off (n,).

    From everywhere in the box `bounds`, m (2, 3), the direction of each antenna, m (n_pulses, 3), of `ends` differs by
    no more than its limit, rad, between that pulse and any other of its block; (n,) bounds by how much it does.
    """
    distance = [np.linalg.norm(e - np.clip(e, *bounds), axis=1) for e in ends]

    def turn(which: int, pulses: np.ndarray, start: int) -> np.ndarray:
        # |a/|a| - b/|b|| <= 2 |a - b|/(|a| + |b|): Dunkl and Williams 1964
        move = 2 * np.linalg.norm(ends[which][pulses] - ends[which][start], axis=1)
        away = distance[which][pulses] + distance[which][start]
        return np.minimum(np.divide(move, away, out=np.where(move > 0, 2.0, 0.0), where=away > 0), 2.0)

    def run(start: int, step: int, stop: int) -> int:
        """How far from pulse `start` on the direction stays within the limits: the last pulse."""
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
    blocks, looks, turns = [], [], []
    while first < n:
        look = run(first, 1, n - 1)
        # tracks that turn back: all from the first on must be near the one looked from
        while run(look, -1, first) != first:
            look = first + (look - first) // 2
        last = run(look, 1, n - 1)
        blocks.append((first, last + 1))
        looks.append(look)
        turns.append(max(turn(i, np.arange(first, last + 1), look).max() for i in range(len(ends))))
        first = last + 1
    return np.array(blocks, np.int64), np.array(looks, np.int64), np.array(turns)


def enough_looks(look: Callable[[int], np.ndarray], at: np.ndarray) -> Iterator[tuple[int, np.ndarray]]:
    """Rising places in `at`, pulses (n,) that may be looked from, and shares, uint8 (k,), that look(place) finds there.

    Every 16th and the last, and what lies between as far as shares do not change evenly from one to the next: halfway,
    those more than a quarter off must hold less than 0.04 % of the squares of all.
    """

    def between(a: int, first: np.ndarray, b: int, last: np.ndarray) -> Iterator[tuple[int, np.ndarray]]:
        if b - a < 2:
            return
        middle = (a + b) // 2
        found = look(middle)
        part = np.float32((at[middle] - at[a]) / (at[b] - at[a]))
        off = np.abs(found - (first + part * (last - first.astype(np.float32))))
        wrong = off[off > UNEVEN * 255]
        enough = float(wrong @ wrong) <= LEFT * float(np.square(found, dtype=np.float32).sum())
        if not enough:
            yield from between(a, first, middle, found)
        yield middle, found
        if not enough:
            yield from between(middle, found, b, last)

    held, share = 0, look(0)
    yield held, share
    for place in np.unique(np.append(np.arange(STRIDE, len(at), STRIDE), len(at) - 1)).tolist()[len(at) == 1 :]:
        end = look(place)
        yield from between(held, share, place, end)
        yield place, end
        held, share = place, end


def blocks_around(looks: np.ndarray, n_pulses: int) -> np.ndarray:
    """First and last + 1, int64 (n, 2), of the pulses nearest each of rising looks (n,)."""
    ends = np.concatenate([[0], (looks[:-1] + looks[1:]) // 2 + 1, [n_pulses]])
    return np.stack([ends[:-1], ends[1:]], axis=1)


def scene_box(triangles: np.ndarray, heights: tuple[np.ndarray, np.ndarray, np.ndarray] | None) -> np.ndarray:
    """Lower and upper corner of facets and terrain, m (2, 3)."""
    corners = box(triangles.reshape(-1, 3))
    if heights is None:
        return corners
    ends = np.array([[v.min() for v in heights], [v.max() for v in heights]])
    return np.stack([np.minimum(corners[0], ends[0]), np.maximum(corners[1], ends[1])])
