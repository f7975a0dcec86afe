"""Samples times weights, with phases relative to the grid's centre: made on the device, or on the host."""

from __future__ import annotations

import numpy as np

from ...base.constants import SPEED_OF_LIGHT
from ...numerics.weighted_samples import WeightedSamples
from ...opencl import fft
from ...opencl.device import Buffer, Device
from ...opencl.pipeline import Pipeline
from ..focusing_task import FocusingTask, weighted_rows
from ._wavefront import Waves


class WeightedRows:
    """The weighted samples of all rows, as nufft2d.Gridder takes them, and their energy.

    A device that makes FFTs itself weighs them: what is uploaded are the samples as they are. On CPUs, and for samples
    whose sums the device may not hold, the host does.
    largest  modulus of a weighted sample so far, before it was rounded; of those that a device weighed a bound
    """

    def __init__(self, device: Device, task: FocusingTask, waves: Waves, tolerance: float) -> None:
        self.device, self.task, self.waves, self.tolerance = device, task, waves, tolerance
        self.held, self.row_bytes, self.largest = True, 0.0, 0.0
        self._energies = np.zeros(task.raw.n_rows)  # of rows that the host has weighed
        self._weigher: WeightedSamples | None = None
        self._out: Buffer | None = None
        self._rows = 0
        if fft.on_device(device, task.raw.n_samples, np.complex64):
            self._weigher = WeightedSamples(device, task.sample_weight, task.raw.n_rows, task.raw.samples.dtype)
            self.row_bytes = self._weigher.row_bytes

    def buffer(self, pipeline: Pipeline, start: int, stop: int) -> Buffer:
        """Rows start ... stop - 1 in a buffer, which may be the one of the call before."""
        if self._weigher is None:
            return self.device.upload(self._on_host(start, stop))
        raw, rows = self.task.raw, slice(start, stop)
        if stop - start > self._rows:
            self._out, self._rows = None, stop - start  # frees the smaller buffer first
            self._out = self.device.empty(8 * self._rows * raw.n_samples)
        samples, weights = raw.read(start, stop), self.task.row_weight[rows]
        bound = self._weigher.bound(samples, weights)
        assert self._out is not None
        if bound is not None:
            self._weigher.make(pipeline, samples, weights, self._cycles(rows), self._out, 0)
            self.largest = max(self.largest, bound)
            self._weigher.add_energy(self._out, 0, rows, bound)
        else:
            self.held = False
            self.device.write(self._out, self._on_host(start, stop))
        return self._out

    def energy(self) -> float:
        """The sum of the squares of all weighted samples."""
        return float(self._energies.sum()) + (self._weigher.energy() if self._weigher else 0.0)

    def _cycles(self, rows: slice) -> tuple[np.ndarray, np.ndarray]:
        """Cycles of phase of the first samples of rows relative to the grid's centre, and from one to the next."""
        raw, shift = self.task.raw, 2 / SPEED_OF_LIGHT * self.waves.shift[rows]
        return shift * raw.frequency[rows] % 1, shift * raw.frequency_step[rows] % 1

    def _on_host(self, start: int, stop: int) -> np.ndarray:
        """Samples of rows start ... stop - 1 times their weights, with phases relative to the centre: complex64."""
        task, rows = self.task, slice(start, stop)
        raw = task.raw
        samples, largest = weighted_rows(raw, (task.sample_weight, task.row_weight), start, stop)
        self.largest = max(self.largest, largest)
        # where the reference is the centre, the shift is rounding alone
        shift = float(np.abs(self.waves.shift[rows]).max())
        if shift * 4 * np.pi * task.highest / SPEED_OF_LIGHT > 1e-3 * self.tolerance:
            first, step = (cycles[:, None] for cycles in self._cycles(rows))
            samples = samples * np.exp(2j * np.pi * (first + step * np.arange(raw.n_samples)))
        out = samples.astype(np.complex64)
        self._energies[rows] = (out.real.astype(np.float64) ** 2 + out.imag.astype(np.float64) ** 2).sum(axis=1)
        return out
