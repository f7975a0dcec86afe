"""Direct backprojection: every (row, pixel) pair that is not skipped, to a stated tolerance."""

from __future__ import annotations

import logging
from collections.abc import Callable
from contextlib import ExitStack
from typing import Any

import numpy as np

from . import cl, planning, profiles
from .check import SPEED_OF_LIGHT, array, choice, instance, number
from .geometry import Antennas, GridTiling
from .grid import ImageGrid
from .image import Image
from .phase_history import PhaseHistory
from .planning import Clock, Plan, cheapest
from .report import Report
from .target import Target

log = logging.getLogger(__name__)

CHUNK = 64  # rows added in float32 before the compensated total; blocks of rows are multiples of it
VECTORS = 4  # vectors of pixels a work-item
SKIPS = ("range window", "zero weight")
Progress = Callable[[str, int, int], None]


def backproject(
    raw: PhaseHistory,
    grid: ImageGrid,
    *,
    tolerance: float = 1e-3,
    method: str = "auto",
    window: Any = None,
    weights: Any = None,
    wrap: bool = False,
    skip: Any = True,
    max_bytes: float | None = None,
    out: Any = None,
    check: bool | None = None,
    device: Any = None,
    progress: Progress | None = None,
) -> Image:
    """Focus echoes on a grid: I(x) = sum_p v_p(x) sum_n w_pn s_p(f_n) exp(+j 2 pi f_n (tau(x, p) - tau_ref(p))).

    raw        PhaseHistory, compressed
    grid       ImageGrid, a plane or any points
    tolerance  L2 error allowed, relative to the larger of |I| and the norm of randomly phased contributions
    method     "direct", or "auto" for the cheapest there is
    window     None, "hamming" or ("taylor", sidelobe_db, nbar): over samples and over rows
    weights    one a row (n_rows,), on top of window and raw.weight
    wrap       False: a row reaches only |tau - tau_ref| <= 1/(2 frequency_step); True: it repeats beyond
    skip       True, False or a set of reasons ("range window", "zero weight"); the image is the same
    max_bytes  memory for blocks on the device, default 1 GiB on CPUs, half the memory of a GPU
    out        None, a writable complex array of grid.shape (memmap, HDF5 dataset), or a path ending in ".h5"
    check      recompute 256 random pixels exactly; None: where that costs less than 2 %
    device     see `sarcl.devices`; progress  called as progress(stage, done, total)

    Returns an Image. ValueError: a tolerance that cannot be met (with the best that can), data not compressed,
    arguments that do not fit. Source: Farooq 2009, section 2.2.2; docs/accuracy.md.
    """
    clock = Clock()
    instance("raw", raw, PhaseHistory)
    instance("grid", grid, ImageGrid)
    choice("method", method, ("auto", "direct"))
    tolerance = number("tolerance", tolerance, above=0)
    if not raw.compressed:
        raise ValueError("raw is not compressed: its pulses still have their own spectrum; call sarcl.compress(raw)")
    skips = planning.skips(skip, SKIPS)
    sample_weight, row_weight = weigh(raw, window, weights)
    gain = float(row_weight.sum() * sample_weight.sum())
    n_all = raw.n_rows
    if "zero weight" in skips and not row_weight.all():
        used = np.flatnonzero(row_weight)
        raw, row_weight = raw[used], row_weight[used]
    opened = cl.open_device(device)
    antennas = antennas_of(raw, wrap)
    budget = planning.budget(opened, max_bytes)
    plan, tiling = make_plan(raw, antennas, grid, tolerance)
    clock.lap("plan")

    with ExitStack() as stack:
        target = Target(grid, out, stack)
        run = _Run(opened, raw, antennas, plan, tiling, wrap, "range window" in skips)
        shaped = sample_weight * profiles.correction(plan.interpolator, raw.n_samples, plan.length)
        skipped = run.focus(shaped, row_weight, budget, target, clock, progress)
        middle = raw.n_rows // 2
        geometry = {
            "frequency": float(np.median(antennas.frequency)),
            "tx": raw.tx[middle],
            "rx": raw.rx[middle],
        }
        pairs = raw.n_rows * grid.size
        if skipped == pairs:
            log.warning("no pixel lies inside the range window of any row: the image is zero; check the grid's center")
        seconds = clock.seconds.get("backproject", 0.0)
        exact_seconds = 256 * raw.n_rows * raw.n_samples * 3e-8
        measured = None
        if check or (check is None and exact_seconds < 0.02 * seconds):
            measured = _measure_error(raw, grid, sample_weight, row_weight, wrap, target.data)
            clock.lap("check")
        report = Report(
            plan=plan.describe("direct"),
            tolerance=tolerance,
            predicted_error=plan.predicted_error,
            measured_error=measured,
            contributions_done=pairs - skipped,
            contributions_skipped={
                "range window": skipped,
                "zero weight": (n_all - raw.n_rows) * grid.size,
            },
            seconds=clock.seconds,
            device=opened.info.name,
        )
        return target.image(gain=gain, report=report, **geometry)


