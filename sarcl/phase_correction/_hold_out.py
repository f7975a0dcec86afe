"""Cross-validation: a part of the echoes gives a phase of its own, which must sharpen echoes it was not found from.

Two ways to divide the echoes in halves are used. Halves of the band have the errors of the pulses and the scene in
common, but neither noise nor speckle. Halves of the places are near and far ones: they have the errors in common, but
no target. What makes one target sharper at the cost of others, such as an echo of constant delay, shows there.
"""

from __future__ import annotations

import logging
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from ..base.validation import sealed
from . import _bright_points, _displacement, _phase_gradient, _phase_smoothing, _smooth_search
from ._aperture_view import NO_LAG, ApertureView, Errors
from ._constant_echo import without_constant_echo
from ._echo_parts import near_and_far, phase_of

log = logging.getLogger(__name__)

AGREE = 0.4  # least closeness of two phases at which they agree; that of noise is smaller
# Least gain in sharpness of echoes that a phase was not found from. It is 0.1 dB of a peak, which is left in the data
# rather than risked: neighbouring points of the scene, which both halves of the band show, can gain as much by chance
GAIN = 1.05
KEPT = 0.95  # least change in sharpness, which is that of noise too, of the echoes without those of constant delay
LOST = 0.5  # of its power, less than which a point must not keep: pixels beside its maximum show about as much
APART = 0.5  # resolution cells: what moves bright places against one another by more must be known for certain
SURE = 0.98  # agreement of the halves of the band from which on it is; 0.95 to 0.98 has been wrong by 1.4 cells
COMMON = 0.35  # share of their pulses that neighbouring bright places must have in common for it
SPANS = 16  # of the aperture: a slope of the phase over one of them moves points, one over a few pulses blurs them
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


