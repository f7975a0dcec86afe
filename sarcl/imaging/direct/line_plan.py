"""Plan of direct backprojection onto planes, a line of pixels at a time (kernels/backproject_lines.cl)."""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from typing import Any

from ...base.errors import ToleranceUnreachable
from ...model.image_grid import ImageGrid
from ...numerics import cost_model, error_bounds, interpolation, interpolator_choice
from ...numerics.cost_model import DeviceClass
from ...numerics.interpolation import Interpolator
from ...numerics.pulse_geometry import PulseGeometry
from ._line_curvature import curvatures

LOCAL_BYTES = 60_000  # bytes of local memory that a group of pulses may take
SIDES = (64, 32, 16)  # pixels along a side of a tile
FINES = (1, 2, 4, 8)  # samples of a line's profile per pixel
GROUP_SIZES = (16, 8, 4)  # pulses per group
MOST_FIXED = 0.7  # largest share of a tolerance for errors that no interpolator changes
MOST_CHOSEN = 0.9  # the same with the errors of a line's interpolators; the rest is for that of the range profile


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
