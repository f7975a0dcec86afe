"""backproject: echoes to an image, to a stated tolerance."""

from __future__ import annotations

import logging
from collections.abc import Callable, Collection, Sequence
from contextlib import ExitStack, closing
from typing import TYPE_CHECKING, Any, Literal, Unpack, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..arrays.map_aperture import MapApertureOptions, MapKind
from ..base import arguments
from ..base.errors import confirm_tolerance, warn
from ..base.report import Report
from ..base.stage_timer import Clock
from ..base.types import PathLike, WritableArray
from ..base.validation import count, flag, instance
from ..model.image import Image
from ..model.image_grid import ImageGrid
from ..model.phase_history import PhaseHistory
from ..numerics.windows import Window
from ..opencl.choose_device import open_devices
from ..opencl.device import Device, DeviceChoice
from ..opencl.failures import DeviceFailed
from ._row_coverage import room_for_gain, seen_by
from .antenna_beam import shares
from .choose_method import MethodChoice, choose
from .collection import collection
from .engine import Skipped
from .focus_options import FocusKeywords, FocusOptions
from .focusing_task import BeamCone, FocusingTask, Skip
from .forecast import speed
from .pixel_taper import PixelTaper
from .run.checkpoint import Checkpoint
from .run.image_output import BandBuffer, ImageOutput, is_path
from .run.tile_files import gaps, share
from .run.workers import LocalWorkers, WorkerPool
from .tiling.tiling import Run
from .unseen_pixels import unseen_pixels

if TYPE_CHECKING:
    import distributed

log = logging.getLogger(__name__)
NOTHING_SEEN = "no pixel lies inside the %s of any row: the image is zero; check the grid's center%s"

MOST_FILES = 64  # blocks per image, where finished tiles are written to files: each block makes one file
# Relative distance from the edge of a range window or beam. Pixels closer to it may fall on either side by rounding,
# and are left out where the error is measured.
EDGE = 1e-5
Progress = Callable[[str, int, int], None]
Tile = Sequence[int] | np.ndarray  # (i, n): piece i of n


class BackprojectOptions(FocusKeywords, total=False):
    """Options of `backproject` other than `tile`, which decides what it returns."""

    out: PathLike | WritableArray | None
    resume: bool | None
    check: bool | None
    cluster: distributed.Client | None
    progress: Progress | None


@overload
def backproject(
    raw: PhaseHistory, grid: ImageGrid, *, tile: None = None, **options: Unpack[BackprojectOptions]
) -> Image: ...


@overload
def backproject(
    raw: PhaseHistory, grid: ImageGrid, *, tile: Tile | None, **options: Unpack[BackprojectOptions]
) -> Image | None: ...


