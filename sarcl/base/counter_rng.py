"""Random numbers computed from positions, independent of the order of points and of their division into blocks."""

from __future__ import annotations

import numpy as np

_GOLDEN = 0x9E3779B97F4A7C15
BLOCK = 2**15  # numbers that are computed together: so few stay in the processor's cache


def gaussian(places: np.ndarray, seed: int, stream: int = 0) -> np.ndarray:
    """Standard normal numbers (n,) that depend only on the seed, the stream and each position, m (n, 3).

    Two hashes (splitmix64, Steele, Lea and Flood 2014) of the position, rounded to a micrometre, give one number by
    the method of Box and Muller. Streams are independent of each other.
    """
    out = np.empty(len(places))
    for first in range(0, len(out), BLOCK):
        out[first : first + BLOCK] = _gaussian(places[first : first + BLOCK], seed, stream)
    return out


def _gaussian(places: np.ndarray, seed: int, stream: int) -> np.ndarray:
    with np.errstate(over="ignore"):
        state = np.full(len(places), ((seed + 1) * _GOLDEN + stream * 0xD1342543DE82EF95) % 2**64, np.uint64)
        for axis in np.rint(places.T * 1e6).astype(np.int64).view(np.uint64):
            state = mix(state ^ axis)
        first, second = mix(state), mix(state + np.uint64(_GOLDEN))
    radius = np.sqrt(-2 * np.log((first >> np.uint64(11)).astype(np.float64) * 2.0**-53 + 2.0**-54))
    return np.asarray(radius * np.cos(2 * np.pi * (second >> np.uint64(11)).astype(np.float64) * 2.0**-53))


def mix(x: np.ndarray) -> np.ndarray:
    """One step of splitmix64."""
    x = x + np.uint64(_GOLDEN)
    x = (x ^ (x >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    x = (x ^ (x >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return x ^ (x >> np.uint64(31))
