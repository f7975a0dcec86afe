"""Plan of direct backprojection onto planes, a line of pixels at a time (kernels/backproject_lines.cl)."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...base.constants import SPEED_OF_LIGHT
from ...base.errors import ToleranceUnreachable
from ...base.rows import spread_over
from ...model.image_grid import ImageGrid
from ...numerics import cost_model, error_bounds, interpolation, interpolator_choice
from ...numerics.cost_model import DeviceClass
from ...numerics.interpolation import Interpolator
from ...numerics.pulse_geometry import PulseGeometry
from ..tiling.plane import outline

LOCAL_BYTES = 60_000  # bytes of local memory that a group of pulses may take
SIDES = (64, 32, 16)  # pixels along a side of a tile
FINES = (1, 2, 4, 8)  # samples of a line's profile per pixel
GROUP_SIZES = (16, 8, 4)  # pulses per group
MOST_FIXED = 0.7  # largest share of a tolerance for errors that no interpolator changes
MOST_CHOSEN = 0.9  # the same with the errors of a line's interpolators; the rest is for that of the range profile
LEAST_CELLS = 1e-30  # resolution cells per pixel; as LEAST_STEP of kernels/backproject_lines.cl


def components(beam: bool) -> int:
    """Floats of a (tile, pulse) record: N_LINE of kernels/backproject_lines.cl."""
    return 32 if beam else 28


@dataclass(frozen=True, eq=False)
class LinePlan:
    """How lines of pixels are computed.

    side            pixels along a side of a tile
    fine            samples of a line's profile per pixel
    group           pulses per group; the pulses of a group share one wavefront curvature
    line            interpolator from the line's profile to its pixels
    interpolator    interpolator from the range profile, of `length` samples, to the line's profile
    order           order of the range series
    slope           the curvature also shifts the positions of pixels along the line
    limit_cycles, limit_position, limit_step
                    a pulse falls back to per-pixel interpolation where its curvature differs from that of its group by
                    more than limit_cycles cycles or limit_position samples, or its range changes by more than
                    limit_step samples per pixel along the line
    cost            per contribution, relative to one with linear interpolation and ranges in float32
    """

    side: int
    fine: int
    group: int
    line: Interpolator
    interpolator: Interpolator
    length: int
    order: int
    slope: bool
    limit_cycles: float
    limit_position: float
    limit_step: float
    predicted_error: float
    cost: float

    def describe(self, method: str) -> dict[str, Any]:
        """The plan in words and numbers, for a report."""
        return {
            "method": method,
            "taps": self.interpolator.taps,
            "profile samples": self.length,
            "points per tile": self.side**2,
            "ranges": f"lines, {self.line.taps} taps, {self.fine} samples per pixel",
            "series": f"order {self.order}" if self.order else "exact",
        }

    def macros(self, bistatic: bool, wrap: bool, local: bool = False) -> dict[str, int]:
        """Build-time macros of kernels/backproject_lines.cl."""
        return {
            "BISTATIC": int(bistatic),
            "WRAP": self.length if wrap else 0,
            "TAPS": self.interpolator.taps,
            "TERMS": self.interpolator.terms,
            "ORDER": self.order,
            "SIDE": self.side,
            "FINE": self.fine,
            "FINE_BITS": self.fine.bit_length() - 1,
            "LINE_TAPS": self.line.taps,
            "LINE_TERMS": self.line.table.shape[-1],
            "GROUP": self.group,
            "SLOPE": int(self.slope),
            "LOCAL": int(local),
        }


def possible(grid: ImageGrid, on: DeviceClass) -> bool:
    """Whether a plan by lines may be faster: pixels lie on lines, and the devices work on vectors of pixels."""
    return on.lanes and grid.is_plane


def steps(grid: ImageGrid) -> np.ndarray:
    """Steps from one column and from one row to the next, m (2, 3)."""
    assert grid.spacing is not None and grid.x_axis is not None and grid.y_axis is not None
    return np.stack([grid.spacing[1] * grid.x_axis, grid.spacing[0] * grid.y_axis])


# Lines i and pixels j, in units of half a tile, where the curvature of a line is largest.
EDGE = np.array([[-1, 0, 1, 1, -1], [1, 1, 1, -1, -1]])


@dataclass(frozen=True, eq=False)
class SampledDirections:
    """Geometry of sampled tiles and pulses.

    along    components of the steps between pixels along the lines of sight, m (tiles, n, 2 antennas, 2)
    inverse  inverse distances from the antennas, 1/m (tiles, n, 2)
    """

    along: np.ndarray
    inverse: np.ndarray

    @classmethod
    def at(cls, points: np.ndarray, tx: np.ndarray, rx: np.ndarray, axes: np.ndarray) -> SampledDirections:
        ends = np.stack([tx, rx], axis=1)
        d = ends - points[:, None, None, :]
        inverse = 1 / np.maximum(np.linalg.norm(d, axis=-1), 1e-3)
        return cls(np.einsum("tnac,kc->tnak", d * inverse[..., None], axes), inverse)

    def largest_step(self) -> float:
        """Largest change of half the two-way path from one pixel to the next along either axis, m."""
        return float(np.abs(self.along.mean(axis=2)).max(initial=0.0))

    def _oriented(self, spacing: tuple[float, float]) -> tuple[np.ndarray, np.ndarray]:
        """`along` with the axis of the lines first, and the step along it, m (tiles, n, 1)."""
        mean = self.along.mean(axis=2)
        turned = np.abs(mean[..., 1]) > np.abs(mean[..., 0])
        u = np.where(turned[..., None, None], self.along[..., ::-1], self.along)
        return u, np.where(turned, spacing[0], spacing[1])[..., None]

    def rest(self, side: int, spacing: tuple[float, float]) -> np.ndarray:
        """rest_ij of kernels/backproject_lines.cl, m (tiles, n, 5), at EDGE of a tile, where it is largest."""
        u, step = self._oriented(spacing)
        i, j = side / 2 * EDGE
        along, across = u[..., :1] * j, u[..., 1:] * i
        # |p|^2 - (u.p)^2 at (i, j), less that at (i, 0)
        bend = (step[..., None] * j) ** 2 - (along + across) ** 2 + across**2
        return (bend * (self.inverse / 2)[..., None]).mean(axis=2)

    def bend(self, spacing: tuple[float, float]) -> np.ndarray:
        """What T of kernels/backproject_shared_lines.cl holds of the curvature, m per pixel^2 (tiles, n): bend_of of
        kernels/line_group.clh."""
        u, step = self._oriented(spacing)
        whole, facing = ((f * self.inverse / 2).mean(axis=2) for f in (step**2, u[..., 0] ** 2))
        along, across = np.moveaxis(np.abs(u.mean(axis=2)), -1, 0)
        return np.where(4 * across < along, whole - facing, -facing)

    def held(self, side: int, spacing: tuple[float, float], bend: np.ndarray) -> np.ndarray:
        """The part of `rest` that T holds with so much bend, m (tiles, n, 5)."""
        mean = self._oriented(spacing)[0].mean(axis=2)
        safe = np.where(mean[..., :1] == 0, np.inf, mean[..., :1])
        i, j = side / 2 * EDGE
        return bend[..., None] * (j**2 + 2 * i * j * mean[..., 1:] / safe)


def unmodelled_shift(rest: np.ndarray) -> float:
    """Largest part of `rest`, m (..., 5), that remains after the shift of a line by half its mean at the line's
    ends."""
    ends = np.stack([rest[..., [0, 1, 2]], rest[..., [4, 1, 3]]])
    middle = ends.mean(axis=0) / 2
    return float(max(np.abs(ends - middle).max(), np.abs(middle).max()))


def sampled_groups(n_rows: int, group: int, most: int = 24) -> np.ndarray:
    """First rows of up to `most` groups spread over all rows."""
    starts = np.arange(0, max(n_rows - group, 0) + 1, group)
    return starts[spread_over(len(starts), most)]


@dataclass(frozen=True)
class GroupCurvature:
    """How much the curvature of the pulses of a group differs, over sampled tiles and groups.

    radius   of a tile, m
    cycles   largest difference of phases from that of the middle pulse, with a margin
    off      largest part of the curvature that no shift of a line holds, m, with a margin
    step     largest change of the range from one pixel to the next, m
    stretch  what bent lines add to it at most, m
    """

    radius: float
    cycles: float
    off: float
    step: float
    stretch: float = 0.0

    @classmethod
    def of(
        cls,
        grid: ImageGrid,
        antennas: PulseGeometry,
        points: np.ndarray,
        side: int,
        group: int,
        highest: float,
        bent: bool = False,
    ) -> GroupCurvature:
        """Of tiles about `points`, with so many pixels along a side, and groups of so many pulses.

        bent  the profile of a line holds the bend of a group's middle pulse: `off` is what it does not hold
        """
        assert grid.spacing is not None
        n_rows = len(antennas.tx)
        starts = sampled_groups(n_rows, group)
        rows = np.minimum(starts[:, None] + np.arange(0, group + 1, group // 4), n_rows - 1).ravel()
        directions = SampledDirections.at(points, antennas.tx[rows], antennas.rx[rows], steps(grid))
        rest = directions.rest(side, grid.spacing).reshape(len(points), len(starts), -1, 5)
        kappa = 2 * highest / SPEED_OF_LIGHT
        cycles = 1.5 * kappa * float(np.abs(rest - rest[:, :, 2:3]).max())
        radius = side / 2 * float(np.hypot(*grid.spacing))
        stretch = 0.0
        if bent:
            bend = directions.bend(grid.spacing).reshape(len(points), len(starts), -1)
            bend = np.repeat(bend[:, :, 2:3], rest.shape[2], axis=2)
            held = directions.held(side, grid.spacing, bend.reshape(len(points), -1))
            rest = rest - held.reshape(rest.shape)
            stretch = 2.2 * side * float(np.abs(bend).max())  # lines and pixels reach 1.1 sides from the tile's middle
        return cls(radius, cycles, 1.1 * unmodelled_shift(rest), directions.largest_step(), stretch)

    @property
    def phase_error(self) -> float:
        """Phase error, rad, of the curvature that the pulses of a group share."""
        return 2 * np.pi * self.cycles

    def shift(self, bandwidth: float) -> float:
        """Phase error, rad, at the band's edge of positions that are not shifted pixel by pixel."""
        return 2 * np.pi * self.off * bandwidth / SPEED_OF_LIGHT

    def cells(self, bandwidth: float) -> float:
        """Resolution cells per pixel; where every pulse sees all pixels at one range they are added pixel by pixel."""
        return self._cells(self.step * 1.02, bandwidth)

    def bent_cells(self, bandwidth: float) -> float:
        """The same where a bent line's samples are farthest apart."""
        return self._cells(self.step * 1.02 + self.stretch, bandwidth)

    @staticmethod
    def _cells(step: float, bandwidth: float) -> float:
        return max(step * 2 * bandwidth / SPEED_OF_LIGHT, LEAST_CELLS)

    def limits(self, bandwidth: float, oversample: float) -> tuple[float, float, float]:
        """limit_cycles, limit_position and limit_step of a plan with profiles `oversample` times finer than a cell."""
        sigma = 2 * bandwidth / SPEED_OF_LIGHT * oversample
        return self.cycles, max(self.off * sigma, 1e-6), self.cells(bandwidth) * oversample * (1 + 1e-5)