def cross_validated(view: ApertureView, errors: Errors, tick: Callable[[], None]) -> tuple[Errors, dict[str, Any]]:
    """Errors, smoothed as cross-validation asks for, and fields of PhaseErrors that say how well they passed it.

    Every half of the echoes gives a phase of its own, with the given range errors. It is smoothed to the number of
    cosines that sharpens the other halves most.
    """
    n, shift, samples = view.n, errors[1], view.raw.n_samples
    zero = np.zeros(n)
    places = view.probes((zero, zero), errors)
    parts = view.band(0, samples // 2), view.band(samples - samples // 2, samples)
    values = [part.contributions((zero, shift), places, NO_LAG, taper=True)[:, :, 0] for part in parts]
    plain = values
    if shift.any():
        plain = [part.contributions((zero, zero), places, NO_LAG, taper=True)[:, :, 0] for part in parts]
    tick()
    sets = [np.tile(s, view.channels) for s in near_and_far(parts[0], places, values, errors[0])]

    def closeness(a: np.ndarray, b: np.ndarray) -> float:
        return _phase_smoothing.alignment(a, b, view.shift_phase, view.cell / 2)[1]

    least = max(AGREE, _phase_smoothing.chance(n))
    bands = [phase_of(view, v) for v in values]
    moved, agreement = _phase_smoothing.alignment(bands[0], bands[1], view.shift_phase, view.cell / 2)
    difference = np.exp(1j * (moved - bands[1]))
    # (phase, columns it must sharpen, the same without any correction, phase of these columns)
    tests = [(bands[1 - h], values[h], plain[h], bands[h]) for h in (0, 1)]
    sides = []
    for some in sets:
        own = [phase_of(view, v.compress(some, axis=1)) for v in values] if some.sum() > 1 else []
        known = closeness(*own) if own else 0.0
        both = np.concatenate([v.compress(some, axis=1) for v in values], axis=1)
        old = np.concatenate([v.compress(some, axis=1) for v in plain], axis=1)
        sides.append((known, phase_of(view, both) if known > least else zero, both, old))
        log.debug("%d places give phases that agree to %.2f between halves of the band", some.sum(), known)
    if all(side[0] > least for side in sides):
        tests += [(sides[1 - i][1], sides[i][2], sides[i][3], sides[i][1]) for i in (0, 1)]
    tick()

    ladder = [2**k for k in range(2, 40) if 2**k < n] + [n]

    def ladder_of_gains(phase: np.ndarray, held: np.ndarray, before: np.ndarray, own: np.ndarray) -> list[float]:
        """Gains in sharpness by the phase of other echoes, smoothed, and registered to the image of these."""
        was = max(_phase_gradient.sharpness(before, zero, view.window), 1e-300)
        ways = _phase_smoothing.unwrappings(phase)
        smoothed = (_phase_smoothing.smooth(phase, modes, ways) for modes in ladder)
        moved = (_phase_smoothing.alignment(curve, own, view.shift_phase, view.cell / 2)[0] for curve in smoothed)
        return [_phase_gradient.sharpness(held, curve, view.window) / was for curve in moved]

    gains = np.array([ladder_of_gains(*test) for test in tests]).T
    best = int(gains[:, :2].prod(axis=1).argmax())
    modes, gain = ladder[best], gains[best, :2]
    agree = agreement > least
    curves = [_phase_smoothing.smooth(phase, modes) for phase in bands]
    if modes < n:
        agreement = closeness(*curves)
        agree |= agreement > _least_of_curves(curves, modes, closeness)
    if view.is_narrow:  # where each place has its own pulses, few cosines leave the places apart
        other = _searched_as_curves(view, values, plain, bands)
        close = closeness(*other[1])
        sharper = other[2].prod() > gain.prod()  # phases of single pulses may focus several points to one
        if close > _least_of_curves(other[1], other[0], closeness) and (sharper or not agree):
            agree, agreement = True, close
            modes, curves, gain = other
    # phases from some of the places have more noise, and ask for more smoothing
    apart = gains[:, 2:].min(axis=1).max() if len(tests) > 2 else np.inf
    log.debug("gains of %s cosines: %s", ladder, gains.round(3).tolist())

    # the result must sharpen the whole band too: a phase with an error of unwrapping would not
    candidates = [_phase_smoothing.smooth(errors[0], modes), *curves]
    smoothed = [view.shift_removed((curve, shift)) for curve in candidates]
    both, old = np.concatenate(values, axis=1), np.concatenate(plain, axis=1)
    levels = np.array([_phase_gradient.sharpness(both, e[0], view.window) for e in smoothed])
    chosen = int((levels * (CLOSER, 1, 1)).argmax())
    was = _phase_gradient.sharpness(old, zero, view.window)
    lowest = min(*gain, apart, levels[chosen] / max(was, 1e-300))
    final = smoothed[chosen]
    power = view.power(final)
    displaced = _displacement.displacements(view, final, power)
    reason = ""
    if not agree:
        reason = DISAGREE.format(agreement)
    elif lowest > GAIN and not _sharpens_others(view, final):
        reason = BLURRED
    elif lowest > GAIN and not _none_lost(view, final, power):
        reason = LOST_POINT
    elif gain.min() > GAIN >= apart:
        reason = BLURRED
    elif lowest <= GAIN:
        reason = IN_FOCUS
    else:
        reason = _apart(displaced, agreement)
    return final, {
        "found": not reason,
        "gain": float(np.sqrt(gain.prod())),
        "agreement": agreement,
        "spread": float(np.std(np.angle(difference * difference.sum().conj())) / 2),
        "modes": modes,
        "reason": reason,
        "places": sealed(displaced.places),
        "displacements": sealed(displaced.along),
    }


def _searched_as_curves(
    view: ApertureView, values: list[np.ndarray], plain: list[np.ndarray], free: list[np.ndarray]
) -> tuple[int, list[np.ndarray], np.ndarray]:
    """Phases of few cosines of both halves of the band, searched as such: their number, the phases, and their gains.

    values, plain  contributions from the halves, with the range errors removed and without any correction
    free           phases of single pulses that sharpen the halves
    """
    zero = np.zeros(view.n)
    was = [max(_phase_gradient.sharpness(before, zero, view.window), 1e-300) for before in plain]
    searched = [_smooth_search.curves(v, phase, view.window) for v, phase in zip(values, free, strict=True)]
    pairs = list(zip(*searched, strict=True))

    def gains(pair: tuple[np.ndarray, np.ndarray]) -> np.ndarray:
        moved = [_phase_smoothing.alignment(a, b, view.shift_phase, view.cell / 2)[0] for a, b in (pair, pair[::-1])]
        sharp = [_phase_gradient.sharpness(values[1 - h], moved[h], view.window) / was[1 - h] for h in (0, 1)]
        return np.array(sharp)

    levels = [gains(pair) for pair in pairs]
    best = int(np.argmax([level.prod() for level in levels]))
    return _smooth_search.MODES[best], list(pairs[best]), levels[best]


def _least_of_curves(
    curves: list[np.ndarray], modes: int, closeness: Callable[[np.ndarray, np.ndarray], float]
) -> float:
    """Closeness from which on the phases of both halves of the band, smoothed to `modes` cosines, agree.

    With few points in a range cell the phases of single pulses, each free, focus them to fewer points than there are:
    two such phases have no more than the smooth curve in common on which they lie. Curves of few cosines are close by
    chance far more often, and curves near zero are close whatever they are: those must be closer to each other than to
    zero.
    """
    zero = np.zeros(len(curves[0]))
    return max(AGREE, _phase_smoothing.chance(modes), *(closeness(curve, zero) for curve in curves))


def _apart(moved: _displacement.Displacements, agreement: float) -> str:
    """Why a correction that moves bright places against one another is refused; empty where it is not.

    Each place alone is as sharp wherever it lies. That two of them belong where the phase puts them is known as far as
    the same pulses see both, and as far as the halves of the band say the same.
    """
    if moved.apart <= APART or (agreement >= SURE and moved.common >= COMMON):
        return ""
    why = UNSURE.format(agreement, SURE) if agreement < SURE else UNLINKED.format(moved.common, COMMON)
    return MOVED_APART.format(np.ptp(moved.along), moved.apart, why)


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
    new, now = _bright_points.pixels_and_levels(power, view.grid, _bright_points.CANDIDATES)
    # a phase that changes by so much per pulse moves a point by so much across range, unless it soon turns back
    span = max(1, view.n // SPANS)
    slope = np.percentile(np.abs(errors[0][span:] - errors[0][:-span]), 90) / span
    for place, level in zip(*_displacement.bright_places(view, view.power((zero, zero))), strict=True):
        per_metre = np.ptp(_displacement.shiftphase_of(view, place, np.ones(view.n))) / view.n
        near = np.linalg.norm(new - place, axis=1) <= 2 * view.cell + slope / max(per_metre, 1e-300)
        if now[near].max(initial=0.0) < LOST * level:
            log.debug("the point at %s, bright before, is lost", place)
            return False
    return True
