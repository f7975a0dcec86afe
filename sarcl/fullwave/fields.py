"""Fields on a device, and their time steps: the vacuum update with absorbing layers, then the corrections of lists.

Step n takes H from n - 1/2 to n + 1/2, and E from n to n + 1. Every update and every correction of a plane needs that
plane and its neighbours alone, so that a block of steps can be done tile by tile: the result is the same, bit by bit.
"""

from __future__ import annotations

from collections.abc import Iterator
from math import prod
from typing import Any

import numpy as np

from ..opencl.device import Buffer, Device
from ..opencl.launch_numbers import launch_numbers
from ._lists import SAMPLES, CoupledList, IncidentList, TargetList, heard
from .absorber import layers
from .incident import COMPONENTS, SILENT, WaveTable, entrances
from .lattice import COURANT, LANES, ROWS, Lattice
from .target import Target

BLOCK = 8  # steps of a block, which is done tile by tile
PERIODS = (8, 4, 2)  # steps between two samples of the residuals, where the pulse allows (currents:sample_period)
TILE = 16  # planes per tile on a CPU
EACH = 4  # cells per work-item of an update on a GPU, along x
GROUP = (32, 4, 1)  # work-items of an update that work together on a GPU: 4 pieces of rows beside each other
WAVE_STEPS = 64  # steps of the incident wave that are on the device at a time: a multiple of BLOCK
VECTORS = 16  # vectors per work-item of a transform on a CPU
ITEMS = 4096  # work-items of a transform on a GPU
LEAST_Z = 1e-6  # component along z of the direction of a wave across z, for kernels, which divide by it


def tiles(n_planes: int, n_steps: int, width: int, ahead: int = 0) -> Iterator[tuple[int, bool, tuple[int, int]]]:
    """Step, field (True: H) and range of planes of a block of steps, in launch order; `width` planes per tile.

    A tile moves down by one plane from step to step: H needs E of the plane after, of the step before, and E needs H of
    the plane before. Where E needs H of the plane after, too (coupled edges), H is one plane ahead, and a tile moves
    down by two.
    """
    down = 1 + ahead
    for low in range(0, n_planes + down * (n_steps - 1), width):
        for step in range(n_steps):
            for magnetic in (True, False):
                move = ahead * magnetic - down * step
                first, last = max(low + move, 0) if low else 0, min(low + width + move, n_planes)
                if first < last:
                    yield step, magnetic, (first, last)


