"""Forecast of a plan of echoes: rows, bytes, seconds and error before the work.

Where the scene is prepared quickly beside the whole job, it is, and kept for the run: the errors are then those of the
run, and a few pulses are computed and timed. Else preparing it is a large part of the work. Then errors are the shares
of the tolerance that the plan allots, which those of the run do not exceed, and seconds follow from the numbers of
pieces and pulses (sarcl/numerics/cost_model.py), to about a factor of three.
"""

from __future__ import annotations

import time
import warnings
from collections.abc import Callable
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from ..base.errors import NotApplicable, NothingSeen, SarclWarning, ToleranceUnreachable
from ..base.forecast import Forecast
from ..base.report import SMALLER_TOLERANCE, ErrorTerm, root_sum_square
from ..base.stage_timer import Clock
from ..base.text import duration
from ..model.phase_history import PhaseHistory
from ..numerics import cost_model
from ._single_channel import SingleEchoes
from .bounces.bounce_spreader import PULSES_AT_ONCE, BounceSpreader
from .echo_output import bytes_of
from .echo_task import EchoTask
from .edges.edge_echoes import EdgeEchoes, PreparedEdges
from .factorized.spreader import FactorizedSpreader
from .planned_echoes import EchoWork, Method, PlannedEchoes
from .scene_echoes import Added, SceneEchoes
from .scene_plan import EDGES, SHADOWS, ScenePlan, samples_shadows
from .scene_preparation import bounced_facets, warn_of_shapes
from .spectral.spectral_task import spectral_task
from .spreading import ChannelView

TIMED_SHARE, LEAST_TIMED = 0.02, 4e-3  # of the modelled job, and seconds, of pulses that are timed
SLOWER = 4.0  # over the modelled seconds: pulses that take longer have built kernels or waited; they are timed again
MORE = 2  # times as many pulses, at least, are timed then: what a call costs by itself counts once per call of the run
MOST_PLANS = 64  # channels and receivers whose plans are made: of more, those of the pulses that are timed
JUDGING = 0.02  # of the modelled job: meshes are judged, and warned of, where that takes no more
FEW_SHARE, MOST_FEW = 16, 8  # of n pulses, n/16 and at most 8 are timed, of several reflections and of edges
SPECTRAL_SHARE = 0.04  # of the modelled job: spectral_echo is planned where that takes no more


class Estimate(NamedTuple):
    """Error terms and words of a plan, and about its seconds and contributions, without planning."""

    error_terms: tuple[ErrorTerm, ...]
    words: dict[str, Any]
    seconds: float
    contributions: float


def forecast_of(
    task: EchoTask, planned: PlannedEchoes, clock: Clock, run_of: Callable[[PlannedEchoes], Callable[[], PhaseHistory]]
) -> Forecast[PhaseHistory]:
    """The Forecast of planned echoes.

    The scene is prepared by every device, at the same time or by one after the other; pulses are shared.

    clock   of planning;  run_of  gives the function that carries out a plan
    plan["contributions"]  about the number of pairs of scatterer, pulse and channel that will be added up
    plan["method"]  "spread or factorized": of many facets that are not cut yet
    plan["spectral_echo"]  about the seconds of `spectral_echo` instead, or why it refuses or was not planned
    """
    shape = planned.channels.shape
    work = EchoWork.of(planned.scene, planned.method.runs, shape[-1])
    limits = task.request.limits
    if work.preparing <= max(limits.prepared_share * work.seconds, limits.prepared_seconds):
        planned, prepared = planned.with_scene()
        clock.lap("plan")
        estimate = _timed(planned, prepared, work)
    else:
        known = planned.scene.describe() | ({"facets": round(work.pieces)} if work.pieces else {})
        if 1e-6 * cost_model.JUDGED_FACET * len(planned.scene.seen.original.triangles) <= JUDGING * work.seconds:
            known |= warn_of_shapes(planned.scene)
        clock.lap("plan")
        estimate = Estimate(_allotted(planned), known, work.seconds + _beyond_single(planned), work.contributions)
    spent = sum(clock.seconds.values())
    seconds = spent + estimate.seconds / task.options.speedup(task.devices)
    words = planned.channels.words(planned.method, estimate.words)  # type: ignore[arg-type]
    if planned.prepared is None:
        words["method"] = _expected_method(planned.scene, work)
    words |= {"contributions": estimate.contributions, "spectral_echo": _spectral(task, work, seconds)}
    return Forecast(
        method=str(words.get("method", "spread")).replace("spread", "pulse by pulse"),
        plan=words,
        seconds=seconds,
        bytes=bytes_of(shape),
        predicted_error=root_sum_square(estimate.error_terms),
        error_terms=estimate.error_terms,
        n_rows=int(np.prod(shape[:-1], dtype=np.int64)),
        n_samples=shape[-1],
        planning=spent,
        run=run_of(planned),
    )


