"""One task of spectral_echo: its arguments, checked; what is refused."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ...arrays.channels import is_single
from ...base.errors import NotApplicable
from ...model.trajectory import Trajectory
from ...model.waveform import Waveform
from ...numerics.pulse_geometry import PulseGeometry
from ...opencl.device import Device
from ...scattering import added_models, antenna_weights
from ...scene.scene import Scene
from .. import echo_sampling
from ..echo_request import EchoRequest
from ..scene_defects import refuse_inside, warn_of_coincident
from ..scene_options import SceneOptions
from ..scene_plan import SeenScene
from ._straight_track import StraightTrack, straight_track

STRAIGHT = 0.05  # share of the tolerance: phase errors, rad, of a track that is not quite straight


@dataclass(frozen=True, eq=False)
class SpectralTask:
    """Echoes to be computed by Fourier transforms.

    variant       "exact" or "saras";  seen  the scene as the antennas see it
    frequencies   of the samples, Hz (n,), and their step;  window  (near, far), m about the reference
    motion        entries of the report;  devices  of this process, that share the work
    """

    options: SceneOptions
    variant: str
    request: EchoRequest
    track: Trajectory
    line: StraightTrack
    seen: SeenScene
    frequencies: np.ndarray
    step: float
    window: tuple[float, float]
    motion: dict[str, object]
    devices: tuple[Device, ...] = ()

    def __getstate__(self) -> dict[str, Any]:
        """For another process: without what belongs to this one."""
        return {**self.__dict__, "options": self.options.portable(), "devices": ()}


def spectral_task(
    scene: Scene,
    waveform: Waveform,
    track: Trajectory,
    options: SceneOptions,
    devices: tuple[Device, ...],
    variant: str = "exact",
) -> SpectralTask:
    """The task of these arguments, planned on the first of the devices. NotApplicable, which names `echo`, for what
    spectral_echo cannot take."""
    request = EchoRequest.of(options, scene, devices[0])
    if options.receiver is not None:
        raise NotApplicable("spectral_echo is for one antenna that transmits and receives; use echo for a receiver")
    if options.array is not None and not is_single(options.array):
        raise NotApplicable("spectral_echo takes no arrays; use echo, which computes their channels")
    if options.bounces > 1:
        raise NotApplicable(f"bounces is {options.bounces}; spectral_echo computes single reflections: use echo")
    if not track.stop_and_go:
        raise NotApplicable(
            "the track is that of an orbit, with the receiver where it is at the echo's arrival; spectral_echo is for "
            "straight tracks, stop and go: use echo"
        )
    if scene.sheets.any():
        raise NotApplicable("the scene has thin sheets (a material with a thickness), for which use echo or rcs")
    added_models.refuse(scene, "spectral_echo", "use echo")
    line = straight_track(track, waveform.center + waveform.bandwidth / 2, STRAIGHT * request.tolerance)
    tx = track.positions
    point = scene.center if options.reference is None else np.asarray(options.reference)
    _, _, motion = echo_sampling.in_flight(track, None, scene, point)
    reference_range = echo_sampling.half_path(tx, tx, point)
    real = scene.realized(request.seed).at_frequency(waveform.center)
    refuse_inside(real, tx)
    warn_of_coincident(scene)
    weights = antenna_weights.weights_of(options.antenna, options.radar, track, None, waveform, real.center)
    near, far = echo_sampling.window(real, waveform, tx, tx, reference_range, options.range_window)
    frequency, step, n_samples = echo_sampling.sampling(waveform, near, far, options.compressed)
    antennas = PulseGeometry.sampled(
        tx, tx, reference_range, first=frequency, step=step, n_samples=n_samples, window=(near, far)
    )
    return SpectralTask(
        options=options,
        variant=variant,
        request=request,
        track=track,
        line=line,
        seen=SeenScene(scene, real, waveform, antennas, weights),
        frequencies=frequency + step * np.arange(n_samples),
        step=step,
        window=(near, far),
        motion=motion,
        devices=devices,
    )
