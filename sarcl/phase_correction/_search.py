"""The search of `autofocus`: phase and range of every pulse that maximise the sharpness of bright points."""

from __future__ import annotations

import logging
from collections.abc import Callable

import numpy as np

from . import _phase_gradient, _phase_smoothing
from ._aperture_view import LAGS, NO_LAG, WINDOW, ApertureView, Errors

log = logging.getLogger(__name__)

PASSES = 5  # largest number of images in one ascent
ENOUGH = 1.002  # gain in sharpness below which an ascent ends, if also
MOVED = 0.05  # range cells: no range error changes by more
GROWTH = 4  # a sub-aperture grows by a fourth of its length on each side
LAST_PASSES = 3  # passes over the whole aperture, at most
BANDS = 8, 4, 2, 1  # parts of the band: a range error of eight cells is one cell of an eighth of the band
LEAST_SAMPLES = 8  # samples in a part of the band
RANGE_MODES = 8  # cosines over the aperture for range errors, or an eighth of the pulses where that is fewer
# Doppler cells between places where range errors are estimated. A target beside a place, in the window about it, moves
# through range cells; where only places on one side see it, as at the edge of a grid, that looks like a range error
APART = WINDOW
RANGE_GAIN = 1.015  # least gain in sharpness by which range errors are accepted
MODES = 4, 8, 16, 32  # cosines over the aperture, in a search for smooth phases
STEPS = 15  # steps of that search, for each number of cosines
RANGE_CELLS = 0.05  # least rms of range errors, cells, at which they are tried: smaller ones can hardly be seen


def ascend(view: ApertureView, errors: Errors) -> Errors:
    """The errors with the phase, near that of `errors`, of the largest sharpness."""
    return _narrow(view, errors, False, PASSES) if view.is_narrow else _widened(view, errors)


