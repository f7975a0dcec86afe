"""Random numbers computed from positions, independent of the order of points and of their division into blocks."""

from __future__ import annotations

import numpy as np

# Step of splitmix64: the odd number nearest to 2^64 over the golden ratio (Steele, Lea and Flood 2014, "Fast splittable
# pseudorandom number generators")
GOLDEN = 0x9E3779B97F4A7C15
# Multiplier of 64 bits with a good lattice in 2 to 8 dimensions (Steele and Vigna 2021, "Computationally easy,
# spectrally good multipliers for congruential pseudorandom number generators"): it sets streams apart
STREAM = 0xD1342543DE82EF95
# Multipliers and shifts of the mixing function: David Stafford's variant 13, as splitmix64 has it
MULTIPLIERS, SHIFTS = (0xBF58476D1CE4E5B9, 0x94D049BB133111EB), (30, 27, 31)
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
        state = np.full(len(places), start_of(seed, stream))
        for axis in np.rint(places.T * 1e6).astype(np.int64).view(np.uint64):
            state = mix(state ^ axis)
    power, cycles = polar(state)
    return np.asarray(np.sqrt(2 * power) * np.cos(2 * np.pi * cycles))


def polar(state: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Squared modulus, exponential of mean 1, and phase, uniform cycles, of a complex normal number of each state."""
    with np.errstate(over="ignore"):
        first, second = mix(state), mix(state + np.uint64(GOLDEN))
    power = -np.log((first >> np.uint64(11)).astype(np.float64) * 2.0**-53 + 2.0**-54)
    return power, (second >> np.uint64(11)).astype(np.float64) * 2.0**-53


def start_of(seed: int, stream: int) -> np.uint64:
    """The state from which a stream of a seed begins."""
    return np.uint64(((seed + 1) * GOLDEN + stream * STREAM) % 2**64)


def mix(x: np.ndarray) -> np.ndarray:
    """One step of splitmix64."""
    x = x + np.uint64(GOLDEN)
    for shift, multiplier in zip(SHIFTS, MULTIPLIERS, strict=False):
        x = (x ^ (x >> np.uint64(shift))) * np.uint64(multiplier)
    return np.asarray(x ^ (x >> np.uint64(SHIFTS[2])))
