"""Plan of direct backprojection onto planes, a line of pixels at a time (kernels/backproject_lines.cl)."""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from dataclasses import dataclass

from ...base.errors import ToleranceUnreachable
from ...model.image_grid import ImageGrid
from ...numerics import cost_model, error_bounds, interpolation, interpolator_choice
from ...numerics.cost_model import DeviceClass
from ...numerics.interpolation import Interpolator
from ...numerics.plan import plan_words, profile_macros, series_words
from ...numerics.pulse_geometry import PulseGeometry
from ..focusing_task import FocusingTask
from ._line_curvature import GroupCurvature, curvatures

LOCAL_BYTES = 60_000  # bytes of local memory that a group of pulses may take
SIDES = (64, 32, 16)  # pixels along a side of a tile
FINES = (1, 2, 4, 8)  # samples of a line's profile per pixel
GROUP_SIZES = (16, 8, 4)  # pulses per group
MOST_LINES = 512  # lines of a tile times pulses of a group, at most: their profiles lie in local memory together
MOST_FIXED = 0.7  # largest share of a tolerance for errors that no interpolator changes
MOST_CHOSEN = 0.9  # the same with the errors of a line's interpolators; the rest is for that of the range profile
ORDER = 3  # of the range series
SAMPLING_MARGIN = 1.2  # ratio of a line's sampling rate to its bandwidth, at least, so that short interpolators suffice
SLOPE_ERROR = 8  # ratio of the error of the slopes of weights to that of the weights
SAMPLED_SIDES, SAMPLED_ENDS = 1.3, 8  # pixels that the samples of a line reach over: so many sides, and so many more


def components(beam: bool) -> int:
    """Floats of a (tile, pulse) record: N_LINE of kernels/backproject_lines.cl."""
    return 32 if beam else 28


