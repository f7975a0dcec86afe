"""Echoes of straight tracks by two-dimensional Fourier transforms of the reflectivity map."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from ...arrays.channels import is_single
from ...base.constants import SPEED_OF_LIGHT
from ...base.errors import NotApplicable, ToleranceMissed
from ...base.report import Report
from ...base.types import PathLike
from ...base.validation import array as numbers
from ...base.validation import choice, count, instance
from ...base.validation import tolerance as allowed_error
from ...model.antenna import Antenna
from ...model.antenna_array import AntennaArray
from ...model.phase_history import PhaseHistory
from ...model.radar import Radar
from ...model.trajectory import Trajectory
from ...model.waveform import Waveform
from ...numerics import plan
from ...numerics.pulse_geometry import PulseGeometry
from ...opencl.choose_device import open_device
from ...opencl.device import DeviceChoice
from ...opencl.memory_budget import budget
from ...scattering import antenna_weights
from ...scene.scene import Scene
from .. import echo_sampling
from ..echo import Polarization, polarization_names, vertical_direction
from ..echo_check import measure_error, seconds_to_check
from ..echo_output import EchoOutput
from ..scene_echoes import EchoRequest, Progress, SceneEchoes, parts_of, prepare_scene
from ..spreading import Counts
from ._scatterer_amplitudes import ScattererAmplitudes
from ._spectral_part import SpectralPart, plan_part
from ._spectral_samples import SpectralSamples
from ._stationary_phase import chirp_ripple
from ._straight_track import StraightTrack, straight_track

SKIPS = ("zero reflectivity", "facing away", "range window")
STRAIGHT = 0.05  # share of the tolerance: phase errors, rad, of a track that is not quite straight
QUICK_CHECK = 1.0  # s, for the exact sums of the check
WINDOW_PULSES = 33  # pulses at which scatterers are compared with a range window that was asked for


def spectral_echo(
    scene: Scene,
    waveform: Waveform,
    track: Trajectory,
    *,
    variant: Literal["exact", "saras"] = "exact",
    receiver: Trajectory | None = None,
    polarization: Polarization | Literal["all"] | Sequence[Polarization] = "HH",
    vertical: ArrayLike | None = None,
    range_window: ArrayLike | None = None,
    reference: ArrayLike | None = None,
    array: AntennaArray | None = None,
    antenna: Antenna | tuple[Antenna, Antenna] | None = None,
    radar: Radar | None = None,
    shadows: bool | Literal["embree"] = True,
    seed: int = 0,
    skip: bool | Collection[Literal["zero reflectivity", "facing away", "range window"]] = True,
    compressed: bool = True,
    ripple: bool = False,
    max_edge: float | Literal["auto"] | None = "auto",
    max_bytes: float | None = None,
    out: PathLike | None = None,
    tolerance: float = 1e-2,
    check: bool | None = None,
    device: DeviceChoice | None = None,
    progress: Progress | None = None,
) -> PhaseHistory:
    """The samples of `echo` for a straight track of evenly spaced pulses, by two-dimensional Fourier transforms.

    Takes the arguments of `echo`, and returns a PhaseHistory with the same frequencies, reference ranges and phases:
    backproject focuses it as it is. The time grows as N^2 log N for a map of N x N cells, that of `echo` as N^3.

    variant     "exact": no approximation but those that the tolerance bounds. The response of a scatterer along the
                track is transformed numerically, with the antenna's pattern, squint and range migration
                "saras": the paper's transfer function and grid deformation, by stationary phase, with amplitudes as
                seen from broadside: for comparison, it is no faster
    track       a straight line of evenly spaced pulses (Trajectory.line), with one attitude for all pulses where there
                is an antenna (pointing.stripmap). Its PRF must be at least the Doppler bandwidth: of the scene without
                an antenna, or of the beam between its half-power directions
    receiver, array   not supported: None
    range_window      must hold every scatterer at every pulse that sees it
    ripple      multiply by the Fresnel ripples of the spectrum of a rectangular chirp (SARAS's function d), which
                `echo` leaves out
    max_bytes   memory for blocks of the map and its spectra; smaller blocks take longer
    tolerance   L2 error of the samples, as in `echo`
    check       recompute samples at 16 random pulses exactly, fewer above 20 000 facets: report.measured_error; None:
                where that takes about a second at most

    Other arguments: see `echo`. Raises NotApplicable, a ValueError, for tracks, receivers, arrays and windows that it
    cannot take, ToleranceUnreachable, a ValueError, for tolerances: both name `echo`. ToleranceMissed, ValueError,
    MemoryError and sarcl.NoDeviceError as `echo` does.
    Source: docs/theory/spectral_echo.md; after Franceschetti, Migliaccio, Riccio and Schirinzi 1992 (SARAS).
    """
    for name, value, kind in (("scene", scene, Scene), ("waveform", waveform, Waveform), ("track", track, Trajectory)):
        instance(name, value, kind)
    choice("variant", variant, ("exact", "saras"))
    seed = count("seed", seed, 0)
    if not isinstance(shadows, (bool, np.bool_)):
        choice("shadows", shadows, ("embree",))
    if ripple and waveform.kind != "chirp":
        raise ValueError(f"ripple is that of a rectangular chirp's spectrum, and the waveform is a {waveform.kind}")
    if receiver is not None:
        raise NotApplicable("spectral_echo is for one antenna that transmits and receives; use echo for a receiver")
    if array is not None:
        instance("array", array, AntennaArray)
        if not is_single(array):
            raise NotApplicable("spectral_echo takes no arrays; use echo, which computes their channels")
    if not track.stop_and_go:
        raise NotApplicable(
            "the track is that of an orbit, with the receiver where it is at the echo's arrival; spectral_echo is for "
            "straight tracks, stop and go: use echo"
        )
    opened = open_device(device)
    request = EchoRequest(
        opened, allowed_error(tolerance), budget(opened, max_bytes), plan.skips(skip, SKIPS),
        polarization_names(polarization), vertical_direction(vertical, scene.center), max_edge, shadows, seed, progress,
    )  # fmt: skip
    line = straight_track(track, waveform.center + waveform.bandwidth / 2, STRAIGHT * request.tolerance)
    tx = track.positions
    point = scene.center if reference is None else numbers("reference", reference, np.float64, (3,))
    _, _, motion = echo_sampling.in_flight(track, None, scene, point)
    reference_range = echo_sampling.half_path(tx, tx, point)
    original_scene, scene = scene, scene.realized(seed)
    weights = antenna_weights.weights_of(antenna, radar, track, None, waveform, scene.center)
    near, far = echo_sampling.window(scene, waveform, tx, tx, reference_range, range_window)
    frequency, step, n_samples = echo_sampling.sampling(waveform, near, far, compressed)
    antennas = PulseGeometry.sampled(
        tx, tx, reference_range, first=frequency, step=step, n_samples=n_samples, near=near, far=far
    )
    n_polarizations = len(request.polarizations)
    with EchoOutput((len(tx), n_polarizations, n_samples), out, request.budget, (near, far)) as output:
        frequencies = frequency + step * np.arange(n_samples)
        pulse = waveform.pulse_spectrum(frequencies)
        request.report("scene", 0, 3)
        prepared = prepare_scene(request, original_scene, scene, waveform, antennas, weights, (), tiled=False)
        spectrum = (np.abs(pulse) ** 2 if compressed else pulse) * prepared.weights.factor(frequencies)
        if ripple:
            spectrum = spectrum * chirp_ripple(waveform, frequencies)
        band = waveform.center - waveform.bandwidth / 2, waveform.center + waveform.bandwidth / 2
        parts, error = _parts(prepared, scene, line, band, variant)
        if range_window is not None and request.gated:
            for part in parts:
                _check_window(part, line, reference_range, (near, far))
        request.clock.lap("plan")
        samples = SpectralSamples(opened, request, parts, line, reference_range, frequencies, spectrum)
        samples.compute(output)
        measured = None
        if check if check is not None else seconds_to_check(prepared) <= QUICK_CHECK:
            measured = measure_error(prepared, antennas, frequencies, spectrum, output)
            request.clock.lap("check")
        seen = sum(len(part.some) for part in parts)
        counts = Counts(len(prepared) * len(tx), 0, 0, (len(prepared) - seen) * len(tx))

        def every(values: Any) -> Any:
            return values if n_polarizations == 1 or values is None else np.repeat(values, n_polarizations, axis=0)

        largest = max(parts, key=lambda part: part.predicted_error)
        raw = output.finish(
            frequency=frequency,
            frequency_step=step,
            tx=every(tx),
            rx=None,
            reference_range=every(reference_range),
            time=every(track.times),
            polarization=np.tile(request.polarizations, len(tx)),
            tx_velocity=every(track.velocities),
            rx_velocity=every(track.velocities),
            waveform=waveform,
            array=array,
            compressed=compressed,
            report=Report(
                plan={
                    "model": "stop and go, single scattering",
                    **largest.describe(),
                    **prepared.mesh_warnings,
                    **prepared.weights.describe(prepared.weight_error),
                    **motion,
                },
                tolerance=request.tolerance,
                predicted_error=error,
                measured_error=measured,
                **prepared.counted(counts),
                seconds=request.clock.seconds,
                device=opened.info.name,
                seed=seed,
            ),
        )
    if measured is not None and measured > request.tolerance:
        raise ToleranceMissed(request.tolerance, measured, raw=raw)
    return raw


def _parts(
    prepared: SceneEchoes, scene: Scene, line: StraightTrack, band: tuple[float, float], variant: str
) -> tuple[list[SpectralPart], float]:
    """Plans for the points and the facets of a scene, and the predicted error of their sum."""
    request, out, errors = prepared.request, [], []
    share = request.tolerance / parts_of(scene)
    straight = 4 * np.pi * band[1] / SPEED_OF_LIGHT * line.deviation
    for part in (prepared.points if request.same else None, prepared.facets):
        if part is None:
            continue
        gain, fixed, random = 1.0, 0.0, False
        if part is prepared.facets and prepared.subdivision is not None:
            gain, fixed = prepared.subdivision.gain, prepared.subdivision.plan.predicted_error
            random = not prepared.facets.is_mirror
        amplitudes = ScattererAmplitudes(part, prepared.weights, line, request.polarizations, request.vertical)
        made = plan_part(
            amplitudes, line, band, prepared.weights.pair is not None, random, variant,
            share / gain - fixed - straight, request.tolerance, request.device,
        )  # fmt: skip
        out.append(made)
        errors.append(gain * (made.predicted_error + fixed + straight))
    return out, float(np.sqrt(np.sum(np.square(errors))))


def _check_window(
    part: SpectralPart, line: StraightTrack, reference_range: np.ndarray, window: tuple[float, float]
) -> None:
    """NotApplicable where a scatterer lies outside the range window at a pulse that sees it."""
    azimuth, slant_range = part.amplitudes.azimuth[part.some], part.amplitudes.slant_range[part.some]
    low, high = part.transfer.aspects.low, part.transfer.aspects.high
    for p in np.unique(np.linspace(0, line.n_pulses - 1, WINDOW_PULSES).astype(int)).tolist():
        lag = p * line.spacing - azimuth
        distance = np.hypot(lag, slant_range)
        seen = (lag >= low * distance) & (lag <= high * distance)
        away = distance[seen] - reference_range[p]
        outside = (away < window[0]) | (away > window[1])
        if outside.any():
            raise NotApplicable(
                f"range_window ({window[0]:g}, {window[1]:g}) m cuts the scene: at pulse {p} scatterers lie at "
                f"{away.min():.4g} to {away.max():.4g} m about the reference. Widen it, leave it out, or use echo, "
                "which leaves out scatterers row by row"
            )
