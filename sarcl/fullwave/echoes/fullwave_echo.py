"""Echoes of closed bodies by Maxwell's equations on a grid, from few runs of the grid."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ...base.errors import confirm_tolerance
from ...base.forecast import Forecast, Plan
from ...base.stage_timer import Clock
from ...base.validation import instance
from ...base.verb import verb
from ...io import formats, output_paths
from ...model.phase_history import PhaseHistory
from ...model.trajectory import Trajectory
from ...model.waveform import Waveform
from ...opencl.memory_budget import budget
from ...scene.scene import Scene
from ...simulation.echo_output import EchoOutput
from ._anchor_files import AnchorFiles
from ._forecast import forecast_of, is_cut
from ._formed_samples import FormedSamples, checked_anchors, formed_samples
from ._fullwave_task import FullwaveTask, fullwave_task
from ._model_error import check_thickness, coarse_task
from ._options import FullwaveOptions


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

    Returns a PhaseHistory whose samples are like those of `echo`: |sample|^2 = RCS, m^2. ToleranceUnreachable, a
    ValueError: more anchors do not meet the tolerance. ToleranceMissed, a ValueError that holds the finished echoes:
    the check measured more than the tolerance. ValueError, MemoryError, sarcl.NoDeviceError say what else does not fit.

    Its forecast estimates the number of anchors from the length of the target in wavelengths, the angle that the track
    covers and the tolerance: with anchors="auto" the runs themselves decide. forecast.bytes is the memory of one run of
    the grid, of the echoes of all anchors, of samples and geometry; forecast.plan has runs, run_bytes and run_seconds.
    forecast.predicted_error is what anchors="auto" reaches; nan for given anchors, whose runs alone tell it. Bodies are
    cut by the grid, up to 5e7 cells, once for the forecast and its run; `out` is not written.
    Source: docs/theory/full_wave.md; after Zou, Jia and Qiao 2021 (waveform forming).
    """
    clock = Clock()
    for name, value, kind in (("scene", scene, Scene), ("waveform", waveform, Waveform), ("track", track, Trajectory)):
        instance(name, value, kind)
    task = fullwave_task(scene, waveform, track, options)
    coarse = coarse_task(task) if options.model_error else None
    anchors = checked_anchors(options.anchors, len(task.along))
    clock.lap("plan")
    return FullwavePlan(task, coarse, anchors, clock.seconds)


@dataclass(frozen=True, eq=False)
class FullwavePlan:
    """Runs of the grid for anchors, and the echoes formed from them: a Plan.

    coarse   the task on larger cells that predicts the model error, or None
    anchors  "auto", their number, or their pulses (n,);  seconds  of planning, by stage
    """

    task: FullwaveTask
    coarse: FullwaveTask | None
    anchors: str | int | np.ndarray
    seconds: dict[str, float]

    def forecast(self) -> Forecast[PhaseHistory]:
        """Its Forecast. A small grid is timed, once per device and process."""
        if is_cut(self.task):
            self._cut()
        return forecast_of(self.task, self.coarse, self.anchors, sum(self.seconds.values()), self.run)

    def run(self) -> PhaseHistory:
        """The echoes, in memory or in the file `out`."""
        out = self.task.options.out
        if out is not None:
            formats.writer_functions(out, "phase history")
            output_paths.check_writable(out)
        self._cut()
        files = None if out is None else AnchorFiles(out, self.task.fingerprint())
        echoes = formed_samples(self.task, self.coarse, self.anchors, files, Clock(self.seconds))
        raw = self._written(echoes)
        if files is not None:
            files.clear()  # the file of the samples is complete
        confirm_tolerance(raw=raw, instead="give more anchors")
        return raw

    def _cut(self) -> None:
        """Cut the bodies by both grids, unless they are cut; warn of gaps. ValueError for parts that are too thin."""
        clock = Clock(self.seconds)
        self.task.warn_of_gaps()
        if self.coarse:
            check_thickness(self.coarse, self.task.cells)
        clock.lap("plan")
        self.seconds.update(clock.seconds)

    def _written(self, echoes: FormedSamples) -> PhaseHistory:
        """The samples, with their geometry and report, in memory or in the file `out`."""
        task = self.task
        names, n_pulses = task.polarizations, len(task.tx)
        room = budget(task.device, task.options.max_bytes)
        with EchoOutput(echoes.samples.shape, task.options.out, room, task.window) as output:
            for start in range(0, n_pulses, output.pulses):
                stop = min(start + output.pulses, n_pulses)
                block = output.block(start, stop)
                block[...] = echoes.samples[start:stop] * task.factors(slice(start, stop))[:, None]
                output.keep(start, block)

            def every(values: Any) -> Any:
                return values if len(names) == 1 or values is None else np.repeat(values, len(names), axis=0)

            velocities = [t.velocities for t in (task.track, task.track if task.receiver is None else task.receiver)]
            return output.finish(
                frequency=task.frequencies[0],
                frequency_step=task.step,
                tx=every(task.tx),
                rx=None if task.receiver is None else every(task.rx),
                reference_range=every(task.reference_range),
                time=every(task.track.times),
                polarization=np.tile(names, n_pulses),
                tx_velocity=every(velocities[0]),
                rx_velocity=every(velocities[1]),
                waveform=task.waveform,
                array=None,
                compressed=task.options.compressed,
                report=echoes.report,
            )