@dataclass(frozen=True, eq=False)
class LinePlan:
    """Plan of backprojection by lines of pixels.

    side            pixels along a side of a tile
    fine            samples of a line's profile per pixel
    group           pulses per group; the pulses of a group share one wavefront curvature
    line            interpolator from the line's profile to its pixels
    interpolator    interpolator from the range profile, of `length` samples, to the line's profile
    order           order of the range series
    slope           the curvature also shifts the positions of pixels along the line
    limits          of the kernels: a pulse falls back to per-pixel interpolation where its curvature differs from that
                    of its group by more than limit_cycles cycles or limit_position samples, or its range changes by
                    more than limit_step samples per pixel along the line
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
    limits: Mapping[str, float]
    predicted_error: float
    cost: float

    def describe(self, method: str) -> dict[str, object]:
        """The plan in words and numbers, for a report."""
        ranges, series = f"lines, {self.line.taps} taps, {self.fine} samples per pixel", series_words(self.order)
        return plan_words(method, self.interpolator, self.length, self.side**2, ranges, series)

    @property
    def group_room(self) -> int:
        """Pulses per group that the kernel is built for: the most that fit into local memory, so that plans share
        programs."""
        form = self.fine, self.line.taps, self.slope
        sizes = (n for n in GROUP_SIZES if self.side * n <= MOST_LINES)
        return max(n for n in sizes if _local_bytes(self.side, n, *form) <= LOCAL_BYTES)

    def macros(self, bistatic: bool, wrap: bool) -> dict[str, int]:
        """Build-time macros of kernels/backproject_lines.cl."""
        return {
            "BISTATIC": int(bistatic),
            **profile_macros(self.interpolator, self.length, wrap, self.order),
            "SIDE": self.side,
            "FINE": self.fine,
            "FINE_BITS": self.fine.bit_length() - 1,
            "LINE_TAPS": self.line.taps,
            "LINE_TERMS": self.line.table.shape[-1],
            "GROUP": self.group_room,
            "SLOPE": int(self.slope),
        }


def possible(grid: ImageGrid, on: DeviceClass) -> bool:
    """Whether a plan by lines may be faster: pixels lie on lines, and the devices work on vectors of pixels."""
    return on.lanes and grid.is_plane


def choose(
    task: FocusingTask,
    antennas: PulseGeometry,
    tolerance: float,
    *,
    source: tuple[Interpolator, int] | None = None,
    sides: tuple[int, ...] = SIDES,
) -> LinePlan | None:
    """The cheapest LinePlan whose predicted error is at most `tolerance`, or None.

    antennas  of the pulses: the rows of the task, or those that are kept of them
    source    interpolator and length of profiles that exist already; None: they are chosen too
    sides     sides of tiles to choose from, pixels
    """
    tiles = [(side, group) for side in sides for group in GROUP_SIZES if side * group <= MOST_LINES]
    best: LinePlan | None = None
    for curvature in curvatures(task, antennas, tiles):
        best = _cheapest(task, tolerance, curvature, source, best)
    return best


def _cheapest(
    task: FocusingTask,
    tolerance: float,
    curvature: GroupCurvature,
    source: tuple[Interpolator, int] | None,
    best: LinePlan | None,
) -> LinePlan | None:
    """The cheapest plan for one side of tiles and number of pulses per group whose predicted error is at most
    `tolerance`; `best` where none is cheaper."""
    side, group, n_samples, n_pixels = curvature.side, curvature.group, task.raw.n_samples, task.grid.size
    fixed = error_bounds.series_error(curvature.radius, curvature.distance, task.highest, ORDER)
    fixed += error_bounds.phase_rounding(0.0, task.highest, True) * 2
    fixed += error_bounds.position_rounding(curvature.radius, task.bandwidth, False)
    fixed += error_bounds.curvature_rounding(curvature.radius, curvature.distance, task.highest)
    if not fixed <= MOST_FIXED * tolerance:
        return best
    fixed += curvature.phase_error + error_bounds.sum_rounding(group, n_samples)
    shift, cells = curvature.shift(task.bandwidth), curvature.cells(task.bandwidth)
    for fine, taps, slope in itertools.product(FINES, interpolation.LINE_TERMS, (False, True)):
        if cells * SAMPLING_MARGIN >= fine or _local_bytes(side, group, fine, taps, slope) > LOCAL_BYTES:
            continue
        vectors = fine * (SAMPLED_SIDES * side + SAMPLED_ENDS)
        cost = _cost(side, group, taps, slope, vectors)  # with the cheapest interpolator of range profiles
        if best is not None and cost >= best.cost:
            continue
        line = interpolation.line_interpolator(taps, fine / cells)
        shift_error = shift**2 / 2 + SLOPE_ERROR * shift * line.error if slope else shift
        error = fixed + line.error + shift_error
        if not error <= MOST_CHOSEN * tolerance:
            continue
        if source is not None:
            interpolator, length = source
            if not interpolator.error <= tolerance - error:
                continue
        else:
            reads = n_pixels * cost_model.LINE_SAMPLE * vectors / side**2
            choice = profile_interpolator(tolerance - error, n_samples, reads)
            if choice is None:
                continue
            interpolator, length, profile_cost = choice
            cost += (profile_cost - cost_model.TAPS[2]) * reads / n_pixels
            if best is not None and cost >= best.cost:
                continue
        best = LinePlan(
            side=side,
            fine=fine,
            group=group,
            line=line,
            interpolator=interpolator,
            length=length,
            order=ORDER,
            slope=slope,
            limits=curvature.limits(task.bandwidth, length / n_samples),
            predicted_error=error + interpolator.error,
            cost=cost,
        )
    return best


def _local_bytes(side: int, group: int, fine: int, taps: int, slope: bool) -> int:
    """Bytes of local memory of a group: two numbers per sample of its lines; places, weights and slopes of their
    taps."""
    return 4 * group * (fine * 2 * (2 * side + 16) + taps * (5 if slope else 3) * side)


def _cost(side: int, group: int, taps: int, slope: bool, vectors: float) -> float:
    """Cost per contribution where range profiles have two taps; vectors: samples of the profile of a line."""
    per_tile = cost_model.LINE_SAMPLE * vectors + cost_model.LINE_WEIGHTS * side + cost_model.LINE_PULSE
    per_tap = taps * cost_model.LINE_TAP * (cost_model.LINE_SLOPE if slope else 1)
    return per_tap + per_tile / side**2 + cost_model.LINE_GROUP / group


def profile_interpolator(error: float, n_samples: int, reads: float) -> tuple[Interpolator, int, float] | None:
    """Result of interpolator_choice.choose_interpolator; None where none has so small an error: other lines may leave
    more to the interpolator."""
    try:
        return interpolator_choice.choose_interpolator(error, n_samples, reads)
    except ToleranceUnreachable:
        return None
