"""Checksums of sarcl's own HDF5 file: of its rows block by block, of every other array, and of all that is left.

They lie behind the end of the HDF5 file, which readers of HDF5 ignore, and are checked before HDF5 sees the file: a
damaged table of HDF5 may make its reader wait for ever. Rows are checked when they are read.

    HDF5 file | JSON text | CRC-32 of the text, 4 bytes | length of the text, 8 bytes | MAGIC

CRC-32 is zlib's; it finds every change of up to 32 neighbouring bits, and one of 4e9 others passes.
"""

from __future__ import annotations

import json
import os
import zlib
from collections.abc import Iterator
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO

import numpy as np

if TYPE_CHECKING:
    import h5py
    from numpy.typing import ArrayLike, DTypeLike

MAGIC = b"sarcl checksums 1\n"
END = 12 + len(MAGIC)  # bytes after the text
BLOCK_BYTES = 2**20  # bytes of a block of rows, about: what must be read to check one row
AT_ONCE = 2**24  # bytes read at a time
SIGNATURE = b"\x89HDF\r\n\x1a\n"


class Damaged(Exception):
    """A checksum differs, or the checksums themselves cannot be read; the message says where."""


class Truncated(Damaged):
    """The file is shorter than its HDF5 tables say."""


@dataclass(frozen=True)
class Checksums:
    """size  bytes of the HDF5 file;  rest  CRC of its bytes outside the arrays

    arrays  name, first byte, bytes and CRC of every array that lies in one piece, but the rows
    rows    name, first byte and bytes of the rows, or None;  step  rows per block;  blocks  their CRCs
    """

    size: int
    rest: int = 0
    arrays: list[tuple[str, int, int, int]] = field(default_factory=list)
    rows: tuple[str, int, int] | None = None
    step: int = 1
    blocks: list[int] = field(default_factory=list)


