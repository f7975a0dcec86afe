"""Echoes of points and facets, pulse by pulse, to a stated tolerance."""

from __future__ import annotations

from ..base.forecast import Plan
from ..base.stage_timer import Clock
from ..base.verb import verb
from ..model.phase_history import PhaseHistory
from ..model.trajectory import Trajectory
from ..model.waveform import Waveform
from ..scene.scene import Scene
from ._echo_plan import EchoPlan
from .echo_options import EchoOptions
from .echo_task import echo_task
from .track_options import Polarization as Polarization
from .tracks.echoes_of_tracks import EchoesOfTracks


@verb(EchoOptions, ("track", "receiver"), EchoesOfTracks.of)
def echo(scene: Scene, waveform: Waveform, track: Trajectory, options: EchoOptions) -> Plan[PhaseHistory]:
    """Echoes s_p(f) = sum_k a_k(p) W(f) exp(-j 2 pi f (tau_k(p) - tau_ref(p))) of every pulse, compressed.

    scene         points (|amplitude|^2 = RCS, m^2) and facets: physical optics with the materials' Fresnel
                  coefficients, the exact phase of the wave over every facet (docs/theory/facets.md); single scattering,
                  or several reflections (docs/theory/bounces.md)
    waveform      the pulse, whose matched spectrum W is
    track         transmitter; or a list of tracks: a list of phase histories is returned, each with the samples of a
                  call of its own. `receiver` is a list of as many then, and `out` a folder, with a file for each track
    {options}

    Antennas rest while a pulse is on its way (stop and go), except on tracks of `Orbit.trajectory`: there the receiver
    is where it is when the echo of the reference point arrives, on the rotating Earth. report.plan says which, and how
    much stop and go leaves out (docs/theory/orbits.md).

    Returns a PhaseHistory; with `tile`, None until the piece that completes it. ToleranceUnreachable, a ValueError: a
    tolerance that cannot be met, with the best that can, before the work starts. ToleranceMissed, a ValueError that
    holds the finished echoes: the check measured more than the tolerance. ValueError: tiles of other echoes in
    "PATH.parts". ValueError, MemoryError, sarcl.NoDeviceError say what else does not fit.
    Source: the echo equation of sarcl/__init__.py.

    >>> raw = sarcl.echo(scene, chirp, track, tolerance=1e-4, polarization=("HH", "VV"))
    >>> raw.samples.shape[0] == 2 * len(track.positions), raw.report.predicted_error <= 1e-4
    (True, True)
    """
    clock = Clock()
    return EchoPlan.of(echo_task(scene, waveform, track, options), clock)
