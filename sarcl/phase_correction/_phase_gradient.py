"""Phase of each pulse from its contributions to bright points of an image; functions of plain arrays.

v[p, k] is the contribution of pulse p to point k (columns may also be lags and channels of it), complex64 (n, columns);
pulse p has the unknown factor exp(j phase[p]). The phase of a scatterer beside point k is linear in p: the FFT over p
is the image on a line through k, one bin per resolution cell of the whole aperture ("Doppler").

`gradient` is phase gradient autofocus with the power method for the principal eigenvector: robust for large errors.
`sharpen` maximises sum |I|^4: accurate for small errors. That sum is convex in exp(-j phase): a step to the maximum of
its linear part never decreases it.

Sources: Wahl, Eichel, Ghiglia, Jakowatz, Phase gradient autofocus, IEEE Trans. AES 30(3), 1994; Jakowatz and Wahl,
Eigenvector method for maximum-likelihood estimation of phase errors, JOSA A 10(12), 1993; Ash, An autofocus method for
backprojection imagery, IEEE GRSL 9(1), 2012.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ..base.threads import of_each, threads
from ._phase_smoothing import cosines, detrended

CHUNK = 2**22  # values per FFT call: bounds the memory
FEW = 8  # pulses at a time, whose contributions fit in a processor's cache
LARGE, PARTS = 2**20, 4  # contributions from which their sums are made in parts, by several threads, and how many
POWER_STEPS = 10  # iterations of the power method
NARROWEST = 10.0  # Doppler bins, smallest window of `gradient` about a point
ENOUGH = 1e-4  # relative gain in sharpness of a step, below which no further one is made


def gradient(v: np.ndarray, widths: list[float]) -> np.ndarray:
    """Phase (n,), rad, whose removal focuses the columns of v (n, columns) to points: a pass per width (Doppler bins).

    A pass shifts every column's brightest bin, within +-width/2, to 0, cuts out `width` bins about it, takes
    the phase from pulse to pulse, common to all columns, and refines it as the principal eigenvector of their
    covariance. Columns are weighted by their ratio of point to clutter, which is estimated from the fourth moment.
    """
    n = len(v)
    phase = np.zeros(n)
    for width in widths:
        cut = _windowed(_centered(turned(v, phase), width), width)
        # means in float64, where the square of the least second moment, of empty columns, is not rounded to 0
        second, fourth = ((abs(cut) ** power).mean(axis=0, dtype=np.float64) for power in (2, 4))
        second = np.maximum(second, 1e-30)
        # |a + clutter|: fourth moment over squared second is 2 - (a^2/(a^2 + clutter^2))^2
        point = np.sqrt(np.clip(2 - fourth / second**2, 1e-4, 0.9999))
        cut *= np.sqrt(np.minimum(point / (1 - point), 1e3) / second).astype(np.float32)
        step = np.angle((cut[1:] * cut[:-1].conj()).sum(axis=1))
        estimate = np.concatenate([[0.0], np.cumsum(step)])
        for _ in range(POWER_STEPS):
            estimate = np.angle((cut * turned(cut, estimate).sum(axis=0).conj()).sum(axis=1))
        phase += detrended(np.unwrap(estimate))
    return phase


def focused(v: np.ndarray, middle: np.ndarray, number: int, window: float) -> tuple[np.ndarray, float]:
    """Phase (n,) after pass `number` of a search in contributions v (n, columns), and its gain in sharpness.

    middle  (n, places): contributions at the places themselves;  window  Doppler bins about a point at last
    A pass starts from phase gradient autofocus where that is sharper than no phase, and sharpens: the larger its
    number, the nearer to the points.
    """
    n = len(v)
    widths = [max(n / 2 ** (number + i / 2), NARROWEST) for i in range(8)]
    width = max(n / 4**number, window)
    starts = [np.zeros(n), gradient(middle, widths)]
    levels = [sharpness(v, start, width) for start in starts]
    phase = sharpen(v, starts[int(np.argmax(levels))], width)
    return phase, sharpness(v, phase, width) / max(levels[0], 1e-300)


def sharpen(v: np.ndarray, phase: np.ndarray, width: float, steps: int = 30) -> np.ndarray:
    """The phase (n,) near `phase` where sum |I|^4 over `width` Doppler bins about 0 has its maximum.

    I is the FFT over pulses of v exp(-j phase); for width 0 only its bin 0, the image at the places themselves.
    Stops after `steps`, or when the relative gain of a step is less than ENOUGH.
    """
    before = 0.0
    for _ in range(steps):
        total, pull = 0.0, np.zeros(len(v), np.complex128)
        for columns, image in _images(v, phase, width):
            total += _fourth(image)
            back = _back(image, len(v))
            pull += _like(v, back[0]) if len(back) == 1 else (back.conj() * v[:, columns]).sum(axis=1)
        phase = phase + np.where(pull == 0, 0, np.angle(pull * np.exp(-1j * phase)))
        if total <= before * (1 + ENOUGH):
            break
        before = total
    return phase


def extended(v: np.ndarray, phase: np.ndarray, first: int, last: int) -> np.ndarray:
    """Phase (n,) of all pulses that fits the image of pulses first ... last - 1 at the points, which keep their own."""
    image = _at_points(v[first:last], phase[first:last])
    extension = np.angle(_like(v, _cubed(image)))
    extension[first:last] = phase[first:last]
    return np.asarray(extension)


def sharpness(v: np.ndarray, phase: np.ndarray, width: float) -> float:
    """Sum |I|^4 over `width` Doppler bins, sampled so finely that the position of points between bins has no effect."""
    return sum(_fourth(image) for _, image in _images(v, phase, width))


def range_shift(v: np.ndarray, phase: np.ndarray, width: float, modes: int) -> np.ndarray:
    """Delay of each pulse's echo relative to the image of all pulses, in lags: (n,), smooth, mean 0, within +-1.

    v (n, columns, lags) at lags of half a range cell. The correlation of a pulse with the linear part of sum |I|^4 is
    largest at its delay. One Newton step towards that maximum, fitted by least squares with the curvatures as weights
    to `modes` cosines over the aperture.
    """
    n, _, lags = v.shape
    flat = v.reshape(n, -1)
    fit = np.zeros((3, n))
    for columns, image in _images(flat, phase, width):
        back = _back(image, n).reshape(n, -1, lags)[:, :, 1:-1].conj()  # all lags of a point: see _images
        part = flat[:, columns].reshape(n, -1, lags)
        for i in range(3):
            fit[i] += ((back * part[:, :, i : lags - 2 + i]).sum(axis=(1, 2)) * np.exp(-1j * phase)).real
    slope = (fit[2] - fit[0]) / 2
    bend = np.maximum(2 * fit[1] - fit[2] - fit[0], 1e-3 * np.abs(fit[1]))
    basis = cosines(n, modes)
    normal = (basis * bend[:, None]).T @ basis
    normal += 1e-9 * max(np.trace(normal), 1e-30) * np.eye(len(normal))
    shift = basis @ np.linalg.solve(normal, basis.T @ slope)
    return np.clip(shift - shift.mean(), -1, 1)


def turned(v: np.ndarray, phase: np.ndarray) -> np.ndarray:
    """v (n, columns) with the phase (n,) removed."""
    return np.asarray(v * np.exp(-1j * phase).astype(np.complex64)[:, None])


def _at_points(v: np.ndarray, phase: np.ndarray) -> np.ndarray:
    """The image at the points themselves (columns,): the sum over pulses of v (n, columns) with the phase removed."""
    # NumPy's products of matrices use threads that wait for each other, on a busy machine longer than this takes
    turn = np.exp(-1j * phase).astype(np.complex64)[:, None]

    def image(pulses: slice) -> np.ndarray:
        total = np.zeros(v.shape[1], np.complex64)
        for first in range(pulses.start, pulses.stop, FEW):
            rows = slice(first, min(first + FEW, pulses.stop))
            total += (v[rows] * turn[rows]).sum(axis=0)
        return total

    return np.asarray(sum(of_each(image, _parts(v))))


def _like(v: np.ndarray, image: np.ndarray) -> np.ndarray:
    """Correlation (n,) of every pulse of v (n, columns) with an image (columns,)."""
    other = image.conj()
    return np.concatenate(of_each(lambda pulses: np.array([row @ other for row in v[pulses]]), _parts(v)))


def _parts(v: np.ndarray) -> list[slice]:
    """Pulses in parts, the same on every machine: several where threads pay."""
    n, parts = len(v), PARTS if v.size > LARGE else 1
    return [slice(n * k // parts, n * (k + 1) // parts) for k in range(parts)]


def _length(n: int) -> int:
    """Length of the Doppler axis: 2 n or more, so that |I|^2 is sampled at its Nyquist rate and nothing wraps."""
    import scipy.fft

    return int(scipy.fft.next_fast_len(2 * n))


def _images(v: np.ndarray, phase: np.ndarray, width: float) -> Iterator[tuple[slice, np.ndarray]]:
    """(columns, I (length, columns)) of v (n, columns or columns x lags), block by block of points with all their lags.

    I is zero outside `width` Doppler bins about 0.
    """
    import scipy.fft

    if width == 0:
        yield slice(None), _at_points(v, phase)[None]
        return
    n = len(v)
    length = _length(n)
    half = int(np.ceil(width / 2 * length / n))
    step = max(1, CHUNK // length // 36) * 36  # a multiple of both numbers of lags in use, 1 and 9
    for first in range(0, v.shape[1], step):
        columns = slice(first, first + step)
        image = scipy.fft.fft(turned(v[:, columns], phase), length, axis=0, overwrite_x=True, workers=threads())
        image[half : max(length - half, half)] = 0
        yield columns, image


def _fourth(image: np.ndarray) -> float:
    """Sum |I|^4."""
    power = image.real**2 + image.imag**2
    return float((power * power).sum(dtype=np.float64))


def _back(image: np.ndarray, n: int) -> np.ndarray:
    """Derivative of sum |I|^4: |I|^2 I transformed to pulses (n, columns), or (1, columns) if the same for all."""
    import scipy.fft

    cubed = _cubed(image)
    if len(image) == 1:
        return cubed
    return np.asarray(scipy.fft.ifft(cubed, axis=0, overwrite_x=True, workers=threads())[:n])


def _cubed(image: np.ndarray) -> np.ndarray:
    """|I|^2 I, in place."""
    image *= image.real**2 + image.imag**2
    return image


def _centered(v: np.ndarray, width: float) -> np.ndarray:
    """Columns shifted so that the brightest Doppler bin within +-width/2 comes to bin 0."""
    import scipy.fft

    n = len(v)
    length = 2 * _length(n)
    half = max(1, min(int(width / 2 * length / n), length // 2))
    out = np.empty_like(v)
    step = max(1, CHUNK // length)
    turns = np.exp(-2j * np.pi * np.arange(length) / length).astype(np.complex64)
    for first in range(0, v.shape[1], step):
        part = v[:, first : first + step]
        spectrum = scipy.fft.fft(part, length, axis=0, workers=threads())
        level = spectrum.real**2 + spectrum.imag**2
        level[half : length - half] = 0
        out[:, first : first + step] = part * turns[np.arange(n)[:, None] * level.argmax(axis=0) % length]
    return out


def _windowed(v: np.ndarray, width: float) -> np.ndarray:
    """Columns with all but the `width` Doppler bins about 0 set to zero."""
    import scipy.fft

    n = len(v)
    if width >= n:
        return v
    length = _length(n)  # padded: the last pulse does not leak into the first
    bins = np.minimum(np.arange(length), length - np.arange(length)) * n / length
    out = np.empty_like(v)
    step = max(1, CHUNK // length)
    for first in range(0, v.shape[1], step):
        spectrum = scipy.fft.fft(v[:, first : first + step], length, axis=0, workers=threads())
        spectrum[bins > width / 2] = 0
        out[:, first : first + step] = scipy.fft.ifft(spectrum, axis=0, overwrite_x=True, workers=threads())[:n]
    return out
