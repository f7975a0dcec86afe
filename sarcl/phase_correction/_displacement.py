"""Displacements: by how much a phase moves bright places across range, each by the pulses that see it.

A scatterer at x that is moved by d u, u a unit vector, changes the phase of pulse p by -(2 pi f/c) d g_p.u, where g_p
is the sum of the unit vectors from both antennas to x. A phase that is linear in g_p.u over the pulses that see x is
therefore a displacement of x across range, and nothing in the image of x alone shows it. What shows it is the next
place, as far as the same pulses see both.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..base.constants import SPEED_OF_LIGHT
from ..base.vectors import Floats, unit
from . import _bright_points
from ._aperture_view import NO_LAG, ApertureView, Errors

BRIGHT = 10  # brightest points of an image
FAINT = 0.1  # share of the power of the brightest point: fainter ones may be side lobes
SEEN = 0.25  # share of a place's largest amplitude: pulses with less at either end of the aperture do not see it
AVERAGED = 8  # parts of the aperture over which amplitudes are averaged: noise and neighbours cancel
# share of the pulses that could see a place: with more, all of them do. Echoes of neighbours, a few Doppler cells
# beside the place, hide as much of it at the ends of the aperture
MOST = 0.75
FITS = 4  # fits of a slope
FINE, REACH = 16, 128  # steps per resolution cell in which peaks are searched, and how many on each side


@dataclass(frozen=True, eq=False)
class Displacements:
    """Displacements of places by a phase.

    places  m (k, 3), brightest first
    along   m (k,), displacements of the places across range, positive towards where the antennas move
    peaks   m (k,), the same of the highest points of the places' images, which a phase that blurs them moves otherwise
    cells   m (k,), resolution of each place across range, by the pulses that see it
    common  share of their pulses that two places have in common, at the weakest link of the strongest chain of all
    """

    places: Floats
    along: Floats
    peaks: Floats
    cells: Floats
    common: float

    @property
    def apart(self) -> float:
        """Largest displacement of two places against one another, resolution cells."""
        return max((float(np.ptp(moved / self.cells)) for moved in (self.along, self.peaks) if len(moved)), default=0.0)


def bright_places(view: ApertureView, power: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Positions, m (k, 3), of the brightest points of an image, and their power (k,)."""
    pixels, levels = _bright_points.pixels_and_levels(power, view.grid, _bright_points.CANDIDATES)
    places = _bright_points.brightest(view.raw[:: view.channels], power, view.grid, 8.0, BRIGHT)
    level = np.array([levels[np.linalg.norm(pixels - place, axis=1).argmin()] for place in places])
    bright = level >= FAINT * levels[0]
    return places[bright], level[bright]


def shift_phase(view: ApertureView, place: np.ndarray, weight: np.ndarray) -> np.ndarray:
    """rad/m (n,): change of a pulse's phase per displacement of a place, m (3,), across range, in the image plane.

    weight  (n,), of the pulses: across range is the direction in which they turn most, as the place sees them
    """
    rows = slice(None, None, view.channels)
    look = unit(place - view.raw.tx[rows]) + unit(place - view.raw.rx[rows])
    if view.grid.x_axis is not None and view.grid.y_axis is not None:
        look = look @ np.stack([view.grid.x_axis, view.grid.y_axis], axis=1)
    look = look - weight @ look / weight.sum()
    across = np.linalg.svd(look * np.sqrt(weight)[:, None], full_matrices=False)[2][0]
    turn = look @ across
    # the place lies ahead: where an antenna moves forwards, the direction to the place turns backwards
    forwards = -np.sign(weight @ (turn * (np.arange(view.n) - weight @ np.arange(view.n) / weight.sum())))
    return np.asarray(2 * np.pi * view.frequency / SPEED_OF_LIGHT * turn * (forwards or 1.0))


