"""Runs of the grid as a job that is computed in blocks: a band is a run, whoever computes it."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from ...base.stage_timer import Clock
from ...blocks.bands import FlatArray
from ...blocks.bands import Run as BandRun
from ...opencl.device import Device
from ..mirrors import Twin
from ._fullwave_task import FullwaveTask

STAGE = "full-wave runs"
# what runs are for: anchors; the check between anchors; the model error, by larger cells, and of losses over the band
ANCHOR, CHECK, COARSE, LOSSES = KINDS = "anchor", "check", "coarse", "losses"
MOST_PULSES = 32  # at which echoes of the grid and of larger cells are compared


class Run(NamedTuple):
    """A run of the grid: one of KINDS, the polarisation that is sent, and the pulse whose wave it is of."""

    kind: str
    sent: str
    pulse: int


@dataclass(frozen=True)
class RunTally:
    """Counts of runs for anchors: see blocks.bands.Tally.

    steps, seconds  of all;  mirrored  anchors that runs of others served
    truncation      largest part of the currents that would have followed after a run: that of `pulse`, after `ended`
                    steps
    """

    runs: int = 0
    steps: int = 0
    seconds: float = 0.0
    mirrored: int = 0
    truncation: float = 0.0
    pulse: int = 0
    ended: int = 0

    def __add__(self, other: RunTally) -> RunTally:
        worst = self if self.truncation >= other.truncation else other
        return RunTally(
            self.runs + other.runs,
            self.steps + other.steps,
            self.seconds + other.seconds,
            self.mirrored + other.mirrored,
            worst.truncation,
            worst.pulse,
            worst.ended,
        )


@dataclass(frozen=True, eq=False)
class RunBands:
    """All runs that a task may need, in bands of one run: see blocks.bands.Bands. Few of them are computed.

    A row holds the samples of one pulse and polarisation. Rows of a band: echoes at some pulses, in all polarisations
    that are received, and for an anchor with a twin those of the twin after its own.

    coarse  the task on larger cells, or None
    """

    task: FullwaveTask
    coarse: FullwaveTask | None

    @property
    def n_bands(self) -> int:
        """Number of runs: of every kind, for every polarisation that is sent and every pulse."""
        return len(KINDS) * len(self.task.sendings) * len(self.task.tx)

    @property
    def row_shape(self) -> tuple[int, ...]:
        """Shape of a row: its samples."""
        return self.task.frequencies.shape

    def number(self, run: Run) -> int:
        """The band of a run."""
        sent = [name for name, _ in self.task.sendings].index(run.sent)
        return (KINDS.index(run.kind) * len(self.task.sendings) + sent) * len(self.task.tx) + run.pulse

    def run(self, band: int) -> Run:
        """The run of a band."""
        rest, pulse = divmod(band, len(self.task.tx))
        kind, sent = divmod(rest, len(self.task.sendings))
        return Run(KINDS[kind], self.task.sendings[sent][0], pulse)

    def received(self, sent: str) -> list[str]:
        """Polarisations that are received with one that is sent."""
        return [self.task.polarizations[i][0] for i in dict(self.task.sendings)[sent]]

    def pulses(self, run: Run) -> np.ndarray:
        """Pulses at which echoes are formed from a run (n,)."""
        n = len(self.task.tx)
        if run.kind == ANCHOR:
            return np.arange(n)
        if run.kind == CHECK:
            return np.array([run.pulse])
        return np.unique(np.append(np.linspace(0, n - 1, min(MOST_PULSES, n)).round().astype(int), run.pulse))

    def twin(self, run: Run) -> Twin | None:
        """The anchor that the run of another serves too."""
        return self.task.twins[run.sent].get(run.pulse) if run.kind == ANCHOR else None

    def shape(self, run: Run) -> tuple[int, int, int, int]:
        """Shape of the echoes of a run: its own and its twin's, pulses, polarisations received, samples."""
        twins = 1 if self.twin(run) is None else 2
        return twins, len(self.pulses(run)), len(self.received(run.sent)), *self.row_shape  # type: ignore[return-value]

    @cached_property
    def _first_rows(self) -> np.ndarray:
        """First row of every band, and the number of all rows (n_bands + 1,)."""
        n, pulses = len(self.task.tx), np.arange(len(self.task.tx))
        even = self.pulses(Run(COARSE, "", 0))
        compared = len(even) + 1 - np.isin(pulses, even)
        rows = [np.zeros(1, np.int64)]
        for kind in KINDS:
            for sent, indices in self.task.sendings:
                twins = np.isin(pulses, list(self.task.twins[sent]))
                each = n * (1 + twins) if kind == ANCHOR else np.ones(n, np.int64) if kind == CHECK else compared
                rows.append(each * len(indices))
        return np.cumsum(np.concatenate(rows))

    def extent(self, first: int, last: int) -> slice:
        """Rows of runs first ... last - 1."""
        return slice(int(self._first_rows[first]), int(self._first_rows[last]))

    def count(self, first: int, last: int) -> int:
        """Steps of these runs, about."""
        of_kinds = len(self.task.sendings) * len(self.task.tx)
        coarse = self.coarse or self.task
        fine, larger = (max(1, task.cost.steps) * len(task.parts) for task in (self.task, coarse))
        n_fine = max(0, min(last, 2 * of_kinds) - first)
        return n_fine * fine + (last - first - n_fine) * larger


