"""Double-double arithmetic: products and quotients of float64 with their rounding errors."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..base.float_pairs import exact_sum

Pair = tuple[np.ndarray, np.ndarray]  # an unevaluated sum hi + lo, about 106 bits


def exact_product(a: Any, b: Any) -> Pair:
    """a b exactly, |a|, |b| < 1e300 (Dekker 1971: each factor in two halves of 26 bits)."""

    def halves(x: Any) -> Pair:
        big = x * 134217729.0
        hi = big - (big - x)
        return hi, x - hi

    p = np.multiply(a, b)
    (ah, al), (bh, bl) = halves(np.asarray(a, np.float64)), halves(np.asarray(b, np.float64))
    return p, ((ah * bh - p) + ah * bl + al * bh) + al * bl


def quotient(a: Pair, b: object) -> Pair:
    """a/b to about 104 bits."""
    first = a[0] / b
    p, e = exact_product(first, b)
    return exact_sum(first, (((a[0] - p) - e) + a[1]) / b)
