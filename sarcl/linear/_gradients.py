"""Gradients of Re <y, A x> with respect to amplitudes and to everything that moves, by the kernels of A in float64."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from typing import Literal

import numpy as np

from ..base import wgs84
from ..imaging.engine import RowProfiles
from ..imaging.float64.plan import CHUNK
from ..imaging.pixel_taper import WEIGHT_BUFFERS
from ..opencl.device import Buffer
from ..opencl.launch_numbers import launch_numbers
from ._float64_pair import ROWS, TransposedImage
from ._measurement import Measurement

Kind = Literal["amplitudes", "positions", "heights", "tx", "rx", "reference_range", "phase", "pointing"]
KINDS: tuple[Kind, ...] = ("amplitudes", "positions", "heights", "tx", "rx", "reference_range", "phase", "pointing")
# of a row, where the sums of kernels/row_gradients_float64.cl have them
PLACES: dict[Kind, int | slice] = {
    "phase": 0,
    "reference_range": 1,
    "tx": slice(2, 5),
    "rx": slice(5, 8),
    "pointing": slice(8, 11),
}
SUMS = 11


class Gradients:
    """d Re <y, A x> of one operator, where <y, z> = sum conj(y) z, and A as `pair` computes it.

    With b the image of y in one row, b' that of j 2 pi kappa y, kappa = 2 f/c, z = x conj(b), z' = x conj(b'), gains G,
    and unit vectors e from points to antennas:

        amplitudes        A.H y, complex: d = Re <A.H y, dx>
        positions         -Re sum_p z' G (e_T + e_R)/2 + z (dG/dT + dG/dR)
        tx, rx             Re sum_x z' G e/2 + z dG/dT
        reference_range   -Re sum_x z' G;   phase  -Im sum_x z G, of s exp(j phase)
        pointing           Re sum_x z dG/d rotation
    """

    def __init__(self, pair: TransposedImage, measurement: Measurement, budget: float) -> None:
        self.pair, self.measurement, self.budget = pair, measurement, budget
        plan, self.slope = pair.plan, measurement.slope
        self.profiles = RowProfiles(pair.device, pair.task, plan.interpolator, plan.length, dtype=np.complex128)

    def of(self, x: np.ndarray, y: np.ndarray, kinds: Collection[Kind]) -> dict[str, np.ndarray]:
        """The gradients of each kind but "amplitudes", for x (n,) and y (n_rows, n_samples), complex128."""
        out: dict[str, np.ndarray] = {}
        weighted = self.measurement.weighted(y)
        if {"positions", "heights"} & {*kinds}:
            positions = (x.conj() * self._directed_image(weighted)).real.T
            out = {"heights": positions @ self._up(), "positions": positions}
        if PLACES.keys() & {*kinds}:
            sums = self._sums_of_rows(x, weighted)
            out |= {kind: sums[:, place] for kind, place in PLACES.items()}
            if self.measurement.task.raw.rx is self.measurement.task.raw.tx:  # one antenna
                out["tx"] = out["tx"] + out["rx"]
        return {kind: np.ascontiguousarray(out[kind]) for kind in kinds if kind in out}

    def _up(self) -> np.ndarray:
        """Unit vector (3,) along which heights are counted."""
        grid = self.measurement.task.grid
        if grid.x_axis is not None and grid.y_axis is not None:
            return np.cross(grid.x_axis, grid.y_axis)
        vertical = wgs84.vertical_at(grid.bounds.mean(axis=0))
        return np.array([0.0, 0.0, 1.0]) if vertical is None else vertical

    def _blocks(self, samples: np.ndarray) -> Iterator[tuple[tuple[int, int], tuple[Buffer, Buffer]]]:
        """Blocks of rows, and the profiles of samples times j 2 pi kappa and of samples."""
        n_rows, both = self.pair.task.raw.n_rows, (samples * self.slope, samples)
        at_once = max(1, min(ROWS, self.profiles.rows_in(self.budget / 8)))
        with self.profiles.pipeline as pipeline:
            for start in range(0, n_rows, at_once):
                stop = min(start + at_once, n_rows)
                pipeline.new_block()
                buffers = []
                for array in both:
                    self.measurement.samples.array = array
                    buffers.append(self.profiles.upload(start, stop))
                yield (start, stop), (buffers[0], buffers[1])
                pipeline.step()

    def _sums_of_rows(self, x: np.ndarray, samples: np.ndarray) -> np.ndarray:
        """Sums (n_rows, SUMS) over all points, of what PLACES has."""
        pair, device = self.pair, self.pair.device
        out, values = np.empty((pair.task.raw.n_rows, SUMS)), pair.on_device(x)
        for (start, stop), profiles in self._blocks(samples):
            sums = device.zeros(8 * SUMS * pair.splits * (stop - start))
            pair.by_rows("row_gradients_float64.cl", "row_gradients", (start, stop), profiles, values, sums)
            out[start:stop] = device.download(sums, np.empty((pair.splits, stop - start, SUMS))).sum(axis=0)
        return out

    def _directed_image(self, samples: np.ndarray) -> np.ndarray:
        """Images (3, n) along x, y and z, of which Re conj(x) times each is the gradient by the places of points."""
        pair, task, device = self.pair, self.pair.task, self.pair.device
        kernel = device.kernel("backproject_float64.cl", "backproject", **pair.macros, CHUNK=CHUNK, GRADIENT=1)
        pixels, stride = pair.n_tiles * pair.per_tile, self.profiles.stride
        image, missed = device.zeros(3 * 32 * pixels), device.zeros(8 * pair.n_tiles)
        vectors, numbers = pair.per_tile // pair.lanes, {"pixels": pixels, "stride": stride, "origin": stride // 2}
        group = (vectors, 1) if vectors <= device.max_group(kernel) else None
        for (start, stop), (block, plain) in self._blocks(samples):
            weights = pair.taper.arguments(pair.apertures, start, stop) or WEIGHT_BUFFERS * (pair.table,)
            for pulse, n, first, constants, n_run in pair.records((start, stop)):
                of_run = {"n": n, "n_used": stop - start, "n_tiles": pair.n_tiles, "first": first}
                launch = launch_numbers("backproject_float64.cl", "backproject", **numbers, **of_run)
                buffers = block, pair.table, pulse, constants, pair.tile, pair.positions, image, missed
                device.run(kernel, (vectors, n_run), group, launch, *buffers, *weights, plain, steps=stop - start)
                device.finish()
        sums = device.download(image, np.empty((3, 2, 2, pixels)))
        re, im = (sums[:, 0] + sums[:, 1]).swapaxes(0, 1)
        out = np.zeros((3, task.grid.size), np.complex128)
        out[:, pair.pixels] = (re + 1j * im)[:, pair.lane_of]
        return out
