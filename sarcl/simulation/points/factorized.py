"""Points to range profiles by a plan of levels: spread about the smallest cells, and joined to larger ones."""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from ...base import float_pairs
from ...base.stage_timer import Clock
from ...numerics import cost_model, range_profiles
from ...numerics.device_profiles import SpreadSamples
from ...numerics.pulse_geometry import PulseGeometry
from ...numerics.tile_constants import TileConstants
from ...opencl.device import Buffer, Device
from ...opencl.launch_numbers import launch_numbers
from ..spreading import Counts, most_pulses
from ._levels import FactorizedPlan
from ._point_cells import CellLevel, PointCells

EXPAND, LEAVES = "expand_subapertures.cl", "spread_leaves.cl"
SPAN, GROUP_SPAN, GROUP = 512, 256, 64  # samples that a work-group of a CPU adds up, and of a GPU; its work-items there


@dataclass(frozen=True, eq=False)
class Pulses:
    """Records of pulses on a device, as kernels/geometry.clh reads them: n of them with padding, n_used without."""

    buffer: Buffer
    n: int
    n_used: int

    @classmethod
    def of(cls, device: Device, antennas: PulseGeometry, center: np.ndarray, length: int, rows: range) -> Pulses:
        """Records of consecutive pulses."""
        packed = antennas.packed(center, length, rows[0], rows[-1] + 1, device.info.vector_width)
        return cls(device.upload(packed), packed.shape[2], len(rows))


@dataclass(frozen=True, eq=False)
class Target:
    """Profiles on the device, to which those of smaller cells are added.

    centers         of the larger cells whose profiles they are, of which `first` is that of the first profile
    stride, origin  samples of a profile, and the sample of delay 0
    n_planes, plane  of a row, and the one that is filled;  first_pulse  of the track, the first of these
    """

    pulses: Pulses
    centers: Buffer
    profiles: Buffer
    first: int
    stride: int
    origin: int
    n_planes: int = 1
    plane: int = 0
    first_pulse: int = 0


@dataclass(frozen=True, eq=False)
class _Join:
    """Which cells lie in which larger ones, of which there are n_larger: on the host and on the device."""

    n_larger: int
    parents: np.ndarray
    children: np.ndarray
    parents_on_device: Buffer
    children_on_device: Buffer

    @classmethod
    def of(cls, device: Device, larger: CellLevel | None, cells: CellLevel) -> _Join:
        """larger  None: all cells lie in one"""
        if larger is None:
            parents, children = np.zeros(len(cells), np.int32), np.array([0, len(cells)], np.int32)
        else:
            parents, children = larger.parents_of(cells), larger.children_in(cells)
        return cls(len(children) - 1, parents, children, device.upload(parents), device.upload(children))


