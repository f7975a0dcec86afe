"""A point response by brute force: many positions, no interpolation, no roots."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike


def measure(
    value: Callable[[np.ndarray], np.ndarray], near: ArrayLike, axes: np.ndarray, cells: np.ndarray
) -> dict[str, Any]:
    """Position, irw, pslr, islr and peak of an exact image, pairs in the order of `axes`.

    value  complex image (n,) at any positions, m (n, 3)
    near   within a cell of the peak, m (3,)
    axes   unit vectors, (2, 3); cells: about the resolution along them, m (2,)
    """
    peak = np.array(near, np.float64)
    for zoom in 2.0 ** -np.arange(14):  # the best of 7 x 7 positions, ever closer together
        a, b = np.meshgrid(*(np.linspace(-zoom, zoom, 7) * cell for cell in cells))
        positions = peak + a.reshape(-1, 1) * axes[0] + b.reshape(-1, 1) * axes[1]
        peak = positions[np.abs(value(positions)).argmax()]
    out: dict[str, Any] = {"position": peak, "peak": value(peak[None])[0], "irw": [], "pslr": [], "islr": []}
    for axis, cell in zip(axes, cells, strict=True):
        t = np.linspace(-20 * cell, 20 * cell, 40 * 200 + 1)
        p = np.abs(value(peak + t[:, None] * axis)) ** 2
        top = len(t) // 2
        nulls = np.flatnonzero((p[1:-1] < p[:-2]) & (p[1:-1] < p[2:])) + 1
        left, right = nulls[nulls < top].max(), nulls[nulls > top].min()
        half = np.interp(p[top] / 2, p[left:top], t[left:top])
        irw = np.interp(-p[top] / 2, -p[top:right], t[top:right]) - half
        lobes = p[(np.abs(t) <= 10 * irw) & ((t < t[left]) | (t > t[right]))]
        out["irw"].append(irw)
        out["pslr"].append(10 * np.log10(lobes.max() / p[top]))
        out["islr"].append(10 * np.log10(lobes.sum() / p[left : right + 1].sum()))
    return out
