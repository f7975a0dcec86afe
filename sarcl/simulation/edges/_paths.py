"""Paths from antennas to points, and the weights of antennas there."""

from __future__ import annotations

import numpy as np

from ...scattering.antenna_weights import AntennaWeights


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
