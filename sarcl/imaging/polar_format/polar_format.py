"""polar_format: echoes to an image with plane wavefronts, by one two-dimensional FFT."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ...base import arguments
from ...base.errors import SarclWarning, confirm_tolerance
from ...base.report import Report
from ...base.stage_timer import Clock
from ...base.validation import flag, instance
from ...base.validation import tolerance as allowed_error
from ...model.image import Image
from ...model.image_grid import ImageGrid
from ...model.phase_history import PhaseHistory
from ...numerics import cost_model
from ...numerics.nufft2d import Gridder, make_plan, tile_of
from ...numerics.range_profiles import check_digits
from ...numerics.windows import Window
from ...opencl import memory_budget
from ...opencl.choose_device import open_device
from ...opencl.device import DeviceChoice
from ..collection import collection
from ..focusing_task import FocusingTask, make_task
from ..forecast import Forecast, speed
from ._samples import WeightedRows
from ._wavefront import Curvature, Waves, curvature, waves_about

DEFOCUS = np.pi / 2  # rad: blurring phase at the border of the grid above which a warning is given
Progress = Callable[[str, int, int], None]


def polar_format(
    raw: PhaseHistory,
    grid: ImageGrid,
    *,
    tolerance: float = 1e-2,
    window: Window | None = None,
    weights: ArrayLike | None = None,
    max_bytes: float | None = None,
    device: DeviceChoice | None = None,
    sum_polarizations: bool = False,
    check: bool | None = None,
    progress: Progress | None = None,
) -> Image:
    """Focus echoes on a plane with plane wavefronts: I(x) = sum_p sum_n w_pn s_pn exp(+j 2 pi K_pn.(x - c)).

    raw        PhaseHistory, compressed, of at least 2 rows; any track, and any receiver: that of an orbit's echoes, at
               their arrival, or one elsewhere
    grid       ImageGrid.plane; c is its pixel (rows//2, columns//2). K = -(2 f/c) u, with u the unit vector from c to
               the antenna, or the mean of those to transmitter and receiver: less the gradient of half the path.
               Phases are relative to c, whatever reference_range is
    tolerance  L2 error allowed against that sum, relative to the larger of the norm of I and the norm of samples that
               add with random phases, sqrt(pixels sum |w s|^2)
    window, weights, max_bytes, sum_polarizations   as `backproject` takes them
    check      compute 256 random pixels of that sum exactly; None: where that costs less than 2 %
    device     see `sarcl.devices`
    progress   called as progress(stage, done, total), in thousandths

    The plan in the report gives the error of plane wavefronts against `backproject`, which the tolerance does not
    include: the largest neglected phase, the part of it that defocuses, the largest displacement of a pixel, and the
    radius in which images are sharp. sarcl.SarclWarning where images are not sharp up to the border of the grid, and
    where the border lies beyond the range window, so that echoes repeat. ValueError: uncompressed data, listed
    points, one row. ToleranceUnreachable: a tolerance that cannot be met. ToleranceMissed: the check measured an
    error above the tolerance. MemoryError: max_bytes too small.
    Source: Farooq 2009, equations 2.59 to 2.64; docs/theory/polar_format.md.
    """
    if check is not None:
        flag("check", check)
    arguments.progress(progress)
    clock = Clock()
    made = _prepare(raw, grid, tolerance, window, weights, max_bytes, device, sum_polarizations)
    task, waves, engine, tolerance = made.task, made.waves, made.engine, made.tolerance
    plan, opened, budget = engine.plan, engine.device, made.budget
    clock.lap("plan")

    def on_progress(share: float) -> None:
        if progress:
            progress("polar format", round(1000 * share), 1000)

    data = engine.image(made.samples, grid.shape, budget, clock, on_progress)
    check_digits(made.samples.largest)
    norm, random = _norm(data), float(np.sqrt(made.samples.energy() * grid.size))
    details = plan.describe()
    if norm < random:
        details["error of a dark image"] = f"{plan.predicted_error * random / norm:.1e}" if norm else "unknown"
    details |= _describe(made.bent)
    measured = None
    exact_seconds = 256 * task.raw.n_rows * raw.n_samples * 3e-8
    if check or (check is None and exact_seconds < 0.02 * clock.seconds["gridding"]):
        measured = _measure_error(task, grid, waves, data)
        clock.lap("check")
    image = Image(
        data,
        grid,
        gain=float(task.row_weight.sum() * task.sample_weight.sum()),
        frequency=float(np.median(task.antennas.frequency)),
        **collection(task.raw, grid, window),
        report=Report(
            plan=details,
            tolerance=tolerance,
            predicted_error=plan.predicted_error,
            measured_error=measured,
            contributions_done=task.pairs,
            contributions_skipped={"zero weight": (raw.n_rows - task.raw.n_rows) * grid.size},
            seconds=clock.seconds,
            device=opened.info.name,
        ),
    )
    confirm_tolerance(image=image, instead="use backproject")
    return image


def plan_polar_format(
    raw: PhaseHistory,
    grid: ImageGrid,
    *,
    tolerance: float = 1e-2,
    window: Window | None = None,
    weights: ArrayLike | None = None,
    max_bytes: float | None = None,
    device: DeviceChoice | None = None,
    sum_polarizations: bool = False,
    check: bool | None = None,
    progress: Progress | None = None,
) -> Forecast:
    """What `polar_format` would do with these arguments: a Forecast. Raises and warns as it does; no sample is read.

    check, progress   are of `polar_format` alone
    """
    made = _prepare(raw, grid, tolerance, window, weights, max_bytes, device, sum_polarizations)
    plan = made.engine.plan
    held = 8.0 * (grid.size + plan.length[0] * plan.length[1])  # complex64
    seconds = cost_model.GRID_UNIT * plan.cost / speed(made.engine.device)
    details = {**plan.describe(), **_describe(made.bent)}
    return Forecast("polar format", details, seconds, held, plan.predicted_error, None)


@dataclass(frozen=True, eq=False)
class _Prepared:
    """What is to be focused, and how."""

    tolerance: float
    task: FocusingTask
    waves: Waves
    bent: Curvature
    engine: Gridder
    samples: WeightedRows
    budget: float


def _prepare(
    raw: PhaseHistory, grid: ImageGrid, tolerance: float, window: Window | None, weights: ArrayLike | None,
    max_bytes: float | None, device: DeviceChoice | None, sum_polarizations: bool,
) -> _Prepared:  # fmt: skip
    """Arguments checked, plane waves and their error, and the plan on the device; warns where the image is blurred."""
    instance("raw", raw, PhaseHistory)
    instance("grid", grid, ImageGrid)
    if not grid.is_plane:
        raise ValueError("grid lists its points; the FFT of polar_format needs an ImageGrid.plane: use backproject")
    tolerance = allowed_error(tolerance)
    task = make_task(raw, grid, window, weights, wrap=True, skip=True, sum_polarizations=sum_polarizations)
    if task.raw.n_rows < 2:
        raise ValueError(f"raw has {task.raw.n_rows} row of weight > 0; a synthetic aperture needs at least 2")
    opened = open_device(device)
    budget = min(memory_budget.budget(opened, max_bytes), opened.info.memory)
    waves = waves_about(task.raw, grid.at(grid.shape[0] // 2, grid.shape[1] // 2))
    bent = curvature(task.raw, waves, grid)
    _warn(task, waves, bent)
    cycles, step = waves.pixel_cycles(task.raw, grid)
    plan = make_plan(tolerance, grid.shape, cycles, step, raw.n_samples, tile_of(opened))
    engine = Gridder(opened, plan, cycles, step, raw.n_samples)
    samples = WeightedRows(opened, task, waves, tolerance)
    engine.blocks(budget, grid.shape, samples.row_bytes)
    return _Prepared(tolerance, task, waves, bent, engine, samples, budget)


def _warn(task: FocusingTask, waves: Waves, bent: Curvature) -> None:
    """Warn where the grid is blurred, or reaches beyond the range window."""
    if bent.defocus > DEFOCUS:
        text = (
            f"wavefronts are curved: at the grid's border {bent.defocus:.2g} rad are left that blur; polar_format "
            f"focuses within {bent.radius:.3g} m of its centre. Take a smaller grid, or backproject"
        )
        warnings.warn(text, SarclWarning, stacklevel=4)
    reach = np.abs(waves.toward @ (_corners(task.grid) - waves.center).T) + np.abs(waves.shift)[:, None]
    if (reach > task.raw.swath[:, None] / 2 * (1 + 1e-9)).any():
        text = (
            f"the grid reaches {reach.max():.4g} m in range, but the range window ends at "
            f"{task.raw.swath.min() / 2:.4g} m: beyond it polar_format repeats echoes. "
            "Take a smaller grid, or backproject"
        )
        warnings.warn(text, SarclWarning, stacklevel=4)


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


def _norm(data: np.ndarray) -> float:
    """Euclidean norm of pixels, row by row in float64: squares of float32 overflow from 2e19 on, and vanish below
    1e-23."""
    return float(np.sqrt(sum(np.linalg.norm(row.astype(np.complex128)) ** 2 for row in data)))


def _measure_error(task: FocusingTask, grid: ImageGrid, waves: Waves, data: np.ndarray) -> float:
    """Relative error at up to 256 random pixels against the exact float64 sum."""
    from ...reference.polar_format import polar_format as exact

    index, positions = grid.sample(256, seed=0)
    wanted, random = exact(task.raw, positions, waves.center, task.sample_weight, task.row_weight)
    wrong = float(np.linalg.norm(data[index] - wanted))
    return wrong / max(float(np.linalg.norm(wanted)), random) if wrong else 0.0