def backproject(
    raw: PhaseHistory,
    grid: ImageGrid,
    *,
    tolerance: float = 1e-3,
    method: Literal["auto", "direct", "factorized"] = "auto",
    window: Window | None = None,
    weights: ArrayLike | None = None,
    beam: BeamCone | None = None,
    mapping: MapKind | MapApertureOptions | None = None,
    wrap: bool = False,
    skip: bool | Collection[Skip] = True,
    max_bytes: float | None = None,
    out: PathLike | WritableArray | None = None,
    resume: bool | None = None,
    tile: Tile | None = None,
    check: bool | None = None,
    device: DeviceChoice | Sequence[DeviceChoice] | None = None,
    sum_polarizations: bool = False,
    cluster: distributed.Client | None = None,
    progress: Progress | None = None,
) -> Image | None:
    """Focus echoes on a grid: I(x) = sum_p v_p(x) sum_n w_pn s_p(f_n) exp(+j 2 pi f_n (tau(x, p) - tau_ref(p))).

    raw        PhaseHistory, compressed
    grid       ImageGrid, a plane or any points
    tolerance  L2 error allowed, relative to the larger of the norm of I and the norm of the same contributions with
               random phases
    method     "direct": every pair that is not skipped; "factorized": sub-apertures; "auto": the cheapest
    window     None, "hamming", ("taylor", sidelobe_db, nbar), another name of scipy.signal.windows, such as "hann" or
               ("kaiser", 8.6): over samples and over rows; or a pair (range, cross-range) of these, of None, or of
               arrays with a weight per sample and per row of a channel. In cross-range with a beam that leaves pixels
               out: over the aperture of each pixel, the rows that see it
    weights    one per row (n_rows,), multiplied with window and raw.weight
    beam       None, or the cone in which v_p(x) is 1: its full angle, rad, about the line from the transmitter to the
               grid's centre (spotlight), or (angle, direction), direction (3,) or (n_rows, 3) (stripmap). Or an
               Antenna, aimed at the grid's centre, (antenna, direction) or (antenna, attitude), attitude (n_rows, 3, 3)
               or a Trajectory that has one: rows are weighted by the conjugate of its gain towards the pixel, transmit
               times receive (matched filter)
    mapping    for echoes of a frequency-diverse array: the mapping that `sarcl.map_aperture` applies first,
               "corrected", "apparent" or "channels", or a dict of its arguments, such as {"mapping": "apparent",
               "center": (0, 0, 5)}
    wrap       False: a row covers only |tau - tau_ref| <= 1/(2 frequency_step); True: it repeats with that period
    skip       True, False or a set of reasons ("range window", "beam", "zero weight", "no data"): pairs of rows and
               pixels that add nothing for these reasons are left out instead of computed; the image is the same
    max_bytes  memory for blocks on each device; default 1 GiB on a CPU, half the memory of a GPU
    out        None, a writable complex array of grid.shape (memmap, HDF5 dataset), or a path ending in ".h5"
    resume     whether finished tiles of an image at a path are kept in "PATH.parts", where the same call finds them if
               the run is killed. None: they are kept from the first second on; True: also when the run ends in an
               exception; False: they are not kept, and those of earlier runs are deleted
    tile       (i, n): compute only piece i of n, 1 <= i <= n, and keep its tiles in "PATH.parts"; the run that
               completes the image assembles and returns it, the others return None
    check      recompute 256 random pixels exactly; None: where that costs less than 2 %
    device     see `sarcl.devices`; a list of devices, or "all", for several at once
    sum_polarizations   True: rows of several polarisations are summed coherently; False: they are refused
    cluster    a dask.distributed.Client whose workers compute the tiles, each on a device of its own
    progress   called as progress(stage, done, total), done and total in (row, pixel) pairs

    Returns an Image, whose gain is the sum of the weights of the rows that saw a pixel: an array where some pixels lie
    outside the range window or the beam of some rows, else a number. Raises ToleranceUnreachable, a ValueError, where
    the tolerance cannot be met; it names the best tolerance that can. ValueError: data not compressed, arguments that
    do not go together, tiles of another job in "PATH.parts". ToleranceMissed, a ValueError that holds the finished
    image: the check measured an error above the tolerance. MemoryError: max_bytes too small for a single row.
    SarclWarning: 1 % of the pixels or more lie outside the range window of every row; report.plan counts them.
    Source: Farooq 2009, section 2.2.2; docs/theory/accuracy.md and docs/guide/large_images.md.
    """
    clock = Clock()
    options = FocusOptions(
        tolerance, method, window, weights, beam, mapping, wrap, skip, max_bytes, device, sum_polarizations
    )
    if check is not None:
        flag("check", check)
    arguments.progress(progress)
    tolerance = options.tolerance
    piece = _piece(tile, resume, out)
    raw, task = options.task(raw, grid)
    workers, chosen = _open_workers(task, options, cluster)
    room_for_gain(task, chosen.dtype)
    clock.lap("plan")

    with ExitStack() as stack:
        checkpoint = None
        if is_path(out):
            checkpoint = Checkpoint(out, task, chosen, tolerance, True if piece else resume)
            stack.push(checkpoint)
        if piece and checkpoint:
            finished = checkpoint.finished()
            if finished is not None:
                return finished
            _fill(
                workers,
                task,
                chosen,
                None,
                checkpoint,
                share(chosen.tiling.n_bands, *piece, chosen.unit),
                clock,
                progress,
            )
            if not checkpoint.complete():
                return None
        try:
            output = ImageOutput(grid, chosen.tiling, out, stack, chosen.dtype)
        except FileExistsError:
            if piece:  # another run is assembling the image from all tiles
                return None
            raise
        if checkpoint:
            checkpoint.begin()
        bands = 0, chosen.tiling.n_bands
        skipped, kept = _fill(workers, task, chosen, output, checkpoint, bands, clock, progress)
        output.finish()
        no_data = 0 if task.grid.empty is None else task.raw.n_rows * int(task.grid.empty.sum())
        done = task.pairs - skipped.window - skipped.beam - no_data
        if done == 0:
            where, remedy = ("range window", "") if skipped.beam == 0 else ("range window and beam", " and the beam")
            log.warning(NOTHING_SEEN, where, remedy)
        unseen = unseen_pixels(task)
        if unseen and unseen.warning and done:
            warn(unseen.warning)
        measured = None
        exact_seconds = 256 * task.raw.n_rows * raw.n_samples * 3e-8
        if check or (check is None and exact_seconds < 0.02 * clock.seconds.get("backproject", 0.0)):
            measured = _measure_error(task, grid, output.data)
            clock.lap("check")
        if task.antenna is None:
            seen = seen_by(task, chosen.dtype, None if task.taper is None else PixelTaper(task).gains)
        else:
            gain = _antenna_gain(task, chosen, open_devices(None if cluster else device)[0], options)
            if gain is None:  # the image is zero, and a gain is not
                gain = float(task.antenna.peak**2 * task.row_weight.sum() * task.sample_weight.sum())
                if done:
                    log.warning(NOTHING_SEEN, "range window and beam", " and the beam")
            seen = {"gain": gain}
        clock.lap("gain")
        plan = chosen.plan.describe(chosen.method)
        if kept:
            plan["from files"] = f"{kept} of {chosen.tiling.n_bands} bands"
        if unseen:
            plan["pixels outside every range window"] = unseen.describe()
        report = Report(
            plan=plan,
            tolerance=tolerance,
            predicted_error=chosen.predicted_error,
            measured_error=measured,
            contributions_done=done,
            contributions_skipped={
                "range window": skipped.window,
                "beam": skipped.beam,
                "zero weight": (raw.n_rows - task.raw.n_rows) * grid.size,
                "no data": no_data,
            },
            seconds=clock.seconds,
            device=" + ".join(workers.names),
        )
        image = output.image(
            job=checkpoint.mark if checkpoint and checkpoint.tiles else None,
            **seen,
            frequency=float(np.median(task.antennas.frequency)),
            report=report,
            **collection(task.raw, grid, window),
        )
        if checkpoint:
            checkpoint.done()
        confirm_tolerance(image=image, instead="try method='direct'")
        return image


