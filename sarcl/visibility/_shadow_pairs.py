"""Pairs of a facet and an occluder whose shadow may fall on it, from any pulse of a block."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator

import numpy as np

from ..base.boxes import box, corners
from ..base.vectors import unit
from ..scene.triangles import distances

PAIRS_AT_ONCE = 2**20  # pairs tested per array operation: bounds the memory on the host
CLOSE = 0.5  # of the scene's diagonal: antennas nearer to its middle than this beyond the scene see it at wide angles
RIGHT = np.radians(89)
MOST_ENTRIES = 2**23  # entries of boxes in the cells of a grid: with more, cells are made larger


def candidate_pairs(
    receivers: np.ndarray,
    occluders: np.ndarray,
    viewpoint: np.ndarray,
    turn: float,
    reach: float,
    casts: Callable[..., np.ndarray],
) -> np.ndarray:
    """Pairs (n, 2) of indices of receivers and occluders that may meet on a line of sight, in the order of receivers.

    receivers, occluders  corners, m (k, 3, 3);  viewpoint  an antenna, m (3,)
    turn, reach  rad and m: directions of other antennas of the block differ from the viewpoint's by no more than this,
                 and they stand no farther from it
    casts        casts(pairs) -> bool (n,): which pairs are kept after an exact test

    Both are seen in perspective from the viewpoint, where boxes that overlap are found by a grid of cells. A shadow
    that falls a distance s behind its occluder moves by at most s turn across the line of sight from pulse to pulse.
    Near the scene, or in it, boxes are those of cones of directions, which other antennas see turned by up to
    asin(reach/distance).
    """
    if not len(receivers) or not len(occluders):
        return np.zeros((0, 2), np.int64)
    bounds = box(np.concatenate([receivers.reshape(-1, 3), occluders.reshape(-1, 3)]))
    diagonal = float(np.linalg.norm(bounds[1] - bounds[0]))
    axis = unit(bounds.mean(axis=0) - viewpoint) if np.any(bounds.mean(axis=0) != viewpoint) else np.zeros(3)
    nearest = float(((corners(bounds) - viewpoint) @ axis).min())
    if nearest < CLOSE * diagonal:
        seen, shading = (_cones(part, viewpoint, reach) for part in (receivers, occluders))
        shading, index = _around(shading, seen[0][:, 1].min(), seen[1][:, 1].max())
        pairs = (np.stack([pair[:, 0], index[pair[:, 1]]], axis=1) for pair in _overlapping(seen, shading))
        return np.unique(_joined(pairs, casts), axis=0)
    sideways = np.linalg.svd(axis[None])[2][1:]
    seen, shading = (_seen(part, viewpoint, axis, sideways) for part in (receivers, occluders))
    widest = max(float(np.abs(side).max()) for boxes in (seen, shading) for side in boxes)
    margin = turn * diagonal / nearest * (1 + widest**2) + 1e-9 * diagonal / nearest
    return _joined(_overlapping((seen[0] - margin, seen[1] + margin), shading), casts)


def _cones(triangles: np.ndarray, viewpoint: np.ndarray, reach: float) -> tuple[np.ndarray, np.ndarray]:
    """Least and largest z, and azimuth, of directions in which antennas up to `reach`, m, from the viewpoint see
    triangles (k, 2) each.

    A cone about a triangle's corners of less than a right angle holds the triangle; of others all directions count.
    """
    ahead, away = triangles - viewpoint, distances(triangles, viewpoint)
    ways = ahead / np.maximum(np.linalg.norm(ahead, axis=2, keepdims=True), 1e-300)
    axis = ways.sum(axis=1)
    length = np.linalg.norm(axis, axis=1)
    axis /= np.maximum(length, 1e-300)[:, None]
    half = np.arccos(np.clip(np.einsum("kij,kj->ki", ways, axis).min(axis=1), -1, 1))
    known = (away > reach) & (half < RIGHT) & (length > 0)
    half = half + np.arcsin(np.minimum(reach / np.maximum(away, 1e-300), 1)) + 1e-7
    elevation, azimuth = np.arcsin(np.clip(axis[:, 2], -1, 1)), np.arctan2(axis[:, 1], axis[:, 0])
    low, high = elevation - half, elevation + half
    pole = ~known | (low <= -np.pi / 2) | (high >= np.pi / 2)
    wide = np.where(pole, np.pi, np.arcsin(np.clip(np.sin(half) / np.maximum(np.cos(elevation), 1e-300), 0, 1)))
    azimuth = np.where(pole, 0.0, azimuth)
    z = [np.where(known, np.sin(np.clip(side, -np.pi / 2, np.pi / 2)), end) for side, end in ((low, -1.0), (high, 1.0))]
    return np.stack([z[0], azimuth - wide], axis=1), np.stack([z[1], azimuth + wide], axis=1)


def _around(
    boxes: tuple[np.ndarray, np.ndarray], least: float, most: float
) -> tuple[tuple[np.ndarray, np.ndarray], np.ndarray]:
    """Boxes of z and azimuth, and again whole turns away where azimuths lie from `least` to `most`, rad; and the index
    of each (n,)."""
    low, high = boxes
    copies = [
        (turn, np.flatnonzero((low[:, 1] + turn <= most) & (high[:, 1] + turn >= least)))
        for turn in (0.0, 2 * np.pi, -2 * np.pi)
    ]
    index = np.concatenate([some for _, some in copies])
    shift = np.concatenate([np.full((len(some), 1), turn) for turn, some in copies]) * [0.0, 1.0]
    return (low[index] + shift, high[index] + shift), index


def _seen(
    triangles: np.ndarray, viewpoint: np.ndarray, axis: np.ndarray, sideways: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Least and largest place of triangles in perspective, tangents of the angles about the axis (k, 2) each."""
    ahead = triangles - viewpoint
    place = (ahead @ sideways.T) / (ahead @ axis)[..., None]
    return place.min(axis=1), place.max(axis=1)


