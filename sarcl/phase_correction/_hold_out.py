"""Cross-validation: a part of the echoes gives a phase of its own, which must sharpen echoes it was not found from.

Two ways to divide the echoes in halves are used. Halves of the band have the errors of the pulses and the scene in
common, but neither noise nor speckle. Halves of the places are near and far ones: they have the errors in common, but
no target. What makes one target sharper at the cost of others, such as an echo of constant delay, shows there.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from ..base.validation import sealed
from . import _bright_points, _displacement, _phase_gradient, _phase_smoothing, _search
from ._aperture_view import NO_LAG, ApertureView, Errors
from ._echo_parts import near_and_far, phase_of, without_constant_echo

log = logging.getLogger(__name__)

AGREE = 0.4  # least closeness of two phases at which they agree; that of noise is smaller
# Least gain in sharpness of echoes that a phase was not found from. It is 0.1 dB of a peak, which is left in the data
# rather than risked: neighbouring points of the scene, which both halves of the band show, can gain as much by chance
GAIN = 1.05
KEPT = 0.95  # least change in sharpness, which is that of noise too, of the echoes without those of constant delay
LOST = 0.5  # share of its power that a point must keep: pixels beside its maximum show about as much
APART = 0.5  # resolution cells: what moves bright places against one another by more must be known for certain
SURE = 0.98  # agreement of the halves of the band from which on it is; 0.95 to 0.98 has been wrong by 1.4 cells
COMMON = 0.35  # share of their pulses that neighbouring bright places must have in common for it
SPANS = 16  # spans of the aperture: a slope of the phase over one moves points, one over a few pulses blurs them
IN_FOCUS = (
    "no phase sharpens echoes that it was not found from: the data are as well focused as these echoes can show; if "
    "the image is blurred, give a grid over its brightest isolated points"
)
DISAGREE = (
    "the halves of the band give phases that agree to {:.2f} only: noise or clutter hides the error, or no target is "
    "seen by all pulses; give a grid over bright isolated points, beam= where pulses see a part of it, and longer data"
)
BLURRED = (
    "the phase that sharpens some places blurs others at other ranges: an echo that is no target of the scene, "
    "such as a leak of constant delay, stands out, or clutter hides the error; subtract the leak (the mean of "
    "the range profiles over the pulses), or give a grid or beam= without it"
)
LOST_POINT = (
    "a point that is bright now would be lost: no target is seen by all pulses; give beam=, a grid over targets that "
    "neighbouring pulses see, and pixels no coarser than the resolution"
)
MOVED_APART = (
    "the correction would move bright places by {:.2g} m against one another, {:.1f} resolution cells, and {}: "
    "it may distort the scene. Check the antenna positions (the radius of an arm) first; give beam=, "
    "or a grid over places that the same pulses see"
)
UNSURE = "the halves of the band agree to {:.2f} only, where {} is wanted"
UNLINKED = "of the pulses that see one of them too few see the next: {:.0%}, where {:.0%} is wanted"
CLOSER = 1.05  # preference for the phase from all echoes, which is the most exact, unless its smoothing went wrong


@dataclass(frozen=True, eq=False)
class _Echoes:
    """Contributions of places (n, k): with the given range errors removed, and without any correction."""

    view: ApertureView
    corrected: np.ndarray
    plain: np.ndarray

    @classmethod
    def joined(cls, parts: Sequence[_Echoes]) -> _Echoes:
        """The places of all parts."""
        corrected, plain = (
            np.concatenate(arrays, axis=1) for arrays in zip(*((p.corrected, p.plain) for p in parts), strict=True)
        )
        return cls(parts[0].view, corrected, plain)

    def picked(self, places: np.ndarray) -> _Echoes:
        """The places of a mask (k,)."""
        return _Echoes(self.view, self.corrected.compress(places, axis=1), self.plain.compress(places, axis=1))

    def sharpness(self, phase: np.ndarray) -> float:
        """Sharpness with a phase (n,) and the range errors removed."""
        return _phase_gradient.sharpness(self.corrected, phase, self.view.window)

    @cached_property
    def plain_sharpness(self) -> float:
        """Sharpness without any correction."""
        return max(_phase_gradient.sharpness(self.plain, np.zeros(self.view.n), self.view.window), 1e-300)

    def gain(self, phase: np.ndarray) -> float:
        """Gain in sharpness by a phase (n,)."""
        return self.sharpness(phase) / self.plain_sharpness


@dataclass(frozen=True, eq=False)
class _Test:
    """A phase (n,) of some echoes, the others that it must sharpen, and the phase of these themselves."""

    phase: np.ndarray
    others: _Echoes
    own: np.ndarray

    def gains(self, ladder: list[int]) -> list[float]:
        """Gains of the others by the phase, smoothed to each number of cosines, and registered to their image."""
        unwrappings = _phase_smoothing.unwrappings(self.phase)
        curves = (_phase_smoothing.smooth(self.phase, modes, unwrappings) for modes in ladder)
        return [self.others.gain(_registered(self.others.view, curve, self.own)[0]) for curve in curves]


@dataclass(frozen=True, eq=False)
class _Curves:
    """Phases (n,) of both halves of the band, of so many cosines, and the gain in sharpness of each other half.

    agreement  closeness of the phases;  do_agree  whether it is more than chance
    """

    modes: int
    phases: list[np.ndarray]
    gains: np.ndarray
    agreement: float = 0.0
    do_agree: bool = False


def cross_validated(view: ApertureView, errors: Errors, tick: Callable[[], None]) -> tuple[Errors, dict[str, Any]]:
    """Errors, smoothed as cross-validation asks for, and fields of PhaseErrors that say how well they passed it.

    Every half of the echoes gives a phase of its own, with the given range errors. It is smoothed to the number of
    cosines that sharpens the other halves most.
    """
    zero = np.zeros(view.n)
    places = view.probes((zero, zero), errors)
    halves = _halves_of_band(view, errors[1], places)
    tick()
    bands = [phase_of(view, half.corrected) for half in halves]
    tests = [_Test(bands[1 - h], halves[h], bands[h]) for h in (0, 1)]
    tests += _tests_of_places(view, places, halves, errors[0])
    tick()
    ladder = [2**k for k in range(2, 40) if 2**k < view.n] + [view.n]
    gains = np.array([test.gains(ladder) for test in tests]).T
    log.debug("gains of %s cosines: %s", ladder, gains.round(3).tolist())
    # phases from some of the places have more noise, and ask for more smoothing
    gain_of_places = gains[:, 2:].min(axis=1).max() if len(tests) > 2 else np.inf
    curves = _agreeing_curves(view, halves, bands, ladder, gains[:, :2])
    final, gain = _sharpest(view, errors, curves, halves)
    power = view.power(final)
    displaced = _displacement.displacements(view, final, power)
    lowest = min(*curves.gains, gain_of_places, gain)
    if not curves.do_agree:
        reason = DISAGREE.format(curves.agreement)
    elif lowest > GAIN and not _sharpens_others(view, final):
        reason = BLURRED
    elif lowest > GAIN and not _none_lost(view, final, power):
        reason = LOST_POINT
    elif lowest <= GAIN:
        reason = BLURRED if curves.gains.min() > GAIN >= gain_of_places else IN_FOCUS
    else:
        reason = _apart(displaced, curves.agreement)
    difference = np.exp(1j * (_registered(view, *bands)[0] - bands[1]))
    return final, {
        "found": not reason,
        "gain": float(np.sqrt(curves.gains.prod())),
        "agreement": curves.agreement,
        "spread": float(np.std(np.angle(difference * difference.sum().conj())) / 2),
        "modes": curves.modes,
        "reason": reason,
        "places": sealed(displaced.places),
        "displacements": sealed(displaced.along),
    }


def _registered(view: ApertureView, phase: np.ndarray, other: np.ndarray) -> tuple[np.ndarray, float]:
    """A phase (n,) shifted to where the image with the other phase is, and the closeness of the two."""
    return _phase_smoothing.alignment(phase, other, view.shift_phase, view.cell / 2)


def _halves_of_band(view: ApertureView, shift: np.ndarray, places: np.ndarray) -> list[_Echoes]:
    """Contributions of places, m (k, 3), in both halves of the band; shift: range errors, m (n,)."""
    zero, n_samples = np.zeros(view.n), view.raw.n_samples
    halves = []
    for band in view.band(0, n_samples // 2), view.band(n_samples - n_samples // 2, n_samples):
        corrected = band.contributions((zero, shift), places, NO_LAG, taper=True)[:, :, 0]
        plain = corrected
        if shift.any():
            plain = band.contributions((zero, zero), places, NO_LAG, taper=True)[:, :, 0]
        halves.append(_Echoes(view, corrected, plain))
    return halves


def _tests_of_places(view: ApertureView, places: np.ndarray, halves: list[_Echoes], phase: np.ndarray) -> list[_Test]:
    """Near against far places and far against near ones; none where the halves of the band disagree about either."""
    values = [half.corrected for half in halves]
    lower_half = view.band(0, view.raw.n_samples // 2)
    sides: list[tuple[_Echoes, np.ndarray]] = []
    for picked_places in near_and_far(lower_half, places, values, phase):
        mask, close = np.tile(picked_places, view.channels), 0.0
        parts = [half.picked(mask) for half in halves]
        if mask.sum() > 1:
            close = _registered(view, *(phase_of(view, part.corrected) for part in parts))[1]
        log.debug("%d places give phases that agree to %.2f between halves of the band", mask.sum(), close)
        if close > max(AGREE, _phase_smoothing.chance(view.n)):
            side = _Echoes.joined(parts)
            sides.append((side, phase_of(view, side.corrected)))
    if len(sides) < 2:
        return []
    (near, phase_of_near), (far, phase_of_far) = sides
    return [_Test(phase_of_far, near, phase_of_near), _Test(phase_of_near, far, phase_of_far)]


def _agreeing_curves(
    view: ApertureView, halves: list[_Echoes], bands: list[np.ndarray], ladder: list[int], gains: np.ndarray
) -> _Curves:
    """Phases of the halves of the band as the curves that sharpen best.

    bands  phases (n,) of single pulses;  gains  by them, smoothed to each number of cosines of the ladder (., 2)
    """

    def closeness(a: np.ndarray, b: np.ndarray) -> float:
        return _registered(view, a, b)[1]

    best = int(gains.prod(axis=1).argmax())
    modes = ladder[best]
    curves = _Curves(modes, [_phase_smoothing.smooth(phase, modes) for phase in bands], gains[best])
    agreement = closeness(*bands)
    do_agree = agreement > max(AGREE, _phase_smoothing.chance(view.n))
    if modes < view.n:
        agreement = closeness(*curves.phases)
        do_agree |= agreement > _least_of_curves(curves, closeness)
    if view.is_narrow:  # where each place has its own pulses, few cosines leave the places apart
        searched = _searched_as_curves(view, halves, bands)
        close = closeness(*searched.phases)
        is_sharper = searched.gains.prod() > curves.gains.prod()  # phases of single pulses may focus points to one
        if close > _least_of_curves(searched, closeness) and (is_sharper or not do_agree):
            return replace(searched, agreement=close, do_agree=True)
    return replace(curves, agreement=agreement, do_agree=do_agree)


def _sharpest(view: ApertureView, errors: Errors, curves: _Curves, halves: list[_Echoes]) -> tuple[Errors, float]:
    """The errors with the phase of all echoes, or of one half of the band, that sharpens the whole band most.

    A phase with an error of unwrapping would not sharpen it. Also returns its gain in sharpness.
    """
    band = _Echoes.joined(halves)
    candidates = [_phase_smoothing.smooth(errors[0], curves.modes), *curves.phases]
    smoothed = [view.shift_removed((curve, errors[1])) for curve in candidates]
    levels = np.array([band.sharpness(phase) for phase, _ in smoothed])
    best = int((levels * (CLOSER, 1, 1)).argmax())
    return smoothed[best], levels[best] / band.plain_sharpness


def _searched_as_curves(view: ApertureView, halves: list[_Echoes], free: list[np.ndarray]) -> _Curves:
    """Phases of few cosines of both halves of the band, searched as such; free: those of single pulses."""
    searched = [_search.curves(half.corrected, phase, view.window) for half, phase in zip(halves, free, strict=True)]
    pairs = list(zip(*searched, strict=True))

    def gains(pair: tuple[np.ndarray, np.ndarray]) -> np.ndarray:
        return np.array([halves[1 - h].gain(_registered(view, pair[h], pair[1 - h])[0]) for h in (0, 1)])

    levels = [gains(pair) for pair in pairs]
    best = int(np.argmax([level.prod() for level in levels]))
    return _Curves(_search.MODES[best], list(pairs[best]), levels[best])


def _least_of_curves(curves: _Curves, closeness: Callable[[np.ndarray, np.ndarray], float]) -> float:
    """Closeness from which on the phases of both halves of the band, smoothed to so many cosines, agree.

    With few points in a range cell the phases of single pulses, each free, focus them to fewer points than there are:
    two such phases have no more than the smooth curve in common on which they lie. Curves of few cosines are close by
    chance far more often, and curves near zero are close whatever they are: those must be closer to each other than to
    zero.
    """
    zero = np.zeros(len(curves.phases[0]))
    return max(AGREE, _phase_smoothing.chance(curves.modes), *(closeness(curve, zero) for curve in curves.phases))


def _apart(displacements: _displacement.Displacements, agreement: float) -> str:
    """Reason to refuse a correction that moves bright places against one another; empty where there is none.

    Each place alone is as sharp wherever it lies. That two of them belong where the phase puts them is known as far as
    the same pulses see both, and as far as the halves of the band say the same.
    """
    if displacements.apart <= APART or (agreement >= SURE and displacements.common >= COMMON):
        return ""
    doubt = UNSURE.format(agreement, SURE) if agreement < SURE else UNLINKED.format(displacements.common, COMMON)
    return MOVED_APART.format(np.ptp(displacements.along), displacements.apart, doubt)


def _sharpens_others(view: ApertureView, errors: Errors) -> bool:
    """Whether the echoes without those of constant delay, where there are any, are at least as sharp as they were."""
    raw = without_constant_echo(view.raw, view.channels)
    if raw is None:
        return True
    rest, zero = replace(view, raw=raw), (np.zeros(view.n), np.zeros(view.n))
    places = rest.probes(zero, errors)
    gain = rest.sharpness(errors, places) / max(rest.sharpness(zero, places), 1e-300)
    log.debug("the sharpness without echoes of constant delay is x %.3f", gain)
    return gain >= KEPT


def _none_lost(view: ApertureView, errors: Errors, power: np.ndarray) -> bool:
    """Whether no bright point of the image without any correction is lost in the corrected one.

    power  of the corrected image

    Where no target is seen by all pulses, most may become sharper and others blurred. The bright points of a blurred
    image lie beside the targets: as far as the phase moves a place by its slope, which is more metres for a far place.
    """
    zero = np.zeros(view.n)
    bright, levels = _bright_points.pixels_and_levels(power, view.grid, _bright_points.CANDIDATES)
    # a phase that changes by so much per pulse moves a point by so much across range, unless it soon turns back
    span = max(1, view.n // SPANS)
    slope = np.percentile(np.abs(errors[0][span:] - errors[0][:-span]), 90) / span
    for place, level in zip(*_displacement.bright_places(view, view.power((zero, zero))), strict=True):
        per_metre = np.ptp(_displacement.shift_phase(view, place, np.ones(view.n))) / view.n
        near = np.linalg.norm(bright - place, axis=1) <= 2 * view.cell + slope / max(per_metre, 1e-300)
        if levels[near].max(initial=0.0) < LOST * level:
            log.debug("the point at %s, bright before, is lost", place)
            return False
    return True
