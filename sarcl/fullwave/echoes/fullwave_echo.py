"""Echoes of closed bodies by Maxwell's equations on a grid, from few runs of the grid."""

from __future__ import annotations

from contextlib import ExitStack
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...base.errors import confirm_tolerance
from ...base.forecast import Forecast, Plan
from ...base.stage_timer import Clock
from ...base.verb import verb
from ...blocks.fill_bands import BandFiller
from ...model.phase_history import PhaseHistory
from ...model.trajectory import Trajectory
from ...model.waveform import Waveform
from ...opencl.memory_budget import budget
from ...scene.scene import Scene
from ...simulation.echo_files import EchoFiles
from ...simulation.echo_output import EchoOutput
from ...simulation.echo_sampling import row_fields
from ...simulation.echo_task import check_subjects
from ._forecast import forecast_of, is_cut
from ._formed_samples import AnchorSearches, checked_anchors, formed_samples
from ._fullwave_task import FullwaveTask, fullwave_task
from ._grid_runs import GridRuns, RunProgress, run_job
from ._model_error import FINER, RATIO, check_thickness
from ._options import FullwaveOptions
from ._run_bands import RunBands, RunEngine, RunRecipe


@verb(FullwaveOptions)
def fullwave_echo(scene: Scene, waveform: Waveform, track: Trajectory, options: FullwaveOptions) -> Plan[PhaseHistory]:
    """Echoes of closed bodies by a solution of Maxwell's equations on a grid (FDTD): all reflections, diffraction,
    creeping waves and resonances.

    The fields about the bodies are computed on a grid of cubic cells for a few pulses of the track, the anchors. The
    currents of an anchor give the echoes of the other pulses (waveform forming); between anchors these echoes are
    interpolated.

    scene         closed bodies of smooth facets: perfect conductors, dielectric and lossy materials. No points, no
                  terrain, no open or rough facets
    waveform      whose band the grid carries;  track  transmitter, outside the sphere about the scene's box
    {options}

    Returns a PhaseHistory whose samples are like those of `echo`: |sample|^2 = RCS, m^2; with `tile`, None until the
    piece that completes it. ToleranceUnreachable, a ValueError: more anchors do not meet the tolerance.
    ToleranceMissed, a ValueError that holds the finished echoes: the check measured more than the tolerance.
    ValueError: runs of other echoes in "PATH.anchors". ValueError, MemoryError, sarcl.NoDeviceError say what else does
    not fit.

    Its forecast estimates the number of anchors from the length of the target in wavelengths, the angle that the track
    covers and the tolerance: with anchors="auto" the runs themselves decide. forecast.bytes is the memory of one run of
    the grid, of the echoes of all anchors, of samples and geometry; forecast.plan has runs, run_bytes and run_seconds.
    forecast.predicted_error is what anchors="auto" reaches; nan for given anchors, whose runs alone tell it. Bodies are
    cut by the grid, up to 5e7 cells, once for the forecast and its run; `out` is not written.
    Source: docs/theory/full_wave.md; after Zou, Jia and Qiao 2021 (waveform forming).

    >>> ball = sarcl.shapes.sphere(0.05, facets=320)
    >>> low = sarcl.Waveform.chirp(center=1.5e9, bandwidth=100e6, duration=1e-6)
    >>> few = sarcl.Trajectory.circle(radius=100, height=50, arc=0.1, n_pulses=3)
    >>> fields = sarcl.fullwave_echo(ball, low, few, tolerance=0.1)
    """
    clock = Clock()
    check_subjects(scene, waveform, track)
    task = fullwave_task(scene, waveform, track, options)
    coarse = task.coarser(RATIO, FINER) if options.model_error else None
    anchors = checked_anchors(options.anchors, len(task.along))
    piece = options.piece(options.out is not None, "raw.h5")
    clock.lap("plan")
    return FullwavePlan(task, coarse, anchors, clock.seconds, piece)


@dataclass(frozen=True, eq=False)
class FullwavePlan:
    """Runs of the grid for anchors, and the echoes formed from them: a Plan.

    coarse   the task on larger cells that predicts the model error, or None
    anchors  "auto", their number, or their pulses (n,);  seconds  of planning, by stage
    piece    (i, n) where only that piece of the runs is computed
    """

    task: FullwaveTask
    coarse: FullwaveTask | None
    anchors: str | int | np.ndarray
    seconds: dict[str, float]
    piece: tuple[int, int] | None = None

    def forecast(self) -> Forecast[PhaseHistory]:
        """Its Forecast. A small grid is timed, once per device and process."""
        if is_cut(self.task):
            self._cut()
        return forecast_of(self.task, self.coarse, self.anchors, sum(self.seconds.values()), self.run)

    def run(self) -> PhaseHistory:
        """The echoes, in memory or in the file `out`; None for a piece while others are missing."""
        with ExitStack() as stack:
            raw = self._echoes(stack)
        if raw is not None:
            confirm_tolerance(raw=raw, instead="give more anchors")
        return raw  # type: ignore[return-value]

    def _echoes(self, stack: ExitStack) -> PhaseHistory | None:
        task, options = self.task, self.task.options
        bands = RunBands(task, self.coarse)
        job = run_job(task, bands, self.anchors)
        files = EchoFiles(stack, job, self._output, out=options.out, resume=options.resume, piece=self.piece)
        if (finished := files.finished()) is not None:
            return finished
        self._cut()
        clock, progress = Clock(self.seconds), RunProgress(options.progress)
        workers = options.workers(job, RunRecipe(bands), task.devices, RunEngine(bands, task.device))
        runs = GridRuns(bands, BandFiller(workers, job, files.checkpoint, clock, progress), progress)
        searches = AnchorSearches(task, self.coarse, self.anchors)
        output = files.output(runs.filler, runs.needed(searches.first))
        if output is None:
            return None
        echoes = formed_samples(searches, runs, clock)
        self._write(echoes.samples, output)
        return files.finish(**self._fields(), report=echoes.report)

    def _cut(self) -> None:
        """Cut the bodies by both grids, unless they are cut; warn of gaps. ValueError for parts that are too thin."""
        clock = Clock(self.seconds)
        self.task.warn_of_gaps()
        if self.coarse:
            check_thickness(self.coarse, self.task.cells)
        clock.lap("plan")
        self.seconds.update(clock.seconds)

    def _output(self) -> EchoOutput:
        """Destination of the samples."""
        task = self.task
        shape = len(task.tx), len(task.polarizations), len(task.frequencies)
        room = budget(task.device, task.options.max_bytes)
        return EchoOutput(shape, task.options.out, room, task.window)

    def _write(self, samples: np.ndarray, output: EchoOutput) -> None:
        """Write samples, with the waveform's spectrum, to the output."""
        for start in range(0, len(samples), output.pulses):
            stop = min(start + output.pulses, len(samples))
            block = output.block(start, stop)
            block[...] = samples[start:stop] * self.task.factors(slice(start, stop))[:, None]
            output.keep(start, block)

    def _fields(self) -> dict[str, Any]:
        """Fields of the PhaseHistory but samples and report."""
        task = self.task
        return {
            "frequency": task.frequencies[0],
            "frequency_step": task.step,
            **row_fields(task.track, task.receiver, task.reference_range, task.polarizations),
            "waveform": task.waveform,
            "array": None,
            "compressed": task.options.compressed,
        }
