"""One task of echo: its arguments, checked."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..base.errors import NotApplicable
from ..base.validation import instance
from ..model.antenna import Antenna
from ..model.trajectory import Trajectory, receiver_positions
from ..model.waveform import Waveform
from ..numerics.pulse_geometry import PulseGeometry
from ..opencl.device import Device
from ..scattering import added_models, antenna_weights
from ..scattering.antenna_weights import AntennaWeights
from ..scattering.facet_kinds import random
from ..scattering.thin_sheets import ThinSheets, may_hide
from ..scene.scene import Scene
from . import echo_sampling
from .echo_options import EchoOptions
from .echo_request import EchoRequest
from .reflection_options import refuse_forward_with
from .scene_defects import refuse_inside, warn_of_coincident

KEPT = 1 / 16  # of the memory for blocks, for results that a scene keeps for the next call


@dataclass(frozen=True, eq=False)
class EchoTask:
    """Echoes to be computed.

    original         the scene as it was given;  scene  with its random heights
    given_track      the transmitter's as it was given
    track, receiver  of the antennas while pulses are on their way;  motion  what the report says of that
    point            the reference point, m (3,);  weights  of antennas and distances
    devices          that compute them in this process: the first prepares the scene for the report
    """

    options: EchoOptions
    request: EchoRequest
    original: Scene
    scene: Scene
    waveform: Waveform
    given_track: Trajectory
    track: Trajectory
    receiver: Trajectory | None
    point: np.ndarray
    motion: dict[str, object]
    weights: AntennaWeights
    devices: tuple[Device, ...]

    def __getstate__(self) -> dict[str, Any]:
        """For another process: without what belongs to this one."""
        return {**self.__dict__, "options": self.options.portable(), "devices": ()}


def echo_task(scene: Scene, waveform: Waveform, track: Trajectory, options: EchoOptions) -> EchoTask:
    """The task of these arguments; opens the device."""
    check_subjects(scene, waveform, track)
    _check_bounces(options)
    devices = options.devices()
    request = replace(
        EchoRequest.of(options, scene, devices[0]),
        method=options.method,
        crease=options.crease if options.edges else None,
    )
    scene.kept.limit(KEPT * request.budget)
    point = scene.center if options.reference is None else np.asarray(options.reference)
    sends, hears, motion = echo_sampling.in_flight(track, options.receiver, scene, point)
    receiver_positions(sends, hears)
    # before the range window: rough terrain moves its corners
    real = scene.realized(request.seed).at_frequency(waveform.center)
    if len(real.triangles):
        if options.bounces > 1 and real.sheets.any():
            raise NotApplicable(
                f"bounces is {options.bounces}, and the scene has thin sheets (a material with a thickness), of which "
                "single reflections alone are computed: give bounces=1, or materials without thickness"
            )
        if options.bounces > 1 or options.edges:
            added_models.refuse(real, "bounces" if options.bounces > 1 else "edges", "leave it out")
        tx, rx = sends.positions, receiver_positions(sends, hears)
        refuse_with_sheets(options, real, PulseGeometry(tx, rx).ends)
        refuse_inside(real, *([tx] if hears is None else [tx, rx]))
        warn_of_coincident(scene)
        if options.forward and not np.array_equal(tx, rx):
            refuse_forward(options, real)
        echo_sampling.warn_of_wide_angles(tx - real.center, rx - real.center, options.forward)
    weights = antenna_weights.weights_of(options.antenna, options.radar, sends, hears, waveform, real.center)
    return EchoTask(
        options=options,
        request=request,
        original=scene,
        scene=real,
        waveform=waveform,
        given_track=track,
        track=sends,
        receiver=hears,
        point=point,
        motion=motion,
        weights=weights,
        devices=devices,
    )


def refuse_with_sheets(options: EchoOptions, scene: Scene, ends: list[np.ndarray]) -> None:
    """NotApplicable where facets may lie behind thin sheets, and echoes through these are not computed with what is
    asked for."""
    if not options.shadows or not may_hide(scene):
        return
    ThinSheets.of(scene, ends, forward=options.forward)
    others = (("an array", options.array is not None), ("edges=True", options.edges))
    names = [name for name, is_given in others if is_given]
    if names:
        raise NotApplicable(
            f"the scene has thin sheets (a material with a thickness), and what lies behind them is not computed with "
            f"{names[0]}: leave it out, or give shadows=False where nothing lies behind them"
        )


def refuse_forward(options: EchoOptions, scene: Scene) -> None:
    """NotApplicable for arrays and surfaces of which forward scatter is not computed."""
    refuse_forward_with(options.bounces, options.edges)
    if options.array is not None:
        raise NotApplicable("forward=True is for one transmitter and one receiver, not for an array")
    if random(scene).any():
        row = int(np.argmax(random(scene)))
        raise NotApplicable(
            f"forward=True is for coherent surfaces, and facet {row} has a random echo (roughness, or a diagram of its "
            "material): give roughness=0 and a smooth material"
        )


def _check_bounces(options: EchoOptions) -> None:
    """ValueError for options that do not go with several reflections."""
    if options.bounces == 1:
        return
    several = f"bounces is {options.bounces}"
    if not options.shadows:
        raise ValueError(
            f"{several} with shadows=False; what reflects to another facet also shades it: give shadows=True"
        )
    antennas = options.antenna if isinstance(options.antenna, (tuple, list)) else (options.antenna,)
    if any(isinstance(one, Antenna) and one.two_way and not one.has_root for one in antennas):
        raise ValueError(
            f"{several} with a two-way pattern that is negative or complex somewhere; waves leave and arrive in "
            "different directions after several reflections, and such a pattern does not say which gain each has: give "
            "the pattern of one way, without two_way=True"
        )


def check_subjects(scene: object, waveform: object, track: object) -> None:
    """TypeError for what is no scene, waveform or track."""
    for name, value, kind in (("scene", scene, Scene), ("waveform", waveform, Waveform), ("track", track, Trajectory)):
        instance(name, value, kind)
