"""Sub-apertures: smooth runs of pulses, decimated level by level. Geometry and errors, without a device."""

from __future__ import annotations

import itertools
from dataclasses import dataclass, replace

import numpy as np

from ..base.constants import SPEED_OF_LIGHT
from ..base.rows import spread_over
from ..base.vectors import dot
from . import interpolation
from .pulse_geometry import PulseGeometry

GAP = 5.0  # a step between pulses that is this many times longer than the median begins a new run


def smooth_runs(tx: np.ndarray, rx: np.ndarray, group: np.ndarray | None = None) -> list[tuple[int, int]]:
    """Runs (first, stop) of pulses that follow one another without a gap in the track.

    tx, rx  positions, m (n, 3);  group  (n,): pulses of a run have the same number; None: all have
    """
    step = np.abs(np.diff(tx, axis=0)).sum(axis=1) + np.abs(np.diff(rx, axis=0)).sum(axis=1)
    usual = float(np.median(step)) if len(step) else 0.0
    is_cut = step > GAP * usual
    if group is not None:
        is_cut |= np.diff(group) != 0
    edges = [0, *(np.flatnonzero(is_cut) + 1).tolist(), len(tx)]
    return list(itertools.pairwise(edges))


@dataclass(frozen=True, eq=False)
class Decimation:
    """Decimation of the pulses of a track to every `ratio`-th position.

    kept    the pulses that are kept, with the range to the origin as reference and no window: their profiles are made
            about tiles, whose centres are their reference
    blocks  (n_blocks, 4) int32: first pulse, number of pulses, first kept pulse, first row of the filter
    filter  (ratio, taps) float32: weights of the kept pulses around a pulse, by its position between two of them
    error   relative error of the filter at the oversampling it was made for
    places  first and last + 1 of the pulses of each run, and the places of the kept ones, counted from the first
    """

    kept: PulseGeometry
    ratio: int
    blocks: np.ndarray
    filter: np.ndarray
    error: float
    places: tuple[tuple[int, int, np.ndarray], ...] = ()

    def taken(self, values: np.ndarray) -> np.ndarray:
        """Values (n, k) of pulses at the kept ones; beyond the ends of runs on the parabola through the last ones."""
        return np.concatenate([_extended(values[begin:end], at) for begin, end, at in self.places])

    @property
    def neighbours(self) -> np.ndarray:
        """First kept pulse around each pulse, and the row of the filter that weighs it and the next: int32 (n, 2)."""
        first, count, kept, row = self.blocks.T
        along = np.arange(count.sum()) - np.repeat(first - first[0], count)
        return np.stack([np.repeat(kept, count), np.repeat(row, count) + along], axis=1).astype(np.int32)


