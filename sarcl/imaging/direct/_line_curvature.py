"""Difference of the curvature of wavefronts over a tile and a group of pulses, for plans by lines of pixels."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...base.constants import SPEED_OF_LIGHT
from ...base.rows import spread_over
from ...model.image_grid import ImageGrid
from ...numerics.pulse_geometry import PulseGeometry
from ..focusing_task import FocusingTask
from ..kept_results import per_task
from ..tiling.plane import outline

LEAST_CELLS = 1e-30  # resolution cells per pixel; as LEAST_STEP of kernels/backproject_lines.cl
LEAST_SHIFT = 1e-6  # samples, smallest limit_position: limits are compared in float32
SAMPLED_GROUPS = 24  # groups of pulses from which curvatures are taken, at most
# Ratio of the largest value anywhere to that of the tiles and pulses that are sampled: of phases that differ within a
# group, of the part of the curvature that no shift holds, of the step from pixel to pixel.
CYCLES_MARGIN, SHIFT_MARGIN, STEP_MARGIN = 1.5, 1.1, 1.02
REACH = 1.1  # sides of a tile, from its middle to the farthest samples of its lines
LIMIT_SLACK = 1 + 1e-5  # ratio of limit_step to the largest step: rounding of float32


def steps(grid: ImageGrid) -> np.ndarray:
    """Steps from one column and from one row to the next, m (2, 3)."""
    assert grid.spacing is not None and grid.x_axis is not None and grid.y_axis is not None
    return np.stack([grid.spacing[1] * grid.x_axis, grid.spacing[0] * grid.y_axis])


# Lines i and pixels j, in units of half a tile, where the curvature of a line is largest.
EDGE = np.array([[-1, 0, 1, 1, -1], [1, 1, 1, -1, -1]])


@dataclass(frozen=True, eq=False)
class SampledDirections:
    """Geometry of sampled tiles and pulses.

    along    components of the steps between pixels along the lines of sight, m (tiles, n, antennas, 2)
    inverse  inverse distances from the antennas, 1/m (tiles, n, antennas)
    """

    along: np.ndarray
    inverse: np.ndarray

    @classmethod
    def at(cls, points: np.ndarray, ends: Sequence[np.ndarray], axes: np.ndarray) -> SampledDirections:
        """Tiles about points, m (tiles, 3); ends  positions of each distinct antenna, m (n, 3)."""
        d = np.stack(ends, axis=1) - points[:, None, None, :]
        inverse = 1 / np.maximum(np.linalg.norm(d, axis=-1), 1e-3)
        return cls(np.einsum("tnac,kc->tnak", d * inverse[..., None], axes), inverse)

    def largest_step(self) -> float:
        """Largest change of half the two-way path from one pixel to the next along either axis, m."""
        return float(np.abs(self.along.mean(axis=2)).max(initial=0.0))

    def _oriented(self, spacing: tuple[float, float]) -> tuple[np.ndarray, np.ndarray]:
        """`along` with the axis of the lines first, and the step along it, m (tiles, n, 1)."""
        mean = self.along.mean(axis=2)
        is_down_columns = np.abs(mean[..., 1]) > np.abs(mean[..., 0])
        u = np.where(is_down_columns[..., None, None], self.along[..., ::-1], self.along)
        return u, np.where(is_down_columns, spacing[0], spacing[1])[..., None]

    def rest(self, side: int, spacing: tuple[float, float]) -> np.ndarray:
        """rest_ij of kernels/backproject_lines.cl, m (tiles, n, 5), at EDGE of a tile, where it is largest."""
        u, step = self._oriented(spacing)
        i, j = side / 2 * EDGE
        along, across = u[..., :1] * j, u[..., 1:] * i
        # |p|^2 - (u.p)^2 at (i, j), less that at (i, 0)
        bend = (step[..., None] * j) ** 2 - (along + across) ** 2 + across**2
        return (bend * (self.inverse / 2)[..., None]).mean(axis=2)

    def bend(self, spacing: tuple[float, float]) -> np.ndarray:
        """The curvature that T of kernels/backproject_shared_lines.cl has, m per pixel^2 (tiles, n): bend_of of
        kernels/line_group.clh."""
        u, step = self._oriented(spacing)
        of_steps, of_ranges = ((f * self.inverse / 2).mean(axis=2) for f in (step**2, u[..., 0] ** 2))
        along, across = np.moveaxis(np.abs(u.mean(axis=2)), -1, 0)
        return np.where(4 * across < along, of_steps - of_ranges, -of_ranges)

    def bent_part(self, side: int, spacing: tuple[float, float], bend: np.ndarray) -> np.ndarray:
        """The part of `rest` that T has with so much bend, m (tiles, n, 5)."""
        mean = self._oriented(spacing)[0].mean(axis=2)
        along = np.where(mean[..., :1] == 0, np.inf, mean[..., :1])
        i, j = side / 2 * EDGE
        return bend[..., None] * (j**2 + 2 * i * j * mean[..., 1:] / along)


def unmodelled_shift(rest: np.ndarray) -> float:
    """Largest part of `rest`, m (..., 5), that remains after the shift of a line by half its mean at the line's
    ends."""
    ends = np.stack([rest[..., [0, 1, 2]], rest[..., [4, 1, 3]]])
    middle = ends.mean(axis=0) / 2
    return float(max(np.abs(ends - middle).max(), np.abs(middle).max()))


def sampled_groups(n_rows: int, group: int) -> np.ndarray:
    """First rows of up to SAMPLED_GROUPS groups spread over all rows."""
    starts = np.arange(0, max(n_rows - group, 0) + 1, group)
    return starts[spread_over(len(starts), SAMPLED_GROUPS)]


@dataclass(frozen=True)
class GroupCurvature:
    """Difference of the curvature among the pulses of a group, over sampled tiles and groups.

    side      pixels along a side of a tile;  radius  of a tile, m
    group     pulses per group
    distance  smallest from an antenna to the grid, m
    cycles    largest difference of phases from that of the middle pulse, with a margin
    off       largest part of the curvature that no shift of a line holds, m, with a margin
    step      largest change of the range from one pixel to the next, m, with a margin
    stretch   what bent lines add to it at most, m
    """

    side: int
    radius: float
    group: int
    distance: float
    cycles: float
    off: float
    step: float
    stretch: float = 0.0

    @property
    def phase_error(self) -> float:
        """Phase error, rad, of the curvature that the pulses of a group share."""
        return 2 * np.pi * self.cycles

    def shift(self, bandwidth: float) -> float:
        """Phase error, rad, at the band's edge of positions that are not shifted pixel by pixel."""
        return 2 * np.pi * self.off * bandwidth / SPEED_OF_LIGHT

    def cells(self, bandwidth: float) -> float:
        """Resolution cells per pixel; where every pulse sees all pixels at one range they are added pixel by pixel."""
        return max(self.step * 2 * bandwidth / SPEED_OF_LIGHT, LEAST_CELLS)

    def bent_cells(self, bandwidth: float) -> float:
        """The same where a bent line's samples are farthest apart."""
        return max((self.step + self.stretch) * 2 * bandwidth / SPEED_OF_LIGHT, LEAST_CELLS)

    def limits(self, bandwidth: float, oversample: float) -> dict[str, float]:
        """Limits of a LinePlan with profiles `oversample` times finer than a cell."""
        position = max(self.off * (2 * bandwidth / SPEED_OF_LIGHT * oversample), LEAST_SHIFT)
        step = self.cells(bandwidth) * oversample * LIMIT_SLACK
        return {"limit_cycles": self.cycles, "limit_position": position, "limit_step": step}


