"""TOML from Python: what tomllib reads back is equal, floats to the last bit."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

WIDTH = 80


def dumps(tables: Mapping[str, Any]) -> str:
    """TOML text of nested tables of str, bool, int, float, lists and dicts.

    TypeError names the key whose value TOML has no word for (None, complex, an array: give lists).
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
    return key if re.fullmatch(r"[A-Za-z0-9_-]+", key) else _string(key)


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