def curvatures(
    grid: ImageGrid,
    antennas: PulseGeometry,
    choices: Sequence[tuple[int, int]],
    highest: float,
    distance: float,
    bent: bool = False,
) -> Iterator[tuple[int, int, GroupCurvature]]:
    """Of `choices`, (side of a tile, pulses per group), those that the grid and its distance, m, allow."""
    assert grid.spacing is not None
    points, least = outline(grid), min(side for side, _ in choices)
    for side, group in choices:
        if 2 * side * float(np.hypot(*grid.spacing)) > distance or (side > least and min(grid.shape) <= side / 2):
            continue
        yield side, group, GroupCurvature.of(grid, antennas, points, side, group, highest, bent)


def series(tolerance: float, radius: float, distance: float, highest: float) -> tuple[int, float]:
    """Order of the range series, and its phase error, rad."""
    errors = {order: error_bounds.series_error(radius, distance, highest, order) for order in (2, 3)}
    order = 2 if errors[2] < 0.1 * tolerance else 3
    return order, errors[order]


def profile_interpolator(error: float, n_samples: int, reads: float) -> tuple[Interpolator, int, float] | None:
    """As interpolator_choice.choose_interpolator; None where it finds nothing: other lines may leave more to the
    interpolator."""
    try:
        return interpolator_choice.choose_interpolator(error, n_samples, reads)
    except ToleranceUnreachable:
        return None


