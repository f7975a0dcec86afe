"""Forecast of a plan of echoes: rows, bytes, seconds and error before the work.

Where the scene is prepared quickly beside the whole job, it is, and kept for the run: the errors are then those of the
run, and a few pulses are computed and timed. Else preparing it is a large part of the work. Then errors are the shares
of the tolerance that the plan allots, which those of the run do not exceed, and seconds follow from the numbers of
pieces and pulses (numerics/cost_model.py), to about a factor of three.
"""

from __future__ import annotations

import time
import warnings
from dataclasses import replace
from typing import Any

import numpy as np

from ..base.errors import NotApplicable, NothingSeen, SarclWarning, ToleranceUnreachable, warned_once
from ..base.forecast import Forecast
from ..base.report import SMALLER_TOLERANCE, ErrorTerm, root_sum_square
from ..base.stage_timer import Clock
from ..base.text import duration
from ..model.phase_history import PhaseHistory
from .echo_output import bytes_of, pulses_at_once
from .echo_plan import EchoPlan, PlannedEchoes
from .echo_work import EchoWork
from .scene_echoes import Added, SceneEchoes
from .scene_plan import SHADOWS, parts_of, samples_shadows
from .spectral.spectral_parts import plan_parts
from .spectral.spectral_task import spectral_task

SHARE, LEAST = 0.06, 0.035  # of the modelled job, and seconds: preparing the scene may take the larger of these
TIMED_SHARE, LEAST_TIMED = 0.02, 4e-3  # of the modelled job, and seconds, of pulses that are timed
MOST_PLANS = 64  # channels and receivers whose plans are made: of more, those of the pulses that are timed
SPECTRAL = 0.06  # s: shortest plan of spectral_echo; it is made where it takes a small share of the echoes
SPECTRAL_SHARE = 0.04  # of the seconds of the echoes, for the plan of spectral_echo


def forecast_of(plan: EchoPlan) -> Forecast[PhaseHistory]:
    """The Forecast of a plan.

    plan["contributions"]  about the number of pairs of scatterer, pulse and channel that will be added up
    plan["spectral_echo"]  about the seconds of `spectral_echo` instead, or why it refuses or was not planned
    """
    clock = Clock(plan.seconds)
    request = replace(plan.request(clock), progress=None)
    with warned_once():
        planned = plan.plan_scene(request)
        work = EchoWork.of(planned)
        clock.lap("plan")
        if work.preparing <= max(SHARE * work.seconds, LEAST):
            planned, prepared = planned.with_scene()
            terms, words, rate, contributions = _timed(plan, planned, prepared, work)
        else:
            terms, words = _allotted(planned), planned.scene.describe()
            rate, contributions = work.preparing + work.adding, work.contributions
    clock.lap("plan")
    spent = sum(clock.seconds.values())
    seconds = spent + rate
    details = plan.channels.words(planned.method, words)  # type: ignore[arg-type]
    shape = plan.channels.shape
    return Forecast(
        method="pulse by pulse",
        plan=details | {"contributions": contributions, "spectral_echo": _spectral(plan, work, seconds)},
        seconds=seconds,
        bytes=bytes_of(shape),
        predicted_error=root_sum_square(terms),
        error_terms=terms,
        n_rows=int(np.prod(shape[:-1], dtype=np.int64)),
        n_samples=shape[-1],
        planning=spent,
        run=replace(plan, seconds=clock.seconds, planned=planned).run,
    )


def _timed(
    plan: EchoPlan, planned: PlannedEchoes, prepared: SceneEchoes, work: EchoWork
) -> tuple[tuple[ErrorTerm, ...], dict[str, Any], float, float]:
    """Error terms, words, and from a few pulses the seconds and contributions of all."""
    shape, method = plan.channels.shape, planned.method
    n_pulses, most = shape[0], max(TIMED_SHARE * work.seconds, LEAST_TIMED)
    n = int(np.clip(most / (work.adding / n_pulses), 1, max(1, n_pulses // 8)))
    quiet = replace(prepared, request=replace(prepared.request, clock=Clock()))

    def timed(first: int, n: int) -> tuple[float, Added]:
        block, begin = np.zeros((n, *shape[1:]), np.complex64), time.perf_counter()
        added = method.fill(quiet, block, first, 0, len(quiet) * n)
        return time.perf_counter() - begin, added

    for first in ((n_pulses - n) // 2, 0, n_pulses - n):  # elsewhere more may be seen
        _, added = timed(first, 1)  # builds kernels, plans
        if added.counts.contributing:
            break
    single, _ = timed(first, 1)
    several, added = timed(first, n) if n > 1 else (single, added)
    slope = max((several - single) / (n - 1), 0.5 * several / n) if n > 1 else single
    at_once = min(
        method.pulses(prepared.request.budget), pulses_at_once(shape, plan.task.options.out, prepared.request.budget)
    )
    blocks = -(-n_pulses // at_once)
    if blocks * method.runs // n_pulses <= MOST_PLANS:
        all_planned = Added()
        for start in range(0, n_pulses, at_once):
            all_planned += method.planned(quiet, start, min(at_once, n_pulses - start))
        added = replace(all_planned, counts=added.counts)
    total = blocks * max(single - slope, 0.0) + slope * n_pulses
    return added.error_terms, added.plan, total, added.counts.contributing / n * n_pulses


def _allotted(planned: PlannedEchoes) -> tuple[ErrorTerm, ...]:
    """Shares of the tolerance that points, facets and their shadows have: no error of the run is larger."""
    scene = planned.scene
    request, share = scene.request, scene.error_budget
    terms = []
    if len(scene.seen.scene.positions) and request.same:
        terms.append(ErrorTerm("points", share, SMALLER_TOLERANCE))
    if scene.subdivision is not None:
        terms.append(ErrorTerm("facets", share, SMALLER_TOLERANCE))
        if samples_shadows(request, scene.seen):
            most = SHADOWS * request.tolerance / parts_of(scene.seen.scene)
            terms.append(ErrorTerm("shadows", most, SMALLER_TOLERANCE))
    return planned.method.between(tuple(terms))


def _spectral(plan: EchoPlan, work: EchoWork, seconds: float) -> str:
    """About the seconds of spectral_echo with these arguments, or why it refuses them or was not planned."""
    task = plan.task
    try:
        spectral = spectral_task(task.original, task.waveform, task.given_track, task.options)
        if work.cutting > SPECTRAL_SHARE * seconds:
            return "not planned: its facets would have to be cut and illuminated first"
        if SPECTRAL > SPECTRAL_SHARE * seconds:
            return f"not planned: echo takes about {duration(seconds)}"
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", SarclWarning)  # those of the mesh came with the plan of echo
            clock = Clock()
            parts = plan_parts(
                spectral, replace(spectral.request, clock=clock, progress=None), SPECTRAL_SHARE * seconds
            )
    except (NotApplicable, NothingSeen, ToleranceUnreachable) as refused:
        return str(refused)
    return f"about {duration(sum(clock.seconds.values()) + parts.seconds())}"
