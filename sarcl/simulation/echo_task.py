"""One task of echo: its arguments, checked."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..base.validation import instance
from ..model.antenna import Antenna
from ..model.trajectory import Trajectory
from ..model.waveform import Waveform
from ..opencl.device import Device
from ..scattering import antenna_weights
from ..scattering.antenna_weights import AntennaWeights
from ..scene.scene import Scene
from . import echo_sampling
from .echo_options import EchoOptions
from .echo_request import EchoRequest

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
    echo_sampling.receiver_positions(sends, hears)
    real = scene.realized(request.seed)  # before the range window: it moves the corners of rough terrain
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


def _check_bounces(options: EchoOptions) -> None:
    """ValueError for options that do not go with several reflections."""
    if options.bounces == 1:
        return
    several = f"bounces is {options.bounces}"
    if not options.shadows:
        raise ValueError(
            f"{several} with shadows=False; what reflects to another facet also shades it: give shadows=True"
        )
    if options.array is not None:
        raise ValueError(
            f"{several} with an array; several reflections are computed for one antenna or a pair: give bounces=1"
        )
    antennas = options.antenna if isinstance(options.antenna, (tuple, list)) else (options.antenna,)
    if any(isinstance(one, Antenna) and one.two_way for one in antennas):
        raise ValueError(
            f"{several} with a two-way pattern; waves leave and arrive in different directions after several "
            "reflections: give the pattern of one way"
        )


def check_subjects(scene: object, waveform: object, track: object) -> None:
    """TypeError for what is no scene, waveform or track."""
    for name, value, kind in (("scene", scene, Scene), ("waveform", waveform, Waveform), ("track", track, Trajectory)):
        instance(name, value, kind)
