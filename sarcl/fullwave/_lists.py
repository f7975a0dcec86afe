"""Lists of cells on a device: those of a target, and those where an incident wave enters."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..opencl.device import Device
from ._incident import AFTER, BEFORE, COMPONENTS, Entrance, WaveTable
from .lattice import LANES, Lattice, PlaneOrder

BLOCK = 8  # steps whose residuals are kept before they are transformed
ENTRIES = 256  # entries per work-item on a CPU


class TargetList:
    """Places of a field with their coefficients and old values, and the residuals of a block of steps.

    places  as in Lattice, sorted by plane (n,);  count  n rounded up to whole vectors, at least one
    """

    def __init__(self, device: Device, lattice: Lattice, at: np.ndarray, values: np.ndarray) -> None:
        self.device = device
        sort = PlaneOrder.of(lattice, at)
        self.places, self._first = at[sort.order], sort.first
        self.count = max(1, -(-len(at) // LANES)) * LANES
        padded = np.zeros((len(values), self.count), np.float32)
        padded[:, : len(at)] = values[:, sort.order]
        in_buffer = np.zeros(self.count, np.int32)
        in_buffer[: len(at)] = lattice.in_buffer(self.places)
        self._at, self._values = device.copied(in_buffer), device.copied(padded)
        self._old, self.residual = device.zeros(4 * self.count), device.zeros(4 * self.count * BLOCK)

    def correct(self, kernel: Any, fields: tuple[Any, ...], step: int, planes: tuple[int, int], *args: Any) -> None:
        """Correct a range of planes; the residuals are those of step `step` of the block."""
        run_entries(
            self.device, kernel, self._first, planes, *fields, self._at, self._values, self._old, self.residual,
            self.count, step * self.count, *args,
        )  # fmt: skip

    def start(self, field: np.ndarray) -> None:
        """Take old values from a field (3, *shape)."""
        old = np.zeros(self.count, np.float32)
        old[: len(self.places)] = field.flat[self.places]
        self.device.write(self._old, old)

    def residuals(self, n_steps: int) -> np.ndarray:
        """The residuals of the first steps of the last block, float32 (n_steps, n)."""
        return self.device.download(self.residual, np.empty((n_steps, self.count), np.float32))[:, : len(self.places)]


class IncidentList:
    """Places where an incident wave corrects one field."""

    def __init__(self, device: Device, lattice: Lattice, part: Entrance, table: WaveTable, magnetic: bool) -> None:
        self.device, self._first = device, part.first
        first, rest = table.read(part.source, magnetic=not magnetic)
        arrays = lattice.in_buffer(part.at), first, rest, part.amount
        self._arrays = tuple(device.copied(values) for values in arrays)

    def correct(self, kernel: Any, field: Any, wave: Any, at: int, loud: list[int], planes: tuple[int, int]) -> None:
        """Correct a range of planes by the values of the wave that begin at `at` in its table.

        loud  first and last point that are not negligible: entries that read neither these nor points between are left
        """
        below, above = COMPONENTS * (loud[0] - BEFORE - AFTER), COMPONENTS * loud[1] + COMPONENTS - 1
        run_entries(self.device, kernel, self._first, planes, field, *self._arrays, wave, at, below, above)


def run_entries(device: Device, kernel: Any, first_of: np.ndarray, planes: tuple[int, int], *args: Any) -> None:
    """Run a kernel of kernels/fdtd_lists.cl over the entries of a range of planes, if there are any."""
    first, last = int(first_of[planes[0]]), int(first_of[planes[1]])
    each = ENTRIES if device.is_cpu else 1
    if first < last:
        device.run(kernel, (-(-(last - first) // each),), None, *args, each, first, last)
