"""Experiment files of `sarcl fda`: what all cases share, and what differs from case to case."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

from . import schema
from .fda import Case

KEYS = tuple(n for n in Case.__dataclass_fields__ if n != "name")


def load(path: Any) -> tuple[str, list[Case]]:
    """Title and cases of a TOML file: [fda] holds `title` and what all cases share, every [[case]] the rest.

    Without a [[case]] the shared table is the only one. ValueError names file and key of what does not fit.
    """
    path = Path(path)
    try:
        tables = tomllib.loads(path.read_bytes().decode("utf-8"))
    except FileNotFoundError:
        raise FileNotFoundError(f"experiment {str(path)!r} does not exist; check its name and folder") from None
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as exc:
        raise ValueError(f"{path}: {exc}; this is not valid TOML") from None
    for name in tables:
        if name not in ("fda", "case"):
            raise ValueError(f"{path}: {schema.unknown(name, ['fda', 'case'], 'table')}")
    shared = dict(tables.get("fda", {}))
    title = shared.pop("title", "Frequency-diverse apertures")
    given = tables.get("case", [{}])
    if not isinstance(given, list) or not all(isinstance(table, dict) for table in given):
        raise ValueError(f"{path}: cases are written [[case]], one table each")
    return str(title), [_case({**shared, **table}, i, path) for i, table in enumerate(given)]


def _case(table: dict[str, Any], number: int, path: Path) -> Case:
    where = f"{path}: case {number + 1}"
    for key in table:
        if key not in (*KEYS, "name"):
            raise ValueError(f"{where}: {schema.unknown(key, [*KEYS, 'name'], 'key')}")
    values: dict[str, Any] = {k: tuple(v) if isinstance(v, list) else v for k, v in table.items()}
    if not isinstance(values.get("mirrored", True), bool):
        raise ValueError(f"{where}: mirrored is {values['mirrored']!r}; give true or false")
    try:
        return Case(**{"name": f"case {number + 1}", **values})
    except (TypeError, ValueError) as exc:
        raise ValueError(f"{where}: {exc}") from exc
