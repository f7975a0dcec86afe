"""Pairs of float64 on the host, and rows as kernels/precise.cl wants them."""

from __future__ import annotations

from typing import Any

import numpy as np

from .check import SPEED_OF_LIGHT
from .geometry import Antennas
from .phase_history import PhaseHistory

Pair = tuple[np.ndarray, np.ndarray]  # an unevaluated sum hi + lo, about 106 bits


def exact_sum(a: Any, b: Any) -> Pair:
    """a + b exactly (Knuth 1969)."""
    s = a + b
    t = s - a
    return s, (a - (s - t)) + (b - t)


def exact_product(a: Any, b: Any) -> Pair:
    """a b exactly, |a|, |b| < 1e300 (Dekker 1971: each factor in two halves of 26 bits)."""

    def halves(x: Any) -> Pair:
        big = x * 134217729.0
        hi = big - (big - x)
        return hi, x - hi

    p = np.multiply(a, b)
    (ah, al), (bh, bl) = halves(np.asarray(a, np.float64)), halves(np.asarray(b, np.float64))
    return p, ((ah * bh - p) + ah * bl + al * bh) + al * bl


def quotient(a: Pair, b: Any) -> Pair:
    """a/b to about 104 bits."""
    first = a[0] / b
    p, e = exact_product(first, b)
    return exact_sum(first, (((a[0] - p) - e) + a[1]) / b)


def packed(raw: PhaseHistory, antennas: Antennas, length: int, start: int, stop: int, lanes: int) -> np.ndarray:
    """Per-pulse array (components, n) of rows start ... stop - 1 for profiles of `length` samples; see precise.cl.

    n is rounded up to whole vectors of `lanes` by repeating the last row. Positions and reference ranges are float64
    as given, so exact; what is derived from frequencies comes in pairs: kappa = 2 fc/c with fc the frequency of
    sample n_samples//2, sigma = 2 df length/c, limit = c/(4 df).
    """
    n = -(-(stop - start) // lanes) * lanes
    rows = np.minimum(np.arange(start, start + n), stop - 1)
    step = raw.frequency_step[rows]
    hi, lo = exact_product(float(raw.n_samples // 2), step)
    carrier, low = exact_sum(raw.frequency[rows], hi)
    kappa = quotient(exact_sum(carrier, low + lo), SPEED_OF_LIGHT / 2)
    sigma = quotient(exact_product(float(length), step), SPEED_OF_LIGHT / 2)
    limit = quotient((np.full(n, SPEED_OF_LIGHT / 4), np.zeros(n)), step)
    components = [*raw.tx[rows].T, raw.reference_range[rows], *kappa, *sigma, *limit]
    if antennas.rx is not None:
        components += list(antennas.rx[rows].T)
    if antennas.beam is not None:
        half = np.full(n, antennas.beam_angle / 2)
        components += [*antennas.beam[rows].T, np.cos(half), np.sin(half)]
    return np.stack(components)
