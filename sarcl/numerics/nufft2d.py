"""Samples at uneven wavenumbers to an even image: a two-dimensional nonuniform FFT of type 1, to a tolerance."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

import numpy as np

from ..base.errors import ToleranceUnreachable
from ..base.stage_timer import Clock
from ..base.text import size_text
from ..base.tolerances import askable, rounded_up
from ..opencl import fft
from ..opencl.device import Device
from ..opencl.launch_numbers import launch_numbers
from ..opencl.pipeline import Pipeline
from . import cost_model, shared_tile
from ._grid_image import WORK, OnDevice, OnHost
from .error_bounds import FLOAT32, sum_rounding
from .interpolation import TERMS, Interpolator, interpolator, lower_bound
from .plan import LEAST_TOLERANCE

if TYPE_CHECKING:
    from ..opencl.device import Buffer


OVERSAMPLE = (1.25, 1.5, 2.0, 2.5, 3.0, 4.0, 6.0, 8.0, 12.0, 16.0, 24.0, 32.0)
MOST_COUNTED = 2**20  # samples that are counted to find the most in a cell
CELLS = 64, 8  # cells per side of a tile of one work-item: on CPUs it stays in a cache, on GPUs many are at work


@dataclass(frozen=True, eq=False)
class GridPlan:
    """How samples become an image: interpolation kernel, cells of the grid, predicted error.

    density  square root of the most samples in one cell of 1/rows x 1/columns cycles per pixel, at least 1: the
             amplitude of the kernel's aliases may exceed that of the image by this factor
    """

    interpolator: Interpolator
    length: tuple[int, int]
    density: float
    predicted_error: float
    cost: float

    def describe(self) -> dict[str, object]:
        """The plan in words and numbers, for a report."""
        return {
            "method": "polar format",
            "taps": f"{self.interpolator.taps} x {self.interpolator.taps}",
            "cells": f"{self.length[0]} x {self.length[1]}",
        }


def make_plan(
    tolerance: float, shape: tuple[int, ...], cycles: np.ndarray, step: np.ndarray, n_samples: int, tile: int
) -> GridPlan:
    """The cheapest plan whose predicted error is at most `tolerance`; ToleranceUnreachable names the best there is.

    cycles, step  (n_rows, 2): cycles of phase per pixel of a row's middle sample, and their growth per sample
    tile          cells per side of a tile
    The error is relative to the larger of |I| and sqrt(pixels sum |s|^2), the norm if samples added at random. Only
    interpolation tables of plans that can be the cheapest are made.
    """
    most = most_in_a_cell(shape, cycles, step, n_samples)
    density = max(1.0, np.sqrt(most))

    def aliases(kernel_error: float) -> float:
        return float(density * (2 * kernel_error + kernel_error**2))

    def error_of(kernel: Interpolator, length: tuple[int, int]) -> float:
        cells = float(length[0]) * length[1]
        in_cell = most * shape[0] * shape[1] / cells
        rounding = sum_rounding(max(1, int(in_cell * kernel.taps**2)), int(min(cells, 2**60))) + 6 * FLOAT32.unit
        rounding *= _growth(kernel, shape, length) * max(1.0, np.sqrt(in_cell))  # samples of a cell may be alike
        return aliases(kernel.error) + rounding

    candidates = _candidates(shape, len(cycles) * n_samples, tile)
    if tolerance >= LEAST_TOLERANCE:
        for taps, oversample, length, cost in sorted(candidates, key=lambda candidate: candidate[-1]):
            if aliases(lower_bound(taps, oversample)) <= tolerance:
                kernel = interpolator(taps, oversample)
                error = error_of(kernel, length)
                if error <= tolerance:
                    return GridPlan(kernel, length, density, error, cost)
    least = np.inf
    for bound, taps, oversample, length in sorted((lower_bound(t, s), t, s, n) for t, s, n, _ in candidates):
        if aliases(bound) < least:
            least = min(least, error_of(interpolator(taps, oversample), length))
    reach = rounded_up(max(least, LEAST_TOLERANCE))
    raise ToleranceUnreachable(
        tolerance,
        askable(reach),
        "rounding of the float32 grid",
        "backproject goes further",
        how="by a polar format image",
    )


def _candidates(shape: tuple[int, ...], n_samples: int, tile: int) -> list[tuple[int, float, tuple[int, int], float]]:
    """Taps, oversampling, cells of the grid (rows, columns) and cost of every plan for so many samples of all rows."""
    out = []
    for taps in TERMS:
        for oversample in OVERSAMPLE:
            room = max(2 * taps + tile + 4, 4 * taps)
            rows, columns = (2 * fft.good_length(-(-int(max(np.ceil(oversample * n), room)) // 2)) for n in shape)
            cells = float(rows) * columns
            cost = n_samples * (cost_model.GRID_SAMPLE + cost_model.GRID_TAP * taps**2)
            out.append((taps, oversample, (rows, columns), cost + cost_model.GRID_CELL * cells * np.log2(cells)))
    return out


def _growth(kernel: Interpolator, shape: tuple[int, ...], length: tuple[int, ...]) -> float:
    """Factor by which rounding errors on the grid grow, rms, when the image is divided by the kernel's transform."""
    z = np.linspace(-0.5, 0.5, 33)
    energy = float((kernel.weights(z) ** 2).sum(axis=-1).mean())
    out = 1.0
    for n, m in zip(shape, length, strict=True):
        nu = np.linspace(0, n / 2, 33) / m
        out *= np.sqrt(energy * (1 / kernel.transform(nu) ** 2).mean())
    return float(out)


