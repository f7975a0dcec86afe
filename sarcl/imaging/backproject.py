"""backproject: echoes to an image, to a stated tolerance."""

from __future__ import annotations

import logging
from contextlib import ExitStack
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..base.errors import confirm_tolerance, warn
from ..base.forecast import Forecast, Plan
from ..base.report import Report
from ..base.stage_timer import Clock
from ..base.verb import verb
from ..blocks.bands import BandBuffer
from ..blocks.block_job import BlockJob
from ..blocks.checkpoint import Checkpoint
from ..blocks.fill_bands import BandFiller
from ..blocks.workers import LocalWorkers, WorkerPool
from ..model.image import Image
from ..model.image_grid import ImageGrid
from ..model.phase_history import PhaseHistory
from ..opencl.choose_device import open_devices
from ..opencl.device import Device
from ._image_job import ImageRecipe, image_job
from ._image_output import ImageOutput, is_path
from ._row_coverage import room_for_gain, seen_by
from .antenna_beam import shares
from .backproject_options import BackprojectOptions
from .choose_method import choose
from .engine import Skipped
from .focus_options import collection, relative_error
from .focusing_task import FocusingTask
from .forecast import forecast_of, speed
from .method_choice import MethodChoice
from .pixel_taper import PixelTaper
from .unseen_pixels import unseen_pixels

log = logging.getLogger(__name__)
NOTHING_SEEN = "no pixel lies inside the %s of any row: the image is zero; check the grid's center%s"

# Relative distance from the edge of a range window or beam. Pixels closer to it may fall on either side by rounding,
# and are left out where the error is measured.
EDGE = 1e-5
CHECKED = 256  # pixels that a check computes exactly


@verb(BackprojectOptions)
def backproject(raw: PhaseHistory, grid: ImageGrid, options: BackprojectOptions) -> Plan[Image]:
    """Focus echoes on a grid: I(x) = sum_p v_p(x) sum_n w_pn s_p(f_n) exp(+j 2 pi f_n (tau(x, p) - tau_ref(p))).

    raw        PhaseHistory, compressed
    grid       ImageGrid, a plane or any points
    {options}

    Returns an Image, whose gain is the sum of the weights of the rows that saw a pixel: an array where some pixels lie
    outside the range window or the beam of some rows, else a number. Raises ToleranceUnreachable, a ValueError, where
    the tolerance cannot be met; it names the best tolerance that can. ValueError: data not compressed, arguments that
    do not go together, tiles of another job in "PATH.parts". ToleranceMissed, a ValueError that holds the finished
    image: the check measured an error above the tolerance. MemoryError: max_bytes too small for a single row.
    SarclWarning: 1 % of the pixels or more lie outside the range window of every row; report.plan counts them.
    Source: Farooq 2009, section 2.2.2; docs/theory/accuracy.md and docs/guide/large_images.md.

    >>> image = sarcl.backproject(raw, grid, tolerance=1e-3, window=("taylor", 35, 5))
    >>> bool(np.allclose(sarcl.measure(image, near=(0, 0, 0)).position, 0, atol=0.01))
    True
    """
    return plan_of(raw, grid, options)


def plan_of(raw: PhaseHistory, grid: ImageGrid, options: BackprojectOptions) -> BackprojectPlan:
    """The plan of `backproject`."""
    clock, piece = Clock(), options.piece(is_path(options.out), "image.h5")
    mapped, task = options.task(raw, grid)
    if options.cluster is None:
        chosen = options.choose(task, open_devices(options.device))
    else:
        from ..blocks.dask_workers import device_class

        chosen = choose(task, options.method, options.tolerance, device_class(options.cluster, options.device))
    clock.lap("plan")
    return BackprojectPlan(options, mapped, grid, task, chosen, piece, clock.seconds)


def pixels_alone(raw: PhaseHistory, grid: ImageGrid, **options: Any) -> NDArray[np.complexfloating]:
    """The pixels of `backproject`, of grid.shape, for images that nobody keeps: no gain, check, report or warning.

    options  as `backproject` takes them, without files, pieces and clusters
    """
    return plan_of(raw, grid, BackprojectOptions(**options)).pixels()


