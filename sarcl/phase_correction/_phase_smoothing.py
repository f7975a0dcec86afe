"""Phase as a curve over the pulses of an aperture, (n,) rad: smoothed, unwrapped, and moved as an image shift does."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

MENDINGS = 4
MOST_BINS = 256.0  # Doppler cells by which two images are looked for apart


def cosines(n: int, modes: int) -> np.ndarray:
    """The first `modes` cosines of the discrete cosine transform, the constant first: (n, modes)."""
    return np.cos(np.pi * np.outer(np.arange(n) + 0.5, np.arange(modes)) / n)


def smooth(phase: np.ndarray, modes: int) -> np.ndarray:
    """The `modes` cosines and slope that fit exp(j phase) best, phase (n,) wrapped or not; all of it where modes is n.

    Noise makes plain unwrapping slip by 2 pi now and then, and a slip spoils any smoothing. So several ways to unwrap
    are smoothed, each is mended by what it leaves, wrapped, and the closest wins.
    """
    if modes >= len(phase):
        return unwrapped(phase)
    best, closest = phase, -1.0
    for way in _ways(phase):
        fit = _lowest(way, modes)
        for _ in range(MENDINGS):
            fit = fit + _lowest(_wrapped(phase - fit), modes)
        close = float(np.abs(np.exp(1j * (phase - fit)).mean()))
        if close > closest:
            best, closest = fit, close
    return best


def unwrapped(phase: np.ndarray) -> np.ndarray:
    """phase (n,) without jumps, as well as noise allows, and where it climbs by more than pi a pulse.

    Of several ways, and of those that stay within pi of a smoothed one, the curve with the least bends.
    """
    n = len(phase)
    bases = [smooth(phase, modes) for modes in (8, n // 16, n // 8, n // 4) if 1 < modes < n]
    curves = [*_ways(phase), *(base + _wrapped(phase - base) for base in bases)]
    return min(curves, key=lambda curve: float((np.diff(curve, 2) ** 2).sum()))


def _ways(phase: np.ndarray) -> Iterator[np.ndarray]:
    """Plainly unwrapped; along what stands out of the noise; and that after the slope, smoothed over some pulses."""
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
        mirrored = np.exp(1j * np.concatenate([rest, rest[::-1]]))  # no jump from the end to the start
        spectrum = scipy.fft.fft(mirrored)
        level = scipy.ndimage.uniform_filter1d(np.abs(spectrum) ** 2, max(3, n // 16), mode="wrap")
        spectrum[level < 4 * np.median(level)] = 0
        if spectrum.any():
            base += np.unwrap(np.angle(scipy.fft.ifft(spectrum)[:n]))
        yield base + _wrapped(phase - base)


def _lowest(curve: np.ndarray, modes: int) -> np.ndarray:
    """Least squares of a curve (n,) on the first `modes` cosines and a slope, which would take many of them."""
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
    """phase (n,) less its mean and its least-squares slope along `along` (n,), default the pulses' numbers."""
    t = np.arange(len(phase)) if along is None else along
    t = t - t.mean()
    return np.asarray(phase - phase.mean() - t * (t @ phase) / max(t @ t, 1e-300))


def alignment(phase: np.ndarray, other: np.ndarray, along: np.ndarray, reach: float) -> tuple[np.ndarray, float]:
    """`phase` (n,) moved to where its image lies on that of `other`, and how close they are then, 0 to 1.

    along  (n, 2), rad/m: what shifts of the image across range and in range do to the phase
    reach  m: limit of the shift in range; phases alone hardly tell it from a bend
    Closeness is |mean exp(j difference)|: 1 for equal phases, about sqrt(log(n)/n) for unrelated ones.
    """
    n = len(phase)
    moves = along - along.mean(axis=0)
    fit = np.linalg.pinv(moves)
    difference = np.exp(1j * (other - phase))
    most = min(n / 2, MOST_BINS)
    slopes = 2 * np.pi / max(float(np.ptp(moves[:, 0])), 1e-300) * np.arange(-most, most, 0.25)
    parts = np.array_split(slopes, 32)
    close = np.concatenate([np.abs(np.exp(-1j * np.outer(part, moves[:, 0])) @ difference) for part in parts])
    limit = np.array([np.inf, reach])
    best, closest = phase, -1.0
    # the highest of a fine comb, which noise does not mislead; the unwrapped difference, which may bend
    for start in (np.array([slopes[close.argmax()], 0.0]), fit @ np.unwrap(np.angle(difference))):
        shift = np.clip(start, -limit, limit)
        for _ in range(5):
            left = difference * np.exp(-1j * moves @ shift)
            shift = np.clip(shift + fit @ np.angle(left * left.sum().conj()), -limit, limit)
        level = float(np.abs((difference * np.exp(-1j * moves @ shift)).mean()))
        if level > closest:
            best, closest = phase + moves @ shift, level
    return best, closest


def chance(n: int) -> float:
    """Closeness that two unrelated phases of n pulses, shifted at will, reach once in a thousand times."""
    return float(np.sqrt(1 - np.exp(-(np.log(n) + np.log(1000)) / (n - 1))))
