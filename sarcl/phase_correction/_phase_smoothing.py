"""Phase as a function of the pulse, (n,) rad: smoothing, unwrapping, and registration, which shifts the image."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

MENDINGS = 4  # corrections of a smoothed phase by its wrapped residual
FEW = 16  # pulses of a product of matrices
MOST_BINS = 256.0  # Doppler cells, largest shift between two images that is searched


def cosines(n: int, modes: int) -> np.ndarray:
    """The first `modes` cosines of the discrete cosine transform, the constant first: (n, modes)."""
    return np.cos(np.pi * np.outer(np.arange(n) + 0.5, np.arange(modes)) / n)


def smooth(phase: np.ndarray, modes: int, ways: list[np.ndarray] | None = None) -> np.ndarray:
    """The sum of `modes` cosines and a slope that fits exp(j phase) best, phase (n,) wrapped or not.

    ways  the phase as `unwrappings` gives it, where the caller has it

    Where modes is n the phase is unwrapped, not smoothed. With noise, plain unwrapping makes errors of 2 pi, each of
    which spoils any smoothing. So the results of several unwrapping methods are smoothed, each is corrected by its
    wrapped residual, and the closest is returned.
    """
    if ways is None:
        ways = unwrappings(phase)
    if modes >= len(phase):
        return unwrapped(phase, ways)
    best, closest = phase, -1.0
    for way in ways:
        fit = lowest(way, modes)
        for _ in range(MENDINGS):
            fit = fit + lowest(_wrapped(phase - fit), modes)
        close = float(np.abs(np.exp(1j * (phase - fit)).mean()))
        if close > closest:
            best, closest = fit, close
    return best


def unwrapped(phase: np.ndarray, ways: list[np.ndarray] | None = None) -> np.ndarray:
    """phase (n,) unwrapped, also with noise, and where it changes by more than pi per pulse.

    Of the results of several methods, and of those within pi of a smoothed phase: the one with the least curvature.
    """
    n = len(phase)
    if ways is None:
        ways = unwrappings(phase)
    bases = [smooth(phase, modes, ways) for modes in (8, n // 16, n // 8, n // 4) if 1 < modes < n]
    curves = [*ways, *(base + _wrapped(phase - base) for base in bases)]
    return min(curves, key=lambda curve: float((np.diff(curve, 2) ** 2).sum()))


def unwrappings(phase: np.ndarray) -> list[np.ndarray]:
    """phase (n,) by several methods of unwrapping, for `smooth` and `unwrapped`."""
    return list(_unwrappings(phase))


def _unwrappings(phase: np.ndarray) -> Iterator[np.ndarray]:
    """Unwrapped plainly; along the spectral peaks above the noise; and so after removal of a smoothed slope."""
    import scipy.fft
    import scipy.ndimage

    n = len(phase)
    yield np.unwrap(phase)
    step = np.exp(1j * np.diff(phase))
    for over in (0, n // 8, n // 16, n // 32):
        base = np.zeros(n)
        if over:
            slope = np.unwrap(np.angle(scipy.ndimage.uniform_filter1d(step, max(3, over), mode="nearest")))
            base[1:] = np.cumsum(slope)
        rest = phase - base
        mirrored = np.exp(1j * np.concatenate([rest, rest[::-1]]))  # continuous from the end to the start
        spectrum = scipy.fft.fft(mirrored)
        level = scipy.ndimage.uniform_filter1d(np.abs(spectrum) ** 2, max(3, n // 16), mode="wrap")
        spectrum[level < 4 * np.median(level)] = 0
        if spectrum.any():
            base += np.unwrap(np.angle(scipy.fft.ifft(spectrum)[:n]))
        yield base + _wrapped(phase - base)


def lowest(curve: np.ndarray, modes: int) -> np.ndarray:
    """Least-squares fit of a curve (n,) by the first `modes` cosines and a slope, which would take many cosines."""
    import scipy.fft

    both = np.stack([curve, np.arange(len(curve)) / len(curve)])
    spectrum = scipy.fft.dct(both)
    spectrum[:, modes:] = 0
    low, slope = scipy.fft.idct(spectrum)
    rest = both[1] - slope
    return np.asarray(low + rest * (rest @ curve) / max(rest @ rest, 1e-300))


def _wrapped(phase: np.ndarray) -> np.ndarray:
    return np.asarray(np.angle(np.exp(1j * phase)))


def detrended(phase: np.ndarray, along: np.ndarray | None = None) -> np.ndarray:
    """phase (n,) without its mean and its least-squares slope against `along` (n,), default the pulse number."""
    t = np.arange(len(phase)) if along is None else along
    t = t - t.mean()
    return np.asarray(phase - phase.mean() - t * (t @ phase) / max(t @ t, 1e-300))


def alignment(phase: np.ndarray, other: np.ndarray, along: np.ndarray, reach: float) -> tuple[np.ndarray, float]:
    """`phase` (n,) after a shift of its image to that of `other`, and the closeness of the two, 0 to 1.

    along  (n, 2), rad/m: change of the phase per shift of the image across range, and in range
    reach  m, largest shift in range: from phases alone it can hardly be distinguished from curvature
    Closeness is |mean exp(j difference)|: 1 for equal phases, about sqrt(log(n)/n) for unrelated ones.
    """
    n = len(phase)
    moves = along - along.mean(axis=0)
    fit = np.linalg.pinv(moves)
    difference = np.exp(1j * (other - phase))
    most = min(n / 2, MOST_BINS)
    slopes = 2 * np.pi / max(float(np.ptp(moves[:, 0])), 1e-300) * np.arange(-most, most, 0.25)
    # slope width a + b: exp(-j s m) is a product of one factor for each, which takes far fewer exponentials
    width = int(np.ceil(np.sqrt(len(slopes))))
    steps = np.exp(-1j * np.outer(moves[:, 0], slopes[:width] - slopes[0]))
    starts = np.exp(-1j * np.outer(slopes[::width], moves[:, 0])) * difference
    # so few pulses at a time that no threads are started, which take longer than the products
    blocks = (slice(first, first + FEW) for first in range(0, n, FEW))
    close = np.abs(sum(starts[:, block] @ steps[block] for block in blocks)).ravel()[: len(slopes)]
    limit = np.array([np.inf, reach])
    best, closest = phase, -1.0
    # two starts: the best of finely spaced shifts, robust to noise; a fit to the unwrapped difference, also in range
    for start in (np.array([slopes[close.argmax()], 0.0]), fit @ np.unwrap(np.angle(difference))):
        shift = np.clip(start, -limit, limit)
        for _ in range(5):
            residual = difference * np.exp(-1j * moves @ shift)
            shift = np.clip(shift + fit @ np.angle(residual * residual.sum().conj()), -limit, limit)
        level = float(np.abs((difference * np.exp(-1j * moves @ shift)).mean()))
        if level > closest:
            best, closest = phase + moves @ shift, level
    return best, closest


def chance(n: int) -> float:
    """Closeness that two unrelated phases of n pulses exceed with probability 1/1000 after registration."""
    return float(np.sqrt(1 - np.exp(-(np.log(n) + np.log(1000)) / (n - 1))))
