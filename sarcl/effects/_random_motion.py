"""Smooth random motion: random processes that are sums of cosines, with frequencies drawn from a spectrum."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike

from ..base import validation

TERMS = 256  # cosines per axis: the kurtosis of the process is 3 - 3/(2 TERMS)


def deviation(name: str, value: ArrayLike) -> np.ndarray:
    """Standard deviations (3,) from one number or one per axis; ValueError for a negative one."""
    out = validation.each(name, value, 3)
    if (out < 0).any():
        raise ValueError(f"{name} is {out.tolist()}; a standard deviation is not negative")
    return out


def frequencies(correlation_time: float | None, spectrum: tuple[ArrayLike, ArrayLike] | None, seed: int) -> np.ndarray:
    """Frequencies (3, TERMS), Hz, drawn from a spectrum: one from each of TERMS parts of equal power."""
    if (correlation_time is None) == (spectrum is None):
        raise ValueError(
            "random motion needs correlation_time=... in s, or spectrum=(frequencies, densities): one of them"
        )
    share = (np.arange(TERMS) + np.random.default_rng([seed, 2]).uniform(size=(3, TERMS))) / TERMS
    if spectrum is None:
        from scipy.special import ndtri

        # exp(-(t/T)^2) has a Gaussian spectrum of deviation 1/(sqrt(2) pi T); cosines do not distinguish signs
        return np.asarray(
            ndtri(0.5 + share / 2)
            / (np.sqrt(2) * np.pi * validation.number("correlation_time", correlation_time, above=0))
        )
    f = validation.array("spectrum frequencies", spectrum[0], np.float64, ("k",))
    density = validation.array("spectrum densities", spectrum[1], np.float64, (len(f),))
    if len(f) < 2 or f[0] < 0 or not (np.diff(f) > 0).all() or (density < 0).any() or not density.any():
        raise ValueError("a spectrum is rising frequencies from 0 Hz up, with densities of 0 or more, not all 0")
    fine = np.unique(np.concatenate([np.linspace(a, b, 65) for a, b in pairwise(f)]))
    level = np.interp(fine, f, density)
    power = np.concatenate([[0], np.cumsum((level[1:] + level[:-1]) / 2 * np.diff(fine))])
    return np.asarray(np.interp(share, power / power[-1], fine))


def random_process(
    times: np.ndarray, rms: np.ndarray, frequencies: np.ndarray, seed: int, stream: int
) -> tuple[np.ndarray, np.ndarray]:
    """A random process (n, 3) of standard deviation rms (3,) at times, s (n,), and its rate of change (n, 3)."""
    phase = np.random.default_rng([seed, stream]).uniform(0, 2 * np.pi, (3, TERMS))
    offset, rate = np.zeros((len(times), 3)), np.zeros((len(times), 3))
    for axis in np.flatnonzero(rms):
        for f, p in zip(2 * np.pi * frequencies[axis], phase[axis], strict=True):
            offset[:, axis] += np.cos(f * times + p)
            rate[:, axis] -= f * np.sin(f * times + p)
    scale = rms * np.sqrt(2 / TERMS)
    return offset * scale, rate * scale
