"""One task of range_doppler: its arguments checked, the track, the ground, the extent and the plan."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ...base import host_memory
from ...base.constants import SPEED_OF_LIGHT
from ...earth.elevation import ElevationModel
from ...model.phase_history import PhaseHistory
from ...numerics import windows
from ...opencl.choose_device import open_device
from ...opencl.device import Device
from ..focusing_task import weigh
from ._doppler import centroid_of_data, centroid_of_geometry, sine
from ._extent import Extent, View, choose_extent
from ._ground import Ground
from ._host_rows import Budget
from ._map_drift import TwoLooks, converged
from ._options import RangeDopplerOptions
from ._plan import FocusPlan, make_plan
from ._track import REMEDY, Track
from ._uneven_energy import UnevenEnergy, uneven_energy
from ._velocity import Hyperbolas, effective_speed, factor_of_rate, hyperbolas, phase_error, rate_of

TRIED, TRIED_ON_TERRAIN = (3, 9), (9, 65)  # times and ranges at which hyperbolas are compared: mountains are narrow
TRIED_BANDS = 6  # each with wider ends
EDGES = 0.25  # share of the tolerance for the ends of the Doppler band


@dataclass(frozen=True, eq=False)
class RangeDopplerTask:
    """One image to be focused, with its plan.

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
        """Level that a point in the middle of the image has, dB, if no echo comes from beyond the beam; 0 or less.

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


def range_doppler_task(raw: PhaseHistory, options: RangeDopplerOptions) -> RangeDopplerTask:
    """The task of these echoes and options of `range_doppler`, which says what is refused."""
    tolerance, heights = options.tolerance, options.heights
    _check_echoes(raw, options)
    track = Track.of(raw, 0.02 * tolerance)
    ground = Ground.of(track, heights, track.side(raw, options.side))
    smooth = ground.smooth().positions
    least = ground.least_range()
    speed = effective_speed(raw, track, smooth, max(least, float(raw.reference_range[raw.n_rows // 2])))
    wavelength = SPEED_OF_LIGHT / float(raw.frequency[0] + raw.n_samples // 2 * raw.frequency_step[0])
    centroids = _centroids(raw, track, speed, wavelength, options)
    opened = open_device(options.device)
    budget = Budget(
        options.budget(opened),
        host_memory.installed() / 2 if options.max_bytes is None else float(options.max_bytes),
    )
    view = View(raw, track, smooth, speed, centroids[1], least)
    extent = choose_extent(view, options, EDGES * tolerance)
    window = options.window if extent.band.window is None else (windows.both(options.window)[0], None)
    weights = weigh(raw, window, options.weights)
    rows, (near, far) = extent.rows_of(extent.middle_time), extent.ranges[[0, -1]]
    of_geometry = hyperbolas(raw, track, smooth, extent.middle_time, near, far, rows)
    n_times, n_ranges = TRIED_ON_TERRAIN if isinstance(heights, ElevationModel) else TRIED
    tried = np.linspace(extent.times[0], extent.times[-1], n_times)
    model_error, worst = phase_error(raw, track, ground.positions, of_geometry, tried, extent.rows_of, n_ranges)
    fit = of_geometry
    if options.doppler_rate == "data":
        looks = TwoLooks(opened, raw, track, extent, of_geometry, weights, budget, wavelength)
        fit = of_geometry.scaled(converged(looks.focused))
    elif isinstance(options.doppler_rate, float):
        middle, along = float(extent.ranges.mean()), centroids[1] * speed
        fit = of_geometry.scaled(factor_of_rate(options.doppler_rate, of_geometry, middle, along, wavelength))
    energy = uneven_energy(raw, track, extent, fit, weights, wavelength)
    extent = _with_wide_ends(extent, energy, EDGES * tolerance)
    plan = make_plan(raw, track, extent, fit, model_error, tolerance, energy.near, energy.whole)
    return RangeDopplerTask(
        tolerance=tolerance,
        track=track,
        ground=ground,
        extent=extent,
        plan=plan,
        sample_weight=weights[0],
        row_weight=weights[1],
        device=opened,
        budget=budget,
        speed=speed,
        centroids=centroids,
        known=of_geometry,
        wavelength=wavelength,
        worst=worst,
    )


def _check_echoes(raw: PhaseHistory, options: RangeDopplerOptions) -> None:
    """ValueError for echoes without one band of frequencies, or a window that is none."""
    if not raw.compressed:
        raise ValueError("raw is not compressed: its pulses still have their own spectrum; call sarcl.compress(raw)")
    for name in ("frequency", "frequency_step"):
        if np.ptp(getattr(raw, name)):
            raise ValueError(f"raw.{name} differs between rows, and the FFT along the track needs one; {REMEDY}")
    if raw.n_samples < 2:
        raise ValueError("raw has one sample per row: without bandwidth there is no range; give at least 2 samples")
    windows.check(options.window)


def _centroids(
    raw: PhaseHistory, track: Track, speed: float, wavelength: float, options: RangeDopplerOptions
) -> tuple[float, float]:
    """Sines of the squint angles of the Doppler centroid: of the geometry, and of the one that is used."""
    expected = centroid_of_geometry(raw, track.step, speed)
    sine_of_hertz = wavelength / (2 * speed)
    if options.doppler == "data":
        about = expected if options.near is None else options.near * sine_of_hertz
        return expected, centroid_of_data(raw, track.step, speed, about, options.near is None)
    if options.near is not None:
        raise ValueError("near is for doppler='data', where the centroid is known but for multiples of the pulse rate")
    return expected, options.doppler * sine_of_hertz if isinstance(options.doppler, float) else expected


def _with_wide_ends(extent: Extent, energy: UnevenEnergy, allowed: float) -> Extent:
    """The extent with a Doppler band whose ends have an error of at most `allowed` in these data.

    Not with a beam: there the tapers are weights of rows, which the data must not change.
    """
    if extent.has_beam:
        return extent
    error_of_ends = allowed
    for _ in range(TRIED_BANDS):
        band = extent.band_for(error_of_ends)
        error = max(band.error, energy.error(band, extent.zone, extent.pixel_band))
        if error <= 1.001 * allowed:
            break
        error_of_ends *= 0.8 * allowed / error
    return replace(extent, band=replace(band, error=error))
