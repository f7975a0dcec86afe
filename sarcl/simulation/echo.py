"""Echoes of points and facets, pulse by pulse, to a stated tolerance."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import Any, Literal, TypedDict

import numpy as np
from numpy.typing import ArrayLike

from ..arrays.channels import is_single
from ..base.errors import confirm_tolerance
from ..base.report import Report
from ..base.types import PathLike
from ..base.validation import array as numbers
from ..base.validation import choice, flag, instance
from ..model.antenna import Antenna
from ..model.antenna_array import AntennaArray
from ..model.phase_history import PhaseHistory
from ..model.radar import Radar
from ..model.trajectory import Trajectory
from ..model.waveform import Waveform
from ..numerics.pulse_geometry import PulseGeometry
from ..opencl.device import DeviceChoice
from ..scattering import antenna_weights
from ..scene.scene import Scene
from . import echo_sampling
from .channels.array_echo import array_echo
from .channels.channel_rows import CHANNELS, RECEIVE
from .echo_check import measure_error, worth_checking
from .echo_output import EchoOutput
from .echo_request import Polarization as Polarization
from .echo_request import Progress
from .echo_request import echo_request as echo_request
from .scene_preparation import prepare_scene
from .spreading import Band, Counts

Skip = Literal[
    "zero reflectivity", "facing away", "range window", "out of beam", "equal channels", "interpolated channels"
]  # fmt: skip
SKIPS = ("zero reflectivity", "facing away", "range window", "out of beam", "equal channels", "interpolated channels")


class EchoOptions(TypedDict, total=False):
    """Options of `echo`."""

    receiver: Trajectory | None
    polarization: Polarization | Literal["all"] | Sequence[Polarization]
    vertical: ArrayLike | None
    range_window: ArrayLike | None
    reference: ArrayLike | None
    array: AntennaArray | None
    channels: Literal["simultaneous", "separated"]
    receive: Literal["reference", "own", "all"]
    antenna: Antenna | tuple[Antenna, Antenna] | None
    radar: Radar | None
    shadows: bool
    seed: int
    skip: bool | Collection[Skip]
    compressed: bool
    max_edge: float | Literal["auto"] | None
    max_bytes: float | None
    out: PathLike | None
    tolerance: float
    check: bool | None
    device: DeviceChoice | None
    progress: Progress | None


def echo(
    scene: Scene,
    waveform: Waveform,
    track: Trajectory,
    *,
    receiver: Trajectory | None = None,
    polarization: Polarization | Literal["all"] | Sequence[Polarization] = "HH",
    vertical: ArrayLike | None = None,
    range_window: ArrayLike | None = None,
    reference: ArrayLike | None = None,
    array: AntennaArray | None = None,
    channels: Literal["simultaneous", "separated"] = "simultaneous",
    receive: Literal["reference", "own", "all"] = "reference",
    antenna: Antenna | tuple[Antenna, Antenna] | None = None,
    radar: Radar | None = None,
    shadows: bool = True,
    seed: int = 0,
    skip: bool | Collection[Skip] = True,
    compressed: bool = True,
    max_edge: float | Literal["auto"] | None = "auto",
    max_bytes: float | None = None,
    out: PathLike | None = None,
    tolerance: float = 1e-3,
    check: bool | None = None,
    device: DeviceChoice | None = None,
    progress: Progress | None = None,
) -> PhaseHistory:
    """Echoes s_p(f) = sum_k a_k(p) W(f) exp(-j 2 pi f (tau_k(p) - tau_ref(p))) of every pulse, compressed.

    scene         points (|amplitude|^2 = RCS, m^2) and facets: physical optics with the materials' Fresnel
                  coefficients, the exact phase of the wave over every facet, single scattering (docs/theory/facets.md)
    track         transmitter; receiver  a track of as many pulses, default the transmitter's; its positions count as
                  they are given
    polarization  "HH", "HV", "VH" or "VV" (first received, then sent), a sequence of these, or "all": one row per
                  pulse for each, pulse by pulse. Points keep the polarisation: they have no echo in HV and VH
    vertical      (3,), direction: H is perpendicular to it, V in a plane with it; default z, or in Earth-centred
                  coordinates the ellipsoid's normal at the scene's centre
    range_window  (near, far) m about the reference, default the smallest that holds the scene plus 10 %;
                  scatterers outside it are left out, row by row
    reference     point of zero phase, m (3,), default the centre of the scene's box
    array         sarcl.AntennaArray at the transmitter, along the axes of the track's attitude where it has one:
                  element n sends the waveform shifted by its offset, Hz; None: one element
    channels      "simultaneous": all channels are added up, each after its own matched filter, a row for every pulse
                  and receiver; "separated": a row of its own for every pulse, sending element and receiver
    receive       "reference": at the array's reference point; "own": every element receives its own channel
                  ("separated" only); "all": every element receives all
    antenna       sarcl.Antenna, or (transmitting, receiving), aimed by the tracks' attitude (sarcl.pointing); None: 1
    radar         sarcl.Radar: amplitudes fall with range, samples are in sqrt(W); None: |sample|^2 = RCS at any range
    shadows       True: of every facet only the part counts that both antennas see at each pulse
                  (docs/theory/shadows.md; points are always seen)
    seed          of the facets' random heights (scene.roughness); the same for any device and block size
    skip          True, False or a set of reasons: "zero reflectivity", "facing away", "range window",
                  "out of beam", "equal channels" (of one carrier and position), "interpolated channels" (from echoes at
                  a few positions of an array to all its elements)
    compressed    False keeps the pulse's own spectrum (see `sarcl.compress`)
    max_edge      facets are cut until no edge is longer, m; "auto": as finely as the tolerance needs, rough ones at
                  least to half a resolution cell; None: they are not cut
    max_bytes     memory for blocks, default 1 GiB on CPUs, half the memory of a GPU; facets are cut into as many as it
                  holds (512 bytes each; at least 256 MiB), by default a quarter of the machine's memory
    out           an HDF5 file of sarcl's (.h5): samples are written there pulse after pulse, and read when needed
    tolerance     L2 error of the samples, relative to the larger of their norm and the norm they would have if
                  scatterers added with random phases
    check         recompute 256 random samples exactly, fewer above 20 000 facets; None: where that costs less than 2 %
    progress      called as progress(stage, done, total)

    Antennas rest while a pulse is on its way (stop and go), except on tracks of `Orbit.trajectory`: there the receiver
    is where it is when the echo of the reference point arrives, on the rotating Earth. report.plan says which, and how
    much stop and go leaves out (docs/guide/orbits.md).

    Returns a PhaseHistory. ToleranceUnreachable, a ValueError: a tolerance that cannot be met, with the best that can,
    before the work starts. ToleranceMissed, a ValueError that holds the finished echoes: the check measured more than
    the tolerance. ValueError, MemoryError, sarcl.NoDeviceError say what else does not fit.
    Source: the echo equation of sarcl/__init__.py.
    """
    for name, value, kind in (("scene", scene, Scene), ("waveform", waveform, Waveform), ("track", track, Trajectory)):
        instance(name, value, kind)
    compressed = flag("compressed", compressed)
    choice("channels", channels, CHANNELS)
    choice("receive", receive, RECEIVE)
    if check is not None:
        flag("check", check)
    request = echo_request(
        scene, SKIPS, polarization=polarization, vertical=vertical, shadows=shadows, seed=seed, skip=skip,
        max_edge=max_edge, max_bytes=max_bytes, tolerance=tolerance, device=device, progress=progress,
    )  # fmt: skip
    opened, seed = request.device, request.seed
    point = scene.center if reference is None else numbers("reference", reference, np.float64, (3,))
    track, receiver, motion = echo_sampling.in_flight(track, receiver, scene, point)
    rx = echo_sampling.receiver_positions(track, receiver)
    tx = track.positions
    reference_range = echo_sampling.half_path(tx, rx, point)
    original_scene, scene = scene, scene.realized(seed)  # before the window: it moves the corners of rough terrain
    weights = antenna_weights.weights_of(antenna, radar, track, receiver, waveform, scene.center)
    if array is not None:
        instance("array", array, AntennaArray)
        if not is_single(array):
            return array_echo(
                array, scene, original_scene, waveform, track, receiver, point, range_window, weights, request,
                motion=motion, channels=channels, receive=receive, compressed=compressed, check=check, out=out,
            )  # fmt: skip
    near, far = echo_sampling.window(scene, waveform, tx, rx, reference_range, range_window)
    frequency, step, n_samples = echo_sampling.sampling(waveform, near, far, compressed)
    antennas = PulseGeometry.sampled(
        tx, rx, reference_range, first=frequency, step=step, n_samples=n_samples, near=near, far=far
    )
    n = len(request.polarizations)
    with EchoOutput((len(tx), n, n_samples), out, request.budget, (near, far)) as output:
        frequencies = frequency + step * np.arange(n_samples)
        pulse = waveform.pulse_spectrum(frequencies)
        request.report("scene", 0, 3)
        bands = [Band(n_samples, waveform.bandwidth, float(antennas.frequency[0]))]
        prepared = prepare_scene(request, original_scene, scene, waveform, antennas, weights, bands)
        spectrum = (np.abs(pulse) ** 2 if compressed else pulse) * prepared.weights.factor(frequencies)
        channel, counts = prepared.channel(antennas, waveform, frequencies), Counts()
        for start in range(0, len(tx), output.pulses):
            stop = min(start + output.pulses, len(tx))
            block = output.block(start, stop)
            counts += channel.add(block, range(start, stop), counts.pairs, len(prepared) * len(tx))
            block *= spectrum.astype(np.complex64)
            output.keep(start, block)
        prepared.check_seen(counts, near, far)
        request.clock.lap("spectra")
        measured = None
        if worth_checking(prepared, check):
            measured = measure_error(prepared, antennas, frequencies, spectrum, output)
            request.clock.lap("check")

        def every(values: Any) -> Any:
            return values if n == 1 or values is None else np.repeat(values, n, axis=0)

        velocities = [t.velocities for t in (track, track if receiver is None else receiver)]
        raw = output.finish(
            frequency=frequency,
            frequency_step=step,
            tx=every(tx),
            rx=None if receiver is None else every(rx),
            reference_range=every(reference_range),
            time=every(track.times),
            polarization=np.tile(request.polarizations, len(tx)),
            tx_velocity=every(velocities[0]),
            rx_velocity=every(velocities[1]),
            waveform=waveform,
            array=array,
            compressed=compressed,
            report=Report(
                plan=channel.plan | motion,
                tolerance=request.tolerance,
                predicted_error=channel.predicted_error,
                error_terms=channel.error_terms,
                measured_error=measured,
                **prepared.counted(counts),
                seconds=request.clock.seconds,
                device=opened.info.name,
                seed=seed,
            ),
        )
    confirm_tolerance(raw=raw)
    return raw
