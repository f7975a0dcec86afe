"""Runs of the grid for one task: computed several at a time, kept in files, counted."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field

import numpy as np

from ...base.errors import warn
from ...blocks.bands import Run as BandRun
from ...blocks.block_job import BlockJob
from ...blocks.fill_bands import BandFiller
from ...io import output_paths
from ...simulation.echo_files import job_description
from ._fullwave_task import FullwaveTask
from ._run_bands import ANCHOR, STAGE, Run, RunBands, RunEchoes, RunTally

UNFINISHED = 1e-2  # of the currents: a warning where more would follow after the end of a run


def run_job(task: FullwaveTask, bands: RunBands, anchors: str | int | np.ndarray) -> BlockJob:
    """The job of the runs that a task needs; anchors  as they were asked for."""

    def describe() -> dict[str, object]:
        options = task.options
        named: dict[str, object] = {
            "tolerance": options.tolerance,
            "polarization": ", ".join(task.polarizations),
            "cells": f"{task.cells:.6g} in {len(task.parts)} parts of the band",
            "anchors": str(anchors if isinstance(anchors, (str, int)) else anchors.tolist()),
            "model_error": None,  # runs for it change no sample
        }
        subjects = {"scene": task.scene, "waveform": task.waveform, "track": task.track}
        shape = len(task.tx), len(task.polarizations), len(task.frequencies)
        return job_description(options, subjects, shape, named)

    return BlockJob(
        kind="phase history",
        stage=STAGE,
        bands=bands,
        unit=1,
        dtype=np.complex64,
        tally=RunTally,
        passes=1,
        describe=describe,
        folder=output_paths.ANCHORS,
    )


@dataclass(eq=False)
class RunProgress:
    """Progress of rounds of runs, counted together: the total grows with every round.

    report  called as report(stage, done, total), or None
    """

    report: Callable[[str, int, int], None] | None
    _before: int = 0  # steps of the rounds before
    _total: int = 0

    def __call__(self, stage: str, done: int, total: int) -> None:
        """Report the steps that are done of this round, and its steps."""
        if self.report:
            self.report(stage, self._before + done, self._before + total)
        self._total = total

    def round_done(self) -> None:
        """Count the steps of a round whose runs are all done."""
        self._before, self._total = self._before + self._total, 0


@dataclass(eq=False)
class GridRuns:
    """Echoes of runs, which the workers of a filler compute.

    total   counts of all runs for anchors;  from_files  number of runs that files of earlier calls held
    """

    bands: RunBands
    filler: BandFiller
    progress: RunProgress
    total: RunTally = field(default_factory=RunTally)
    from_files: int = 0
    _echoes: RunEchoes = field(default_factory=RunEchoes)
    _serving: dict[Run, tuple[Run, int]] = field(default_factory=dict)  # run of an anchor, 1: as its twin
    _is_warned: bool = False

    def needed(self, runs: Iterable[Run]) -> list[BandRun]:
        """Bands of the runs by which all of these have echoes: mirror images of anchors before need none."""
        serving = dict(self._serving)
        for run in runs:
            self._serve(run, serving)
        numbers = sorted({self.bands.number(run) for run, _ in serving.values()})
        return [(n, n + 1) for n in numbers if not self._echoes.has(self.bands.extent(n, n + 1))]

    def _serve(self, run: Run, serving: dict[Run, tuple[Run, int]]) -> None:
        """Store the run that gives the echoes of `run`: itself, unless a mirrored anchor gave them."""
        if run not in serving:
            serving[run] = run, 0
            twin = self.bands.twin(run)
            if twin is not None:
                serving.setdefault(run._replace(pulse=twin.pulse), (run, 1))

    def compute(self, runs: Iterable[Run]) -> None:
        """Compute runs that are not computed yet, as many at a time as there are workers.

        SarclWarning, once, where the currents of one had not decayed when it ended.
        """
        runs = list(runs)
        bands = self.needed(runs)
        for run in runs:
            self._serve(run, self._serving)
        if bands:
            tally, n_kept = self.filler.fill(self._echoes, bands)
            assert isinstance(tally, RunTally)
            self.total, self.from_files = self.total + tally, self.from_files + n_kept
            self.progress.round_done()
            self._warn_of_resonance()

    def echoes(self, run: Run) -> np.ndarray:
        """Echoes (n, Q, F) of a run that is computed."""
        own, part = self._serving[run]
        number = self.bands.number(own)
        rows: np.ndarray = self._echoes[self.bands.extent(number, number + 1)]
        return rows.reshape(self.bands.shape(own))[part]

    def _warn_of_resonance(self) -> None:
        """Warn once of a run that ended before its currents had decayed; bodies with a gap are named before."""
        total = self.total
        if total.truncation > UNFINISHED and self.bands.task.target.gap is None and not self._is_warned:
            self._is_warned = True
            warn(
                f"the run of pulse {total.pulse} ended after {total.ended} steps, and {total.truncation:.1e} of the "
                "currents would have followed: the bodies resonate, and that part of the echo is missing; "
                "report.plan['left'] is the largest of all runs"
            )


def anchors_of(sent: str, pulses: Iterable[int]) -> list[Run]:
    """Runs for anchors at some pulses."""
    return [Run(ANCHOR, sent, int(pulse)) for pulse in pulses]