def pixels_alone(raw: PhaseHistory, grid: ImageGrid, **keywords: Unpack[FocusKeywords]) -> NDArray[np.complexfloating]:
    """The pixels of `backproject`, of grid.shape, for images that nobody keeps: no gain, check, report or warning."""
    options = FocusOptions(**keywords)
    _, task = options.task(raw, grid)
    workers, chosen = _open_workers(task, options, None)
    with ExitStack() as stack:
        output = ImageOutput(grid, chosen.tiling, None, stack, chosen.dtype)
        _fill(workers, task, chosen, output, None, (0, chosen.tiling.n_bands), Clock(), None)
        output.finish()
    return np.asarray(output.data)


def _piece(tile: Any, resume: Any, out: Any) -> tuple[int, int] | None:
    """`tile` as (i, n), 0 <= i <= n, or None; ValueError for arguments that do not go together."""
    if resume is not None:
        instance("resume", resume, bool)
    if (tile is not None or resume) and not is_path(out):
        name, given = ("tile", tile) if tile is not None else ("resume", resume)
        raise ValueError(
            f'{name} is {" ".join(repr(given).split()):.60} but out is no path; give out="image.h5": tiles are kept '
            "beside it"
        )
    if tile is None:
        return None
    if resume is False:
        raise ValueError("tile and resume=False do not go together: a piece would delete the tiles of the other pieces")
    if not isinstance(tile, (tuple, list)) or len(tile) != 2:
        raise ValueError(f"tile is {' '.join(repr(tile).split()):.60}; wanted (i, n): piece i of n")
    i, n = count("tile[0]", tile[0], least=0), count("tile[1]", tile[1])
    if i > n:
        raise ValueError(f"tile is {tile!r}; pieces of {n} are numbered 1 to {n}")
    return i, n


def _open_workers(task: FocusingTask, options: FocusOptions, cluster: Any) -> tuple[WorkerPool, MethodChoice]:
    """The workers that make the image, and the one method and plan for all of them."""
    if cluster is not None:
        from .run.dask_workers import DaskWorkers, device_class

        chosen = choose(task, options.method, options.tolerance, device_class(cluster, options.device))
        return DaskWorkers(cluster, task, chosen, options.device, options.max_bytes), chosen
    devices = open_devices(options.device)
    budgets = [options.budget(d) for d in devices]
    chosen = options.choose(task, devices)
    engines = [chosen.on(d, task) for d in devices]
    kinds = {(d.info.platform, d.info.name, d.info.kind, d.info.units) for d in devices}
    rates = [speed(d) for d in devices] if len(kinds) > 1 else [1.0 for _ in devices]
    return LocalWorkers(engines, budgets, [d.info.name for d in devices], task.raw.n_rows, rates), chosen


