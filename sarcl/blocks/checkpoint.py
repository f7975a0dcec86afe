"""When finished tiles are written to files, and when these files are removed."""

from __future__ import annotations

import logging
import math
import time
from collections.abc import Iterable, Iterator

import numpy as np

from ..base import host_memory
from ..base.types import PathLike
from ..io import formats, output_paths
from ..io.hdf5 import BLOCK_BYTES
from ..model import store
from ..model.image import Image
from ..model.phase_history import PhaseHistory
from .bands import FlatArray, Run, Tally
from .block_job import BlockJob
from .tile_files import TileStore, discard, folder_of, gaps

log = logging.getLogger(__name__)

PERIOD = 1.0  # s: a run that ends sooner writes no tile files
WORTH = 60.0  # s: a run that fails or is interrupted sooner removes its tile files, unless resume=True


def _parts(flat: FlatArray, at: slice, row_bytes: int) -> Iterator[np.ndarray]:
    """Rows `at` of the flat array or of a BandBuffer, of row_bytes each, some at a time: they may lie in a file."""
    step = max(1, BLOCK_BYTES // row_bytes)
    for start in range(at.start, at.stop, step):
        yield flat[start : min(start + step, at.stop)]


class Checkpoint:
    """Keeps the finished bands of the result `path` in files, as `resume` says.

    True   always, also where the run ends in an exception
    None   from PERIOD seconds on, so that a killed run loses no finished tile; a run that ends in an exception before
           WORTH seconds removes the files that it wrote, unless its devices were lost
    False  never; the files of earlier runs are deleted by `begin`

    The constructor describes the job where there are tile files, or resume is True: for an image it reads all samples.
    ValueError: the files belong to another job. As a context manager it ends with the run: an exception in its block is
    one that ended the run.
    """

    def __init__(self, path: PathLike, job: BlockJob, resume: bool | None) -> None:
        self.path, self.job = path, job
        self.folder, self.resume = folder_of(path, job), resume
        self.tiles: TileStore | None = None
        self.begun = time.monotonic()
        self.fresh, self._are_lost = True, False
        self._waiting: list[tuple[int, int, Tally]] = []
        self._row_bytes = np.dtype(job.dtype).itemsize * math.prod(job.bands.row_shape)
        if resume is not False and (resume or self.folder.exists()):
            output_paths.check_writable(path)
            self._open()

    def begin(self) -> None:
        """Delete the files of earlier runs where resume is False: this run alone makes the result now."""
        if self.resume is False:
            discard(self.folder)

    @property
    def mark(self) -> str | None:
        """Fingerprint of the job, or None where no tile files were needed."""
        return self.tiles.mark if self.tiles else None

    def finished(self) -> Image | PhaseHistory | None:
        """The result, if this very job has completed it already."""
        if self.mark is None or formats.writer_functions(self.path, self.job.kind).job_of(self.path) != self.mark:
            return None
        self.done()
        return store.read(self.path)

    def complete(self, runs: Iterable[Run]) -> bool:
        """Whether every band of `runs` has a tile file."""
        there = self.tiles.runs() if self.tiles else []
        return not any(gaps(there, *run) for run in runs)

    def found(self, first: int, last: int) -> Iterator[tuple[Run, np.ndarray, Tally]]:
        """Tiles of earlier runs; see TileStore.found."""
        if self.tiles is not None:
            yield from self.tiles.found(first, last)

    def keep(self, first: int, last: int, flat: FlatArray, tally: Tally) -> None:
        """Bands first ... last - 1 are finished in `flat` (the flat array, or a BandBuffer of just them)."""
        if self.resume is False:
            return
        self._waiting.append((first, last, tally))
        if self.tiles is not None or time.monotonic() - self.begun >= PERIOD:
            self._write(flat)

    def rescue(self, flat: FlatArray) -> None:
        """The devices are lost: finished tiles, in `flat`, stay however short the run was."""
        if self.resume is False:
            return
        self._are_lost = True
        if self._waiting:
            self._write(flat)

    def _write(self, flat: FlatArray) -> None:
        try:
            tiles = self.tiles or self._open()
            for a, b, n in self._waiting:
                rows = self.job.bands.extent(a, b)
                host_memory.release(self._row_bytes * (rows.stop - rows.start))
                tiles.save(a, b, _parts(flat, rows, self._row_bytes), n)
        except (OSError, TypeError) as exc:
            if self.resume:
                raise
            log.warning("finished tiles cannot be kept in %s: %s; a killed run would start again", self.folder, exc)
            self.resume = False
        self._waiting.clear()

    def done(self) -> None:
        """Remove the tile files: the result is complete."""
        if self.tiles is not None:
            self.tiles.clear()

    def __enter__(self) -> Checkpoint:
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        if kind is None or self.tiles is None:
            return
        if self.resume or self._are_lost or not self.fresh or time.monotonic() - self.begun >= WORTH:
            log.warning("finished tiles are kept in %s; the same call continues from them", self.folder)
        else:
            self.tiles.clear()

    def _open(self) -> TileStore:
        self.fresh = not self.folder.exists()
        try:
            self.tiles = TileStore(self.folder, self.job)
        except FileNotFoundError:  # another run has just completed the result and taken the folder away
            self.tiles = TileStore(self.folder, self.job)
        return self.tiles
