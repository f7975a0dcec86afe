"""Both directions in float64: `DirectFloat64` of images, and its transpose, with the same records, taps and phases."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial

import numpy as np

from ..base.errors import ToleranceUnreachable
from ..base.morton import morton_order
from ..imaging.antenna_beam import rounding
from ..imaging.choose_method import in_float64
from ..imaging.float64.direct import N_CONST, by_range, packed, remedy, weights_on
from ..imaging.float64.plan import SIDES, Float64Plan
from ..imaging.method_choice import MethodChoice
from ..imaging.pixel_taper import WEIGHT_BUFFERS
from ..imaging.tiling.of_grid import tiling_of
from ..model.waveform import Waveform
from ..numerics import range_profiles
from ..numerics.error_bounds import range_error_float64
from ..opencl.device import Buffer, Device
from ..opencl.launch_numbers import launch_numbers
from ..simulation.kernel_images import PatchSamples, sample_patches
from ._measurement import Measurement

FLOAT64 = 2.0**-27  # rounding of gains in float64 over that in float32, with the error of sines, 4e-15
LEAST_SHARE = 2.0**-20  # of a tolerance: no plan is looked for below it where images of the kernel add up
ROWS = 256  # rows whose profiles are on the device at a time


def choice_of(measurement: Measurement, tolerance: float, known: TransposedImage | None) -> MethodChoice:
    """The cheapest plan with which both directions meet the tolerance. ToleranceUnreachable where there is none.

    known  pair for a similar geometry, whose plan is taken where it meets the tolerance
    The error of an image is that of the kernel; of echoes the kernel's images add up where pixels lie evenly. Gains of
    an antenna have the rounding of float64, for which what is left of a tolerance is taken.
    """
    task = measurement.task
    gains = 0.0 if task.antenna is None else FLOAT64 * rounding(task, tiling_of(task.grid, SIDES[0]).radius)
    moved = None if known is None else _moved(measurement, known)
    if moved is not None and moved.predicted_error <= tolerance:
        return moved
    patches, share = _patches(measurement), 1.0
    bandwidth = float(task.raw.bandwidth.max())
    while True:
        choice = in_float64(task, share * (tolerance - gains))
        if not isinstance(choice, MethodChoice):
            raise choice.restated(tolerance, None) if share < 1 else choice
        plan = choice.plan
        assert isinstance(plan, Float64Plan)
        images = patches.error(plan.interpolator, plan.length, task.raw.n_samples, bandwidth)
        error = choice.predicted_error + max(images - plan.interpolator.error, 0) + gains
        if error <= tolerance:
            return replace(choice, predicted_error=error)
        share /= 2
        if share < LEAST_SHARE:
            how = "with pixels that lie so evenly: the images of the interpolation kernel add up"
            raise ToleranceUnreachable(tolerance, None, "float64 range profiles", "take a larger tolerance", how)


def _moved(measurement: Measurement, known: TransposedImage) -> MethodChoice | None:
    """The choice of another pair, with the error that its ranges have in this geometry. None: it has other pixels."""
    task, plan, tiling = measurement.task, known.plan, known.tiling
    if task.grid.size != tiling.grid.size or task.raw.n_samples != known.task.raw.n_samples:
        return None
    new_tiling = tiling_of(task.grid, tiling.side)
    before, now = (
        range_error_float64(tiles.radius, of.antennas.distance(of.grid.bounds), of.highest, plan.order)
        for tiles, of in ((tiling, known.task), (new_tiling, task))
    )
    return replace(known.choice, tiling=new_tiling, predicted_error=known.predicted_error + max(now - before, 0.0))


def _patches(measurement: Measurement) -> PatchSamples:
    """Samples of pixels of equal amplitudes, from which the images of a kernel are measured."""
    antennas, raw = measurement.task.antennas, measurement.task.raw
    center, bandwidth = float(np.median(antennas.frequency)), float(raw.bandwidth.max())
    band, positions = Waveform.chirp(center=center, bandwidth=bandwidth, duration=1 / bandwidth), measurement.positions
    alike = np.ones((len(positions), 1), np.complex128)
    return sample_patches(positions, morton_order(positions), antennas, band, lambda some, *_: alike[some])


class TransposedImage:
    """Echoes of the pixels: the transpose of the image that DirectFloat64 makes by a plan.

    macros   of the kernels, and  table  of the interpolator;  taper, apertures  windows over the aperture of each pixel
    pixels   numbers of those that have a position, and  lane_of  where each lies among the tiles
    tile, positions  reference points of the tiles and positions of their points: buffers
    """

    dtype = np.complex128

    def __init__(self, device: Device, measurement: Measurement, choice: MethodChoice, budget: float) -> None:
        if not device.info.fp64:
            raise ValueError(f"exact=True needs float64, as gradients do, which {device.info.name!r} lacks: {remedy()}")
        plan, tiling = choice.plan, choice.tiling
        assert isinstance(plan, Float64Plan)
        self.device, self.task, self.plan, self.tiling, self.budget = device, measurement.task, plan, tiling, budget
        self.choice, self.predicted_error, self.lanes = choice, choice.predicted_error, device.info.vector_width
        task = self.task
        geometry = {"BISTATIC": int(not task.antennas.is_monostatic), "BEAM": int(task.antennas.beam is not None)}
        self._constants = device.kernel("tile_constants_float64.cl", "tile_constants", **geometry)
        self.taper = weights_on(device, task)
        self.macros = {**geometry, **plan.macros(task.wrap), **self.taper.macros}
        del self.macros["CHUNK"]
        self.pad = range_profiles.padding(plan.interpolator)
        self.table = device.upload(plan.interpolator.table)
        self._place_pixels()

    def _place_pixels(self) -> None:
        """Tiles of the pixels, sorted as DirectFloat64 sorts them."""
        raw, tiling, run = self.task.raw, self.tiling, (0, self.tiling.n_bands)
        orders, middle = tiling.bands(*run)[1], raw.n_rows // 2
        positions, order = by_range(tiling.positions(*run, orders), raw.tx[middle], raw.rx[middle])
        numbers, flat = np.empty(positions.shape[:2], np.int64), np.full(tiling.grid.size, -1, np.int64)
        np.put_along_axis(numbers, order, np.arange(numbers.size).reshape(numbers.shape), axis=1)
        shaped = flat.reshape(tiling.grid.shape) if tiling.in_rows else flat
        tiling.place(numbers.ravel(), run, 0, orders, shaped)
        empty = tiling.grid.empty if self.task.grid.empty is None else self.task.grid.empty
        self.pixels = np.arange(flat.size) if empty is None else np.flatnonzero(~empty.ravel())
        self.lane_of = flat[self.pixels]
        references = (positions.min(axis=1) + positions.max(axis=1)) / 2
        radius = np.linalg.norm(positions - references[:, None], axis=-1).max(axis=-1)
        self.n_tiles, self.per_tile = positions.shape[:2]
        upload = self.device.upload
        self.tile, self._reach = upload(references.T), upload(radius)
        self.positions = upload(positions.reshape(-1, 3).T)
        self.apertures = self.taper.apertures(positions)

    def on_device(self, amplitudes: np.ndarray) -> Buffer:
        """Amplitudes (n,) of all pixels in the order of the tiles, re and im (2, pixels)."""
        lanes = np.zeros((2, self.n_tiles * self.per_tile))
        lanes[:, self.lane_of] = amplitudes[self.pixels].real, amplitudes[self.pixels].imag
        return self.device.upload(lanes)

    @property
    def splits(self) -> int:
        """Work-items for each row."""
        units, n_rows = self.device.info.units, self.task.raw.n_rows
        return int(np.clip(4 * units // min(ROWS, n_rows), 1, min(self.n_tiles, 64)))

    def rows_of(self, amplitudes: np.ndarray) -> Callable[[int, int], np.ndarray]:
        """What makes samples (stop - start, n_samples) complex128 of rows start ... stop - 1: of amplitudes (n,) of
        all pixels."""
        return partial(self._rows, self.on_device(amplitudes))

    def _rows(self, values: Buffer, first: int, last: int) -> np.ndarray:
        device, raw, splits, interpolator = self.device, self.task.raw, self.splits, self.plan.interpolator
        stride, out = self.plan.length + 2 * self.pad, np.empty((last - first, raw.n_samples), np.complex128)
        row_bytes = 16 * stride * splits
        at_once = max(1, min(ROWS, int(self.budget / 2 / row_bytes), int(device.info.max_alloc / row_bytes)))
        for start in range(first, last, at_once):
            stop = min(start + at_once, last)
            rows = device.zeros(row_bytes * (stop - start))
            self.by_rows("spread_float64.cl", "spread", (start, stop), (), values, rows)
            profiles = np.empty((splits, stop - start, stride), np.complex128)
            device.download(rows, profiles)
            of_rows = range_profiles.to_samples(device, profiles.sum(axis=0), raw.n_samples, interpolator)
            out[start - first : stop - first] = of_rows
        return out

    def by_rows(
        self, file: str, name: str, block: tuple[int, int], profiles: tuple[Buffer, ...], values: Buffer, out: Buffer
    ) -> None:
        """Run a kernel that adds all tiles to what each row of a block has; profiles  its first buffers."""
        device, stride = self.device, self.plan.length + 2 * self.pad
        kernel = device.kernel(file, name, **self.macros)
        weights = self.taper.arguments(self.apertures, *block) or WEIGHT_BUFFERS * (self.table,)
        for pulse, n, first, constants, n_run in self.records(block):
            numbers = {"n": n, "n_used": block[1] - block[0], "n_tiles": self.n_tiles, "first": first, "n_run": n_run}
            numbers |= {"stride": stride, "origin": stride // 2, "vectors": self.per_tile // self.lanes}
            launch = launch_numbers(file, name, pixels=self.n_tiles * self.per_tile, **numbers)
            group = (1, 1) if device.is_cpu else None
            buffers = *profiles, self.table, pulse, constants, self.tile, self.positions, values, out, *weights
            steps = n_run * self.per_tile / self.splits
            device.run(kernel, (block[1] - block[0], self.splits), group, launch, *buffers, steps=steps)
        device.finish()

    def records(self, block: tuple[int, int]) -> Iterator[tuple[Buffer, int, int, Buffer, int]]:
        """For each run of tiles: pulses of the block on the device, their number with padding, the first tile, the
        records of these tiles and pulses, and the number of tiles."""
        device, task = self.device, self.task
        host = packed(task.raw, task.antennas, self.plan.length, *block, self.lanes)
        pulse, n = device.upload(host), host.shape[1]
        step = max(1, min(self.n_tiles, int(min(self.budget / 4, device.info.max_alloc) / (8 * N_CONST * n))))
        constants = device.empty(8 * N_CONST * n * step)
        skips = {"skip": task.skip_flags, "wrap": self.plan.length if task.wrap else 0}
        for first in range(0, self.n_tiles, step):
            n_run = min(step, self.n_tiles - first)
            numbers = launch_numbers(
                "tile_constants_float64.cl", "tile_constants", n=n, n_tiles=self.n_tiles, first=first, **skips
            )
            size = n // self.lanes, n_run
            device.run(self._constants, size, None, numbers, pulse, self.tile, self._reach, constants)
            yield pulse, n, first, constants, n_run
