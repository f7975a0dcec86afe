"""The method of echoes of points: each pulse by itself, or factorised, for the points that all pulses see."""

from __future__ import annotations

import functools
from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np

from ...base.boxes import box
from ...base.errors import NotApplicable
from ...model.waveform import Waveform
from ...numerics import cost_model
from ...numerics.interpolator_choice import choose_interpolator
from ...numerics.plan import Plan, carrier_steps
from ...numerics.pulse_geometry import PulseGeometry
from ...opencl.device import Device
from ...scattering.antenna_weights import AntennaWeights
from ...scattering.scatterers import Points
from ..kernel_images import PatchSamples, sample_patches
from ..spreading import Band, ChannelView, TiledScatterers
from ._levels import FactorizedPlan, plan_levels
from ._point_cells import PointCells
from .direct import PointSpreader, tiled_points
from .factorized import FactorizedSpreader

WINDOW_DEPTHS = (0, 3, 6)  # depths of cells that are looked for in the range window, coarse ones first
FEWEST_PULSES = 8  # fewer are not decimated


@dataclass(frozen=True, eq=False)
class PointPlan:
    """How the points of a channel are added.

    direct      points that are added at each pulse, and their plan;  factorized  cells of points that every pulse sees,
                their numbers among all points, and their plan. None: there are none
    """

    direct: tuple[TiledScatterers, Plan] | None
    factorized: tuple[PointCells, np.ndarray, FactorizedPlan] | None = None

    @property
    def plans(self) -> list[Plan | FactorizedPlan]:
        """The plans, that of most points first."""
        by_levels = [] if self.factorized is None else [self.factorized[2]]
        return [*by_levels, *([] if self.direct is None else [self.direct[1]])]

    @property
    def predicted_error(self) -> float:
        """Relative error: the larger one, since each is relative to its own points."""
        return max(plan.predicted_error for plan in self.plans)

    def describe(self) -> dict[str, object]:
        """The plan of most points, in words and numbers."""
        return self.plans[0].describe("spread")

    def spreaders(
        self, device: Device, points: Points, view: ChannelView, nodes: np.ndarray, tolerance: float, budget: float
    ) -> Iterator[PointSpreader | FactorizedSpreader]:
        """What adds the points; nodes, tolerance, budget  as PointSpreader takes them."""
        if self.factorized is not None:
            cells, numbers, plan = self.factorized
            amplitudes, n_samples = points.amplitudes[numbers], len(view.frequencies)
            yield FactorizedSpreader(device, plan, cells, amplitudes, view.antennas, n_samples, budget)
        if self.direct is not None:
            yield PointSpreader(*self.direct, view, nodes, tolerance, budget)


