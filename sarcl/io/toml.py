"""TOML text: read with the file and line in messages, the line of each key, and values written as TOML."""

from __future__ import annotations

import re
import textwrap
import tomllib
from bisect import bisect_right
from collections.abc import Mapping
from typing import Any

Path = tuple[str | int, ...]

WIDTH = 80  # most characters of a line with the numbers of an array
INDENT = 2  # spaces

_BARE = re.compile(r"[A-Za-z0-9_-]+")
_SCALAR = re.compile(r"[^\s,\]}#]+(?: \d[^\s,\]}#]*)?")  # a space may separate date and time
_STRING = re.compile(r'"""(?:\\.|[^\\])*?"{3,5}' r"|'''.*?'{3,5}" r'|"(?:\\.|[^"\\])*"' r"|'[^']*'", re.DOTALL)
_FLAT = re.compile(r"""\[[^\[\]{}"'#]*\]""")  # an array of numbers: nothing in it has a path of its own
# an array of numbers as tomli-w writes it; strings hold no line end there
_NUMBERS = re.compile(r"\[\n(?P<indent> +)(?P<values>[-+.\w]+(?:,\s+[-+.\w]+)*),\n *\]")
_SPACE = re.compile(r"(?:[ \t\r\n]|#[^\n]*)*")
_ESCAPE = re.compile(r'\\(u[0-9A-Fa-f]{4}|U[0-9A-Fa-f]{8}|x[0-9A-Fa-f]{2}|[btnfre"\\])')
_ESCAPED = {"b": "\b", "t": "\t", "n": "\n", "f": "\f", "r": "\r", "e": "\x1b", '"': '"', "\\": "\\"}


def tables(text: str, name: str) -> dict[str, Any]:
    """The tables of a TOML text; ValueError begins with `name`, the file, and the line where the text is no TOML."""
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as exc:
        raise ValueError(_syntax(name, text, str(exc))) from None


def _syntax(name: str, text: str, message: str) -> str:
    """tomllib's message with file and line in front, the form that editors recognise."""
    match = re.search(r" \(at (?:line (\d+), column (\d+)|end of document)\)", message)
    line = int(match[1]) if match and match[1] else text.rstrip().count("\n") + 1
    column = f" (column {match[2]})" if match and match[2] else " (at the end)" if match else ""
    reason = message[: match.start()] if match else message
    return f"{name}:{line}: {reason}{column}; this is not valid TOML"


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

    tomli-w writes the text; numbers of an array, each on a line of its own there, are then put side by side.
    TypeError names a key whose value is of no TOML type (None, complex, NumPy arrays: give lists).
    """
    import tomli_w

    _check(tables, "")
    return _NUMBERS.sub(_side_by_side, tomli_w.dumps(tables, indent=INDENT))


def _check(value: object, name: str) -> None:
    if isinstance(value, Mapping):
        for key, part in value.items():
            _check(part, f"{name}.{key}" if name else key)
    elif isinstance(value, (list, tuple)):
        for i, part in enumerate(value):
            _check(part, f"{name}[{i}]")
    elif not isinstance(value, (bool, int, float, str)):
        kind = type(value).__name__
        raise TypeError(f"{name} is a {kind}; TOML holds strings, numbers, true, false, arrays and tables")


def _side_by_side(match: re.Match[str]) -> str:
    """An array of numbers on one line, or on lines of at most WIDTH characters."""
    values = ", ".join(match["values"].replace(",", " ").split())
    if len(values) + 2 <= WIDTH:
        return f"[{values}]"
    indent = match["indent"]
    lines = textwrap.fill(values, WIDTH, initial_indent=indent, subsequent_indent=indent, break_on_hyphens=False)
    return f"[\n{lines},\n{indent[INDENT:]}]"