def make_plan(raw: PhaseHistory, antennas: Antennas, grid: ImageGrid, tolerance: float) -> tuple[Plan, GridTiling]:
    """The cheapest plan whose predicted error is at most `tolerance`, and the tiling of the grid that it uses."""
    tilings = {side**2: GridTiling(grid, side) for side in (32, 16, 8)}
    plan = cheapest(
        tolerance,
        [(n, tiling.radius) for n, tiling in tilings.items()],
        distance=antennas.distance(grid.bounds),
        frequency=float((raw.frequency + raw.n_samples * raw.frequency_step).max()),
        bandwidth=float(raw.bandwidth.max()),
        n_samples=raw.n_samples,
        points_per_row=grid.size,
        chunk=CHUNK,
    )
    return plan, tilings[plan.per_tile]


def weigh(raw: PhaseHistory, window: Any, weights: Any) -> tuple[np.ndarray, np.ndarray]:
    """Weights of samples (n_samples,) and rows (n_rows,): window, raw.weight and `weights` together.

    The rows of each channel and polarisation, in time, share one window over the aperture.
    """
    from .windows import weights as window_weights

    rows = np.ones(raw.n_rows)
    if window is not None:
        keys = [k for k in (raw.tx_channel, raw.rx_channel, raw.polarization) if k is not None]
        when = np.arange(raw.n_rows) if raw.time is None else np.argsort(np.argsort(raw.time, kind="stable"))
        group = np.zeros(raw.n_rows, np.int64)
        for key in keys:
            group = group * (len(np.unique(key)) + 1) + np.unique(key, return_inverse=True)[1]
        for g in np.unique(group):
            members = np.flatnonzero(group == g)
            rows[members[np.argsort(when[members])]] = window_weights(window, len(members))
    if raw.weight is not None:
        rows = rows * raw.weight
    if weights is not None:
        rows = rows * array("weights", weights, np.float64, (raw.n_rows,))
    if (rows < 0).any():
        raise ValueError(f"weights[{int(np.argmin(rows))}] is negative; a weight cannot be")
    if not rows.any():
        raise ValueError("every row has weight 0; nothing would be focused")
    return window_weights(window, raw.n_samples), rows


def antennas_of(raw: PhaseHistory, wrap: bool) -> Antennas:
    """The geometry of every row; the carrier is the frequency of sample n_samples//2."""
    half = np.full(raw.n_rows, 1e30) if wrap else SPEED_OF_LIGHT / (4 * raw.frequency_step)
    return Antennas(
        tx=raw.tx,
        rx=None if raw.is_monostatic else raw.rx,
        reference_range=raw.reference_range,
        frequency=raw.frequency + raw.n_samples // 2 * raw.frequency_step,
        frequency_step=raw.frequency_step,
        near=-half,
        far=half,
        wrap=wrap,
    )