def most_in_a_cell(shape: tuple[int, ...], cycles: np.ndarray, step: np.ndarray, n_samples: int) -> float:
    """Most samples in one cell of 1/rows x 1/columns cycles per pixel, which an image of that size cannot resolve.

    Of more than 2^20 samples every k-th of a row is counted, in cells so wide that a row meets every cell on its way;
    the samples between are assumed on the line of those counted.
    """
    every = -(-len(cycles) * n_samples // MOST_COUNTED)
    n = (np.arange(0, n_samples, every) - n_samples // 2).astype(np.float32)
    size = np.array(shape)
    wide = max(1.0, float((every * np.abs(step - np.rint(step)) * size).max())) if every > 1 else 1.0
    bins = np.maximum((size / wide).astype(np.int64), 1)
    cell = np.zeros((len(cycles), len(n)), np.int64)
    for axis in (0, 1):
        first = (cycles[:, axis] % 1).astype(np.float32)[:, None]
        position = first + (step[:, axis] - np.rint(step[:, axis])).astype(np.float32)[:, None] * n
        position -= np.floor(position)
        position *= bins[axis]
        cell = cell * bins[axis] + np.minimum(position.astype(np.int32), bins[axis] - 1)
    if bins.prod() > 16 * cell.size:
        counts = np.unique(cell, return_counts=True)[1]
    else:
        counts = np.bincount(cell.ravel())
    return float(counts.max() * every / wide)


class Gridder:
    """A plan on a device, for rows whose wavenumbers are given."""

    def __init__(self, device: Device, plan: GridPlan, cycles: np.ndarray, step: np.ndarray, n_samples: int) -> None:
        self.device, self.plan, self.n_samples = device, plan, n_samples
        self.tile = tile_of(device)
        length = np.array(plan.length, np.float64)
        position = (cycles % 1) * length
        cell = np.floor(position)
        step = (step - np.rint(step)) * length
        # n high, |n| <= n_samples, must be exact in float32
        spare = max(0, 23 - int(np.ceil(np.log2(n_samples + 1))))
        grain = 2.0 ** (np.ceil(np.log2(np.maximum(np.abs(step), 1e-30))) - spare)
        high = np.rint(step / grain) * grain
        self.cell = cell.astype(np.int32)
        self.line = np.stack([position - cell, high, step - high], axis=-1).reshape(-1, 6).astype(np.float32)
        macros = {"TAPS": plan.interpolator.taps, "TERMS": plan.interpolator.terms, "TILE": self.tile}
        self.grouped, self.kernel = shared_tile.spreading_kernel(device, "nufft2d.cl", **macros, VW=1)
        self.table = device.upload(plan.interpolator.table)

    def blocks(self, budget: float, shape: tuple[int, ...], row_bytes: float = 0) -> tuple[int, int]:
        """Tile rows of the grid, and rows of samples, at a time in `budget` bytes. MemoryError where none fits.

        shape      of the image;  row_bytes  of a row of samples beside its 8 n_samples
        """
        return self._parts(budget, shape, row_bytes)[1]

    def _parts(
        self, budget: float, shape: tuple[int, ...], row_bytes: float
    ) -> tuple[OnHost | OnDevice, tuple[int, int]]:
        """What makes the image of the grid, and the `blocks`: the device where it can, at once where it fits."""
        device, length = self.device, self.plan.length
        flat = [
            1 / self.plan.interpolator.transform((np.arange(n) - n // 2) / m)
            for n, m in zip(shape, length, strict=True)
        ]
        sample_row, n_rows, n_tiles = 8 * self.n_samples + 32 + row_bytes, len(self.cell), -(-length[0] // self.tile)
        if OnDevice.possible(device, length, WORK * budget):
            end = OnDevice(device, length, flat, WORK * budget, True)
            grid, half = 8.0 * length[0] * length[1], 8.0 * shape[1] * length[0]
            rest = budget - end.nbytes - grid
            if rest >= sample_row and max(grid, half) <= device.info.max_alloc:
                most = min(rest, n_rows * sample_row, device.limits.upload)
                return end, (n_tiles, max(1, int(most // sample_row)))
            end = OnDevice(device, length, flat, WORK * budget, False)
            if end.nbytes + end.across(self.tile) + sample_row <= budget:
                return end, self._divided(budget, end, sample_row)
        host = OnHost(device, length, flat)
        return host, self._divided(budget, host, sample_row)

    def _divided(self, budget: float, end: OnHost | OnDevice, sample_row: float) -> tuple[int, int]:
        """`blocks` beside what makes the image of the grid."""
        across = end.across(self.tile)
        budget = min(budget - end.nbytes, 2 * self.device.info.max_alloc)
        if across + sample_row > budget:
            raise MemoryError(
                f"max_bytes leaves {size_text(budget)}, but a row of samples and {self.tile} rows of the grid need "
                f"{size_text(across + sample_row)}; raise max_bytes"
            )
        n_rows = len(self.cell)
        part = max(sample_row, min(budget / 2, n_rows * sample_row, budget - across))
        return max(1, int((budget - part) // across)), max(1, int(part // sample_row))

    def image(
        self,
        samples: Samples,
        shape: tuple[int, ...],
        budget: float,
        clock: Clock,
        on_progress: Callable[[float], None],
    ) -> np.ndarray:
        """The image complex64 of `shape`, its pixel (rows//2, columns//2) where every phase is that of the samples.

        on_progress  called with the share that is done
        """
        m0, m1 = self.plan.length
        end, (band, block) = self._parts(budget, shape, samples.row_bytes)
        n_rows, n_tiles = len(self.cell), -(-m0 // self.tile)
        pipeline = Pipeline(self.device)
        buffer = out = None
        with pipeline:
            for first in range(0, n_tiles, band):
                last = min(first + band, n_tiles)
                rows = min(last * self.tile, m0) - first * self.tile
                out = None  # frees the band before
                out = self.device.empty(8 * rows * m1)
                for start in range(0, n_rows, block):
                    stop = min(start + block, n_rows)
                    pipeline.new_block()
                    if buffer is None or block < n_rows:
                        buffer = samples.buffer(pipeline, start, stop)
                        clock.lap("samples")
                    cell, line = (pipeline.upload(a[start:stop]) for a in (self.cell, self.line))
                    tiles = -(-m1 // self.tile), last - first
                    self.device.run(
                        self.kernel, *shared_tile.launch(self.device, tiles, self.grouped),
                        launch_numbers(
                            "nufft2d.cl", "spread", n_rows=stop - start, n_samples=self.n_samples, m0=m0, m1=m1,
                            first=first, add=start > 0,
                        ),
                        buffer, cell, line, self.table, out, steps=stop - start,
                    )  # fmt: skip
                    share = 0.8 * (first + (last - first) * stop / n_rows) / n_tiles

                    def spread(share: float = share) -> None:
                        clock.lap("gridding")
                        on_progress(share)

                    pipeline.step(spread)
                if not samples.held and not isinstance(end, OnHost):  # known once all rows were read
                    end = OnHost(self.device, self.plan.length, end.flat)
                end.add(out, first * self.tile, rows)
                clock.lap("fft")
            buffer = out = None
            image = end.image()
        clock.lap("fft")
        on_progress(1.0)
        return image


class Samples(Protocol):
    """Weighted samples of rows, complex64.

    row_bytes  on the device per row, beside 8 n_samples
    held       whether the device can sum them, known once all were asked for: else the host makes the image
    """

    row_bytes: float
    held: bool

    def buffer(self, pipeline: Pipeline, start: int, stop: int) -> Buffer:
        """Rows start ... stop - 1 in a buffer, which may be the one of the call before."""


def tile_of(device: Device) -> int:
    """Cells per side of a tile."""
    if shared_tile.used_by(device):
        return shared_tile.CELLS
    return CELLS[0] if device.is_cpu else CELLS[1]
