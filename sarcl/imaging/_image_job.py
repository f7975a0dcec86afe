"""An image as a job that is computed in blocks."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..base.fingerprint import as_bytes, checker, checksum, kernels, leaves
from ..blocks.block_job import BlockJob
from ..blocks.dask_workers import portable
from ..opencl.device import Device
from .backproject_options import BackprojectOptions
from .engine import Engine, Skipped
from .focusing_task import FocusingTask
from .method_choice import MethodChoice


@dataclass(frozen=True, eq=False)
class ImageRecipe:
    """How the engine of an image is made on a device; max_bytes  as `backproject` takes it."""

    task: FocusingTask
    chosen: MethodChoice
    max_bytes: float | None

    @classmethod
    def portable(cls, task: FocusingTask, chosen: MethodChoice, max_bytes: float | None) -> ImageRecipe:
        """The recipe for another process: samples in files are read there."""
        raw = replace(task.raw, samples=portable(task.raw.samples))
        return cls(replace(task, raw=raw), chosen, max_bytes)

    def on(self, device: Device) -> Engine:
        """The engine on one device."""
        return self.chosen.on(device, self.task)

    def budget(self, device: Device) -> float:
        """Bytes that blocks may take on a device."""
        return BackprojectOptions(max_bytes=self.max_bytes).budget(device)


def image_job(task: FocusingTask, chosen: MethodChoice, tolerance: float) -> BlockJob:
    """The job of an image."""
    return BlockJob(
        kind="image",
        stage="backproject",
        bands=chosen.tiling,
        unit=chosen.unit,
        dtype=chosen.dtype,
        tally=Skipped,
        passes=task.raw.n_rows,
        describe=lambda: description(task, chosen, tolerance),
    )


def description(task: FocusingTask, chosen: MethodChoice, tolerance: float) -> dict[str, Any]:
    """Everything that the pixels depend on, as text and numbers; arrays, and the samples, as checksums.

    The device and its memory are left out: they change nothing but rounding. Reads all samples. TypeError for an option
    that cannot be described.
    """
    from ..base.version import __version__

    raw, grid, antennas = task.raw, task.grid, task.antennas
    samples = checker()
    step = max(1, 2**24 // (raw.n_samples * np.dtype(raw.samples.dtype).itemsize))
    for start in range(0, raw.n_rows, step):
        samples.update(as_bytes(raw.read(start, min(start + step, raw.n_rows))))
    described = {"raw", "grid", "antennas", "sample_weight", "row_weight", "wrap", "skips"}
    others = set(task.__dataclass_fields__) - described
    return {
        "sarcl": f"{__version__}, kernels {kernels()}",
        "method": chosen.method,
        "tolerance": tolerance,
        "plan": ", ".join(f"{k} {v}" for k, v in chosen.plan.describe(chosen.method).items()),
        "pixels": np.dtype(chosen.dtype).name,
        "samples": f"{raw.n_rows} x {raw.n_samples} {np.dtype(raw.samples.dtype).name} {samples.hexdigest()[:32]}",
        "antennas": checksum(*leaves(antennas)),
        "weights": checksum(task.sample_weight, task.row_weight),
        "grid": f"{' x '.join(map(str, grid.shape))} {checksum(*leaves(grid))}",
        "bands": chosen.tiling.n_bands,
        "wrap": task.wrap,
        "skip": ", ".join(sorted(task.skips)),
        "options": checksum(*(value for name in sorted(others) for value in (name, *leaves(getattr(task, name))))),
    }
