"""Range profiles: between samples in frequency and a finer grid of delays."""

from __future__ import annotations

import functools

import numpy as np

from ..opencl import fft
from ..opencl.device import Device
from .interpolation import Interpolator

IN_CACHE = 2**15  # samples weighted at a time, so that they stay in a cache

# Largest part of a profile, real or imaginary: sums of ten thousand such rows still fit in complex64, of any number in
# complex128.
TINY = 1e-35  # amplitude of samples below which pixels approach the smallest numbers of complex64
LARGEST: dict[type[np.complexfloating], float] = {np.complex64: 1e34, np.complex128: 1e290}


def check_digits(largest: float) -> None:
    """ValueError where the largest of all samples times weights is so small that complex64 loses digits of it."""
    if 0 < largest < TINY:
        raise ValueError(
            f"samples times weights reach {largest:.1e}; complex64 loses digits below {TINY:.0e}: scale the samples up"
        )


def padding(interpolator: Interpolator) -> int:
    """Samples kept on each side of a profile, so that taps never leave their row.

    In float64 windows of FAR samples more, which neighbouring lanes share, must not leave it either.
    """
    return interpolator.taps + (4 if interpolator.dtype == np.float64 else 2)


@functools.lru_cache(maxsize=16)
def correction(interpolator: Interpolator, n_samples: int, length: int) -> np.ndarray:
    """Factors of spectra (n_samples,): 1/transform, and the sign that puts delay 0 at length/2."""
    k = np.arange(n_samples) - n_samples // 2
    factors = np.where(k % 2, -1.0, 1.0) / interpolator.transform(k / length)
    factors.flags.writeable = False
    return factors


def from_samples(
    device: Device | None,
    samples: np.ndarray,
    weights: np.ndarray | float,
    length: int,
    pad: int = 0,
    dtype: type[np.complexfloating] = np.complex64,
) -> np.ndarray:
    """Profiles (n, length + 2 pad) complex64 or complex128 of samples, each times its weight.

    device            computes the FFT; None: the host does
    samples, weights  (n, n_samples), or shapes that broadcast to it
    Delay 0 stands at pad, with a `correction` among the weights at pad + length/2. The padding repeats the profile's
    other end. ValueError where samples are too large for sums in this number type.
    """
    shape = n, n_samples = np.broadcast_shapes(samples.shape, np.shape(weights))
    samples, weights = np.broadcast_to(samples, shape), np.broadcast_to(weights, shape)
    profiles = np.empty((n, length + 2 * pad), dtype)
    within, low, at_once = profiles[:, pad : pad + length], n_samples // 2, max(1, IN_CACHE // n_samples)
    largest, limit = 0.0, LARGEST[dtype]
    within[:, n_samples - low : length - low] = 0
    for rows in (slice(start, start + at_once) for start in range(0, n, at_once)):
        # products are written in their places, in parts that stay in a cache
        for columns, place in ((slice(low, None), slice(n_samples - low)), (slice(low), slice(length - low, None))):
            part = within[rows, place]
            with np.errstate(over="ignore", invalid="ignore"):
                np.multiply(samples[rows, columns], weights[rows, columns], out=part, casting="same_kind")
            numbers = part.view(part.real.dtype)
            largest = float(np.maximum(largest, np.maximum(numbers.max(initial=0.0), -numbers.min(initial=0.0))))
    if not largest * n_samples <= limit:
        raise ValueError(
            f"samples times weights reach {largest:.1e} in rows of {n_samples}; sums in "
            f"{dtype.__name__} hold up to {limit:.0e}: scale the samples down"
        )
    transformed = fft.rows(device, within, inverse=True, overwrite=True)
    if not np.may_share_memory(transformed, within):
        within[:] = transformed
    for start in range(0, pad, length):
        end = min(start + length, pad)
        profiles[:, pad - end : pad - start] = profiles[:, pad - end + length : pad - start + length]
        profiles[:, pad + length + start : pad + length + end] = profiles[:, pad + start : pad + end]
    return profiles


def to_samples(device: Device, profiles: np.ndarray, n_samples: int, interpolator: Interpolator) -> np.ndarray:
    """Spectra (n, n_samples) of spread profiles (n, length + 2 padding): the adjoint of `from_samples`."""
    pad = padding(interpolator)
    length = profiles.shape[1] - 2 * pad
    folded = profiles[:, pad:-pad].copy()
    folded[:, -pad:] += profiles[:, :pad]
    folded[:, :pad] += profiles[:, -pad:]
    spectrum = fft.rows(device, folded)
    low = n_samples // 2
    # conjugate grids: the sign that centres delay 0 is its own inverse
    samples = np.concatenate([spectrum[:, length - low :], spectrum[:, : n_samples - low]], axis=1)
    return samples * correction(interpolator, n_samples, length).astype(profiles.real.dtype)
