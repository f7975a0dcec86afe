"""The plan of echoes: the method and the plan of the scene that are taken, and their run."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

from ..arrays.channels import is_single
from ..base.errors import confirm_tolerance, warned_once
from ..base.forecast import Forecast
from ..base.report import Report
from ..base.stage_timer import Clock
from ..model.phase_history import PhaseHistory
from ._echo_forecast import forecast_of
from ._planned_echoes import Channels, Method, PlannedEchoes
from ._single_channel import SingleChannel
from .channels.array_channels import ArrayChannels
from .echo_check import worth_checking
from .echo_output import EchoOutput
from .echo_request import EchoRequest
from .echo_task import EchoTask
from .scene_echoes import Added, SceneEchoes


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
        clock = Clock(self.seconds)

        def run_of(planned: PlannedEchoes) -> Callable[[], PhaseHistory]:
            return replace(self, seconds=clock.seconds, planned=planned).run

        with warned_once():
            planned = self.plan_scene(replace(self.request(clock), progress=None))
            return forecast_of(self.task, planned, clock, run_of)

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