@dataclass(frozen=True, eq=False)
class BackprojectPlan:
    """One image to be made by the chosen method: a Plan.

    raw      all rows, mapped where a mapping is asked for;  grid  as it was given
    task     of the rows that have a weight
    piece    (i, n) where only that piece of the tiles is made;  seconds  of planning, by stage
    """

    options: BackprojectOptions
    raw: PhaseHistory
    grid: ImageGrid
    task: FocusingTask
    chosen: MethodChoice
    piece: tuple[int, int] | None
    seconds: dict[str, float]

    def forecast(self) -> Forecast[Image]:
        """Its Forecast."""
        return forecast_of(self.task, self.options, self.chosen, sum(self.seconds.values()), self.run)

    @property
    def job(self) -> BlockJob:
        """The image as a job that is computed in blocks."""
        return image_job(self.task, self.chosen, self.options.tolerance)

    def pixels(self) -> NDArray[np.complexfloating]:
        """The pixels alone."""
        with ExitStack() as stack:
            output = ImageOutput(self.grid, self.chosen.tiling, None, stack, self.chosen.dtype)
            self._filler(None, Clock(), progress=False).fill(output.flat)
            output.finish()
        return np.asarray(output.data)

    def run(self) -> Image:
        """The image; None for a piece while others are missing."""
        room_for_gain(self.task, self.chosen.dtype)
        clock = Clock(self.seconds)
        with ExitStack() as stack:
            image = self._image(stack, clock)
        return image  # type: ignore[return-value]

    def _image(self, stack: ExitStack, clock: Clock) -> Image | None:
        options, out = self.options, self.options.out
        checkpoint = None
        if is_path(out):
            kept = True if self.piece else options.resume
            checkpoint = Checkpoint(out, self.job, kept)
            stack.push(checkpoint)
        filler = self._filler(checkpoint, clock)
        if self.piece and checkpoint:
            finished = checkpoint.finished()
            if isinstance(finished, Image):
                return finished
            if not filler.fill_piece(self.piece):
                return None
        try:
            output = ImageOutput(self.grid, self.chosen.tiling, out, stack, self.chosen.dtype)
        except FileExistsError:
            if self.piece:  # another run is assembling the image from all tiles
                return None
            raise
        if checkpoint:
            checkpoint.begin()
        skipped, n_kept = filler.fill(output.flat)
        assert isinstance(skipped, Skipped)
        output.finish()
        fields = self._fields(filler, skipped, n_kept, output)
        image = output.image(job=checkpoint.mark if checkpoint and checkpoint.tiles else None, **fields)
        if checkpoint:
            checkpoint.done()
        confirm_tolerance(image=image, instead="try method='direct'")
        return image

    def _filler(self, checkpoint: Checkpoint | None, clock: Clock, progress: bool = True) -> BandFiller:
        """The filler of this task on its workers."""
        report = self.options.progress if progress else None
        job = self.job
        return BandFiller(self._workers(job), job, checkpoint, clock, report)

    def _workers(self, job: BlockJob) -> WorkerPool:
        """The workers that make the image."""
        options, task, chosen = self.options, self.task, self.chosen
        if options.cluster is not None:
            from ..blocks.dask_workers import DaskWorkers

            recipe = ImageRecipe.portable(task, chosen, options.max_bytes)
            return DaskWorkers(options.cluster, job, recipe, options.device, np.inf)
        devices = open_devices(options.device)
        engines = [chosen.on(d, task) for d in devices]
        kinds = {(d.info.platform, d.info.name, d.info.kind, d.info.units) for d in devices}
        rates = [speed(d) for d in devices] if len(kinds) > 1 else [1.0 for _ in devices]
        budgets = [options.budget(d) for d in devices]
        return LocalWorkers(job, engines, budgets, [d.info.name for d in devices], rates)

    def _fields(self, filler: BandFiller, skipped: Skipped, n_kept: int, output: ImageOutput) -> dict[str, Any]:
        """Fields of the Image about its data: gain, carrier, collection, report; warns of pixels that no row sees.

        n_kept  bands that files of earlier runs held
        """
        task, grid, clock = self.task, self.grid, filler.clock
        no_data = 0 if task.grid.empty is None else task.raw.n_rows * int(task.grid.empty.sum())
        done = task.pairs - skipped.window - skipped.beam - no_data
        if done == 0:
            where, remedy = ("range window", "") if skipped.beam == 0 else ("range window and beam", " and the beam")
            log.warning(NOTHING_SEEN, where, remedy)
        unseen = unseen_pixels(task)
        if unseen and unseen.warning() and done:
            warn(unseen.warning())
        pairs, seconds = CHECKED * task.raw.n_rows * self.raw.n_samples, clock.seconds.get("backproject", 0.0)
        measured = self.options.measured(
            pairs, seconds, clock, lambda: _measure_error(task, grid, output.data, self.options.tolerance)
        )
        gain = self._gain(done)
        clock.lap("gain")
        plan = self.chosen.plan.describe(self.chosen.method)
        if n_kept:
            plan["from files"] = f"{n_kept} of {self.chosen.tiling.n_bands} bands"
        if unseen:
            plan["pixels outside every range window"] = unseen.describe()
        report = Report(
            plan=plan,
            tolerance=self.options.tolerance,
            predicted_error=self.chosen.predicted_error,
            error_terms=self.chosen.error_terms,
            measured_error=measured,
            contributions_done=done,
            contributions_skipped={
                "range window": skipped.window,
                "beam": skipped.beam,
                "zero weight": (self.raw.n_rows - task.raw.n_rows) * grid.size,
                "no data": no_data,
            },
            seconds=clock.seconds,
            device=" + ".join(filler.workers.names),
        )
        frequency = float(np.median(task.antennas.frequency))
        return {**gain, "frequency": frequency, "report": report, **collection(task.raw, grid, self.options.window)}

    def _gain(self, done: int) -> dict[str, Any]:
        """The gain of the image, as fields of Image."""
        task = self.task
        if task.antenna is None:
            return seen_by(task, self.chosen.dtype, None if task.taper is None else PixelTaper(task).gains)
        device = open_devices(None if self.options.cluster else self.options.device)[0]
        gain = _antenna_gain(task, self.chosen, device, self.options)
        if gain is None:  # the image is zero, and a gain is not
            gain = float(task.antenna.peak**2 * task.row_weight.sum() * task.sample_weight.sum())
            if done:
                log.warning(NOTHING_SEEN, "range window and beam", " and the beam")
        return {"gain": gain}


