"""The plan of a scene's spectral echoes: parts that are transformed, and facets that are added pulse by pulse."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ...base.constants import SPEED_OF_LIGHT
from ...base.errors import NotApplicable
from ...base.report import SMALLER_TOLERANCE, ErrorTerm
from ...base.stage_timer import Clock
from ...numerics import cost_model
from ...opencl.device import Device
from ...scattering.facets import FacetSet
from ...scattering.scatterers import Points
from ..echo_request import EchoRequest
from ..planned_echoes import EchoWork
from ..scene_echoes import ChannelEchoes, SceneEchoes
from ..scene_plan import ScenePlan, planned_scene, share_of
from ..scene_preparation import prepare_scene
from ..spreading import Band, Counts
from ._scatterer_amplitudes import ScattererAmplitudes
from ._spectral_part import PartTask, SpectralPart, plan_part
from ._straight_track import StraightTrack
from .planning_time import PlanningTime
from .spectral_task import SpectralTask

WINDOW_PULSES = 33  # pulses at which scatterers are compared with a range window that was asked for


@dataclass(frozen=True, eq=False)
class PlannedParts:
    """The prepared scene, plans for its points and its facets, and the terms of the error of their sum.

    scene   how the scene was prepared;  prepared  None in another process
    direct  echoes of facets of which pulses see different parts, as `echo` adds them; None where there are none, and
            for the variant "saras", whose shares of them change as slowly as amplitudes
    """

    task: SpectralTask
    scene: ScenePlan
    prepared: SceneEchoes
    parts: list[SpectralPart]
    direct: ChannelEchoes | None
    error_terms: tuple[ErrorTerm, ...]

    def describe(self) -> dict[str, Any]:
        """Words of the plan of the part with the largest error; of facets added as `echo` does where there is no
        other."""
        if not self.parts and self.direct is not None:
            return self.direct.plan
        return max(self.parts, key=lambda part: part.predicted_error).describe()

    def counts(self) -> Counts:
        """Pairs of scatterer and pulse that are added up."""
        n_pulses, n_direct = len(self.task.track), 0 if self.direct is None else len(self.direct.scene)
        seen = sum(len(part.some) for part in self.parts) + n_direct
        return Counts(len(self.prepared) * n_pulses, 0, 0, (len(self.prepared) - seen) * n_pulses)

    def direct_on(self, device: Device) -> ChannelEchoes | None:
        """`direct` on another device, which prepares the scene too."""
        seen, request = self.task.seen, replace(self.task.request, device=device, progress=None, clock=Clock())
        prepared = prepare_scene(replace(self.scene, request=request), tiled=False)
        direct = prepared.by_light(seen.antennas, seen.waveform)[1]
        return None if direct is None else direct.channel(seen.antennas, seen.waveform, self.task.frequencies)

    def portable(self) -> PlannedParts:
        """The same for another process: what lies on a device is made there."""
        return replace(self, direct=None, prepared=None)  # type: ignore[arg-type]

    def seconds_pulse_by_pulse(self) -> float:
        """About the seconds of the facets that are added as `echo` does."""
        if self.direct is None:
            return 0.0
        partly = self.direct.scene.shadow_words.get("partly lit facets", 0)
        each = cost_model.LIT_PART * partly + cost_model.ECHO_FACET * len(self.direct.scene)
        return 1e-6 * each * len(self.task.track)

    def seconds(self) -> float:
        """About the seconds of the echoes, planning not included."""
        task, total = self.task, self.seconds_pulse_by_pulse()
        n_samples = len(task.frequencies)
        for part in self.parts:
            n, terms = len(part.some), len(part.expansion)
            of_facets = isinstance(part.amplitudes.part, FacetSet)
            amplitude = cost_model.SPECTRAL_FACET if of_facets else cost_model.SPECTRAL_POINT
            total += 1e-6 * n * (terms * amplitude + cost_model.SPECTRAL_PLANES * of_facets)
            for one in part.maps:
                of_map = cost_model.SPECTRAL_SPREAD * len(one.azimuth)
                of_map += cost_model.SPECTRAL_SAMPLE * one.grid.count * n_samples
                total += 1e-6 * terms * len(task.request.polarizations) * one.nodes * of_map
        return total


def plan_parts(task: SpectralTask, request: EchoRequest, time: PlanningTime | None = None) -> PlannedParts:
    """The plan of a task's echoes.

    request  that of the task, with the clock of this plan;  time  that it may take, default no longer than echo
    """
    seen, exact = task.seen, task.variant == "exact"
    request.report("scene", 0, 3)
    scene = planned_scene(request, seen, ())
    prepared = prepare_scene(scene, tiled=False, exact=exact)
    steady, direct = next(iter(prepared.facets), None), None
    time = time or PlanningTime(len(task.track), lambda: _seconds_of_echo(task, scene))
    if exact:
        steady, direct = prepared.by_light(seen.antennas, seen.waveform)
    parts, terms = [], list(prepared.shadow_terms)
    for scatterers in (prepared.points if request.same else None, steady):
        if scatterers is not None:
            part, term = _planned_part(task, prepared, scatterers, time)
            parts.append(part)
            terms.append(term)
    if task.options.range_window is not None and request.gated:
        for part in parts:
            _check_window(part, task.line, seen.antennas.reference_range, task.window)
    channel = None
    if direct is not None:
        channel = direct.channel(seen.antennas, seen.waveform, task.frequencies)
        # other facets than those that are transformed: both errors are relative to norms whose squares add up
        error = max([channel.predicted_error, *(term.value for term in terms if term.name == "facets")])
        terms = [term for term in terms if term.name != "facets"]
        terms.append(ErrorTerm("facets", error, SMALLER_TOLERANCE))
    request.clock.lap("plan")
    return PlannedParts(task, scene, prepared, parts, channel, tuple(terms))


def _seconds_of_echo(task: SpectralTask, scene: ScenePlan) -> float:
    """About the seconds that `echo` takes for the same task, as its forecast has them before it times pulses."""
    n_samples = len(task.frequencies)
    band = Band(n_samples, task.seen.waveform.bandwidth, float(task.frequencies[0]))
    request = replace(scene.request, method="auto")
    return EchoWork.of(replace(scene, request=request, bands=(band,)), len(task.track), n_samples).seconds


def _planned_part(
    task: SpectralTask, prepared: SceneEchoes, scatterers: Points | FacetSet, time: PlanningTime
) -> tuple[SpectralPart, ErrorTerm]:
    """The plan of points or facets, and the term of its error."""
    request, line, waveform = prepared.request, task.line, task.seen.waveform
    band = waveform.center - waveform.bandwidth / 2, waveform.center + waveform.bandwidth / 2
    share = share_of(request, task.seen, request.tolerance)
    straight = 4 * np.pi * band[1] / SPEED_OF_LIGHT * line.deviation
    gain, fixed, random = 1.0, 0.0, False
    of_facets = isinstance(scatterers, FacetSet)
    if isinstance(scatterers, FacetSet) and prepared.subdivision is not None:
        gain, fixed = prepared.subdivision.gain, prepared.subdivision.plan.predicted_error
        random = not scatterers.is_mirror
    amplitudes = ScattererAmplitudes(
        scatterers,
        prepared.weights,
        line,
        request.polarizations,
        request.vertical,
        share if task.variant == "exact" else None,
    )
    part = plan_part(
        PartTask(
            amplitudes=amplitudes,
            track=line,
            band=band,
            has_beam=prepared.weights.pair is not None,
            is_random=random,
            variant=task.variant,
            tolerance=share / gain - fixed - straight,
            asked=request.tolerance,
            device=request.device,
            time=time,
        )
    )
    error = gain * (part.predicted_error + fixed + straight)
    return part, ErrorTerm("facets" if of_facets else "points", error, SMALLER_TOLERANCE)


def _check_window(
    part: SpectralPart, line: StraightTrack, reference_range: np.ndarray, window: tuple[float, float]
) -> None:
    """NotApplicable where a scatterer lies outside the range window at a pulse that sees it."""
    azimuth, slant_range = part.amplitudes.azimuth[part.some], part.amplitudes.slant_range[part.some]
    low, high = part.seen
    for p in np.unique(np.linspace(0, line.n_pulses - 1, WINDOW_PULSES).astype(int)).tolist():
        lag = p * line.spacing - azimuth
        distance = np.hypot(lag, slant_range)
        seen = (lag >= low * distance) & (lag <= high * distance)
        away = distance[seen] - reference_range[p]
        outside = (away < window[0]) | (away > window[1])
        if outside.any():
            raise NotApplicable(
                f"range_window ({window[0]:g}, {window[1]:g}) m cuts the scene: at pulse {p} scatterers lie at "
                f"{away.min():.4g} to {away.max():.4g} m about the reference. Widen it, leave it out, or use echo, "
                "which leaves out scatterers row by row"
            )
