"""Both directions in complex64: the plan of an echo of points, and the plan of an image, each made once."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np

from ..base.errors import ToleranceUnreachable
from ..base.stage_timer import Clock
from ..imaging import antenna_beam
from ..imaging.backproject import BackprojectPlan
from ..imaging.backproject_options import BackprojectOptions
from ..imaging.focusing_task import FocusingTask
from ..imaging.method_choice import MethodChoice
from ..imaging.tiling.of_grid import tiling_of
from ..model.waveform import Waveform
from ..opencl.device import Device
from ..scattering.antenna_weights import AntennaWeights
from ..scattering.scatterers import Points
from ..simulation.points.point_plan import PointPlan, PreparedPoints
from ..simulation.spreading import ChannelView, HostTiling
from ._measurement import Measurement, RowsAsRead

LARGEST_GAIN_SHARE = 0.5  # of a tolerance, for the rounding of gains in float32; the rest is for a plan


class Image:
    """The sums of samples over rows, in every pixel: the plan of `backproject` without its weights."""

    def __init__(self, options: BackprojectOptions, measurement: Measurement, choice: MethodChoice) -> None:
        self.choice, self._samples, task = choice, measurement.samples, measurement.task
        self._plan = BackprojectPlan(options, task.raw, task.grid, task, choice, None, {})

    def __call__(self, samples: np.ndarray | RowsAsRead) -> np.ndarray:
        """Pixels (n,), complex64 or complex128, of samples (n_rows, n_samples)."""
        self._samples.array = samples
        return self._plan.pixels().ravel()


class PointEchoes:
    """The echoes of the pixels as points: direct or factorised, as `echo` adds them.

    predicted_error  relative, for amplitudes with random phases and for equal ones
    """

    dtype = np.complex64

    def __init__(self, device: Device, measurement: Measurement, tolerance: float, method: str, budget: float) -> None:
        task = measurement.task
        self.device, self._measurement, self._budget = device, measurement, budget
        raw, antennas = task.raw, task.antennas
        gains = 0.0
        weights = AntennaWeights(antennas, float(np.median(antennas.frequency)))
        if task.antenna is not None:
            weights, gains = task.antenna.at(antennas), gain_rounding(task, tolerance)
        bandwidth = float(raw.bandwidth.max())
        frequencies = raw.frequency[0] + np.arange(raw.n_samples) * raw.frequency_step[0]
        vertical = np.array([0.0, 0.0, 1.0])
        self._view = ChannelView(antennas, weights, frequencies, bandwidth, ("HH",), vertical, gated=not task.wrap)
        positions = measurement.positions
        self._points = Points(positions, np.ones(len(positions), np.complex128))
        band = Waveform.chirp(center=self._view.band.carrier, bandwidth=bandwidth, duration=1 / bandwidth)
        if task.wrap:
            method = "direct"  # cells of the factorised method have places that do not repeat
        prepared = PreparedPoints(device, self._points, antennas, band, weights, method)
        self._inner = tolerance - gains
        self.plan: PointPlan = prepared.plan(weights, self._view.band, self._inner, 1)
        self.predicted_error = self.plan.predicted_error + gains

    def rows_of(self, amplitudes: np.ndarray) -> Callable[[int, int], np.ndarray]:
        """What makes samples (stop - start, n_samples) complex64 of rows start ... stop - 1 from amplitudes (n,) of all
        pixels."""
        measurement, view = self._measurement, self._view
        nodes = np.array([view.weights.frequency])
        seen = amplitudes if measurement.seen is None else amplitudes[measurement.seen]
        points = Points(self._points.positions, seen)
        direct = None
        leveled = self.plan.factorized_spreader(self.device, points, view, nodes, (0,), self._budget)
        if self.plan.direct is not None:
            numbers = slice(None) if self.plan.numbers is None else self.plan.numbers
            tiling = self.plan.direct[0].tiling
            assert isinstance(tiling, HostTiling)
            tiling.refill(partial(_planes, seen[numbers]))
            direct = self.plan.direct_spreader(view, nodes, self._inner, self._budget)

        def rows(start: int, stop: int) -> np.ndarray:
            samples = np.zeros((stop - start, measurement.shape[1]), np.complex64)
            if leveled is not None:
                leveled.add(samples[:, None], range(start, stop), Clock(), _nothing)
            if direct is not None:
                direct.add(samples, range(start, stop), Clock(), _nothing)
            return samples

        if leveled is None or leveled.keeps_profiles:
            return rows
        samples = rows(0, measurement.shape[0])  # parts would repeat the work on cells
        return lambda start, stop: samples[start:stop]


def _planes(amplitudes: np.ndarray, order: np.ndarray) -> np.ndarray:
    return Points(np.empty((len(amplitudes), 3)), amplitudes).planes(order)


def _nothing(done: int) -> None:
    """Progress of an application, which nobody watches."""


def gain_rounding(task: FocusingTask, tolerance: float) -> float:
    """Error of an antenna's gains in float32; ToleranceUnreachable where it leaves too little of the tolerance."""
    error = antenna_beam.rounding(task, tiling_of(task.grid, 32).radius)
    if error > LARGEST_GAIN_SHARE * tolerance:
        best = error / LARGEST_GAIN_SHARE * (1 + 1e-9)
        raise ToleranceUnreachable(tolerance, best, "float32 gains of the antenna", "aim it at the pixels")
    return error
