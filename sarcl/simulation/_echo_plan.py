"""The plan of echoes: the method and the plan of the scene that are taken, and their run."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass, replace
from typing import Any

from ..arrays.channels import is_single
from ..base.errors import confirm_tolerance, warn, warned_once
from ..base.forecast import Forecast
from ..base.report import Report
from ..base.stage_timer import Clock
from ..blocks.checkpoint import Checkpoint
from ..blocks.fill_bands import BandFiller
from ..model.phase_history import PhaseHistory
from ._echo_blocks import EchoEngine, EchoRecipe, echo_job
from ._echo_forecast import forecast_of
from ._single_channel import SingleChannel
from .channels.array_channels import ArrayChannels
from .echo_check import worth_checking
from .echo_files import EchoFiles
from .echo_options import EchoOptions
from .echo_output import EchoOutput
from .echo_request import EchoRequest
from .echo_task import EchoTask
from .planned_echoes import Channels, PlannedEchoes
from .scene_echoes import Added, SceneEchoes
from .spreading import Counts


@dataclass(frozen=True, eq=False)
class EchoPlan:
    """Echoes to be computed: a Plan.

    channels  rows and samples;  seconds  of planning, by stage
    piece     (i, n) where only that piece of the pulses is computed
    planned   None until `forecast` or `run` plans the scene: its samples have a place before that
    """

    task: EchoTask
    channels: Channels
    seconds: dict[str, float]
    piece: tuple[int, int] | None = None
    planned: PlannedEchoes | None = None

    @classmethod
    def of(cls, task: EchoTask, clock: Clock) -> EchoPlan:
        """The plan of a task."""
        array = task.options.array
        channels = SingleChannel(task) if array is None or is_single(array) else ArrayChannels(task, array)
        piece = task.options.piece(task.options.out is not None, "raw.h5")
        clock.lap("plan")
        return cls(task, channels, clock.seconds, piece)

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
        """The echoes; None for a piece while others are missing."""
        with ExitStack() as stack:
            raw = self._echoes(stack, Clock(self.seconds))
        if raw is not None:
            confirm_tolerance(raw=raw)
        return raw  # type: ignore[return-value]

    def _echoes(self, stack: ExitStack, clock: Clock) -> PhaseHistory | None:
        options, request = self.task.options, self.request(clock)
        job = echo_job(self.task, self.channels.shape)
        files = EchoFiles(stack, job, self._output, out=options.out, resume=options.resume, piece=self.piece)
        if (finished := files.finished()) is not None:
            return finished
        request.report("scene", 0, 3)
        with warned_once():  # the scene may be prepared for one method and then for the other
            planned, prepared = self.plan_scene(request).with_scene()
            filler = self._filler(planned, prepared, files.checkpoint, clock)
        clock.lap("plan")
        output = files.output(filler)
        if output is None:
            return None
        added, n_kept = filler.fill(output.flat)
        assert isinstance(added, Added)
        prepared.check_seen(added.counts, *self.channels.window)
        clock.lap("spectra")
        fields = self._fields(planned, prepared, filler, output, added=added, n_kept=n_kept)
        return files.finish(**fields)

    def _output(self) -> EchoOutput:
        """Destination of the samples."""
        channels, options = self.channels, self.task.options
        return EchoOutput(channels.shape, options.out, self.task.request.budget, channels.window)

    def _filler(
        self, planned: PlannedEchoes, prepared: SceneEchoes, checkpoint: Checkpoint | None, clock: Clock
    ) -> BandFiller:
        """What fills the samples, by the devices of the task; the others prepare the scene too."""
        task, options = self.task, self.task.options
        engine, recipe = EchoEngine(planned, prepared), EchoRecipe(planned.unprepared(), options.max_bytes)
        job = echo_job(task, self.channels.shape, engine.passes)
        workers = options.workers(job, recipe, task.devices, engine)
        clock.lap("scene")
        return BandFiller(workers, job, checkpoint, clock, options.progress)

    def _fields(
        self,
        planned: PlannedEchoes,
        prepared: SceneEchoes,
        filler: BandFiller,
        output: EchoOutput,
        *,
        added: Added,
        n_kept: int,
    ) -> dict[str, Any]:
        """Fields of the PhaseHistory; n_kept  pulses that files of earlier runs held."""
        channels, options, clock = self.channels, self.task.options, filler.clock
        measured = None
        crossed = added.counts.crossed / max(len(output), 1)
        if worth_checking(prepared, options.check, channels.overlap, crossed):
            measured = channels.measured(prepared, output)
            clock.lap("check")
        plan = channels.words(planned.method, added.plan)  # type: ignore[arg-type]
        if prepared.bounced is not None:
            plan["contributions by reflections"] = added.counts.by_order()
            plan |= _late_words(added.counts, options)
        if n_kept:
            plan["from files"] = f"{n_kept} of {len(output)} pulses"
        report = Report(
            plan=plan,
            tolerance=options.tolerance,
            predicted_error=added.predicted_error,
            error_terms=added.error_terms,
            measured_error=measured,
            **channels.counted(planned.method, prepared, added.counts),  # type: ignore[arg-type]
            seconds=clock.seconds,
            device=" + ".join(filler.workers.names),
            seed=prepared.request.seed,
        )
        compressed, waveform = options.compressed, self.task.waveform
        own = {"waveform": waveform, "array": options.array, "compressed": compressed, "report": report}
        return {**channels.fields(), **own}


def _late_words(counts: Counts, options: EchoOptions) -> dict[str, str]:
    """What a report says of echoes of several reflections outside the range window; warns where they are stronger than
    the tolerance, and nobody asked for that window."""
    share = counts.late_share
    if not share:
        return {}
    if options.range_window is None and share > options.tolerance**2:
        warn(
            f"echoes of several reflections arrive outside the range window, with {100 * share:.2g} % of the power: up "
            f"to {counts.latest:.1f} m behind the reference; pass range_window=({-counts.latest:.0f}, "
            f"{1.05 * counts.latest:.0f})",
            "late echoes",
        )
    return {"late echoes outside the range window": f"{100 * share:.2g} % of the power, up to {counts.latest:.1f} m"}
