"""Gradients of Re <y, A x> with respect to amplitudes and to everything that moves, by the kernels of A in float64."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

import numpy as np

from ..base import wgs84
from ..imaging.engine import RowProfiles
from ..imaging.float64.plan import CHUNK
from ..imaging.pixel_taper import WEIGHT_BUFFERS
from ..opencl.launch_numbers import launch_numbers
from ._float64_pair import ROWS, TransposedImage
from ._measurement import Measurement

Kind = Literal["amplitudes", "positions", "heights", "tx", "rx", "reference_range", "phase", "pointing"]
KINDS: tuple[Kind, ...] = ("amplitudes", "positions", "heights", "tx", "rx", "reference_range", "phase", "pointing")
BOTH = 3  # TOWARDS of kernels/point_path_float64.clh: the mean of the unit vectors to both antennas


class Gradients:
    """d Re <y, A x> of one operator, where <y, z> = sum conj(y) z, and A as `pair` computes it.

    With kappa = 2 f/c, half paths delta, s = A x, and unit vectors e from points to antennas:

        amplitudes        A.H y, complex: d = Re <A.H y, dx>
        positions         -Re x conj(sum_pn j 2 pi kappa m y exp(+j 2 pi kappa delta) (e_T + e_R)/2)
        tx, rx            Re sum_n conj(y) (-j 2 pi kappa) m sum_k x exp(-j 2 pi kappa delta) e/2
        reference_range   Re sum_n conj(y) j 2 pi kappa s;   phase  Re sum_n conj(y) j s, of s exp(j phase)
    """

    def __init__(self, pair: TransposedImage, measurement: Measurement, budget: float) -> None:
        self.pair, self.measurement, self.budget = pair, measurement, budget
        plan, self.slope = pair.plan, measurement.slope
        self.profiles = RowProfiles(pair.device, pair.task, plan.interpolator, plan.length, dtype=np.complex128)

    def of(self, x: np.ndarray, y: np.ndarray, kinds: Sequence[Kind]) -> dict[str, np.ndarray]:
        """The gradients of each kind but "amplitudes", for x (n,) and y (n_rows, n_samples), complex128."""
        out: dict[str, np.ndarray] = {}
        if {"positions", "heights"} & {*kinds}:
            weighted = self.slope * self.measurement.weighted(y)
            positions = -(x.conj() * self._directed_image(weighted)).real.T
            of_height = {"heights": positions @ self._up(), "positions": positions}
            out |= {kind: of_height[kind] for kind in of_height if kind in kinds}
        weighted = y.conj() * self.measurement.weighted(self.slope)
        for kind, towards in (("tx", 1), ("rx", 2)):
            if kind in kinds:
                moved = np.einsum("pn,ipn->pi", weighted, self.pair(x, towards)).real
                out[kind] = -moved if self._is_one_antenna else -moved / 2
        if {"reference_range", "phase"} & {*kinds}:
            terms = y.conj() * self.measurement.weighted(self.pair(x))
            of_row = {"reference_range": (self.slope * terms).sum(axis=1).real, "phase": -terms.sum(axis=1).imag}
            out |= {kind: of_row[kind] for kind in of_row if kind in kinds}
        return out

    @property
    def _is_one_antenna(self) -> bool:
        """Whether the receiver moves with the transmitter."""
        return self.measurement.task.raw.rx is self.measurement.task.raw.tx

    def _up(self) -> np.ndarray:
        """Unit vector (3,) along which heights are counted."""
        grid = self.measurement.task.grid
        if grid.x_axis is not None and grid.y_axis is not None:
            return np.cross(grid.x_axis, grid.y_axis)
        vertical = wgs84.vertical_at(grid.bounds.mean(axis=0))
        return np.array([0.0, 0.0, 1.0]) if vertical is None else vertical

    def _directed_image(self, samples: np.ndarray) -> np.ndarray:
        """Images (3, n) of samples whose rows are weighted, pixel by pixel, with the mean of the unit vectors to both
        antennas along x, y and z."""
        pair, task, device = self.pair, self.pair.task, self.pair.device
        self.measurement.samples.array = samples
        kernel = device.kernel("backproject_float64.cl", "backproject", **pair.macros, CHUNK=CHUNK, TOWARDS=BOTH)
        pixels, stride = pair.n_tiles * pair.per_tile, self.profiles.stride
        image, missed = device.zeros(3 * 32 * pixels), device.zeros(8 * pair.n_tiles)
        at_once = max(1, min(ROWS, self.profiles.rows_in(self.budget / 4)))
        vectors = pair.per_tile // pair.lanes
        group = (vectors, 1) if vectors <= device.max_group(kernel) else None
        with self.profiles.pipeline as pipeline:
            for start in range(0, task.raw.n_rows, at_once):
                stop = min(start + at_once, task.raw.n_rows)
                pipeline.new_block()
                block = self.profiles.upload(start, stop)
                weights = pair.taper.arguments(pair.apertures, start, stop) or WEIGHT_BUFFERS * (pair.table,)
                for pulse, n, first, constants, n_run in pair.records((start, stop)):
                    numbers = {"n": n, "n_used": stop - start, "n_tiles": pair.n_tiles, "first": first}
                    launch = launch_numbers(
                        "backproject_float64.cl",
                        "backproject",
                        pixels=pixels,
                        stride=stride,
                        origin=stride // 2,
                        **numbers,
                    )
                    buffers = block, pair.table, pulse, constants, pair.tile, pair.positions, image, missed
                    device.run(kernel, (vectors, n_run), group, launch, *buffers, *weights, steps=stop - start)
                    device.finish()
                pipeline.step()
        sums = device.download(image, np.empty((3, 2, 2, pixels)))
        re, im = (sums[:, 0] + sums[:, 1]).swapaxes(0, 1)
        out = np.zeros((3, task.grid.size), np.complex128)
        out[:, pair.pixels] = (re + 1j * im)[:, pair.lane_of]
        return out