def decimated(track: PulseGeometry, ratio: int, taps: int, oversample: float) -> Decimation:
    """Decimate each run by `ratio`; beyond its ends as many are kept as the filter of `taps` needs."""
    runs, spots, first = [], [], 0
    blocks: list[np.ndarray] = []
    rows: list[int] = []
    for begin, end in track.runs:
        n = end - begin
        n_blocks = -(-n // ratio)
        numbers = np.arange(n_blocks + taps - 1) - (taps // 2 - 1)
        b = np.arange(n_blocks)
        blocks.append(np.stack([begin + b * ratio, np.minimum(ratio, n - b * ratio), first + b, 0 * b], axis=1))
        spots.append((begin, end, numbers * ratio))
        rows += [begin] * len(numbers)
        runs.append((first, first + len(numbers)))
        first += len(numbers)
    z = np.arange(ratio) / ratio - 0.5
    weights = interpolation.least_squares_weights(taps, oversample, z)
    tx, *rx = (
        np.concatenate([_extended(antenna[begin:end], at) for begin, end, at in spots]) for antenna in track.ends
    )
    kept = PulseGeometry(
        tx,
        rx[0] if rx else tx,
        frequency=track.frequency[rows],
        frequency_step=track.frequency_step[rows],
        runs=tuple(runs),
    )
    kept = replace(kept, reference_range=kept.half_path(np.zeros(3)))
    error = interpolation.line_interpolator(taps, oversample).error
    return Decimation(
        kept, ratio, np.concatenate(blocks).astype(np.int32), weights.astype(np.float32), error, tuple(spots)
    )


def _extended(run: np.ndarray, at: np.ndarray) -> np.ndarray:
    """Values (n, k) of a run at whole indices; beyond its ends on the parabola through its last values."""
    n = len(run)
    inside = np.clip(at, 0, n - 1)
    out = run[inside]
    step = max(1, min((n - 1) // 2, int(at[1] - at[0]) if len(at) > 1 else 1))
    for outside, end, sign in ((at < 0, 0, 1), (at > n - 1, n - 1, -1)):
        if not outside.any() or n < 3:
            continue
        a, b, c = run[end], run[end + sign * step], run[end + 2 * sign * step]
        t = ((at[outside] - end) * sign / step)[:, None]
        out[outside] = a + t * (b - a) + t * (t - 1) / 2 * (c - 2 * b + a)
    return out


def rate(track: PulseGeometry, points: np.ndarray, axes: np.ndarray | None) -> float:
    """Largest change of the gradient of range at points, m (n, 3), from one row to the next; see `rates`."""
    return float(rates(track, points, axes).max(initial=0.0))


def rates(track: PulseGeometry, points: np.ndarray, axes: np.ndarray | None, most: int = 512) -> np.ndarray:
    """Largest change of the gradient of range at each of the points, m (n, 3), from one row to the next; no unit.

    axes  unit vectors (2, 3) of the plane that the pixels lie in, or None for pixels anywhere
    most  pulses of a run at which it is computed
    """
    largest = np.zeros(len(points))
    for begin, end in track.runs:
        if end - begin < 2:
            continue
        rows = begin + spread_over(end - begin - 1, most)
        change = np.zeros((3, len(points), len(rows)))
        for antenna in track.ends:
            before, after = (_planes_of_directions(antenna[r], points) for r in (rows, rows + 1))
            change += (after - before) / len(track.ends)
        seen = change if axes is None else np.moveaxis(np.moveaxis(change, 0, -1) @ axes.T, -1, 0)
        np.maximum(largest, np.sqrt(sum(plane * plane for plane in seen)).max(axis=1), out=largest)
    return largest


def _planes_of_directions(ends: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Components of the unit vectors from points (n, 3) to ends (m, 3): (3, n, m), faster than rows of three."""
    d = ends.T[:, None] - points.T[:, :, None]
    return np.asarray(d / np.maximum(np.sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2]), 1e-9))


def filter_error(
    track: PulseGeometry,
    decimation: Decimation,
    centers: np.ndarray,
    radius: float,
    frequency: float,
    axes: np.ndarray | None = None,
    directions: np.ndarray | None = None,
) -> float:
    """Largest relative error of a pulse that the kept ones make, `radius` m away from each of `centers`, m (m, 3).

    axes        unit vectors (2, 3) of the plane in which points lie;  directions  of points from the centres, unit
                vectors (n, 3), in place of those along the coordinates, or in the plane
    Computed for the track as it is, not for a smooth one: for the pulses of 32 blocks spread over the track, and for
    the 1024 pulses where the track deviates most from a smooth one.
    """
    if directions is None:
        directions = np.concatenate([np.eye(3), -np.eye(3)])
    if axes is not None:
        angle = 2 * np.pi * np.arange(8) / 8
        directions = np.cos(angle)[:, None] * axes[0] + np.sin(angle)[:, None] * axes[1]
    blocks = decimation.blocks
    spread = spread_over(len(blocks), 32)
    within = spread_over(decimation.ratio, 64)
    usual = (blocks[spread, :1] + np.minimum(within, blocks[spread, 1:2] - 1)).ravel()
    pulses = np.unique(np.concatenate([usual, _roughest(track, decimation, centers[len(centers) // 2])]))
    block = blocks[np.searchsorted(blocks[:, 0], pulses, side="right") - 1]
    # the pulses of a block share their kept pulses
    kept, tap = np.unique(block[:, 2:3] + np.arange(decimation.filter.shape[1]), return_inverse=True)
    filters, worst = decimation.filter.astype(np.float64)[block[:, 3] + pulses - block[:, 0]], 0.0
    tap = tap.reshape(filters.shape)
    for center in centers:
        points = center + radius * directions
        exact = _phases(track, pulses, points, center, frequency)
        phases = _phases(decimation.kept, kept, points, center, frequency)
        parts = np.einsum("pn,pnm->pm", filters, phases.view(np.float64)[tap])  # real and imaginary
        error = (parts - exact.view(np.float64)).view(np.complex128)
        worst = max(worst, abs(error.flat[np.argmax(error.real**2 + error.imag**2)]))
    return float(worst)


def _roughest(track: PulseGeometry, decimation: Decimation, center: np.ndarray, most: int = 1024) -> np.ndarray:
    """Pulses whose direction from `center` deviates most from linear interpolation between the kept pulses."""
    first, count, row, _ = decimation.blocks.T
    before = row + decimation.filter.shape[1] // 2 - 1
    way = ((np.arange(len(track)) - np.repeat(first, count)) / decimation.ratio)[:, None]
    before, off = np.repeat(before, count), np.zeros(len(track))
    for antenna, ends in zip(track.ends, decimation.kept.ends, strict=True):
        pulses, ends_seen = _directions(antenna, center), _directions(ends, center)
        deviation = pulses - (1 - way) * ends_seen[before] - way * ends_seen[before + 1]
        off = np.maximum(off, dot(deviation, deviation))
    return np.argpartition(off, max(len(off) - most, 0))[-most:]


def _directions(ends: np.ndarray, center: np.ndarray) -> np.ndarray:
    d = ends - center
    return d / np.maximum(np.sqrt(dot(d, d)), 1e-9)[:, None]


def _phases(
    track: PulseGeometry, rows: np.ndarray, points: np.ndarray, center: np.ndarray, frequency: float
) -> np.ndarray:
    """exp(j 2 pi f (tau(x) - tau(center))) for rows (...) at points (m, 3): (..., m)."""
    path = np.zeros((*rows.shape, len(points)))
    x = points - center
    for antenna in track.ends:
        to_center = antenna[rows] - center
        near = np.sqrt((to_center**2).sum(axis=-1))[..., None]
        along = to_center @ x.T
        grown = (x**2).sum(axis=1) - 2 * along
        path += grown / (near + np.sqrt(near**2 + grown)) / len(track.ends)
    angle = 4 * np.pi * frequency / SPEED_OF_LIGHT * path
    phases = np.empty(angle.shape, np.complex128)  # twice as fast as the exponential of complex numbers
    np.cos(angle, out=phases.real)
    np.sin(angle, out=phases.imag)
    return phases