def curvatures(
    task: FocusingTask, antennas: PulseGeometry, tiles: Sequence[tuple[int, int]], is_bent: bool = False
) -> Iterator[GroupCurvature]:
    """Of `tiles`, (side, pulses per group), those that the grid and its distance from the antennas allow.

    is_bent  the profile of a line has the bend of a group's middle pulse: `off` is what it has not
    """
    grid, distance = task.grid, antennas.distance(task.grid.bounds)
    assert grid.spacing is not None
    least = min(side for side, _ in tiles)
    for side, group in tiles:
        is_too_near = 2 * side * float(np.hypot(*grid.spacing)) > distance
        if not is_too_near and (side <= least or min(grid.shape) > side / 2):
            unit = _curvature(task, antennas, group, is_bent)
            yield replace(
                unit,
                side=side,
                radius=side * unit.radius,
                distance=distance,
                # paths in a tile are quadratic forms of the places of its pixels
                cycles=side**2 * unit.cycles,
                off=side**2 * unit.off,
                stretch=side * unit.stretch,
            )


@per_task
def _curvature(task: FocusingTask, antennas: PulseGeometry, group: int, is_bent: bool) -> GroupCurvature:
    """The curvature in tiles of one pixel, for so many pulses per group."""
    grid, points, n_rows = task.grid, outline(task.grid), len(antennas.tx)
    assert grid.spacing is not None
    starts = sampled_groups(n_rows, group)
    rows = np.minimum(starts[:, None] + np.arange(0, group + 1, group // 4), n_rows - 1).ravel()
    directions = SampledDirections.at(points, [end[rows] for end in antennas.ends], steps(grid))
    rest = directions.rest(1, grid.spacing).reshape(len(points), len(starts), -1, 5)
    kappa = 2 * task.highest / SPEED_OF_LIGHT
    cycles = CYCLES_MARGIN * kappa * float(np.abs(rest - rest[:, :, 2:3]).max())
    stretch = 0.0
    if is_bent:
        bend = directions.bend(grid.spacing).reshape(len(points), len(starts), -1)
        bend = np.repeat(bend[:, :, 2:3], rest.shape[2], axis=2)
        rest = rest - directions.bent_part(1, grid.spacing, bend.reshape(len(points), -1)).reshape(rest.shape)
        stretch = 2 * REACH * float(np.abs(bend).max())
    return GroupCurvature(
        side=1,
        radius=float(np.hypot(*grid.spacing)) / 2,
        group=group,
        distance=0.0,
        cycles=cycles,
        off=SHIFT_MARGIN * unmodelled_shift(rest),
        step=directions.largest_step() * STEP_MARGIN,
        stretch=stretch,
    )
