"""range_doppler: echoes of a near-straight track to an image by zero-Doppler time and slant range."""

from __future__ import annotations

import logging
from dataclasses import dataclass

import numpy as np

from ...base.constants import SPEED_OF_LIGHT
from ...base.forecast import Forecast, Plan
from ...base.report import Report, terms_of_sum
from ...base.stage_timer import Clock
from ...base.validation import instance
from ...base.verb import verb
from ...model.image import Image
from ...model.image_grid import ImageGrid
from ...model.phase_history import PhaseHistory
from ..focus_options import check_output, collection, finished, relative_error
from ..forecast import speed
from ._doppler import fresnel, sine
from ._focus import focus
from ._host_rows import Job
from ._options import RangeDopplerOptions
from ._plan import FocusPlan
from ._task import RangeDopplerTask, range_doppler_task
from ._track import Track

log = logging.getLogger(__name__)

TOLD = 0.05  # dB, of the level of a point, from which on it is said that the beam's tapers lie beyond it
BEYOND = (
    "the beam has no window along the track, and ends in tapers beyond its angle, whose rows count in the gain: a "
    "point that the antenna does not see there reads up to %.2f dB low; window=(None, 'boxcar') keeps within the beam"
)

CHECKED = 128  # pixels that a check computes exactly
COLUMNS = 65  # slant ranges at which gains are summed; they are linear between: apertures grow as the slant range does


@verb(RangeDopplerOptions)
def range_doppler(raw: PhaseHistory, options: RangeDopplerOptions) -> Plan[Image]:
    """Focus echoes of a near-straight, evenly sampled track on a grid of zero-Doppler times and slant ranges.

    raw        PhaseHistory, compressed, with times, of one channel; the same frequencies in all rows
    {options}

    Returns an Image whose grid lists positions, and knows `times` and `ranges`. Gain, carrier and phase are those of
    `backproject` on image.grid; with a beam the gain has a value per pixel where the pixels are seen by more rows or
    fewer, and pixels with less than `tolerance` of the largest are zero. The report names the errors by cause, and the
    centroid and rate of the geometry where others are used. ValueError: bad input, a pulse rate below the Doppler
    bandwidth, ranges that the range window does not hold in all rows, echoes that do not tell a rate.
    ToleranceUnreachable: a track that is not straight enough for the tolerance. ToleranceMissed: the check measured an
    error above the tolerance.
    Source: Cumming and Wong, "Digital Processing of Synthetic Aperture Radar Data", 2005, chapter 6;
    docs/theory/range_doppler.md.

    >>> flight = sarcl.Trajectory.line(start=(-5e3, -100, 4e3), velocity=(0, 100, 0), prf=400, n_pulses=800)
    >>> image = sarcl.range_doppler(sarcl.echo(scene, chirp, flight))
    >>> image.shape == (image.grid.times.size, image.grid.ranges.size)
    True
    """
    instance("raw", raw, PhaseHistory)
    check_output(options.out)
    clock = Clock()
    task = range_doppler_task(raw, options)
    clock.lap("plan")
    return RangeDopplerPlan(options, raw, task, clock.seconds)


@dataclass(frozen=True, eq=False)
class RangeDopplerPlan:
    """One image to be made by zero-Doppler time and slant range: a Plan; seconds  of planning, by stage."""

    options: RangeDopplerOptions
    raw: PhaseHistory
    task: RangeDopplerTask
    seconds: dict[str, float]

    def forecast(self) -> Forecast[Image]:
        """Its Forecast. Planning reads some rows; all of them only for a centroid or rate from the data."""
        task, raw, plan = self.task, self.raw, self.task.plan
        pixels = len(plan.times) * len(plan.ranges)
        numbers = plan.held(raw.n_rows, raw.n_samples) + pixels
        planning = sum(self.seconds.values())
        return Forecast(
            method="range-Doppler",
            plan={"pixels": f"{len(plan.times)} x {len(plan.ranges)}", **task.describe()},
            seconds=planning + float(plan.cost(raw.n_rows, raw.n_samples) / speed(task.device)),
            bytes=8.0 * numbers + 24.0 * pixels,  # complex64, and positions
            predicted_error=plan.predicted_error,
            error_terms=terms_of_sum(plan.errors),
            planning=planning,
            run=self.run,
        )

    def run(self) -> Image:
        """The image."""
        raw, task, plan, clock = self.raw, self.task, self.task.plan, Clock(self.seconds)
        weight = task.sample_weight, task.row_weight
        positions = task.ground.positions(plan.times, plan.ranges)
        grid = ImageGrid.zero_doppler(task.track.epoch + plan.times, plan.ranges, positions)
        if task.extent.has_beam and plan.band.window is None and task.beyond_beam < -TOLD:
            log.warning(BEYOND, -task.beyond_beam)
        clock.lap("plan")
        job = Job(task.device, plan, raw, task.track, weight, task.budget)
        data = focus(job, clock, self.options.shares_of("range Doppler"))
        gain: float | np.ndarray = float(task.sample_weight.sum() * task.row_weight.sum())
        if task.extent.has_beam:
            gain = gain_of(plan, task.track, *weight, task.tolerance)
            if isinstance(gain, np.ndarray):
                data[gain == 0] = 0
        pairs, seconds = CHECKED * raw.n_rows * raw.n_samples, sum(clock.seconds.values())
        measured = self.options.measured(pairs, seconds, clock, lambda: _measure_error(raw, task, grid, data))
        image = Image(
            data,
            grid,
            gain=gain,
            frequency=SPEED_OF_LIGHT / task.wavelength,
            **collection(raw, grid, self.options.window),
            report=Report(
                plan=task.describe(),
                tolerance=task.tolerance,
                predicted_error=plan.predicted_error,
                error_terms=terms_of_sum(plan.errors),
                measured_error=measured,
                contributions_done=raw.n_rows * grid.size,
                seconds=clock.seconds,
                device=task.device.info.name,
            ),
        )
        return finished(image, self.options.out, "use backproject")


