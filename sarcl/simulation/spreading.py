"""What the spreading of points and of facets into range profiles has in common: tiles, plan, counts."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import zip_longest
from typing import Any, Protocol

import numpy as np

from ..base import float_pairs
from ..base.boxes import box
from ..base.errors import ToleranceUnreachable
from ..base.morton import morton_order
from ..numerics import cost_model
from ..numerics.error_bounds import FLOAT32
from ..numerics.interpolator_choice import choose_interpolator
from ..numerics.plan import LEAST_TOLERANCE, Plan, ProfileSums, carrier_steps, cheapest, least
from ..numerics.pulse_geometry import PulseGeometry
from ..numerics.tiles import Tiles, tile_points
from ..opencl.device import Buffer, Device, Kernel
from ..opencl.group_sizes import first_allowed
from ..scattering.antenna_weights import AntennaWeights
from .kernel_images import PatchSamples

PER_TILE = (256, 64)
# Shares of the tiles for which float32 ranges are tried where it does not carry those of the largest: neighbours along
# the Morton curve may lie far apart, so that few tiles are many times as large as the others.
SHARES = (0.5, 0.75, 0.9, 0.97)
GROUP = 64  # work-items that add up a row together: ITEMS of kernels/spread_group.clh
LOCAL = 12 * 1024  # bytes of local memory that they take, with 8 taps
SUMS = 4  # sums of a row with vectors of lanes (kernels/spread_taps.clh)
TOGETHER = 16  # pulses for which a work-item adds the scatterers of a tile: rows of so many stay in a core's cache
GROUPED_ITEMS = 100_000  # work-items of a launch, of groups: more than a GPU runs at once


@dataclass(frozen=True)
class Counts:
    """Pairs of scatterer and pulse that were visited, and how many of them contributed nothing.

    outside_window  outside the range window;  facing_away  inside it, the facet seen from behind
    outside_beam    beyond the limits of an antenna's beam
    unseen          pairs of a beam and a facet that it does not reach, or that the receiver does not see
    weak            beams whose echoes together are weaker than a share of the tolerance
    orders          beams of 1, 2 ... reflections that contributed, where several are followed
    crossed         pairs of a coherent facet and a pulse whose range window ends on it
    late, power     mean |sample|^2, less the pulse's spectrum, of beams outside the range window, and of all samples
    latest          m about the reference: the latest of such beams
    """

    pairs: int = 0
    outside_window: int = 0
    facing_away: int = 0
    outside_beam: int = 0
    unseen: int = 0
    weak: int = 0
    orders: tuple[int, ...] = ()
    late: float = 0.0
    power: float = 0.0
    latest: float = -math.inf
    crossed: int = 0

    def __add__(self, other: Counts) -> Counts:
        return Counts(
            self.pairs + other.pairs,
            self.outside_window + other.outside_window,
            self.facing_away + other.facing_away,
            self.outside_beam + other.outside_beam,
            self.unseen + other.unseen,
            self.weak + other.weak,
            tuple(map(sum, zip_longest(self.orders, other.orders, fillvalue=0))),
            self.late + other.late,
            self.power + other.power,
            max(self.latest, other.latest),
            self.crossed + other.crossed,
        )

    @property
    def contributing(self) -> int:
        """Pairs that were added up."""
        return self.pairs - self.outside_window - self.facing_away - self.outside_beam - self.unseen - self.weak

    @property
    def late_share(self) -> float:
        """Share of the power that beams outside the range window have, 0 to 1."""
        return self.late / (self.late + self.power) if self.late else 0.0

    def by_order(self) -> str:
        """Contributions of 1, 2 ... reflections, for a report."""
        several = list(self.orders[1:])
        return ", ".join(f"{i}: {n}" for i, n in enumerate([self.contributing - sum(several), *several], 1))


@dataclass(frozen=True)
class Band:
    """The band of a row of samples: their number, the bandwidth, Hz, and the carrier, Hz, in its middle."""

    n_samples: int
    bandwidth: float
    carrier: float

    def least_tolerance(self, n_scatterers: int, tolerance: float) -> float:
        """The smallest tolerance that range profiles of the band can meet.

        tolerance  that is asked for: it determines how many scatterers are summed in float32
        """
        steps = carrier_steps(self.carrier, self.n_samples, self.bandwidth)
        return least(self.n_samples, _chunk(n_scatterers, tolerance), steps)

    def spreading_cost(self, tolerance: float, n_scatterers: int) -> float:
        """About the cost of a pair of scatterer and row, in contributions."""
        steps = carrier_steps(self.carrier, self.n_samples, self.bandwidth)
        return choose_interpolator(tolerance, self.n_samples, n_scatterers, steps, cost_model.SPREADING)[2]


@dataclass(frozen=True, eq=False)
class ChannelView:
    """A channel at one receiver, as it sees scatterers.

    antennas  of its pulses, and  weights  as these see the scatterers
    frequencies  Hz, of its samples, over a band of `bandwidth`, Hz
    polarizations  of them, with V nearest to `vertical` (3,)
    gated     leave out scatterers outside the range window
    """

    antennas: PulseGeometry
    weights: AntennaWeights
    frequencies: np.ndarray
    bandwidth: float
    polarizations: Sequence[str]
    vertical: np.ndarray
    gated: bool

    @property
    def band(self) -> Band:
        """The band of a row of its samples."""
        # the median of equal frequencies is that frequency, to the bit: plans are kept by their band
        return Band(len(self.frequencies), self.bandwidth, float(np.median(self.antennas.frequency)))


@dataclass(frozen=True, eq=False)
class DeviceTiles:
    """Tiles of scatterers on a device.

    per_tile, n_tiles            scatterers in a tile, and tiles
    order                        of the scatterers in whole tiles; the last scatterer fills up the last tile
    references, radius, offsets  of the tiles, and planes  of the scatterers' numbers: buffers
    n_offsets                    distance of one plane of offsets or numbers from the next
    last                         scatterers in the last tile
    """

    per_tile: int
    n_tiles: int
    order: np.ndarray
    references: object
    radius: object
    offsets: object
    planes: object
    n_offsets: int
    last: int

    def release(self) -> None:
        """The block of pulses is done: buffers that do not stay on the device may leave it."""


class Tiling(Protocol):
    """Scatterers that can be put into tiles on a device.

    bounds  box of the positions, m (2, 3), and  center  its middle;  radii  m, of the tiles of each size (n_tiles,)
    order   neighbours follow one another (n,)
    """

    bounds: np.ndarray
    center: np.ndarray
    radii: dict[int, np.ndarray]
    order: np.ndarray

    def __len__(self) -> int: ...

    def tiles(self, per_tile: int) -> DeviceTiles:
        """Tiles of `per_tile` scatterers on the device."""


class HostTiling:
    """Scatterers put into tiles on the host, in Morton order. Tiles of one size stay on the device: those of the last
    plan."""

    def __init__(self, device: Device, positions: np.ndarray, planes: Callable[[np.ndarray], np.ndarray]) -> None:
        """positions  m (n, 3);  planes  of an order: the scatterers' numbers as the kernel reads them"""
        self.device, self.positions, self._planes = device, positions, planes
        self.bounds, self.order = box(positions), morton_order(positions)
        self.center = self.bounds.mean(axis=0)
        largest = max(PER_TILE)
        self._tiled_largest: tuple[Tiles, np.ndarray] | None = self._tiled(largest)
        tiles = self._tiled_largest[0]
        self.radii = {n: tiles.radius if n == largest else tiles.radii_in_parts(n) for n in PER_TILE}
        self._on_device: DeviceTiles | None = None

    def __len__(self) -> int:
        return len(self.positions)

    def tiles(self, per_tile: int) -> DeviceTiles:
        """Tiles of `per_tile` scatterers on the device."""
        device_tiles = self._on_device
        if device_tiles is None or device_tiles.per_tile != per_tile:
            self._on_device = None  # frees the buffers of the other size first
            largest, self._tiled_largest = self._tiled_largest, None  # what the device holds is not needed here
            tiles, order = largest if largest and largest[0].per_tile == per_tile else self._tiled(per_tile)
            upload = self.device.upload
            device_tiles = self._on_device = DeviceTiles(
                per_tile, tiles.n_tiles, order, upload(float_pairs.wide(tiles.references.T)),
                upload(tiles.radius.astype(np.float32)), upload(tiles.offsets), upload(self._planes(order)),
                len(order), per_tile - (len(order) - len(self)),
            )  # fmt: skip
        return device_tiles

    def refill(self, planes: Callable[[np.ndarray], np.ndarray]) -> None:
        """Give the scatterers other numbers; tiles that are on the device stay."""
        self._planes = planes
        if self._on_device is not None:
            on_device = self.device.upload(planes(self._on_device.order))
            self._on_device = replace(self._on_device, planes=on_device)

    def _tiled(self, per_tile: int) -> tuple[Tiles, np.ndarray]:
        return tile_points(self.positions, self.center, per_tile, self.order)


