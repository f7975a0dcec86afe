"""Experiment files of `sarcl fda`: keys shared by all cases, keys of each case, and swept keys."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from ...base import text, validation
from ...base.types import PathLike
from ...io import input_paths, toml
from ._sweep import KEYS as SWEPT
from ._sweep import cases
from .case import Case

KEYS = tuple(n for n in Case.__dataclass_fields__ if n not in ("name", "series", "swept"))
ANGLES = ("squint", "steer")
TABLES = ["fda", "case", "sweep"]


def load(path: PathLike) -> tuple[str, list[Case]]:
    """Title and cases of a TOML file: [fda] holds `title` and the keys that all cases share, each [[case]] its own.

    Without a [[case]] the shared table is the only case. [sweep] makes of each case one case per combination of its
    lists (`sarcl.fda.sweep`). squint_deg and steer_deg are in degrees. ValueError names the file and the key.
    """
    path = Path(path)
    try:
        tables = toml.tables(input_paths.contents(path, "experiment").decode("utf-8"), str(path))
    except UnicodeDecodeError as exc:
        raise ValueError(f"{path}: {exc}; this is not valid TOML") from None
    for name in tables:
        if name not in TABLES:
            raise ValueError(f"{path}: {text.unknown(name, TABLES, 'table')}")
    for name in ("fda", "sweep"):
        if not isinstance(tables.get(name, {}), dict):
            raise ValueError(f"{path}: {name} is {tables[name]!r:.60}; it is a table, written [{name}]")
    shared = dict(tables.get("fda", {}))
    title = shared.pop("title", "Frequency-diverse apertures")
    case_tables = tables.get("case", [{}])
    if not isinstance(case_tables, list) or not all(isinstance(table, dict) for table in case_tables):
        raise ValueError(f"{path}: cases are written [[case]], one table each")
    out: list[Case] = []
    for i, table in enumerate(case_tables):
        where = f"{path}: case {i + 1}"
        fields = {"name": f"case {i + 1}", **_plain({**shared, **table}, (*KEYS, "name"), where)}
        try:
            if "sweep" in tables:
                where = f"{path}: [sweep] of case {i + 1}"
                out += cases(fields, _plain(tables["sweep"], SWEPT, where))
            else:
                out.append(Case(**fields))
        except (TypeError, ValueError) as exc:
            raise ValueError(str(exc) if str(exc).startswith(where) else f"{where}: {exc}") from exc
    return str(title), out


def _plain(table: dict[str, Any], known: tuple[str, ...], where: str) -> dict[str, Any]:
    """Keys and values for Case: tuples instead of lists, radians instead of degrees."""
    degrees = {f"{name}_deg": name for name in ANGLES}
    out: dict[str, Any] = {}
    for key, value in table.items():
        if key not in (*known, *degrees):
            raise ValueError(f"{where}: {text.unknown(key, [*known, *degrees], 'key')}")
        name = degrees.get(key, key)
        if name in out:
            raise ValueError(f"{where}: {name} is given twice, in radians and in degrees; leave one out")
        out[name] = _tuples(value) if name == key else _radians(key, value, where)
    return out


def _tuples(value: object) -> object:
    return tuple(_tuples(v) for v in value) if isinstance(value, list) else value


def _radians(key: str, value: object, where: str) -> float | tuple[float, ...]:
    try:
        angles = [float(np.deg2rad(validation.number(key, v))) for v in (value if isinstance(value, list) else [value])]
    except ValueError as exc:
        raise ValueError(f"{where}: {exc}") from None
    return tuple(angles) if isinstance(value, list) else angles[0]
