"""Range profiles: between samples in frequency and a finer grid of delays."""

from __future__ import annotations

import numpy as np

from ..opencl import fft
from ..opencl.device import Device
from .interpolation import Interpolator

# Largest modulus of a profile: sums of ten thousand such rows still fit in complex64, of any number in complex128.
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


def correction(interpolator: Interpolator, n_samples: int, length: int) -> np.ndarray:
    """Factors of spectra (n_samples,): 1/transform, and the sign that puts delay 0 at length/2."""
    k = np.arange(n_samples) - n_samples // 2
    return np.where(k % 2, -1.0, 1.0) / interpolator.transform(k / length)


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
    shaped = samples * weights
    n, n_samples = shaped.shape
    largest, limit = float(np.abs(shaped).max(initial=0.0)) * n_samples, LARGEST[dtype]
    if not largest <= limit:
        raise ValueError(
            f"samples times weights reach {largest / n_samples:.1e} in rows of {n_samples}; sums in "
            f"{dtype.__name__} hold up to {limit:.0e}: scale the samples down"
        )
    spectrum = np.zeros((n, length), dtype)
    low = n_samples // 2
    spectrum[:, : n_samples - low] = shaped[:, low:]
    if low:
        spectrum[:, -low:] = shaped[:, :low]
    made = fft.rows(device, spectrum, inverse=True)
    if not pad:
        return made
    profiles = np.empty((n, length + 2 * pad), dtype)
    profiles[:, pad:-pad] = made
    profiles[:, :pad] = made[:, np.arange(-pad, 0) % length]
    profiles[:, -pad:] = made[:, np.arange(pad) % length]
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
    return samples * correction(interpolator, n_samples, length).astype(np.float32)
