"""The bands of an image focused by workers, into an output or into tile files."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import closing
from dataclasses import dataclass

from ...base.stage_timer import Clock
from ...opencl.failures import DeviceFailed
from ..choose_method import MethodChoice
from ..engine import Skipped
from ..focusing_task import FocusingTask
from ..tiling.tiling import FlatImage, Run
from .checkpoint import Checkpoint
from .image_output import BandBuffer, ImageOutput
from .tile_files import gaps
from .workers import Work, WorkerPool

MOST_FILES = 64  # blocks per image, where finished tiles are written to files: each block makes one file


@dataclass(frozen=True, eq=False)
class BandFiller:
    """Workers with the task, the method and the files of one image.

    checkpoint  None where no tile files are kept;  progress  as `backproject` takes it
    """

    workers: WorkerPool
    task: FocusingTask
    chosen: MethodChoice
    checkpoint: Checkpoint | None
    clock: Clock
    progress: Callable[[str, int, int], None] | None

    def fill(self, output: ImageOutput | None, bands: Run) -> tuple[Skipped, int]:
        """Focus a run of bands into `output`, or only into tile files; returns the pairs skipped and the number of
        bands that files already held."""
        tiling, n_rows, checkpoint = self.chosen.tiling, self.task.raw.n_rows, self.checkpoint
        there, skipped = [], Skipped()
        for run, values, missed in checkpoint.found(*bands) if checkpoint else ():
            if output is not None:
                output.flat[tiling.extent(*run)] = values
            there.append(run)
            skipped += missed
        todo = gaps(there, *bands)
        total = n_rows * sum(tiling.count(*run) for run in todo)
        reported = -1

        def on_progress(done: int) -> None:
            nonlocal reported
            if self.progress and done != reported:
                self.progress("backproject", done, total)
                reported = done

        def output_for(first: int, last: int) -> FlatImage:
            return BandBuffer(tiling, first, last, self.chosen.dtype) if output is None else output.flat

        most = float("inf")
        if checkpoint and checkpoint.resume is not False:
            most = max(total / max(n_rows, 1) / MOST_FILES, self.workers.least_pixels)
        self.clock.lap("files")
        focused = []
        try:
            work = Work(todo, most, self.chosen.unit, output_for, self.clock, on_progress)
            with closing(self.workers.focus(work)) as blocks:
                for first, last, flat, missed in blocks:
                    focused.append((first, last))
                    skipped += missed
                    if checkpoint:
                        checkpoint.keep(first, last, flat, missed)
                        self.clock.lap("files")
        except DeviceFailed:
            if checkpoint and output is not None:  # without an output every tile is written at once
                checkpoint.rescue(output.flat)
            raise
        if gaps(there + focused, *bands):
            raise RuntimeError(f"bands {gaps(there + focused, *bands)} were left out; please report this")
        return skipped, sum(b - a for a, b in there)
