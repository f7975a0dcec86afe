"""Samples of all pulses from the runs of anchors, with their report."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...base.report import SMALLER_TOLERANCE, ErrorTerm, Report, root_sum_square
from ...base.stage_timer import Clock
from ...base.validation import array, choice, count, ndim
from ..anchors import Anchored, anchored
from ._anchor_files import AnchorFiles
from ._anchor_runs import AnchorRuns, RunCounts
from ._fullwave_task import FullwaveTask
from ._model_error import grid_error
from ._options import FullwaveOptions
from ._run_progress import RunProgress


@dataclass(frozen=True, eq=False)
class FormedSamples:
    """Echoes of all pulses, phase zero at the scene's centre, without the waveform's spectrum: complex64
    (P, polarisations, F); and their report.
    """

    samples: np.ndarray
    report: Report


def formed_samples(
    task: FullwaveTask,
    coarse: FullwaveTask | None,
    anchors: str | int | np.ndarray,
    files: AnchorFiles | None,
    clock: Clock,
) -> FormedSamples:
    """Runs the anchors of every polarisation that is sent, and forms the samples.

    coarse  the task on larger cells that predicts the error of the grid, or None;  files  for finished anchors, or None
    """
    options, n_pulses = task.options, len(task.tx)
    samples = np.empty((n_pulses, len(task.polarizations), len(task.frequencies)), np.complex64)
    progress = RunProgress(options.progress, 1, task.cost.steps)
    sums, counts = ErrorSums(), RunCounts()
    for sent, indices in task.sendings:
        twins = task.twins[sent]
        runs = AnchorRuns(
            task,
            sent,
            [task.polarizations[i][0] for i in indices],
            files=files,
            progress=progress,
            twins=twins,
            counts=counts,
        )
        mirror = np.array([twins[p].pulse if p in twins else -1 for p in range(n_pulses)])
        echoes = anchored(runs, task.along, anchors=anchors, tolerance=options.tolerance, mirror=mirror)
        clock.lap("runs")
        samples[:, indices] = echoes.samples
        sums.add(task, sent, echoes)
        if coarse:
            sums.add_grid_error(task, coarse, runs)
            clock.lap("model error")
        if options.check:
            sums.add_check(task, runs, echoes)
            clock.lap("check")
    progress.finish()
    return FormedSamples(samples, _report(task, sums, counts, clock))


def checked_anchors(asked: object, n_pulses: int) -> str | int | np.ndarray:
    """`anchors` as `anchored` takes it."""
    if isinstance(asked, str):
        return choice("anchors", asked, ("auto",))
    if ndim("anchors", asked) == 0:
        number = count("anchors", asked)
        if number > n_pulses:
            raise ValueError(f"anchors is {number}, and the track has {n_pulses} pulses; give at most one per pulse")
        return number
    pulses = array("anchors", asked, np.int64, ("n",))
    if not len(pulses) or len(np.unique(pulses)) < len(pulses) or pulses.min() < 0 or pulses.max() >= n_pulses:
        raise ValueError(
            f"anchors is {pulses.tolist()!r:.60}; give numbers of pulses from 0 to {n_pulses - 1}, each once, a number "
            "of anchors, or 'auto'"
        )
    return pulses


def error_terms(forming: float, left: float, options: FullwaveOptions) -> tuple[ErrorTerm, ...]:
    """Terms of the error of samples: waveform forming, and the part `left` of the currents that runs end before."""
    remedy = SMALLER_TOLERANCE if isinstance(options.anchors, str) else "more anchors"
    return (
        ErrorTerm("waveform forming", forming, remedy),
        ErrorTerm("end of runs", left, SMALLER_TOLERANCE),
    )


class ErrorSums:
    """Squares of errors, weighted by energy, and energies, added up over the polarisations that are sent.

    anchors  pulses of the anchors, for each polarisation that is sent
    power    energy of the samples;  forming, checked  squares of their errors by waveform forming, predicted, measured
    grid     squares of errors of the grid, and grid_power the energy of the samples that they belong to
    """

    def __init__(self) -> None:
        self.anchors: dict[str, list[int]] = {}
        self.power, self.forming, self.checked = 0.0, 0.0, 0.0
        self.grid = self.grid_power = 0.0
        self.has_grid = self.has_check = False

    def add(self, task: FullwaveTask, sent: str, echoes: Anchored) -> None:
        """Add the echoes of a polarisation that is sent."""
        power = float((np.abs(echoes.samples * np.abs(task.spectrum)) ** 2).sum())
        self.anchors[sent] = [int(p) for p in echoes.pulses]
        self.power += power
        if np.ptp(task.along):  # else one run is that of every pulse
            self.forming += echoes.predicted_error**2 * power

    def add_grid_error(self, task: FullwaveTask, coarse: FullwaveTask, runs: AnchorRuns) -> None:
        """Add the error of the grid, predicted at the middle anchor."""
        middle = (task.along[0] + task.along[-1]) / 2
        pulse = min(self.anchors[runs.sent], key=lambda p: abs(task.along[p] - middle))
        error, power = grid_error(task, coarse, pulse, runs)
        self.grid, self.grid_power, self.has_grid = self.grid + error, self.grid_power + power, True

    def add_check(self, task: FullwaveTask, runs: AnchorRuns, echoes: Anchored) -> None:
        """Add the error at the pulse that is farthest from every anchor, by a run; it counts for all pulses."""
        distance = np.abs(task.along[:, None] - task.along[self.anchors[runs.sent]]).min(axis=1)
        pulse = int(np.argmax(distance))
        exact = task.formed(pulse, runs.sent, runs.received, np.array([pulse]), runs.progress)[0][0][0]
        error = float((np.abs((echoes.samples[pulse] - exact) * np.abs(task.spectrum)) ** 2).sum())
        self.checked, self.has_check = self.checked + len(task.tx) * error, True

    @property
    def forming_error(self) -> float:
        """Relative error of the samples by waveform forming, predicted."""
        return float(np.sqrt(self.forming / self.power)) if self.power else 0.0

    @property
    def measured_error(self) -> float | None:
        """Relative error of the samples by waveform forming, measured."""
        return float(np.sqrt(self.checked / self.power)) if self.has_check and self.power else None

    @property
    def model_error(self) -> float | None:
        """Relative error of the grid, predicted."""
        return float(np.sqrt(self.grid / self.grid_power)) if self.has_grid and self.grid_power else None


def _report(task: FullwaveTask, sums: ErrorSums, counts: RunCounts, clock: Clock) -> Report:
    pulses = list(sums.anchors.values())
    plan: dict[str, object] = {
        "model": "full wave on a grid (FDTD)",
        "anchors": pulses[0] if all(p == pulses[0] for p in pulses) else sums.anchors,
        "runs": counts.runs,
        "mirrored": counts.mirrored,
        **task.grid_choices,
        "steps": int(counts.steps / counts.runs) if counts.runs else 0,
        "left": float(f"{counts.left:.1e}"),
        "run_bytes": round(task.run_bytes),
        "max_bytes": round(task.max_bytes),
        "parts": len(task.parts),
        "run_seconds": float(f"{counts.seconds / max(counts.runs, 1):.3g}"),
        **task.strips,
        **task.losses,
        **task.motion,
    }
    terms = error_terms(sums.forming_error, counts.left, task.options)
    return Report(
        plan=plan,
        tolerance=task.options.tolerance,
        predicted_error=root_sum_square(terms),
        error_terms=terms,
        measured_error=sums.measured_error,
        contributions_done=counts.steps * task.n_cells,
        seconds=clock.seconds,
        device=task.device.info.name,
        model_error=sums.model_error,
    )
