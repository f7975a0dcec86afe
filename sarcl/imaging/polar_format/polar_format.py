"""polar_format: echoes to an image with plane wavefronts, by one two-dimensional FFT."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...base.errors import warn
from ...base.forecast import Forecast, Plan
from ...base.options import option
from ...base.report import ErrorTerm, Report, terms_of_sum
from ...base.stage_timer import Clock
from ...base.validation import instance
from ...base.verb import verb
from ...model.image import Image
from ...model.image_grid import ImageGrid
from ...model.phase_history import PhaseHistory
from ...numerics import cost_model
from ...numerics.nufft2d import Gridder, make_plan, tile_of
from ...numerics.range_profiles import check_digits
from ...opencl.choose_device import open_device
from ..focus_options import GridOptions, check_output, collection, finished, norm_of, relative_error
from ..focusing_task import FocusingTask, make_task
from ..forecast import speed
from ._samples import WeightedRows
from ._wavefront import Curvature, Waves, curvature, waves_about

DEFOCUS = np.pi / 2  # rad: blurring phase at the border of the grid above which a warning is given
CHECKED = 256  # pixels that a check computes exactly


@dataclass(frozen=True, eq=False, kw_only=True)
class PolarFormatOptions(GridOptions):
    """Options of `polar_format`."""

    tolerance: float = option(
        1e-2,
        "L2 error allowed against the sum of plane waves, relative to the larger of the norm of I and the norm of "
        "samples that add with random phases, sqrt(pixels sum |w s|^2)",
    )


@verb(PolarFormatOptions)
def polar_format(raw: PhaseHistory, grid: ImageGrid, options: PolarFormatOptions) -> Plan[Image]:
    """Focus echoes on a plane with plane wavefronts: I(x) = sum_p sum_n w_pn s_pn exp(+j 2 pi K_pn.(x - c)).

    raw        PhaseHistory, compressed, of at least 2 rows; any track, and any receiver: that of an orbit's echoes, at
               their arrival, or one elsewhere
    grid       ImageGrid.plane; c is its pixel (rows//2, columns//2). K = -(2 f/c) u, with u the unit vector from c to
               the antenna, or the mean of those to transmitter and receiver: less the gradient of half the path.
               Phases are relative to c, whatever reference_range is
    {options}

    The plan in the report gives the error of plane wavefronts against `backproject`, which the tolerance does not
    include: the largest neglected phase, the part of it that defocuses, the largest displacement of a pixel, and the
    radius in which images are sharp. sarcl.SarclWarning where images are not sharp up to the border of the grid, and
    where the border lies beyond the range window, so that echoes repeat. ValueError: uncompressed data, listed
    points, one row. ToleranceUnreachable: a tolerance that cannot be met. ToleranceMissed: the check measured an
    error above the tolerance. MemoryError: max_bytes too small.
    Source: Farooq 2009, equations 2.59 to 2.64; docs/theory/polar_format.md.

    >>> image = sarcl.polar_format(raw, grid, tolerance=1e-2)
    >>> round(float(abs(image.data).max() / image.gain), 2)
    1.0
    """
    instance("raw", raw, PhaseHistory)
    instance("grid", grid, ImageGrid)
    if not grid.is_plane:
        raise ValueError("grid lists its points; the FFT of polar_format needs an ImageGrid.plane: use backproject")
    check_output(options.out)
    clock = Clock()
    task = make_task(
        raw, grid, options.window, options.weights, wrap=True, skip=True, sum_polarizations=options.sum_polarizations
    )
    if task.raw.n_rows < 2:
        raise ValueError(f"raw has {task.raw.n_rows} row of weight > 0; a synthetic aperture needs at least 2")
    device = open_device(options.device)
    budget = options.budget(device)
    waves = waves_about(task.raw, grid.at(grid.shape[0] // 2, grid.shape[1] // 2))
    bent = curvature(task.raw, waves, grid)
    _warn(task, waves, bent)
    cycles, step = waves.pixel_cycles(task.raw, grid)
    plan = make_plan(options.tolerance, grid.shape, cycles, step, raw.n_samples, tile_of(device))
    engine = Gridder(device, plan, cycles, step, raw.n_samples)
    samples = WeightedRows(device, task, waves, options.tolerance)
    engine.blocks(budget, grid.shape, samples.row_bytes)
    clock.lap("plan")
    return PolarFormatPlan(options, raw, task, waves, bent, engine, samples, budget, clock.seconds)


@dataclass(frozen=True, eq=False)
class PolarFormatPlan:
    """One image to be made with plane wavefronts: a Plan.

    raw      all rows;  task  of the rows that have a weight
    bent     error of plane wavefronts;  engine  the transform on a device;  samples  that it reads
    budget   bytes on the device;  seconds  of planning, by stage
    """

    options: PolarFormatOptions
    raw: PhaseHistory
    task: FocusingTask
    waves: Waves
    bent: Curvature
    engine: Gridder
    samples: WeightedRows
    budget: float
    seconds: dict[str, float]

    @property
    def error_terms(self) -> tuple[ErrorTerm, ...]:
        """Parts of the predicted error."""
        return terms_of_sum({"samples to grid cells": self.engine.plan.predicted_error})

    def forecast(self) -> Forecast[Image]:
        """Its Forecast; no sample is read."""
        plan, pixels = self.engine.plan, self.task.grid.size
        planning = sum(self.seconds.values())
        return Forecast(
            method="polar format",
            plan={**plan.describe(), **_describe(self.bent)},
            seconds=planning + float(cost_model.GRID_UNIT * plan.cost / speed(self.engine.device)),
            bytes=8.0 * (pixels + plan.length[0] * plan.length[1]),  # complex64
            predicted_error=plan.predicted_error,
            error_terms=self.error_terms,
            planning=planning,
            run=self.run,
        )

    def run(self) -> Image:
        """The image."""
        options, task, plan, clock = self.options, self.task, self.engine.plan, Clock(self.seconds)
        grid = task.grid

        on_progress = options.shares_of("polar format")
        data = self.engine.image(self.samples, grid.shape, self.budget, clock, on_progress)
        check_digits(self.samples.largest)
        norm, random = norm_of(data), float(np.sqrt(self.samples.energy() * grid.size))
        details = plan.describe()
        if norm < random:
            details["error of a dark image"] = f"{plan.predicted_error * random / norm:.1e}" if norm else "unknown"
        details |= _describe(self.bent)
        pairs = CHECKED * task.raw.n_rows * self.raw.n_samples
        seconds = clock.seconds["gridding"]
        measured = options.measured(
            pairs, seconds, clock, lambda: _measure_error(task, self.waves, data, self.options.tolerance)
        )
        image = Image(
            data,
            grid,
            gain=float(task.row_weight.sum() * task.sample_weight.sum()),
            frequency=float(np.median(task.antennas.frequency)),
            **collection(task.raw, grid, options.window),
            report=Report(
                plan=details,
                tolerance=options.tolerance,
                predicted_error=plan.predicted_error,
                error_terms=self.error_terms,
                measured_error=measured,
                contributions_done=task.pairs,
                contributions_skipped={"zero weight": (self.raw.n_rows - task.raw.n_rows) * grid.size},
                seconds=clock.seconds,
                device=self.engine.device.info.name,
            ),
        )
        return finished(image, self.options.out, "use backproject")


def _warn(task: FocusingTask, waves: Waves, bent: Curvature) -> None:
    """Warn where the grid is blurred, or reaches beyond the range window."""
    if bent.defocus > DEFOCUS:
        text = (
            f"wavefronts are curved: at the grid's border {bent.defocus:.2g} rad are left that blur; polar_format "
            f"focuses within {bent.radius:.3g} m of its centre. Take a smaller grid, or backproject"
        )
        warn(text)
    reach = np.abs(waves.toward @ (_corners(task.grid) - waves.center).T) + np.abs(waves.shift)[:, None]
    if (reach > task.raw.swath[:, None] / 2 * (1 + 1e-9)).any():
        text = (
            f"the grid reaches {reach.max():.4g} m in range, but the range window ends at "
            f"{task.raw.swath.min() / 2:.4g} m: beyond it polar_format repeats echoes. "
            "Take a smaller grid, or backproject"
        )
        warn(text)


def _corners(grid: ImageGrid) -> np.ndarray:
    last = np.array(grid.shape) - 1
    return grid.at(np.array([0, 0, 1, 1]) * last[0], np.array([0, 1, 0, 1]) * last[1])


def _describe(bent: Curvature) -> dict[str, str]:
    """The error of plane wavefronts, for a report."""
    return {
        "plane-wave phase error": f"{bent.phase:.2g} rad",
        "defocusing phase error": f"{bent.defocus:.2g} rad",
        "displaced by": f"{bent.distortion:.2g} m",
        "sharp within": f"{bent.radius:.3g} m",
    }


def _measure_error(task: FocusingTask, waves: Waves, data: np.ndarray, tolerance: float) -> float:
    """Relative error at up to 256 random pixels against the exact float64 sum."""
    from ...reference.polar_format import polar_format as exact

    index, positions = task.grid.sample(CHECKED, seed=0)
    truth, random = exact(task.raw, positions, waves.center, task.sample_weight, task.row_weight)
    return relative_error(data, index, truth, random, tolerance)
