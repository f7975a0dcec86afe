"""Complex arrays that may be larger than the memory for blocks: then they lie in a temporary file."""

from __future__ import annotations

import tempfile
import threading
from pathlib import Path

import numpy as np

from ...base.types import PathLike


class Scratch:
    """complex64 (n, m), zeros at first: in memory where it takes up to `room` bytes, else in a file without a name.

    folder  of the file; None: that of temporary files. The file is read and written in parts, not mapped: pages of a
    mapped file count as memory of the process. Several threads may use other rows of it at the same time: it is a
    blocks.bands.FlatArray.
    """

    def __init__(self, shape: tuple[int, int], room: float, folder: Path | None) -> None:
        self.shape, nbytes = shape, 8 * shape[0] * shape[1]
        self.whole = np.zeros(shape, np.complex64) if nbytes <= room else None
        if self.whole is None:
            self.file = tempfile.TemporaryFile(dir=folder, buffering=0)
            self.file.truncate(nbytes)
            self._lock = threading.Lock()  # a place in the file belongs to one thread until it is read or written

    def __getitem__(self, rows: slice) -> np.ndarray:
        return self.rows(rows.start, rows.stop)

    def __setitem__(self, rows: slice | tuple[slice, slice], block: np.ndarray) -> None:
        assert isinstance(rows, slice)
        self.put(rows.start, block)

    def rows(self, first: int, stop: int) -> np.ndarray:
        """Rows first ... stop - 1: (stop - first, m)."""
        if self.whole is not None:
            return self.whole[first:stop]
        out = np.empty((stop - first, self.shape[1]), np.complex64)
        rest = out.view(np.uint8).ravel().data
        with self._lock:
            self.file.seek(8 * first * self.shape[1])
            while len(rest):
                rest = rest[self.file.readinto(rest) :]
        return out

    def put(self, first: int, rows: np.ndarray) -> None:
        """Store rows from `first` on."""
        if self.whole is not None:
            if rows.base is not self.whole:  # else they are these rows
                self.whole[first : first + len(rows)] = rows
            return
        rest = np.ascontiguousarray(rows, np.complex64).view(np.uint8).ravel().data
        with self._lock:
            self.file.seek(8 * first * self.shape[1])
            while len(rest):
                rest = rest[self.file.write(rest) :]

    def columns(self, first: int, stop: int, room: float, rows: slice = slice(None)) -> np.ndarray:
        """Columns first ... stop - 1 of some rows, default all; room  bytes for the rows that are read for them."""
        if self.whole is not None:
            return self.whole[rows, first:stop]
        begin, end, _ = rows.indices(self.shape[0])
        out = np.empty((end - begin, stop - first), np.complex64)
        at_once = max(1, int(room / (8 * self.shape[1])))
        for start in range(begin, end, at_once):
            last = min(start + at_once, end)
            out[start - begin : last - begin] = self.rows(start, last)[:, first:stop]
        return out


def folder_of(out: PathLike | None) -> Path | None:
    """The folder for temporary files of echoes that go to `out`: beside it; None: that of the system."""
    return None if out is None else Path(out).parent