def row_weights(track: Track, plan: FocusPlan, u: np.ndarray, r: np.ndarray, wavelength: float) -> np.ndarray:
    """Weights of all rows, complex (n, n_rows), in pixels at zero-Doppler times, s (n,), and slant ranges, m (n,)."""
    speed, _, shift = plan.fit.at(r)
    sines = sine((u + shift)[:, None], r[:, None], track.times, speed[:, None])
    return plan.band.row_weight(sines, fresnel(wavelength, r)[:, None])


def _measure_error(raw: PhaseHistory, task: RangeDopplerTask, grid: ImageGrid, data: np.ndarray) -> float:
    """Relative error at up to CHECKED random pixels against the exact float64 sum over the rows in the beam.

    Ranges are those of the geometry, and longer by what the plan's hyperbolas have more than those of the geometry.
    """
    from ...reference.backproject import PerPoint
    from ...reference.backproject import backproject as exact

    index, points = grid.sample(CHECKED, seed=0)
    plan, track = task.plan, task.track
    u, r = plan.times[index[0]], plan.ranges[index[1]]
    terms = PerPoint(row_weights(track, plan, u, r, task.wavelength))
    if plan.fit is not task.known:
        t = track.times[:, None]
        terms = terms._replace(longer=(plan.fit.range(u, r, t) - task.known.range(u, r, t)).T)
    truth, random = exact(raw, points, task.sample_weight, task.row_weight, wrap=True, per_point=terms)
    return relative_error(data, index, truth, random, task.tolerance)


def gain_of(
    plan: FocusPlan, track: Track, sample_weight: np.ndarray, row_weight: np.ndarray, faintest: float
) -> float | np.ndarray:
    """Sums of the weights of the rows that see a pixel: gain(u, r) = sum_n w_n sum_p w_p b(s_p(u, r)), b the weight of
    the Doppler band at the sine of row p. A number where it is the same in all pixels to 1e-6, else float32 (times,
    ranges).

    faintest  of the largest gain: pixels of less count as seen by no row
    """
    from scipy.signal import fftconvolve

    n_rows, (n_times, n_ranges) = len(row_weight), (len(plan.times), len(plan.ranges))
    chosen = np.unique(np.linspace(0, n_ranges - 1, COLUMNS).round().astype(int))
    step = track.step / plan.finer
    between = np.arange(-plan.finer * (n_rows - 1), n_times)
    rows = np.zeros(plan.finer * (n_rows - 1) + 1)
    rows[:: plan.finer] = row_weight * sample_weight.sum()
    sums = np.empty((n_times, len(chosen)))
    for k, column in enumerate(chosen):
        distance = plan.ranges[column]
        speed, _, shift = (float(v[0]) for v in plan.fit.at(np.array([distance])))
        later = float(plan.times[0]) + shift + step * between
        seen = plan.band.weight(sine(later, distance, np.array(0.0), speed))
        sums[:, k] = fftconvolve(seen, rows, mode="valid")
    largest = float(sums.max())
    if sums.min() >= (1 - 1e-6) * largest:
        return largest
    out = np.empty((n_times, n_ranges), np.float32)
    position = np.interp(np.arange(n_ranges), chosen, np.arange(len(chosen)))
    before = np.minimum(position.astype(int), max(len(chosen) - 2, 0))
    after, share = np.minimum(before + 1, len(chosen) - 1), position - before
    for first in range(0, n_times, 256):  # in blocks: a large image is not held in float64
        block = sums[first : first + 256]
        out[first : first + 256] = block[:, before] * (1 - share) + block[:, after] * share
    out[out < faintest * largest] = 0
    return out
