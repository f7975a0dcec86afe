"""Complex arrays that may be larger than the memory for blocks: then they lie in a temporary file."""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np


class Scratch:
    """complex64 (n, m), zeros at first: in memory where it takes up to `room` bytes, else in a file without a name.

    folder  of the file; None: that of temporary files. The file is read and written in parts, not mapped: pages of a
    mapped file count as memory of the process.
    """

    def __init__(self, shape: tuple[int, int], room: float, folder: Path | None) -> None:
        self.shape, nbytes = shape, 8 * shape[0] * shape[1]
        self.whole = np.zeros(shape, np.complex64) if nbytes <= room else None
        if self.whole is None:
            self.file = tempfile.TemporaryFile(dir=folder, buffering=0)
            self.file.truncate(nbytes)

    def rows(self, first: int, stop: int) -> np.ndarray:
        """Rows first ... stop - 1: (stop - first, m)."""
        if self.whole is not None:
            return self.whole[first:stop]
        out = np.empty((stop - first, self.shape[1]), np.complex64)
        self.file.seek(8 * first * self.shape[1])
        left = out.view(np.uint8).ravel().data
        while len(left):
            left = left[self.file.readinto(left) :]
        return out

    def put(self, first: int, rows: np.ndarray) -> None:
        """Store rows from `first` on."""
        if self.whole is not None:
            if rows.base is not self.whole:  # else they are these rows
                self.whole[first : first + len(rows)] = rows
            return
        self.file.seek(8 * first * self.shape[1])
        left = np.ascontiguousarray(rows, np.complex64).view(np.uint8).ravel().data
        while len(left):
            left = left[self.file.write(left) :]

    def columns(self, first: int, stop: int, room: float) -> np.ndarray:
        """Columns first ... stop - 1: (n, stop - first); room  bytes for the rows that are read for them."""
        if self.whole is not None:
            return self.whole[:, first:stop]
        out = np.empty((self.shape[0], stop - first), np.complex64)
        at_once = max(1, int(room / (8 * self.shape[1])))
        for start in range(0, self.shape[0], at_once):
            end = min(start + at_once, self.shape[0])
            out[start:end] = self.rows(start, end)[:, first:stop]
        return out
