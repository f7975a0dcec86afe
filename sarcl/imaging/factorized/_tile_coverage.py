"""Which rows see which of the factorised method's largest tiles: whole, in part, or not at all."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...numerics.pulse_geometry import PulseGeometry
from ..tiling import GridTiling
from ._tile_tree import Tree

MORE = 1.5  # as many rows as a tile needs, at most, are added to it directly so that neighbours share their profiles


@dataclass(frozen=True, eq=False)
class TileCoverage:
    """What becomes of the pairs of rows and largest tiles (tops).

    merged    (n tops,) bool: tops into which rows are merged
    left_out  by top: the rows that are not, bool (n_rows,), or None where all are
    directly  (tops, rows): rows that are added to these tops by the direct method instead, indices; rows None: all
    missed    (2, n leaves): rows that neither sees, outside their range window, and outside their beam
    """

    merged: np.ndarray
    left_out: list[np.ndarray | None]
    directly: list[tuple[np.ndarray, np.ndarray | None]]
    missed: np.ndarray


def coverage_of(
    a: PulseGeometry, tree: Tree, tiling: GridTiling, radius: float, line_of: np.ndarray, least: float
) -> TileCoverage:
    """How rows see tops of `radius` m.

    A row that sees every point of a top, in its range window and its beam, can be merged; one that sees none has no
    part in it; one that sees some is added directly. Below `least` rows that can be merged, all are added directly.

    line_of  (n tops,): tops next to one another share direct rows if this is the same; a matter of the tiling alone
    """
    n = len(tree.centers[0])
    merged = np.ones(n, bool)
    left_out: list[Any] = [None] * n
    missed = np.zeros((2, tree.leaves.n_tiles), np.int64)
    if a.wrap and a.beam is None:
        return TileCoverage(merged, left_out, [], missed)
    reach = radius * (1 + 1e-6)
    partly: dict[int, np.ndarray] = {}
    reasons: dict[int, np.ndarray] = {}
    whole_tops = []
    for i, center in enumerate(tree.centers[0] + tiling.center):
        depth = a.depth(center)
        outside, whole = depth < -reach, depth >= reach
        unlit = np.zeros_like(outside)
        if a.beam is not None:
            depth = a.beam_depth(center)
            unlit = ~outside & (depth < -reach)
            whole &= depth >= reach
        if whole.all():
            continue
        some = ~(whole | outside | unlit)
        if some.any() and whole.sum() < least:
            merged[i] = False
            whole_tops.append(i)
            continue
        merged[i], left_out[i], reasons[i] = whole.any(), ~whole, np.stack([outside, unlit])
        if some.any():
            partly[i] = some
    directly: list[tuple[np.ndarray, np.ndarray | None]] = []
    if whole_tops:
        directly.append((np.array(whole_tops), None))
    for tops, rows in _shared(partly, line_of):
        directly.append((np.array(tops), np.flatnonzero(rows)))
        for i in tops:
            left_out[i] = left_out[i] | rows
            reasons[i] = reasons[i] & ~rows
    for i, why in reasons.items():
        low, high = tree.leaves_of(i)
        missed[:, low:high] = why.sum(axis=1)[:, None]
    return TileCoverage(merged, left_out, directly, missed)


def _shared(partly: dict[int, np.ndarray], line_of: np.ndarray) -> Iterator[tuple[list[int], np.ndarray]]:
    """Runs of tops next to one another, and the rows that any of them needs: at most MORE times what each does."""
    tops: list[int] = []
    rows, fewest = np.zeros(0, bool), 0
    for i, some in partly.items():
        both = rows | some if tops else some
        least = min(fewest, int(some.sum())) if tops else int(some.sum())
        if tops and (line_of[i] != line_of[tops[-1]] or i != tops[-1] + 1 or both.sum() > MORE * least):
            yield tops, rows
            tops, both, least = [], some, int(some.sum())
        tops.append(i)
        rows, fewest = both, least
    if tops:
        yield tops, rows


def same_coverage(
    rows: list[np.ndarray | None], low: int, high: int, most: int
) -> Iterator[tuple[int, int, np.ndarray | None]]:
    """Tops low ... high - 1 in runs of up to `most` that leave out the same rows: (first, how many, these rows)."""
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
    for first, count, node, row in cut:
        begin, end = np.maximum(begins, first), np.minimum(ends, first + count)
        some = end > begin
        begin, end = begin[some], end[some]
        parts.append(np.stack([begin, end - begin, np.full(len(begin), node), row + begin - first], axis=1))
    return np.concatenate(parts)
