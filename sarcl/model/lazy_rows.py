"""Rows of arrays that may be in files: selected, stacked, scaled and sliced without reading them."""

from __future__ import annotations

import os
from abc import ABC, abstractmethod
from typing import Any, TypeGuard

import numpy as np
from numpy.typing import DTypeLike

from ..base import arguments
from ..base.types import LazyRows
from ..base.validation import sealed


def in_memory(source: object) -> TypeGuard[np.ndarray]:
    """Whether `source` is a plain array; a memmap counts as a file."""
    return isinstance(source, np.ndarray) and not isinstance(source, np.memmap)


def is_constant(source: object) -> bool:
    """Whether nobody can write to `source`: a plain array that is read-only, as all are whose memory it shares."""
    while in_memory(source) and not source.flags.writeable:
        if source.base is None:
            return True
        source = source.base
    return isinstance(source, bytes)


def file_stamps(source: object) -> dict[str, tuple[int, int, int]]:
    """Inode, size and time of change of every file that a source reads its rows from, by its path."""
    if isinstance(source, RowsOnDemand):
        inner = [*getattr(source, "sources", []), *([source.source] if hasattr(source, "source") else [])]
        return {path: stamp for each in inner for path, stamp in file_stamps(each).items()}
    path = getattr(getattr(source, "file", None), "filename", None) or getattr(source, "filename", None)
    if path is None:
        return {}
    try:
        state = os.stat(path)
    except OSError:  # it is gone
        return {str(path): (0, 0, 0)}
    return {str(path): (state.st_ino, state.st_size, state.st_mtime_ns)}


def pick(source: LazyRows, index: np.ndarray) -> LazyRows:
    """Rows `index` (k,) of a source; lazy where the source is."""
    if in_memory(source):
        return sealed(source[index])
    if isinstance(source, Picked):
        return Picked(source.source, source.index[index])
    return Picked(source, index)


def stack(sources: list[LazyRows]) -> LazyRows:
    """Rows of several sources, one after another; lazy where any of them is."""
    if len(sources) == 1:
        return sources[0]
    arrays = [source for source in sources if in_memory(source)]
    return sealed(np.concatenate(arrays)) if len(arrays) == len(sources) else Stacked(sources)


class RowsOnDemand(ABC):
    """Rows that are read or computed when they are sliced; NumPy takes all of them as an array."""

    shape: tuple[int, ...]
    dtype: np.dtype[Any]

    @abstractmethod
    def rows(self, rows: slice) -> np.ndarray:
        """The rows of a slice of step 1, whose ends lie within the rows."""

    def __getitem__(self, index: Any) -> np.ndarray:
        """Values as NumPy indexes all rows; slices of rows alone, and single rows, read no others."""
        rows, *others = index if isinstance(index, tuple) else (index,)
        if others or isinstance(rows, slice):
            arguments.checked_index("index", "samples", index, self.shape)
        if isinstance(rows, slice):
            steps = range(*rows.indices(self.shape[0]))
            if len(steps) == 0:
                block = np.empty((0, *self.shape[1:]), self.dtype)
            else:
                low, high = min(steps[0], steps[-1]), max(steps[0], steps[-1])
                block = self.rows(slice(low, high + 1))[:: steps.step]
            return block[(slice(None), *others)] if others else block
        if isinstance(rows, (int, np.integer)) and not isinstance(rows, (bool, np.bool_)):
            row = int(rows) + (self.shape[0] if rows < 0 else 0)
            if not 0 <= row < self.shape[0]:
                raise IndexError(
                    f"row {rows} was requested, but there are {self.shape[0]}; give one from {-self.shape[0]} to "
                    f"{self.shape[0] - 1}"
                )
            return np.asarray(self.rows(slice(row, row + 1))[(0, *others)])
        arguments.checked_index("index", "samples", index, self.shape)
        return np.asarray(self.rows(slice(0, self.shape[0]))[index])

    def __array__(self, dtype: DTypeLike | None = None, copy: bool | None = None) -> np.ndarray:
        return np.asarray(self[:], dtype)


class Picked(RowsOnDemand):
    """Selected rows of a lazy source; a slice reads its rows, one read per run of consecutive rows."""

    def __init__(self, source: LazyRows, index: np.ndarray) -> None:
        self.source, self.index = source, index
        self.shape = (len(index), *source.shape[1:])
        self.dtype = source.dtype

    def rows(self, rows: slice) -> np.ndarray:
        index = self.index[rows]
        runs = np.split(index, np.flatnonzero(np.diff(index) != 1) + 1)
        return np.concatenate([np.asarray(self.source[int(r[0]) : int(r[-1]) + 1]) for r in runs])


class Stacked(RowsOnDemand):
    """Rows of several sources one after another; a slice reads only the sources of its rows."""

    def __init__(self, sources: list[LazyRows]) -> None:
        self.sources = sources
        self.first = np.cumsum([0, *(s.shape[0] for s in sources)])
        self.shape = (int(self.first[-1]), *sources[0].shape[1:])
        self.dtype = np.result_type(*(s.dtype for s in sources))

    def rows(self, rows: slice) -> np.ndarray:
        start, stop, _ = rows.indices(self.shape[0])
        out = np.empty((stop - start, *self.shape[1:]), self.dtype)
        for first, source in zip(self.first.tolist(), self.sources, strict=False):
            a, b = max(start, first), min(stop, first + source.shape[0])
            if a < b:
                out[a - start : b - start] = source[a - first : b - first]
        return out


class Scaled(RowsOnDemand):
    """Rows of a source times a factor per row (n,); a slice reads and multiplies its rows."""

    def __init__(self, source: LazyRows, factor: np.ndarray) -> None:
        self.source, self.factor = source, factor.astype(np.result_type(source.dtype, np.complex64))
        self.shape, self.dtype = source.shape, self.factor.dtype

    def rows(self, rows: slice) -> np.ndarray:
        return np.asarray(self.source[rows]) * self.factor[rows, None]


class Tapered(RowsOnDemand):
    """Rows of a source, each times the same factors (n_columns,); a slice reads and multiplies its rows."""

    def __init__(self, source: LazyRows, factors: np.ndarray) -> None:
        self.source, self.factors = source, factors.astype(np.float32)
        self.shape, self.dtype = source.shape, source.dtype

    def rows(self, rows: slice) -> np.ndarray:
        return np.asarray(self.source[rows]) * self.factors


class Columns(RowsOnDemand):
    """Columns first ... last - 1 of a source; a slice reads its rows."""

    def __init__(self, source: LazyRows, first: int, last: int) -> None:
        self.source, self.columns = source, slice(first, last)
        self.shape = (source.shape[0], last - first)
        self.dtype = source.dtype

    def rows(self, rows: slice) -> np.ndarray:
        return np.asarray(self.source[rows])[:, self.columns]
