"""The share of each facet that both antennas see, along a track: back faces, occlusion by facets.

Shares are kept as levels, uint8: roots of shares, 255 of a whole facet. These are the amplitudes of rough facets, and
what is interpolated between pulses.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from ..base import arguments
from ..base.constants import EDGE_ON
from ..base.errors import warn
from ..base.validation import array, flags, ndim, number, sealed
from ..opencl.choose_device import open_device
from ..opencl.device import Device, DeviceChoice
from ..opencl.memory_budget import budget
from ..scene.triangles import areas
from ._aspect_blocks import STRIDE, blocks_around, projected_width, pulse_blocks, shadow_length
from ._facet_samples import MOST_LINES
from ._frame import box_of
from ._illumination_solver import IlluminationSolver, Occlusion
from ._levels_along_track import SAMPLING, Course, Judge, Looks, look_along
from ._lit_shares import facet_shares as facet_shares
from ._lit_shares import pixel_shares as pixel_shares
from ._viewpoints import drawn_of

# Looks that are taken in any case: shadows move by two COARSE widths of a facet at most from one to the next, so that
# none crosses a facet unseen. Up to COARSEST times fewer where they were more looks at a facet than MUCH
COARSE, COARSEST, MUCH = 1.0, 32, 1e6

log = logging.getLogger(__name__)

ALL_DARK = (
    "the whole scene is in shadow: no facet faces the antennas with nothing in between; check the side the track is "
    "on, the winding of the mesh, and heights; or pass shadows=False"
)


@dataclass(frozen=True, eq=False)
class Span:
    """Pulses first ... stop - 1, and levels, uint8 (k,), at pulse `first` and at pulse `stop`.

    The levels change linearly in between; where they are constant, `later` is `level` itself.
    """

    first: int
    stop: int
    level: np.ndarray
    later: np.ndarray

    def moments(self, pulses: np.ndarray) -> np.ndarray:
        """Position of pulses (n,) between first, 0, and stop, 1; 0 where the levels are constant."""
        if self.later is self.level:
            return np.zeros(len(pulses), np.float32)
        return ((pulses - self.first) / np.float32(self.stop - self.first)).astype(np.float32)

    def within(self, first: int, stop: int) -> Span | None:
        """The part of the span that lies in pulses first ... stop - 1, counted from `first`; None for no pulse."""
        begin, end = max(self.first, first), min(self.stop, stop)
        if begin >= end:
            return None
        levels = [self.level, self.later]
        if self.later is not self.level and (begin, end) != (self.first, self.stop):
            change = self.later - self.level.astype(np.float32)
            moments = self.moments(np.array([begin, end])).tolist()
            levels = [np.rint(self.level + np.float32(moment) * change).astype(np.uint8) for moment in moments]
        return Span(begin - first, end - first, *levels)


def shares_of(level: np.ndarray) -> np.ndarray:
    """Shares, uint8, of levels, uint8: 255 of a whole facet."""
    return np.rint(np.square(level, dtype=np.float32) / 255).astype(np.uint8)


@dataclass(frozen=True, eq=False)
class Illumination:
    """Shares of k facets that both antennas see, computed at the viewpoints: one pulse for each block of pulses.

    blocks      first and last + 1 of the pulses nearest each viewpoint, int64 (n_blocks, 2)
    viewpoints  pulse at which the shares of each block were computed (n_blocks,)
    dark        (k,) bool: facets of which nothing is illuminated at any viewpoint
    full        (k,) bool: facets that are wholly illuminated at every viewpoint
    changing    (k,) bool: facets whose shares are not the same at every viewpoint
    dark_facets  number of facets of which nothing is illuminated, per block (n_blocks,)
    window      (first, stop): pulses that `spans` and `fraction_at` count from `first`; all other members are of the
                whole track
    sampling    estimated error of the amplitudes, roots of the shares, relative to their norm: shares from samples
    motion      the same of levels between viewpoints
    reached     accuracy that can be asked for, where the error is larger than what was

    >>> box = sarcl.shapes.box((4, 2, 3))
    >>> light = sarcl.illumination.lit(box.triangles, track.positions, two_sided=False)
    >>> light.fraction_at(20).shape, light.blocks.shape == (len(light.viewpoints), 2)
    ((12,), True)
    >>> float(light.fraction(0).max())  # share of each facet that is lit at the first viewpoints
    1.0
    """

    blocks: np.ndarray
    viewpoints: np.ndarray
    dark: np.ndarray
    full: np.ndarray
    changing: np.ndarray
    dark_facets: np.ndarray
    window: tuple[int, int]
    sampling: float
    motion: float
    reached: float
    _usual: np.ndarray = field(repr=False)
    _changes: list[tuple[np.ndarray, np.ndarray]] = field(repr=False)
    _look: Callable[[int], np.ndarray] = field(repr=False)

    @classmethod
    def of_nothing(cls, n_pulses: int) -> Illumination:
        """The illumination of no facets."""
        level, no_facet, pulse = np.zeros(0, np.uint8), np.zeros(0, bool), np.zeros(1, np.int64)
        return cls(
            blocks=np.array([[0, n_pulses]]),
            viewpoints=pulse,
            dark=no_facet,
            full=no_facet,
            changing=no_facet,
            dark_facets=pulse,
            window=(0, n_pulses),
            sampling=0.0,
            motion=0.0,
            reached=0.0,
            _usual=level,
            _changes=[],
            _look=lambda block: level,
        )

    def __len__(self) -> int:
        return len(self.blocks)

    @property
    def error(self) -> float:
        """Both estimated errors of the amplitudes together, relative to their norm."""
        return float(np.hypot(self.sampling, self.motion))

    def level(self, block: int) -> np.ndarray:
        """Roots of illuminated shares in a block, uint8 (k,). Stored, or computed anew (max_bytes)."""
        arguments.checked_index("block", "the blocks", block, (len(self),))
        if not isinstance(block, (int, np.integer)):
            raise IndexError(f"block is {block!r:.60}; give a whole number from {-len(self)} to {len(self) - 1}")
        block %= len(self)
        if block >= len(self._changes):
            return self._look(block)
        out = self._usual.copy()
        index, value = self._changes[block]
        out[index] = value
        return out

    def share(self, block: int) -> np.ndarray:
        """Illuminated shares in a block, uint8 (k,): 255 is a whole facet."""
        return shares_of(self.level(block))

    def fraction(self, block: int) -> np.ndarray:
        """Illuminated shares in a block, float32 (k,), 0 to 1."""
        return np.asarray((self.level(block) / np.float32(255)) ** 2)

    def fraction_at(self, pulse: int) -> np.ndarray:
        """Illuminated shares at a pulse of the window, float32 (k,), 0 to 1: their roots interpolated between
        viewpoints."""
        level, later, part = self.levels_around(pulse)
        before, after = level / np.float32(255), later / np.float32(255)
        return np.asarray((before + part * (after - before)) ** 2)

    def levels_around(self, pulse: int) -> tuple[np.ndarray, np.ndarray, np.float32]:
        """Levels, uint8 (k,), at the viewpoints before and after a pulse of the window, and where between these the
        pulse lies, 0 to 1."""
        pulse += self.window[0]
        after = int(np.searchsorted(self.viewpoints, pulse, side="right"))
        one, two = max(after - 1, 0), min(after, len(self) - 1)
        before, behind = int(self.viewpoints[one]), int(self.viewpoints[two])
        part = np.float32((pulse - before) / (behind - before)) if behind > before and pulse > before else np.float32(0)
        return self.level(one), self.level(two), part

    def spans(self, weigh: Callable[[np.ndarray], np.ndarray] = lambda level: level) -> Iterator[Span]:
        """The window in spans, from viewpoint to viewpoint, in each of which weigh(levels), uint8, changes linearly."""
        weighed: tuple[np.ndarray, np.ndarray] | None = None  # levels, and what they weigh
        for span in self._spans():
            level = weighed[1] if weighed and weighed[0] is span.level else weigh(span.level)
            later = level if span.later is span.level else weigh(span.later)
            weighed = span.later, later
            part = Span(span.first, span.stop, level, later).within(*self.window)
            if part is not None:
                yield part

    def _spans(self) -> Iterator[Span]:
        n, constant, start = int(self.blocks[-1, 1]), self.level(0), 0
        pulses = self.viewpoints.tolist()
        for i in range(1, len(self)):
            level = self.level(i)
            if not np.array_equal(level, constant):
                if start < pulses[i - 1]:
                    yield Span(start, pulses[i - 1], constant, constant)
                yield Span(pulses[i - 1], pulses[i], constant, level)
                constant, start = level, pulses[i]
        yield Span(start, n, constant, constant)

    def among(self, index: np.ndarray, k: int) -> Illumination:
        """The illumination of k facets, of which these are those of an index (n,) and all others are seen whole."""

        def filled(values: np.ndarray, other: int) -> np.ndarray:
            out = np.full(k, other, values.dtype)
            out[index] = values
            return out

        return replace(
            self,
            dark=sealed(filled(self.dark, False)),
            full=sealed(filled(self.full, True)),
            changing=sealed(filled(self.changing, False)),
            _usual=sealed(filled(self._usual, 255)),
            _changes=[(index[some], level) for some, level in self._changes],
            _look=lambda block: filled(self._look(block), 255),
        )

    def between(self, first: int, stop: int) -> Illumination:
        """The illumination of pulses first ... stop - 1 of the window alone."""
        return replace(self, window=(self.window[0] + first, self.window[0] + stop))


Lighting = Illumination  # a public name


@dataclass(frozen=True, eq=False)
class IlluminationTask:
    """Facets, m (k, 3, 3), whose shares are asked for, and how accurate these must be; see `lit`.

    ends        one antenna, or two, m (n_pulses, 3) each;  two_sided  (k,) bool
    occlusions  what occludes, from both sides, and which facets it may hide
    power       of the facets (k,), 0 or more: weights of the squares of errors;  beside  power, in the same unit, of
                other facets that every pulse sees whole: the norm is of these too
    """

    triangles: np.ndarray
    ends: list[np.ndarray]
    two_sided: np.ndarray
    occlusions: Sequence[Occlusion]
    power: np.ndarray
    beside: float
    tolerance: float
    accuracy: float
    max_bytes: float

    @cached_property
    def _bounds(self) -> np.ndarray:
        return box_of(self.triangles, *(part.occluders for part in self.occlusions))

    @cached_property
    def _widths(self) -> list[float]:
        lengths = [max(shadow_length(self._bounds, end), 1e-300) for end in self.ends]
        return [projected_width(self.triangles, e[len(e) // 2]) / n for e, n in zip(self.ends, lengths, strict=True)]

    def blocks(self, part: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Blocks of pulses in which shadows move by a part of a facet's width, as of `pulse_blocks`."""
        return pulse_blocks(self.ends, self._bounds, [part * width for width in self._widths])


