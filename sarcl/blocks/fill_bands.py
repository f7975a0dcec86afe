"""The bands of a result computed by workers, into an output or into tile files."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import closing
from dataclasses import dataclass

from ..base.stage_timer import Clock
from ..opencl.failures import DeviceFailed
from .bands import BandBuffer, FlatArray, Run, Tally
from .block_job import BlockJob
from .checkpoint import Checkpoint
from .tile_files import gaps, part, share
from .workers import Work, WorkerPool

MOST_FILES = 64  # blocks per result, where finished bands are written to files: each block makes one file


@dataclass(frozen=True, eq=False)
class BandFiller:
    """Workers with the job and the files of one result.

    checkpoint  None where no tile files are kept;  progress  as every verb takes it
    """

    workers: WorkerPool
    job: BlockJob
    checkpoint: Checkpoint | None
    clock: Clock
    progress: Callable[[str, int, int], None] | None

    def fill_piece(self, piece: tuple[int, int], runs: Sequence[Run] | None = None) -> bool:
        """Compute the bands of piece (i, n) of `runs`, by default of all bands, into tile files; whether every band of
        `runs` has one then."""
        runs = [(0, self.job.bands.n_bands)] if runs is None else runs
        self.fill(None, part(runs, *share(sum(b - a for a, b in runs), *piece, self.job.unit)))
        return self.checkpoint is not None and self.checkpoint.complete(runs)

    def fill(self, flat: FlatArray | None, runs: Sequence[Run] | None = None) -> tuple[Tally, int]:
        """Compute runs of bands, by default all, into the flat array, or only into tile files; returns the sum of the
        tallies in the order of the bands, and the number of bands that files already held."""
        job, bands, checkpoint = self.job, self.job.bands, self.checkpoint
        runs = [(0, bands.n_bands)] if runs is None else runs
        there, tallies = [], list[tuple[int, Tally]]()
        for asked in runs if checkpoint else ():
            for run, values, tally in checkpoint.found(*asked) if checkpoint else ():
                if run not in there:
                    if flat is not None:
                        flat[bands.extent(*run)] = values
                    there.append(run)
                    tallies.append((run[0], tally))
        todo = [gap for run in runs for gap in gaps(there, *run)]
        units = sum(bands.count(*run) for run in todo)
        total, reported = job.passes * units, -1

        def on_progress(done: int) -> None:
            nonlocal reported
            if self.progress and done != reported:
                self.progress(job.stage, done, total)
                reported = done

        def output_for(first: int, last: int) -> FlatArray:
            return BandBuffer(bands, first, last, job.dtype) if flat is None else flat

        most = float("inf")
        if checkpoint and checkpoint.resume is not False:
            most = max(units / MOST_FILES, self.workers.least)
        if flat is None:
            most = min(most, self.workers.most)
        self.clock.lap("files")
        finished = []
        try:
            work = Work(todo, most, job.unit, output_for, self.clock, on_progress)
            with closing(self.workers.compute(work)) as blocks:
                for first, last, values_at, tally in blocks:
                    finished.append((first, last))
                    tallies.append((first, tally))
                    if checkpoint:
                        checkpoint.keep(first, last, values_at, tally)
                        self.clock.lap("files")
        except DeviceFailed:
            if checkpoint and flat is not None:  # without an output every block is written at once
                checkpoint.rescue(flat)
            raise
        if missing := [gap for run in runs for gap in gaps(there + finished, *run)]:
            raise RuntimeError(f"bands {missing} were left out; please report this")
        tally = job.tally()
        for _, one in sorted(tallies, key=lambda pair: pair[0]):
            tally = tally + one
        return tally, sum(b - a for a, b in there)
