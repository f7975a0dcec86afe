"""Plans of float64 backprojection: the cheapest that meets a tolerance, and its predicted error."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from ...base.constants import SPEED_OF_LIGHT
from ...base.errors import ToleranceUnreachable
from ...base.tolerances import askable, rounded_up
from ...numerics import cost_model, error_bounds, interpolation, interpolator_choice
from ...numerics.interpolation import Interpolator
from ...numerics.plan import plan_words, profile_macros, series_words
from .. import profile_energy
from ..focusing_task import FocusingTask
from ..profile_energy import ProfileEnergy
from ..tiling.of_grid import tiling_of
from ..tiling.tiling import Tiling

CHUNK = 64  # rows added without compensation before the compensated total; blocks of rows are multiples of it
SIDES = (16, 8)  # pixels along a side of a tile
MOST_CYCLES = 2.0**44  # cycles of a path; sample positions, up to 32 per cycle, are still exact below 2^51
WIDE = -1  # order of plans that compute every path in pairs of float64


@dataclass(frozen=True, eq=False)
class Float64Plan:
    """Plan of an image in float64.

    length        samples of a range profile
    per_tile      pixels of a tile
    order         order of the range series: 4; 0: exact differences; WIDE: exact, in pairs of float64
    cost          per row, in units of cost_model
    """

    interpolator: Interpolator
    length: int
    per_tile: int
    order: int
    predicted_error: float
    cost: float

    def describe(self, method: str) -> dict[str, object]:
        """The plan in words and numbers, for a report."""
        ranges, series = "pairs of float64" if self.order == WIDE else "float64", series_words(self.order)
        return plan_words(method, self.interpolator, self.length, self.per_tile, ranges, series)

    def macros(self, wrap: bool) -> dict[str, int]:
        """Build-time macros of kernels/backproject_float64.cl that the plan sets."""
        return {**profile_macros(self.interpolator, self.length, wrap, self.order), "CHUNK": CHUNK}


def make_plan(task: FocusingTask, tolerance: float) -> tuple[Float64Plan, Tiling]:
    """The cheapest plan whose predicted error is at most `tolerance`, and the tiling of the grid that it uses.

    ToleranceUnreachable names the best tolerance that can be met. ValueError for paths that are too long (`too_long`).
    """
    long = too_long(task)
    if long:
        raise ValueError(long)
    tilings = {side**2: tiling_of(task.grid, side) for side in SIDES}
    energy = profile_energy.estimate(task)
    plans = list(_plans(task, tilings, energy))
    able = [plan for plan in plans if plan.predicted_error <= tolerance]
    if not able:
        ratio = 20 * np.log10(energy.near_pixels)
        dark = f": these pixels are {ratio:.0f} dB darker than their surroundings in the same rows"
        best = askable(rounded_up(min(p.predicted_error for p in plans)))
        how = f"in complex128{dark if energy.near_pixels > 10 else ''}"
        raise ToleranceUnreachable(tolerance, best, "float64 range profiles", how=how)
    cheapest = min(able, key=lambda plan: plan.cost)
    return cheapest, tilings[cheapest.per_tile]


def _plans(task: FocusingTask, tilings: dict[int, Tiling], energy: ProfileEnergy) -> Iterator[Float64Plan]:
    """All plans. They do not depend on the memory of a device."""
    raw, grid = task.raw, task.grid
    distance = task.antennas.distance(grid.bounds)
    extent = float(np.linalg.norm(np.diff(grid.bounds, axis=0)))
    cells = np.clip(2 * float(raw.bandwidth.min()) * extent / SPEED_OF_LIGHT, 1, grid.size)
    expected = error_bounds.darkness(float(cells))
    ranges = [
        (
            error_bounds.range_error_float64(tiling.radius, distance, task.highest, order),
            cost + cost_model.FLOAT64_TILE / per_tile,
            per_tile,
            order,
        )
        for per_tile, tiling in tilings.items()
        for order, cost in cost_model.FLOAT64_SERIES.items()
    ]
    for taps in interpolator_choice.FLOAT64_TAPS:
        for oversample in interpolator_choice.FLOAT64_OVERSAMPLE:
            length = interpolator_choice.profile_length(oversample, raw.n_samples, taps)
            if length > max(interpolator_choice.LONGEST, 2 * raw.n_samples):
                continue
            interpolator = interpolation.interpolator_float64(taps, float(oversample))
            # ratio of the energy in the profiles to that at the pixels: in these data, or at the nulls to be expected
            dark = max(energy.near(length), expected)
            fixed = dark * interpolator.error
            rounding = error_bounds.sum_rounding(CHUNK, length, interpolator.edge_gain, error_bounds.FLOAT64)
            fixed += max(energy.whole_profile, dark) * rounding
            profile = cost_model.float64_profile(length)
            for error, extra, per_tile, order in ranges:
                if np.isfinite(error):
                    pairs = grid.size * (cost_model.FLOAT64_PAIR + cost_model.FLOAT64_TAP * taps + extra)
                    yield Float64Plan(interpolator, length, per_tile, order, fixed + error, pairs + profile)


def too_long(task: FocusingTask) -> str | None:
    """The reason why paths are too long for complex128 at any tolerance, or None.

    Pairs of float64 must split the phase of a path into whole cycles and a fraction.
    """
    raw, grid = task.raw, task.grid
    ends = (raw.tx, raw.rx, grid.bounds)
    longest = 2 * sum(float(np.abs(x).max()) for x in ends) + float(np.abs(raw.reference_range).max())
    cycles = 2 * float(raw.frequency.max()) / SPEED_OF_LIGHT * longest
    if cycles <= MOST_CYCLES:
        return None
    return (
        f"paths of up to {longest:.1e} m are {cycles:.1e} cycles of phase, float64 counts {MOST_CYCLES:.1e}; give "
        "positions about a nearer origin"
    )
