"""Two looks of a range-Doppler image along the track, for the Doppler rate from data (_map_drift.py).

With a beam the looks are halves of its Doppler band. Without one all rows see all pixels, and the looks are the halves
of the rows.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ...base.stage_timer import Clock
from ...model.phase_history import PhaseHistory
from ...opencl.device import Device
from ._doppler import sine
from ._extent import Extent
from ._focus import focus
from ._host_rows import Budget, Job
from ._map_drift import Looks
from ._plan import FocusPlan, make_plan
from ._track import Track
from ._velocity import Hyperbolas

TOLERANCE = 0.1  # tolerance of the looks: the displacement of intensities does not need more
MOST_PIXELS = 2048, 512  # rows and columns of the looks, from the middle of the image


@dataclass(frozen=True, eq=False)
class TwoLooks:
    """The looks of echoes in the extent of an image, for hyperbolas whose Doppler rates are scaled.

    weights  of samples (n_samples,) and rows (n_rows,);  wavelength  m
    """

    device: Device
    raw: PhaseHistory
    track: Track
    extent: Extent
    fit: Hyperbolas
    weights: tuple[np.ndarray, np.ndarray]
    budget: Budget
    wavelength: float

    def focused(self, factor: float) -> Looks:
        """Both looks where the squares of effective velocities are `factor` times those of the geometry."""
        fit = self.fit.scaled(factor)
        kept = [
            _middle(axis, most) for axis, most in zip((self.extent.times, self.extent.ranges), MOST_PIXELS, strict=True)
        ]
        band = replace(self.extent.band, window=None)  # with a window the middles of the looks would lie elsewhere
        extent = replace(self.extent, times=kept[0], ranges=kept[1], band=band)
        plan = make_plan(self.raw, self.track, extent, fit, 0.0, TOLERANCE)
        speeds = fit.at(extent.ranges)[0]
        speed = float(speeds.mean())
        if self.extent.has_beam:
            low, high = plan.band.low, plan.band.high
            half = (low + high) / 2
            plans = [replace(plan, band=replace(plan.band, low=a, high=b)) for a, b in ((low, half), (half, high))]
            rows = [self.weights[1]] * 2
            middles = (low + half) / 2, (half + high) / 2
        else:
            plans = [plan, plan]
            later = np.arange(self.raw.n_rows) >= self.raw.n_rows // 2
            rows = [self.weights[1] * part for part in (later, ~later)]  # Doppler frequencies fall along the rows
            when = [float((row * self.track.times).sum() / row.sum()) for row in rows]
            distance = np.array(extent.ranges.mean())
            first, second = (float(sine(np.array(extent.middle_time), distance, np.array(t), speed)) for t in when)
            middles = first, second
        intensities = [self._intensity(one, row) for one, row in zip(plans, rows, strict=True)]
        step = float(extent.times[1] - extent.times[0])
        doppler = 2 * speed / self.wavelength * middles[0], 2 * speed / self.wavelength * middles[1]
        return Looks(intensities[0], intensities[1], extent.ranges, speeds, step, doppler, self.wavelength)

    def _intensity(self, plan: FocusPlan, rows: np.ndarray) -> np.ndarray:
        """Intensities of one look, float64 (times, ranges) of mean 1."""
        job = Job(self.device, plan, self.raw, self.track, (self.weights[0], rows), self.budget)
        data = focus(job, Clock(), lambda _: None)
        power = np.abs(data).astype(np.float64) ** 2
        return np.asarray(power / np.maximum(power.mean(), 1e-300))


def _middle(axis: np.ndarray, most: int) -> np.ndarray:
    """At most so many neighbours from the middle of an axis."""
    start = max(0, (len(axis) - most) // 2)
    return axis[start : start + most]
