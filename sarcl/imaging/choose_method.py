"""Choice of the method: each plans the task, and the cheapest plan that meets the tolerance is taken."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ..base.errors import ToleranceUnreachable
from ..base.report import ErrorTerm, terms_of_sum
from ..base.tolerances import askable, reachable, rounded_up
from ..base.validation import LARGEST_TOLERANCE
from ..numerics import cost_model, error_bounds
from ..numerics import plan as numerics_plan
from ..numerics.cost_model import CPU, DeviceClass
from ..numerics.plan import LEAST_TOLERANCE
from ..numerics.range_profiles import TINY
from ..opencl.device import Device
from . import antenna_beam, profile_energy
from .direct import direct as direct_method
from .direct import tile_kernels
from .engine import Engine, ImagePlan
from .factorized import plan as factorized_plan
from .factorized.factorized import Factorized
from .factorized.plan import FactorPlan
from .float64 import direct as float64_direct
from .float64 import plan as float64_plan
from .focusing_task import FocusingTask
from .tiling.of_grid import tiling_of
from .tiling.tiling import Tiling

METHODS = ("auto", "direct", "factorized")
NEAR_ORIGIN = "put the origin near the scene"
ROUNDING = 0.5  # largest share of a tolerance for rounding errors from echoes that lie away from the pixels


@dataclass(frozen=True, eq=False)
class MethodChoice:
    """A method, its plan and tiling for one task, and the class of its engine.

    engine           called as engine(device, task, plan, tiling)
    predicted_error  bound of the relative error, for the energy of these rows at these pixels
    error_terms      its parts
    cost             per contribution, relative to one with linear interpolation and ranges in float32
    """

    method: str
    plan: ImagePlan
    tiling: Tiling
    engine: type[Engine]
    predicted_error: float
    error_terms: tuple[ErrorTerm, ...]
    cost: float

    @property
    def dtype(self) -> type[np.complexfloating]:
        """Data type of the pixels."""
        return self.engine.dtype

    @property
    def unit(self) -> int:
        """Number of consecutive bands that share work: blocks that begin elsewhere cost more time."""
        return self.tiling.root_bands(self.plan.factors[0]) if isinstance(self.plan, FactorPlan) else 1

    def on(self, device: Device, task: FocusingTask) -> Engine:
        """The engine on one device."""
        return self.engine(device, task, self.plan, self.tiling)


def choose(
    task: FocusingTask, method: str, tolerance: float, on: DeviceClass = CPU, float64: bool = True
) -> MethodChoice:
    """The cheapest plan that meets `tolerance` with `method`, or with any method for "auto".

    on       the devices that follow the plan
    float64  the devices have float64, for tolerances that complex64 cannot meet
    ToleranceUnreachable names the best tolerance that can be met. ValueError for samples or paths with which no
    tolerance can.
    """
    if method == "factorized":
        if task.weighs_pixels:
            raise ValueError(
                "method='factorized' merges rows, and cannot taper the aperture of each pixel, which a window in "
                "cross-range with a beam does, or an Antenna as beam: take method='direct' or 'auto', or "
                "window=(range, None) and a beam of an angle"
            )
        return _factorized(task, tolerance, on, float64)
    direct = _direct(task, tolerance, on, float64)
    if (
        method == "direct"
        or task.weighs_pixels
        or direct.dtype != np.complex64
        or task.pairs < cost_model.SEARCH_PAYS
    ):
        return direct
    try:
        merged = _Float32(task, tolerance).factorized(on)
    except ToleranceUnreachable:
        return direct
    return merged if merged.cost < cost_model.MERGING_PAYS * direct.cost else direct


class _Float32:
    """Plans in complex64 for one task and tolerance. ValueError where samples are too small for complex64.

    Errors of interpolation and rounding are proportional to the energy of the range profiles, the tolerance to the
    energy at the pixels: `inner` is the tolerance that is left for a plan. `coordinates` is the error of planes far
    from the origin, which adds to the others in squares: it is independent from pixel to pixel.
    """

    def __init__(self, task: FocusingTask, tolerance: float) -> None:
        strongest = float(profile_energy.row_norms(task).max()) / np.sqrt(task.raw.n_samples)
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
        self._aim(self.energy.darkness())

    def _aim(self, near: float) -> None:
        """Leave a plan what it may take of the tolerance where its errors are `near` times those of its kernels."""
        self.near = near
        self.rounding = error_bounds.sum_rounding(tile_kernels.CHUNK, self.task.raw.n_samples) * max(
            self.energy.whole_profile - near, 0.0
        )
        left = np.sqrt(max(self.tolerance**2 - self.coordinates**2, 0.0))
        self.inner = float(left - self.rounding - self.gains) / near

    def _planned(self, make: Callable[[float], tuple[ImagePlan, Tiling]]) -> tuple[ImagePlan, Tiling]:
        """The plan that `make` finds for the tolerance that is left. How the errors of few rows add up depends on the
        length of its profiles: where they add up to more, there is less left."""
        while True:
            made = make(self.inner)
            near = self.energy.darkness(made[0].length)
            if near <= self.near:
                return made
            self._aim(near)

    def direct(self, on: DeviceClass) -> MethodChoice:
        """Every pair of row and pixel. ToleranceUnreachable names the best tolerance in complex64."""
        self._must_round_less("in complex64", self._best)
        radius = tiling_of(self.task.grid, 8).radius  # of the smallest tiles
        if not self.task.resolves_beam(radius):
            raise ToleranceUnreachable(
                self.tolerance, None, "float32 differences in a beam", "take smaller pixels, or a device with float64",
                how=f"in complex64: beam is narrower than float32 resolves in tiles of {radius:.3g} m so near a track",
            )  # fmt: skip
        try:
            made = self._planned(lambda left: direct_method.make_plan(self.task, left, on))
        except ToleranceUnreachable as refused:
            raise refused.restated(self.tolerance, self._best()) from None
        return self._offer("direct", made, direct_method.Direct)

    def factorized(self, on: DeviceClass) -> MethodChoice:
        """With sub-apertures. ToleranceUnreachable gives the reason, but no best tolerance, which takes a search."""
        self._must_round_less("with sub-apertures", lambda: None)
        try:
            made = self._planned(lambda left: factorized_plan.make_plan(self.task, left, on))
        except ToleranceUnreachable as refused:
            raise refused.restated(self.tolerance, None) from None
        return self._offer("factorized", made, Factorized)

    def _best(self) -> float | None:
        """The smallest tolerance that `direct` meets: rounding takes half of it at most, and the plan the rest."""
        n_samples = self.task.raw.n_samples
        least = max(
            LEAST_TOLERANCE,
            numerics_plan.least(n_samples, tile_kernels.CHUNK) * self.energy.largest(n_samples) + self.rounding,
        )
        least = np.hypot(least + self.gains, self.coordinates)
        least = max(least, *(error / ROUNDING for error in (self.rounding, self.coordinates, self.gains)))
        return askable(rounded_up(float(least) * (1 + 1e-9)))

    def _must_round_less(self, how: str, best: Callable[[], float | None]) -> None:
        """ToleranceUnreachable where rounding alone takes too much. best()  what can be met: found where it is not."""
        if not self.gains <= ROUNDING * self.tolerance:
            raise ToleranceUnreachable(
                self.tolerance, best(), "float32 gains of the antenna", "aim it at the grid, or give the beam an angle",
                how=f"{how}: gains of the antenna have an error of {self.gains:.1g}",
            )  # fmt: skip
        if not self.coordinates <= ROUNDING * self.tolerance:
            raise ToleranceUnreachable(
                self.tolerance, best(), "float64 coordinates of a plane's pixels", NEAR_ORIGIN,
                how=f"{how}: coordinates this large are rounded by {self.coordinates:.1g} rad of phase",
            )  # fmt: skip
        if not self.rounding <= ROUNDING * self.tolerance:
            ratio = 20 * np.log10(self.energy.whole_profile)
            dark = f"these pixels are {ratio:.0f} dB darker than what else is in the same rows"
            raise ToleranceUnreachable(self.tolerance, best(), "rounding of float32 sums", how=f"{how}: {dark}")

    def _offer(self, name: str, made: tuple[ImagePlan, Tiling], engine: type[Engine]) -> MethodChoice:
        errors = {
            "range profiles": self.near * float(made[0].predicted_error),
            "rounding of float32 sums": self.rounding,
            "float32 gains of the antenna": self.gains,
        }
        terms = terms_of_sum(errors)
        if self.coordinates:
            terms += (ErrorTerm("float64 coordinates of a plane's pixels", self.coordinates, NEAR_ORIGIN),)
        error = float(np.hypot(sum(errors.values()), self.coordinates))
        return MethodChoice(name, *made, engine, min(error, self.tolerance), terms, made[0].cost)


def _direct(task: FocusingTask, tolerance: float, on: DeviceClass, float64: bool) -> MethodChoice:
    """The direct method, in complex64 where that meets the tolerance, else in complex128 where the devices can."""
    if tolerance >= LEAST_TOLERANCE:
        try:
            return _Float32(task, tolerance).direct(on)
        except ToleranceUnreachable as refused:
            remedy = _without_float64(task, float64)
            if remedy and not refused.remedy:
                raise refused.restated(tolerance, None, remedy) from None
            if remedy:
                raise
    elif task.antenna is not None:
        best = reachable(lambda t: _Float32(task, t).direct(on), LEAST_TOLERANCE)
        raise ToleranceUnreachable(
            tolerance, best, "float32 gains of the antenna", "give the beam an angle", how="with an antenna"
        )
    elif not float64:
        best = reachable(lambda t: _direct(task, t, on, False), LEAST_TOLERANCE)
        raise ToleranceUnreachable(tolerance, best, "float32", float64_direct.remedy(), how="without float64")
    return _float64(task, tolerance)


def _without_float64(task: FocusingTask, float64: bool) -> str:
    """What to do where complex64 cannot meet a tolerance and no sums in complex128 can be made; "": they can."""
    if task.antenna is not None:
        return "give the beam an angle"
    if not float64:
        return float64_direct.remedy()
    return float64_plan.too_long(task) or ""


def _factorized(task: FocusingTask, tolerance: float, on: DeviceClass, float64: bool) -> MethodChoice:
    """Sub-apertures, in complex64 alone. Where they cannot meet the tolerance, the best one is found by a search."""
    try:
        if tolerance < LEAST_TOLERANCE:
            raise ToleranceUnreachable(tolerance, None, "float32 range profiles", how="with sub-apertures")
        return _Float32(task, tolerance).factorized(on)
    except ToleranceUnreachable as refused:
        remedy, otherwise = "method='direct' can", ""
        try:
            _direct(task, tolerance, on, float64)
        except ToleranceUnreachable as direct:
            remedy = ""
            otherwise = f"method='direct' cannot either{': ' if direct.remedy else ''}{direct.remedy}"
        best = _search(lambda t: _Float32(task, t).factorized(on), max(tolerance, LEAST_TOLERANCE))
        raise refused.restated(tolerance, best, remedy or (otherwise if best is None else "")) from None


def _search(plan: Callable[[float], object], above: float) -> float | None:
    """A tolerance of `above` or more that `plan` meets, at most 1.5 times the smallest one; None: none that is allowed.

    Plans take long, so few are tried: each at twice the tolerance before, then one halfway back.
    """

    def met(tolerance: float) -> bool:
        try:
            plan(tolerance)
        except ToleranceUnreachable:
            return False
        return True

    failed, best = 0.0, rounded_up(above)
    while not met(best):
        if best >= LARGEST_TOLERANCE:
            return None
        failed, best = best, min(rounded_up(2 * best), LARGEST_TOLERANCE)
    middle = rounded_up(float(np.sqrt(best * failed))) if failed else best
    return middle if middle < best and met(middle) else best


def _float64(task: FocusingTask, tolerance: float) -> MethodChoice:
    """The direct method in float64."""
    plan, tiling = float64_plan.make_plan(task, tolerance)
    cost = cost_model.FLOAT64_UNIT * plan.cost / task.grid.size
    return MethodChoice(
        "direct", plan, tiling, float64_direct.DirectFloat64, plan.predicted_error,
        terms_of_sum({"float64 range profiles": float(plan.predicted_error)}), cost,
    )  # fmt: skip
