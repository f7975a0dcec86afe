"""Few places of an array stand for all its elements: what lies between two places is interpolated.

Less the path to the scene's centre, an echo heard from an element turns as little over the array as the scene is wide:

    psi(d, x) = |T + d - x| - |T + d - c|,    exp(-j 2 pi f psi(d, x)/c) = sum_m L_m(d) exp(-j 2 pi f psi(d_m, x)/c)

with L_m Lagrange's polynomials along the array's axes, d_m Chebyshev's places on them. How much that errs is computed
at the elements themselves, for the responses of _response_samples.py.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import product

import numpy as np

SAFETY = 1.5  # pulses between those looked at
ELEMENTS = 1000  # at most looked at
BLOCK = 64  # elements at a time
FLAT = 1e-9  # of an array's extent: what is no wider than this is a line, or a plane

Response = Callable[[np.ndarray], np.ndarray]  # at places, m (n, 3): complex (n, k), see `_response_samples.Views`


@dataclass(frozen=True, eq=False)
class Places:
    """Places, m (m, 3), and how each element, (n,), is made of them: basis (n, m), or None: they are the elements.

    error  relative
    """

    at: np.ndarray
    basis: np.ndarray | None = None
    error: float = 0.0

    @property
    def growth(self) -> float:
        """By how much errors at the places may grow at an element."""
        return 1.0 if self.basis is None else float(np.abs(self.basis).sum(axis=1).max())

    def __len__(self) -> int:
        return len(self.at)


def places_of(elements: np.ndarray, response: Response, allowed: float, most: float = np.inf, least: int = 1) -> Places:
    """The fewest places for elements, m (n, 3), whose error is at most `allowed`; else the elements themselves.

    most  so many places do not pay;  least  places along an axis that is not flat
    """
    best = Places(elements)
    if len(elements) == 1 or allowed <= 0:
        return best
    middle = (elements.min(axis=0) + elements.max(axis=0)) / 2
    off = elements - middle
    for axes in (np.eye(3), np.linalg.eigh(off.T @ off)[1].T):
        along = off @ axes.T
        centre = (along.min(axis=0) + along.max(axis=0)) / 2
        half = np.ptp(along, axis=0) / 2
        half[half <= FLAT * half.max()] = 0
        grid = _Grid(along - centre, half, middle + centre @ axes, axes, response)
        found = grid.fewest(elements, allowed, min(most + 1, len(best)), least)
        if found is not None:
            best = found
    return best


class _Grid:
    """Chebyshev's places on a grid along axes (3, 3) about a centre, for elements at `along` (n, 3), within +-half."""

    def __init__(
        self, along: np.ndarray, half: np.ndarray, centre: np.ndarray, axes: np.ndarray, response: Response
    ) -> None:
        self.along, self.half, self.centre, self.axes, self.response = along, half, centre, axes, response

    def fewest(self, elements: np.ndarray, allowed: float, fewer_than: float, least: int) -> Places | None:
        """The fewest places that do, or None where these are not fewer than asked."""
        wide = np.flatnonzero(self.half)
        counts, some = [1, 1, 1], _some(self.along)
        for axis in wide.tolist():  # each alone

            def do(count: int, axis: int = axis) -> bool:
                alone = [count if i == axis else 1 for i in range(3)]
                line = np.zeros((max(32, 4 * count), 3))
                line[:, axis] = np.linspace(-self.half[axis], self.half[axis], len(line))
                return self._error(alone, line, self.centre + line @ self.axes) <= allowed / (2 * len(wide))

            few, counts[axis] = least - 1, least
            while not do(counts[axis]):
                few, counts[axis] = counts[axis], 2 * counts[axis]
                if few >= fewer_than - 1:
                    return None
            while counts[axis] - few > 1:
                middle = (few + counts[axis]) // 2
                few, counts[axis] = (few, middle) if do(middle) else (middle, counts[axis])
        while int(np.prod(counts)) < fewer_than:
            error = self._error(counts, self.along[some], elements[some])
            if error <= allowed:
                at, basis = self.made(counts, self.along)
                return Places(self.centre + at @ self.axes, basis, error)
            for axis in wide.tolist():
                counts[axis] += 1
        return None

    def _error(self, counts: list[int], along: np.ndarray, elements: np.ndarray) -> float:
        """The largest there is at elements, m (n, 3)."""
        at, basis = self.made(counts, along)
        there = self.response(self.centre + at @ self.axes)
        worst = 0.0
        for a in range(0, len(along), BLOCK):
            wanted = self.response(elements[a : a + BLOCK])
            worst = max(worst, float(np.abs(wanted - basis[a : a + BLOCK] @ there).max()))
        return SAFETY * worst

    def made(self, counts: list[int], along: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Places (m, 3) along the axes, and Lagrange's polynomials of these at `along` (n, 3): (n, m)."""
        nodes, parts = [], []
        for i, n in enumerate(counts):
            angle, order = np.pi * (np.arange(n) + 0.5) / n, np.arange(n)
            nodes.append(self.half[i] * np.cos(angle))
            flat = np.full(len(along), np.pi / 2)
            where = np.arccos(np.clip(along[:, i] / self.half[i], -1, 1)) if self.half[i] else flat
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
