"""The search behind `autofocus`: phase and range of every pulse that make the bright places of an image sharpest."""

from __future__ import annotations

import logging
from collections.abc import Callable

import numpy as np

from . import _phase_gradient
from ._aperture_view import LAGS, NO_LAG, WINDOW, Errors, View

log = logging.getLogger(__name__)

PASSES = 5  # images of one climb, at most
ENOUGH = 1.002  # gain in sharpness below which a climb ends
MOVED = 0.05  # range cells below which it does
GROWTH = 4  # an aperture grows by its fourth part on each side
LAST_PASSES = 3
BANDS = 8, 4, 2, 1  # a range error of eight cells is one of an eighth of the band
LEAST_SAMPLES = 8
RANGE_MODES = 8  # cosines over the aperture, or an eighth of the pulses where that is fewer
RANGE_GAIN = 1.015  # what a range error must gain in sharpness to be believed,
RANGE_CELLS = 0.05  # and how large it must be, rms: less can hardly be seen


def climb(view: View, errors: Errors) -> Errors:
    """The errors with the phase near `errors` that makes the image sharpest."""
    return _narrow(view, errors, False, PASSES) if view.narrow else _grown(view, errors)


def _narrow(view: View, errors: Errors, walk: bool, passes: int) -> Errors:
    """`climb` over a narrow aperture; with `walk` the range errors too.

    Each pass makes an image, picks bright places far enough apart for what is still blurred, and finds the
    phase there: by gradient from afar, then by sharpness.
    """
    n, lags = view.n, LAGS if walk else NO_LAG
    zero = np.zeros(n)
    for k in range(passes):
        places = view.brightest(errors, max(n / 2 / 4**k, 8.0))
        v = view.contributions(errors, places, lags)
        flat = v.reshape(n, -1)
        widths = [max(n / 2 ** (k + i / 2), _phase_gradient.NARROWEST) for i in range(8)]
        width = max(n / 4**k, WINDOW)
        starts = [zero, _phase_gradient.gradient(v[:, :, len(lags) // 2], widths)]
        levels = [_phase_gradient.sharpness(flat, start, width) for start in starts]
        step = _phase_gradient.sharpen(flat, starts[int(np.argmax(levels))], width)
        gain = _phase_gradient.sharpness(flat, step, width) / max(levels[0], 1e-300)
        cells = np.zeros(n)
        if walk:
            cells = _phase_gradient.range_shift(v, step, width, min(RANGE_MODES, n // 8)) / 2
        errors = view.unmoved((errors[0] + step, errors[1] + cells * view.cell))
        log.debug("pass %d: %d places, sharpness x %.4f, range %.3f cells", k, len(places), gain, abs(cells).max())
        if gain < ENOUGH and abs(cells).max() < MOVED:
            break
    return errors


def _grown(view: View, errors: Errors) -> Errors:
    """`climb` over a wide aperture: a narrow core first, then more and more pulses on both sides of it.

    Their phases are those that fit the image of the pulses before; then all climb, in the bright pixels alone.
    """
    n = view.n
    phase, shift = errors[0].copy(), errors[1]
    first, last = view.core
    core = view.pulses(first, last)
    phase[first:last] = _narrow(core, (phase[first:last], shift[first:last]), False, PASSES)[0]
    log.debug("core of pulses %d to %d of %d", first, last, n)
    passes = 0
    while passes < LAST_PASSES:
        passes += last - first == n
        places = view.pulses(first, last).pixels((phase[first:last], shift[first:last]))
        step = (last - first) // GROWTH + 1
        low, high = max(0, first - step), min(n, last + step)
        now = phase[low:high], shift[low:high]
        v = view.pulses(low, high).contributions(now, places, NO_LAG)[:, :, 0]
        start = _phase_gradient.extended(v, first - low, last - low)
        phase[low:high] += _phase_gradient.sharpen(v, start, 0)
        first, last = low, high
    return view.unmoved((phase, shift))


def searches(view: View, walk: bool) -> int:
    """How often `search` calls `tick`."""
    return 1 + (len(BANDS) if walk and view.narrow else 0)


def search(view: View, walk: bool, tick: Callable[[], None]) -> Errors:
    """Errors from scratch. A range error is believed where it is sharper than the best without one.

    Range errors are sought as what the phase means if it comes from motion; and over narrow apertures in an eighth
    of the band first, whose cells they do not leave, then in more and more of it.
    """
    zero = np.zeros(view.n)
    plain = climb(view, (zero, zero))
    tick()
    found = plain
    if walk and view.narrow:
        found, m = (zero, zero), view.raw.n_samples
        for parts in BANDS:
            if m // parts >= LEAST_SAMPLES:
                first = (m - m // parts) // 2
                found = _narrow(view.band(first, first + m // parts), found, True, 3)
            tick()
    if not walk:
        return plain
    places = view.probes(plain, found)

    def sharpened(errors: Errors) -> tuple[float, Errors]:
        v = view.values(errors, places)
        step = _phase_gradient.sharpen(v, zero, view.window)
        return _phase_gradient.sharpness(v, step, view.window), view.unmoved((errors[0] + step, errors[1]))

    still = max((sharpened(e) for e in (plain, (found[0], zero))), key=lambda s: s[0])
    walks = [(plain[0], view.tied(plain[0])), found, (found[0], view.tied(found[0]))]
    walks = [e for e in walks if np.std(e[1]) > RANGE_CELLS * view.cell]
    best = max((sharpened(e) for e in walks), key=lambda s: s[0], default=still)
    log.debug("with a range error the sharpness is x %.4f", best[0] / max(still[0], 1e-300))
    return best[1] if best[0] > RANGE_GAIN * still[0] else still[1]
