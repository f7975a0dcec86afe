"""The structure of a MATLAB 5 file, walked before scipy reads it: its reader crashes on damaged files.

Source: MathWorks, "MAT-File Format", Level 5: elements of a tag (type, bytes) and data, padded to 8 bytes; an array is
an element of elements: flags, dimensions, name, and its numbers, fields or cells.
"""

from __future__ import annotations

import zlib
from collections.abc import Iterator

# bytes per number of each data type
SIZES = {1: 1, 2: 1, 3: 2, 4: 2, 5: 4, 6: 4, 7: 4, 9: 8, 12: 8, 13: 8, 16: 1, 17: 2, 18: 4}
MATRIX, COMPRESSED = 14, 15  # data types
CELL, STRUCT, CHAR = 1, 2, 4  # classes of arrays
NUMERIC = range(6, 16)  # classes of arrays of numbers
# What a file may hold, by its size: random float32 takes 4 bytes per number, zeros may take a thousandth of their size
UNPACKED = 8, 16_000_000  # bytes of compressed elements per byte of the file, and those that any file may hold
NUMBERS = 2, 4_000_000  # numbers, and characters of text, likewise
MOST_ARRAYS = 100_000  # arrays and their parts, about 200 bytes each in memory; a Gotcha file has 60
DEPTH = 8  # arrays within arrays


class Damaged(Exception):
    """The message says what does not fit."""


class TooLarge(Exception):
    """The message says what the file holds more of than its size warrants."""


class _Room:
    """What the rest of a file may hold."""

    def __init__(self, size: int) -> None:
        self.unpacked, self.numbers = (each * size + least for each, least in (UNPACKED, NUMBERS))
        self.arrays = MOST_ARRAYS

    def take_array(self) -> None:
        self.arrays -= 1
        if self.arrays < 0:
            raise TooLarge(f"holds more than {MOST_ARRAYS:,} arrays and parts of arrays")

    def take_numbers(self, count: int) -> None:
        self.numbers -= count
        if self.numbers < 0:
            raise TooLarge("holds more than 2 numbers per byte")


def check(data: bytes) -> None:
    """Damaged where elements do not fit into the file, or numbers into their elements; TooLarge where a few bytes
    unpack to far more memory."""
    if len(data) < 128 or data[126:128] not in (b"IM", b"MI"):
        raise Damaged("its head of 128 bytes is not whole")
    order, room = "little" if data[126:128] == b"IM" else "big", _Room(len(data))
    for kind, body in _elements(memoryview(data)[128:], order, room):
        if kind == COMPRESSED:
            for inner, unpacked in _elements(memoryview(_unpacked(body, room)), order, room):
                _array(inner, unpacked, order, 0, room)
        else:
            _array(kind, body, order, 0, room)


def _unpacked(body: memoryview, room: _Room) -> bytes:
    stream = zlib.decompressobj()
    try:
        out = stream.decompress(body, room.unpacked + 1)
    except zlib.error as exc:
        raise Damaged(f"a compressed element cannot be unpacked ({exc})") from None
    room.unpacked -= len(out)
    if room.unpacked < 0:
        raise TooLarge("unpacks to more than 8 times that")
    if not stream.eof:
        raise Damaged("a compressed element is not whole")
    return out


def _elements(data: memoryview, order: str, room: _Room) -> Iterator[tuple[int, memoryview]]:
    """Type and data of each element."""
    at = 0
    while at < len(data):
        if len(data) - at < 8:
            raise Damaged(f"{len(data) - at} bytes are left where an element begins")
        tag = int.from_bytes(data[at : at + 4], order)  # type: ignore[arg-type]
        if tag >> 16:  # up to 4 bytes within the tag
            kind, size, start, end = tag & 0xFFFF, tag >> 16, at + 4, at + 8
            if size > 4:
                raise Damaged(f"a small element has {size} bytes")
        else:
            kind, size, start = tag, int.from_bytes(data[at + 4 : at + 8], order), at + 8  # type: ignore[arg-type]
            end = start + size + (0 if kind == COMPRESSED else -size % 8)
        if start + size > len(data):
            raise Damaged(f"an element of {size} bytes has {len(data) - start}")
        room.take_array()
        yield kind, data[start : start + size]
        at = end


def _array(kind: int, body: memoryview, order: str, depth: int, room: _Room) -> None:
    """Check an element that must be an array."""
    if kind != MATRIX:
        raise Damaged(f"data of type {kind} stand where an array is wanted")
    if not body:  # an empty array
        return
    if depth > DEPTH:
        raise Damaged("arrays lie within arrays too deep")
    parts = list(_elements(body, order, room))
    if len(parts) < 3 or [p[0] for p in parts[:3]] != [6, 5, 1] or len(parts[0][1]) != 8:
        raise Damaged("an array lacks flags, dimensions or a name")
    flags = int.from_bytes(parts[0][1][:4], order)  # type: ignore[arg-type]
    dims = [int.from_bytes(parts[1][1][i : i + 4], order, signed=True) for i in range(0, len(parts[1][1]), 4)]  # type: ignore[arg-type]
    if not 2 <= len(dims) <= 32 or len(parts[1][1]) % 4 or min(dims) < 0:
        raise Damaged(f"an array has the dimensions {dims}")
    count, rest = 1, parts[3:]
    for n in dims:
        count *= n
    kind = flags & 0xFF
    if kind == STRUCT:
        if len(rest) < 2 or rest[0][0] != 5 or len(rest[0][1]) != 4 or rest[1][0] != 1:
            raise Damaged("a struct lacks the names of its fields")
        length = int.from_bytes(rest[0][1], order, signed=True)  # type: ignore[arg-type]
        if length <= 0 or len(rest[1][1]) % length:
            raise Damaged(f"a struct has names of {length} characters in {len(rest[1][1])} bytes")
        count *= len(rest[1][1]) // length
        rest = rest[2:]
    if kind in (STRUCT, CELL):
        if len(rest) != count:
            raise Damaged(f"{count} arrays are announced and {len(rest)} are there")
        for inner, data in rest:
            _array(inner, data, order, depth + 1, room)
    elif kind in NUMERIC or kind == CHAR:
        if len(rest) != (2 if flags & 0x800 else 1):
            raise Damaged(f"an array of numbers has {len(rest)} parts")
        for inner, data in rest:
            size = SIZES.get(inner)
            if size is None or len(data) % size or (kind != CHAR and len(data) != size * count):
                raise Damaged(f"{count} numbers are announced, and {len(data)} bytes of type {inner} are there")
            room.take_numbers(len(data) // size)
    else:
        raise Damaged(f"an array is of class {kind}")
