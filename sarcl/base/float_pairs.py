"""Sums of two numbers: with their rounding error, and float64 as pairs of float32 for devices without float64."""

from __future__ import annotations

from typing import Any

import numpy as np


def exact_sum(a: Any, b: Any) -> tuple[Any, Any]:
    """a + b, rounded, and its rounding error, in their number type (Knuth 1969)."""
    total = a + b
    part = total - a
    return total, (a - (total - part)) + (b - part)


def wide(values: np.ndarray) -> np.ndarray:
    """Numbers as hi and lo float32 parts, (2, ...): about 48 bits of a float64 (or longdouble)."""
    values = np.asarray(values)
    hi = values.astype(np.float32)
    return np.stack([hi, (values - hi).astype(np.float32)])


def magic(step: float) -> np.float32:
    """The number that rounds to multiples of `step`, a power of two, by adding and subtracting it in float32."""
    return np.float32(1.5 * 2**23 * step)
