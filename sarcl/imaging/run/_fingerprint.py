"""Fingerprint of a job: everything that the pixels of an image depend on, as text, numbers and checksums."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
from numpy.typing import DTypeLike

from ...base.fingerprint import as_bytes, checker, checksum, kernels, leaves
from ..engine import ImagePlan
from ..focusing_task import FocusingTask
from ..tiling.tiling import Tiling


def job(
    task: FocusingTask, method: str, tolerance: float, plan: ImagePlan, tiling: Tiling, dtype: DTypeLike
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
    described = {"raw", "grid", "antennas", "sample_weight", "row_weight", "wrap", "skips"}
    others = set(task.__dataclass_fields__) - described
    return {
        "sarcl": f"{__version__}, kernels {kernels()}",
        "method": method,
        "tolerance": tolerance,
        "plan": ", ".join(f"{k} {v}" for k, v in plan.describe(method).items()),
        "pixels": np.dtype(dtype).name,
        "samples": f"{raw.n_rows} x {raw.n_samples} {np.dtype(raw.samples.dtype).name} {samples.hexdigest()[:32]}",
        "antennas": checksum(*leaves(antennas)),
        "weights": checksum(task.sample_weight, task.row_weight),
        "grid": f"{' x '.join(map(str, grid.shape))} {checksum(*leaves(grid))}",
        "bands": tiling.n_bands,
        "wrap": task.wrap,
        "skip": ", ".join(sorted(task.skips)),
        "options": checksum(*(value for name in sorted(others) for value in (name, *leaves(getattr(task, name))))),
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