def lit(
    triangles: np.ndarray,
    tx: np.ndarray,
    rx: np.ndarray | None = None,
    *,
    two_sided: np.ndarray | bool = True,
    tolerance: float = 0.25,
    accuracy: float = 0.02,
    max_bytes: float | None = None,
    device: DeviceChoice | None = None,
) -> Illumination:
    """Shares of facets that both antennas see past one another, in blocks of pulses.

    triangles   corners of the facets, m (k, 3, 3)
    tx, rx      positions of the antennas, m (n_pulses, 3), rx by default those of tx;  device  see `sarcl.devices`
    two_sided   (k,) bool or one for all: the other facets are not illuminated where they face away from an antenna
    tolerance   largest change of a share between the pulses of a block, for the facet of median size: shares are
                computed at one pulse of a block at most; blocks become shorter where the accuracy asks for it
    accuracy    error of the amplitudes, roots of the shares, relative to their norm, weighted by area: more samples and
                pulses are taken until it is met, or there are no more; `error` says what was met. See
                docs/theory/shadows.md
    max_bytes   memory for the shares, default a quarter of that for blocks of `echo`; shares beyond it are computed
                anew each time they are asked for

    Warns with SarclWarning where nothing at all is illuminated.

    >>> box = sarcl.shapes.box((4, 2, 3))
    >>> lighting = sarcl.illumination.lit(box.triangles, track.positions, two_sided=False)
    >>> lighting.error < 0.02
    True
    """
    tx = array("tx", tx, np.float64, ("n_pulses", 3))
    ends = [tx] if rx is None else [tx, array("rx", rx, np.float64, (len(tx), 3))]
    if not isinstance(triangles, np.ndarray) or triangles.dtype != np.float64 or triangles.shape[1:] != (3, 3):
        triangles = array("triangles", triangles, np.float64, ("k", 3, 3))
    k = len(triangles)
    if max_bytes is not None:
        max_bytes = number("max_bytes", max_bytes, least=0)
    tolerance, accuracy = number("tolerance", tolerance, above=0), number("accuracy", accuracy, above=0)
    sides, every, opened = _mask("two_sided", two_sided, k), np.ones(k, bool), open_device(device)
    if max_bytes is None:
        max_bytes = budget(opened, None) / 4
    if k == 0:
        return Illumination.of_nothing(len(tx))
    power = np.asarray(areas(triangles), np.float64)
    task = IlluminationTask(
        triangles, ends, sides, (Occlusion(triangles, every),), power, 0.0, tolerance, accuracy, max_bytes
    )
    return illuminated(task, opened)


