"""At which pulses shares are looked at: as many as an error of levels between them asks for, and of which facets."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from ._aspect_blocks import STRIDE

# Mean square of differences between two viewpoints over the square of that halfway: of parabolas, and the mean of
# levels that begin to change anywhere between
MEAN = 8 / 15
# Mean square of differences halfway in the halves of an interval, over that in the interval: 1/16 of parabolas, 1/8 of
# levels that begin to change, 1/2 of steps. The least that is taken is 1/4, of levels that begin as roots do; the most
# is for intervals that are no halves
LEAST_RATIO, MOST_RATIO = 0.25, 0.85
# Of the limit: what facets may differ by, from linear changes, once they are not looked at any more
LEFT_OUT = 0.5
MOST = 3.0  # limits that one interval may take up, where others left so much less
DRAWN, FEW = 8, 2**13  # one in so many facets is looked at to learn whether they may be left out, but not fewer


@dataclass(frozen=True, eq=False)
class PartialLook:
    """A look at some facets: levels of the others lie at `part`, 0 to 1, between those of viewpoints `before` and
    `after`.

    facets  (k,) bool: to be looked at;  levels  uint8 (k,) of the others
    known   (k,) bool: of the others, those that were looked at before, from the same viewpoint
    """

    before: int
    after: int
    part: float
    facets: np.ndarray
    levels: np.ndarray
    known: np.ndarray


LevelsAt = Callable[[int, PartialLook | None], np.ndarray]
SquaredDifferences = Callable[[np.ndarray, np.ndarray, np.ndarray, float, np.ndarray], np.ndarray]


def refine_viewpoints(
    look: LevelsAt, at: np.ndarray, first: np.ndarray, squares: SquaredDifferences, limit: Callable[[], float]
) -> Iterator[tuple[int, np.ndarray, float]]:
    """Viewpoints between which levels change linearly, as increasing indices into `at`, pulses (n,).

    first        indices of viewpoints that are taken in any case
    look(index, partial)  the levels, uint8 (k,), at a viewpoint; of some facets alone where it is a partial look
    squares(found, first, last, part, some)  of differences of the levels of facets `some` (n,) from what lies at `part`
                 between those of two viewpoints around it (n,)
    limit()      mean square of differences that is left, on the average of all pulses

    The first ones, every 128th from each of these on, and the last are taken. Between two of them, the one halfway is
    compared with linear interpolation: where more than the limit would be left, both halves are refined in the same
    way. Facets with the smallest differences are left out from there on: an eighth of them is looked at once more, in
    the halves' middles, and if these differ, all are. Yields the index, the levels, and the mean square of differences
    from the viewpoint before.
    """
    refined, start, levels = _Refinement(look, at, squares, limit), 0, look(0, None)
    yield start, levels, 0.0
    taken = np.unique(np.concatenate([[0], first, [len(at) - 1]]))
    strides = [np.arange(a, b, STRIDE) for a, b in pairwise(taken.tolist())]
    for place in np.concatenate([*strides, taken[-1:]])[1:].tolist():
        end = look(place, None)
        yield from refined.between(start, levels, place, end, _Selection(None, None, 0.0), 0.0, 0.0)
        start, levels = place, end


@dataclass(frozen=True, eq=False)
class _Selection:
    """Facets (k,) bool to be looked at, and those of which an eighth is; None: all, none.

    settled  mean square of the differences of those that were left out before
    """

    kept: np.ndarray | None
    doubtful: np.ndarray | None
    settled: float


@dataclass(eq=False)
class _Refinement:
    """`saved` is what was left below the limit so far, times pulses: later intervals may exceed the limit by it."""

    look: LevelsAt
    at: np.ndarray
    squares: SquaredDifferences
    limit: Callable[[], float]
    saved: float = 0.0

    def between(
        self, a: int, first: np.ndarray, b: int, last: np.ndarray, which: _Selection, left: float, above: float
    ) -> Iterator[tuple[int, np.ndarray, float]]:
        """Viewpoints after a, up to b, with levels `first` and `last`, between which `left` is left.

        above  mean square of differences halfway in the interval of which this is a half; 0: in none
        """
        at = self.at
        pulses = float(at[b] - at[a])
        if b - a < 2:
            left *= (pulses - 1) / pulses
            self.saved += (self.limit() - left) * pulses
            yield b, last, left
            return
        middle = (a + b) // 2
        part = float((at[middle] - at[a]) / (at[b] - at[a]))
        halfway, which = self._halfway(a, first, b, last, middle, part, which)
        moves = (halfway != first) | (halfway != last)
        some = np.flatnonzero(moves if which.kept is None else moves & which.kept)
        off = self.squares(halfway, first, last, part, some)
        found = float(off.sum()) + which.settled
        off *= MEAN * (np.clip(found / above, LEAST_RATIO, MOST_RATIO) if above else MOST_RATIO)
        left = float(off.sum()) + which.settled
        if left <= min(self.limit() + max(self.saved, 0.0) / pulses, MOST * self.limit()):
            self.saved += (self.limit() - left) * pulses
            yield middle, halfway, left
            yield b, last, left
            return
        if which.kept is None:
            moves |= is_partly(halfway)
            below = _Selection(moves, ~moves, 0.0)
        else:
            below = self._without_smallest(which.kept, which.settled, some, off)
        yield from self.between(a, first, middle, halfway, below, left, found)
        yield from self.between(middle, halfway, b, last, below, left, found)

    def _halfway(
        self, a: int, first: np.ndarray, b: int, last: np.ndarray, middle: int, part: float, which: _Selection
    ) -> tuple[np.ndarray, _Selection]:
        """The levels in the middle, and the facets that were looked at for them."""
        if which.kept is None or which.doubtful is None:
            return self.look(middle, None), which
        even = between_levels(first, last, part)
        drawn = drawn_of(which.doubtful)
        looked = which.kept | drawn
        found = self.look(middle, PartialLook(a, b, part, looked, even, np.zeros_like(looked)))
        some = np.flatnonzero(drawn)
        off = self.squares(found, first, last, part, some)
        times = float(np.count_nonzero(which.doubtful)) / max(len(some), 1)
        settled = which.settled + times * float(off.sum())
        if settled <= LEFT_OUT * self.limit():
            kept = which.kept.copy()
            kept[some[off > 0]] = True
            return found, _Selection(kept, None, settled)
        kept = which.kept | which.doubtful
        found = self.look(middle, PartialLook(a, b, part, kept & ~looked, found, looked))
        return found, _Selection(None if kept.all() else kept, None, which.settled)

    def _without_smallest(self, of: np.ndarray, settled: float, some: np.ndarray, off: np.ndarray) -> _Selection:
        """Of facets (k,) bool without those whose differences are the smallest: `off` of facets `some`, 0 of others."""
        room = (LEFT_OUT * self.limit() - settled) / 2
        order = np.argsort(off)
        kept = np.zeros(len(of), bool)
        kept[some[order[np.searchsorted(np.cumsum(off[order]), room, side="right") :]]] = True
        return _Selection(kept, of & ~kept, settled)


def between_levels(first: np.ndarray, last: np.ndarray, part: float) -> np.ndarray:
    """Levels, uint8 (k,), at `part`, 0 to 1, between two."""
    out = first.copy()
    some = np.flatnonzero(first != last)
    out[some] = np.rint(first[some] + np.float32(part) * (last[some].astype(np.float32) - first[some]))
    return out


def is_partly(levels: np.ndarray) -> np.ndarray:
    """Which levels, uint8 (k,), are those of facets that are neither dark, 0, nor seen whole, 255: bool (k,)."""
    return np.asarray(levels + np.uint8(1) > 1)


def drawn_of(facets: np.ndarray) -> np.ndarray:
    """One in DRAWN of facets (k,) bool, drawn by their numbers; all of them where they are few."""
    if np.count_nonzero(facets) < FEW:
        return facets
    number = np.arange(len(facets), dtype=np.uint32) * np.uint32(2654435761)  # Knuth: multiplicative hashing
    return np.asarray(facets & (number < 2**32 // DRAWN))
