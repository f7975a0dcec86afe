"""The cheapest interpolation kernel that meets an error, and the length of the range profiles that it reads."""

from __future__ import annotations

import functools

import numpy as np

from ..base.errors import ToleranceUnreachable
from ..base.tolerances import rounded_up
from ..opencl import fft
from . import cost_model, interpolation
from .interpolation import Interpolator

OVERSAMPLE = (1.5, 2, 2.5, 3, 4, 5, 6, 8, 10, 12, 16, 20, 24, 32, 48, 64)
LONGEST = 2**18  # samples of a profile that is oversampled to spare taps
FLOAT64_TAPS = (4, 6, 8, 10, 12, 14)
FLOAT64_OVERSAMPLE = (1.5, 2, 2.5, 3, 4, 5, 6, 8, 12, 16)


def profile_length(oversample: float, n_samples: int, taps: int) -> int:
    """The shortest even length with a fast FFT for rows of n_samples; an even length puts delay 0 on a sample.

    One sample has no bandwidth, but a profile of a few samples keeps its taps apart.
    """
    return 2 * fft.good_length(max(int(np.ceil(oversample * n_samples / 2)), 2 * taps))


@functools.lru_cache(maxsize=256)
def lengths(n_samples: int) -> tuple[int, ...]:
    """Lengths of the profiles of rows of n_samples that a plan may take, in float32 or float64."""
    taps = (*interpolation.TERMS, *FLOAT64_TAPS)
    candidates = {profile_length(s, n_samples, t) for s in OVERSAMPLE for t in taps}
    return tuple(sorted(n for n in candidates if n <= max(LONGEST, 2 * n_samples * max(interpolation.TERMS))))


@functools.lru_cache(maxsize=256)
def interpolators(n_samples: int, carrier: float) -> tuple[tuple[int, float, int], ...]:
    """Taps, oversampling and profile length of every interpolator for rows of n_samples."""
    out = []
    for taps in interpolation.TERMS:
        for oversample in OVERSAMPLE:
            length = profile_length(oversample, n_samples, taps)
            while not off_carrier(length, carrier):
                length = 2 * fft.good_length(length // 2 + 1)
            if length <= max(LONGEST, 2 * n_samples * taps):
                out.append((taps, float(oversample), length))
    return tuple(out)


@functools.lru_cache(maxsize=1024)
def _by_cost(
    n_samples: int, pairs_per_row: float, carrier: float, gathering: cost_model.Gathering
) -> tuple[tuple[float, int, float, int], ...]:
    """Cost, taps, oversampling and profile length of every interpolator, the cheapest first."""
    candidates = [
        (pairs_per_row * gathering.of_taps(*one) + cost_model.profile(one[2]), *one)
        for one in interpolators(n_samples, carrier)
    ]
    return tuple(sorted(candidates, key=lambda candidate: candidate[0]))


@functools.lru_cache(maxsize=256)
def least_error(n_samples: int, carrier: float = 0.0) -> float:
    """The smallest error that `choose_interpolator` can meet, for rows of n_samples."""
    least, candidates = np.inf, interpolators(n_samples, carrier)
    for bound, taps, oversample in sorted((interpolation.lower_bound(t, s), t, s) for t, s, _ in candidates):
        if bound < least:
            least = min(least, interpolation.interpolator(taps, oversample).error)
    return least


@functools.lru_cache(maxsize=4096)
def choose_interpolator(
    error: float,
    n_samples: int,
    pairs_per_row: float,
    carrier: float = 0.0,
    gathering: cost_model.Gathering = cost_model.ON_CPU,
) -> tuple[Interpolator, int, float]:
    """The cheapest interpolator whose error is at most `error`, the profile length it needs, and its cost.

    The cost of a contribution is in units of one with the hat; making profiles is counted in.

    n_samples      samples of a row before oversampling
    pairs_per_row  contributions read from a row: they weigh the cost of taps against that of the FFT
    gathering      costs of taps on the devices that read the rows, and the kernels that they read with
    carrier        centre frequency in steps between samples, for evenly spaced scatterers: see off_carrier
    The choice never depends on memory, so that results do not.
    ToleranceUnreachable names the smallest error that can be met.
    """

    families = [(interpolation.lower_bound, interpolation.interpolator)]
    if gathering.fitted:
        families.insert(0, (interpolation.fitted_lower_bound, interpolation.fitted))
    for cost, taps, oversample, length in _by_cost(n_samples, pairs_per_row, carrier, gathering):
        for least_of, make in families:
            if least_of(taps, oversample) <= error:
                interpolator = make(taps, oversample)
                if interpolator.error <= error:
                    return interpolator, length, cost / pairs_per_row
    least = rounded_up(least_error(n_samples, carrier))
    raise ToleranceUnreachable(error, least, "interpolation of float32 range profiles")


def off_carrier(length: int, carrier: float) -> bool:
    """Whether no image of a kernel, one profile rate from the next, lies within a quarter of that from the carrier.

    At an image evenly spaced scatterers, such as the pieces of a plate, add up although they cancel at the carrier.
    """
    images = carrier / length
    return abs(images - max(round(images), 1)) >= 0.25