def _fill(
    workers: WorkerPool,
    task: FocusingTask,
    chosen: MethodChoice,
    output: ImageOutput | None,
    checkpoint: Checkpoint | None,
    bands: Run,
    clock: Clock,
    progress: Progress | None,
) -> tuple[Skipped, int]:
    """Focus a run of bands into `output`, or only into tile files; returns the pairs skipped and the number of bands
    that files already held."""
    tiling, n_rows = chosen.tiling, task.raw.n_rows
    there, skipped = [], Skipped()
    for run, values, missed in checkpoint.found(*bands) if checkpoint else ():
        if output is not None:
            output.flat[tiling.extent(*run)] = values
        there.append(run)
        skipped += missed
    todo = gaps(there, *bands)
    total = n_rows * sum(tiling.count(*run) for run in todo)
    reported = -1

    def on_progress(done: int) -> None:
        nonlocal reported
        if progress and done != reported:
            progress("backproject", done, total)
            reported = done

    def output_for(first: int, last: int) -> Any:
        return BandBuffer(tiling, first, last, chosen.dtype) if output is None else output.flat

    most = float("inf")
    if checkpoint and checkpoint.resume is not False:
        most = max(total / max(n_rows, 1) / MOST_FILES, workers.least_pixels)
    clock.lap("files")
    made = []
    try:
        with closing(workers.work(todo, most, chosen.unit, output_for, clock, on_progress)) as work:
            for first, last, flat, missed in work:
                made.append((first, last))
                skipped += missed
                if checkpoint:
                    checkpoint.keep(first, last, flat, missed)
                    clock.lap("files")
    except DeviceFailed:
        if checkpoint and output is not None:  # without an output every tile is written at once
            checkpoint.rescue(output.flat)
        raise
    if gaps(there + made, *bands):
        raise RuntimeError(f"bands {gaps(there + made, *bands)} were left out; please report this")
    return skipped, sum(b - a for a, b in there)


def _antenna_gain(task: FocusingTask, chosen: MethodChoice, device: Device, options: FocusOptions) -> Any:
    """Sums of the squared gains of the antenna times the weights, float32 of the grid's shape; a number where they are
    the same in all pixels; None where they are 0 in all: the antenna sees no pixel inside a range window."""
    engine: Any = chosen.engine
    tiling, budget = chosen.tiling, options.budget(device)
    sums = engine(device, task, chosen.plan, tiling, gain=True)
    flat = np.zeros(task.grid.shape if tiling.in_rows else task.grid.size, np.float32)
    for first, last in sums.blocks(budget):
        made = BandBuffer(tiling, first, last, np.complex64)
        sums.fill(first, last, made, budget, Clock(), lambda rows: None)
        flat[tiling.extent(first, last)] = made.values.real
    flat *= task.sample_weight.sum()
    if not flat.any():
        return None
    return float(flat.flat[0]) if flat.min() == flat.max() > 0 else flat.reshape(task.grid.shape)


def _measure_error(task: FocusingTask, grid: ImageGrid, data: Any) -> float:
    """Relative error at up to 256 random pixels against the exact float64 sum, as `tolerance` is defined."""
    from ..reference.backproject import backproject as exact

    index, positions = grid.sample(256, seed=0)
    beam = None if task.antennas.beam is None else (task.antennas.beam_angle, task.antennas.beam)
    share = None if task.taper is None else PixelTaper(task).weights(positions)
    if task.antenna is not None:
        share = shares(task, positions)
    wanted, spread = exact(task.raw, positions, task.sample_weight, task.row_weight, task.wrap, beam, EDGE, share)
    got = (
        np.asarray(data)[index]
        if isinstance(data, np.ndarray)
        else np.array([data[i] for i in zip(*index, strict=True)])
    )
    clear = np.isfinite(wanted)
    wrong, scale = float(np.linalg.norm((got - wanted)[clear])), max(float(np.linalg.norm(wanted[clear])), spread)
    return wrong / scale if wrong else 0.0
