"""The method of echoes of points: each pulse by itself, or factorised, for the points that all pulses see."""

from __future__ import annotations

import functools
import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from ...base.errors import NotApplicable
from ...model.waveform import Waveform
from ...numerics import cost_model
from ...numerics.plan import Plan
from ...numerics.polynomials import lagrange
from ...numerics.pulse_geometry import PulseGeometry
from ...opencl.device import Device
from ...scattering.antenna_weights import AntennaWeights
from ...scattering.kept_amplitudes import AmplitudeSamples
from ...scattering.scatterers import Points
from ..factorized.cells import ScattererCells, scatterers_in_window
from ..factorized.levels import FEWEST_PULSES, Amplitudes, FactorizedPlan, expected_cost, plan_levels
from ..factorized.scatterers import Channel, Scatterers
from ..factorized.spreader import FactorizedSpreader
from ..kernel_images import PatchSamples, sample_patches
from ..spreading import Band, ChannelView, TiledScatterers
from .direct import PointSpreader, tiled_points


@dataclass(frozen=True, eq=False)
class PointPlan:
    """How the points of a channel are added.

    direct      points that are added at each pulse, and their plan;  factorized  cells of points that every pulse sees,
                their numbers among all points, and their plan. None: there are none
    numbers     of the points that are added at each pulse; None: all
    """

    direct: tuple[TiledScatterers, Plan] | None
    factorized: tuple[ScattererCells, np.ndarray, FactorizedPlan] | None = None
    numbers: np.ndarray | None = None

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

    def direct_spreader(
        self, view: ChannelView, nodes: np.ndarray, tolerance: float, budget: float
    ) -> PointSpreader | None:
        """What adds points at each pulse; arguments as PointSpreader takes them."""
        return None if self.direct is None else PointSpreader(*self.direct, view, nodes, tolerance, budget)

    def factorized_spreader(
        self,
        device: Device,
        points: Points,
        view: ChannelView,
        nodes: np.ndarray,
        columns: Sequence[int],
        budget: float,
    ) -> FactorizedSpreader | None:
        """What adds points by levels; nodes, budget  as PointSpreader takes them; columns  in which points reflect."""
        if self.factorized is None:
            return None
        cells, numbers, plan = self.factorized
        amplitudes = points.amplitudes[numbers]
        basis = lagrange(nodes, view.frequencies).astype(np.float32)
        ratios = (nodes / view.weights.frequency).tolist()
        channels = tuple(
            Channel(tuple(columns), None if len(nodes) == 1 else weight, ratio=ratio)
            for weight, ratio in zip(basis, ratios, strict=True)
        )
        scatterers = Scatterers(cells, (amplitudes.real, amplitudes.imag), channels, view.weights)
        return FactorizedSpreader(device, plan, scatterers, view.antennas, len(view.frequencies), budget)


@dataclass(frozen=True, eq=False)
class PointCosts:
    """Costs of adding n points of a channel, in contributions per pair of point and pulse.

    gain  of antennas and distances, at each pulse or kept position;  direct  at each pulse
    fewest  points for which levels are looked for
    """

    gain: float
    direct: float
    fewest: float

    @classmethod
    def of(cls, n: int, weights: AntennaWeights, band: Band, tolerance: float, n_nodes: int) -> PointCosts:
        """n_nodes  frequencies at which gains are computed"""
        gain = cost_model.GAIN if weights.is_needed else 0.0
        direct = n_nodes * (band.spreading_cost(tolerance, n) + gain)
        return cls(gain, direct, cost_model.ECHO_SEARCH_PAYS / (direct * len(weights.geometry)))


