"""Echoes of straight tracks by two-dimensional Fourier transforms of the reflectivity map."""

from __future__ import annotations

from ...base.forecast import Plan
from ...base.stage_timer import Clock
from ...base.verb import verb
from ...model.phase_history import PhaseHistory
from ...model.trajectory import Trajectory
from ...model.waveform import Waveform
from ...scene.scene import Scene
from ..echo_task import check_subjects
from ._spectral_options import SpectralEchoOptions
from ._spectral_plan import SpectralEchoPlan
from .spectral_task import spectral_task


@verb(SpectralEchoOptions)
def spectral_echo(
    scene: Scene, waveform: Waveform, track: Trajectory, options: SpectralEchoOptions
) -> Plan[PhaseHistory]:
    """The samples of `echo` for a straight track of evenly spaced pulses, by two-dimensional Fourier transforms.

    Takes the options of `echo` that are listed here, and returns a PhaseHistory with the same frequencies, reference
    ranges and phases: backproject focuses it as it is. The time grows as N^2 log N for a map of N x N cells, that of
    `echo` as N^3.

    scene, waveform   as `echo` takes them
    track         a straight line of evenly spaced pulses (Trajectory.line), with one attitude for all pulses where
                  there is an antenna (pointing.stripmap). Its PRF must be at least the Doppler bandwidth: of the scene
                  without an antenna, or of the beam between its half-power directions
    {options}

    Raises NotApplicable, a ValueError, for tracks, receivers, arrays and windows that it cannot take,
    ToleranceUnreachable, a ValueError, for tolerances: both name `echo`. ToleranceMissed, ValueError, MemoryError and
    sarcl.NoDeviceError as `echo` does. With `tile`, returns None until the piece that completes the echoes.
    Source: docs/theory/spectral_echo.md; after Franceschetti, Migliaccio, Riccio and Schirinzi 1992 (SARAS).

    >>> flight = sarcl.Trajectory.line(start=(-5e3, -100, 4e3), velocity=(0, 100, 0), prf=400, n_pulses=800)
    >>> raw = sarcl.spectral_echo(scene, chirp, flight, tolerance=1e-2)
    >>> raw.n_rows
    800
    """
    clock = Clock()
    if options.ripple and isinstance(waveform, Waveform) and waveform.sweep_rate is None:
        raise ValueError(f"ripple is that of a rectangular chirp's spectrum, and the waveform is a {waveform.kind}")
    check_subjects(scene, waveform, track)
    task = spectral_task(scene, waveform, track, options, options.devices(), options.variant)
    piece = options.piece(options.out is not None, "raw.h5")
    clock.lap("plan")
    return SpectralEchoPlan(options, task, clock.seconds, piece)
