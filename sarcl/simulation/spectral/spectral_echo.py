"""Echoes of straight tracks by two-dimensional Fourier transforms of the reflectivity map."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from ...base.errors import confirm_tolerance
from ...base.report import Report, root_sum_square
from ...base.types import PathLike
from ...base.validation import choice, flag, instance
from ...model.antenna import Antenna
from ...model.antenna_array import AntennaArray
from ...model.phase_history import PhaseHistory
from ...model.radar import Radar
from ...model.trajectory import Trajectory
from ...model.waveform import Waveform
from ...opencl.device import DeviceChoice
from ...scene.scene import Scene
from ..echo_check import measure_error, seconds_to_check
from ..echo_output import EchoOutput
from ..echo_request import EchoRequest, Polarization, Progress, echo_request
from ..scene_echoes import UNKNOWN_SHADOWS, ChannelEchoes
from ..spreading import Counts
from ._spectral_samples import SpectralSamples
from ._stationary_phase import chirp_ripple
from .spectral_task import spectral_task

SKIPS = ("zero reflectivity", "facing away", "range window")
QUICK_CHECK = 1.0  # s, for the exact sums of the check


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
    shadows: bool = True,
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
    max_bytes   memory for blocks of the map and its spectra. What it does not hold goes to temporary files: beside
                `out`, or where the system has temporary files
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
    ripple, compressed = flag("ripple", ripple), flag("compressed", compressed)
    if check is not None:
        flag("check", check)
    if ripple and waveform.sweep_rate is None:
        raise ValueError(f"ripple is that of a rectangular chirp's spectrum, and the waveform is a {waveform.kind}")
    request = echo_request(
        scene, SKIPS, polarization=polarization, vertical=vertical, shadows=shadows, seed=seed, skip=skip,
        max_edge=max_edge, max_bytes=max_bytes, tolerance=tolerance, device=device, progress=progress,
    )  # fmt: skip
    task = spectral_task(
        scene, waveform, track, request, receiver=receiver, array=array, reference=reference,
        range_window=range_window, antenna=antenna, radar=radar, compressed=compressed,
    )  # fmt: skip
    n_pulses, n_polarizations, frequencies = len(track), len(request.polarizations), task.frequencies
    with EchoOutput((n_pulses, n_polarizations, len(frequencies)), out, request.budget, task.window) as output:
        prepared, parts, direct, terms = task.planned(variant)
        pulse = waveform.pulse_spectrum(frequencies)
        spectrum = (np.abs(pulse) ** 2 if compressed else pulse) * prepared.weights.factor(frequencies)
        if ripple:
            spectrum = spectrum * chirp_ripple(waveform, frequencies)
        reference_range = task.antennas.reference_range
        folder = None if out is None else Path(out).parent
        samples = SpectralSamples(request, parts, task.line, reference_range, frequencies, spectrum, folder)
        samples.compute(output)
        if direct is not None:
            _add_directly(direct, request, spectrum, output)
        measured = None
        if check if check is not None else seconds_to_check(prepared) <= QUICK_CHECK:
            measured = measure_error(prepared, task.antennas, frequencies, spectrum, output)
            request.clock.lap("check")
        seen = sum(len(part.some) for part in parts) + (0 if direct is None else len(direct.scene))
        counts = Counts(len(prepared) * n_pulses, 0, 0, (len(prepared) - seen) * n_pulses)

        def every(values: Any) -> Any:
            return values if n_polarizations == 1 or values is None else np.repeat(values, n_polarizations, axis=0)

        raw = output.finish(
            frequency=frequencies[0],
            frequency_step=task.step,
            tx=every(track.positions),
            rx=None,
            reference_range=every(reference_range),
            time=every(track.times),
            polarization=np.tile(request.polarizations, n_pulses),
            tx_velocity=every(track.velocities),
            rx_velocity=every(track.velocities),
            waveform=waveform,
            array=array,
            compressed=compressed,
            report=Report(
                plan={
                    "model": "stop and go, single scattering",
                    **task.describe(parts, direct),
                    **prepared.mesh_warnings,
                    **prepared.shadow_words,
                    # here aspects are interpolated as if shares changed slowly: what that adds is not known
                    **(UNKNOWN_SHADOWS if variant == "saras" and "shadow edges" in prepared.shadow_words else {}),
                    **prepared.weights.describe(prepared.weight_error),
                    **task.motion,
                },
                tolerance=request.tolerance,
                predicted_error=root_sum_square(terms),
                error_terms=terms,
                measured_error=measured,
                **prepared.counted(counts),
                seconds=request.clock.seconds,
                device=request.device.info.name,
                seed=request.seed,
            ),
        )
    confirm_tolerance(raw=raw, instead="use echo")
    return raw


def _add_directly(direct: ChannelEchoes, request: EchoRequest, spectrum: np.ndarray, output: EchoOutput) -> None:
    """Add echoes that change from pulse to pulse as `echo` does; spectrum  complex (n_f,), of all samples."""
    counts, n = Counts(), len(output)
    pulses = max(1, int(request.budget / 8 / (8.0 * np.prod(output.shape[1:]))))
    for start in range(0, n, pulses):
        stop = min(start + pulses, n)
        block = np.zeros((stop - start, *output.shape[1:]), np.complex64)
        counts += direct.add(block, range(start, stop), counts.pairs, len(direct.scene) * n)
        output.add(start, block * spectrum.astype(np.complex64))
    request.clock.lap("facets with shadows")
