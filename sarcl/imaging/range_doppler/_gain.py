"""Gain of a range-Doppler image: in each pixel the sum of the weights of the rows that see it.

gain(u, r) = sum_n w_n sum_p w_p b(s_p(u, r)),    b: the weight of the Doppler band at the sine of row p
"""

from __future__ import annotations

import numpy as np

from ._doppler import sine
from ._plan import FocusPlan
from ._track import Track

COLUMNS = 65  # slant ranges at which sums are made; they are linear between: apertures grow as the slant range does


def gain_of(
    plan: FocusPlan, track: Track, sample_weight: np.ndarray, row_weight: np.ndarray, faintest: float
) -> float | np.ndarray:
    """The gain: a number where it is the same in all pixels to 1e-6, else float32 (times, ranges).

    faintest  of the largest gain: pixels of less count as seen by no row
    """
    from scipy.signal import fftconvolve

    n_rows, (n_times, n_ranges) = len(row_weight), (len(plan.times), len(plan.ranges))
    chosen = np.unique(np.linspace(0, n_ranges - 1, COLUMNS).round().astype(int))
    step = track.step / plan.finer
    between = np.arange(-plan.finer * (n_rows - 1), n_times)
    rows = np.zeros(plan.finer * (n_rows - 1) + 1)
    rows[:: plan.finer] = row_weight * sample_weight.sum()
    sums = np.empty((n_times, len(chosen)))
    for k, column in enumerate(chosen):
        distance = plan.ranges[column]
        speed, _, shift = (float(v[0]) for v in plan.fit.at(np.array([distance])))
        later = float(plan.times[0]) + shift - track.start + step * between
        seen = plan.band.weight(sine(later, distance, np.array(0.0), speed))
        sums[:, k] = fftconvolve(seen, rows, mode="valid")
    largest = float(sums.max())
    if sums.min() >= (1 - 1e-6) * largest:
        return largest
    out = np.empty((n_times, n_ranges), np.float32)
    position = np.interp(np.arange(n_ranges), chosen, np.arange(len(chosen)))
    before = np.minimum(position.astype(int), max(len(chosen) - 2, 0))
    after, share = np.minimum(before + 1, len(chosen) - 1), position - before
    for first in range(0, n_times, 256):  # in blocks: a large image is not held in float64
        block = sums[first : first + 256]
        out[first : first + 256] = block[:, before] * (1 - share) + block[:, after] * share
    out[out < faintest * largest] = 0
    return out