def choose(
    tolerance: float,
    grid: ImageGrid,
    antennas: PulseGeometry,
    *,
    n_samples: int,
    bandwidth: float,
    highest: float,
    source: tuple[Interpolator, int] | None = None,
    sides: tuple[int, ...] = SIDES,
) -> LinePlan | None:
    """The cheapest LinePlan whose predicted error is at most `tolerance`, or None.

    highest  highest frequency, Hz
    source   interpolator and length of profiles that exist already; None: they are chosen too
    sides    sides of tiles to choose from, pixels
    """
    distance = antennas.distance(grid.bounds)
    best: LinePlan | None = None
    choices = [(s, g) for s in sides for g in GROUP_SIZES if s * g <= 512]
    for side, group, curvature in curvatures(grid, antennas, choices, highest, distance):
        radius = curvature.radius
        order, fixed = series(tolerance, radius, distance, highest)
        fixed += error_bounds.phase_rounding(0.0, highest, True) * 2
        fixed += error_bounds.position_rounding(radius, bandwidth, False)
        fixed += error_bounds.curvature_rounding(radius, distance, highest)
        if not fixed <= MOST_FIXED * tolerance:
            continue
        fixed += curvature.phase_error + error_bounds.sum_rounding(group, n_samples)
        position_phase, cells = curvature.shift(bandwidth), curvature.cells(bandwidth)
        for fine, taps, slope in itertools.product(FINES, interpolation.LINE_TERMS, (False, True)):
            size = 4 * group * (fine * 2 * (2 * side + 16) + taps * (5 if slope else 3) * side)
            if cells * 1.2 >= fine or size > LOCAL_BYTES:
                continue
            line = interpolation.line_interpolator(taps, fine / cells)
            # the error of the weights' slopes is a few times that of the weights
            shifted = position_phase**2 / 2 + 8 * position_phase * line.error if slope else position_phase
            error = fixed + line.error + shifted
            if not error <= MOST_CHOSEN * tolerance:
                continue
            vectors = fine * (1.3 * side + 8)
            per_tile = cost_model.LINE_SAMPLE * vectors + cost_model.LINE_WEIGHTS * side + cost_model.LINE_PULSE
            per_tap = taps * cost_model.LINE_TAP * (cost_model.LINE_SLOPE if slope else 1)
            per_pair = per_tap + per_tile / side**2 + cost_model.LINE_GROUP / group
            if source is None:
                reads = grid.size * cost_model.LINE_SAMPLE * vectors / side**2
                found = profile_interpolator(tolerance - error, n_samples, reads)
                if found is None:
                    continue
                made, length, cost = found
                per_pair += (cost - cost_model.TAPS[2]) * reads / grid.size
            else:
                made, length = source
                if not made.error <= tolerance - error:
                    continue
            if best is None or per_pair < best.cost:
                best = LinePlan(
                    side, fine, group, line, made, length, order, slope,
                    *curvature.limits(bandwidth, length / n_samples), error + made.error, per_pair,
                )  # fmt: skip
    return best
