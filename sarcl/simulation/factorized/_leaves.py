"""Scatterers spread into profiles of the smallest cells: the engine of kernels/spread_leaves.cl."""

from __future__ import annotations

import numpy as np

from ...base import float_pairs
from ...numerics.pulse_geometry import PulseGeometry
from ...numerics.tile_constants import TileConstants
from ...opencl.device import Buffer, Device
from ...opencl.launch_numbers import launch_numbers
from .levels import FactorizedPlan
from .scatterers import Scatterers

LEAVES = "spread_leaves.cl"
LEAST_ROOM = 64  # samples of a work-item's profile on CPUs, else the next power of two: few programs serve all plans


class Leaves:
    """The smallest cells of a plan on a device: their scatterers, and the antenna positions that are kept there."""

    def __init__(self, device: Device, plan: FactorizedPlan, scatterers: Scatterers, *, bistatic: bool) -> None:
        self.device, self.level, self.channels = device, plan.levels[-1], scatterers.channels
        weights = scatterers.weights
        for level in plan.levels:
            weights = weights.decimated(level.decimation)
        cells, lanes = self.level.cells, device.info.vector_width
        self.constants = TileConstants(device, plan.leaf, bistatic=bistatic, local=True)
        self.macros = plan.leaf.macros(bistatic) | weights.macros(scatterers.n_frequencies) | dict(scatterers.macros)
        self.macros |= {"ROOM": max(LEAST_ROOM, 1 << (self.level.stride - 1).bit_length()) if lanes > 1 else 0}
        del self.macros["WRAP"], self.macros["NODES"]
        packed = kept_records(self.level.decimation.kept, scatterers.cells.center, plan.leaf.length, lanes)
        self.pulses, self.n, self.n_used = device.upload(packed), packed.shape[2], len(self.level.decimation.kept)
        vectors, place = vectors_of(cells.first, lanes)
        self.n_offsets = int(vectors[-1]) * lanes
        self.references = device.upload(float_pairs.wide(cells.centers.T))
        self.vectors, self.offsets = device.upload(vectors), device.upload(self._offsets(scatterers, place))
        self.planes = device.upload(placed(scatterers.planes, place, self.n_offsets))
        self.radius = device.upload(np.full(len(cells), cells.radius, np.float32))
        self.table, self.up = device.upload(plan.leaf.interpolator.table), device.upload(scatterers.up)
        self.patterns, self.second = weights.upload(device)
        self.axes, self.range = device.upload(weights.packed_axes(np.arange(self.n_used))), weights.range

    @property
    def nbytes(self) -> int:
        """Bytes of a cell's profiles, and of the records by which they are computed."""
        return (8 * self.level.stride + self.constants.nbytes) * self.n_used

    def profiles(self, number: int, low: int, high: int) -> tuple[Buffer, np.ndarray]:
        """Profiles of cells low ... high - 1 in a channel, a buffer (high - low, kept positions, stride, 2); and of
        their facets those that are seen from their front, at each kept position (n,)."""
        device, n_cells, channel = self.device, len(self.level.cells), self.channels[number]
        constants = self.constants.compute(self.pulses, self.n, self.references, self.radius, (low, high), n_cells)
        out = device.empty(8 * (high - low) * self.n_used * self.level.stride)
        fronts = device.zeros(4 * (high - low) * self.n_used)
        device.run(
            device.kernel(LEAVES, "leaves", **self.macros, **channel.macros), (self.n_used, high - low),
            (1, 1) if device.is_cpu else None,
            launch_numbers(
                LEAVES, "leaves", n=self.n, n_used=self.n_used, n_tiles=n_cells, n_offsets=self.n_offsets, first=low,
                root=channel.root, second=self.second, stride=self.level.stride, wave=channel.wave,
                scale=channel.scale, ratio=channel.ratio, range=self.range,
            ),
            self.pulses, constants, self.references, self.offsets, self.vectors, self.planes, self.up, self.patterns,
            self.axes, self.table, out, fronts,
        )  # fmt: skip
        device.finish()
        counts = device.download(fronts, np.empty((high - low, self.n_used), np.int32))
        return out, counts.sum(axis=0, dtype=np.int64)

    def _offsets(self, scatterers: Scatterers, place: np.ndarray) -> np.ndarray:
        """Positions about the centres of the cells, m, hi then lo parts, float32 (6, n_offsets)."""
        cells, out = self.level.cells, np.zeros((6, self.n_offsets), np.float32)
        for axis in range(3):
            middle = np.repeat(cells.centers[:, axis], np.diff(cells.first))
            out[axis::3, place] = float_pairs.wide(scatterers.cells.positions[:, axis] - middle)
        return out


def kept_records(kept: PulseGeometry, center: np.ndarray, length: int, lanes: int) -> np.ndarray:
    """Records of all antenna positions that are kept, as kernels/geometry.clh reads them."""
    return kept.packed(center, length, 0, len(kept), lanes)


def vectors_of(first: np.ndarray, lanes: int) -> tuple[np.ndarray, np.ndarray]:
    """First vector of each cell, and the number of vectors, int32; and the place of each scatterer among all lanes.

    first  scatterer of each cell, and the number of scatterers
    """
    count = np.diff(first)
    vectors = np.concatenate([[0], np.cumsum(-(-count // lanes))]).astype(np.int32)
    return vectors, np.repeat(vectors[:-1] * lanes - first[:-1], count) + np.arange(first[-1])


def placed(planes: np.ndarray | tuple[np.ndarray, ...], place: np.ndarray, n: int) -> np.ndarray:
    """Numbers of scatterers (k, m) at their places among n lanes; the other lanes are 0."""
    out = np.zeros((len(planes), n), np.float32)
    for row, plane in zip(out, planes, strict=True):
        row[place] = plane
    return out
