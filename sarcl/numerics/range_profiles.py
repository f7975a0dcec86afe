"""Range profiles: between samples in frequency and a finer grid of delays."""

from __future__ import annotations

import numpy as np

from ..opencl import fft
from ..opencl.device import Device
from .interpolation import Interpolator

LARGEST = 1e34  # of a profile: sums of ten thousand such rows still fit in complex64


def padding(interpolator: Interpolator) -> int:
    """Samples kept on each side of a profile, so that taps never leave their row."""
    return interpolator.taps + 2


def correction(interpolator: Interpolator, n_samples: int, length: int) -> np.ndarray:
    """What spectra (n_samples,) are multiplied by: 1/transform, and the sign that puts delay 0 at length/2."""
    k = np.arange(n_samples) - n_samples // 2
    return np.where(k % 2, -1.0, 1.0) / interpolator.transform(k / length)


def from_samples(
    device: Device,
    samples: np.ndarray,
    weights: np.ndarray,
    interpolator: Interpolator,
    length: int,
    pad: int | None = None,
) -> np.ndarray:
    """Profiles (n, length + 2 pad) complex64 of samples (n, n_samples), each times weights (n, n_samples).

    Delay 0 stands at pad + length/2; the padding, by default what taps need, repeats the profile's other end.
    """
    n, n_samples = samples.shape
    spectrum = np.zeros((n, length), np.complex64)
    shaped = samples * weights
    largest = float(np.abs(shaped).max(initial=0.0)) * n_samples
    if largest > LARGEST:
        raise ValueError(
            f"samples times weights reach {largest / n_samples:.1e} in rows of {n_samples}; sums in complex64 hold up "
            f"to {LARGEST:.0e}: scale the samples down"
        )
    low = n_samples // 2
    spectrum[:, : n_samples - low] = shaped[:, low:]
    if low:
        spectrum[:, -low:] = shaped[:, :low]
    pad = padding(interpolator) if pad is None else pad
    profiles = np.empty((n, length + 2 * pad), np.complex64)
    profiles[:, pad:-pad] = made = fft.rows(device, spectrum, inverse=True)
    if pad <= length:
        profiles[:, :pad], profiles[:, -pad:] = made[:, length - pad :], made[:, :pad]
    else:  # several times over
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