@dataclass(eq=False)
class PreparedPoints:
    """Points, and what the plans of all channels share.

    antennas, waveform, weights  of all channels, from which the images of kernels are measured
    method  "auto", "direct" or "factorized"
    """

    device: Device
    points: Points
    antennas: PulseGeometry
    waveform: Waveform
    weights: AntennaWeights
    method: str
    _latest: tuple[PulseGeometry, tuple[Band, float], PointPlan] | None = field(default=None, init=False)

    def __len__(self) -> int:
        return len(self.points)

    def plan(self, antennas: PulseGeometry, band: Band, tolerance: float) -> PointPlan:
        """The plan for one channel; the last one is kept.

        ToleranceUnreachable: none meets the tolerance. NotApplicable: "factorized" is asked for and not possible.
        """
        key = band, tolerance
        if self._latest is None or self._latest[0] is not antennas or self._latest[1] != key:
            self._latest = antennas, key, self._planned(antennas, band, tolerance)
        return self._latest[2]

    def _planned(self, antennas: PulseGeometry, band: Band, tolerance: float) -> PointPlan:
        if self.method != "direct":
            by_levels = self._by_levels(antennas, band, tolerance)
            if isinstance(by_levels, PointPlan):
                return by_levels
            if self.method == "factorized":
                raise NotApplicable(f'method="factorized" is not possible: {by_levels}; pass method="auto"')
        return PointPlan((self._whole, self._whole.plan(antennas, band, tolerance)))

    def _by_levels(self, antennas: PulseGeometry, band: Band, tolerance: float) -> PointPlan | str:
        """The factorised plan, or the reason why the direct one is taken."""
        forced, pairs = self.method == "factorized", len(self) * len(antennas)
        if self.weights.is_needed:
            return "antenna gains and spreading losses change along the track"
        if len(antennas) < FEWEST_PULSES:
            return f"the track has {len(antennas)} pulses, and {FEWEST_PULSES} are the fewest that are decimated"
        if not forced and pairs < cost_model.SEARCH_PAYS:
            return "planning would take longer than it saves"
        if not forced and not self.device.is_cpu and len(antennas) < cost_model.PULSES_BESIDE_CELLS:
            return "the GPU adds these pulses before the host has made cells"
        seen = points_in_window(self._cells, antennas)
        numbers, cells = self._cells.order, self._cells
        if not seen.all():
            numbers = numbers[seen]
            if len(numbers) * len(antennas) < (1 if forced else cost_model.SEARCH_PAYS):
                return "too few points lie inside the range window at every pulse"
            cells = PointCells(self.points.positions[numbers])
            numbers = numbers[cells.order]
        plan = plan_levels(cells, antennas, band, tolerance, lambda leaf: self._image_error(leaf, band))
        if isinstance(plan, str):
            return plan
        if not forced and plan.cost > cost_model.MERGING_PAYS * _direct_cost(band, tolerance, len(self)):
            return "the direct method costs less"
        if seen.all():
            return PointPlan(None, (cells, numbers, plan))
        rest = self._tiled(self._cells.order[~seen])
        return PointPlan((rest, rest.plan(antennas, band, tolerance)), (cells, numbers, plan))

    @functools.cached_property
    def _cells(self) -> PointCells:
        return PointCells(self.points.positions)

    @functools.cached_property
    def _whole(self) -> TiledScatterers:
        return tiled_points(self.device, self.points, self.antennas, self.waveform, self.weights)

    def _tiled(self, numbers: np.ndarray) -> TiledScatterers:
        """Some of the points, in tiles."""
        points = Points(self.points.positions[numbers], self.points.amplitudes[numbers])
        return tiled_points(self.device, points, self.antennas, self.waveform, self.weights)

    @functools.cached_property
    def _patches(self) -> PatchSamples:
        def amplitudes(numbers: np.ndarray, pulse: int, frequency: float) -> np.ndarray:
            return self.points.amplitudes[numbers][:, None]

        return sample_patches(self.points.positions, self._cells.order, self.antennas, self.waveform, amplitudes)

    def _image_error(self, plan: Plan, band: Band) -> float:
        """Error of a plan's kernel, larger where points lie so evenly that its images add up."""
        kernel = plan.interpolator
        return max(kernel.error, self._patches.error(kernel, plan.length, band.n_samples, band.bandwidth))


def _direct_cost(band: Band, tolerance: float, n_points: int) -> float:
    """About the cost of a pair that is added directly, in contributions."""
    steps = carrier_steps(band.carrier, band.n_samples, band.bandwidth)
    return choose_interpolator(tolerance, band.n_samples, n_points, steps)[2]


def points_in_window(cells: PointCells, antennas: PulseGeometry) -> np.ndarray:
    """Whether points, in the order of the cells, lie in the range window of every pulse, judged by cells: bool (n,)."""
    inside = np.zeros(len(cells), bool)
    undecided = np.zeros(1, int)  # first points of cells of the depth before that may be inside or not
    for depth, before in zip(WINDOW_DEPTHS, (0, *WINDOW_DEPTHS), strict=False):
        first, larger = cells.first(depth), cells.first(before)
        parents = larger[np.searchsorted(larger, first[:-1], side="right") - 1]
        candidates = np.flatnonzero(np.isin(parents, undecided))
        crossing = []
        for begin, end in zip(first[candidates].tolist(), first[candidates + 1].tolist(), strict=True):
            low, high = box(cells.positions[begin:end])
            margin = antennas.depth((low + high) / 2 + cells.center)
            radius = float(np.linalg.norm(high - low)) / 2 * (1 + 1e-9)
            if margin.min() >= radius:
                inside[begin:end] = True
            elif margin.max() >= -radius:
                crossing.append(begin)
        undecided = np.array(crossing, int)
    return inside
