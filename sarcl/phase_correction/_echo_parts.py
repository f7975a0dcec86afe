"""Parts of the echoes for cross-validation: near and far places, and the phase that sharpens contributions most."""

from __future__ import annotations

import numpy as np

from . import _bright_points, _phase_gradient
from ._aperture_view import WINDOW, ApertureView
from ._search import ENOUGH, GROWTH

PASSES = 3  # passes of the estimate from given places
# of the power of the brightest place: side lobes in range, of a Hamming window over the band, are below (-43 dB)
SIDE_LOBES = 1e-4
BETWEEN = 2.0  # range cells of half the band behind the border of near and far places, which neither uses


def near_and_far(
    view: ApertureView, places: np.ndarray, values: list[np.ndarray], phase: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Two sets of places, bool (k,) each, at different ranges, of sharpness as equal as can be.

    Places between the sets belong to neither. Where they are all the targets that one of them has, the sets are those
    of which the fainter is as sharp as can be; where these lack a target too, both are empty.
    """
    middle = view.n // 2 * view.channels
    cells = _bright_points.delay(view.raw, middle, places) * view.raw.bandwidth[0]

    def sharpness(removed: np.ndarray) -> np.ndarray:
        return sum(abs(_phase_gradient.turned(v, removed).sum(axis=0)) ** 4 for v in values)

    level = np.maximum(sharpness(phase), sharpness(0 * phase))
    level = level.reshape(view.channels, -1).sum(axis=0)
    order = np.argsort(cells)
    ranges, total = cells[order], np.concatenate([[0.0], np.cumsum(level[order], dtype=np.float64)])
    beyond = np.searchsorted(ranges, ranges + BETWEEN, side="right")
    bright = level >= SIDE_LOBES**2 * level.max()
    for first in (np.arange(1, len(order) + 1), beyond):  # of the places behind each border, in order of range
        border = ranges[int(np.minimum(total[1:], total[-1] - total[first]).argmax())]
        sets = cells <= border, cells > border + BETWEEN
        if all((picked & bright).any() for picked in sets):
            return sets
    return np.zeros(len(cells), bool), np.zeros(len(cells), bool)


def phase_of(view: ApertureView, v: np.ndarray) -> np.ndarray:
    """The phase (n,), from a start without any, that sharpens the contributions v (n, k) to bright points most."""
    if view.is_narrow:
        return _narrow_phase(v)
    first, last = view.narrow_pulses
    phase = np.zeros(view.n)
    brightest = np.argsort(-np.abs(v[first:last].sum(axis=0)))[: view.places]
    phase[first:last] = _narrow_phase(v[first:last].take(brightest, axis=1))
    while last - first < view.n:
        step = (last - first) // GROWTH + 1
        low, high = max(0, first - step), min(view.n, last + step)
        start = _phase_gradient.extended(v[low:high], phase[low:high], first - low, last - low)
        phase[low:high] = _phase_gradient.sharpen(v[low:high], start, 0)
        first, last = low, high
    still = _phase_gradient.sharpen(v, np.zeros(view.n), 0)
    return max((phase, still), key=lambda start: _phase_gradient.sharpness(v, start, 0))


def _narrow_phase(v: np.ndarray) -> np.ndarray:
    """`phase_of` over a narrow aperture."""
    n = len(v)
    phase = np.zeros(n)
    for k in range(PASSES):
        widths = [max(n / 2 ** (k + i / 2), _phase_gradient.NARROWEST) for i in range(8)]
        width = max(n / 4**k, WINDOW)
        blurred = _phase_gradient.turned(v, phase)
        starts = [np.zeros(n), _phase_gradient.gradient(blurred, widths)]
        levels = [_phase_gradient.sharpness(blurred, start, width) for start in starts]
        step = _phase_gradient.sharpen(blurred, starts[int(np.argmax(levels))], width)
        phase = phase + step
        if width <= WINDOW and _phase_gradient.sharpness(blurred, step, width) < ENOUGH * levels[0]:
            break
    return phase