def _antenna_gain(
    task: FocusingTask, chosen: MethodChoice, device: Device, options: BackprojectOptions
) -> float | np.ndarray | None:
    """Sums of the squared gains of the antenna times the weights, of the grid's shape, float32, or float64 of an image
    in complex128 and where float32 does not hold them; a number where they are the same in all pixels; None where they
    are 0 in all: the antenna sees no pixel inside a range window."""
    assert task.antenna is not None
    engine: Any = chosen.engine
    tiling, budget = chosen.tiling, options.budget(device)
    sums = engine(device, task, chosen.plan, tiling, gain=True)
    kind: type[np.floating] = np.float64 if chosen.dtype == np.complex128 else np.float32
    flat = np.zeros(task.grid.shape if tiling.in_rows else task.grid.size, kind)
    for first, last in sums.blocks(budget):
        bands = BandBuffer(tiling, first, last, chosen.dtype)
        sums.fill(first, last, bands, budget, Clock(), lambda rows: None)
        flat[tiling.extent(first, last)] = bands.values.real
    if not flat.any():
        return None
    peak, limits = task.antenna.peak**2 * float(task.sample_weight.sum()), np.finfo(np.float32)
    if not float(limits.smallest_normal) <= peak * float(flat.max()) <= float(limits.max):
        flat = flat.astype(np.float64)
    flat *= peak
    return float(flat.flat[0]) if flat.min() == flat.max() > 0 else flat.reshape(task.grid.shape)


def _measure_error(task: FocusingTask, grid: ImageGrid, data: Any, tolerance: float) -> float:
    """Relative error at up to 256 random pixels against the exact float64 sum, as `tolerance` is defined."""
    from ..reference.backproject import PerPoint
    from ..reference.backproject import backproject as exact

    index, positions = grid.sample(CHECKED, seed=0)
    beam = None if task.antennas.beam is None else (task.antennas.beam_angle, task.antennas.beam)
    share = 1.0 if task.taper is None else PixelTaper(task).weights(positions)
    if task.antenna is not None:
        share = shares(task, positions)
    weights = task.sample_weight, task.row_weight
    truth, spread = exact(task.raw, positions, *weights, task.wrap, beam, EDGE, PerPoint(share))
    return relative_error(data, index, truth, spread, tolerance)