def _expected_method(scene: ScenePlan, work: EchoWork) -> str:
    """The method of a scene that is not prepared; that of many facets is chosen when they are cut and illuminated."""
    method, n_pulses = scene.request.method, len(scene.seen.antennas)
    if work.by_levels or method == "factorized":
        return "factorized"
    if scene.subdivision is None or scene.subdivision.plan.is_float64 or method == "direct":
        return "spread"
    direct = n_pulses * len(scene.request.polarizations) * cost_model.FACET_PAIR
    pays = direct > cost_model.CELL_FACET and work.pieces * direct > cost_model.ECHO_SEARCH_PAYS
    return "spread or factorized" if pays else "spread"


def _timed(planned: PlannedEchoes, prepared: SceneEchoes, work: EchoWork) -> Estimate:
    """The errors of all pulses, and from a few of them the seconds and contributions of all."""
    shape, method = planned.channels.shape, planned.method
    n_pulses, pulse_by_pulse = shape[0], method
    quiet = replace(prepared, request=replace(prepared.request, clock=Clock()))
    by_levels: list[FactorizedSpreader] = []  # their work is not that of single pulses
    if isinstance(method, SingleEchoes):
        pulse_by_pulse, by_levels = method.apart(quiet)
    seconds, pairs = sum(one.seconds for one in by_levels), float(sum(len(one) for one in by_levels) * n_pulses)
    timed = None
    if pairs < len(quiet) * n_pulses:
        timed = _timed_pulses(quiet, pulse_by_pulse, shape, work)
        seconds, pairs = seconds + timed.seconds * n_pulses, pairs + timed.contributions * n_pulses
    if timed is not None and method.runs > MOST_PLANS * n_pulses:
        return Estimate(timed.error_terms, timed.words, seconds, pairs)
    track = method.planned(quiet)
    return Estimate(track.error_terms, track.plan, seconds, pairs)