class RunningSums:
    """CRCs of the blocks of rows that are being written, without reading them again where rows come in order."""

    def __init__(self, shape: tuple[int, ...], dtype: DTypeLike) -> None:
        self.shape, self.dtype = shape, np.dtype(dtype)
        self.step = max(1, BLOCK_BYTES // max(1, int(np.prod(shape[1:], dtype=np.int64)) * self.dtype.itemsize))
        n = -(-shape[0] // self.step)
        self.sums = np.zeros(n, np.uint32)
        self._rows = np.zeros(n, np.int64)  # of each block, those that its CRC covers; -1: written in another order

    def wrote(self, index: object, values: ArrayLike) -> None:
        """Rows `at` were given these values, as numpy assigns them."""
        row_index, block_values = index[0] if isinstance(index, tuple) and index else index, np.asarray(values)
        # HDF5 converts other types, and may write other NaNs than numpy
        if not isinstance(row_index, slice) or row_index.step not in (None, 1) or block_values.dtype != self.dtype:
            self._rows[:] = -1
            return
        a, b, _ = row_index.indices(self.shape[0])
        if isinstance(index, tuple) and not all(isinstance(s, slice) and s == slice(None) for s in index[1:]):
            self._rows[a // self.step : -(-b // self.step)] = -1
            return
        rows = np.broadcast_to(block_values, (max(b - a, 0), *self.shape[1:]))
        for block in range(a // self.step, -(-b // self.step)):
            low, high = max(a, block * self.step), min(b, (block + 1) * self.step)
            if self._rows[block] == low - block * self.step:
                self.sums[block] = crc_of(rows[low - a : high - a], int(self.sums[block]))
                self._rows[block] += high - low
            else:
                self._rows[block] = -1

    def of(self, dataset: h5py.Dataset) -> list[int]:
        """All CRCs; blocks that were not written in order are read from the dataset."""
        for block in range(len(self.sums)):
            low, high = block * self.step, min((block + 1) * self.step, self.shape[0])
            if self._rows[block] != high - low:
                self.sums[block] = crc_of(dataset[low:high])
        return [int(s) for s in self.sums]


def crc_of(values: np.ndarray, start: int = 0) -> int:
    return zlib.crc32(np.ascontiguousarray(values).reshape(-1).view(np.uint8).data, start)


def layout(file: h5py.File, size: int, rows: str, sums: RunningSums | None) -> Checksums:
    """Places of the arrays in an open HDF5 file, and the CRCs of its rows; `append` adds those of the arrays."""
    import h5py

    arrays: list[tuple[str, int, int, int]] = []

    def visit(name: str, member: h5py.Dataset) -> None:
        if isinstance(member, h5py.Dataset) and name != rows and (offset := member.id.get_offset()) is not None:
            arrays.append((name, int(offset), int(member.id.get_storage_size()), 0))

    file.visititems(visit)
    offset = file[rows].id.get_offset() if rows in file else None
    if offset is None or sums is None:  # rows that were never written have no place yet
        return Checksums(size, 0, arrays)
    place = (rows, int(offset), int(file[rows].id.get_storage_size()))
    return Checksums(size, 0, arrays, place, sums.step, sums.of(file[rows]))


def append(path: Path, sums: Checksums) -> None:
    """Put the checksums behind an HDF5 file that is closed."""
    with open(path, "r+b") as file:
        fields = asdict(sums) | {
            "arrays": [(name, at, size, _read_crc(file, at, size)) for name, at, size, _ in sums.arrays],
            "rest": _rest(file, sums),
        }
        text = json.dumps(fields).encode()
        file.seek(sums.size)
        file.write(text + zlib.crc32(text).to_bytes(4, "little") + len(text).to_bytes(8, "little") + MAGIC)


def of(path: Path) -> Checksums | None:
    """The checksums of a file, after a check of all but the rows; None where it has none.

    Damaged where they differ; Truncated where the file ends before the HDF5 file does; OSError.
    """
    with open(path, "rb") as file:
        size = file.seek(0, os.SEEK_END)
        file.seek(max(0, size - END))
        end = file.read()
        if not end.endswith(MAGIC):
            _without(file, size)
            return None
        length = int.from_bytes(end[4:12], "little")
        if length > size - END:
            raise Damaged("its list of checksums is longer than the file")
        file.seek(size - END - length)
        text = file.read(length)
        if zlib.crc32(text) != int.from_bytes(end[:4], "little"):
            raise Damaged("its list of checksums is not as it was written")
        try:
            sums = Checksums(**json.loads(text))
        except (ValueError, TypeError):  # an empty text has the checksum 0
            raise Damaged("its list of checksums is none") from None
        if sums.size != size - END - length:
            raise Damaged(f"it has {size} bytes and was written with {sums.size + END + length}")
        if _rest(file, sums) != sums.rest:
            raise Damaged("its description and tables are not as they were written")
        for name, at, n, crc in sums.arrays:
            if _read_crc(file, at, n) != crc:
                raise Damaged(f"{name} is not as it was written")
        return sums


def _without(file: BinaryIO, size: int) -> None:
    """Damaged where something is left of checksums, bytes behind the end of the HDF5 file; Truncated before it."""
    file.seek(0)
    head = file.read(48)
    version = head[8] if len(head) == 48 and head.startswith(SIGNATURE) else None
    position = 40 if version == 0 else 28 if version in (2, 3) else None  # of the end of the file, in HDF5's superblock
    end = size if position is None else int.from_bytes(head[position : position + 8], "little")
    if end > size:
        raise Truncated(f"it has {size:,} of {end:,} bytes")
    if end < size:
        raise Damaged("its list of checksums at the end is not as it was written")


def _pieces(file: BinaryIO, at: int, size: int) -> Iterator[bytes]:
    file.seek(at)
    while size > 0 and (piece := file.read(min(size, AT_ONCE))):
        size -= len(piece)
        yield piece


def _read_crc(file: BinaryIO, at: int, size: int, crc: int = 0) -> int:
    for piece in _pieces(file, at, size):
        crc = zlib.crc32(piece, crc)
    return crc


def _rest(file: BinaryIO, sums: Checksums) -> int:
    """CRC of the bytes of the HDF5 file that are in no array."""
    places = [(at, size) for _, at, size, _ in sums.arrays]
    if sums.rows is not None:
        places.append((sums.rows[1], sums.rows[2]))
    crc, start = 0, 0
    for at, size in sorted(places):
        crc, start = _read_crc(file, start, at - start, crc), at + size
    return _read_crc(file, start, sums.size - start, crc)
