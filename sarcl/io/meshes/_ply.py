"""PLY files (G. Turk, 1994), text and binary: vertices and polygons, each number of the type that its header declares.

trimesh takes the length of the first list for that of all, and lets numbers of text wrap around their declared type:
here numbers of text are what is written.
"""

from __future__ import annotations

import re
from collections import Counter
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from . import _checks

C_TYPES = "char:i1 uchar:u1 short:i2 ushort:u2 int:i4 uint:u4 float:f4 double:f8"
SIZED_TYPES = (
    "int8:i1 uint8:u1 int16:i2 uint16:u2 int32:i4 uint32:u4 int64:i8 uint64:u8 float16:f2 float32:f4 float64:f8"
)
TYPES = dict(pair.split(":") for pair in f"{C_TYPES} {SIZED_TYPES}".split())  # NumPy's types by those of a header
HEADER = re.compile(rb"ply[ \t]*\r?\n((?:.*?\n)??)[ \t]*end_header[ \t]*(?:\r?\n|$)", re.DOTALL)
Order = Literal["", "<", ">"]
# order of bytes by the name of a format; text has none
ORDER: dict[str, Order] = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}
FACES = ("vertex_index", "vertex_indices")
PIECE = 2**18  # numbers read at a time, so that what is made on the way to them stays small
LONGEST = 400  # characters of a number as text: the largest of float64 has 309 digits before its point
PLURAL = {"face": "faces", "vertex": "vertices"}


@dataclass
class _Property:
    """type  of its numbers;  count  type of the number of them, None where it is one number, not a list."""

    name: str
    type: np.dtype
    count: np.dtype | None


@dataclass
class _Element:
    """Rows of properties. start (n,): where the numbers of a property begin;  length (n,): how many a list has."""

    name: str
    rows: int
    properties: list[_Property] = field(default_factory=list)
    start: dict[str, np.ndarray] = field(default_factory=dict)
    length: dict[str, np.ndarray] = field(default_factory=dict)


def read(data: bytes, what: str) -> tuple[np.ndarray, np.ndarray]:
    """Vertices (n, 3) and triangles (k, 3) of a PLY file, polygons as fans about their first corners.

    ValueError: a damaged file, polygons that fans do not cover.
    """
    head = HEADER.match(data)
    if head is None:
        raise ValueError(f"{what} cannot be read as .ply (no header from 'ply' to 'end_header'): {_checks.TAKE}")
    order, elements = _header(head[1].decode("latin-1"), what)
    body = _Text(data[head.end() :], what) if not order else _Binary(data[head.end() :], order)
    position = 0
    for element in elements:
        position = _place(element, body, position, what)
    if position != body.size:
        raise ValueError(f"{what} holds {body.size - position} {body.unit} more than it declares: {_checks.TAKE}")
    elements_by_name = {element.name: element for element in elements if element.rows}
    for name in elements_by_name:
        if name.startswith("tristrip"):
            raise ValueError(f"{what} has strips of triangles ({name}), which are not read; export triangles")
    if "vertex" not in elements_by_name or "face" not in elements_by_name:
        return np.zeros((0, 3)), np.zeros((0, 3), np.int64)
    vertices = _vertices(elements_by_name["vertex"], body, what)
    return vertices, _triangles(elements_by_name["face"], body, vertices, what)


def _header(text: str, what: str) -> tuple[Order, list[_Element]]:
    """(order of bytes, "" for text; the elements)."""
    order: Order | None = None
    elements: list[_Element] = []
    for line in text.split("\n"):  # str.splitlines also splits within characters of comments, as "Å" in UTF-8
        words = line.split()
        if not words or words[0] in ("comment", "obj_info"):
            continue
        try:
            if words[0] == "format" and order is None:
                order = ORDER[words[1]]
            elif words[0] == "element" and len(words) == 3 and re.fullmatch("[0-9]{1,18}", words[2]):
                elements.append(_Element(words[1], int(words[2])))
            elif words[0] == "property" and words[1] == "list" and len(words) == 5:
                elements[-1].properties.append(_Property(words[4], _type(words[3]), _type(words[2])))
            elif words[0] == "property" and len(words) == 3:
                elements[-1].properties.append(_Property(words[2], _type(words[1]), None))
            else:
                raise KeyError
        except (KeyError, IndexError):
            raise ValueError(
                f"{what}: {line.strip()!r:.60} is no line of the header of a PLY file, wanted a format, element, "
                f"property or comment: {_checks.TAKE}"
            ) from None
    if order is None:
        raise ValueError(f"{what} has no line 'format' in its header: {_checks.TAKE}")
    _check_names([element.name for element in elements], "elements", what)
    for element in elements:
        _check_names([p.name for p in element.properties], f"properties of {element.name!r:.40}", what)
    return order, elements