def _timed_pulses(scene: SceneEchoes, method: Method, shape: tuple[int, ...], work: EchoWork) -> Estimate:
    """Seconds and contributions of one pulse, from a few that are computed."""
    n_pulses, most = shape[0], max(TIMED_SHARE * work.seconds, LEAST_TIMED)
    n = int(np.clip(most / (work.adding / n_pulses), 1, max(1, n_pulses // 8)))

    def timed(first: int, number: int) -> tuple[float, Added]:
        block, begin = np.zeros((number, *shape[1:]), np.complex64), time.perf_counter()
        added = method.fill(scene, block, first, 0, len(scene) * number)
        return time.perf_counter() - begin, added

    for first in ((n_pulses - n) // 2, 0, n_pulses - n):  # elsewhere more may be seen
        seconds, added = timed(first, n)
        if added.counts.contributing:
            break
    pulse = seconds / n
    if seconds > SLOWER * n * work.adding / n_pulses:
        seconds, more = min(seconds, timed(first, n)[0]), min(max(MORE * n, n_pulses // 8), n_pulses)
        pulse = seconds / n
        if more > n and added.counts.contributing:
            longer = timed(min(first, n_pulses - more), more)[0]
            least = min(pulse, work.adding / n_pulses)
            pulse = float(np.clip((longer - seconds) / (more - n), least, pulse))
            pulse += (seconds - n * pulse) / min(n_pulses, max(n, method.pulses(scene.request.budget)))
    return Estimate(added.error_terms, added.plan, pulse, added.counts.contributing / n)


def _beyond_single(planned: PlannedEchoes) -> float:
    """Seconds of several reflections and of edges, from those of a few pulses in the middle of the track."""
    scene, n_samples = planned.scene, planned.channels.shape[-1]
    request, seen, n = scene.request, scene.seen, len(scene.seen.antennas)
    center, bandwidth = seen.waveform.center, seen.waveform.bandwidth
    frequencies = center + bandwidth * ((np.arange(n_samples) + 0.5) / n_samples - 0.5)
    view = ChannelView(
        seen.antennas, seen.weights, frequencies, bandwidth, request.polarizations, request.vertical, request.gated
    )
    begin = time.perf_counter()
    bounced = bounced_facets(scene)
    edges = PreparedEdges.of(request, seen)
    ends = None if edges is None else edges.pieces.wedges
    spreaders: list[BounceSpreader | EdgeEchoes] = [] if bounced is None else [BounceSpreader(bounced, view, ends)]
    spreaders += [] if edges is None else [EdgeEchoes(edges, view)]
    seconds = time.perf_counter() - begin
    few = int(np.clip(n // FEW_SHARE, 2, MOST_FEW))
    for spreader in spreaders:
        took = []
        for number in (1, 1, min(few, n)):  # the first call builds kernels and lists of facets
            pulses, begin = range((n - number) // 2, (n + number) // 2), time.perf_counter()
            spreader.add(np.zeros((number, len(request.polarizations), n_samples), np.complex64), pulses, Clock(), bool)
            took.append(time.perf_counter() - begin)
        pulse = np.clip((took[2] - took[1]) / (few - 1), 0, took[2] / few)
        block = max(took[1] - pulse, 0.0)  # what pulses that are looked at together share
        seconds += float(pulse + block / min(n, PULSES_AT_ONCE)) * planned.method.runs
    return seconds


def _allotted(planned: PlannedEchoes) -> tuple[ErrorTerm, ...]:
    """Shares of the tolerance that points, facets and their shadows have: no error of the run is larger."""
    scene = planned.scene
    request, share = scene.request, scene.error_budget
    terms = []
    if len(scene.seen.scene.positions) and request.same:
        terms.append(ErrorTerm("points", share, SMALLER_TOLERANCE))
    if scene.subdivision is not None:
        terms.append(ErrorTerm("facets", share, SMALLER_TOLERANCE))
        if request.bounces > 1:
            terms.append(ErrorTerm("bounces", share, SMALLER_TOLERANCE))
        if samples_shadows(request, scene.seen):
            terms.append(ErrorTerm("shadows", SHADOWS * request.tolerance, SMALLER_TOLERANCE))
    if request.crease is not None:
        terms.append(ErrorTerm("edges", EDGES * request.tolerance, SMALLER_TOLERANCE))
    return planned.method.between(tuple(terms))


def _spectral(task: EchoTask, work: EchoWork, seconds: float) -> str:
    """About the seconds of spectral_echo with these arguments, or why it refuses them or was not planned."""
    try:
        spectral = spectral_task(task.original, task.waveform, task.given_track, task.options, task.devices[:1])
        longest = SPECTRAL_SHARE * work.seconds
        if work.cutting > longest:
            return "not planned: its facets would have to be cut and illuminated first"
        n_points = len(task.scene.positions)
        if 1e-6 * (cost_model.SPECTRAL_PLAN + cost_model.SPECTRAL_PLAN_POINT * n_points) > longest:
            return f"not planned: that takes long beside echo, about {duration(seconds)}"
        from .spectral.planning_time import PlanningTime
        from .spectral.spectral_parts import plan_parts  # imports scipy

        with warnings.catch_warnings():
            warnings.simplefilter("ignore", SarclWarning)  # those of the mesh came with the plan of echo
            clock = Clock()
            request = replace(spectral.request, clock=clock, progress=None)
            parts = plan_parts(spectral, request, PlanningTime(len(spectral.track), lambda: seconds, longest))
    except (NotApplicable, NothingSeen, ToleranceUnreachable) as refused:
        return str(refused)
    return f"about {duration(sum(clock.seconds.values()) + parts.seconds())}"
