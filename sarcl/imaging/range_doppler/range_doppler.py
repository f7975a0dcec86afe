"""range_doppler: echoes of a near-straight track to an image by zero-Doppler time and slant range."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from ...base.constants import SPEED_OF_LIGHT
from ...base.errors import ToleranceMissed
from ...base.report import Report
from ...base.stage_timer import Clock
from ...base.validation import array, instance, number
from ...base.validation import tolerance as allowed_error
from ...earth.elevation import ElevationModel
from ...model.image import Image
from ...model.image_grid import ImageGrid
from ...model.phase_history import PhaseHistory
from ...numerics.windows import Window
from ...opencl import memory_budget
from ...opencl.choose_device import open_device
from ...opencl.device import DeviceChoice
from ..focusing_task import weigh
from ._doppler import centroid_of_data, centroid_of_geometry, fresnel, sine
from ._extent import Extent, choose_extent
from ._focus import focus
from ._ground import Ground
from ._plan import FocusPlan, make_plan
from ._track import REMEDY, Track
from ._velocity import effective_speed, hyperbolas, phase_error

EDGES = 0.25  # share of the tolerance for the ends of the Doppler band
Progress = Callable[[str, int, int], None]


def range_doppler(
    raw: PhaseHistory,
    *,
    heights: float | ElevationModel = 0.0,
    side: Literal["left", "right"] | None = None,
    tolerance: float = 1e-2,
    window: Window | None = None,
    weights: ArrayLike | None = None,
    times: Sequence[float] | None = None,
    ranges: Sequence[float] | None = None,
    spacing: tuple[float | None, float | None] | None = None,
    beam: float | None = None,
    doppler: Literal["geometry", "data"] | float = "geometry",
    max_bytes: float | None = None,
    device: DeviceChoice | None = None,
    check: bool | None = None,
    progress: Progress | None = None,
) -> Image:
    """Focus echoes of a near-straight, evenly sampled track on a grid of zero-Doppler times and slant ranges.

    raw        PhaseHistory, compressed, with times, of one channel; the same frequencies in all rows
    heights    z of the pixels, m; in Earth-fixed coordinates heights above the ellipsoid, m, or a sarcl.ElevationModel.
               Positions depend on them, the pixels of a straight track do not
    side       "left" or "right" of the track, seen from above; None: where the origin is, if the echoes contain it
    tolerance  L2 error allowed against `backproject` at the same positions, relative to the larger of the norm of the
               image and the norm of the same contributions with random phases
    window, weights, max_bytes   as `backproject` takes them
    times      (first, last) zero-Doppler time, s; None: those of the rows, less where a pixel's Doppler band and the
               image's exceed the pulse rate
    ranges     (near, far) slant range, m; None: the ranges that the range window holds in every row
    spacing    (s, m) between rows and columns, or None for either: the spectrum of a pixel then fills 0.8 of the
               sampling rate at most. Rows are a whole fraction of the pulse interval apart, no farther than asked
    beam       None: all rows contribute to every pixel. Else the azimuth beam, full angle in rad about the Doppler
               centroid: rows that see a pixel outside it do not contribute. Its ends are tapered
    doppler    centroid of the beam, and of the default times: "geometry", from reference ranges that change (else
               broadside); "data", from the phases of neighbouring rows; or in Hz, at the centre frequency
    check      compute 128 random pixels exactly; None: where that costs less than 2 %
    device     see `sarcl.devices`
    progress   called as progress(stage, done, total), in thousandths

    Returns an Image whose grid lists positions, and knows `times` and `ranges`. Gain, carrier and phase are those of
    `backproject` on image.grid. The report names the errors by cause. ValueError: bad input, a pulse rate below the
    Doppler bandwidth, ranges that the range window does not hold in all rows. ToleranceUnreachable: a track that is
    not straight enough for the tolerance. ToleranceMissed: the check measured an error above the tolerance.
    Source: Cumming and Wong, "Digital Processing of Synthetic Aperture Radar Data", 2005, chapter 6;
    docs/theory/range_doppler.md.
    """
    clock = Clock()
    instance("raw", raw, PhaseHistory)
    tolerance = allowed_error(tolerance)
    if not raw.compressed:
        raise ValueError("raw is not compressed: its pulses still have their own spectrum; call sarcl.compress(raw)")
    for name in ("frequency", "frequency_step"):
        if np.ptp(getattr(raw, name)):
            raise ValueError(f"raw.{name} differs between rows, and the FFT along the track needs one; {REMEDY}")
    if raw.n_samples < 2:
        raise ValueError("raw has one sample per row: without bandwidth there is no range; give at least 2 samples")
    sample_weight, row_weight = weigh(raw, window, weights)
    track = Track.of(raw, 0.02 * tolerance)
    ground = Ground.of(track, heights, track.side(raw, side))
    smooth = ground.smooth().positions
    least = ground.least_range()
    speed = effective_speed(raw, track, smooth, max(least, float(raw.reference_range[raw.n_rows // 2])))
    wavelength = SPEED_OF_LIGHT / float(raw.frequency[0] + raw.n_samples // 2 * raw.frequency_step[0])
    if doppler in ("geometry", "data"):
        centroid = centroid_of_geometry(raw, track.step, speed)
        if doppler == "data":
            centroid = centroid_of_data(raw, track.step, speed, centroid)
    else:
        if isinstance(doppler, str):
            raise ValueError(f"doppler is {doppler!r}; choose 'geometry', 'data' or a frequency in Hz")
        centroid = number("doppler", doppler) * wavelength / (2 * speed)
    opened = open_device(device)
    budget = min(memory_budget.budget(opened, max_bytes), opened.info.memory)

    extent = choose_extent(
        raw, track, smooth, speed, centroid, None if beam is None else number("beam", beam, above=0),
        _pair("times", times), _pair("ranges", ranges), spacing, least,
        EDGES * tolerance,
    )  # fmt: skip
    fit = hyperbolas(
        raw, track, smooth, extent.middle_time, extent.ranges[0], extent.ranges[-1],
        extent.rows_of(extent.middle_time),
    )  # fmt: skip
    ends = np.linspace(extent.times[0], extent.times[-1], 3)
    model_error, worst = phase_error(raw, track, ground.positions, fit, ends, extent.rows_of)
    plan = make_plan(raw, track, extent, fit, model_error, tolerance)
    grid = ImageGrid.zero_doppler(extent.times, extent.ranges, ground.positions(extent.times, extent.ranges))
    clock.lap("plan")

    def on_progress(share: float) -> None:
        if progress:
            progress("range Doppler", round(1000 * share), 1000)

    data = focus(opened, plan, raw, track, (sample_weight, row_weight), budget, clock, on_progress)
    measured = None
    exact_seconds = 128 * raw.n_rows * raw.n_samples * 3e-8
    if check or (check is None and exact_seconds < 0.02 * sum(clock.seconds.values())):
        measured = _measure_error(raw, track, plan, grid, data, (sample_weight, row_weight), wavelength)
        clock.lap("check")
    middle = raw.n_rows // 2
    seen = _row_weights(
        track, plan, np.array([extent.middle_time]), plan.ranges[[len(plan.ranges) // 2]], wavelength
    ).real
    image = Image(
        data,
        grid,
        gain=float(sample_weight.sum() * (seen[0] * row_weight).sum()),
        frequency=SPEED_OF_LIGHT / wavelength,
        tx=raw.tx[middle],
        rx=raw.rx[middle],
        report=Report(
            plan=plan.describe() | _describe(extent, plan, track, centroid, wavelength, worst),
            tolerance=tolerance,
            predicted_error=plan.predicted_error,
            measured_error=measured,
            contributions_done=raw.n_rows * grid.size,
            seconds=clock.seconds,
            device=opened.info.name,
        ),
    )
    if measured is not None and measured > tolerance:
        raise ToleranceMissed(tolerance, measured, image)
    return image


def _pair(name: str, value: Sequence[float] | None) -> tuple[float, float] | None:
    if value is None:
        return None
    made = array(name, value, np.float64, (2,))
    if not made[0] < made[1]:
        raise ValueError(f"{name} is ({made[0]:g}, {made[1]:g}); the first must be less than the last")
    return float(made[0]), float(made[1])


def _describe(
    extent: Extent, plan: FocusPlan, track: Track, centroid: float, wavelength: float, worst: float
) -> dict[str, str]:
    """Doppler, velocity and the errors by cause, for a report."""
    speed = float(plan.fit.at(np.array([plan.ranges.mean()]))[0][0])
    hertz = 2 * speed / wavelength
    rate = -hertz * speed / plan.ranges.mean() * (1 - centroid**2) ** 1.5
    return {
        "Doppler centroid": f"{hertz * centroid:.6g} Hz",
        "Doppler rate": f"{rate:.6g} Hz/s",
        "Doppler band": f"{hertz * (plan.band.high - plan.band.low):.5g} Hz of the image, "
        f"{hertz * extent.pixel_band:.5g} Hz of a pixel, PRF {1 / track.step:.5g} Hz",
        "effective velocity": f"{speed:.7g} m/s",
        "largest phase error of the hyperbolas": f"{worst:.1e} rad",
        **{f"error, {cause}": f"{value:.1e}" for cause, value in plan.errors.items()},
    }


def _row_weights(track: Track, plan: FocusPlan, u: np.ndarray, r: np.ndarray, wavelength: float) -> np.ndarray:
    """Weights of all rows, complex (n, n_rows), in pixels at zero-Doppler times, s (n,), and slant ranges, m (n,)."""
    speed, _, shift = plan.fit.at(r)
    sines = sine((u + shift)[:, None], r[:, None], track.times, speed[:, None])
    return plan.band.row_weight(sines, fresnel(wavelength, r)[:, None])


def _measure_error(
    raw: PhaseHistory, track: Track, plan: FocusPlan, grid: ImageGrid, data: np.ndarray,
    weights: tuple[np.ndarray, np.ndarray], wavelength: float,
) -> float:  # fmt: skip
    """Relative error at up to 128 random pixels against the exact float64 sum over the rows in the beam."""
    from ...reference.backproject import backproject as exact

    index, points = grid.sample(128, seed=0)
    share = _row_weights(track, plan, plan.times[index[0]], plan.ranges[index[1]], wavelength)
    wanted, random = exact(raw, points, *weights, wrap=True, share=share)
    wrong = float(np.linalg.norm(data[index] - wanted))
    return wrong / max(float(np.linalg.norm(wanted)), random) if wrong else 0.0
