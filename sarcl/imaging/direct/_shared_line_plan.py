"""Plan of direct backprojection onto planes by lines that a work-group shares (kernels/backproject_shared_lines.cl)."""

from __future__ import annotations

import itertools
from dataclasses import dataclass

from ...model.image_grid import ImageGrid
from ...numerics import cost_model, error_bounds, interpolation
from ...numerics.cost_model import DeviceClass
from ...numerics.interpolation import Interpolator
from ...numerics.pulse_geometry import PulseGeometry
from ._line_curvature import curvatures
from .line_plan import FINES, MOST_CHOSEN, MOST_FIXED, LinePlan, profile_interpolator, series

SIDES = (64, 32)  # pixels along a side of a tile
GROUP_SIZES = (64, 32, 16, 8)  # pulses per group
CHUNK = 64  # pulses added in float32 before the compensated total
PER_ITEM = 16  # pixels of a work-item
PIXELS = 4  # neighbouring ones among them: PIXELS of the kernel
MOST_LOCAL = 48 * 1024  # bytes of local memory that any NVIDIA device gives to a work-group


@dataclass(frozen=True, eq=False)
class SharedLinePlan(LinePlan):
    """As LinePlan, for lines that a work-group shares.

    slopes  interpolator whose weights' slopes shift the positions of pixels; None: none do
    native  sine and cosine are the device's own
    """

    slopes: Interpolator | None = None
    native: bool = False

    @property
    def items(self) -> int:
        """Work-items of a group."""
        return self.side**2 // PER_ITEM

    def macros(self, bistatic: bool, wrap: bool, local: bool = False) -> dict[str, int]:
        """Build-time macros of kernels/backproject_shared_lines.cl."""
        if local:
            raise RuntimeError("lines that a work-group shares read the profiles of pulses; please report this")
        macros = super().macros(bistatic, wrap)
        for name in ("SLOPE", "LOCAL"):
            del macros[name]
        taps, terms = (self.slopes.taps, self.slopes.terms) if self.slopes else (0, 0)
        macros |= {"SLOPE_TAPS": taps, "SLOPE_TERMS": terms, "ITEMS": self.items, "CHUNK": CHUNK}
        return macros | {"SHARED": 1, "NATIVE": int(self.native)}

    @property
    def local_bytes(self) -> int:
        """Bytes of local memory of a work-group."""
        return local_bytes(self.side, self.fine, self.line.taps, self.slopes.taps if self.slopes else 0)


def local_bytes(side: int, fine: int, taps: int, slope_taps: int) -> int:
    """Bytes of local memory that a work-group takes: two pulses' samples of T, weights, slopes and places of lines."""
    period = fine * PIXELS
    rows = period + (PIXELS - 1) * fine + taps - 1
    columns = fine * (2 * side + 16) // period + 1
    return 2 * (8 * rows * columns + 8 * side * taps + max(8 * side * slope_taps, 16) + 4 * side)


def choose(
    tolerance: float,
    grid: ImageGrid,
    antennas: PulseGeometry,
    *,
    n_samples: int,
    bandwidth: float,
    highest: float,
    on: DeviceClass,
) -> SharedLinePlan | None:
    """The cheapest SharedLinePlan whose predicted error is at most `tolerance`, or None.

    highest  highest frequency, Hz
    on       the devices that follow the plan: their local memory holds two pulses
    """
    distance = antennas.distance(grid.bounds)
    best: SharedLinePlan | None = None
    choices = list(itertools.product(SIDES, GROUP_SIZES))
    for side, group, curvature in curvatures(grid, antennas, choices, highest, distance, bent=True):
        radius = curvature.radius
        order, fixed = series(tolerance, radius, distance, highest)
        # sines and cosines: of T; of weights, whose taps are turned by another; and of each turn of a sum
        turns = CHUNK // group
        fixed += error_bounds.phase_rounding(0.0, highest, True) * (3 + turns)
        native = on.native_pays(tolerance)
        fixed += (3 + turns) * on.native_error if native else 0.0
        fixed += error_bounds.two_part_position_rounding(radius, distance, bandwidth)
        fixed += 2 * error_bounds.curvature_rounding(radius, distance, highest)
        if not fixed <= MOST_FIXED * tolerance:
            continue
        fixed += curvature.phase_error + error_bounds.sum_rounding(CHUNK, n_samples)
        shift, cells = curvature.shift(bandwidth), curvature.bent_cells(bandwidth)
        for fine, taps, slope_taps in itertools.product(FINES, interpolation.LINE_TERMS, (0, 2, 4, 6, 8)):
            if cells * 1.2 >= fine or slope_taps > taps or local_bytes(side, fine, taps, slope_taps) > on.local_memory:
                continue
            line = interpolation.line_interpolator(taps, fine / cells)
            slopes = interpolation.line_interpolator(slope_taps, fine / cells) if slope_taps else None
            shifted = shift**2 / 2 + shift * interpolation.slope_error(slopes) if slopes else shift
            error = fixed + line.error + shifted
            if not error <= MOST_CHOSEN * tolerance:
                continue
            samples = fine * 1.4 * side + taps + 4  # of T
            found = profile_interpolator(tolerance - error, n_samples, grid.size * samples / side**2)
            if found is None:
                continue
            made, length, _ = found
            cost = cost_model.shared_lines(side, fine, taps, slope_taps, group, made.taps, samples)
            cost += cost_model.profile(length) / grid.size
            if best is None or cost < best.cost:
                best = SharedLinePlan(
                    side, fine, group, line, made, length, order, slopes is not None,
                    *curvature.limits(bandwidth, length / n_samples), error + made.error, cost, slopes, native,
                )  # fmt: skip
    return best
