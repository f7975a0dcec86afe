"""Levels, roots of shares, at as many pulses of a track as an accuracy asks for, and what their errors are."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from ._facet_samples import FEWEST_LINES
from ._illumination_solver import IlluminationSolver, Look
from ._viewpoints import PartialLook, between_levels, is_partly, refine_viewpoints

SAMPLING = 0.375  # of the error of amplitudes: share of counting samples, beside that of looks at some pulses alone
# Of the square of the accuracy: what both errors may take while those of samples are not known of all pulses, and the
# least that is left to looks at some pulses alone
MARGIN, LEAST = 0.95, 0.1
RECENT = 2 * 7 + 2  # levels that are kept where they do not all fit: of the looks between which one lies, and theirs
ROUNDED = 1 / (12 * 255**2)  # mean square of the rounding of levels to 1/255


@dataclass(eq=False)
class Course:
    """Levels along a track: indices of viewpoints among those offered, the mean square of differences up to each, the
    number of facets that each sees, levels at the first and changes from these, and facets (k,) bool: ever seen, always
    seen whole, and those whose levels change."""

    looks: Looks
    chosen: list[int]
    left: list[float]
    seen: list[int]
    usual: np.ndarray
    changes: list[tuple[np.ndarray, np.ndarray]]
    ever: np.ndarray
    always: np.ndarray
    changing: np.ndarray


def look_along(
    looks: Looks, offered: np.ndarray, first: np.ndarray, judge: Judge, accuracy: float, max_bytes: float,
    progress: Callable[[int, int], object] | None,
) -> Course:  # fmt: skip
    """Levels at as many of the pulses offered (n,) as an accuracy asks for, at those of indices `first` in any case.

    Changes of levels are kept up to `max_bytes`.
    """
    k, kept = looks.solver.facets.size, 0
    course = Course(
        looks, [], [], [], np.zeros(k, np.uint8), [], np.zeros(k, bool), np.ones(k, bool), np.zeros(k, bool)
    )

    def look(place: int, partial: PartialLook | None) -> np.ndarray:
        seen = looks.at(place, partial)
        judge.note(seen, partial)
        return seen.levels

    def limit() -> float:
        return max(MARGIN * accuracy**2 - judge.sampling**2, LEAST * accuracy**2)

    for place, levels, left in refine_viewpoints(look, offered, first, judge.squares, limit):
        if not course.chosen:
            course.usual = levels
        if kept <= max_bytes and len(course.changes) == len(course.chosen):
            index = np.flatnonzero(levels != course.usual).astype(np.int32)
            kept += 5 * len(index)
            if kept <= max_bytes:
                course.changes.append((index, levels[index]))
        course.chosen.append(place)
        course.left.append(left)
        course.seen.append(int(np.count_nonzero(levels)))
        course.ever |= levels > 0
        course.always &= levels == 255
        course.changing |= levels != course.usual
        if progress:
            progress(int(offered[place]) + 1, int(offered[-1]) + 1)
    return course


class Looks:
    """What antennas at some places, m (n, 3) each, see; slack  rad (n,), of facets that face away."""

    def __init__(self, solver: IlluminationSolver, ends: list[np.ndarray], slack: np.ndarray) -> None:
        self.solver, self.ends, self.slack = solver, ends, slack
        self._partial_looks: dict[int, tuple[int, int, float, np.ndarray]] = {}
        self._recent: dict[int, np.ndarray] = {}

    def whole(self, place: int, some: np.ndarray | None = None) -> Look:
        """A look at facets `some` (k,) bool; None: at all."""
        return self.solver.look([end[place] for end in self.ends], float(self.slack[place]), some)

    def at(self, place: int, partial: PartialLook | None) -> Look:
        """A look; at some facets alone where it has a partial."""
        if partial is None:
            self._partial_looks.pop(place, None)
            return self.whole(place)
        looked = np.packbits(partial.facets | partial.known)
        self._partial_looks[place] = partial.before, partial.after, partial.part, looked
        seen = self.whole(place, partial.facets)
        return replace(seen, levels=np.where(partial.facets, seen.levels, partial.levels))

    def again(self, place: int) -> np.ndarray:
        """The levels of a look that was taken."""
        if place in self._recent:
            return self._recent[place]
        if place in self._partial_looks:
            before, after, part, packed = self._partial_looks[place]
            some = np.unpackbits(packed, count=self.solver.facets.size).astype(bool)
            even = between_levels(self.again(before), self.again(after), part)
            levels = np.where(some, self.whole(place, some).levels, even)
        else:
            levels = self.whole(place).levels
        while len(self._recent) >= RECENT:
            self._recent.pop(next(iter(self._recent)))
        self._recent[place] = levels
        return levels


class Judge:
    """Squares of errors of levels, with weights (k,), relative to the weighed sum of their squares: means of looks.

    beside  what others add to that sum, which are always seen whole
    """

    def __init__(self, weights: np.ndarray, beside: float) -> None:
        self.weights, self._beside, self._rate = weights, beside, 0.0
        self._power = weights.astype(np.float32)
        self._sampling: list[float] = []
        self._whole: list[float] = []

    @property
    def norm(self) -> float:
        """The weighed sum of the squares of levels, the mean of the looks that were noted."""
        return float(np.mean(self._whole))

    @property
    def sampling(self) -> float:
        """Relative error of counting samples in the looks that were noted."""
        return float(np.sqrt(np.mean(self._sampling) / self.norm)) if self.norm else 0.0

    def lines(self, look: Look, limit: float) -> int:
        """Lines of samples with which errors stay below a limit: those of straight edges fall as lines become more."""
        self.note(look, None)
        error = self.sampling
        return FEWEST_LINES * 2 ** int(np.clip(np.ceil(np.log2(max(error / limit, 1e-9))), 0, 8))

    def note(self, look: Look, partial: PartialLook | None) -> None:
        """Note the norm of a look, and its sampling error: of facets that were left out as in the last whole look."""
        self._whole.append(float(self._power @ np.square(look.levels, dtype=np.float32)) / 255**2 + self._beside)
        partly = float(self.weights[look.partly].sum())
        off = look.spread(self.weights) + ROUNDED * partly
        if partial is None or not self._rate:
            self._rate = off / partly if partly else self._rate
        if partial is not None:
            off += self._rate * max(float(self._power[is_partly(look.levels)].sum(dtype=np.float64)) - partly, 0.0)
        self._sampling.append(off)

    def squares(
        self, halfway: np.ndarray, first: np.ndarray, last: np.ndarray, part: float, some: np.ndarray
    ) -> np.ndarray:
        """As `refine_viewpoints` asks for them."""
        a, b, c = (levels[some].astype(np.float64) / 255 for levels in (halfway, first, last))
        off = self.weights[some] * (a - b * (1 - part) - c * part) ** 2
        return np.asarray(off / self.norm if self.norm else off)

    def motion(self, viewpoints: np.ndarray, left: list[float]) -> float:
        """Root of the mean square over the track of the differences `left` up to each viewpoint."""
        steps = np.diff(viewpoints, prepend=viewpoints[0])
        return float(np.sqrt(float(steps @ left) / max(float(steps.sum()), 1.0)))
