"""Samples of all pulses from the runs of anchors, with what the report says of them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ...base.report import Report
from ...base.validation import array, choice, count, ndim
from ..anchors import Anchored, anchored
from ._anchor_files import AnchorFiles
from ._anchor_runs import AnchorRuns
from ._fullwave_task import FullwaveTask
from ._model_error import coarse_task, grid_error
from ._run_progress import RunProgress


@dataclass(frozen=True, eq=False)
class FormedSamples:
    """Echoes of all pulses, phase zero at the scene's centre, without the waveform's spectrum: complex64
    (P, polarisations, F); their report; files of finished anchors, where there are any.
    """

    samples: np.ndarray
    report: Report
    measured_error: float | None
    files: AnchorFiles | None


def formed_samples(task: FullwaveTask, anchors: Any, out: Any, *, check: bool, model_error: bool) -> FormedSamples:
    """Runs the anchors of every polarisation that is sent, and forms the samples.

    out  the file beside which finished anchors are kept, or None;  check, model_error  see fullwave_echo
    """
    request, n_pulses = task.request, len(task.tx)
    anchors = checked_anchors(anchors, n_pulses)
    task.warn_of_gaps()
    if model_error:
        coarse_task(task)  # what it refuses is refused before the runs
    files = None if out is None else AnchorFiles(out, task.fingerprint())
    samples = np.empty((n_pulses, len(request.polarizations), len(task.frequencies)), np.complex64)
    progress = RunProgress(request.report, 1, task.cost.steps)
    sums = _Sums()
    for sent, which in task.sendings():
        twins = task.twins(sent)
        runs = AnchorRuns(task, sent, [request.polarizations[i][0] for i in which], files, progress, twins)
        mirror = np.array([twins[p].pulse if p in twins else -1 for p in range(n_pulses)])
        made = anchored(runs, task.along, anchors=anchors, tolerance=request.tolerance, mirror=mirror)
        request.clock.lap("runs")
        samples[:, which] = made.samples
        sums.add(task, runs, made)
        if model_error:
            sums.add_grid_error(task, runs, made)
            request.clock.lap("model error")
        if check:
            sums.add_check(task, runs, made)
            request.clock.lap("check")
    progress.finish()
    return FormedSamples(samples, sums.report(task), sums.measured, files)


def checked_anchors(asked: Any, n_pulses: int) -> str | int | np.ndarray:
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


class _Sums:
    """What the report says, added up over the polarisations that are sent; errors are weighted by energy."""

    def __init__(self) -> None:
        self.anchors: dict[str, list[int]] = {}
        self.runs, self.mirrored, self.steps, self.seconds, self.left = 0, 0, 0, 0.0, 0.0
        self.power, self.forming, self.checked = 0.0, 0.0, 0.0
        self.grid = self.grid_power = 0.0
        self.has_grid = self.has_check = False

    def add(self, task: FullwaveTask, runs: AnchorRuns, made: Anchored) -> None:
        power = float((np.abs(made.samples * np.abs(task.spectrum)) ** 2).sum())
        self.anchors[runs.sent] = [int(p) for p in made.pulses]
        self.power += power
        if np.ptp(task.along):  # else one run is that of every pulse
            self.forming += made.predicted_error**2 * power
        self._count(runs)

    def _count(self, runs: AnchorRuns) -> None:
        self.runs, self.steps, self.seconds = (
            self.runs + runs.runs,
            self.steps + runs.steps,
            self.seconds + runs.seconds,
        )
        self.left, self.mirrored = max(self.left, runs.left), self.mirrored + runs.mirrored

    def add_grid_error(self, task: FullwaveTask, runs: AnchorRuns, made: Anchored) -> None:
        middle = (task.along[0] + task.along[-1]) / 2
        pulse = min(self.anchors[runs.sent], key=lambda p: abs(task.along[p] - middle))
        wrong, power = grid_error(task, pulse, runs.sent, runs.received, runs(pulse), runs.progress)
        self.grid, self.grid_power, self.has_grid = self.grid + wrong, self.grid_power + power, True

    def add_check(self, task: FullwaveTask, runs: AnchorRuns, made: Anchored) -> None:
        """One run at the pulse that is farthest from every anchor; its error counts for all pulses."""
        at = np.abs(task.along[:, None] - task.along[self.anchors[runs.sent]]).min(axis=1)
        pulse = int(np.argmax(at))
        wanted = task.formed(pulse, runs.sent, runs.received, np.array([pulse]), runs.progress)[0][0][0]
        wrong = float((np.abs((made.samples[pulse] - wanted) * np.abs(task.spectrum)) ** 2).sum())
        self.checked, self.has_check = self.checked + len(task.tx) * wrong, True

    @property
    def measured(self) -> float | None:
        """Relative error of the samples, measured."""
        return float(np.sqrt(self.checked / self.power)) if self.has_check and self.power else None

    def report(self, task: FullwaveTask) -> Report:
        lists = list(self.anchors.values())
        said: dict[str, object] = {
            "model": "full wave on a grid (FDTD)",
            "anchors": lists[0] if all(x == lists[0] for x in lists) else self.anchors,
            "runs": self.runs,
            "mirrored": self.mirrored,
            "cells": float(f"{task.carried_cells:.4g}"),
            "cell_m": float(f"{task.lattice.cell:.4g}"),
            "grid": " x ".join(map(str, task.lattice.shape)),
            "steps": int(self.steps / self.runs) if self.runs else 0,
            "left": float(f"{self.left:.1e}"),
            "bytes": round(task.cost.bytes(task.parts()[0].stop)),
            "max_bytes": round(task.max_bytes),
            "parts": len(task.parts()),
            "seconds_per_run": float(f"{self.seconds / max(self.runs, 1):.3g}"),
            **task.strips,
            **task.losses,
            **task.motion,
        }
        return Report(
            plan=said,
            tolerance=task.request.tolerance,
            predicted_error=float(np.sqrt(self.forming / self.power)) if self.power else 0.0,
            measured_error=self.measured,
            contributions_done=int(self.steps * np.prod(task.lattice.shape)),
            seconds=task.request.clock.seconds,
            device=task.device.info.name,
            model_error=float(np.sqrt(self.grid / self.grid_power)) if self.has_grid and self.grid_power else None,
        )
