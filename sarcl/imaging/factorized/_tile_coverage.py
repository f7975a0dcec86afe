"""Coverage of the roots, the largest tiles of the factorised method, by rows: whole, in part, or not at all."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from ...numerics.pulse_geometry import PulseGeometry
from ..tiling.tiling import Roots

MORE = 1.5  # rows added directly to a root, relative to those it needs: neighbouring roots share range profiles


@dataclass(frozen=True, eq=False)
class TileCoverage:
    """Rows by what becomes of them at each root (the largest tiles).

    merged    (n roots,) bool: roots into which rows are merged
    left_out  for each root: the rows that are not merged, bool (n_rows,), or None where all are
    directly  (roots, rows): rows that are added to these roots by the direct method instead, indices; rows None: all
    missed    (2, n roots): rows that add nothing to a root, outside their range window, and outside their beam
    """

    merged: np.ndarray
    left_out: list[np.ndarray | None]
    directly: list[tuple[np.ndarray, np.ndarray | None]]
    missed: np.ndarray

    def of(self, roots: np.ndarray) -> TileCoverage:
        """The coverage of these roots: the same rows are added directly, whichever neighbours are made with them."""
        place = np.full(len(self.merged), -1)
        place[roots] = np.arange(len(roots))
        directly = [(places[places >= 0], rows) for places, rows in ((place[r], rows) for r, rows in self.directly)]
        directly = [(places, rows) for places, rows in directly if len(places)]
        left_out = [self.left_out[i] for i in roots]
        return TileCoverage(self.merged[roots], left_out, directly, self.missed[:, roots])


def coverage_of(a: PulseGeometry, roots: Roots, center: np.ndarray, radius: float, least: float) -> TileCoverage:
    """Coverage by rows of roots of `radius` m about the scene's centre, m (3,).

    A row whose range window and beam contain every point of a root can be merged. One whose window or beam contains
    none adds nothing. The others are added directly. Where fewer than `least` rows can be merged, all are added
    directly.
    """
    n = len(roots.centers)
    merged = np.ones(n, bool)
    left_out: list[np.ndarray | None] = [None] * n
    missed = np.zeros((2, n), np.int64)
    if a.wrap and a.beam is None:
        return TileCoverage(merged, left_out, [], missed)
    reach = radius * (1 + 1e-6)
    partly: dict[int, np.ndarray] = {}
    reasons: dict[int, np.ndarray] = {}
    all_rows = []
    for i, place in enumerate(roots.centers + center):
        depth = a.depth(place)
        outside, is_inside = depth < -reach, depth >= reach
        outside_beam = np.zeros_like(outside)
        if a.beam is not None:
            depth = a.beam_depth(place)
            outside_beam = ~outside & (depth < -reach)
            is_inside &= depth >= reach
        if is_inside.all():
            continue
        is_partly_inside = ~(is_inside | outside | outside_beam)
        if is_partly_inside.any() and is_inside.sum() < least:
            merged[i] = False
            all_rows.append(i)
            continue
        merged[i], left_out[i], reasons[i] = is_inside.any(), ~is_inside, np.stack([outside, outside_beam])
        if is_partly_inside.any():
            partly[i] = is_partly_inside
    directly: list[tuple[np.ndarray, np.ndarray | None]] = []
    if all_rows:
        directly.append((np.array(all_rows), None))
    for some_roots, rows in _shared(partly, roots.line):
        directly.append((np.array(some_roots), np.flatnonzero(rows)))
        for i in some_roots:
            left_out[i] = left_out[i] | rows
            reasons[i] = reasons[i] & ~rows
    for i, why in reasons.items():
        missed[:, i] = why.sum(axis=1)
    return TileCoverage(merged, left_out, directly, missed)


def _shared(partly: dict[int, np.ndarray], line: np.ndarray) -> Iterator[tuple[list[int], np.ndarray]]:
    """Runs of neighbouring roots, and the rows that any of them needs: at most MORE times the rows that each needs."""
    roots: list[int] = []
    rows, fewest = np.zeros(0, bool), 0
    for i, some in partly.items():
        both = rows | some if roots else some
        least = min(fewest, int(some.sum())) if roots else int(some.sum())
        if roots and (line[i] != line[roots[-1]] or i != roots[-1] + 1 or both.sum() > MORE * least):
            yield roots, rows
            roots, both, least = [], some, int(some.sum())
        roots.append(i)
        rows, fewest = both, least
    if roots:
        yield roots, rows


def same_coverage(
    rows: list[np.ndarray | None], low: int, high: int, most: int
) -> Iterator[tuple[int, int, np.ndarray | None]]:
    """Roots low ... high - 1 in runs of up to `most` that leave out the same rows: (first, how many, these rows)."""
    first = low
    while first < high:
        last, those = first + 1, rows[first]
        while last < min(first + most, high) and _same(rows[last], those):
            last += 1
        yield first, last - first, those
        first = last


def _same(a: np.ndarray | None, b: np.ndarray | None) -> bool:
    return a is b if a is None or b is None else bool((a == b).all())


def without(cut: np.ndarray, left_out: np.ndarray) -> np.ndarray:
    """Blocks (n, 4) as of merge_subapertures.cl's `blocks`, cut so that none has a row of `left_out` (n_rows of
    the blocks,)."""
    edges = np.flatnonzero(np.diff(np.concatenate([[True], left_out, [True]])))
    begins, ends = edges[::2], edges[1::2]  # runs of rows that are not left out
    parts = [cut[:0]]
    for first, count, kept, row in cut:
        begin, end = np.maximum(begins, first), np.minimum(ends, first + count)
        has_rows = end > begin
        begin, end = begin[has_rows], end[has_rows]
        parts.append(np.stack([begin, end - begin, np.full(len(begin), kept), row + begin - first], axis=1))
    return np.concatenate(parts)
