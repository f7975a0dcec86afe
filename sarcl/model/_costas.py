"""Costas permutations by the constructions of Welch and Golomb over the integers modulo a prime."""

from __future__ import annotations

import numpy as np


def permutation(n: int) -> np.ndarray | None:
    """A Costas permutation of 0 ... n - 1, int64, or None where these constructions give none of this size.

    Welch (p - 1) and Golomb (p - 2), with up to two corner points removed: sizes p - 1 to p - 4 for the next primes p.
    Source: Golomb, Taylor 1984, Constructions and properties of Costas arrays.
    """
    for p in range(n + 1, n + 5):
        if _is_prime(p):
            for array in _constructions(p):
                corner = _corner(array, n)
                if corner is not None and is_costas(corner):
                    return corner
    return None


def nearest_sizes(n: int) -> tuple[int, int]:
    """The nearest sizes below (0: none) and above n for which `permutation` finds one."""
    below = next((m for m in range(n - 1, 0, -1) if permutation(m) is not None), 0)
    above = n + 1
    while permutation(above) is None:
        above += 1
    return below, above


def is_costas(f: np.ndarray) -> bool:
    """Whether f is a permutation of 0 ... n - 1 with f(i + k) - f(i) all different for every k.

    Only k <= (n - 1)/2 need to be checked (Chang 1987): two equal differences at distance k imply two equal ones
    between the same points paired the other way.
    """
    n = len(f)
    if not np.array_equal(np.sort(f), np.arange(n)):
        return False
    return all(np.bincount(f[k:] - f[:-k] + n).max() == 1 for k in range(1, (n - 1) // 2 + 1))


def _constructions(p: int) -> list[np.ndarray]:
    """Welch's array of order p - 1 and Golomb's of order p - 2 whose corner points can be removed, counted from 0."""
    g = _primitive_root(p)
    power = np.ones(p - 1, np.int64)
    for i in range(1, p - 1):
        power[i] = power[i - 1] * g % p
    arrays = [power - 1]
    if p < 5:
        return arrays
    log = np.zeros(p, np.int64)
    log[power] = np.arange(p - 1)
    element = np.arange(2, p)
    primitive = np.gcd(log[element], p - 1) == 1
    partner = (1 - element) % p  # Golomb: alpha^i + beta^j = 1, so alpha + beta = 1 puts a point in the corner
    pairs = element[primitive & (np.gcd(log[partner], p - 1) == 1)]
    square = [
        a for a in element[primitive].tolist() if (a * a + a) % p == 1
    ]  # two by two points in the corner (Taylor)
    generators = [(int(a), int((1 - a) % p)) for a in pairs[:1]] + [(a, a) for a in square[:1]]
    number = np.arange(1, p - 1)
    for a, b in generators:
        rest = (1 - power[number * log[a] % (p - 1)]) % p
        arrays.append(log[rest] * pow(int(log[b]), -1, p - 1) % (p - 1) - 1)
    return arrays


def _corner(f: np.ndarray, n: int) -> np.ndarray | None:
    """f without its first rows and columns, if those hold a permutation of their own; else None."""
    cut = len(f) - n
    if cut < 0 or (cut and f[:cut].max() >= cut):
        return None
    return f[cut:] - cut


def _is_prime(p: int) -> bool:
    return p > 1 and all(p % d for d in range(2, int(p**0.5) + 1))


def _primitive_root(p: int) -> int:
    factors = [q for q in range(2, p) if (p - 1) % q == 0 and _is_prime(q)]
    return next(g for g in range(1, p) if all(pow(g, (p - 1) // q, p) != 1 for q in factors))
