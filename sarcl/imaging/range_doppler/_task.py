"""One task of range_doppler: its arguments checked, the track, the ground, the extent and the plan."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ...base import host_memory
from ...base.constants import SPEED_OF_LIGHT
from ...base.validation import array, instance, number
from ...base.validation import tolerance as allowed_error
from ...earth.elevation import ElevationModel
from ...model.phase_history import PhaseHistory
from ...numerics import windows
from ...opencl import memory_budget
from ...opencl.choose_device import open_device
from ...opencl.device import Device
from ..focusing_task import weigh
from ._doppler import centroid_of_data, centroid_of_geometry, sine
from ._extent import Extent, choose_extent
from ._focus import Budget
from ._ground import Ground
from ._looks import TwoLooks
from ._map_drift import converged
from ._plan import FocusPlan, make_plan
from ._track import REMEDY, Track
from ._uneven_energy import UnevenEnergy, uneven_energy
from ._velocity import Hyperbolas, effective_speed, factor_of_rate, hyperbolas, phase_error, rate_of

TRIED, TRIED_ON_TERRAIN = (3, 9), (9, 65)  # times and ranges at which hyperbolas are compared: mountains are narrow
TRIED_BANDS = 6  # each with wider ends
EDGES = 0.25  # share of the tolerance for the ends of the Doppler band


@dataclass(frozen=True, eq=False)
class RangeDopplerTask:
    """What is to be focused, and how.

    sample_weight, row_weight   of samples (n_samples,) and rows (n_rows,);  budget  bytes
    speed      effective velocity, m/s, to which the centroids refer;  wavelength  of sample n_samples//2, m
    centroids  sines of the squint angles of the Doppler centroid: of the geometry, and used
    known      hyperbolas of the geometry, those of the plan unless the Doppler rate is another
    worst      largest phase error of the hyperbolas, rad
    """

    tolerance: float
    track: Track
    ground: Ground
    extent: Extent
    plan: FocusPlan
    sample_weight: np.ndarray
    row_weight: np.ndarray
    device: Device
    budget: Budget
    speed: float
    centroids: tuple[float, float]
    known: Hyperbolas
    wavelength: float
    worst: float

    @property
    def beyond_beam(self) -> float:
        """What a point in the middle of the image lacks, dB, if no echo of it comes from beyond the beam; 0 or less.

        The tapers of a beam without a window lie beyond it, and rows there count in the gain.
        """
        plan, r = self.plan, float(self.plan.ranges.mean())
        speed, _, shift = (float(v[0]) for v in plan.fit.at(np.array([r])))
        sines = sine(np.array(self.extent.middle_time + shift), np.array(r), self.track.times, speed)
        weights = plan.band.weight(sines) * self.row_weight
        within = weights[(sines >= plan.band.low) & (sines <= plan.band.high)].sum()
        return float(20 * np.log10(within / weights.sum())) if within else 0.0

    def describe(self) -> dict[str, Any]:
        """The plan, Doppler, velocity and the errors by cause, for a report."""
        plan, extent, (expected, centroid) = self.plan, self.extent, self.centroids
        middle = float(plan.ranges.mean())
        hertz = 2 * self.speed / self.wavelength
        used, geometry = (
            rate_of(fit, middle, centroid * self.speed, self.wavelength) for fit in (plan.fit, self.known)
        )
        out = {**plan.describe(), "Doppler centroid": f"{hertz * centroid:.6g} Hz"}
        if centroid != expected:
            out["Doppler centroid of the geometry"] = f"{hertz * expected:.6g} Hz"
        out["Doppler rate"] = f"{used:.6g} Hz/s"
        if plan.fit is not self.known:
            out["Doppler rate of the geometry"] = f"{geometry:.6g} Hz/s"
        if extent.has_beam and plan.band.window is None:
            out["gain from beyond the beam"] = f"{-self.beyond_beam:.2f} dB"
        return {
            **out,
            "Doppler band": f"{hertz * (plan.band.high - plan.band.low):.5g} Hz of the image, "
            f"{hertz * extent.pixel_band:.5g} Hz of a pixel, PRF {1 / self.track.step:.5g} Hz",
            "effective velocity": f"{float(plan.fit.at(np.array([middle]))[0][0]):.7g} m/s",
            "largest phase error of the hyperbolas": f"{self.worst:.1e} rad",
            **{f"error, {cause}": f"{value:.1e}" for cause, value in plan.errors.items()},
        }


def make_task(
    raw: PhaseHistory, heights: Any, side: Any, tolerance: Any, window: Any, weights: Any, times: Any, ranges: Any,
    spacing: Any, beam: Any, doppler: Any, near: Any, doppler_rate: Any, max_bytes: Any, device: Any,
) -> RangeDopplerTask:  # fmt: skip
    """The task of these arguments of `range_doppler`, which says what each is and what is refused."""
    instance("raw", raw, PhaseHistory)
    tolerance = allowed_error(tolerance)
    if not raw.compressed:
        raise ValueError("raw is not compressed: its pulses still have their own spectrum; call sarcl.compress(raw)")
    for name in ("frequency", "frequency_step"):
        if np.ptp(getattr(raw, name)):
            raise ValueError(f"raw.{name} differs between rows, and the FFT along the track needs one; {REMEDY}")
    if raw.n_samples < 2:
        raise ValueError("raw has one sample per row: without bandwidth there is no range; give at least 2 samples")
    windows.check(window)
    track = Track.of(raw, 0.02 * tolerance)
    ground = Ground.of(track, heights, track.side(raw, side))
    smooth = ground.smooth().positions
    least = ground.least_range()
    speed = effective_speed(raw, track, smooth, max(least, float(raw.reference_range[raw.n_rows // 2])))
    wavelength = SPEED_OF_LIGHT / float(raw.frequency[0] + raw.n_samples // 2 * raw.frequency_step[0])
    expected = centroid = centroid_of_geometry(raw, track.step, speed)
    about = None if near is None else _number("near", near, "Hz") * wavelength / (2 * speed)
    if isinstance(doppler, str) and doppler == "data":
        centroid = centroid_of_data(raw, track.step, speed, expected if about is None else about, near is None)
    elif near is not None:
        raise ValueError("near is for doppler='data', where the centroid is known but for multiples of the pulse rate")
    elif not (isinstance(doppler, str) and doppler == "geometry"):
        centroid = _number("doppler", doppler, "Hz") * wavelength / (2 * speed)
    opened = open_device(device)
    budget = Budget(
        min(memory_budget.budget(opened, max_bytes), opened.info.memory),
        host_memory.installed() / 2 if max_bytes is None else float(max_bytes),
    )

    extent = choose_extent(
        raw, track, smooth, speed, centroid, None if beam is None else _beam(beam),
        _times(times, track.epoch), _pair("ranges", ranges), spacing, least,
        EDGES * tolerance, None if beam is None else windows.both(window)[1],
    )  # fmt: skip
    over_rows = window if extent.band.window is None else (windows.both(window)[0], None)
    sample_weight, row_weight = weigh(raw, over_rows, weights)
    fit = hyperbolas(
        raw, track, smooth, extent.middle_time, extent.ranges[0], extent.ranges[-1],
        extent.rows_of(extent.middle_time),
    )  # fmt: skip
    n_times, n_ranges = TRIED_ON_TERRAIN if isinstance(heights, ElevationModel) else TRIED
    some = np.linspace(extent.times[0], extent.times[-1], n_times)
    model_error, worst = phase_error(raw, track, ground.positions, fit, some, extent.rows_of, n_ranges)
    known = fit
    if isinstance(doppler_rate, str) and doppler_rate == "data":
        looks = TwoLooks(opened, raw, track, extent, fit, (sample_weight, row_weight), budget, wavelength)
        fit = fit.scaled(converged(looks.focused))
    elif not (isinstance(doppler_rate, str) and doppler_rate == "geometry"):
        wanted, middle = _number("doppler_rate", doppler_rate, "Hz/s"), float(extent.ranges.mean())
        fit = fit.scaled(factor_of_rate(wanted, fit, middle, centroid * speed, wavelength))
    energy = uneven_energy(raw, track, extent, fit, sample_weight, row_weight, wavelength)
    extent = _with_wide_ends(extent, energy, EDGES * tolerance)
    plan = make_plan(raw, track, extent, fit, model_error, tolerance, energy.near, energy.whole)
    return RangeDopplerTask(
        tolerance, track, ground, extent, plan, sample_weight, row_weight, opened, budget, speed, (expected, centroid),
        known, wavelength, worst,
    )  # fmt: skip


def _with_wide_ends(extent: Extent, energy: UnevenEnergy, allowed: float) -> Extent:
    """The extent with a Doppler band whose ends have an error of at most `allowed` in these data.

    Not with a beam: there the tapers are weights of rows, which the data must not change.
    """
    if extent.has_beam:
        return extent
    asked = allowed
    for _ in range(TRIED_BANDS):
        band = extent.band_for(asked)
        error = max(band.error, energy.error(band, extent.zone, extent.pixel_band))
        if error <= 1.001 * allowed:
            break
        asked *= 0.8 * allowed / error
    return replace(extent, band=replace(band, error=error))


def _beam(value: Any) -> float:
    beam = number("beam", value, above=0)
    if beam >= np.pi:
        raise ValueError(f"beam is {beam:g} rad, which looks backwards too; give less than pi: was it in degrees?")
    return beam


def _number(name: str, value: Any, unit: str) -> float:
    if isinstance(value, str):
        raise ValueError(f"{name} is {value!r}; choose 'geometry', 'data' or a number in {unit}")
    return number(name, value)


def _times(value: Sequence[float] | None, epoch: float) -> tuple[float, float] | None:
    """Zero-Doppler times that were asked for, s from the first row."""
    made = _pair("times", value)
    return made and (made[0] - epoch, made[1] - epoch)


def _pair(name: str, value: Sequence[float] | None) -> tuple[float, float] | None:
    if value is None:
        return None
    made = array(name, value, np.float64, (2,))
    if not made[0] < made[1]:
        raise ValueError(f"{name} is ({made[0]:g}, {made[1]:g}); the first must be less than the last")
    return float(made[0]), float(made[1])
