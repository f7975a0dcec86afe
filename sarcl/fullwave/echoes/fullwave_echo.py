"""Echoes of closed bodies by Maxwell's equations on a grid, from few runs of the grid."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, Literal, TypedDict

import numpy as np
from numpy.typing import ArrayLike

from ...base.errors import confirm_tolerance
from ...base.types import PathLike
from ...base.validation import flag, instance
from ...io import formats, output_paths
from ...model.phase_history import PhaseHistory
from ...model.trajectory import Trajectory
from ...model.waveform import Waveform
from ...opencl.device import DeviceChoice
from ...scene.scene import Scene
from ...simulation.echo import Polarization, echo_request
from ...simulation.echo_output import EchoOutput, check_name
from ._formed_samples import FormedSamples, formed_samples
from ._fullwave_task import FullwaveTask, fullwave_task

TOLERANCE = 3e-2  # unless asked otherwise


class FullwaveOptions(TypedDict, total=False):
    """Options of `fullwave_echo`."""

    receiver: Trajectory | None
    polarization: Polarization | Literal["all"] | Sequence[Polarization]
    vertical: ArrayLike | None
    range_window: ArrayLike | None
    reference: ArrayLike | None
    cells: Literal["auto"] | float
    anchors: Literal["auto"] | int | Sequence[int]
    compressed: bool
    max_bytes: float | None
    out: PathLike | None
    tolerance: float
    check: bool
    model_error: bool
    device: DeviceChoice | None
    progress: Callable[[str, int, int], None] | None


def fullwave_echo(
    scene: Scene,
    waveform: Waveform,
    track: Trajectory,
    *,
    receiver: Trajectory | None = None,
    polarization: Polarization | Literal["all"] | Sequence[Polarization] = "HH",
    vertical: ArrayLike | None = None,
    range_window: ArrayLike | None = None,
    reference: ArrayLike | None = None,
    cells: Literal["auto"] | float = "auto",
    anchors: Literal["auto"] | int | Sequence[int] = "auto",
    compressed: bool = True,
    max_bytes: float | None = None,
    out: PathLike | None = None,
    tolerance: float = TOLERANCE,
    check: bool = False,
    model_error: bool = True,
    device: DeviceChoice | None = None,
    progress: Callable[[str, int, int], None] | None = None,
) -> PhaseHistory:
    """Echoes of closed bodies by a solution of Maxwell's equations on a grid (FDTD): all reflections, diffraction,
    creeping waves and resonances.

    The fields about the bodies are computed on a grid of cubic cells for a few pulses of the track, the anchors. The
    currents of an anchor give the echoes of the other pulses (waveform forming); between anchors these echoes are
    interpolated.

    scene         closed bodies of smooth facets: perfect conductors, dielectric and lossy materials. No points, no
                  terrain, no open or rough facets
    track, receiver, polarization, vertical, reference, compressed   as in `echo`. One run of the grid gives all
                  polarisations of one that is sent: HH and VH share theirs
    range_window  as in `echo`, but it must hold the scene; default: also what creeps round its bodies
    cells         cells per shortest wavelength of the waveform's band, at least 8; "auto": 12 for conductors, and for
                  dielectrics of permittivity eps 10 sqrt(eps 3e-2/tolerance), from 8 to 20 sqrt(eps); the number is
                  report.plan["cells"]. Time grows as their fourth power
    anchors       "auto": as many as the tolerance needs; a number, spaced evenly; or pulse numbers
    max_bytes     memory for one run of the grid, default half the memory that is installed; frequencies that do not fit
                  take runs of their own
    out           an HDF5 file of sarcl's (.h5) for the samples. Echoes of finished anchors are kept beside it, in
                  OUT.anchors, until it is complete: after a kill, the same call continues from them
    tolerance     L2 error of waveform forming: of the samples against those of a run at every pulse, on the same grid
    check         one run more per polarisation sent, between anchors: report.measured_error
    model_error   predict the error of the grid itself, report.model_error, by a run with larger cells, which takes
                  about a fifth of the time
    progress      called as progress(stage, done, total)

    Returns a PhaseHistory whose samples are like those of `echo`: |sample|^2 = RCS, m^2. ToleranceUnreachable, a
    ValueError: more anchors do not meet the tolerance. ToleranceMissed, a ValueError that holds the finished echoes:
    the check measured more than the tolerance. ValueError, MemoryError, sarcl.NoDeviceError say what else does not fit.
    Source: docs/theory/full_wave.md; after Zou, Jia and Qiao 2021 (waveform forming).
    """
    for name, value, kind in (("scene", scene, Scene), ("waveform", waveform, Waveform), ("track", track, Trajectory)):
        instance(name, value, kind)
    request = echo_request(
        scene, (), polarization=polarization, vertical=vertical, max_bytes=max_bytes, tolerance=tolerance,
        device=device, progress=progress,
    )  # fmt: skip
    task = fullwave_task(
        scene, waveform, track, request, receiver=receiver, reference=reference, range_window=range_window,
        compressed=flag("compressed", compressed), cells=cells, max_bytes=max_bytes,
    )  # fmt: skip
    check_name(out)
    if out is not None:
        formats.writer_functions(out, "phase history")
        output_paths.check_writable(out)
    made = formed_samples(
        task, anchors, out, check=flag("check", check), model_error=flag("model_error", model_error)
    )  # fmt: skip
    raw = _written(task, made, out)
    confirm_tolerance(raw=raw, instead="give more anchors")
    return raw


def _written(task: FullwaveTask, made: FormedSamples, out: Any) -> PhaseHistory:
    """The samples, with their geometry and report, in memory or in the file `out`."""
    names, n_pulses = task.request.polarizations, len(task.tx)
    with EchoOutput(made.samples.shape, out, task.request.budget, task.window) as output:
        for start in range(0, n_pulses, output.pulses):
            stop = min(start + output.pulses, n_pulses)
            block = output.block(start, stop)
            block[...] = made.samples[start:stop] * task.factors(slice(start, stop))[:, None]
            output.keep(start, block)

        def every(values: Any) -> Any:
            return values if len(names) == 1 or values is None else np.repeat(values, len(names), axis=0)

        velocities = [t.velocities for t in (task.track, task.track if task.receiver is None else task.receiver)]
        raw = output.finish(
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
            compressed=task.compressed,
            report=made.report,
        )
    if made.files is not None:
        made.files.clear()  # the file is complete
    return raw
