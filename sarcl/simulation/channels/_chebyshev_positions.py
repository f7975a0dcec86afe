"""Chebyshev positions in an array: echoes computed there are interpolated to all elements.

Without the path to the scene's centre, the phase of an echo changes as little over the array as the scene is small:

    psi(d, x) = |T + d - x| - |T + d - c|,    exp(-j 2 pi f psi(d, x)/c) = sum_m L_m(d) exp(-j 2 pi f psi(d_m, x)/c)

with L_m Lagrange's polynomials along the array's axes and d_m Chebyshev nodes on them. The interpolation error is
computed at the elements themselves, for the responses of _response_samples.py.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import product

import numpy as np

from ...numerics.polynomials import chebyshev

SAFETY = 1.5  # factor on the error, which is sampled at some pulses only
ELEMENTS = 1000  # elements at most at which errors are computed
BLOCK = 64  # elements per array operation: bounds the memory
FLAT = 1e-9  # fraction of an array's extent below which it counts as a line, or a plane

Response = Callable[[np.ndarray], np.ndarray]  # at positions, m (n, 3): complex (n, k), see _response_samples.py


@dataclass(frozen=True, eq=False)
class Positions:
    """Positions in an array, m (m, 3), and the interpolation from them to its n elements.

    basis  Lagrange's polynomials at the elements (n, m); None: the positions are the elements
    error  largest interpolation error, relative
    """

    at: np.ndarray
    basis: np.ndarray | None = None
    error: float = 0.0

    @property
    def growth(self) -> float:
        """Largest factor by which errors at the positions grow at an element: the Lebesgue constant."""
        return 1.0 if self.basis is None else float(np.abs(self.basis).sum(axis=1).max())

    def __len__(self) -> int:
        return len(self.at)


def choose_positions(
    elements: np.ndarray, response: Response, allowed: float, most: float = np.inf, least: int = 1
) -> Positions:
    """The fewest positions from which elements, m (n, 3), are interpolated with an error of at most `allowed`.

    Where that takes more than `most` positions, these are the elements themselves.
    least  positions along each axis in which the array extends
    """
    best = Positions(elements)
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
        positions = grid.fewest(elements, allowed, min(most + 1, len(best)), least)
        if positions is not None:
            best = positions
    return best


class _Grid:
    """Chebyshev nodes on a grid along axes (3, 3) about a centre, for elements at `along` (n, 3), within +-half."""

    def __init__(
        self, along: np.ndarray, half: np.ndarray, centre: np.ndarray, axes: np.ndarray, response: Response
    ) -> None:
        self.along, self.half, self.centre, self.axes, self.response = along, half, centre, axes, response

    def fewest(self, elements: np.ndarray, allowed: float, fewer_than: float, least: int) -> Positions | None:
        """The fewest positions that keep the error, or None where that takes `fewer_than` or more."""
        extended = np.flatnonzero(self.half)
        counts, sample = [1, 1, 1], _sampled(self.along)
        for axis in extended.tolist():  # each axis by itself

            def suffices(count: int, axis: int = axis) -> bool:
                alone = [count if i == axis else 1 for i in range(3)]
                line = np.zeros((max(32, 4 * count), 3))
                line[:, axis] = np.linspace(-self.half[axis], self.half[axis], len(line))
                return self._error(alone, line, self.centre + line @ self.axes) <= allowed / (2 * len(extended))

            few, counts[axis] = least - 1, least
            while not suffices(counts[axis]):
                few, counts[axis] = counts[axis], 2 * counts[axis]
                if few >= fewer_than - 1:
                    return None
            while counts[axis] - few > 1:
                middle = (few + counts[axis]) // 2
                few, counts[axis] = (few, middle) if suffices(middle) else (middle, counts[axis])
        while int(np.prod(counts)) < fewer_than:
            error = self._error(counts, self.along[sample], elements[sample])
            if error <= allowed:
                at, basis = self.made(counts, self.along)
                return Positions(self.centre + at @ self.axes, basis, error)
            for axis in extended.tolist():
                counts[axis] += 1
        return None

    def _error(self, counts: list[int], along: np.ndarray, elements: np.ndarray) -> float:
        """Largest interpolation error at elements, m (n, 3), that lie at `along` (n, 3)."""
        at, basis = self.made(counts, along)
        at_nodes = self.response(self.centre + at @ self.axes)
        worst = 0.0
        for a in range(0, len(along), BLOCK):
            exact = self.response(elements[a : a + BLOCK])
            worst = max(worst, float(np.abs(exact - basis[a : a + BLOCK] @ at_nodes).max()))
        return SAFETY * worst

    def made(self, counts: list[int], along: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Positions (m, 3) along the axes, and their Lagrange polynomials at `along` (n, 3): (n, m)."""
        nodes, parts = [], []
        for i, n in enumerate(counts):
            angle, order = np.pi * (np.arange(n) + 0.5) / n, np.arange(n)
            nodes.append(chebyshev(0, 2 * self.half[i], n))
            flat = np.full(len(along), np.pi / 2)
            where = np.arccos(np.clip(along[:, i] / self.half[i], -1, 1)) if self.half[i] else flat
            terms = np.cos(np.outer(where, order)) * np.where(order == 0, 1, 2) / n  # Chebyshev's polynomials
            parts.append(terms @ np.cos(np.outer(order, angle)))
        basis = np.einsum("na,nb,nc->nabc", *parts).reshape(len(along), -1)
        return np.array(list(product(*nodes))), basis


def _sampled(along: np.ndarray) -> np.ndarray:
    """Indices of up to ELEMENTS elements, with the outermost along each axis among them."""
    if len(along) <= ELEMENTS:
        return np.arange(len(along))
    ends = [i for axis in range(3) for i in (along[:, axis].argmin(), along[:, axis].argmax())]
    drawn = np.random.default_rng(0).choice(len(along), ELEMENTS - len(ends), replace=False)
    return np.unique(np.concatenate([ends, drawn]))
