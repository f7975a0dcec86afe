"""Choice of the method: each plans the task, and the cheapest plan that meets the tolerance is taken."""

from __future__ import annotations

from weakref import WeakKeyDictionary

import numpy as np

from ..base.errors import ToleranceUnreachable
from ..base.report import terms_of_sum
from ..base.tolerances import askable, reachable, rounded_up
from ..model.lazy_rows import is_constant
from ..model.phase_history import PhaseHistory
from ..numerics import cost_model
from ..numerics.cost_model import CPU, DeviceClass
from ..numerics.plan import LEAST_TOLERANCE, PROFILES
from . import antenna_beam
from ._float32_methods import AIM, ROUNDING, Float32Methods
from .float64 import direct as float64_direct
from .float64 import plan as float64_plan
from .focusing_task import FocusingTask
from .kept_results import kept
from .method_choice import Candidate, MethodChoice, conditions, confirmed
from .tiling.of_grid import tiling_of

METHODS = ("auto", "direct", "factorized")
STEP_OF_SEARCH = 2.0  # ratio of the tolerances that are tried for a refusal: plans of sub-apertures take long
FLOAT64_SHARE = 1e-8  # error of gains in float64, over that in float32: 2^-29 by the digits, and a margin
GAINS_OF_FLOAT64 = "float64 gains of the antenna"
_choices: WeakKeyDictionary[PhaseHistory, dict[tuple[object, ...], MethodChoice]] = WeakKeyDictionary()


def choose(
    task: FocusingTask, method: str, tolerance: float, devices: DeviceClass = CPU, float64: bool = True
) -> MethodChoice:
    """The cheapest plan that meets `tolerance` with `method`, or with any method for "auto".

    devices  those that follow the plan
    float64  the devices have float64, for tolerances that complex64 cannot meet
    ToleranceUnreachable names the best tolerance that can be met. ValueError for samples or paths with which no
    tolerance can.

    The last choices for the same echoes are kept (`conditions`).
    """
    known = conditions(task) if is_constant(task.raw.samples) else None
    if known is None:
        return _cheapest(task, method, tolerance, devices, float64)
    key = known, method, tolerance, devices, float64
    return kept(_choices.setdefault(task.raw, {}), key, lambda: _cheapest(task, method, tolerance, devices, float64))


def _cheapest(task: FocusingTask, method: str, tolerance: float, devices: DeviceClass, float64: bool) -> MethodChoice:
    """See `choose`."""
    if method == "factorized":
        if task.weighs_pixels:
            raise ValueError(
                "method='factorized' merges rows, and cannot taper the aperture of each pixel, which a window in "
                "cross-range with a beam does, or an Antenna as beam: take method='direct' or 'auto', or "
                "window=(range, None) and a beam of an angle"
            )
        return confirmed(_factorized(task, tolerance, devices, float64))
    direct = confirmed(_direct(task, tolerance, devices, float64))
    is_merging_possible = not task.weighs_pixels and direct.dtype == np.complex64
    if method == "direct" or not is_merging_possible or task.pairs < cost_model.SEARCH_PAYS:
        return direct
    merged = Float32Methods(task, tolerance).factorized(devices)
    if isinstance(merged, MethodChoice) and merged.cost < cost_model.MERGING_PAYS * direct.cost:
        return merged
    return direct


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
        best = reachable(lambda t: confirmed(Float32Methods(task, t).direct(devices)), LEAST_TOLERANCE)
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
    best = reachable(lambda t: confirmed(Float32Methods(task, t).factorized(devices)), least, STEP_OF_SEARCH)
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
