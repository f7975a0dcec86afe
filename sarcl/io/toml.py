"""TOML text: the line of each key, and values written as TOML.

tomli-w and tomlkit are not used for writing: one puts every number of an array on a line of its own, the other all of
them on one line. Positions and rows of numbers stay readable here.
"""

from __future__ import annotations

import re
from bisect import bisect_right
from collections.abc import Mapping
from typing import Any

Path = tuple[str | int, ...]

WIDTH = 80  # characters of the longest array that stays on one line

_BARE = re.compile(r"[A-Za-z0-9_-]+")
_SCALAR = re.compile(r"[^\s,\]}#]+(?: \d[^\s,\]}#]*)?")  # a space may separate date and time
_STRING = re.compile(r'"""(?:\\.|[^\\])*?"{3,5}' r"|'''.*?'{3,5}" r'|"(?:\\.|[^"\\])*"' r"|'[^']*'", re.DOTALL)
_FLAT = re.compile(r"""\[[^\[\]{}"'#]*\]""")  # an array of numbers: nothing in it has a path of its own
_SPACE = re.compile(r"(?:[ \t\r\n]|#[^\n]*)*")
_ESCAPE = re.compile(r'\\(u[0-9A-Fa-f]{4}|U[0-9A-Fa-f]{8}|x[0-9A-Fa-f]{2}|[btnfre"\\])')
_ESCAPED = {"b": "\b", "t": "\t", "n": "\n", "f": "\f", "r": "\r", "e": "\x1b", '"': '"', "\\": "\\"}


def locate(text: str) -> dict[Path, int]:
    """Line, from 1, of every table and key of a valid TOML text, by its path.

    The n-th table of [[a.b]] is ("a", "b", n), as is the n-th inline table of an array; a table that is only
    implied ([a.b] implies a) has the line where it is first implied.
    """
    return _Scanner(text).lines


class _Scanner:
    """Reads a text that tomllib has accepted: it checks nothing."""

    def __init__(self, text: str) -> None:
        self.text, self.pos = text, 0
        self.ends = [m.start() for m in re.finditer("\n", text)]
        self.lines: dict[Path, int] = {}
        self.counts: dict[Path, int] = {}  # tables so far in each array of tables
        table: Path = ()
        while self._skip():
            start = self.pos
            if self._take("[["):
                *outer, last = self._key()
                array = (*self._resolve(outer, start), last)
                n = self.counts.get(array, 0)
                self.counts[array] = n + 1
                table = (*array, n)
                self._note(array, start)
                self._note(table, start)
                self._take("]]")
            elif self._take("["):
                table = self._resolve(self._key(), start)
                self.lines[table] = self._line(start)  # the line of its own header, not of a header that implied it
                self._take("]")
            else:
                self._pair(table)

    def _line(self, pos: int) -> int:
        return bisect_right(self.ends, pos - 1) + 1

    def _note(self, path: Path, pos: int) -> None:
        self.lines.setdefault(path, self._line(pos))

    def _skip(self) -> bool:
        """Pass white space, line ends and comments; False at the end."""
        self.pos = _SPACE.match(self.text, self.pos).end()  # type: ignore[union-attr]
        return self.pos < len(self.text)

    def _take(self, mark: str) -> bool:
        self._skip()
        if not self.text.startswith(mark, self.pos):
            return False
        self.pos += len(mark)
        return True

    def _resolve(self, keys: list[str], pos: int) -> Path:
        """The path of a header's keys: where one names an array of tables, its latest table is meant."""
        path: Path = ()
        for key in keys:
            path = (*path, key)
            self._note(path, pos)
            if path in self.counts:
                path = (*path, self.counts[path] - 1)
        return path

    def _key(self) -> list[str]:
        """A key, dotted or not, as its parts."""
        parts = []
        while True:
            self._skip()
            if match := _STRING.match(self.text, self.pos):
                parts.append(_unquote(match[0]))
            else:
                match = _BARE.match(self.text, self.pos)
                assert match is not None
                parts.append(match[0])
            self.pos = match.end()
            if not self._take("."):
                return parts

    def _pair(self, table: Path) -> None:
        self._skip()
        start, path = self.pos, table
        for key in self._key():
            path = (*path, key)
            self._note(path, start)
        self._take("=")
        self._value(path)

    def _value(self, path: Path) -> None:
        self._skip()
        if flat := _FLAT.match(self.text, self.pos):
            self.pos = flat.end()
        elif self._take("["):
            n = 0
            while not self._take("]"):
                if self.text.startswith("{", self.pos):
                    self._note((*path, n), self.pos)
                self._value((*path, n))
                self._take(",")
                n += 1
        elif self._take("{"):
            while not self._take("}"):
                self._pair(path)
                self._take(",")
        else:
            match = _STRING.match(self.text, self.pos) or _SCALAR.match(self.text, self.pos)
            assert match is not None
            self.pos = match.end()