def _overlapping(
    receivers: tuple[np.ndarray, np.ndarray], occluders: tuple[np.ndarray, np.ndarray]
) -> Iterator[np.ndarray]:
    """Pairs of boxes that overlap, in blocks (n, 2), each pair in one block."""
    if not len(occluders[0]):  # none lies in a direction that any receiver is seen in
        return
    least, most = occluders[0].min(axis=0), occluders[1].max(axis=0)
    inside = np.flatnonzero(((receivers[1] >= least) & (receivers[0] <= most)).all(axis=1))
    if not len(inside):
        return
    if len(inside) * len(occluders[0]) <= PAIRS_AT_ONCE:
        one, other = np.nonzero(_overlap_of_all(*receivers, *occluders, inside))
        yield np.stack([inside[one], other], axis=1)
        return
    size = np.quantile(occluders[1] - occluders[0], 0.75, axis=0) + np.median(receivers[1] - receivers[0], axis=0)
    size = np.maximum(size, (most - least) / 1024)
    size = np.where(size > 0, size, 1.0)
    while True:
        counts = [
            _cells(low, high, least, most, size)[1].prod(axis=1).sum()
            for low, high in (occluders, (receivers[0][inside], receivers[1][inside]))
        ]
        if sum(counts) <= MOST_ENTRIES or (size >= most - least).all():
            break
        size = 1.5 * size
    in_cell, occluder = cells_of_boxes(*occluders, least, most, size)
    order = np.argsort(in_cell, kind="stable")
    in_cell, occluder = in_cell[order], occluder[order]
    cell, receiver = cells_of_boxes(receivers[0][inside], receivers[1][inside], least, most, size)
    begin, end = np.searchsorted(in_cell, cell, "left"), np.searchsorted(in_cell, cell, "right")
    is_overlap = end > begin
    cell, receiver, begin, end = cell[is_overlap], inside[receiver[is_overlap]], begin[is_overlap], end[is_overlap]
    wide = int(np.ceil((most - least)[1] / size[1])) + 1
    total = np.concatenate([[0], np.cumsum(end - begin)])
    first = 0
    while first < len(cell):
        last = max(first + 1, int(np.searchsorted(total, total[first] + PAIRS_AT_ONCE, "right")) - 1)
        n = (end - begin)[first:last]
        here = np.repeat(np.arange(first, last), n)
        one = receiver[here]
        other = occluder[begin[here] + np.arange(len(here)) - np.repeat(np.cumsum(n) - n, n)]
        low = np.maximum(receivers[0][one], occluders[0][other])
        overlap = (low <= np.minimum(receivers[1][one], occluders[1][other])).all(axis=1)
        # of the cells that hold both, the one with the lower corner of their overlap counts
        place = np.clip(np.floor((low - least) / size), 0, None).astype(np.int64)
        overlap &= place[:, 0] * wide + place[:, 1] == cell[here]
        yield np.stack([one[overlap], other[overlap]], axis=1)
        first = last


def _overlap_of_all(
    low: np.ndarray, high: np.ndarray, least: np.ndarray, most: np.ndarray, inside: np.ndarray
) -> np.ndarray:
    """Whether boxes `inside`, from low to high, overlap each other box, from least to most, bool (m, n)."""
    apart = [
        (low[inside, axis, None] > most[None, :, axis]) | (high[inside, axis, None] < least[None, :, axis])
        for axis in range(2)
    ]
    return ~(apart[0] | apart[1])


def _cells(
    low: np.ndarray, high: np.ndarray, least: np.ndarray, most: np.ndarray, size: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """First cell of boxes, and number of cells that they reach over, along both axes, int64 (k, 2) each."""
    first = np.floor((np.clip(low, least, most) - least) / size).astype(np.int64)
    return first, np.floor((np.clip(high, least, most) - least) / size).astype(np.int64) - first + 1


def cells_of_boxes(
    low: np.ndarray, high: np.ndarray, least: np.ndarray, most: np.ndarray, size: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Number of the cell, and index of the box, of every cell that boxes reach over (n,)."""
    first, count = _cells(low, high, least, most, size)
    n = count.prod(axis=1)
    which = np.repeat(np.arange(len(low)), n)
    step = np.arange(len(which)) - np.repeat(np.cumsum(n) - n, n)
    wide = int(np.ceil((most - least)[1] / size[1])) + 1
    return (first[which, 0] + step // count[which, 1]) * wide + first[which, 1] + step % count[which, 1], which


def _joined(blocks: Iterable[np.ndarray], casts: Callable[..., np.ndarray]) -> np.ndarray:
    """The pairs of all blocks that pass the test, in the order of receivers."""
    kept = [pairs[casts(pairs)] for pairs in blocks]
    out = np.concatenate([np.zeros((0, 2), np.int64), *kept])
    return out[np.lexsort((out[:, 1], out[:, 0]))]
