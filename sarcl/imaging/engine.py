"""Base classes of the methods of focusing: a plan, and an engine that makes bands of the image on one device."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from ..base.stage_timer import Clock
from ..blocks import bands
from ..blocks.bands import FlatArray, Run
from ..numerics import cost_model, device_profiles, range_profiles
from ..numerics.device_profiles import DeviceProfiles
from ..numerics.interpolation import Interpolator
from ..opencl.device import Buffer, Device
from ..opencl.pipeline import Pipeline
from .focusing_task import FocusingTask
from .row_norms import largest_sample
from .tiling.tiling import Tiling


@dataclass(frozen=True)
class Skipped:
    """Numbers of (row, pixel) pairs that were left out, by reason.

    window  pairs outside the range window of the row
    beam    pairs inside the range window but outside the beam
    """

    window: int = 0
    beam: int = 0

    @classmethod
    def of_tiles(cls, missed: np.ndarray, sizes: np.ndarray) -> Skipped:
        """From the rows left out of every tile, by reason (2, n_tiles), and the pixels of each tile (n_tiles,)."""
        return cls(*(int((rows * sizes).sum()) for rows in missed))

    def __add__(self, other: Skipped) -> Skipped:
        return Skipped(self.window + other.window, self.beam + other.beam)


class ImagePlan(Protocol):
    """Plan of an image by a method. It depends on the task and the tolerance, never on the memory of a device."""

    @property
    def predicted_error(self) -> float:
        """Bound of the relative error."""
        ...

    @property
    def cost(self) -> float:
        """Cost of the image, relative to that of other plans of the method."""
        ...

    @property
    def length(self) -> int:
        """Samples of a range profile."""
        ...

    def describe(self, method: str) -> dict[str, object]:
        """The plan in words and numbers, for a report."""
        ...


class Engine(bands.Engine, Protocol):
    """A method of focusing, on one device, for one task and plan.

    tiling  tiling whose bands are computed in blocks; fixed by grid, geometry and tolerance
    dtype   data type of the pixels: complex64 or complex128
    least   pixels a block should have at least, so that the cost of the range profiles, which every block makes anew,
            stays below a tenth; inf: blocks are as large as memory allows, and a killed run loses as much
    """

    tiling: Tiling
    dtype: type[np.complexfloating]
    least: float = np.inf
    most: float = np.inf

    def __init__(self, device: Device, task: FocusingTask, plan: object, tiling: Tiling) -> None: ...

    def working(self, nbytes: float) -> float:
        """Estimated bytes on the device that `fill` takes for the first block when it is given nbytes."""

    def repeated(self, nbytes: float) -> float:
        """Cost, in contributions of numerics/cost_model, of what `fill` makes more than once because nbytes on the
        device divide the image: range profiles, and what precedes the division."""

    def fill(
        self, first: int, last: int, flat: FlatArray, budget: float, clock: Clock, on_progress: Callable[[float], None]
    ) -> Skipped:
        """See bands.Engine; passes are the task's rows. Returns the number of (row, pixel) pairs that were skipped."""


class DirectEngine(Engine, Protocol):
    """An engine of a direct method, in either number type: its blocks hold as many tiles as fit."""

    profiles: RowProfiles

    def tiles_at_once(self, nbytes: float) -> int:
        """Tiles that fit in nbytes on the device beside the range profiles; MemoryError where those do not fit."""

    def blocks(self, nbytes: float) -> list[Run]:
        """See Engine. A band that is alone may be larger than what fits: `fill` makes it in parts."""
        return self.tiling.blocks(self.tiles_at_once(nbytes) * self.tiling.per_tile)

    def repeated(self, nbytes: float) -> float:
        """See Engine: the range profiles of all rows, for each block and each part of a band."""
        most, tiling = self.tiles_at_once(nbytes) * self.tiling.per_tile, self.tiling
        passes = sum(max(1, -(-tiling.pixels(*run) // most)) for run in self.blocks(nbytes))
        return float((passes - 1) * self.profiles.cost)

    def working(self, nbytes: float) -> float:
        """See Engine: sums and values of the pixels, and the range profiles of 256 rows."""
        return min(24.0 * self.tiling.pixels(*self.blocks(nbytes)[0]) + 8.0 * self.profiles.length * 256, nbytes)


class RowProfiles:
    """Range profiles of a task's rows on a device, for an interpolator.

    length    samples of a profile; pad: samples that repeat its other end, on each side; stride: both together
    dtype     complex64 or complex128
    pipeline  of the blocks of rows: a block's profiles are made, and its other arrays uploaded, after `new_block`

    On a GPU samples are uploaded and the device makes the profiles; on a CPU the host does, in the same memory.
    """

    def __init__(
        self,
        device: Device,
        task: FocusingTask,
        interpolator: Interpolator,
        length: int,
        pad: int | None = None,
        dtype: type[np.complexfloating] = np.complex64,
        largest: float | None = None,
    ) -> None:
        """largest  `largest_sample` of a task with these rows and others, where it is known."""
        self.device, self.task, self.length, self.dtype = device, task, length, dtype
        self.pad = range_profiles.padding(interpolator) if pad is None else pad
        self.stride = length + 2 * self.pad
        correction = range_profiles.correction(interpolator, task.raw.n_samples, length)
        self.sample_weight = task.sample_weight * correction
        self.pipeline = Pipeline(device)
        self._maker: DeviceProfiles | None = None
        self._largest: float | None = None
        if device_profiles.possible(device, length, dtype):
            self._maker = DeviceProfiles(device, self.sample_weight, length, self.pad, dtype)
            largest = largest or largest_sample(task)
            self._largest = None if largest is None else largest * float(np.abs(correction).max())

    @property
    def cost(self) -> float:
        """Cost of the profiles of all rows, in contributions."""
        return self.task.raw.n_rows * cost_model.profile(self.length)

    @property
    def on_device(self) -> bool:
        """Whether the device makes the profiles, and not the host."""
        return self._maker is not None

    def nbytes(self, rows: int) -> float:
        """Bytes on the device for the profiles of a block of so many rows."""
        return self._maker.nbytes(rows) if self._maker else self._row_bytes * rows

    def rows_in(self, nbytes: float) -> int:
        """Rows of a block whose profiles take this many bytes at most."""
        return self._maker.rows_in(nbytes) if self._maker else int(nbytes / self._row_bytes)

    def most_rows(self, on_cpu: int, on_others: int) -> int:
        """Most rows of a block, whatever the memory: as given, and on GPUs about `limits.upload` bytes of samples."""
        if self.device.is_cpu:
            return on_cpu
        sample_bytes = self.task.raw.samples.dtype.itemsize * self.task.raw.n_samples
        return max(1, min(on_others, self.device.limits.upload // sample_bytes))

    def upload(self, start: int, stop: int) -> Buffer:
        """Buffer of the profiles (stop - start, stride) of rows start ... stop - 1."""
        along = self.task.row_weight[start:stop]
        samples = self.task.raw.read(start, stop)
        if self._maker and self._maker.holds(samples, along, self._largest):
            buffer, weights = self.pipeline.upload(samples), self.pipeline.upload(self._maker.weights(along))
            return self._maker.make(buffer, samples.dtype, weights, stop - start)
        weights = along[:, None] * self.sample_weight
        profiles = range_profiles.from_samples(self.device, samples, weights, self.length, self.pad, self.dtype)
        return self.pipeline.upload(profiles)

    @property
    def _row_bytes(self) -> float:
        """Bytes of the profile of a row that the host makes, for as many blocks as are in memory."""
        return float(np.dtype(self.dtype).itemsize * self.stride * self.pipeline.held)