class TiledScatterers:
    """Scatterers in tiles and on a device: prepared once, for all channels, receivers and pulses."""

    def __init__(
        self, device: Device, tiling: Tiling, n_coherent: int, patches: Callable[[np.ndarray], PatchSamples]
    ) -> None:
        """n_coherent  sums over all scatterers, of all pulses, that are not at random phases: 0 where all are
        patches  of the order of the tiling: samples from which the error of evenly spaced scatterers is measured
        """
        self.device, self.tiling, self._n_coherent, self._patches = device, tiling, n_coherent, patches
        self.center, self.tiles = tiling.center, tiling.tiles
        self._samples: PatchSamples | None = None
        self._image_errors: dict[tuple[Any, ...], float] = {}

    def __len__(self) -> int:
        return len(self.tiling)

    def plan(
        self, antennas: PulseGeometry, band: Band, tolerance: float, least_tolerance: float = LEAST_TOLERANCE
    ) -> Plan:
        """The cheapest plan for these scatterers. ToleranceUnreachable where none meets the tolerance."""
        n, radii = len(self), self.tiling.radii
        near = {size: list(zip(np.quantile(each, SHARES), SHARES, strict=True)) for size, each in radii.items()}

        tiles = [(size, float(each.max())) for size, each in radii.items()]
        distance, highest = antennas.distance(self.tiling.bounds), float(antennas.frequency.max()) + band.bandwidth / 2
        chunk = _chunk(n, tolerance)
        sums = ProfileSums(distance, highest, band.bandwidth, band.n_samples, n, chunk, band.carrier)
        costs = cost_model.SPREADING if self.device.info.vector_width > 1 else cost_model.SPREADING_ON_GPU

        def with_gain(gain: float) -> Plan:
            limits = {"least_tolerance": least_tolerance, "image_gain": gain}
            return cheapest(tolerance, tiles, sums, near=near, gathering=costs, **limits)

        plan = with_gain(1.0)
        if not self._n_coherent:
            return plan
        try:  # n echoes are at most the root of n times their power's root
            bounded = with_gain(np.sqrt(n))
        except ToleranceUnreachable:
            bounded = None
        if bounded is not None and (bounded.cost - plan.cost) * n * self._n_coherent <= cost_model.PATCHES:
            return bounded
        gain = 1.0
        while True:
            kernel = plan.interpolator.error
            fixed, images = plan.predicted_error - gain * kernel, self._image_error(plan, band)
            if gain == 1 and images <= kernel:
                return plan
            if fixed + images <= tolerance:
                return replace(plan, predicted_error=fixed + max(images, kernel))
            gain = max(images / kernel, 2 * gain)
            try:
                plan = with_gain(gain)
            except ToleranceUnreachable as refused:
                lattice = "with scatterers that lie so evenly: the images of the interpolation kernel add up"
                raise ToleranceUnreachable(tolerance, None, refused.limit, "take a larger tolerance", lattice) from None

    def image_error(self, plan: Plan, band: Band) -> float:
        """Relative error of the images of a plan's kernel, at least that for scatterers at random places."""
        return max(plan.interpolator.error, self._image_error(plan, band) if self._n_coherent else 0.0)

    def _image_error(self, plan: Plan, band: Band) -> float:
        """Relative error of the images of a plan's kernel."""
        kernel = plan.interpolator
        key = kernel.taps, kernel.oversample, plan.length, band.n_samples, band.bandwidth
        if key not in self._image_errors:
            if self._samples is None:
                self._samples = self._patches(self.tiling.order)
            self._image_errors[key] = self._samples.error(kernel, plan.length, band.n_samples, band.bandwidth)
        return self._image_errors[key]


