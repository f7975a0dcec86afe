"""Runs of the grid for the anchors of one polarisation that is sent: computed, kept in files, counted."""

from __future__ import annotations

import time
from dataclasses import dataclass, field

import numpy as np

from ..runs import RunEnd, Twin
from ._anchor_files import AnchorFiles
from ._fullwave_task import FullwaveTask
from ._run_progress import RunProgress


@dataclass(eq=False)
class AnchorRuns:
    """Echoes at all pulses, formed from anchors one after the other.

    sent, received  the polarisation that is sent, and those that are received with it (Q)
    twins           pulses whose anchor the run of another serves too, by mirror symmetry
    echoes          of each anchor's pulse, complex64 (P, Q, F)
    steps, runs, seconds  of the runs that this process did;  mirrored  anchors that runs of others served
    left            largest part of the currents that would have followed after a run
    """

    task: FullwaveTask
    sent: str
    received: list[str]
    files: AnchorFiles | None
    progress: RunProgress
    twins: dict[int, Twin]
    echoes: dict[int, np.ndarray] = field(default_factory=dict)
    steps: int = 0
    runs: int = 0
    mirrored: int = 0
    seconds: float = 0.0
    left: float = 0.0

    def __call__(self, pulse: int) -> np.ndarray:
        """The echoes (P, Q, F) that are formed from the anchor at a pulse."""
        if pulse not in self.echoes and not self._load(pulse):
            twin = self.twins.get(pulse)
            started = time.perf_counter()
            found, ended = self.task.formed(
                pulse, self.sent, self.received, np.arange(len(self.task.tx)), self.progress, twin
            )
            self.seconds += time.perf_counter() - started
            self.runs += len(self.task.parts())
            self.steps += ended.steps
            numbers = [pulse, *([twin.pulse] if twin else [])]
            self.mirrored += len(numbers) - 1
            # the twin first: where a kill leaves one file, both are made again, by this run and not by the twin's own
            for number, echoes in reversed(list(zip(numbers, found, strict=True))):
                if self.files:
                    self.files.keep(number, self.sent, echoes, ended)
                self.echoes[number] = echoes
            self._look_at(pulse, ended)
        return self.echoes[pulse]

    def _load(self, pulse: int) -> bool:
        """Take the echoes from a file, if there is one."""
        shape = len(self.task.tx), len(self.received), len(self.task.frequencies)
        kept = self.files.load(pulse, self.sent, shape) if self.files else None
        if kept is None:
            return False
        self.echoes[pulse], ended = kept
        self.progress.run_done(len(self.task.parts()))
        self._look_at(pulse, ended)
        return True

    def _look_at(self, pulse: int, ended: RunEnd) -> None:
        """Warn where the currents had not decayed."""
        self.left = max(self.left, ended.left)
        self.task.warn_of_unfinished(pulse, ended)
