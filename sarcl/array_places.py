"""Few places of an array stand for all its elements: what lies between two places is interpolated.

Less the path to the scene's centre, an echo heard from an element turns as little over the array as the scene is wide:

    psi(d, x) = |T + d - x| - |T + d - c|,    exp(-j 2 pi f psi(d, x)/c) = sum_m L_m(d) exp(-j 2 pi f psi(d_m, x)/c)

with L_m Lagrange's polynomials along the array's axes, d_m Chebyshev's places on them. How much that errs is computed
at the elements themselves, for outermost places of the scene, whose psi are the largest.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import product

import numpy as np

SAFETY = 1.5  # pulses between those looked at
PULSES, ELEMENTS = 33, 1000  # at most looked at
FLAT = 1e-9  # of an array's extent: what is no wider than this is a line, or a plane

Extra = Callable[[np.ndarray], np.ndarray]  # of places, m (n, 3): their turns psi f/c for every corner and pulse (n, k)


@dataclass(frozen=True, eq=False)
class Places:
    """Places, m (m, 3), and how each element, (n,), is made of them: basis (n, m). error: relative."""

    at: np.ndarray
    basis: np.ndarray
    error: float = 0.0

    @property
    def growth(self) -> float:
        """By how much errors at the places may grow at an element."""
        return float(np.abs(self.basis).sum(axis=1).max())

    def __len__(self) -> int:
        return len(self.at)


def places_of(elements: np.ndarray, extra: Extra, allowed: float) -> Places:
    """The fewest places for elements, m (n, 3), whose error is at most `allowed`; else the elements themselves."""
    itself = Places(elements, np.eye(len(elements)))
    middle = (elements.min(axis=0) + elements.max(axis=0)) / 2
    if len(elements) == 1 or allowed <= 0:
        return itself
    best = itself
    for axes in (np.eye(3), np.linalg.svd(elements - middle, full_matrices=False)[2]):
        along = (elements - middle) @ axes.T
        centre = (along.min(axis=0) + along.max(axis=0)) / 2
        half = np.ptp(along, axis=0) / 2
        half[half <= FLAT * half.max()] = 0
        found = _along(along - centre, half, middle + centre @ axes, axes, elements, extra, allowed, len(best))
        if found is not None:
            best = found
    return best


def _along(
    along: np.ndarray, half: np.ndarray, centre: np.ndarray, axes: np.ndarray, elements: np.ndarray, extra: Extra,
    allowed: float, most: int,
) -> Places | None:  # fmt: skip
    """Places on a grid along axes (3, 3), fewer than `most`, or None. along: the elements' (n, 3), within +-half."""
    some = _some(along)
    wanted = np.exp(-2j * np.pi * extra(elements[some]))
    counts, wide = [1, 1, 1], np.flatnonzero(half)
    for axis in wide.tolist():

        def alone(count: int, axis: int = axis) -> bool:
            """Whether so many places do along this axis."""
            line = np.zeros((max(32, 4 * count), 3))
            line[:, axis] = np.linspace(-half[axis], half[axis], len(line))
            at, basis = _grid([count if i == axis else 1 for i in range(3)], half, line)
            made = basis @ np.exp(-2j * np.pi * extra(centre + at @ axes))
            error = np.abs(np.exp(-2j * np.pi * extra(centre + line @ axes)) - made).max()
            return bool(SAFETY * error <= allowed / (2 * len(wide)))

        few = 0
        while not alone(counts[axis]):
            few, counts[axis] = counts[axis], 2 * counts[axis]
            if few >= most:
                return None
        while counts[axis] - few > 1:
            middle = (few + counts[axis]) // 2
            few, counts[axis] = (few, middle) if alone(middle) else (middle, counts[axis])
    while int(np.prod(counts)) < most:
        at, basis = _grid(counts, half, along[some])
        error = SAFETY * float(np.abs(wanted - basis @ np.exp(-2j * np.pi * extra(centre + at @ axes))).max())
        if error <= allowed:
            return Places(centre + at @ axes, _grid(counts, half, along)[1], error)
        for axis in wide.tolist():
            counts[axis] += 1
    return None


def _grid(counts: list[int], half: np.ndarray, along: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Chebyshev's places of a grid (m, 3) within +-half, and Lagrange's polynomials of these at `along`: (n, m)."""
    nodes, parts = [], []
    for i, n in enumerate(counts):
        angle, order = np.pi * (np.arange(n) + 0.5) / n, np.arange(n)
        nodes.append(half[i] * np.cos(angle))
        where = np.arccos(np.clip(along[:, i] / half[i], -1, 1)) if half[i] else np.full(len(along), np.pi / 2)
        terms = np.cos(np.outer(where, order)) * np.where(order == 0, 1, 2) / n  # Chebyshev's polynomials
        parts.append(terms @ np.cos(np.outer(order, angle)))
    basis = np.einsum("na,nb,nc->nabc", *parts).reshape(len(along), -1)
    return np.array(list(product(*nodes))), basis


def _some(along: np.ndarray) -> np.ndarray:
    """Up to ELEMENTS of them, those farthest out among them."""
    if len(along) <= ELEMENTS:
        return np.arange(len(along))
    ends = [i for axis in range(3) for i in (along[:, axis].argmin(), along[:, axis].argmax())]
    drawn = np.random.default_rng(0).choice(len(along), ELEMENTS - len(ends), replace=False)
    return np.unique(np.concatenate([ends, drawn]))
