"""From profiles of the smallest cells to profiles of pulses: joined to larger cells, level by level."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...base import float_pairs
from ...numerics import range_profiles
from ...numerics.device_profiles import SpreadSamples
from ...numerics.pulse_geometry import PulseGeometry
from ...opencl.device import Buffer, Device
from ...opencl.group_sizes import first_allowed
from ...opencl.launch_numbers import launch_numbers
from ..spreading import most_pulses
from ._leaves import Leaves
from .cells import CellLevel
from .levels import FactorizedPlan, Level
from .scatterers import Scatterers

EXPAND, NAMES = "expand_subapertures.cl", ("moves", "expand")
# bytes that a pulse reads of the cells of a launch on a CPU: the next pulse reads nearly the same from a core's cache
CACHED = 2**19
SPAN, GROUP_SPAN = 512, 256  # samples that a work-group of a CPU adds up, and of a GPU
GROUPS = 64, 32, 16, 8, 1  # work-items of a group on a GPU, most first


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
    """Which cells lie in which larger ones, of which there are n_larger: on the host and on the device.

    launches  first and last + 1 of the cells in each larger one that are joined together, launch by launch
    """

    n_larger: int
    parents: np.ndarray
    children: np.ndarray
    parents_on_device: Buffer
    launches: list[Buffer]

    @classmethod
    def of(cls, device: Device, larger: CellLevel | None, level: Level) -> _Join:
        """larger  None: all cells lie in one"""
        cells = level.cells
        if larger is not None:
            parents, children = larger.parents_of(cells), larger.children_in(cells)
            return cls(len(larger), parents, children, device.upload(parents), [device.upload(children)])
        parents, n = np.zeros(len(cells), np.int32), len(cells)
        step = max(CACHED // (8 * level.stride * level.decimation.filter.shape[1]), 1) if device.is_cpu else n
        edges = np.array([*range(0, n, step), n], np.int32)
        launches = [device.upload(edges[i : i + 2].copy()) for i in range(len(edges) - 1)]
        return cls(1, parents, edges[[0, -1]], device.upload(parents), launches)


class Ascent:
    """From profiles of the smallest cells to those of larger and larger ones, with what all share on the device.

    fronts  number of facets spread so far that each position kept for the smallest cells sees from their front
    cells_at_once, pulses_at_once  largest cells whose profiles are on the device together, and pulses they are added to
    """

    def __init__(
        self,
        device: Device,
        plan: FactorizedPlan,
        scatterers: Scatterers,
        antennas: PulseGeometry,
        n_samples: int,
        budget: float,
    ) -> None:
        """budget  bytes on the device"""
        self.device, self.plan, self.antennas, levels = device, plan, antennas, plan.levels
        self.n_scatterers = len(scatterers)
        self.center, length = scatterers.cells.center, plan.leaf.length
        self.bistatic, self.lanes = not antennas.is_monostatic, device.info.vector_width
        self.leaves = Leaves(device, plan, scatterers, bistatic=self.bistatic)
        kept = [level.decimation.kept for level in levels]
        self.fronts = np.zeros(len(kept[-1]), np.int64)
        self.pulses = [Pulses.of(device, k, self.center, length, range(len(k))) for k in kept[:-1]]
        self.centers = [device.upload(float_pairs.wide(level.cells.centers.T)) for level in levels]
        self.filters = [device.upload(level.decimation.filter) for level in levels]
        self.neighbours = [device.upload(level.decimation.neighbours) for level in levels]
        cells = [level.cells for level in levels]
        self.joins = [_Join.of(device, *pair) for pair in zip([None, *cells], levels, strict=False)]
        self.between = device.upload(plan.between.table)
        self.spectra_of = SpreadSamples(device, n_samples, plan.leaf.interpolator, length)
        self.stride = length + 2 * range_profiles.padding(plan.leaf.interpolator)
        per_pulse, room = 24 * self.stride + self.spectra_of.row_bytes, budget / 4
        n_roots, n_pulses = len(levels[0].cells), len(antennas)
        self.pulses_at_once = int(np.clip(room / per_pulse, 1, min(max(most_pulses(device), 256), n_pulses)))
        self.cells_at_once = int(
            np.clip(room / len(scatterers.channels) / self._bytes(0, self.pulses_at_once), 1, n_roots)
        )
        self.within = room / max(len(levels) - 1, 1)  # bytes of the profiles of each deeper level

    def _bytes(self, level: int, n_pulses: int) -> float:
        """Bytes of a cell's profiles, and of records by which they are made and added to those of so many pulses."""
        planned = self.plan.levels[level]
        own = 8 * planned.stride * len(planned.decimation.kept)
        if planned is self.plan.levels[-1]:
            own = self.leaves.nbytes
        return float(own + 4 * (4 + self.plan.between.taps) * n_pulses)

    def profiles(self, channel: int, level: int, low: int, high: int) -> Buffer:
        """Profiles of cells low ... high - 1 of a level: a buffer (high - low, kept pulses, stride, 2)."""
        levels = self.plan.levels
        if level == len(levels) - 1:
            profiles, fronts = self.leaves.profiles(channel, low, high)
            self.fronts += fronts if channel == 0 else 0
            return profiles
        pulses, below, stride = self.pulses[level], level + 1, levels[level].stride
        join = self.joins[below]
        out = self.device.zeros(8 * (high - low) * pulses.n_used * stride)
        target = Target(pulses, self.centers[level], out, low, stride, levels[level].reach)
        begin, end = int(join.children[low]), int(join.children[high])
        step = max(1, int(self.within / self._bytes(below, pulses.n_used)))
        for first in range(begin, end, step):
            last = min(first + step, end)
            self._expand(below, self.profiles(channel, below, first, last), (first, last), target)
        return out

    def facing_away(self, first: int, stop: int) -> int:
        """Pairs of facets and pulses first ... stop - 1 seen from behind, by the kept position next to each pulse."""
        near = np.arange(first, stop)
        for level in self.plan.levels:
            decimation = level.decimation
            before, row = decimation.neighbours[near].T
            taps = decimation.filter.shape[1]
            near = before + taps // 2 - 1 + (2 * row >= decimation.ratio)
        return int((self.n_scatterers - self.fronts[near]).sum())

    def rows(self, profiles: Buffer, roots: tuple[int, int], pulses: range) -> Buffer:
        """Profiles of pulses about their reference range, of the largest cells (first, stop): a buffer as
        `SpreadSamples.of` takes it."""
        stride = self.stride
        geometry = Pulses.of(self.device, self.antennas, self.center, self.plan.leaf.length, pulses)
        out = self.device.zeros(24 * len(pulses) * stride)
        # of sum, total and rest the total alone is filled
        target = Target(geometry, self.centers[0], out, 0, stride, stride // 2, 3, 1, pulses[0])
        self._expand(0, profiles, roots, target)
        return out

    def _expand(self, level: int, profiles: Buffer, cells: tuple[int, int], target: Target) -> None:
        """Add profiles of cells (first, stop) of a level to those of a target."""
        device, plan, (first, last), join = self.device, self.plan, cells, self.joins[level]
        planned, pulses, taps = plan.levels[level], target.pulses, plan.between.taps
        span, sizes = (SPAN, (1,)) if device.is_cpu else (GROUP_SPAN, GROUPS)
        macros = {
            "BISTATIC": int(self.bistatic), "WRAP": 0, "TAPS": taps, "TERMS": plan.between.terms,
            "FROM_CENTRE": int(level == 0), "FILTER_TAPS": planned.decimation.filter.shape[1], "SPAN": span,
        }  # fmt: skip
        items, (moves, expand) = first_allowed(
            device, sizes, lambda items: tuple(device.kernel(EXPAND, name, **macros, ITEMS=items) for name in NAMES)
        )
        records = device.empty(4 * (4 + taps) * pulses.n_used * (last - first))
        numbers = {"n": pulses.n, "n_used": pulses.n_used, "n_larger": join.n_larger, "n_tiles": len(planned.cells)}
        launch = launch_numbers(EXPAND, "moves", **numbers, first=first)
        buffers = pulses.buffer, target.centers, self.centers[level], join.parents_on_device, self.between, records
        device.run(moves, (pulses.n // self.lanes, last - first), None, launch, *buffers)
        larger, stop = int(join.parents[first]), int(join.parents[last - 1]) + 1
        numbers = {"n_used": pulses.n_used, "first_tile": first, "last_tile": last, "first_larger": larger}
        numbers |= {"first_out": target.first, "n_kept": len(planned.decimation.kept), "stride": planned.stride}
        numbers |= {"reach": planned.reach, "new_stride": target.stride, "new_origin": target.origin}
        numbers |= {"n_planes": target.n_planes, "plane": target.plane, "first_pulse": target.first_pulse}
        launch = launch_numbers(EXPAND, "expand", **numbers)
        tables = records, self.neighbours[level], self.filters[level]
        size = (-(-target.stride // span) * items, pulses.n_used, stop - larger)
        for children in join.launches:
            steps = (last - first) / len(join.launches)
            device.run(expand, size, (items, 1, 1), launch, profiles, children, *tables, target.profiles, steps=steps)
        device.finish()  # on a CPU profiles are memory of the host: they must exist until the kernel has read them