def _narrow(view: ApertureView, errors: Errors, ranges: bool, passes: int) -> Errors:
    """`ascend` over a narrow aperture; with `ranges` the range errors too.

    Each pass makes an image, chooses bright points farther apart than they are still blurred, and estimates the phase
    from them: by phase gradient autofocus, then by sharpness.
    """
    n, lags = view.n, LAGS if ranges else NO_LAG
    for k in range(passes):
        places = view.brightest(errors, max(n / 2 / 4**k, APART if ranges else 8.0))
        v = view.contributions(errors, places, lags)
        flat = v.reshape(n, -1)
        step, gain = _phase_gradient.focused(flat, v[:, :, len(lags) // 2], k, WINDOW)
        cells = np.zeros(n)
        if ranges:
            cells = _phase_gradient.range_shift(v, step, max(n / 4**k, WINDOW), min(RANGE_MODES, n // 8)) / 2
        errors = view.shift_removed((errors[0] + step, errors[1] + cells * view.cell))
        log.debug("pass %d: %d places, sharpness x %.4f, range %.3f cells", k, len(places), gain, abs(cells).max())
        if gain < ENOUGH and abs(cells).max() < MOVED:
            break
    return errors


def _widened(view: ApertureView, errors: Errors) -> Errors:
    """`ascend` over a wide aperture: the narrow sub-aperture first, then more and more pulses on both sides of it.

    Added pulses get the phases that fit the image of the others best; then all phases are sharpened, in the brightest
    pixels alone.
    """
    n = view.n
    phase, shift = errors[0].copy(), errors[1]
    first, last = view.narrow_pulses
    narrow = view.pulses(first, last)
    phase[first:last] = _narrow(narrow, (phase[first:last], shift[first:last]), False, PASSES)[0]
    log.debug("narrow sub-aperture: pulses %d to %d of %d", first, last, n)
    passes = 0
    while passes < LAST_PASSES:
        passes += last - first == n
        places = view.pulses(first, last).pixels((phase[first:last], shift[first:last]))
        step = (last - first) // GROWTH + 1
        low, high = max(0, first - step), min(n, last + step)
        now = phase[low:high], shift[low:high]
        v = view.pulses(low, high).contributions(now, places, NO_LAG)[:, :, 0]
        start = _phase_gradient.extended(v, np.zeros(high - low), first - low, last - low)
        step_of_phase = _phase_gradient.sharpen(v, start, 0)
        phase[low:high] += step_of_phase
        if passes and _phase_gradient.sharpness(v, step_of_phase, 0) < ENOUGH * _phase_gradient.sharpness(v, start, 0):
            break
        first, last = low, high
    # a start without phases: where targets seen by different pulses have none in common, growth loses some of them
    zero = np.zeros(n)
    places = view.probes((zero, shift), (phase, shift))
    v = view.values((zero, shift), places)
    starts = [phase, _phase_gradient.sharpen(v, zero, 0)]
    return view.shift_removed((max(starts, key=lambda start: _phase_gradient.sharpness(v, start, 0)), shift))


def searches(view: ApertureView, ranges: bool) -> int:
    """Number of calls of `tick` by `search`."""
    return 1 + (len(BANDS) if ranges and view.is_narrow else 0)


def search(view: ApertureView, ranges: bool, tick: Callable[[], None]) -> Errors:
    """Errors, from a start without any. Range errors are accepted where they gain enough in sharpness.

    Two kinds are tried: the range errors of a motion that explains the phase; and over narrow apertures those estimated
    in an eighth of the band first, in whose range cells they stay, and then in more and more of it. The second kind is
    left out where the echoes stay in their range cells under the phase alone.
    """
    zero = np.zeros(view.n)
    plain = ascend(view, (zero, zero))
    tick()
    if not ranges:
        return plain
    estimate = plain
    if view.is_narrow:
        if _migrates(view, plain):
            estimate, m = (zero, zero), view.raw.n_samples
            for parts in BANDS:
                if m // parts >= LEAST_SAMPLES:
                    first = (m - m // parts) // 2
                    estimate = _narrow(view.band(first, first + m // parts), estimate, True, 3)
                tick()
        else:
            for _ in BANDS:
                tick()
    motions = [(plain[0], view.implied_range(plain[0])), estimate, (estimate[0], view.implied_range(estimate[0]))]
    motions = [e for e in motions[: 1 if estimate is plain else 3] if np.std(e[1]) > RANGE_CELLS * view.cell]
    if not motions:
        return plain
    places = view.probes(*([plain] if estimate is plain else [plain, estimate]), apart=APART)

    def sharpened(errors: Errors) -> tuple[float, Errors]:
        v = view.values(errors, places)
        step = _phase_gradient.sharpen(v, zero, view.window)
        return _phase_gradient.sharpness(v, step, view.window), view.shift_removed((errors[0] + step, errors[1]))

    stays = [plain] if estimate is plain else [plain, (estimate[0], zero)]
    still = max((sharpened(e) for e in stays), key=lambda s: s[0])
    best = max((sharpened(e) for e in motions), key=lambda s: s[0])
    log.debug("with a range error the sharpness is x %.4f", best[0] / max(still[0], 1e-300))
    return best[1] if best[0] > RANGE_GAIN * still[0] else still[1]


def _migrates(view: ApertureView, errors: Errors) -> bool:
    """Whether echoes, with the errors removed, move through range cells from pulse to pulse, as far as can be seen."""
    zero = np.zeros(view.n)
    v = view.contributions(errors, view.brightest(errors, APART), LAGS)
    cells = _phase_gradient.range_shift(v, zero, view.window, min(RANGE_MODES, view.n // 8)) / 2
    log.debug("under the phase alone the echoes move by %.3f range cells", abs(cells).max())
    return bool(abs(cells).max() >= MOVED)


def curves(v: np.ndarray, free: np.ndarray, width: float) -> list[np.ndarray]:
    """Phases (n,) of MODES cosines and a slope that sharpen contributions v (n, k).

    In crowded scenes free phases of single pulses make fewer points than there are.

    free   phase (n,) of the same contributions, each pulse by itself, which is a start besides the curve of fewer
           cosines: a large error is far from no phase at all. The sharper of the two is taken
    width  Doppler bins about 0, as of `_phase_gradient.sharpen`, whose steps are projected onto the cosines. MODES of
           half the pulses or more are left out.
    """
    phase, phases = np.zeros(len(v)), []
    for modes in (m for m in MODES if 2 * m < len(v)):
        ends = [_ascended(v, start, modes, width) for start in (phase, _phase_smoothing.smooth(free, modes))]
        phase = max(ends, key=lambda end: _phase_gradient.sharpness(v, end, width))
        phases.append(phase)
    return phases


def _ascended(v: np.ndarray, phase: np.ndarray, modes: int, width: float) -> np.ndarray:
    """The phase (n,) of so many cosines near `phase` that sharpens contributions v (n, k)."""
    for _ in range(STEPS):
        step = _phase_gradient.sharpen(v, phase, width, steps=1) - phase
        phase = _phase_smoothing.lowest(phase + np.angle(np.exp(1j * step)), modes)
    return phase