def _unquote(text: str) -> str:
    if text[0] == "'":
        return text[1:-1]

    def plain(match: re.Match[str]) -> str:
        code = match[1]
        return _ESCAPED.get(code) or chr(int(code[1:], 16))

    return _ESCAPE.sub(plain, text[1:-1])


def dumps(tables: Mapping[str, Any]) -> str:
    """TOML text of nested tables of str, bool, int, float, lists and dicts.

    TypeError names a key whose value is of no TOML type (None, complex, NumPy arrays: give lists).
    """
    return "\n".join(_table((), tables)).strip("\n") + "\n"


def _table(path: tuple[str, ...], table: Mapping[str, Any]) -> list[str]:
    """Lines of a table: its own keys, then the tables in it."""
    own, nested = [], []
    for key, value in table.items():
        where = (*path, key)
        name = ".".join(map(_key, where))
        if isinstance(value, Mapping):
            # a table that only holds tables needs no header of its own
            plain = not value or not all(_holds_tables(v) for v in value.values())
            nested += ["", f"[{name}]"] if plain else []
            nested += _table(where, value)
        elif _holds_tables(value):
            for part in value:
                nested += ["", f"[[{name}]]", *_table(where, part)]
        else:
            own.append(f"{_key(key)} = {_value(value, name)}")
    return own + nested


def _holds_tables(value: Any) -> bool:
    return isinstance(value, Mapping) or (
        isinstance(value, (list, tuple)) and bool(value) and all(isinstance(v, Mapping) for v in value)
    )


def _key(key: str) -> str:
    return key if _BARE.fullmatch(key) else _string(key)


def _value(value: Any, name: str) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, (int, float)):
        return (float if isinstance(value, float) else int).__repr__(
            value
        )  # the shortest text that reads back as the same number; inf and nan too
    if isinstance(value, str):
        return _string(value)
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{_key(k)} = {_value(v, f'{name}.{k}')}" for k, v in value.items()) + "}"
    if isinstance(value, (list, tuple)):
        parts = [_value(v, f"{name}[{i}]") for i, v in enumerate(value)]
        if sum(map(len, parts)) + 2 * len(parts) <= WIDTH:
            return "[" + ", ".join(parts) + "]"
        if all(isinstance(v, (bool, int, float)) for v in value):
            return "[\n" + "".join(f"  {', '.join(parts[i : i + 8])},\n" for i in range(0, len(parts), 8)) + "]"
        return "[\n" + "".join(f"  {p},\n" for p in parts) + "]"
    raise TypeError(f"{name} is a {type(value).__name__}; TOML holds strings, numbers, true, false, arrays and tables")


def _string(text: str) -> str:
    """A basic string; TOML wants every control character escaped."""
    short = {"\\": "\\\\", '"': '\\"', "\n": "\\n", "\t": "\\t", "\r": "\\r"}
    return '"' + re.sub(r'[\x00-\x1f\x7f"\\]', lambda m: short.get(m[0]) or f"\\u{ord(m[0]):04x}", text) + '"'
