"""The method of echoes, the plan of the scene for it, and how much work they are: known before any facet is cut."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

from ..base.errors import ToleranceUnreachable
from ..base.stage_timer import Clock
from ..numerics import cost_model
from ..opencl.device import Device
from ..scattering.rough_pieces import RoughPieces
from ..scene import terrain
from ._single_channel import SingleChannel, SingleEchoes
from .channels.array_channels import ArrayChannels
from .channels.array_channels import Method as ArrayMethod
from .echo_request import EchoRequest
from .points.point_plan import PointCosts, expected_method
from .scene_echoes import SceneEchoes
from .scene_plan import ScenePlan, planned_scene, samples_shadows
from .scene_preparation import prepare_scene

Channels = SingleChannel | ArrayChannels
Method = SingleEchoes | ArrayMethod


@dataclass(frozen=True, eq=False)
class PlannedEchoes:
    """A method, and the plan of the scene for it.

    scene   how the scene is prepared;  prepared  the scene, where that has been done
    others  methods that are taken where the prepared scene cannot meet the tolerance, and what is asked of each
    """

    channels: Channels
    method: Method
    scene: ScenePlan
    others: Sequence[tuple[Method, EchoRequest]]
    prepared: SceneEchoes | None = None

    @classmethod
    def first_of(cls, channels: Channels, methods: Sequence[tuple[Any, EchoRequest]]) -> PlannedEchoes:
        """The first of the methods whose plan can meet the tolerance; ToleranceUnreachable of the last one."""
        (method, request), *others = methods
        try:
            return cls(channels, method, planned_scene(request, channels.seen, method.bands), others)
        except ToleranceUnreachable:
            if not others:
                raise
        return cls.first_of(channels, others)

    def with_scene(self) -> tuple[PlannedEchoes, SceneEchoes]:
        """The same with the scene prepared, and that scene."""
        if self.prepared is not None:
            return self, self.prepared
        try:
            prepared = prepare_scene(self.scene)
        except ToleranceUnreachable:
            if not self.others:
                raise
            return self.first_of(self.channels, self.others).with_scene()
        return replace(self, prepared=prepared), prepared

    def unprepared(self) -> PlannedEchoes:
        """The same without the prepared scene and the methods that were not needed."""
        return replace(self, method=self.method.fresh(), others=(), prepared=None)

    def on(self, device: Device, budget: float) -> PlannedEchoes:
        """The same for another device, with so many bytes for blocks there: its scene is to be prepared."""
        request = replace(self.scene.request, device=device, budget=budget, progress=None, clock=Clock())
        scene = replace(self.scene, request=request)
        return replace(self, method=self.method.fresh(), scene=scene, prepared=None)

    def asked_by(self, request: EchoRequest) -> PlannedEchoes:
        """The same with the clock and the progress function of another request."""

        def renewed(old: EchoRequest) -> EchoRequest:
            return replace(old, clock=request.clock, progress=request.progress)

        return replace(
            self,
            scene=replace(self.scene, request=renewed(self.scene.request)),
            others=[(method, renewed(old)) for method, old in self.others],
            prepared=self.prepared and replace(self.prepared, request=renewed(self.prepared.request)),
        )


class EchoWork(NamedTuple):
    """Work of echoes, in seconds of one core.

    tiling, cutting  of preparing points and facets;  adding  of their echoes
    pieces           about the number of facets after cutting;  contributions  pairs of scatterer, pulse and channel
    by_levels        whether points are expected to be added by levels
    """

    tiling: float
    cutting: float
    adding: float
    pieces: float
    contributions: float
    by_levels: bool

    @property
    def preparing(self) -> float:
        """Seconds before the first pulse."""
        return self.tiling + self.cutting

    @property
    def seconds(self) -> float:
        """Seconds of the whole job."""
        return self.preparing + self.adding

    @classmethod
    def of(cls, scene: ScenePlan, runs: int, n_samples: int) -> EchoWork:
        """The work of a scene's echoes;  runs  pulses of one transmitter and receiver, n_samples each."""
        request, seen = scene.request, scene.seen
        n_points = len(seen.scene.positions) if request.same else 0
        smooth, rough = scene.n_pieces()
        device = None if scene.subdivision is None else scene.subdivision.device
        on_device = device is not None and RoughPieces.suited(device, seen.scene).any()
        cut_rough = cost_model.CUT_PIECE_ON_DEVICE if on_device else cost_model.CUT_PIECE
        cutting = cost_model.CUT_PIECE * smooth + cut_rough * rough
        lit, n_pulses = 0.0, len(seen.antennas)
        if request.shadows:
            sampled = samples_shadows(request, seen)
            clipped = n_pulses * (smooth if sampled else smooth + rough)
            looks = min(n_pulses, cost_model.LOOKS) if sampled and _shadows_may_fall(scene) else 0
            cutting += cost_model.CLIPPED_PIECE * clipped + cost_model.LOOK_AT_PIECE * rough * looks
            lit = cost_model.LIT_PIECE * clipped
        n_polarizations = len(request.polarizations)
        pulse = cost_model.ECHO_PULSE + cost_model.ECHO_SAMPLE * n_samples + cost_model.SPREAD_PIECE * (smooth + rough)
        cost, by_levels = points_cost(scene) if n_points else (0.0, False)
        adding = runs * (n_polarizations * pulse + cost_model.SPREAD_POINT * cost * n_points) + lit
        contributions = float(runs * (n_points + smooth + rough))
        tiling, cutting, adding = 1e-6 * cost_model.TILED_POINT * n_points, 1e-6 * cutting, 1e-6 * adding
        return cls(tiling, cutting, adding, smooth + rough, contributions, by_levels)


def points_cost(scene: ScenePlan) -> tuple[float, bool]:
    """About the cost of a pair of point and pulse, in contributions, and whether points are added by levels."""
    request, seen, n_nodes = scene.request, scene.seen, scene.n_nodes
    tolerance = scene.error_budget - scene.weight_error.of(n_nodes, scene.error_budget)
    weights, positions = seen.weights.at(seen.antennas), seen.scene.positions
    case = weights, scene.bands[0], tolerance, n_nodes
    if request.method == "direct":
        return PointCosts.of(len(positions), *case).direct, False
    cost, by_levels = expected_method(positions, *case, request.device)
    return cost, by_levels or request.method == "factorized"


def _shadows_may_fall(scene: ScenePlan) -> bool:
    """Whether something may be hidden from an antenna: not on a terrain alone that all of them overlook."""
    original = scene.seen.original
    if original.heights is None or len(original.triangles) > terrain.n_facets(original.heights):
        return True
    return not terrain.is_overlooked(original.heights, original.bounds, scene.seen.antennas.ends)
