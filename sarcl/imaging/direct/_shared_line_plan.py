"""Plan of direct backprojection onto planes by lines that a work-group shares (kernels/backproject_shared_lines.cl)."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from dataclasses import dataclass

from ...numerics import cost_model, error_bounds, interpolation
from ...numerics.cost_model import DeviceClass
from ...numerics.interpolation import Interpolator
from ..focusing_task import FocusingTask
from ._line_curvature import GroupCurvature, curvatures
from .line_plan import FINES, MOST_CHOSEN, MOST_FIXED, SAMPLING_MARGIN, LinePlan, profile_interpolator

SIDES = (64, 32)  # pixels along a side of a tile
GROUP_SIZES = (64, 32, 16, 8)  # pulses per group
SLOPE_TAPS = (0, 2, 4, 6, 8)  # taps of the slopes of weights; 0: positions are not shifted
SAMPLED_SIDES = 1.4  # sides of a tile that the samples of a line reach over, without those of its taps
CHUNK = 64  # pulses added in float32 before the compensated total
PER_ITEM = 16  # pixels of a work-item
ENTRY = 24  # numbers that are known of a pulse: N_ENTRY of kernels/line_schedule.clh
PIXELS = 4  # neighbouring ones among them: PIXELS of the kernel
SERIES_SHARE = 0.1  # share of a tolerance up to which the range series ends at its second order
MOST_LOCAL = 48 * 1024  # bytes of local memory that any NVIDIA device gives to a work-group


@dataclass(frozen=True, eq=False)
class SharedLinePlan(LinePlan):
    """LinePlan of lines that a work-group shares.

    slopes  interpolator whose weights' slopes shift the positions of pixels; None: none do
    native  sine and cosine are the device's own
    """

    slopes: Interpolator | None = None
    native: bool = False

    @property
    def items(self) -> int:
        """Work-items of a group."""
        return self.side**2 // PER_ITEM

    @property
    def least_items(self) -> int:
        """Fewest work-items with which the kernel works: those that share a line."""
        return self.side // PIXELS

    @property
    def group_room(self) -> int:
        """Pulses per group that the kernels are built for: those of this plan."""
        return self.group

    def macros(self, bistatic: bool, wrap: bool) -> dict[str, int]:
        """Build-time macros of kernels/backproject_shared_lines.cl."""
        macros = super().macros(bistatic, wrap)
        del macros["SLOPE"]
        taps, terms = (self.slopes.taps, self.slopes.terms) if self.slopes else (0, 0)
        macros |= {"SLOPE_TAPS": taps, "SLOPE_TERMS": terms, "ITEMS": self.items, "CHUNK": CHUNK}
        return macros | {"SHARED": 1, "NATIVE": int(self.native)}

    @property
    def local_bytes(self) -> int:
        """Bytes of local memory of a work-group."""
        return local_bytes(self.side, self.group, self.fine, self.line.taps, self.slopes.taps if self.slopes else 0)


def _series(tolerance: float, curvature: GroupCurvature, highest: float) -> tuple[int, float]:
    """Order of the range series, and its phase error, rad; highest frequency, Hz."""
    errors = {
        order: error_bounds.series_error(curvature.radius, curvature.distance, highest, order) for order in (2, 3)
    }
    order = 2 if errors[2] < SERIES_SHARE * tolerance else 3
    return order, errors[order]


def local_bytes(side: int, group: int, fine: int, taps: int, slope_taps: int) -> int:
    """Bytes of local memory that a work-group takes: two pulses' samples of T, weights, slopes and places of lines, and
    what is known of the pulses of a group."""
    period = fine * PIXELS
    rows = period + (PIXELS - 1) * fine + taps - 1
    columns = fine * (2 * side + 16) // period + 1
    pulses = 2 * (8 * rows * columns + 8 * side * taps + max(8 * side * slope_taps, 16) + 4 * side)
    return pulses + 4 * ENTRY * group


def choose(task: FocusingTask, tolerance: float, devices: DeviceClass) -> SharedLinePlan | None:
    """The cheapest SharedLinePlan whose predicted error is at most `tolerance`, or None.

    devices  those that follow the plan: their local memory holds two pulses, their groups the items of a tile
    """
    sides = [side for side in SIDES if side**2 // PER_ITEM <= devices.most_items]
    if not sides:
        return None
    tiles = list(itertools.product(sides, GROUP_SIZES))
    plans = (
        plan
        for curvature in curvatures(task, task.antennas, tiles, is_bent=True)
        for plan in _plans(task, tolerance, curvature, devices)
    )
    return min(plans, key=lambda plan: plan.cost, default=None)


def _plans(
    task: FocusingTask, tolerance: float, curvature: GroupCurvature, devices: DeviceClass
) -> Iterator[SharedLinePlan]:
    """Plans for one side of tiles and number of pulses per group, whose predicted errors are at most `tolerance`."""
    side, group, n_samples, n_pixels = curvature.side, curvature.group, task.raw.n_samples, task.grid.size
    order, fixed = _series(tolerance, curvature, task.highest)
    # sines and cosines: of T; of weights, whose taps are turned by another; and of each turn of a sum
    n_rotations = 3 + CHUNK // group
    fixed += error_bounds.phase_rounding(0.0, task.highest, True) * n_rotations
    native = devices.native_pays(tolerance)
    fixed += n_rotations * devices.native_error if native else 0.0
    fixed += error_bounds.two_part_position_rounding(curvature.radius, curvature.distance, task.bandwidth)
    fixed += 2 * error_bounds.curvature_rounding(curvature.radius, curvature.distance, task.highest)
    if not fixed <= MOST_FIXED * tolerance:
        return
    fixed += curvature.phase_error + error_bounds.sum_rounding(CHUNK, n_samples)
    shift, cells = curvature.shift(task.bandwidth), curvature.bent_cells(task.bandwidth)
    for fine, taps, slope_taps in itertools.product(FINES, interpolation.LINE_TERMS, SLOPE_TAPS):
        if cells * SAMPLING_MARGIN >= fine or slope_taps > taps:
            continue
        if local_bytes(side, group, fine, taps, slope_taps) > devices.local_memory:
            continue
        line = interpolation.line_interpolator(taps, fine / cells)
        slopes = interpolation.line_interpolator(slope_taps, fine / cells) if slope_taps else None
        shift_error = shift**2 / 2 + shift * interpolation.slope_error(slopes) if slopes else shift
        error = fixed + line.error + shift_error
        if not error <= MOST_CHOSEN * tolerance:
            continue
        line_samples = fine * SAMPLED_SIDES * side + taps + 4  # of T
        choice = profile_interpolator(tolerance - error, n_samples, n_pixels * line_samples / side**2)
        if choice is None:
            continue
        interpolator, length, _ = choice
        cost = cost_model.shared_lines(side, fine, taps, slope_taps, group, interpolator.taps)
        yield SharedLinePlan(
            side=side,
            fine=fine,
            group=group,
            line=line,
            interpolator=interpolator,
            length=length,
            order=order,
            slope=slopes is not None,
            limits=curvature.limits(task.bandwidth, length / n_samples),
            predicted_error=error + interpolator.error,
            cost=cost + cost_model.profile(length) / n_pixels,
            slopes=slopes,
            native=native,
        )
