"""The method of echoes and the plan of the scene for it: what is decided before the first pulse."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

from ..base.errors import ToleranceUnreachable
from ..base.stage_timer import Clock
from ..opencl.device import Device
from ._single_channel import SingleChannel, SingleEchoes
from .channels.array_channels import ArrayChannels
from .channels.array_channels import Method as ArrayMethod
from .echo_request import EchoRequest
from .scene_echoes import SceneEchoes
from .scene_plan import ScenePlan, planned_scene
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
