"""range_doppler: echoes of a near-straight track to an image by zero-Doppler time and slant range."""

from __future__ import annotations

import logging
from collections.abc import Callable, Sequence
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from ...base import arguments
from ...base.constants import SPEED_OF_LIGHT
from ...base.errors import confirm_tolerance
from ...base.report import Report
from ...base.stage_timer import Clock
from ...base.validation import flag
from ...earth.elevation import ElevationModel
from ...model.image import Image
from ...model.image_grid import ImageGrid
from ...model.phase_history import PhaseHistory
from ...numerics.windows import Window
from ...opencl.device import DeviceChoice
from ..collection import collection
from ..forecast import Forecast, speed
from ._doppler import fresnel, sine
from ._focus import focus
from ._gain import gain_of
from ._plan import FocusPlan
from ._task import RangeDopplerTask, make_task
from ._track import Track

log = logging.getLogger(__name__)

TOLD = 0.05  # dB, of the level of a point, from which on it is said that the beam's tapers lie beyond it
BEYOND = (
    "the beam has no window along the track, and ends in tapers beyond its angle, whose rows count in the gain: a "
    "point that the antenna does not see there reads up to %.2f dB low; window=(None, 'boxcar') keeps within the beam"
)

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
    near: float | None = None,
    doppler_rate: Literal["geometry", "data"] | float = "geometry",
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
    window, weights   as `backproject` takes them. With a beam the window along the track is over the rows that see a
               pixel in the beam, as a weight of Doppler frequencies: a pixel at the end of the track has a part of it
    max_bytes  for blocks on the device, as `backproject` takes it; arrays of all pulses or Doppler bins that are larger
               than a third of it, or of half the machine's memory, are temporary files
    times      (first, last) zero-Doppler time, s, on the clock of raw.time, which may be absolute (2e9 s); None: those
               of the rows, less where a pixel's Doppler band and the image's exceed the pulse rate
    ranges     (near, far) slant range, m; None: the ranges that the range window holds in every row
    spacing    (s, m) between rows and columns, or None for either: the spectrum of a pixel then fills 0.8 of the
               sampling rate at most. Rows are a whole fraction of the pulse interval apart, no farther than asked
    beam       None: all rows contribute to every pixel. Else the azimuth beam, full angle in rad about the Doppler
               centroid: rows that see a pixel outside it do not contribute. Its ends are tapered, beyond the angle
               without a window along the track (the log and the report say how much that is), else within it
    doppler    centroid of the beam, and of the default times: "geometry", from reference ranges that change (else
               broadside); "data", from the phases of neighbouring rows; or in Hz, at the centre frequency
    near       Hz: data determine the centroid but for multiples of the pulse rate; the one nearest to this is taken.
               None: the one nearest to that of the geometry, with a warning where the echoes tell another one
    doppler_rate  of the azimuth compression: "geometry", from the track; "data", from the displacement of two looks
               (map drift), which needs ground with contrast; or in Hz/s at the centre frequency, in the middle of the
               ranges and at the centroid. Effective velocities at all ranges are scaled alike. `tolerance` then refers
               to backprojection with ranges that have this rate
    check      compute 128 random pixels exactly; None: where that costs less than 2 %
    device     see `sarcl.devices`
    progress   called as progress(stage, done, total), in thousandths

    Returns an Image whose grid lists positions, and knows `times` and `ranges`. Gain, carrier and phase are those of
    `backproject` on image.grid; with a beam the gain has a value per pixel where the pixels are seen by more rows or
    fewer, and pixels with less than `tolerance` of the largest are zero. The report names the errors by cause, and the
    centroid and rate of the geometry where others are used. ValueError: bad input, a pulse rate below the Doppler
    bandwidth, ranges that the range window does not hold in all rows, echoes that do not tell a rate.
    ToleranceUnreachable: a track that is not straight enough for
    the tolerance. ToleranceMissed: the check measured an error above the tolerance.
    Source: Cumming and Wong, "Digital Processing of Synthetic Aperture Radar Data", 2005, chapter 6;
    docs/theory/range_doppler.md.
    """
    if check is not None:
        flag("check", check)
    arguments.progress(progress)
    clock = Clock()
    task = make_task(
        raw, heights, side, tolerance, window, weights, times, ranges, spacing, beam, doppler, near, doppler_rate,
        max_bytes, device,
    )  # fmt: skip
    plan, track, weight = task.plan, task.track, (task.sample_weight, task.row_weight)
    positions = task.ground.positions(plan.times, plan.ranges)
    grid = ImageGrid.zero_doppler(track.epoch + plan.times, plan.ranges, positions)
    if task.extent.has_beam and plan.band.window is None and task.beyond_beam < -TOLD:
        log.warning(BEYOND, -task.beyond_beam)
    clock.lap("plan")

    def on_progress(share: float) -> None:
        if progress:
            progress("range Doppler", round(1000 * share), 1000)

    data = focus(task.device, plan, raw, track, weight, task.budget, clock, on_progress)
    gain = float(task.sample_weight.sum() * task.row_weight.sum())
    if task.extent.has_beam:
        gain = gain_of(plan, track, *weight, task.tolerance)
        if isinstance(gain, np.ndarray):
            data[gain == 0] = 0
    measured = None
    exact_seconds = 128 * raw.n_rows * raw.n_samples * 3e-8
    if check or (check is None and exact_seconds < 0.02 * sum(clock.seconds.values())):
        measured = _measure_error(raw, task, grid, data)
        clock.lap("check")
    image = Image(
        data,
        grid,
        gain=gain,
        frequency=SPEED_OF_LIGHT / task.wavelength,
        **collection(raw, grid, window),
        report=Report(
            plan=task.describe(),
            tolerance=task.tolerance,
            predicted_error=plan.predicted_error,
            measured_error=measured,
            contributions_done=raw.n_rows * grid.size,
            seconds=clock.seconds,
            device=task.device.info.name,
        ),
    )
    confirm_tolerance(image=image, instead="use backproject")
    return image


def plan_range_doppler(
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
    near: float | None = None,
    doppler_rate: Literal["geometry", "data"] | float = "geometry",
    max_bytes: float | None = None,
    device: DeviceChoice | None = None,
    check: bool | None = None,
    progress: Progress | None = None,
) -> Forecast:
    """What `range_doppler` would do with these arguments: a Forecast. Raises as it does.

    Some rows are read, as for the plan itself; all of them only for a centroid or rate from the data.

    check, progress   are of `range_doppler` alone
    """
    task = make_task(
        raw, heights, side, tolerance, window, weights, times, ranges, spacing, beam, doppler, near, doppler_rate,
        max_bytes, device,
    )  # fmt: skip
    plan = task.plan
    pixels = len(plan.times) * len(plan.ranges)
    details: dict[str, object] = {"pixels": f"{len(plan.times)} x {len(plan.ranges)}", **task.describe()}
    held = plan.held(raw.n_rows, raw.n_samples) + pixels  # complex64
    seconds = plan.cost(raw.n_rows, raw.n_samples) / speed(task.device)
    return Forecast("range-Doppler", details, seconds, 8.0 * held + 24.0 * pixels, plan.predicted_error, None)


def _row_weights(track: Track, plan: FocusPlan, u: np.ndarray, r: np.ndarray, wavelength: float) -> np.ndarray:
    """Weights of all rows, complex (n, n_rows), in pixels at zero-Doppler times, s (n,), and slant ranges, m (n,)."""
    speed, _, shift = plan.fit.at(r)
    sines = sine((u + shift)[:, None], r[:, None], track.times, speed[:, None])
    return plan.band.row_weight(sines, fresnel(wavelength, r)[:, None])


def _measure_error(raw: PhaseHistory, task: RangeDopplerTask, grid: ImageGrid, data: np.ndarray) -> float:
    """Relative error at up to 128 random pixels against the exact float64 sum over the rows in the beam.

    Ranges are those of the geometry, and longer by what the plan's hyperbolas have more than those of the geometry.
    """
    from ...reference.backproject import backproject as exact

    index, points = grid.sample(128, seed=0)
    plan, track = task.plan, task.track
    u, r = plan.times[index[0]], plan.ranges[index[1]]
    share = _row_weights(track, plan, u, r, task.wavelength)
    longer = None
    if plan.fit is not task.known:
        t = track.times[:, None]
        longer = (plan.fit.range(u, r, t) - task.known.range(u, r, t)).T
    wanted, random = exact(raw, points, task.sample_weight, task.row_weight, wrap=True, share=share, longer=longer)
    wrong = float(np.linalg.norm(data[index] - wanted))
    return wrong / max(float(np.linalg.norm(wanted)), random) if wrong else 0.0
