"""Rows that saw a pixel, and the sum of their weights: the gain of the image, pixel by pixel.

    gain(x) = sum_p v_p(x) w_p sum_n w_n,    v_p(x) = 1 in the range window and the beam of row p, else 0

A tile of pixels lies in a sphere. Rows whose range window and beam contain the sphere count for all of its pixels, rows
that miss it for none, and only the rows between are asked for each pixel, in float64.
reference: sarcl/reference/backproject.py: the image of a unit point at x has the value gain(x) there
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import DTypeLike

from ..base import validation
from ..base.constants import SPEED_OF_LIGHT
from ..base.rows import spread_over
from ..numerics.pulse_geometry import UNLIMITED
from .focusing_task import FocusingTask
from .tiling.of_grid import tiling_of

SIDE = 16  # pixels along a side of a tile
ROWS = 256  # rows of Image.aperture, at most
PAIRS = 2**20  # pairs of a tile and a row that are looked at together
SLACK = 1e-9  # share of the largest distance, by which distances of tiles are rounded, which are differences of squares


def may_vary(task: FocusingTask) -> bool:
    """Whether some pixel may lie outside the range window or the beam of some row."""
    if task.antennas.beam is not None or task.antenna is not None:
        return True
    if task.wrap:
        return False
    bounds, half = task.grid.bounds, SPEED_OF_LIGHT / (4 * task.raw.frequency_step)
    corners = np.stack(np.meshgrid(*bounds.T, indexing="ij"), axis=-1).reshape(-1, 3)
    ends = task.antennas.ends
    # half a path is a convex function: largest in a corner of the box; and not less than the distances of the box
    most = np.max([sum(np.linalg.norm(e - c, axis=1) for e in ends) / len(ends) for c in corners], axis=0)
    least = sum(np.linalg.norm(e - np.clip(e, *bounds), axis=1) for e in ends) / len(ends)
    reference = task.raw.reference_range
    return bool((most - reference > half * (1 - SLACK)).any() or (reference - least > half * (1 - SLACK)).any())


def room_for_gain(task: FocusingTask, dtype: DTypeLike) -> None:
    """MemoryError where the gain needs a value per pixel and there is no memory for them."""
    if may_vary(task):
        gain = f"the gain of {' x '.join(map(str, task.grid.shape))} pixels, one number per pixel"
        validation.room(gain, float(task.grid.size * _kind(dtype).itemsize), "focus parts of the grid")


Gains = Callable[[np.ndarray, np.ndarray], np.ndarray]


def seen_by(task: FocusingTask, dtype: DTypeLike, tapered: Gains | None = None) -> dict[str, Any]:
    """Fields `gain` and `aperture` of an Image.

    The gain is a number where it is the same in all pixels, else an array of the grid's shape. The aperture is None
    where every row saw every pixel. dtype is that of the pixels: the gain has float32 beside complex64, and float64
    beside complex128. tapered gives sums of weights that differ from pixel to pixel, of positions, m (n_tiles,
    per_tile, 3), and the number of rows that see each (`PixelTaper.gains`).
    """
    total = float(task.row_weight.sum() * task.sample_weight.sum())
    if not may_vary(task):
        return {"gain": total}
    tiling, grid = tiling_of(task.grid, SIDE), task.grid
    flat = np.zeros(grid.shape if tiling.in_rows else grid.size, _kind(dtype))
    coverage, complete = RowCoverage(task), True
    for band in range(tiling.n_bands):
        orders = tiling.bands(band, band + 1)[1]
        positions = tiling.positions(band, band + 1, orders)
        weight, count = coverage.sums(positions, np.stack([task.row_weight, np.ones(task.raw.n_rows)]))
        if tapered is not None:
            weight = tapered(positions, count)
        complete = complete and bool((count == task.raw.n_rows).all())
        tiling.place((weight * task.sample_weight.sum()).ravel(), (band, band + 1), 0, orders, flat)
    if complete and tapered is None:
        return {"gain": total}
    image = flat.reshape(grid.shape)
    used = image if grid.empty is None else image[~grid.empty]
    low, high = float(used.min()), float(used.max())
    # where no pixel is seen the image is zero, and a gain is not
    gain = total if high == 0 else low if low == high else image
    return {"gain": gain, "aperture": _aperture(task)}


def _aperture(task: FocusingTask) -> np.ndarray:
    """Rows spread over all, (k, 13), as Image.aperture holds them."""
    raw, antennas = task.raw, task.antennas
    rows = spread_over(raw.n_rows, ROWS)
    half = np.full(len(rows), UNLIMITED) if task.wrap else SPEED_OF_LIGHT / (4 * raw.frequency_step[rows])
    beam, cosine = np.zeros((len(rows), 3)), -1.0
    if antennas.beam is not None:
        beam, cosine = antennas.beam[rows], float(np.cos(antennas.beam_angle / 2))
    reference = raw.reference_range[rows]
    limits = [np.full(len(rows), cosine), reference - half, reference + half, task.row_weight[rows]]
    return np.column_stack([raw.tx[rows], raw.rx[rows], beam, *limits])


def _kind(dtype: DTypeLike) -> np.dtype:
    return np.dtype(np.float64 if np.dtype(dtype) == np.complex128 else np.float32)


@dataclass(frozen=True, eq=False)
class RowCoverage:
    """Range windows and beams of a task's rows."""

    task: FocusingTask

    def sums(self, positions: np.ndarray, weights: np.ndarray) -> np.ndarray:
        """Sums (k, n_tiles, per_tile) of weights (k, n_rows) over the rows that see each of positions, m (n_tiles,
        per_tile, 3)."""
        totals = np.zeros((len(weights), *positions.shape[:2]))
        for first, stop, is_seen_whole, partly in self._tiles(positions):
            totals[:, first:stop] += (weights @ is_seen_whole.T)[..., None]
            for tile, rows in partly:
                totals[:, tile] += weights[:, rows] @ self.sees(positions[tile], rows)
        return totals

    def spans(self, positions: np.ndarray, places: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Least and largest of places (n_rows,) of the rows that see positions, m (n_tiles, per_tile, 3): (n_tiles,
        per_tile) each, inf and -inf where none does."""
        least, most = np.full(positions.shape[:2], np.inf), np.full(positions.shape[:2], -np.inf)
        for first, stop, is_seen_whole, partly in self._tiles(positions):
            least[first:stop] = np.where(is_seen_whole, places, np.inf).min(axis=1)[:, None]
            most[first:stop] = np.where(is_seen_whole, places, -np.inf).max(axis=1)[:, None]
            for tile, rows in partly:
                rows = rows[np.argsort(places[rows], kind="stable")]
                # rows within the span that is known already add nothing
                rows = rows[(places[rows] < least[tile, 0]) | (places[rows] > most[tile, 0])]
                if len(rows) == 0:
                    continue
                seen = self.sees(positions[tile], rows)
                is_seen, places_of_rows = seen.any(axis=0), places[rows]
                low, high = (
                    places_of_rows[seen.argmax(axis=0)],
                    places_of_rows[len(rows) - 1 - seen[::-1].argmax(axis=0)],
                )
                least[tile] = np.where(is_seen, np.minimum(least[tile], low), least[tile])
                most[tile] = np.where(is_seen, np.maximum(most[tile], high), most[tile])
        return least, most

    def sees(self, points: np.ndarray, rows: np.ndarray) -> np.ndarray:
        """Whether rows (m,) see points, m (n, 3), which lie near one another: bool (m, n)."""
        raw, antennas = self.task.raw, self.task.antennas
        origin = points.mean(axis=0)
        x, tx = points - origin, raw.tx[rows] - origin
        reach = _distances(tx, x)
        seen = np.ones(reach.shape, bool)
        if not self.task.wrap:
            path = reach if antennas.is_monostatic else (reach + _distances(raw.rx[rows] - origin, x)) / 2
            half = SPEED_OF_LIGHT / (4 * raw.frequency_step[rows])
            seen &= np.abs(path - raw.reference_range[rows][:, None]) <= half[:, None]
        if antennas.beam is not None:
            beam = antennas.beam[rows]
            along = beam @ x.T - np.einsum("mx,mx->m", tx, beam)[:, None]
            seen &= along >= np.cos(antennas.beam_angle / 2) * reach
        return seen

    def _tiles(self, positions: np.ndarray) -> Iterator[tuple[int, int, np.ndarray, list[tuple[int, np.ndarray]]]]:
        """For tiles first ... stop - 1: rows that see all of each, (stop - first, n_rows) bool, and the tiles with rows
        for which each of their points must be asked, (tile, rows)."""
        raw, antennas = self.task.raw, self.task.antennas
        low, high = positions.min(axis=1), positions.max(axis=1)
        middle = (low + high) / 2
        radius = np.sqrt(((positions - middle[:, None]) ** 2).sum(axis=-1).max(axis=1))
        origin = middle.mean(axis=0)
        half = SPEED_OF_LIGHT / (4 * raw.frequency_step)
        ends = [e - origin for e in antennas.ends]
        farthest = max(float(np.abs(e).max()) for e in ends) + float(np.abs(middle - origin).max())
        step = max(1, PAIRS // raw.n_rows)
        for first in range(0, len(middle), step):
            stop = min(first + step, len(middle))
            x, reach = middle[first:stop] - origin, radius[first:stop, None] + SLACK * farthest
            distances = [_distances(x, e) for e in ends]
            is_seen_whole = np.ones((stop - first, raw.n_rows), bool)
            outside = np.zeros_like(is_seen_whole)
            if not self.task.wrap:
                depth = half - np.abs(sum(distances) / len(ends) - raw.reference_range)
                is_seen_whole &= depth > reach
                outside |= depth < -reach
            if antennas.beam is not None:
                angle = antennas.beam_angle / 2
                along = x @ antennas.beam.T - np.einsum("px,px->p", ends[0], antennas.beam)
                across = np.sqrt(np.maximum(distances[0] ** 2 - along**2, 0))
                inside = along * np.sin(angle) - across * np.cos(angle)  # no more than the distance from the cone
                # of a point on the axis `across` is a difference of nearly equal squares
                slack = reach + np.abs(np.cos(angle)) * np.sqrt(SLACK) * farthest * (across < 1e-4 * distances[0])
                is_seen_whole &= inside > slack
                outside |= inside < -slack
            is_seen_in_part = ~(is_seen_whole | outside)
            tiles_in_part = np.flatnonzero(is_seen_in_part.any(axis=1))
            yield (
                first,
                stop,
                is_seen_whole,
                [(int(first + t), np.flatnonzero(is_seen_in_part[t])) for t in tiles_in_part],
            )


def _distances(points: np.ndarray, ends: np.ndarray) -> np.ndarray:
    """Distances (n, m) of points, m (n, 3), from ends, m (m, 3)."""
    squares = (points**2).sum(axis=1)[:, None] + (ends**2).sum(axis=1) - 2 * points @ ends.T
    return np.sqrt(np.maximum(squares, 0))