def _check_names(names: list[str], kind: str, what: str) -> None:
    """ValueError for a name that is given twice: which of the two is meant cannot be told."""
    twice = next((name for name, n in Counter(names).items() if n > 1), None)
    if twice is not None:
        raise ValueError(f"{what} declares two {kind} with the name {twice!r:.40}, wanted one: {_checks.TAKE}")


def _type(name: str) -> np.dtype:
    return np.dtype(TYPES[name])


class _Text:
    """Numbers of a text file; places count numbers."""

    unit = "numbers"

    def __init__(self, body: bytes, what: str) -> None:
        words = body.split()
        self.size = len(words)
        wrong = next((word for word in words if len(word) > LONGEST), None)
        if wrong is None and b"_" in body:  # NumPy takes 1_0 for 10
            wrong = next(word for word in words if b"_" in word)
        if wrong is not None:
            raise ValueError(f"{what} has a word that is no number: {str(wrong)[1:]:.60}: {_checks.TAKE}")
        self.numbers = np.empty(self.size)
        try:
            for at in range(0, self.size, PIECE):
                self.numbers[at : at + PIECE] = np.array(words[at : at + PIECE], "S").astype(np.float64)
        except ValueError as exc:
            raise ValueError(f"{what} has words that are no numbers ({exc}): {_checks.TAKE}") from None

    def width(self, type_: np.dtype) -> int:
        return 1

    def one(self, place: int, type_: np.dtype) -> float:
        return float(self.numbers[place])

    def take(self, places: np.ndarray, type_: np.dtype) -> np.ndarray:
        """Numbers as written, floating-point ones rounded to their type."""
        numbers = self.numbers[places]
        with np.errstate(over="ignore"):
            return numbers.astype(type_).astype(np.float64) if type_.kind == "f" else numbers


class _Binary:
    """Numbers of a binary file; places count bytes."""

    unit = "bytes"

    def __init__(self, body: bytes, order: Literal["<", ">"]) -> None:
        self.body, self.order, self.size = body, order, len(body)
        self.bytes = np.frombuffer(body, np.uint8)

    def width(self, type_: np.dtype) -> int:
        return type_.itemsize

    def one(self, place: int, type_: np.dtype) -> float:
        return float(np.frombuffer(self.body, type_.newbyteorder(self.order), 1, place)[0])

    def take(self, places: np.ndarray, type_: np.dtype) -> np.ndarray:
        numbers = np.empty(len(places), type_)
        for at in range(0, len(places), PIECE):
            piece = self.bytes[places[at : at + PIECE, None] + np.arange(type_.itemsize)]
            numbers[at : at + PIECE] = piece.view(type_.newbyteorder(self.order)).reshape(-1)
        return numbers


