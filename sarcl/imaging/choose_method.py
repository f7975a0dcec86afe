"""Choice of the method: each plans the task, and the cheapest plan that meets the tolerance is taken."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeAlias, TypeVar
from weakref import WeakKeyDictionary

import numpy as np

from ..base.errors import ToleranceUnreachable
from ..base.fingerprint import checksum, leaves
from ..base.report import ErrorTerm, terms_of_sum
from ..base.tolerances import askable, reachable, rounded_up
from ..model.lazy_rows import is_constant
from ..model.phase_history import PhaseHistory
from ..numerics import cost_model, error_bounds
from ..numerics import plan as numerics_plan
from ..numerics.cost_model import CPU, DeviceClass
from ..numerics.plan import LEAST_TOLERANCE, PROFILES
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
from .focusing_task import FocusingTask, per_task
from .row_norms import row_norms
from .tiling.of_grid import tiling_of
from .tiling.tiling import Tiling

METHODS = ("auto", "direct", "factorized")
ROUNDING = 0.5  # largest share of a tolerance for each error that no plan makes smaller; the plan needs the rest
MOST_CHOICES = 8  # that are kept for the same echoes, and plans for the same geometry
STEPS = 2**10  # of a tolerance between two powers of 2: of echoes that differ little the plan is the same
STEP_OF_SEARCH = 2.0  # ratio of the tolerances that are tried for a refusal: plans of sub-apertures take long
FLOAT64_SHARE = 1e-8  # error of gains in float64, over that in float32: 2^-29 by the digits, and a margin
GAINS, SUMS = "float32 gains of the antenna", "rounding of float32 sums"
GAINS_OF_FLOAT64, AIM = "float64 gains of the antenna", "aim it at the grid, or give the beam an angle"
COORDINATES, NEAR_ORIGIN = "float64 coordinates of a plane's pixels", "put the origin near the scene"


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


Planned: TypeAlias = tuple[ImagePlan, Tiling]
Planner: TypeAlias = Callable[[FocusingTask, float, DeviceClass], Planned]

_choices: WeakKeyDictionary[PhaseHistory, dict[tuple[object, ...], MethodChoice]] = WeakKeyDictionary()
kept_plans: dict[tuple[object, ...], Planned] = {}  # of the last geometries, whatever the samples
Result = TypeVar("Result")
Candidate: TypeAlias = (
    MethodChoice | ToleranceUnreachable
)  # a plan, or its refusal: `choose` raises the one that counts


def choose(
    task: FocusingTask, method: str, tolerance: float, devices: DeviceClass = CPU, float64: bool = True
) -> MethodChoice:
    """The cheapest plan that meets `tolerance` with `method`, or with any method for "auto".

    devices  those that follow the plan
    float64  the devices have float64, for tolerances that complex64 cannot meet
    ToleranceUnreachable names the best tolerance that can be met. ValueError for samples or paths with which no
    tolerance can.

    The last choices for the same echoes are kept (`_conditions`).
    """
    conditions = _conditions(task) if is_constant(task.raw.samples) else None
    if conditions is None:
        return _cheapest(task, method, tolerance, devices, float64)
    key = conditions, method, tolerance, devices, float64
    return _kept(_choices.setdefault(task.raw, {}), key, lambda: _cheapest(task, method, tolerance, devices, float64))


def _kept(known: dict[tuple[object, ...], Result], key: tuple[object, ...], make: Callable[[], Result]) -> Result:
    """The result of a key, made where it is not known; the last MOST_CHOICES are kept."""
    result = known.pop(key, None)
    known[key] = result = make() if result is None else result  # the last one
    for oldest in list(known)[:-MOST_CHOICES]:  # a copy: other threads may choose at the same time
        known.pop(oldest, None)
    return result


@per_task
def _conditions(task: FocusingTask) -> str | None:
    """Checksum of all that a choice follows from beside the samples; None where it cannot be kept.

    That is where an option has no checksum, and for listed points, which take memory.
    """
    if not task.grid.is_plane:
        return None
    raw, fields = task.raw, (getattr(task, name) for name in task.__dataclass_fields__ if name != "raw")
    rows = raw.frequency, raw.frequency_step, raw.time, raw.tx_channel, raw.rx_channel, raw.polarization
    try:
        return checksum(*rows, *(leaf for field in fields for leaf in leaves(field)))
    except TypeError:
        return None


def _cheapest(task: FocusingTask, method: str, tolerance: float, devices: DeviceClass, float64: bool) -> MethodChoice:
    """See `choose`."""
    if method == "factorized":
        if task.weighs_pixels:
            raise ValueError(
                "method='factorized' merges rows, and cannot taper the aperture of each pixel, which a window in "
                "cross-range with a beam does, or an Antenna as beam: take method='direct' or 'auto', or "
                "window=(range, None) and a beam of an angle"
            )
        return _confirmed(_factorized(task, tolerance, devices, float64))
    direct = _confirmed(_direct(task, tolerance, devices, float64))
    is_merging_possible = not task.weighs_pixels and direct.dtype == np.complex64
    if method == "direct" or not is_merging_possible or task.pairs < cost_model.SEARCH_PAYS:
        return direct
    merged = Float32Methods(task, tolerance).factorized(devices)
    if isinstance(merged, MethodChoice) and merged.cost < cost_model.MERGING_PAYS * direct.cost:
        return merged
    return direct


def _confirmed(candidate: Candidate) -> MethodChoice:
    """The choice; the refusal is raised."""
    if isinstance(candidate, ToleranceUnreachable):
        raise candidate
    return candidate


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
        conditions, rounded = _conditions(self.task), _rounded_down(self.inner)
        if conditions is not None and rounded > 0:
            key = conditions, make_plan, rounded, devices
            try:
                return _kept(kept_plans, key, lambda: make_plan(self.task, rounded, devices))
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


def _rounded_down(tolerance: float) -> float:
    """The largest tolerance of STEPS between two powers of 2 that is not above `tolerance`."""
    mantissa, exponent = np.frexp(tolerance)
    return float(np.ldexp(np.floor(mantissa * 2 * STEPS) / (2 * STEPS), exponent))


def _direct(task: FocusingTask, tolerance: float, devices: DeviceClass, float64: bool) -> Candidate:
    """The direct method, in complex64 where that meets the tolerance, else in complex128 where the devices can."""
    if tolerance >= LEAST_TOLERANCE:
        candidate = Float32Methods(task, tolerance).direct(devices)
        if isinstance(candidate, MethodChoice):
            return candidate
        remedy = _without_float64(task, float64)
        if remedy:
            return candidate if candidate.remedy else candidate.restated(tolerance, None, remedy)
    elif not float64:
        best = reachable(lambda t: _confirmed(Float32Methods(task, t).direct(devices)), LEAST_TOLERANCE)
        return ToleranceUnreachable(tolerance, best, "float32", _without_float64(task, float64), "without float64")
    return in_float64(task, tolerance)


def _without_float64(task: FocusingTask, float64: bool) -> str:
    """Remedy where complex64 cannot meet a tolerance and no sums in complex128 can be made; "": they can."""
    if not float64:
        return float64_direct.remedy()
    return float64_plan.too_long(task) or ""


def _factorized(task: FocusingTask, tolerance: float, devices: DeviceClass, float64: bool) -> Candidate:
    """Sub-apertures, in complex64 alone. Where they cannot meet the tolerance, the best one is found by a search."""
    candidate: Candidate = ToleranceUnreachable(tolerance, None, PROFILES, how="with sub-apertures")
    if tolerance >= LEAST_TOLERANCE:
        candidate = Float32Methods(task, tolerance).factorized(devices)
    if isinstance(candidate, MethodChoice):
        return candidate
    direct = _direct(task, tolerance, devices, float64)
    least = max(tolerance, LEAST_TOLERANCE)
    best = reachable(lambda t: _confirmed(Float32Methods(task, t).factorized(devices)), least, STEP_OF_SEARCH)
    if isinstance(direct, MethodChoice):
        remedy = "method='direct' can"
    elif best is None:
        remedy = f"method='direct' cannot either{': ' if direct.remedy else ''}{direct.remedy}"
    else:
        remedy = ""
    return candidate.restated(tolerance, best, remedy)


def in_float64(task: FocusingTask, tolerance: float) -> Candidate:
    """The direct method in float64."""
    errors = {}
    if task.antenna is not None:
        radius = tiling_of(task.grid, max(float64_plan.SIDES)).radius
        errors[GAINS_OF_FLOAT64] = antenna_beam.rounding(task, radius, FLOAT64_SHARE)
    gains = sum(errors.values())
    if not gains <= ROUNDING * tolerance:
        best = askable(rounded_up(gains / ROUNDING)) if np.isfinite(gains) else None
        how = f"in complex128: gains of the antenna have an error of {gains:.1g}"
        return ToleranceUnreachable(tolerance, best, GAINS_OF_FLOAT64, AIM, how)
    try:
        plan, tiling = float64_plan.make_plan(task, tolerance - gains)
    except ToleranceUnreachable as refusal:
        best = refusal.best and askable(rounded_up(refusal.best + gains))
        return refusal if not gains else refusal.restated(tolerance, best)
    terms = terms_of_sum({"float64 range profiles": float(plan.predicted_error), **errors})
    cost, error = cost_model.FLOAT64_UNIT * plan.cost / task.grid.size, plan.predicted_error + gains
    return MethodChoice("direct", plan, tiling, float64_direct.DirectFloat64, error, terms, cost)
