"""Lists of cells on a device: those of a target, coupled ones among them, and those where an incident wave enters."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..opencl.device import Device
from .incident import AFTER, BEFORE, Entrance, WaveTable
from .lattice import LANES, GroupOrder, Lattice
from .target import Target

SAMPLES = 8  # samples of the residuals that are kept before they are transformed
PARTS = 2  # of a list of the incident wave: components on an edge of its box are corrected twice


class TargetList:
    """Places of a field with their coefficients and old values, and samples of the residuals.

    places    as in Lattice, in the order of GroupOrder (n,);  count  n rounded up to whole vectors, at least one
    conducts  edges of a conductor alone, which have no coefficients;  rows  buffer of the first entry of each group
    """

    def __init__(self, device: Device, lattice: Lattice, at: np.ndarray, values: np.ndarray) -> None:
        self.device, self._groups = device, lattice.groups
        sort = GroupOrder.of(lattice, at)
        self.places, self._first = at[sort.order], sort.first
        self.count = max(1, -(-len(at) // LANES)) * LANES
        self.conducts = len(values) == 2 and not values.any()
        kept = 0 if self.conducts else self.count
        padded = np.zeros((len(values), max(kept, 1)), np.float32)
        if kept:
            padded[:, : len(at)] = values[:, sort.order]
        in_buffer = np.zeros(self.count, np.int32)
        in_buffer[: len(at)] = lattice.in_buffer(self.places)
        self.rows = device.copied(sort.first)
        self._at, self._values = device.copied(in_buffer), device.copied(padded)
        self._old, self.residual = device.zeros(4 * max(kept, 1)), device.zeros(4 * self.count * SAMPLES)

    @property
    def arrays(self) -> tuple[Any, ...]:
        """The buffers that kernels read: places, coefficients, old values, residuals."""
        return self._at, self._values, self._old, self.residual

    def numbers(self, sample: int | None) -> dict[str, int]:
        """Numbers of kernels: count, and where sample number `sample` of the residuals is stored."""
        return {"count": self.count, "record": -1 if sample is None else sample * self.count}

    def span(self, planes: tuple[int, int]) -> tuple[int, int]:
        """First entry of a range of planes, and the first one after these."""
        return _span(self._first, self._groups, planes)

    def numbers_of(self, at: np.ndarray) -> np.ndarray:
        """The numbers (n,) of entries at places (n,), all of which are in the list."""
        order = np.argsort(self.places)
        return np.asarray(order[np.searchsorted(self.places[order], at)])

    @property
    def kept(self) -> tuple[Any, Any]:
        """The buffers of old values and of residuals."""
        return self._old, self.residual

    def start(self, field: np.ndarray) -> None:
        """Take old values from a field (3, *shape)."""
        if not self.conducts:
            old = np.zeros(self.count, np.float32)
            old[: len(self.places)] = field.flat[self.places]
            self.device.write(self._old, old)

    def residuals(self, n_samples: int) -> np.ndarray:
        """The first of the samples that are kept, float32 (n_samples, n)."""
        return self.device.download(self.residual, np.empty((n_samples, self.count), np.float32))[:, : len(self.places)]


class CoupledList:
    """Edges of a list whose field depends on the edges across them, with their weights (kernels/fdtd_coupled.cl)."""

    def __init__(self, device: Device, lattice: Lattice, target: Target, edges: TargetList) -> None:
        self._groups = lattice.groups
        sort = GroupOrder.of(lattice, target.coupled)
        places = target.coupled[sort.order]
        self.count, self._first = len(places), sort.first
        self.arrays: tuple[Any, ...] = ()
        if self.count:
            weight = np.concatenate([target.coupling, target.lagging])[:, sort.order].astype(np.float32)
            number = edges.numbers_of(places).astype(np.int32)
            late = np.zeros(self.count, np.float32)
            self.arrays = tuple(device.copied(values) for values in (lattice.in_buffer(places), number, weight, late))

    def span(self, planes: tuple[int, int]) -> tuple[int, int]:
        """First entry of a range of planes, and the first one after these."""
        return _span(self._first, self._groups, planes)


class IncidentList:
    """Places where an incident wave corrects one field, in PARTS parts without a place that occurs twice."""

    def __init__(
        self, device: Device, lattice: Lattice, parts: list[Entrance], table: WaveTable | None, magnetic: bool
    ) -> None:
        self._groups = lattice.groups
        if len(parts) > PARTS:
            raise AssertionError(f"{len(parts)} parts")  # a component lies on two faces of a box at most
        groups = lattice.shape[0] * lattice.groups + 1
        sizes = [len(part.at) for part in parts] + [0] * (PARTS - len(parts))
        self._first = np.zeros((PARTS, groups), np.int32)
        for n in range(PARTS):
            self._first[n] = sum(sizes[:n]) + (parts[n].first if n < len(parts) else 0)
        columns: list[np.ndarray] = [np.zeros(1, dtype) for dtype in (np.int32, np.int32, np.float32, np.float32)]
        if table is not None and parts:
            read = [table.read(part.source, magnetic=not magnetic) for part in parts]
            columns = [
                np.concatenate([lattice.in_buffer(part.at) for part in parts]),
                *(np.concatenate([both[n] for both in read]) for n in (0, 1)),
                np.concatenate([part.amount for part in parts]),
            ]
        self.rows, self.arrays = device.copied(self._first), tuple(device.copied(values) for values in columns)

    def spans(self, planes: tuple[int, int]) -> list[tuple[int, int]]:
        """First entry of a range of planes, and the first one after these, of each part."""
        return [_span(first, self._groups, planes) for first in self._first]


def heard(loud: list[int]) -> dict[str, int]:
    """Limits of `from` (kernels/fdtd_lists.clh) beyond which entries read no point from loud[0] to loud[1]."""
    return {"quiet_below": 8 * (loud[0] - BEFORE - AFTER), "quiet_above": 8 * loud[1] + 7}


def _span(first: np.ndarray, groups: int, planes: tuple[int, int]) -> tuple[int, int]:
    return int(first[planes[0] * groups]), int(first[planes[1] * groups])