def _place(element: _Element, body: _Text | _Binary, at: int, what: str) -> int:
    """Find where the numbers of an element lie, from `at` on, and where the next element begins.

    Lists of one length make rows of one width; where lengths differ, rows are followed one by one.
    """
    least = sum(body.width(p.type if p.count is None else p.count) for p in element.properties)
    if not element.rows or not least:
        return at
    if element.rows * least > body.size - at:
        raise _short(element, (body.size - at) // least, what)
    first, lengths, width = {}, {}, 0
    for p in element.properties:
        if p.count is not None:
            lengths[p.name] = _count(element, 0, p, body, at + width, what)
            width += body.width(p.count)
        first[p.name] = width
        width += body.width(p.type) * lengths.get(p.name, 1)
    rows = np.arange(element.rows, dtype=np.int64)
    if at + element.rows * width <= body.size and all(
        (body.take(at + first[p.name] - body.width(p.count) + width * rows, p.count) == lengths[p.name]).all()
        for p in element.properties
        if p.count is not None
    ):
        element.start = {name: at + place + width * rows for name, place in first.items()}
        element.length = {name: np.full(element.rows, n) for name, n in lengths.items()}
        return at + element.rows * width
    element.start = {p.name: np.empty(element.rows, np.int64) for p in element.properties}
    element.length = {p.name: np.empty(element.rows, np.int64) for p in element.properties if p.count is not None}
    for row in range(element.rows):
        for p in element.properties:
            n = 1
            if p.count is not None:
                n = element.length[p.name][row] = _count(element, row, p, body, at, what)
                at += body.width(p.count)
            element.start[p.name][row] = at
            at += n * body.width(p.type)
        if at > body.size:
            raise _short(element, row, what)
    return at


def _count(element: _Element, row: int, p: _Property, body: _Text | _Binary, at: int, what: str) -> int:
    """The length of a list."""
    if p.count is None or at + body.width(p.count) > body.size:
        raise _short(element, row, what)
    count = body.one(at, p.count)
    largest = np.iinfo(p.count).max if p.count.kind in "iu" else 2.0**31
    if not (0 <= count <= largest and count == int(count)):
        raise ValueError(
            f"{what}: {element.name} {row} has {count:g} {p.name}, wanted a whole number from 0 to {largest:.10g}, the "
            f"largest of the declared type: {_checks.TAKE}"
        )
    if at + body.width(p.count) + int(count) * body.width(p.type) > body.size:
        raise _short(element, row, what)
    return int(count)


def _short(element: _Element, rows: int, what: str) -> ValueError:
    noun = PLURAL.get(element.name, f"rows of {element.name!r:.40}")
    difference = f"it declares {element.rows} {noun} and holds {rows}"
    return ValueError(f"{what} cannot be read as .ply ({difference}): {_checks.TAKE}")


def _vertices(element: _Element, body: _Text | _Binary, what: str) -> np.ndarray:
    types = {p.name: p.type for p in element.properties if p.count is None}
    if not {"x", "y", "z"} <= set(types):
        raise ValueError(f"{what} has vertices of {', '.join(types) or 'nothing'}, wanted x, y and z: {_checks.TAKE}")
    coordinates = [body.take(element.start[name], types[name]) for name in "xyz"]
    return np.stack(coordinates, axis=1).astype(np.float64)


def _triangles(element: _Element, body: _Text | _Binary, vertices: np.ndarray, what: str) -> np.ndarray:
    lists = [p for p in element.properties if p.count is not None]
    p = next((p for p in lists if p.name in FACES), lists[0] if len(lists) == 1 else None)
    if p is None:
        raise ValueError(f"{what} has faces without a list {' or '.join(FACES)}: {_checks.TAKE}")
    corners = element.length[p.name]
    if (corners < 3).any():
        face = int(np.argmax(corners < 3))
        raise ValueError(f"{what}: face {face} has {corners[face]} corners, wanted at least 3: {_checks.TAKE}")
    begin = np.cumsum(corners) - corners
    within = np.arange(int(corners.sum())) - np.repeat(begin, corners)
    index = body.take(np.repeat(element.start[p.name], corners) + within * body.width(p.type), p.type)
    owner = np.repeat(np.arange(element.rows), corners)
    is_wrong = ~((index >= 0) & (index < len(vertices)) & (index == np.rint(index)))
    if is_wrong.any():
        face = int(np.argmax(is_wrong))
        raise ValueError(
            f"{what}: face {owner[face]} names vertex {index[face]:.20g} of {len(vertices)}: {_checks.TAKE}"
        )
    index = index.astype(np.int64)
    wrong_faces = _checks.wrong_fans(corners, index, vertices)
    if wrong_faces:
        raise ValueError(f"{what}: face {wrong_faces[0]}, of {corners[wrong_faces[0]]} corners, {_checks.CONCAVE}")
    return _checks.fans(corners, index)