def displacements(view: ApertureView, errors: Errors, power: np.ndarray) -> Displacements:
    """Displacements of the brightest points of the corrected image, whose power is given, by the correction."""
    places = bright_places(view, power)[0]
    seen = _seen(view, errors, places)
    shifts, peaks, cells = (np.empty(len(places)) for _ in range(3))
    for k, place in enumerate(places):
        along = shift_phase(view, place, seen[:, k])
        shifts[k] = _slope(errors[0], along, seen[:, k])
        cells[k] = 2 * np.pi / max(float(np.ptp(along[seen[:, k] > 0])), 1e-300)
        # over a narrow aperture nearly all pulses see nearly all places, and what blurs them moves all peaks alike
        peaks[k] = shifts[k] if view.is_narrow else shifts[k] + _peak(errors[0] - shifts[k] * along, along, seen[:, k])
    return Displacements(places, shifts, peaks, cells, _weakest_link(seen))


def _peak(phase: np.ndarray, along: np.ndarray, seen: np.ndarray) -> float:
    """Displacement at which the pulses that are seen, with a phase (n,) and equal amplitudes, add up to the most."""
    lit = seen > 0
    cell = 2 * np.pi / max(float(np.ptp(along[lit])), 1e-300)
    trials = np.arange(-REACH, REACH + 1) * cell / FINE
    level = np.abs(np.exp(1j * (phase[lit, None] - np.outer(along[lit], trials))).sum(axis=0))
    return float(trials[level.argmax()])


def _slope(phase: np.ndarray, along: np.ndarray, seen: np.ndarray) -> float:
    """Slope of a phase against `along`, over the pulses that are seen (n,): the least-squares fit, from steps alone.

    The fit is a weighted mean of the steps from pulse to pulse. Their phasors are averaged, so that steps of 2 pi in an
    estimate that was not smoothed do not count.
    """
    weight = np.abs(np.cumsum((along - seen @ along / seen.sum()) * seen))[:-1] * (seen[1:] > 0) * (seen[:-1] > 0)
    step, per_metre = np.diff(phase), np.diff(along)
    scale = weight @ per_metre
    if not scale:
        return 0.0
    slope = 0.0
    for _ in range(FITS):  # steps of `along` differ
        slope += float(np.angle(weight @ np.exp(1j * (step - slope * per_metre))) * weight.sum() / scale)
    return slope


def _seen(view: ApertureView, errors: Errors, places: np.ndarray) -> np.ndarray:
    """1.0 where a pulse sees a place, else 0.0 (n, k): from the first to the last whose echo fits the image."""
    import scipy.ndimage

    v = view.contributions(errors, places, NO_LAG, taper=True)[:, :, 0]
    # the part of every contribution in phase with the sum of all of them
    level = (v * np.exp(-1j * np.angle(v.sum(axis=0)))).real.reshape(view.n, view.channels, -1).sum(axis=1)
    size = max(view.n // AVERAGED, 3)
    level = scipy.ndimage.uniform_filter1d(level.astype(np.float64), size, axis=0, mode="nearest")
    could = (v != 0).reshape(view.n, view.channels, -1).any(axis=1)
    seen = could & (level >= SEEN * level.max(axis=0))
    seen = np.logical_or.accumulate(seen, axis=0) & np.logical_or.accumulate(seen[::-1], axis=0)[::-1]
    return np.where(seen.sum(axis=0) >= MOST * could.sum(axis=0), could, seen).astype(np.float64)


def _weakest_link(seen: np.ndarray) -> float:
    """Least share of their pulses that two neighbours have in common, of the chain of all places where it is largest.

    seen  (n, k), 1.0 where a pulse sees a place. The chain is grown from the first place (Prim's spanning tree)
    """
    pulses = seen.sum(axis=0)
    share = seen.T @ seen / np.minimum(pulses[:, None], pulses)
    chain, weakest = [0], 1.0
    while len(chain) < len(pulses):
        nearest = share[chain].max(axis=0)
        nearest[chain] = -1.0
        weakest = min(weakest, float(nearest.max()))
        chain.append(int(nearest.argmax()))
    return weakest
