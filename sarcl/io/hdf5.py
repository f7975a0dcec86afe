"""Plain values written to HDF5 and read again: numbers, words, arrays, a report; blocks of rows."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    import h5py

    from ..base.report import Report
    from ..base.types import WritableArray

FORMAT = 1  # version of sarcl's HDF5 file
BLOCK_BYTES = 2**22  # bytes of a block of rows, about
ATTRIBUTE_LETTERS = 2**12  # letters from which a text is a dataset: attributes end at 64 KB, of all of them together


def sign(file: h5py.File, kind: str) -> None:
    """Mark a file as sarcl's."""
    file.attrs["sarcl_file"] = kind
    file.attrs["format"] = FORMAT


def blocks(dataset: WritableArray) -> Iterator[tuple[int, int]]:
    """Row ranges (start, stop) of about BLOCK_BYTES each."""
    n = dataset.shape[0]
    row = max(1, int(np.prod(dataset.shape[1:], dtype=np.int64))) * dataset.dtype.itemsize
    step = max(1, BLOCK_BYTES // row)
    for a in range(0, n, step):
        yield a, min(a + step, n)


def put(group: h5py.Group, name: str, value: object) -> None:
    """A number or word as an attribute, an array as a dataset, None not at all."""
    import h5py

    if value is None:
        return
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, (int, float)) or (isinstance(value, str) and len(value) < ATTRIBUTE_LETTERS):
        group.attrs[name] = value
        return
    value = np.asarray(value)
    if value.dtype.kind == "U":
        group.create_dataset(name, data=value.astype(object), dtype=h5py.string_dtype())
    else:
        group.create_dataset(name, data=value)


def get(group: h5py.Group, name: str) -> Any:
    """Value that `put` stored: a str, an int or float, an array, or None."""
    import h5py

    if name in group.attrs:
        value = group.attrs[name]
        return value.item() if isinstance(value, np.generic) else value
    if name not in group:
        return None
    if h5py.check_string_dtype(group[name].dtype) is not None:
        words = group[name].asstr()[...]
        return words.astype(str) if group[name].shape else str(words)
    return group[name][...]


def get_all(group: h5py.Group, leave: Sequence[str] = ()) -> dict[str, Any]:
    """Values that `put` stored in a group, by name, except the names to leave; a group in it becomes a mapping."""
    import h5py

    names = [name for name in (*group.attrs, *group) if name not in leave]
    inside = {name for name in names if name not in group.attrs and isinstance(group[name], h5py.Group)}
    return {name: get_all(group[name]) if name in inside else get(group, name) for name in names}


def put_report(file: h5py.File, report: Report | None) -> None:
    """A report as a dataset of JSON text; None not at all."""
    if report is not None:  # a dataset: attributes end at 64 KB
        file["report"] = report_text(report)


def get_report(file: h5py.File) -> Report | None:
    """The report that `put_report` stored, or None."""
    return report_of(file["report"].asstr()[()]) if "report" in file else None


def report_text(report: Report) -> str:
    """A report as JSON text."""
    return json.dumps(_plain(report.to_dict()))


def report_of(text: str) -> Report:
    """The report of `report_text`."""
    from ..base.report import Report

    return Report(**_revive(json.loads(text)))


def _plain(value: object) -> object:
    """A value of a report in the types of JSON; a tuple is marked as one, any other type becomes its text."""
    if isinstance(value, Mapping):
        return {str(k): _plain(v) for k, v in value.items()}
    if isinstance(value, tuple):
        return {"__tuple__": [_plain(v) for v in value]}
    if isinstance(value, list):
        return [_plain(v) for v in value]
    if isinstance(value, (np.generic, np.ndarray)):
        return _plain(value.tolist())
    return value if value is None or isinstance(value, (bool, int, float, str)) else str(value)


def _revive(value: Any) -> Any:
    if isinstance(value, list):
        return [_revive(v) for v in value]
    if isinstance(value, dict):
        if set(value) == {"__tuple__"}:
            return tuple(_revive(v) for v in value["__tuple__"])
        return {k: _revive(v) for k, v in value.items()}
    return value
