"""Samples of all pulses from the runs of anchors, with their report."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from ...base.report import SMALLER_TOLERANCE, ErrorTerm, Report, root_sum_square
from ...base.stage_timer import Clock
from ...base.validation import array, choice, count, ndim
from ..anchors import Anchored, Search, anchor_search
from ._fullwave_task import FullwaveTask
from ._grid_runs import GridRuns, anchors_of
from ._model_error import grid_error
from ._options import FullwaveOptions
from ._run_bands import ANCHOR, CHECK, COARSE, LOSSES, Run


@dataclass(frozen=True, eq=False)
class FormedSamples:
    """Echoes of all pulses, phase zero at the scene's centre, without the waveform's spectrum: complex64
    (P, polarisations, F); and their report.
    """

    samples: np.ndarray
    report: Report


class AnchorSearches:
    """The anchors of all polarisations that are sent, found together, so that their runs can be computed together."""

    def __init__(self, task: FullwaveTask, coarse: FullwaveTask | None, anchors: str | int | np.ndarray) -> None:
        """coarse  the task on larger cells that predicts the error of the grid, or None"""
        self.task, self.coarse, self._searches = task, coarse, dict[str, Search]()
        for sent, _ in task.sendings:
            twins = task.twins[sent]
            mirror = np.array([twins[p].pulse if p in twins else -1 for p in range(len(task.tx))])
            self._searches[sent] = anchor_search(
                task.along, anchors=anchors, tolerance=task.options.tolerance, mirror=mirror
            )
        self._asked = {sent: next(search) for sent, search in self._searches.items()}
        self.first = self._runs()
        if not isinstance(anchors, str):  # all anchors are known, and so is what is compared with them
            self.first += [run for sent, pulses in self._asked.items() for run in self._others(sent, pulses)]

    def _runs(self) -> list[Run]:
        return [run for sent, pulses in self._asked.items() for run in anchors_of(sent, pulses)]

    def _others(self, sent: str, anchors: Iterable[int]) -> list[Run]:
        """Runs that echoes from some anchors are compared with: for the check, and for the error of the grid."""
        others = []
        if self.task.options.check:
            others.append(Run(CHECK, sent, farthest_pulse(self.task, anchors)))
        if self.coarse:
            pulse = middle_anchor(self.task, anchors)
            others += [Run(kind, sent, pulse) for kind in ((COARSE, LOSSES) if self.task.losses else (COARSE,))]
        return others

    def anchored(self, runs: GridRuns) -> dict[str, Anchored]:
        """Run all anchors, and what they are compared with; the echoes of each polarisation that is sent."""
        runs.compute(self.first)
        anchored: dict[str, Anchored] = {}
        while self._asked:
            runs.compute(self._runs())
            for sent, pulses in list(self._asked.items()):
                echoes = [runs.echoes(run) for run in anchors_of(sent, pulses)]
                try:
                    self._asked[sent] = self._searches[sent].send(echoes)
                except StopIteration as end:
                    anchored[sent] = end.value
                    del self._asked[sent]
        runs.compute(run for sent, one in anchored.items() for run in self._others(sent, one.pulses))
        return {sent: anchored[sent] for sent, _ in self.task.sendings}


def formed_samples(searches: AnchorSearches, runs: GridRuns, clock: Clock) -> FormedSamples:
    """Runs the anchors of every polarisation that is sent, and forms the samples."""
    task = searches.task
    samples = np.empty((len(task.tx), len(task.polarizations), len(task.frequencies)), np.complex64)
    sums = ErrorSums()
    anchored = searches.anchored(runs)
    for sent, indices in task.sendings:
        samples[:, indices] = anchored[sent].samples
        sums.add(task, sent, anchored[sent])
        if searches.coarse:
            sums.add_grid_error(task, searches.coarse, runs, sent)
        if task.options.check:
            sums.add_check(task, runs, sent, anchored[sent])
    clock.lap("forming")
    return FormedSamples(samples, _report(task, sums, runs, clock))


def middle_anchor(task: FullwaveTask, anchors: Iterable[int]) -> int:
    """The pulse of the anchor that is nearest to the middle of the track."""
    middle = (task.along[0] + task.along[-1]) / 2
    return min(sorted(map(int, anchors)), key=lambda p: abs(task.along[p] - middle))


def farthest_pulse(task: FullwaveTask, anchors: Iterable[int]) -> int:
    """The pulse that is farthest from every anchor."""
    return int(np.argmax(np.abs(task.along[:, None] - task.along[list(anchors)]).min(axis=1)))


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


def error_terms(forming: float, truncation: float, options: FullwaveOptions) -> tuple[ErrorTerm, ...]:
    """Terms of the error of samples: waveform forming, and the part of the currents that runs end before."""
    remedy = SMALLER_TOLERANCE if isinstance(options.anchors, str) else "more anchors"
    return (
        ErrorTerm("waveform forming", forming, remedy),
        ErrorTerm("end of runs", truncation, SMALLER_TOLERANCE),
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

    def add_grid_error(self, task: FullwaveTask, coarse: FullwaveTask, runs: GridRuns, sent: str) -> None:
        """Add the error of the grid, predicted at the middle anchor."""
        pulse = middle_anchor(task, self.anchors[sent])
        error, power = grid_error(task, coarse, runs, Run(ANCHOR, sent, pulse))
        self.grid, self.grid_power, self.has_grid = self.grid + error, self.grid_power + power, True

    def add_check(self, task: FullwaveTask, runs: GridRuns, sent: str, echoes: Anchored) -> None:
        """Add the error at the pulse that is farthest from every anchor, by a run; it counts for all pulses."""
        pulse = farthest_pulse(task, self.anchors[sent])
        exact = runs.echoes(Run(CHECK, sent, pulse))[0]
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


def _report(task: FullwaveTask, sums: ErrorSums, runs: GridRuns, clock: Clock) -> Report:
    pulses, counts = list(sums.anchors.values()), runs.total
    plan: dict[str, object] = {
        "model": "full wave on a grid (FDTD)",
        "anchors": pulses[0] if all(p == pulses[0] for p in pulses) else sums.anchors,
        "runs": counts.runs,
        "mirrored": counts.mirrored,
        **task.grid_choices,
        "steps": int(counts.steps / counts.runs) if counts.runs else 0,
        "left": float(f"{counts.truncation:.1e}"),
        "run_bytes": round(task.run_bytes),
        "max_bytes": round(task.max_bytes),
        "parts": len(task.parts),
        "run_seconds": float(f"{counts.seconds / max(counts.runs, 1):.3g}"),
        **task.strips,
        **task.losses,
        **task.motion,
        **({"from files": f"{runs.from_files} runs"} if runs.from_files else {}),
    }
    terms = error_terms(sums.forming_error, counts.truncation, task.options)
    return Report(
        plan=plan,
        tolerance=task.options.tolerance,
        predicted_error=root_sum_square(terms),
        error_terms=terms,
        measured_error=sums.measured_error,
        contributions_done=counts.steps * task.n_cells,
        seconds=clock.seconds,
        device=" + ".join(runs.filler.workers.names),
        model_error=sums.model_error,
    )
