"""Fields on a device, and their time steps: the vacuum update with absorbing layers, then the corrections of lists.

Step n takes H from n - 1/2 to n + 1/2, and E from n to n + 1. Every update and every correction of a plane needs that
plane and its neighbours alone, so that a block of steps can be done tile by tile: the result is the same, bit by bit.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from ..opencl.device import Device
from ._absorber import layers
from ._incident import WaveTable, entrances
from ._lists import BLOCK, IncidentList, TargetList
from .lattice import COURANT, LANES, Lattice
from .target import Target

ROWS = 8  # rows per work-item on a CPU
TILE = 16  # planes per tile on a CPU


def tiles(n_planes: int, n_steps: int, width: int) -> Iterator[tuple[int, tuple[int, int]]]:
    """Step and range of planes of a block of steps, in launch order; `width` planes per tile.

    A tile moves down by one plane from step to step: H needs E of the plane after, of the step before, and E needs H of
    the plane before.
    """
    for low in range(0, n_planes + n_steps - 1, width):
        for step in range(n_steps):
            first, last = max(low - step, 0), min(low + width - step, n_planes)
            if first < last:
                yield step, (first, last)


class Fields:
    """E and H of a grid on a device, with everything that is not vacuum.

    absorber  layers on each side, at most LANES; 0: the grid ends at its walls (kernels/fdtd.clh)
    wave      an incident wave
    tile      planes per tile; None: TILE on CPUs, whose caches hold the planes from step to step, and all on GPUs
    """

    def __init__(
        self, device: Device, lattice: Lattice, target: Target, *, absorber: int = 0, wave: WaveTable | None = None,
        tile: int | None = None,
    ) -> None:  # fmt: skip
        self.device, self.lattice = device, lattice
        self._tile = tile or (TILE if device.is_cpu else lattice.shape[0] + BLOCK)
        self.lanes = LANES if device.info.vector_width > 1 else 1
        self.step = 0  # steps that are done
        self._update = [
            device.kernel("fdtd_vacuum.cl", name, LANES=self.lanes, ABSORB=int(absorber > 0))
            for name in ("update_e", "update_h")
        ]
        self._edges, self._faces, self._incident, self._transform = (
            self._kernel("fdtd_lists.cl", name) for name in ("edges", "faces", "incident", "transform")
        )
        self.e, self.h = (device.zeros(12 * lattice.component) for _ in range(2))
        self.edges = TargetList(device, lattice, target.edges, target.share)
        self.faces = TargetList(device, lattice, target.faces, target.weight)
        self._thickness, self._layers = absorber, layers(device, lattice, absorber)
        self._wave, self._wave_steps, self._wave_values = None, 0, 0
        self._loud: list[list[int]] = []
        self._entrances: tuple[list[IncidentList], list[IncidentList]] = [], []
        if wave is not None:
            parts = entrances(lattice, wave.low, wave.high)
            for magnetic in (False, True):
                self._entrances[magnetic].extend(
                    IncidentList(device, lattice, p, wave, magnetic) for p in parts[magnetic]
                )
            self._wave, self._loud = device.copied(wave.values), wave.loud.tolist()
            self._wave_steps, self._wave_values = len(wave.values), wave.values[0].size

    def _kernel(self, file: str, name: str) -> Any:
        return self.device.kernel(file, name, LANES=self.lanes)

    def advance(self, n_steps: int) -> None:
        """Do up to BLOCK steps. The residuals of the lists are those of these steps afterwards."""
        grid = self.lattice
        for step, planes in tiles(grid.shape[0], n_steps, self._tile):
            self._vacuum_step(step, planes, magnetic=True)
            self.faces.correct(
                self._faces, (self.e, self.h), step, planes, grid.component, grid.plane, grid.row, np.float32(COURANT)
            )
            self._vacuum_step(step, planes, magnetic=False)
            self.edges.correct(self._edges, (self.e,), step, planes)
        self.step += n_steps

    def _vacuum_step(self, step: int, planes: tuple[int, int], magnetic: bool) -> None:
        """The vacuum update of one field, with its absorbing layers, and its incident wave."""
        grid, vectors = self.lattice, self.lattice.shape[2] // self.lanes
        each, columns = (ROWS, 1) if self.device.is_cpu else (1, vectors)
        self.device.run(
            self._update[magnetic], (columns, -(-grid.shape[1] // each), planes[1] - planes[0]), None, self.e, self.h,
            *self._layers[magnetic], self._thickness, grid.component, grid.start, grid.plane, grid.row, *grid.shape[:2],
            vectors, each, np.float32(COURANT), planes[0],
        )  # fmt: skip
        if self.step + step < self._wave_steps:
            at, loud = (self.step + step) * self._wave_values, self._loud[self.step + step]
            for part in self._entrances[magnetic]:
                part.correct(self._incident, self.h if magnetic else self.e, self._wave, at, loud, planes)

    def transform(self, part: TargetList, phase: Any, sums: Any, first: int, n_steps: int, n_frequencies: int) -> None:
        """Add the residuals of the last steps to their sums over time; see kernels/fdtd_lists.cl."""
        self.device.run(
            self._transform, (part.count // self.lanes,), None, part.residual, phase, sums, part.count, first,
            n_steps, n_frequencies,
        )  # fmt: skip

    def download(self) -> tuple[np.ndarray, np.ndarray]:
        """Copies of E and of H times the impedance of vacuum, float32 (3, *shape) each."""
        contents = np.empty((2, 3 * self.lattice.component), np.float32)
        for buffer, out in zip((self.e, self.h), contents, strict=True):
            self.device.download(buffer, out)
        e, h = (self.lattice.from_buffer(out) for out in contents)
        return e, h

    def start(self, e: np.ndarray, h: np.ndarray) -> None:
        """Set E and H, (3, *shape) each."""
        for buffer, values, part in ((self.e, e, self.edges), (self.h, h, self.faces)):
            self.device.write(buffer, self.lattice.to_buffer(values))
            part.start(values)
