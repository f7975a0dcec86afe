"""Aspects at which a track sees scatterers: limits of its length, of beams, of the pulse repetition frequency."""

from __future__ import annotations

import numpy as np

from ...base.constants import SPEED_OF_LIGHT
from ...base.errors import NotApplicable, NothingSeen
from ._aspect_window import fresnel_zone
from ._beam_extent import beam_extent
from ._scatterer_amplitudes import ScattererAmplitudes
from ._straight_track import StraightTrack

STEEPEST = 0.95  # largest sine of the aspect: nearer to the track's direction the geometry degenerates
WIDEST = 16  # Fresnel zones: the widest edges of a window
MOST_DOPPLER = 64  # pulse repetition frequencies over which responses may spread in Doppler


def aspects_seen(
    amplitudes: ScattererAmplitudes, track: StraightTrack, band: tuple[float, float], has_beam: bool, allowed: float
) -> tuple[float, float, float, tuple[float, float]]:
    """Sines (low, high) of the aspects at which pulses see scatterers, the relative error of leaving out what a beam
    receives beyond them, and the sines between which it has half its power."""
    first, last = amplitudes.sines(0.0), amplitudes.sines(track.length)
    if amplitudes.edges is None:
        low, high = float(first.min()), float(last.max())
        if not has_beam:
            return _checked(low, high, 0.0, (low, high))
        extent = beam_extent(amplitudes, first, last, band, allowed)
        return _checked(extent.low, extent.high, extent.outside, extent.main)
    edges, seen = amplitudes.edges.sines(), amplitudes.edges.seen
    if not seen.any():
        raise NothingSeen("the scene is out of the beam at every pulse; aim it with sarcl.pointing")
    first, last = np.maximum(first, edges[0])[seen], np.minimum(last, edges[1])[seen]
    extent = beam_extent(amplitudes, first, last, band, allowed, np.flatnonzero(seen))
    return _checked(float(first.min()), float(last.max()), 0.0, extent.main)


def _checked(
    low: float, high: float, outside: float, main: tuple[float, float]
) -> tuple[float, float, float, tuple[float, float]]:
    """NotApplicable where aspects come too near to the direction of the track."""
    if max(abs(low), abs(high)) > STEEPEST:
        raise NotApplicable(
            f"scatterers are seen down to {np.degrees(np.arccos(max(abs(low), abs(high)))):.2g} deg from the direction "
            f"of the track, where spectral_echo needs {np.degrees(np.arccos(STEEPEST)):.2g} deg; use echo"
        )
    return low, high, outside, main


def check_doppler(track: StraightTrack, highest: float, main: tuple[float, float], has_beam: bool) -> None:
    """ValueError where the pulse repetition frequency is below the Doppler bandwidth."""
    needed = track.prf * track.spacing * 2 * highest / SPEED_OF_LIGHT * (main[1] - main[0])
    if needed > track.prf * (1 + 1e-9):
        of = "the beam (between its half-power directions)" if has_beam else "the scene as this track sees it"
        raise NotApplicable(
            f"the track has {track.prf:.6g} pulses per second, below the Doppler bandwidth of {of}, {needed:.6g} Hz; "
            f"give prf={1.001 * needed:.4g} or more, or use echo, which computes aliased echoes too"
        )


def check_spread(track: StraightTrack, highest: float, low: float, high: float) -> None:
    """NotApplicable where side lobes reach so far beyond the pulse repetition frequency that echo is cheaper."""
    spread = track.spacing * 2 * highest / SPEED_OF_LIGHT * (high - low)
    if spread > MOST_DOPPLER:
        raise NotApplicable(
            f"at this tolerance side lobes count over {spread:.0f} times the pulse repetition frequency, and "
            f"spectral_echo computes up to {MOST_DOPPLER}; raise prf or the tolerance, or use echo"
        )


def inner_aspects(
    amplitudes: ScattererAmplitudes, track: StraightTrack, limits: tuple[float, float], lowest: float
) -> tuple[tuple[float, float], tuple[bool, bool]]:
    """Sines between which every scatterer is inside the hard edges of the beam, and which of them are such edges.

    limits  sines between which pulses see scatterers;  lowest  Hz, of the band
    Edges beyond the ends of the track count where a window's edges, outside the limits, would reach them.
    """
    if amplitudes.edges is None:
        return limits, (False, False)
    seen = amplitudes.edges.seen
    first, last = (sine[seen] for sine in amplitudes.edges.sines())
    reach = WIDEST * fresnel_zone(*limits, float(amplitudes.slant_range.min()), lowest)
    hard = (
        bool((first > amplitudes.sines(0.0)[seen] - reach).any()),
        bool((last < amplitudes.sines(track.length)[seen] + reach).any()),
    )
    low, high = (float(first.max()) if hard[0] else limits[0]), (float(last.min()) if hard[1] else limits[1])
    if low >= high:
        raise NotApplicable(
            "the hard edges of the beam lie at other aspects for scatterers of other elevations: no aspect is inside "
            "for all. Divide the scene over slant range, or use echo"
        )
    return (low, high), hard
