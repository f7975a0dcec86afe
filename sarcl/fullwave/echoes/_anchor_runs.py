"""Runs of the grid for the anchors of one polarisation that is sent: computed, kept in files, counted."""

from __future__ import annotations

import time
from dataclasses import dataclass, field

import numpy as np

from ...base.errors import warn
from ._anchor_files import AnchorFiles
from ._fullwave_task import FullwaveTask
from ._run_progress import RunProgress

UNFINISHED = 1e-3  # of the largest current: a warning where a run ends with more


@dataclass(eq=False)
class AnchorRuns:
    """Echoes at all pulses, formed from anchors one after the other.

    sent, received  the polarisation that is sent, and those that are received with it (Q)
    echoes          of each anchor's pulse, complex64 (P, Q, F)
    steps, runs, seconds  of the runs that this process did;  left  largest part of the currents that a run left
    """

    task: FullwaveTask
    sent: str
    received: list[str]
    files: AnchorFiles | None
    progress: RunProgress
    echoes: dict[int, np.ndarray] = field(default_factory=dict)
    steps: int = 0
    runs: int = 0
    seconds: float = 0.0
    left: float = 0.0

    def __call__(self, pulse: int) -> np.ndarray:
        """The echoes (P, Q, F) that are formed from the anchor at a pulse."""
        if pulse not in self.echoes:
            self.echoes[pulse] = self._found(pulse)
        return self.echoes[pulse]

    def _found(self, pulse: int) -> np.ndarray:
        task = self.task
        shape = len(task.tx), len(self.received), len(task.frequencies)
        kept = self.files.load(pulse, self.sent, shape) if self.files else None
        if kept is None:
            started = time.perf_counter()
            kept = task.formed(pulse, self.sent, self.received, np.arange(shape[0]), self.progress)
            self.seconds += time.perf_counter() - started
            self.runs += len(task.parts())
            self.steps += kept[1].steps
            if self.files:
                self.files.keep(pulse, self.sent, *kept)
        else:
            self.progress.run_done(len(task.parts()))
        echoes, ended = kept
        self.left = max(self.left, ended.left)
        if ended.left > UNFINISHED:
            warn(
                f"the currents of pulse {pulse} have fallen to {ended.left:.1e} of their peak alone when the run "
                f"ended after {ended.steps} steps: the bodies resonate, and the echo of what was left is missing"
            )
        return echoes