def expected_method(
    positions: np.ndarray, weights: AntennaWeights, band: Band, tolerance: float, n_nodes: int, device: Device
) -> tuple[float, bool]:
    """About the cost per pair of point and pulse of the method that "auto" takes, and whether it is by levels."""
    antennas, costs = weights.geometry, PointCosts.of(len(positions), weights, band, tolerance, n_nodes)
    beside_cells = not device.is_cpu and len(antennas) < cost_model.PULSES_BESIDE_CELLS
    if len(antennas) < FEWEST_PULSES or len(positions) < costs.fewest or beside_cells:
        return costs.direct, False
    kind = Amplitudes(lambda leaf: 0.0, None, n_nodes, costs.gain)
    by_levels = expected_cost(ScattererCells(positions), antennas, band, tolerance, kind)
    return min(by_levels, costs.direct), by_levels <= cost_model.LEVELS_PAY * costs.direct


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
    _latest: tuple[PulseGeometry, tuple[Band, float, int], PointPlan] | None = field(default=None, init=False)

    def __len__(self) -> int:
        return len(self.points)

    def plan(self, weights: AntennaWeights, band: Band, tolerance: float, n_nodes: int) -> PointPlan:
        """The plan for one channel; the last one is kept.

        weights  of the channel's antennas;  n_nodes  frequencies at which gains are computed

        ToleranceUnreachable: none meets the tolerance. NotApplicable: "factorized" is asked for and not possible.
        """
        key, antennas = (band, tolerance, n_nodes), weights.geometry
        if self._latest is None or self._latest[0] is not antennas or self._latest[1] != key:
            self._latest = antennas, key, self._planned(weights, band, tolerance, n_nodes)
        return self._latest[2]

    def _planned(self, weights: AntennaWeights, band: Band, tolerance: float, n_nodes: int) -> PointPlan:
        antennas = weights.geometry
        if self.method != "direct":
            by_levels = self._by_levels(weights, band, tolerance, n_nodes)
            if isinstance(by_levels, PointPlan):
                return by_levels
            if self.method == "factorized":
                raise NotApplicable(f'method="factorized" is not possible: {by_levels}; pass method="auto"')
        return PointPlan((self._whole, self._whole.plan(antennas, band, tolerance)))

    def _by_levels(self, weights: AntennaWeights, band: Band, tolerance: float, n_nodes: int) -> PointPlan | str:
        """The factorised plan, or the reason why the direct one is taken."""
        antennas, forced = weights.geometry, self.method == "factorized"
        costs = PointCosts.of(len(self), weights, band, tolerance, n_nodes)
        fewest = 1 if forced else costs.fewest
        if len(antennas) < FEWEST_PULSES:
            return f"the track has {len(antennas)} pulses, and {FEWEST_PULSES} are the fewest that are decimated"
        if len(self) < fewest:
            return "planning would take longer than it saves"
        if not forced and not self.device.is_cpu and len(antennas) < cost_model.PULSES_BESIDE_CELLS:
            return "the GPU adds these pulses before the host has made cells"
        seen, numbers, cells = scatterers_in_window(self._cells, antennas), None, self._cells
        if not seen.all():
            numbers = self._cells.order[seen]
            if len(numbers) < fewest:
                return "too few points lie inside the range window at every pulse"
            cells = ScattererCells(self.points.positions[numbers])
        samples = None
        if weights.is_needed:
            highest = band.carrier + band.bandwidth / 2
            some = slice(None) if numbers is None else numbers
            places, amplitudes = self.points.positions[some], self.points.amplitudes[some]
            samples = AmplitudeSamples.of_points(places, amplitudes, weights, highest)
        kind = Amplitudes(lambda leaf: self._image_error(leaf, band), samples, n_nodes, costs.gain)
        most = math.inf if forced else cost_model.LEVELS_PAY * costs.direct
        plan = plan_levels(cells, antennas, band, tolerance, kind, most=most)
        if isinstance(plan, str):
            return plan
        if numbers is None:
            return PointPlan(None, (cells, cells.order, plan))
        others = self._cells.order[~seen]
        rest = self._tiled(others)
        return PointPlan((rest, rest.plan(antennas, band, tolerance)), (cells, numbers[cells.order], plan), others)

    @functools.cached_property
    def _cells(self) -> ScattererCells:
        return ScattererCells(self.points.positions)

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
            gains = self.weights.weights(self.points.positions[numbers], pulse, frequency)
            return np.asarray((gains * self.points.amplitudes[numbers])[:, None])

        return sample_patches(self.points.positions, self._cells.order, self.antennas, self.waveform, amplitudes)

    def _image_error(self, plan: Plan, band: Band) -> float:
        """Error of a plan's kernel, larger where points lie so evenly that its images add up."""
        kernel = plan.interpolator
        return max(kernel.error, self._patches.error(kernel, plan.length, band.n_samples, band.bandwidth))