class RunEchoes:
    """Echoes of the runs that are finished: see blocks.bands.FlatArray, of which it holds these bands alone."""

    def __init__(self) -> None:
        self._rows: dict[int, np.ndarray] = {}  # by the first row of a band

    def __setitem__(self, rows: slice | tuple[slice, slice], block: np.ndarray) -> None:
        assert isinstance(rows, slice)
        self._rows[rows.start] = block

    def __getitem__(self, rows: slice) -> np.ndarray:
        start = max(first for first in self._rows if first <= rows.start)
        return self._rows[start][rows.start - start : rows.stop - start]

    def has(self, rows: slice) -> bool:
        """Whether a band of these rows is finished."""
        return rows.start in self._rows


class RunEngine:
    """Runs of a task on its device: see blocks.bands.Engine."""

    least, most = 0.0, float("inf")

    def __init__(self, bands: RunBands, device: Device) -> None:
        self.bands, coarse = bands, bands.coarse
        self.task = bands.task if bands.task.device is device else bands.task.on(device)
        self.coarse = coarse if coarse is None or coarse.device is device else coarse.on(device)

    def blocks(self, nbytes: float) -> list[BandRun]:
        """See Engine: each run by itself."""
        return [(0, self.bands.n_bands)]

    def fill(
        self,
        first: int,
        last: int,
        flat: FlatArray,
        budget: float,
        clock: Clock,
        on_progress: Callable[[float], None],
    ) -> RunTally:
        """See Engine; the memory of a run is that of its task."""
        total, count = RunTally(), self.bands.count
        total_steps = count(first, last)
        for band in range(first, last):
            before, steps = count(first, band), count(band, band + 1)

            def share_done(share: float, before: int = before, steps: int = steps) -> None:
                on_progress((before + share * steps) / total_steps)

            total += self._one(band, flat, share_done)
        clock.lap(STAGE)
        return total

    def _one(self, band: int, flat: FlatArray, progress: Callable[[float], None]) -> RunTally:
        """Compute a run, and write its echoes to their rows."""
        bands, started = self.bands, time.perf_counter()
        run = bands.run(band)
        twin, received = bands.twin(run), bands.received(run.sent)
        formed, end = self._task_of(run.kind).formed(run.pulse, run.sent, received, bands.pulses(run), progress, twin)
        flat[bands.extent(band, band + 1)] = np.stack(formed).reshape(-1, *bands.row_shape)
        if run.kind != ANCHOR:
            return RunTally()
        return RunTally(
            runs=len(self.task.parts),
            steps=end.steps,
            seconds=time.perf_counter() - started,
            mirrored=len(formed) - 1,
            truncation=end.left,
            pulse=run.pulse,
            ended=end.steps,
        )

    def _task_of(self, kind: str) -> FullwaveTask:
        if kind in (ANCHOR, CHECK):
            return self.task
        assert self.coarse is not None
        return self.coarse if kind == COARSE else self.coarse.with_upper_losses


@dataclass(frozen=True, eq=False)
class RunRecipe:
    """How runs are computed on a device: see blocks.bands.Recipe."""

    bands: RunBands

    def on(self, device: Device) -> RunEngine:
        """The engine on one device."""
        return RunEngine(self.bands, device)

    def budget(self, device: Device) -> float:
        """Bytes that a run may take, on every device."""
        return self.bands.task.max_bytes