@dataclass(eq=False)
class FactorizedSpreader:
    """Points of one channel at one receiver, by a plan.

    amplitudes  complex (n,), in the order of the cells;  budget  bytes on the device
    Profiles of the largest cells are kept from one call of `add` to the next, where all of them fit.
    """

    device: Device
    plan: FactorizedPlan
    cells: PointCells
    amplitudes: np.ndarray
    antennas: PulseGeometry
    n_samples: int
    budget: float
    _whole: Buffer | None = field(default=None, init=False)

    def __len__(self) -> int:
        return len(self.cells)

    @property
    def seconds(self) -> float:
        """About the seconds of one core that all pulses take."""
        return 1e-6 * cost_model.SPREAD_POINT * self.plan.cost * len(self.cells) * len(self.antennas)

    @functools.cached_property
    def _ascent(self) -> _Ascent:
        return _Ascent(self)

    def add(
        self, samples: np.ndarray, pulses: Sequence[int], clock: Clock, on_progress: Callable[[int], object]
    ) -> Counts:
        """Add points to samples (n_pulses, n_samples) of consecutive `pulses` of the antennas.

        on_progress is called with the number of pairs of point and pulse that are done.
        """
        ascent, n_cells = self._ascent, len(self.plan.levels[0].cells)
        clock.lap("scene")
        first, stop = pulses[0], pulses[-1] + 1
        for low in range(0, n_cells, ascent.cells_at_once):
            cells = low, min(low + ascent.cells_at_once, n_cells)
            profiles = self._profiles(cells)
            clock.lap("echo")
            for start in range(first, stop, ascent.pulses_at_once):
                end = min(start + ascent.pulses_at_once, stop)
                rows = ascent.rows(profiles, cells, range(start, end))
                clock.lap("echo")
                samples[start - first : end - first] += ascent.spectra_of.of(rows, 1, end - start)
                clock.lap("spectra")
                pairs = low * len(pulses) + (cells[1] - low) * (end - first)
                on_progress(len(self.cells) * pairs // n_cells)
        return Counts(len(self.cells) * len(pulses))

    def _profiles(self, cells: tuple[int, int]) -> Buffer:
        """Profiles of the largest cells (first, stop)."""
        if cells != (0, len(self.plan.levels[0].cells)):
            return self._ascent.profiles(0, *cells)
        if self._whole is None:
            self._whole = self._ascent.profiles(0, *cells)
        return self._whole


class _Ascent:
    """From points to profiles of larger and larger cells, with what all of them share on the device.

    cells_at_once, pulses_at_once  largest cells whose profiles are on the device together, and pulses they are added to
    """

    def __init__(self, spreader: FactorizedSpreader) -> None:
        self.spreader, self.plan, self.device = spreader, spreader.plan, spreader.device
        device, plan, levels = self.device, self.plan, self.plan.levels
        self.bistatic, self.lanes = not spreader.antennas.is_monostatic, device.info.vector_width
        center, leaf, length = spreader.cells.center, levels[-1], plan.leaf.length
        kept = [level.decimation.kept for level in levels]
        self.pulses = [Pulses.of(device, k, center, length, range(len(k))) for k in kept]
        self.centers = [device.upload(float_pairs.wide(level.cells.centers.T)) for level in levels]
        self.filters = [device.upload(level.decimation.filter) for level in levels]
        self.neighbours = [device.upload(level.decimation.neighbours) for level in levels]
        cells = [level.cells for level in levels]
        self.joins = [_Join.of(device, *pair) for pair in zip([None, *cells], cells, strict=False)]
        self.table, self.between = (device.upload(i.table) for i in (plan.leaf.interpolator, plan.between))
        self.constants = TileConstants(device, plan.leaf, bistatic=self.bistatic, local=True)
        macros = {k: v for k, v in plan.leaf.macros(self.bistatic).items() if k != "WRAP"}
        self.leaves = device.kernel(LEAVES, "leaves", **macros, STRIDE=leaf.stride)
        vectors, offsets, scatterers = packed_points(spreader.cells, leaf.cells, spreader.amplitudes, self.lanes)
        self.vectors, self.offsets, self.scatterers = map(device.upload, (vectors, offsets, scatterers))
        self.n_offsets = offsets.shape[1]
        self.radius = device.upload(np.full(len(leaf.cells), leaf.cells.radius, np.float32))
        self.spectra_of = SpreadSamples(device, spreader.n_samples, plan.leaf.interpolator, length)
        self.stride = length + 2 * range_profiles.padding(plan.leaf.interpolator)
        per_pulse, budget = 24 * self.stride + self.spectra_of.row_bytes, spreader.budget / 4
        n_roots, n_pulses = len(levels[0].cells), len(spreader.antennas)
        self.pulses_at_once = int(np.clip(budget / per_pulse, 1, min(max(most_pulses(device), 256), n_pulses)))
        self.cells_at_once = int(np.clip(budget / self._bytes(0, self.pulses_at_once), 1, n_roots))
        self.within = budget / max(len(levels) - 1, 1)  # bytes of the profiles of each deeper level

    def _bytes(self, level: int, n_pulses: int) -> float:
        """Bytes of a cell's profiles, and of records by which they are made and added to those of so many pulses."""
        planned = self.plan.levels[level]
        moves = 4 * (4 + self.plan.between.taps) * n_pulses
        per_pulse = 8 * planned.stride + (self.constants.nbytes if planned is self.plan.levels[-1] else 0)
        return float(per_pulse * len(planned.decimation.kept) + moves)

    def profiles(self, level: int, low: int, high: int) -> Buffer:
        """Profiles of cells low ... high - 1 of a level: a buffer (high - low, kept pulses, stride, 2)."""
        levels = self.plan.levels
        if level == len(levels) - 1:
            return self._spread(low, high)
        pulses, below, stride = self.pulses[level], level + 1, levels[level].stride
        join = self.joins[below]
        out = self.device.zeros(8 * (high - low) * pulses.n_used * stride)
        target = Target(pulses, self.centers[level], out, low, stride, levels[level].reach)
        begin, end = int(join.children[low]), int(join.children[high])
        step = max(1, int(self.within / self._bytes(below, pulses.n_used)))
        for first in range(begin, end, step):
            last = min(first + step, end)
            self._expand(below, self.profiles(below, first, last), (first, last), target)
        return out

    def rows(self, profiles: Buffer, roots: tuple[int, int], pulses: range) -> Buffer:
        """Profiles of pulses about their reference range, of the largest cells (first, stop): a buffer as
        `SpreadSamples.of` takes it."""
        spreader, stride = self.spreader, self.stride
        geometry = Pulses.of(self.device, spreader.antennas, spreader.cells.center, self.plan.leaf.length, pulses)
        out = self.device.zeros(24 * len(pulses) * stride)
        # of sum, total and rest the total alone is filled
        target = Target(geometry, self.centers[0], out, 0, stride, stride // 2, 3, 1, pulses[0])
        self._expand(0, profiles, roots, target)
        return out

    def _spread(self, low: int, high: int) -> Buffer:
        """Profiles of the smallest cells low ... high - 1."""
        device, leaf, pulses = self.device, self.plan.levels[-1], self.pulses[-1]
        n_cells, references = len(leaf.cells), self.centers[-1]
        constants = self.constants.compute(pulses.buffer, pulses.n, references, self.radius, (low, high), n_cells)
        out = device.empty(8 * (high - low) * pulses.n_used * leaf.stride)
        numbers = {"n": pulses.n, "n_used": pulses.n_used, "n_tiles": n_cells, "n_offsets": self.n_offsets}
        buffers = pulses.buffer, constants, references, self.offsets, self.vectors, self.scatterers, self.table, out
        size, group = (pulses.n_used, high - low), (1, 1) if device.is_cpu else None
        device.run(self.leaves, size, group, launch_numbers(LEAVES, "leaves", **numbers, first=low), *buffers)
        device.finish()
        return out

    def _expand(self, level: int, profiles: Buffer, cells: tuple[int, int], target: Target) -> None:
        """Add profiles of cells (first, stop) of a level to those of a target."""
        device, plan, (first, last), join = self.device, self.plan, cells, self.joins[level]
        planned, pulses, taps = plan.levels[level], target.pulses, plan.between.taps
        span, items = (SPAN, 1) if device.is_cpu else (GROUP_SPAN, GROUP)
        macros = {
            "BISTATIC": int(self.bistatic), "WRAP": 0, "TAPS": taps, "TERMS": plan.between.terms,
            "FROM_CENTRE": int(level == 0), "FILTER_TAPS": planned.decimation.filter.shape[1], "SPAN": span,
            "ITEMS": items,
        }  # fmt: skip
        moves, expand = (device.kernel(EXPAND, name, **macros) for name in ("moves", "expand"))
        records = device.empty(4 * (4 + taps) * pulses.n_used * (last - first))
        numbers = {"n": pulses.n, "n_used": pulses.n_used, "n_larger": join.n_larger, "n_tiles": len(planned.cells)}
        launch = launch_numbers(EXPAND, "moves", **numbers, first=first)
        buffers = pulses.buffer, target.centers, self.centers[level], join.parents_on_device, self.between, records
        device.run(moves, (pulses.n // self.lanes, last - first), None, launch, *buffers)
        larger, stop = int(join.parents[first]), int(join.parents[last - 1]) + 1
        numbers = {"n_used": pulses.n_used, "first_tile": first, "last_tile": last, "first_larger": larger}
        numbers |= {"first_out": target.first, "n_kept": self.pulses[level].n_used, "stride": planned.stride}
        numbers |= {"reach": planned.reach, "new_stride": target.stride, "new_origin": target.origin}
        numbers |= {"n_planes": target.n_planes, "plane": target.plane, "first_pulse": target.first_pulse}
        launch = launch_numbers(EXPAND, "expand", **numbers)
        tables = join.children_on_device, records, self.neighbours[level], self.filters[level]
        size = (-(-target.stride // span) * items, pulses.n_used, stop - larger)
        device.run(expand, size, (items, 1, 1), launch, profiles, *tables, target.profiles, steps=last - first)
        device.finish()  # on a CPU profiles are memory of the host: they must exist until the kernel has read them


def packed_points(
    cells: PointCells, smallest: CellLevel, amplitudes: np.ndarray, lanes: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Points as kernels/spread_leaves.cl reads them: first vector of each cell, offsets, amplitudes (2, n).

    Offsets (6, n) are m, hi then lo parts.
    """
    count = np.diff(smallest.first)
    vectors = np.concatenate([[0], np.cumsum(-(-count // lanes))]).astype(np.int32)
    place = np.repeat(vectors[:-1] * lanes - smallest.first[:-1], count) + np.arange(len(cells))
    offsets, scatterers = (np.zeros((n, int(vectors[-1]) * lanes), np.float32) for n in (6, 2))
    for axis in range(3):
        local = cells.positions[:, axis] - np.repeat(smallest.centers[:, axis], count)
        offsets[axis::3, place] = float_pairs.wide(local)
    scatterers[0, place], scatterers[1, place] = amplitudes.real, amplitudes.imag
    return vectors, offsets, scatterers