def illuminated(
    task: IlluminationTask, device: Device, progress: Callable[[int, int], object] | None = None
) -> Illumination:
    """Shares of the facets of a task; progress is called as progress(pulse, pulses), of those that are looked from."""
    k, n_pulses = len(task.triangles), len(task.ends[0])
    solver = IlluminationSolver(device, task.triangles, two_sided=task.two_sided, occlusions=task.occlusions)
    course, viewpoints, errors = _within(task, solver, progress)
    blocks = blocks_around(viewpoints, n_pulses)
    if not course.ever.any() and not task.beside:
        warn(ALL_DARK)
    log.info(
        "%d pulses in %d blocks; %d of %d facets never illuminated", n_pulses, len(blocks), k - course.ever.sum(), k
    )
    return Illumination(
        sealed(blocks), sealed(viewpoints), sealed(~course.ever), sealed(course.always), sealed(course.changing),
        sealed(k - np.array(course.seen, np.int64)), (0, n_pulses), *errors,
        sealed(course.usual), course.changes, lambda block: course.looks.again(course.chosen[block]),
    )  # fmt: skip


def _within(
    task: IlluminationTask, solver: IlluminationSolver, progress: Callable[[int, int], object] | None
) -> tuple[Course, np.ndarray, tuple[float, float, float]]:
    """Looks with an error of at most the task's accuracy, or as many as there are; their pulses (n,); and errors: of
    sampling, of motion, and the accuracy that could have been asked for."""
    power, beside, accuracy = task.power, task.beside, task.accuracy
    judge, lines, finer, ends = Judge(power, beside), 0, 1.0, task.ends
    n_pulses = len(ends[0])
    _, coarse, _ = task.blocks(COARSE)
    thinned = float(np.clip(len(coarse) * len(power) / MUCH, 1, COARSEST))
    while True:
        _, offered, turns = task.blocks(finer * task.tolerance)
        # angle by which facets may turn towards an antenna before the next viewpoint; and those that are edge-on to one
        # of two antennas send back a part of their echo (sarcl/scattering/physical_optics.py:lit_share)
        edge_on = 0.0 if len(ends) == 1 else 2 * EDGE_ON
        slack = edge_on + 2 * np.convolve(turns, np.ones(2 * STRIDE + 1))[STRIDE : STRIDE + len(turns)]
        first = np.unique(np.searchsorted(offered, coarse, side="right") - 1)
        if thinned > 1:
            n = int(np.ceil(max(len(coarse) / thinned, len(offered) / STRIDE)))
            first = first[np.unique(np.linspace(0, len(first) - 1, n + 1).round().astype(int))][1:-1]
        looks = Looks(solver, [end[offered] for end in ends], slack)
        if not lines:  # a look at some facets tells how many lines all of them need
            drawn = drawn_of(np.ones(len(power), bool))
            lines = judge.lines(looks.whole(len(offered) // 2, drawn), SAMPLING * accuracy)
        solver.take_lines(lines)
        judge = Judge(power, beside)
        course = look_along(looks, offered, first, judge, accuracy, task.max_bytes, progress)
        viewpoints = offered[course.chosen]
        sampling, motion = judge.sampling, judge.motion(viewpoints, course.left)
        # each part has its share of the accuracy
        few_looks = motion > np.sqrt(1 - SAMPLING**2) * accuracy and len(offered) < n_pulses
        few_lines = sampling > SAMPLING * accuracy and lines < MOST_LINES
        if np.hypot(sampling, motion) <= accuracy or not (few_looks or few_lines):
            reached = max(sampling / SAMPLING, motion / np.sqrt(1 - SAMPLING**2))
            return course, viewpoints, (sampling, motion, float(reached))
        if few_looks:
            finer /= 4
        else:
            lines *= 4


def _mask(name: str, value: np.ndarray | bool, k: int) -> np.ndarray:
    """A bool for each of k facets (k,), read-only, from one or one for all."""
    if ndim(name, value) and np.shape(value) != (k,):
        raise ValueError(f"{name} has shape {np.shape(value)}; wanted one for each of {k} facets, ({k},)")
    if getattr(value, "dtype", None) != np.bool_:
        flags(name, value)
    return np.broadcast_to(np.asarray(value, np.bool_), (k,))
