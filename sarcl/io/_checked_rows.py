"""Rows of an HDF5 file whose checksums are compared when they are read. Imported late: it loads h5py."""

from __future__ import annotations

from typing import Any, NoReturn

import h5py
import numpy as np
from numpy.typing import DTypeLike

from ..base import arguments
from ._checksums import AT_ONCE, Checksums, crc_of


class CheckedRows(h5py.Dataset):
    """A dataset that compares the checksum of every block of rows when it is first read from.

    OSError names the file and the rows of a block that is not as it was written, or cannot be read.
    """

    def __init__(self, dataset: h5py.Dataset, sums: Checksums) -> None:
        super().__init__(dataset.id, readonly=True)
        self._sums = sums
        self._good = np.zeros(len(sums.blocks), bool)

    def __reduce__(self) -> NoReturn:
        """Refused: copy, pickle and multiprocessing cannot hand an open file on."""
        raise TypeError(
            f"the samples or pixels are rows of the open file {self.file.filename!r}, which cannot be copied or sent "
            "to another process: read the file there, sarcl.read(path), or take them into memory first, such as "
            "dataclasses.replace(raw, samples=raw.read(0, raw.n_rows))"
        )

    def __getitem__(self, args: Any, new_dtype: DTypeLike | None = None) -> Any:
        if new_dtype is None:
            arguments.checked_index("index", f"samples in {self.file.filename!r}", args, self.shape)
        first = args[0] if isinstance(args, tuple) and args else args
        low, high = self._touched(first)
        step = self._sums.step
        a, b = low // step, -(-high // step)
        if high > low and not self._good[a:b].all():
            start, stop = a * step, min(b * step, self.shape[0])
            plain = args is first and new_dtype is None and isinstance(first, slice) and first.step in (None, 1)
            row = max(1, self.nbytes // max(1, self.shape[0]))
            if plain and (stop - start) * row <= 2 * AT_ONCE:  # one reading serves the check and the caller
                rows = self._read(slice(start, stop))
                self._compare(rows, a)
                selection = rows[low - start : high - start]
                return (
                    selection.copy() if 2 * len(selection) < len(rows) else selection
                )  # does not hold much more than asked
            for block in range(a, b):
                if not self._good[block]:
                    self._compare(self._read(slice(block * step, min((block + 1) * step, self.shape[0]))), block)
        return self._read(args, new_dtype)

    def read_direct(self, dest: object, source_sel: object = None, dest_sel: object = None) -> None:
        """The method of h5py.Dataset, after the check of all rows."""
        for start in range(0, self.shape[0], self._sums.step):
            if not self._good[block := start // self._sums.step]:
                self._compare(self._read(slice(start, min(start + self._sums.step, self.shape[0]))), block)
        super().read_direct(dest, source_sel, dest_sel)

    def _touched(self, first: object) -> tuple[int, int]:
        """First and last + 1 of the rows that an index of rows may name."""
        n = self.shape[0]
        if isinstance(first, slice):
            a, b, step = first.indices(n)
            return (a, b) if step > 0 else (0, n)
        if isinstance(first, (int, np.integer)):
            return (int(first) % n, int(first) % n + 1) if -n <= first < n else (0, 0)
        return 0, n

    def _read(self, args: Any, new_dtype: DTypeLike | None = None) -> Any:
        try:
            return super().__getitem__(args, new_dtype)
        except (TypeError, ValueError, IndexError):  # what NumPy reads of an array, but h5py not of a file
            raise IndexError(
                f"index {args!r:.60} cannot be read from {self.file.filename!r}, which gives whole numbers, slices of "
                "positive steps, masks and increasing lists: take all into memory first, numpy.asarray(...)"
            ) from None
        except (OSError, RuntimeError) as exc:
            raise OSError(f"{self.file.filename!r} cannot be read ({exc}); copy it again") from exc

    def _compare(self, rows: np.ndarray, block: int) -> None:
        """Compare whole blocks of rows, from `block` on."""
        step = self._sums.step
        for i in range(0, len(rows), step):
            if crc_of(rows[i : i + step]) != self._sums.blocks[block]:
                first, last = block * step, min((block + 1) * step, self.shape[0]) - 1
                name = self.name.strip("/")
                raise OSError(
                    f"{self.file.filename!r} is damaged: rows {first} to {last} of {name} are not as they were "
                    f"written (their checksum differs); save or copy it again, or use the other rows of {name}"
                )
            self._good[block] = True
            block += 1
