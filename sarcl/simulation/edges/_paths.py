"""Paths from antennas to points, and the weights of antennas there."""

from __future__ import annotations

from functools import reduce

import numpy as np

from ...numerics.pulse_geometry import PulseGeometry
from ...scattering.antenna_weights import AntennaWeights

LEAST_STEP = 1e-300  # m: of pieces all at one range
WHOLE = np.array([0.0, 1.0])  # of a piece of an edge, from its beginning to its end


def paths_over(ends: list[np.ndarray], points: list[np.ndarray], reference: np.ndarray) -> np.ndarray:
    """Half the sum of the distances from each antenna to its point, about reference ranges, m (m, n), to the rounding
    of float64 times the distance of the points from one another.

    ends  m (m, 3), of one antenna that sends and receives, or of two;  reference  m (m,)
    points  of each, m (n, 3), or (m or 1, n, 3) where they differ from pulse to pulse

    |t - x| = |t - c| + d.(d - 2 (t - c))/(|t - x| + |t - c|), d = x - c.
    """
    center = points[0].reshape(-1, 3).mean(axis=0)
    out: np.ndarray | float = 0.0
    middle = np.zeros(len(reference), np.longdouble)
    for end, point in zip(ends, points, strict=True):
        step, to = point - center, end - center
        distance = np.sqrt((to.astype(np.longdouble) ** 2).sum(axis=1))
        middle += distance / len(ends)
        turned = step.T if step.ndim == 2 else step.swapaxes(1, 2)
        along = to @ turned if step.ndim == 2 else (to[:, None] @ turned)[:, 0]
        change = (step**2).sum(axis=-1) - 2 * along
        short = distance.astype(np.float64)[:, None]
        out = out + change / (np.sqrt(np.maximum(short**2 + change, 0)) + short) / len(ends)
    return np.asarray(out + (middle - reference).astype(np.float64)[:, None])


def weigh(
    amplitudes: np.ndarray,
    places: np.ndarray,
    weights: AntennaWeights,
    pulses: np.ndarray,
    pulse: np.ndarray,
    frequencies: np.ndarray,
) -> None:
    """Multiply amplitudes (k, ..., m) of places, m (k, 3), by the weights of antennas at pulses[pulse] (k,)."""
    for p in np.unique(pulse).tolist():
        rows = np.flatnonzero(pulse == p)
        for m, f in enumerate(frequencies.tolist()):
            weight = weights.weights(places[rows], int(pulses[p]), f)
            amplitudes[rows, ..., m] = (amplitudes[rows, ..., m].T * weight).T


def within_window(begin: np.ndarray, end: np.ndarray, antennas: PulseGeometry, pulses: np.ndarray) -> np.ndarray:
    """The part of pieces of edges inside the range windows of pulses (p,): shares of their lengths where it begins and
    ends, (p, n, 2), equal where there is none. begin, end  half paths about the reference range, m (p, n)"""
    step = np.where(end == begin, LEAST_STEP, end - begin)
    limits = [np.clip((limit[pulses, None] - begin) / step, 0.0, 1.0) for limit in (antennas.near, antennas.far)]
    return np.sort(np.stack(limits, axis=-1), axis=-1)


def common_part(parts: list[np.ndarray]) -> np.ndarray:
    """Where the intervals begin and end that parts (..., 2) have in common; equal where there is none."""
    begin = reduce(np.maximum, [part[..., 0] for part in parts])
    return np.stack([begin, np.maximum(reduce(np.minimum, [part[..., 1] for part in parts]), begin)], axis=-1)
