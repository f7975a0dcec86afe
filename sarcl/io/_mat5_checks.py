"""The structure of a MATLAB 5 file, walked before scipy reads it: its reader crashes on damaged files.

Source: MathWorks, "MAT-File Format", Level 5: elements of a tag (type, bytes) and data, padded to 8 bytes; an array is
an element of elements: flags, dimensions, name, and its numbers, fields or cells.
"""

from __future__ import annotations

import zlib
from collections.abc import Iterator
from typing import Literal

# bytes per number of each data type
SIZES = {1: 1, 2: 1, 3: 2, 4: 2, 5: 4, 6: 4, 7: 4, 9: 8, 12: 8, 13: 8, 16: 1, 17: 2, 18: 4}
MATRIX, COMPRESSED = 14, 15  # data types
CELL, STRUCT, CHAR = 1, 2, 4  # classes of arrays
NUMERIC = range(6, 16)  # classes of arrays of numbers
Order = Literal["little", "big"]


class Damaged(Exception):
    """The message says what does not fit."""


def check(data: bytes) -> None:
    """Damaged where elements do not fit into the file, or numbers into their elements."""
    if len(data) < 128 or data[126:128] not in (b"IM", b"MI"):
        raise Damaged("its head of 128 bytes is not whole")
    order: Order = "little" if data[126:128] == b"IM" else "big"
    for kind, body in _elements(memoryview(data)[128:], order):
        if kind == COMPRESSED:
            for part_kind, part in _elements(memoryview(_decompress(body)), order):
                _check_array(part_kind, part, order)
        else:
            _check_array(kind, body, order)


def _decompress(body: memoryview) -> bytes:
    stream = zlib.decompressobj()
    try:
        unpacked = stream.decompress(body)
    except zlib.error as exc:
        raise Damaged(f"a compressed element cannot be unpacked ({exc})") from None
    if not stream.eof:
        raise Damaged("a compressed element is not whole")
    return unpacked


def _elements(data: memoryview, order: Order) -> Iterator[tuple[int, memoryview]]:
    """Type and data of each element."""
    position = 0
    while position < len(data):
        if len(data) - position < 8:
            raise Damaged(f"{len(data) - position} bytes are left where an element begins")
        tag = int.from_bytes(data[position : position + 4], order)
        if tag >> 16:  # up to 4 bytes within the tag
            kind, size, start, end = tag & 0xFFFF, tag >> 16, position + 4, position + 8
            if size > 4:
                raise Damaged(f"a small element has {size} bytes")
        else:
            kind, size, start = tag, int.from_bytes(data[position + 4 : position + 8], order), position + 8
            end = start + size + (0 if kind == COMPRESSED else -size % 8)
        if start + size > len(data):
            raise Damaged(f"an element of {size} bytes has {len(data) - start}")
        yield kind, data[start : start + size]
        position = end


def _check_array(kind: int, body: memoryview, order: Order) -> None:
    """Damaged for an element that is no array, or an array whose parts do not fit it."""
    if kind != MATRIX:
        raise Damaged(f"data of type {kind} stand where an array is wanted")
    if not body:  # an empty array
        return
    parts = list(_elements(body, order))
    if len(parts) < 3 or [p[0] for p in parts[:3]] != [6, 5, 1] or len(parts[0][1]) != 8:
        raise Damaged("an array lacks flags, dimensions or a name")
    flags = int.from_bytes(parts[0][1][:4], order)
    dims = [int.from_bytes(parts[1][1][i : i + 4], order, signed=True) for i in range(0, len(parts[1][1]), 4)]
    if not 2 <= len(dims) <= 32 or len(parts[1][1]) % 4 or min(dims) < 0:
        raise Damaged(f"an array has the dimensions {dims}")
    count, rest = 1, parts[3:]
    for n in dims:
        count *= n
    kind = flags & 0xFF
    if kind == STRUCT:
        if len(rest) < 2 or rest[0][0] != 5 or len(rest[0][1]) != 4 or rest[1][0] != 1:
            raise Damaged("a struct lacks the names of its fields")
        length = int.from_bytes(rest[0][1], order, signed=True)
        if length <= 0 or len(rest[1][1]) % length:
            raise Damaged(f"a struct has names of {length} characters in {len(rest[1][1])} bytes")
        count *= len(rest[1][1]) // length
        rest = rest[2:]
    if kind in (STRUCT, CELL):
        if len(rest) != count:
            raise Damaged(f"{count} arrays are announced and {len(rest)} are there")
        for inner, data in rest:
            _check_array(inner, data, order)
    elif kind in NUMERIC or kind == CHAR:
        if len(rest) != (2 if flags & 0x800 else 1):
            raise Damaged(f"an array of numbers has {len(rest)} parts")
        for inner, data in rest:
            size = SIZES.get(inner)
            if size is None or len(data) % size or (kind != CHAR and len(data) != size * count):
                raise Damaged(f"{count} numbers are announced, and {len(data)} bytes of type {inner} are there")
    else:
        raise Damaged(f"an array is of class {kind}")