class Fields:
    """E and H of a grid on a device, with everything that is not vacuum.

    absorber  layers on each side, at most LANES; 0: the grid ends at its walls (kernels/fdtd.clh)
    wave      an incident wave; cells that it has not reached are not updated, unless fields are given by `start`
    tile      planes per tile; None: TILE on CPUs, whose caches hold the planes from step to step, and all on GPUs
    every     residuals are kept at every so many steps, from step number every - 1 on; 1, 2, 4 or 8
    """

    def __init__(
        self, device: Device, lattice: Lattice, target: Target, *, absorber: int = 0, wave: WaveTable | None = None,
        tile: int | None = None, every: int = 1,
    ) -> None:  # fmt: skip
        self.device, self.lattice = device, lattice
        self.lanes = LANES if device.info.vector_width > 1 else 1
        self._rows_are_items = self.lanes > 1  # else each cell and each entry of a list is a work-item
        self._tile = tile or (TILE if self._rows_are_items else lattice.shape[0] + BLOCK)
        self._every = every
        self.step = 0  # steps that are done
        self._update = [
            device.kernel(
                "fdtd_vacuum.cl", name, LANES=self.lanes, ABSORB=int(absorber > 0), LISTS=int(self._rows_are_items)
            )
            for name in ("update_e", "update_h")
        ]
        allowed = min(map(device.max_group, self._update))
        self._group = None if self._rows_are_items or allowed < prod(GROUP) else GROUP
        self._edges, self._faces, self._enter, self._transform = (
            device.kernel("fdtd_lists.cl", name, LANES=self.lanes)
            for name in ("edges", "faces", "incident", "transform")
        )
        self.e, self.h = (device.zeros(12 * lattice.component) for _ in range(2))
        self.edges = TargetList(device, lattice, target.edges, target.share)
        self.faces = TargetList(device, lattice, target.faces, target.weight)
        self._coupled = CoupledList(device, lattice, target, self.edges)
        self._keep = target.keep
        self._couple = device.kernel("fdtd_coupled.cl", "couple") if self._coupled.count else None
        self._thickness, self._layers = absorber, layers(device, lattice, absorber)
        resting = np.zeros((*lattice.shape[:2], 2), np.uint16)
        if target.resting is not None:
            resting[target.resting[:, 0], target.resting[:, 1]] = target.resting[:, 2:]
        self._resting = device.copied(resting)
        parts = entrances(lattice, wave.low, wave.high) if wave else ([], [])
        self._entrances = [IncidentList(device, lattice, parts[m], wave, magnetic=bool(m)) for m in (0, 1)]
        self._wave = wave
        self._dark = wave is not None  # fields are zero beyond the front of the wave
        travel = np.array([0, 0, 1.0]) if wave is None else wave.wave.travel
        along_z = travel[2] if abs(travel[2]) > LEAST_Z else LEAST_Z
        self._travel = *travel[:2], along_z
        self._wave_first, self._loud, self._front = -WAVE_STEPS, [SILENT], np.full(WAVE_STEPS, -np.inf)
        self._wave_values = device.zeros(4)

    def advance(self, n_steps: int) -> None:
        """Do up to BLOCK steps, which do not pass a multiple of BLOCK."""
        self._load_wave()
        ahead = int(self._coupled.count > 0)
        for step, magnetic, planes in tiles(self.lattice.shape[0], n_steps, self._tile, ahead):
            self._half_step(self.step + step, planes, magnetic)
        self.step += n_steps

    def _load_wave(self) -> None:
        """Have the next steps of the incident wave on the device."""
        wave, first = self._wave, self.step - self.step % WAVE_STEPS
        if wave is None or self.step < self._wave_first + WAVE_STEPS:
            return
        if first >= wave.n_steps:
            self._wave, self._dark, self._wave_values = None, False, self.device.zeros(4)
            return
        values = wave.values(first, WAVE_STEPS)
        loud = wave.loud(values)
        loud[wave.n_steps - first :] = SILENT
        self._wave_first, self._loud = first, loud.tolist()
        self._front = wave.fronts(loud, float(self._front[-1]))
        self._wave_values = self.device.copied(values)

    def _half_step(self, step: int, planes: tuple[int, int], magnetic: bool) -> None:
        """The update of one field in a range of planes, with its absorbing layers, its incident wave and its list."""
        grid, field, wave = self.lattice, self.h if magnetic else self.e, self._wave
        part, entrance = self.faces if magnetic else self.edges, self._entrances[magnetic]
        now = step - self._wave_first
        loud = self._loud[now] if wave else SILENT
        points = wave.n_points if wave else 0
        enters = {"u_at": now * COMPONENTS * points if wave else 0, "n_points": points, **heard(loud)}
        sample = step // self._every % SAMPLES if (step + 1) % self._every == 0 else None
        vectors = grid.shape[2] // self.lanes
        each: int = ROWS
        size: tuple[int, ...] = (1, grid.groups, planes[1] - planes[0])
        if not self._rows_are_items:
            each, items = EACH, (vectors, grid.shape[1], -(-(planes[1] - planes[0]) // EACH))
            size = tuple(-(-n // group) * group for n, group in zip(items, self._group or (1, 1, 1), strict=True))
        lists: tuple[Any, ...] = ()
        if self._rows_are_items:
            lists = entrance.rows, *entrance.arrays, self._wave_values, part.rows, *part.arrays
        self.device.run(
            self._update[magnetic], size, self._group,
            launch_numbers(
                "fdtd_vacuum.cl", "update", thick=self._thickness, component=grid.component, start=grid.start,
                plane=grid.plane, row=grid.row, n_planes=grid.shape[0], n_rows=grid.shape[1], n_vectors=vectors,
                each=each, first=planes[0], last=planes[1], s=COURANT, front=self._front[now] if self._dark else np.inf,
                along=self._travel, wave=loud != SILENT, conducts=part.conducts, **enters, **part.numbers(sample),
            ),
            self.e, self.h, *self._layers[magnetic], self._resting, *lists, steps=each,
        )  # fmt: skip
        if not self._rows_are_items:
            for first, last in entrance.spans(planes) if loud != SILENT else ():
                if first < last:
                    self.device.run(
                        self._enter,
                        (last - first,),
                        None,
                        launch_numbers("fdtd_lists.cl", "incident", first=first, **enters),
                        field,
                        *entrance.arrays,
                        self._wave_values,
                    )
            self._correct(part, sample, part.span(planes), magnetic)
        if not magnetic:
            self._add_coupled(sample, self._coupled.span(planes))

    def _add_coupled(self, sample: int | None, span: tuple[int, int]) -> None:
        """Add to E along coupled edges what depends on the edges across them."""
        if span[0] < span[1]:
            grid = self.lattice
            record = self.edges.numbers(sample)["record"]
            self.device.run(
                self._couple, (span[1] - span[0],), None,
                launch_numbers(
                    "fdtd_coupled.cl", "couple", n=self._coupled.count, first=span[0], record=record,
                    component=grid.component, plane=grid.plane, row=grid.row, s=COURANT, keep=self._keep,
                ),
                self.e, self.h, *self._coupled.arrays, *self.edges.kept,
            )  # fmt: skip

    def _correct(self, part: TargetList, sample: int | None, span: tuple[int, int], magnetic: bool) -> None:
        """Correct entries of the list of a target, each by a work-item."""
        if span[0] < span[1]:
            grid, size = self.lattice, (span[1] - span[0],)
            if magnetic:
                numbers = launch_numbers(
                    "fdtd_lists.cl", "faces", component=grid.component, plane=grid.plane, row=grid.row, s=COURANT,
                    first=span[0], **part.numbers(sample),
                )  # fmt: skip
                self.device.run(self._faces, size, None, numbers, self.e, self.h, *part.arrays)
            else:
                numbers = launch_numbers(
                    "fdtd_lists.cl", "edges", conducts=part.conducts, first=span[0], **part.numbers(sample)
                )
                self.device.run(self._edges, size, None, numbers, self.e, *part.arrays)

    def transform(
        self, part: TargetList, phase: Buffer, sums: Buffer, n_samples: int, n_frequencies: int
    ) -> np.ndarray:
        """Add the samples of the residuals to their sums over time (kernels/fdtd_lists.cl).

        Returns the sums over the list of |change|^2 and of |sum|^2, float64 (2, n_frequencies).
        """
        vectors = part.count // self.lanes
        if self._rows_are_items:
            items, begin, stride, each = -(-vectors // VECTORS), VECTORS, 1, VECTORS
        else:
            items = min(vectors, ITEMS)
            begin, stride, each = 1, items, -(-vectors // items)
        norms = self.device.empty(8 * n_frequencies * items)
        self.device.run(
            self._transform, (items,), None,
            launch_numbers(
                "fdtd_lists.cl", "transform", count=part.count, n_samples=n_samples, n_frequencies=n_frequencies,
                begin=begin, stride=stride, each=each,
            ),
            part.residual, phase, sums, norms,
        )  # fmt: skip
        out = self.device.download(norms, np.empty((2, n_frequencies, items), np.float32))
        return np.asarray(out.sum(axis=2, dtype=np.float64))

    def download(self) -> tuple[np.ndarray, np.ndarray]:
        """Copies of E and of H times the impedance of vacuum, float32 (3, *shape) each."""
        contents = np.empty((2, 3 * self.lattice.component), np.float32)
        for buffer, out in zip((self.e, self.h), contents, strict=True):
            self.device.download(buffer, out)
        e, h = (self.lattice.from_buffer(out) for out in contents)
        return e, h

    def start(self, e: np.ndarray, h: np.ndarray) -> None:
        """Set E and H, (3, *shape) each."""
        self._dark = False
        for buffer, values, part in ((self.e, e, self.edges), (self.h, h, self.faces)):
            self.device.write(buffer, self.lattice.to_buffer(values))
            part.start(values)
