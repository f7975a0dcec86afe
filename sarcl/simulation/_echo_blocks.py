"""Echoes as a job that is computed in blocks of pulses: each pulse has the same bits in whatever block it is."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..base.stage_timer import Clock
from ..blocks.bands import BandBuffer, FlatArray, Run
from ..blocks.block_job import BlockJob
from ..opencl.device import Device
from ..opencl.memory_budget import budget
from .echo_files import job_description
from .echo_output import pulses_at_once
from .echo_task import EchoTask
from .planned_echoes import PlannedEchoes
from .scene_echoes import Added, SceneEchoes

# of a block: fewer bytes of samples take longer to write, unless its contributions take about a second
LEAST_BYTES, LEAST_CONTRIBUTIONS = 2.0**22, 1e8
UNIT = 64  # pulses: a block begins at a multiple of so many, which fill the lanes of every device


@dataclass(frozen=True)
class PulseBands:
    """The rows of echoes in bands of one pulse: see blocks.bands.Bands.

    shape  of the samples: (pulses, ..., samples)
    """

    shape: tuple[int, ...]

    @property
    def n_bands(self) -> int:
        """Number of pulses."""
        return self.shape[0]

    @property
    def row_shape(self) -> tuple[int, ...]:
        """Shape of a row: its samples."""
        return self.shape[-1:]

    def extent(self, first: int, last: int) -> slice:
        """Rows of pulses first ... last - 1."""
        n = int(np.prod(self.shape[1:-1], dtype=np.int64))
        return slice(first * n, last * n)

    def count(self, first: int, last: int) -> int:
        """Number of these pulses."""
        return last - first


class EchoEngine:
    """Echoes of a prepared scene on its device: see blocks.bands.Engine.

    passes  contributions to a pulse: scatterers times range profiles
    """

    def __init__(self, planned: PlannedEchoes, scene: SceneEchoes) -> None:
        """scene  prepared as planned"""
        self.method, self.scene = planned.method, scene
        self.bands = PulseBands(planned.channels.shape)
        self.most = float(pulses_at_once(self.bands.shape, True, scene.request.budget))
        self.passes = len(scene) * self.method.runs // self.bands.n_bands

    @property
    def least(self) -> float:
        """Pulses of a block, at least: also so that its samples are worth a file."""
        worth = min(LEAST_BYTES / (8.0 * np.prod(self.bands.shape[1:])), LEAST_CONTRIBUTIONS / max(self.passes, 1))
        return max(float(self.method.least(self.scene)), float(worth))

    def blocks(self, nbytes: float) -> list[Run]:
        """See Engine: no block needs more of the device than another."""
        return [(0, self.bands.n_bands)]

    def fill(
        self, first: int, last: int, flat: FlatArray, budget: float, clock: Clock, on_progress: Callable[[float], None]
    ) -> Added:
        """See Engine: passes are the contributions to a pulse."""
        total, in_memory = len(self.scene) * self.method.runs, isinstance(flat, (np.ndarray, BandBuffer))
        n_pulses = last - first

        def progress(stage: str, done: int, _: int) -> None:
            on_progress(min(done / n_pulses, self.passes))

        request = replace(self.scene.request, clock=clock, progress=progress)
        scene, added = replace(self.scene, request=request), Added()
        at_once = min(self.method.pulses(budget), n_pulses if in_memory else int(self.most))
        for start in range(first, last, at_once):
            rows = self.bands.extent(start, min(start + at_once, last))
            shape = min(at_once, last - start), *self.bands.shape[1:]
            samples = flat[rows].reshape(shape) if in_memory else np.empty(shape, np.complex64)
            samples[:] = 0
            added += self.method.fill(scene, samples, start, added.counts.pairs, total)
            if not in_memory:
                flat[rows] = samples.reshape(-1, shape[-1])
        return added


@dataclass(frozen=True, eq=False)
class EchoRecipe:
    """How echoes are computed on a device as they were planned: the scene is prepared there once.

    max_bytes  as `echo` takes it
    """

    planned: PlannedEchoes
    max_bytes: float | None

    def on(self, device: Device) -> EchoEngine:
        """The engine on one device."""
        planned, prepared = self.planned.on(device, self.budget(device)).with_scene()
        return EchoEngine(planned, prepared)

    def budget(self, device: Device) -> float:
        """Bytes that blocks may take on a device."""
        return budget(device, self.max_bytes)


def echo_job(task: EchoTask, shape: tuple[int, ...], passes: int = 0) -> BlockJob:
    """The job of echoes with samples of this shape; passes  see EchoEngine, 0 where they are not known yet."""
    return BlockJob(
        kind="phase history",
        stage="echo",
        bands=PulseBands(shape),
        unit=UNIT,
        dtype=np.complex64,
        tally=Added,
        passes=passes,
        describe=lambda: description(task, shape),
    )


def description(task: EchoTask, shape: tuple[int, ...]) -> dict[str, Any]:
    """Everything that the samples depend on: see echo_files.job_description."""
    options, request = task.options, task.request
    named = {
        "method": options.method,
        "tolerance": options.tolerance,
        "polarization": ", ".join(request.polarizations),
        "seed": options.seed,
        "edges": request.crease,
        "skip": ", ".join(sorted(request.skips)),
        "bounces": str(request.bounces),
    }
    subjects = {"scene": task.original, "waveform": task.waveform, "track": task.given_track}
    return job_description(options, subjects, shape, named)
