"""The plan of echoes: the method and the plan of the scene that are taken, and their run."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

from ..arrays.channels import is_single
from ..base.errors import ToleranceUnreachable, confirm_tolerance, warned_once
from ..base.forecast import Forecast
from ..base.report import Report
from ..base.stage_timer import Clock
from ..model.phase_history import PhaseHistory
from .channels.array_channels import ArrayChannels
from .channels.array_channels import Method as ArrayMethod
from .echo_check import worth_checking
from .echo_output import EchoOutput
from .echo_request import EchoRequest
from .echo_task import EchoTask
from .scene_echoes import Added, SceneEchoes
from .scene_plan import ScenePlan, planned_scene
from .scene_preparation import prepare_scene
from .single_channel import SingleChannel, SingleEchoes

Channels = SingleChannel | ArrayChannels
Method = SingleEchoes | ArrayMethod


@dataclass(frozen=True, eq=False)
class PlannedEchoes:
    """A method, and the plan of the scene for it.

    scene   how the scene is prepared;  prepared  the scene, where that has been done
    others  methods that are taken where the prepared scene cannot meet the tolerance, and what is asked of each
    """

    channels: Channels
    method: Method
    scene: ScenePlan
    others: Sequence[tuple[Method, EchoRequest]]
    prepared: SceneEchoes | None = None

    @classmethod
    def first_of(cls, channels: Channels, methods: Sequence[tuple[Any, EchoRequest]]) -> PlannedEchoes:
        """The first of the methods whose plan can meet the tolerance; ToleranceUnreachable of the last one."""
        (method, request), *others = methods
        try:
            return cls(channels, method, planned_scene(request, channels.seen, method.bands), others)
        except ToleranceUnreachable:
            if not others:
                raise
        return cls.first_of(channels, others)

    def with_scene(self) -> tuple[PlannedEchoes, SceneEchoes]:
        """The same with the scene prepared, and that scene."""
        if self.prepared is not None:
            return self, self.prepared
        try:
            prepared = prepare_scene(self.scene)
        except ToleranceUnreachable:
            if not self.others:
                raise
            return self.first_of(self.channels, self.others).with_scene()
        return replace(self, prepared=prepared), prepared

    def asked_by(self, request: EchoRequest) -> PlannedEchoes:
        """The same with the clock and the progress function of another request."""

        def renewed(old: EchoRequest) -> EchoRequest:
            return replace(old, clock=request.clock, progress=request.progress)

        return replace(
            self,
            scene=replace(self.scene, request=renewed(self.scene.request)),
            others=[(method, renewed(old)) for method, old in self.others],
            prepared=self.prepared and replace(self.prepared, request=renewed(self.prepared.request)),
        )


@dataclass(frozen=True, eq=False)
class EchoPlan:
    """Echoes to be computed: a Plan.

    channels  rows and samples;  seconds  of planning, by stage
    planned   None until `forecast` or `run` plans the scene: its samples have a place before that
    """

    task: EchoTask
    channels: Channels
    seconds: dict[str, float]
    planned: PlannedEchoes | None = None

    @classmethod
    def of(cls, task: EchoTask, clock: Clock) -> EchoPlan:
        """The plan of a task."""
        array = task.options.array
        channels = SingleChannel(task) if array is None or is_single(array) else ArrayChannels(task, array)
        clock.lap("plan")
        return cls(task, channels, clock.seconds)

    def request(self, clock: Clock) -> EchoRequest:
        """What is asked for, with a clock."""
        return replace(self.task.request, clock=clock)

    def plan_scene(self, request: EchoRequest) -> PlannedEchoes:
        """The plan of the scene, with the clock and the progress function of a request."""
        if self.planned is not None:
            return self.planned.asked_by(request)
        return PlannedEchoes.first_of(self.channels, self.channels.methods(request))

    def forecast(self) -> Forecast[PhaseHistory]:
        """Its Forecast."""
        from .echo_forecast import forecast_of

        return forecast_of(self)

    def run(self) -> PhaseHistory:
        """The echoes."""
        clock, channels, options = Clock(self.seconds), self.channels, self.task.options
        request = self.request(clock)
        with EchoOutput(channels.shape, options.out, request.budget, channels.window) as output:
            request.report("scene", 0, 3)
            with warned_once():  # the scene may be prepared for one method and then for the other
                planned, prepared = self.plan_scene(request).with_scene()
            added = _filled(planned.method, prepared, output)
            prepared.check_seen(added.counts, *channels.window)
            clock.lap("spectra")
            measured = None
            if worth_checking(prepared, options.check, channels.overlap):
                measured = channels.measured(prepared, output)
                clock.lap("check")
            raw = output.finish(
                **channels.fields(),
                waveform=self.task.waveform,
                array=options.array,
                compressed=options.compressed,
                report=Report(
                    plan=channels.words(planned.method, added.plan),  # type: ignore[arg-type]
                    tolerance=options.tolerance,
                    predicted_error=added.predicted_error,
                    error_terms=added.error_terms,
                    measured_error=measured,
                    **channels.counted(planned.method, prepared, added.counts),  # type: ignore[arg-type]
                    seconds=clock.seconds,
                    device=request.device.info.name,
                    seed=request.seed,
                ),
            )
        confirm_tolerance(raw=raw)
        return raw


def _filled(method: Method, prepared: SceneEchoes, output: EchoOutput) -> Added:
    """Fill the output with samples."""
    added, total = Added(), len(prepared) * method.runs
    pulses = min(method.pulses(prepared.request.budget), output.pulses)
    for start in range(0, len(output), pulses):
        block = output.block(start, min(start + pulses, len(output)))
        added += method.fill(prepared, block, start, added.counts.pairs, total)
        output.keep(start, block)
    return added
