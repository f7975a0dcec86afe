"""Fingerprint of a job: everything that the pixels of an image depend on, as text, numbers and checksums."""

from __future__ import annotations

import functools
import hashlib
import json
from collections.abc import Mapping
from dataclasses import is_dataclass
from typing import Any

import numpy as np

from ..engine import ImagePlan
from ..focusing_task import FocusingTask
from ..tiling.tiling import Tiling


def job(
    task: FocusingTask, method: str, tolerance: float, plan: ImagePlan, tiling: Tiling, dtype: Any
) -> dict[str, Any]:
    """Everything that the pixels depend on, as text and numbers; arrays, and the samples, as checksums.

    The device and its memory are left out: they change nothing but rounding. Reads all samples. TypeError for an option
    that cannot be described.
    """
    from ...base.version import __version__

    raw, grid, antennas = task.raw, task.grid, task.antennas
    samples = checker()
    step = max(1, 2**24 // (raw.n_samples * np.dtype(raw.samples.dtype).itemsize))
    for start in range(0, raw.n_rows, step):
        samples.update(as_bytes(raw.read(start, min(start + step, raw.n_rows))))
    others = set(task.__dataclass_fields__) - {
        "raw", "grid", "antennas", "sample_weight", "row_weight", "wrap", "skips",
    }  # fmt: skip
    return {
        "sarcl": f"{__version__}, kernels {_kernels()}",
        "method": method,
        "tolerance": tolerance,
        "plan": ", ".join(f"{k} {v}" for k, v in plan.describe(method).items()),
        "pixels": np.dtype(dtype).name,
        "samples": f"{raw.n_rows} x {raw.n_samples} {np.dtype(raw.samples.dtype).name} {samples.hexdigest()[:32]}",
        "antennas": checksum(*_leaves(antennas)),
        "weights": checksum(task.sample_weight, task.row_weight),
        "grid": f"{' x '.join(map(str, grid.shape))} {checksum(*_leaves(grid))}",
        "bands": tiling.n_bands,
        "wrap": task.wrap,
        "skip": ", ".join(sorted(task.skips)),
        "options": checksum(*(value for name in sorted(others) for value in (name, *_leaves(getattr(task, name))))),
    }


def mark(job: dict[str, Any]) -> str:
    """The job's fingerprint."""
    return checksum(json.dumps(job, sort_keys=True))


def difference(there: dict[str, Any], here: dict[str, Any]) -> str:
    """The differences between two jobs, in words."""
    differences = []
    for name, value in here.items():
        if there.get(name) != value:
            plain = name in ("sarcl", "method", "tolerance", "pixels", "wrap", "skip")
            differences.append(f"{name} was {there.get(name)}, is {value}" if plain else f"other {name}")
    return "; ".join(differences) or "other options"


def checker(*parts: Any) -> Any:
    """A checksum object that has taken `parts`, bytes or views of them."""
    made = hashlib.blake2b(digest_size=32)
    for part in parts:
        made.update(part)
    return made


def as_bytes(values: np.ndarray) -> np.ndarray:
    """The bytes of an array, in C order."""
    return np.ascontiguousarray(values).reshape(-1).view(np.uint8)


def checksum(*values: Any) -> str:
    """Checksum of arrays, numbers (or tuples of them), strings and None, with shapes and types."""
    made = checker()
    for value in values:
        if value is None or isinstance(value, str):
            made.update(repr(value).encode())
        else:
            array = np.asarray(value)
            made.update(f"{array.dtype.str}{array.shape}".encode())
            made.update(as_bytes(array))
    return str(made.hexdigest()[:32])


def _leaves(value: Any) -> list[Any]:
    """The names, arrays, numbers, strings and None in a dataclass, or in a tuple, list or dict of such, for
    `checksum`."""
    if is_dataclass(value) and not isinstance(value, type):
        value = {name: getattr(value, name) for name in value.__dataclass_fields__}
    if isinstance(value, Mapping):
        return [leaf for name in sorted(value) for leaf in (str(name), *_leaves(value[name]))]
    if isinstance(value, (tuple, list, frozenset, set)):
        return [
            leaf for part in (value if isinstance(value, (tuple, list)) else sorted(value)) for leaf in _leaves(part)
        ]
    if value is None or isinstance(value, (str, bool, int, float, complex, np.ndarray, np.generic)):
        return [value]
    raise TypeError(f"tiles computed with a {type(value).__name__} among the options cannot be identified")


@functools.cache
def _kernels() -> str:
    """Checksum of the kernel sources: tiles of two versions are not mixed."""
    from importlib.resources import files

    sources = [(p.name, p.read_text()) for p in files("sarcl.kernels").iterdir() if p.name.endswith((".cl", ".clh"))]
    return checksum(*(text for pair in sorted(sources) for text in pair))[:12]