def _chunk(n_scatterers: int, tolerance: float) -> int:
    """Scatterers summed in float32."""
    return min(n_scatterers, max(min(PER_TILE), int(terms(tolerance))))


class Rows:
    """Rows of samples on a device, which a kernel adds scatterers to: macros of kernels/spread_rows.clh.

    splits   rows of each pulse and channel, each of a share of the tiles
    grouped  work-groups add rows up, in local memory
    """

    def __init__(
        self, device: Device, stride: int, channels: int, n_pulses: int, n_tiles: int, *, alone: bool = False
    ) -> None:
        """stride  samples of a row;  channels  rows of a pulse;  n_pulses, n_tiles  in all;  alone  never grouped"""
        self.device, self.stride, self.channels = device, stride, channels
        lanes = device.info.vector_width > 1
        self.grouped = not (lanes or alone) and device.shares(LOCAL, GROUP)
        self._pulses, self._sums = (TOGETHER, SUMS) if lanes else (1, 1)
        self.items = GROUP if self.grouped else 1
        launched = min(n_pulses, most_pulses(device)) if self.grouped else n_pulses
        wanted = GROUPED_ITEMS if self.grouped else 4 * device.info.units
        splits = -(-wanted // (self.items * -(-launched // self._pulses)))
        self.splits = int(min(splits, n_tiles, n_tiles if self.grouped else 64))
        self._plane = 0 if self.grouped else self._sums * ((stride + 15) // 8 * 8)
        self._buffer: tuple[int, Buffer] | None = None

    @classmethod
    def with_kernels(
        cls, device: Device, shape: tuple[int, int, int, int], build: Callable[[Mapping[str, int]], tuple[Kernel, ...]]
    ) -> tuple[Rows, tuple[Kernel, ...]]:
        """Rows of a shape, and the kernels that `build` makes of their macros: not grouped where the driver allows too
        few work-items for these kernels.

        shape  stride, channels, n_pulses, n_tiles
        """
        of_items = {rows.items: rows for rows in (cls(device, *shape), cls(device, *shape, alone=True))}
        items, kernels = first_allowed(device, of_items, lambda items: build(of_items[items].macros))
        return of_items[items], kernels

    @property
    def macros(self) -> dict[str, int]:
        """Build-time macros."""
        return {"SUMS": self._sums, "PULSES": self._pulses, "GROUPED": int(self.grouped)}

    @property
    def pulse_bytes(self) -> float:
        """Bytes on the device per pulse."""
        return float(8 * self.splits * self.channels * (2 * self.stride + self._plane))

    @property
    def group(self) -> tuple[int, int] | None:
        """Work-items per group."""
        return (self.items, 1) if self.grouped or self.device.is_cpu else None

    def size(self, n_pulses: int) -> tuple[int, int]:
        """Work-items of a launch for so many pulses."""
        return self.items * -(-n_pulses // self._pulses), self.splits

    def buffers(self, n_pulses: int) -> tuple[Buffer, Buffer]:
        """Sums, which a kernel finds and leaves at zero, and rows of zeros: (splits, pulses, channels, 2, stride)."""
        rows = self.splits * n_pulses * self.channels
        if self._buffer is None or self._buffer[0] < rows:
            self._buffer = None  # frees the smaller buffer first
            self._buffer = rows, self.device.zeros(max(8 * rows * self._plane, 16))
        return self._buffer[1], self.device.zeros(16 * rows * self.stride)


def most_pulses(device: Device) -> int:
    """Pulses of a block: enough to keep every unit busy, few enough for the progress to be seen."""
    return max(64, 16 * device.info.units)


def terms(tolerance: float) -> float:
    """Terms of one float32 sum: the error of n equal terms, up to n/2 roundings, may take a fifth of the tolerance."""
    return 0.2 * tolerance * 2 / FLOAT32.unit
