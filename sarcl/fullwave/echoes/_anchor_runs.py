"""Runs of the grid for the anchors of one polarisation that is sent: computed, kept in files, counted."""

from __future__ import annotations

import time
from dataclasses import dataclass, field

import numpy as np

from ...base.errors import warn
from ..mirrors import Twin
from ..runs import RunEnd
from ._anchor_files import AnchorFiles
from ._fullwave_task import FullwaveTask
from ._run_progress import RunProgress

UNFINISHED = 1e-2  # of the currents: a warning where more would follow after the end of a run


@dataclass(eq=False)
class RunCounts:
    """Counts of the runs for all anchors of one task.

    runs, steps, seconds  of the runs that this process did;  mirrored  anchors that runs of others served
    left                  largest part of the currents that would have followed after a run
    """

    runs: int = 0
    steps: int = 0
    seconds: float = 0.0
    mirrored: int = 0
    left: float = 0.0
    _is_warned: bool = False

    def note_end(self, task: FullwaveTask, pulse: int, ended: RunEnd) -> None:
        """Note how a run ended; SarclWarning, once, where currents had not decayed, none where a gap, which has been
        warned of, is the reason.
        """
        self.left = max(self.left, ended.left)
        if ended.left > UNFINISHED and task.target.gap is None and not self._is_warned:
            self._is_warned = True
            warn(
                f"the run of pulse {pulse} ended after {ended.steps} steps, and {ended.left:.1e} of the currents would "
                "have followed: the bodies resonate, and that part of the echo is missing; report.plan['left'] is the "
                "largest of all runs"
            )


@dataclass(eq=False)
class AnchorRuns:
    """Echoes at all pulses, formed from anchors one after the other.

    sent, received  the polarisation that is sent, and those that are received with it (Q)
    twins           pulses whose anchor the run of another serves too, by mirror symmetry
    echoes          of each anchor's pulse, complex64 (P, Q, F)
    counts          of the runs of all polarisations that are sent
    """

    task: FullwaveTask
    sent: str
    received: list[str]
    files: AnchorFiles | None
    progress: RunProgress
    twins: dict[int, Twin]
    counts: RunCounts
    echoes: dict[int, np.ndarray] = field(default_factory=dict)

    def __call__(self, pulse: int) -> np.ndarray:
        """The echoes (P, Q, F) that are formed from the anchor at a pulse."""
        if pulse not in self.echoes and not self._load(pulse):
            twin = self.twins.get(pulse)
            started = time.perf_counter()
            formed, ended = self.task.formed(
                pulse, self.sent, self.received, np.arange(len(self.task.tx)), self.progress, twin
            )
            numbers = [pulse, *([twin.pulse] if twin else [])]
            self.counts.runs += len(self.task.parts)
            self.counts.steps += ended.steps
            self.counts.mirrored += len(numbers) - 1
            self.counts.seconds += time.perf_counter() - started
            # the twin first: where a kill leaves one file, both are made again, by this run and not by the twin's own
            for number, echoes in reversed(list(zip(numbers, formed, strict=True))):
                if self.files:
                    self.files.keep(number, self.sent, echoes, ended)
                self.echoes[number] = echoes
            self.counts.note_end(self.task, pulse, ended)
        return self.echoes[pulse]

    def _load(self, pulse: int) -> bool:
        """Take the echoes from a file, if there is one."""
        shape = len(self.task.tx), len(self.received), len(self.task.frequencies)
        kept = self.files.load(pulse, self.sent, shape) if self.files else None
        if kept is None:
            return False
        self.echoes[pulse], ended = kept
        self.progress.run_done(len(self.task.parts))
        self.counts.note_end(self.task, pulse, ended)
        return True
