"""Plans in complex64 for one task and tolerance: what rounding and gains leave of it for a plan."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeAlias

import numpy as np

from ..base.errors import ToleranceUnreachable
from ..base.report import ErrorTerm, terms_of_sum
from ..base.tolerances import askable, rounded_up
from ..numerics import error_bounds
from ..numerics import plan as numerics_plan
from ..numerics.cost_model import DeviceClass
from ..numerics.plan import LEAST_TOLERANCE
from ..numerics.range_profiles import TINY
from . import antenna_beam, profile_energy
from .direct import direct as direct_method
from .direct import tile_kernels
from .engine import Engine, ImagePlan
from .factorized import plan as factorized_plan
from .factorized.factorized import Factorized
from .focusing_task import FocusingTask
from .kept_results import kept
from .method_choice import Candidate, MethodChoice, Planned, conditions, kept_plans, rounded_down
from .row_norms import row_norms
from .tiling.of_grid import tiling_of
from .tiling.tiling import Tiling

ROUNDING = 0.5  # largest share of a tolerance for each error that no plan makes smaller; the plan needs the rest
GAINS, SUMS = "float32 gains of the antenna", "rounding of float32 sums"
AIM = "aim it at the grid, or give the beam an angle"
COORDINATES, NEAR_ORIGIN = "float64 coordinates of a plane's pixels", "put the origin near the scene"
Planner: TypeAlias = Callable[[FocusingTask, float, DeviceClass], Planned]


class Float32Methods:
    """Plans in complex64 for one task and tolerance. ValueError where samples are too small for complex64.

    Errors of interpolation and rounding are proportional to the energy of the range profiles, the tolerance to the
    energy at the pixels: `inner` is the tolerance that is left for a plan. `coordinates` is the error of planes far
    from the origin, which adds to the others in squares: it is independent from pixel to pixel.
    """

    def __init__(self, task: FocusingTask, tolerance: float) -> None:
        strongest = float(row_norms(task).max()) / np.sqrt(task.raw.n_samples)
        if 0 < strongest < TINY:
            raise ValueError(
                f"samples times weights reach {strongest:.1e}; complex64 loses digits below {TINY:.0e}: scale the "
                f"samples up, or ask for a tolerance below {LEAST_TOLERANCE:.0e}, which is met in complex128"
            )
        self.task, self.tolerance, self.energy = task, tolerance, profile_energy.estimate(task)
        self.gains = 0.0
        if task.antenna is not None:
            self.gains = antenna_beam.rounding(task, tiling_of(task.grid, 32).radius)  # of the largest tiles
        self.coordinates = 0.0
        if task.grid.is_plane:  # listed points are taken as they are
            farthest = float(np.abs(task.grid.bounds).max())
            self.coordinates = error_bounds.coordinate_rounding(farthest, task.highest)
        self._divide_tolerance(self.energy.darkness())

    def direct(self, devices: DeviceClass) -> Candidate:
        """Every pair of row and pixel; a refusal names the best tolerance in complex64."""
        refusal = self._refusal("in complex64")
        radius = tiling_of(self.task.grid, 8).radius  # of the smallest tiles
        if refusal is None and not self.task.resolves_beam(radius):
            how = f"in complex64: beam is narrower than float32 resolves in tiles of {radius:.3g} m so near a track"
            remedy = "take smaller pixels, or a device with float64"
            return ToleranceUnreachable(self.tolerance, None, "float32 differences in a beam", remedy, how)
        candidate = refusal or self._planned("direct", direct_method.make_plan, direct_method.Direct, devices)
        if isinstance(candidate, ToleranceUnreachable):
            return candidate.restated(self.tolerance, self.best())
        return candidate

    def factorized(self, devices: DeviceClass) -> Candidate:
        """With sub-apertures; a refusal gives the reason, but no best tolerance, which takes a search."""
        refusal = self._refusal("with sub-apertures")
        candidate = refusal or self._planned("factorized", factorized_plan.make_plan, Factorized, devices)
        if isinstance(candidate, ToleranceUnreachable):
            return candidate.restated(self.tolerance, None)
        return candidate

    def _refusal(self, representation: str) -> ToleranceUnreachable | None:
        """Refusal by the largest of the errors that no plan makes smaller and that take more than ROUNDING of the
        tolerance."""
        errors = (
            ErrorTerm(GAINS, self.gains, AIM),
            ErrorTerm(COORDINATES, self.coordinates, NEAR_ORIGIN),
            ErrorTerm(SUMS, self.rounding, ""),
        )
        excessive = [error for error in errors if not error.value <= ROUNDING * self.tolerance]
        if not excessive:
            return None
        largest, ratio = max(excessive, key=lambda error: error.value), 20 * np.log10(self.energy.whole_profile)
        reason = {
            GAINS: f"gains of the antenna have an error of {self.gains:.1g}",
            COORDINATES: f"coordinates this large are rounded by {self.coordinates:.1g} rad of phase",
            SUMS: f"these pixels are {ratio:.0f} dB darker than what else is in the same rows",
        }[largest.name]
        how = f"{representation}: {reason}"
        return ToleranceUnreachable(self.tolerance, None, largest.name, largest.remedy, how)

    def best(self) -> float | None:
        """The smallest tolerance that `direct` meets: rounding takes half of it at most, and the plan the rest."""
        n_samples = self.task.raw.n_samples
        least = max(
            LEAST_TOLERANCE,
            numerics_plan.least(n_samples, tile_kernels.CHUNK) * self.energy.largest(n_samples) + self.rounding,
        )
        least = np.hypot(least + self.gains, self.coordinates)
        least = max(least, *(error / ROUNDING for error in (self.rounding, self.coordinates, self.gains)))
        return askable(rounded_up(float(least) * (1 + 1e-9)))

    def _planned(self, method: str, make_plan: Planner, engine: type[Engine], devices: DeviceClass) -> Candidate:
        """The method with the plan for the tolerance that is left for it, or the planner's refusal.

        How the errors of few rows add up depends on the length of the plan's profiles: where they add up to more, less
        of the tolerance is left, for another plan.
        """
        while True:
            try:
                plan, tiling = self._plan(make_plan, devices)
            except ToleranceUnreachable as refusal:
                return refusal
            near = self.energy.darkness(plan.length)
            if near <= self.near:
                return self._choice(method, plan, tiling, engine)
            self._divide_tolerance(near)

    def _plan(self, make_plan: Planner, devices: DeviceClass) -> Planned:
        """The planner's plan for `inner`, rounded down to one of STEPS: it is kept, for other samples of this geometry.

        Planned for `inner` itself where the smaller tolerance cannot be met.
        """
        known, rounded = conditions(self.task), rounded_down(self.inner)
        if known is not None and rounded > 0:
            key = known, make_plan, rounded, devices
            try:
                return kept(kept_plans, key, lambda: make_plan(self.task, rounded, devices))
            except ToleranceUnreachable:
                if rounded == self.inner:
                    raise
        return make_plan(self.task, self.inner, devices)

    def _divide_tolerance(self, near: float) -> None:
        """Set `inner`, what is left of the tolerance for a plan whose errors are `near` times those of its kernels."""
        self.near = near
        self.rounding = error_bounds.sum_rounding(tile_kernels.CHUNK, self.task.raw.n_samples) * max(
            self.energy.whole_profile - near, 0.0
        )
        profiles_and_sums = np.sqrt(max(self.tolerance**2 - self.coordinates**2, 0.0))
        self.inner = float(profiles_and_sums - self.rounding - self.gains) / near

    def _choice(self, method: str, plan: ImagePlan, tiling: Tiling, engine: type[Engine]) -> MethodChoice:
        errors = {"range profiles": self.near * float(plan.predicted_error), SUMS: self.rounding, GAINS: self.gains}
        terms = terms_of_sum(errors)
        if self.coordinates:
            terms += (ErrorTerm(COORDINATES, self.coordinates, NEAR_ORIGIN),)
        error = float(np.hypot(sum(errors.values()), self.coordinates))
        return MethodChoice(method, plan, tiling, engine, min(error, self.tolerance), terms, plan.cost)