class _Run:
    """The loops over image blocks, row blocks and tiles of one backprojection."""

    def __init__(
        self,
        device: cl.Device,
        raw: PhaseHistory,
        antennas: Antennas,
        plan: Plan,
        tiling: GridTiling,
        wrap: bool,
        skip: bool,
    ) -> None:
        self.device, self.raw, self.antennas, self.plan, self.tiling = device, raw, antennas, plan, tiling
        self.skip = skip
        self.lanes = device.info.vector_width
        bistatic = antennas.rx is not None
        common = {**plan.macros(bistatic, wrap), "VECTORS": VECTORS, "CHUNK": CHUNK}
        self.components = plan.components(bistatic)
        self.constants = device.kernel("backproject.cl", "tile_constants", **common)
        self.kernel = device.kernel("backproject.cl", "backproject", **common)
        self.group = device.max_group(self.kernel)
        self.table = device.upload(plan.interpolator.table)

    def focus(
        self,
        sample_weight: np.ndarray,
        row_weight: np.ndarray,
        budget: float,
        target: Target,
        clock: Clock,
        progress: Progress | None,
    ) -> int:
        """Fill `target`; return how many pairs were outside the range window in whole tiles."""
        raw, tiling, device = self.raw, self.tiling, self.device
        stride = self.plan.length + 2 * profiles.padding(self.plan.interpolator)
        # few enough rows on a CPU that what neighbouring tiles read of them stays in its caches
        most = 2 if device.is_cpu else 64
        fit = int(budget / 4 / (8 * stride))
        rows = min(most * CHUNK, fit // CHUNK * CHUNK or max(1, fit))
        blocks = self._image_blocks(min(budget / 2, device.info.max_alloc))
        total, done, skipped = raw.n_rows * len(blocks), 0, 0
        if progress:
            progress("backproject", 0, total)
        for first, last in blocks:
            tiles, orders = tiling.bands(first, last)
            sizes = tiling.tile_sizes(first, last)
            pixels = tiles.n_tiles * tiles.per_tile
            image, missed = device.zeros(16 * pixels), device.zeros(4 * tiles.n_tiles)
            references = device.upload(cl.wide(tiles.references.T))
            offsets = device.upload(tiles.offsets)
            radius = device.upload(tiles.radius.astype(np.float32))
            clock.lap("prepare")
            for start in range(0, raw.n_rows, rows):
                stop = min(start + rows, raw.n_rows)
                weights = row_weight[start:stop, None] * sample_weight
                made = profiles.from_samples(
                    device, raw.read(start, stop), weights, self.plan.interpolator, self.plan.length
                )
                block = device.upload(made)
                pulse_host = self.antennas.packed(tiling.center, self.plan.length, start, stop, self.lanes)
                pulse, n = device.upload(pulse_host), pulse_host.shape[2]
                clock.lap("profiles")
                at_once = int(min(budget / 4, device.info.max_alloc) / (4 * self.components * n))
                step = max(1, min(tiles.n_tiles, at_once))
                constants = device.empty(4 * self.components * n * step)
                for tile in range(0, tiles.n_tiles, step):
                    count = min(step, tiles.n_tiles - tile)
                    device.run(
                        self.constants, (n // self.lanes, count), None,
                        pulse, references, radius, n, tiles.n_tiles, tile, int(self.skip), constants,
                    )  # fmt: skip
                    items = tiles.per_tile // self.lanes // VECTORS
                    device.run(
                        self.kernel, (items, count), (items, 1) if items <= self.group else None,
                        block, stride, stride // 2, self.table, pulse, n, stop - start, constants, references,
                        tiles.n_tiles, tile, offsets, tiles.offsets.shape[1],
                        0 if tiles.shared else tiles.per_tile // self.lanes, image, np.uint64(pixels), missed,
                    )  # fmt: skip
                device.finish()
                clock.lap("backproject")
                done += stop - start
                if progress:
                    progress("backproject", done, total)
            sums = device.download(image, np.empty((4, pixels), np.float32))
            values = (sums[0] + sums[2]) + 1j * (sums[1] + sums[3])
            tiling.place(values.astype(np.complex64), first, last, orders, target.flat)
            missed_host = device.download(missed, np.empty(tiles.n_tiles, np.int32))
            skipped += int((missed_host.astype(np.int64) * sizes).sum())
            clock.lap("write")
        target.finish()
        return skipped

    def _image_blocks(self, nbytes: float) -> list[tuple[int, int]]:
        """Runs of bands whose four planes of float32 fit in nbytes."""
        blocks, first = [], 0
        for band in range(self.tiling.n_bands):
            if band > first and 16 * self.tiling.pixels(first, band + 1) > nbytes:
                blocks.append((first, band))
                first = band
        return [*blocks, (first, self.tiling.n_bands)]


def _measure_error(
    raw: PhaseHistory, grid: ImageGrid, sample_weight: np.ndarray, row_weight: np.ndarray, wrap: bool, data: Any
) -> float:
    """Relative error at up to 256 random pixels against the exact float64 sum, as the contract defines it."""
    from .reference.backproject import backproject as exact

    picked = np.sort(np.random.default_rng(0).choice(grid.size, min(256, grid.size), replace=False))
    index = np.unravel_index(picked, grid.shape)
    positions = grid.at(*index) if grid.listed is None else grid.listed[index]
    wanted, spread = exact(raw, positions, sample_weight, row_weight, wrap)
    got = (
        np.asarray(data)[index]
        if isinstance(data, np.ndarray)
        else np.array([data[i] for i in zip(*index, strict=True)])
    )
    wrong, scale = float(np.linalg.norm(got - wanted)), max(float(np.linalg.norm(wanted)), spread)
    return wrong / scale if wrong else 0.0
