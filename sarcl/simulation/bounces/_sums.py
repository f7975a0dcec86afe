"""Sums over triangles at all frequencies of the samples: one by one, or by a nonuniform FFT.

    s_p(f_n) = sum_k a_k(f_n) exp(-j 2 pi f_n tau_k)

Amplitudes change slowly over the band, since a triangle is short in range: they are computed at Chebyshev nodes f_m.
Their products with exp(-j 2 pi f_0 tau) are spread into one range profile per node, whose spectra are interpolated.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ...numerics.interpolation import Interpolator, interpolator_float64
from ...numerics.polynomials import chebyshev, lagrange

OVERSAMPLE = 2.0
TAPS = (4, 6, 8)  # of the kernels that spread triangles, with errors down to 1e-6
AT_ONCE = 2_000_000  # amplitudes computed together
Amplitudes = Callable[[np.ndarray, np.ndarray], np.ndarray]  # of triangles (n,) at frequencies: (n, n_f, n_pol)


@dataclass(frozen=True, eq=False)
class Delays:
    """Rows p (n,) to which triangles are added, and their delays tau_k, s (n,)."""

    row: np.ndarray
    delay: np.ndarray


def nodes_for(excursion: np.ndarray, error: float, extra: int) -> np.ndarray:
    """Nodes that interpolate exp(j x) over |x| <= excursion, rad (n,), to an error; `extra` more for other factors."""
    out = np.full(len(excursion), 3)
    for _ in range(200):
        is_coarse = 4 * (np.e * excursion / (2 * out)) ** out > error
        if not is_coarse.any():
            break
        out[is_coarse] += 1
    steps = np.where(out < 12, 1, np.where(out < 32, 4, 16))  # few groups of triangles
    return np.asarray(-(-out // steps) * steps + extra)


def add(
    samples: np.ndarray,
    frequencies: np.ndarray,
    delays: Delays,
    amplitudes: Amplitudes,
    nodes: np.ndarray,
    error: float,
) -> None:
    """Add triangles to samples complex128 (rows, n_pol, n_f): `nodes` (n,) of each; error  relative."""
    kernel = next((k for taps in TAPS if (k := interpolator_float64(taps, OVERSAMPLE)).error <= error), None)
    for number in np.unique(nodes).tolist():
        facets = np.flatnonzero(nodes == number)
        if kernel is None or 2 * number >= len(frequencies):
            step = max(1, AT_ONCE // len(frequencies))
            for first in range(0, len(facets), step):
                _add_directly(samples, frequencies, delays, amplitudes, facets[first : first + step])
        else:
            step = max(1, AT_ONCE // number)
            for first in range(0, len(facets), step):
                _add_by_profiles(samples, frequencies, delays, amplitudes, facets[first : first + step], number, kernel)


def _add_directly(
    samples: np.ndarray, frequencies: np.ndarray, delays: Delays, amplitudes: Amplitudes, facets: np.ndarray
) -> None:
    values = amplitudes(facets, frequencies)
    values *= np.exp(-2j * np.pi * (delays.delay[facets, None] * frequencies % 1))[..., None]
    rows = delays.row[facets]
    order = np.argsort(rows, kind="stable")
    rows = rows[order]
    starts = np.flatnonzero(np.append(True, rows[1:] != rows[:-1]))
    samples[rows[starts]] += np.add.reduceat(values[order], starts, axis=0).swapaxes(1, 2)


def _add_by_profiles(
    samples: np.ndarray,
    frequencies: np.ndarray,
    delays: Delays,
    amplitudes: Amplitudes,
    facets: np.ndarray,
    number: int,
    kernel: Interpolator,
) -> None:
    """As `_add_directly`, at evenly spaced frequencies, with amplitudes at `number` nodes, spread by a kernel."""
    n_rows, _, n = samples.shape
    length = int(2 * np.ceil(OVERSAMPLE * n / 2))
    places = delays.delay[facets] * (frequencies[1] - frequencies[0]) * length
    first = np.floor(places - kernel.taps / 2).astype(np.int64) + 1
    weights = kernel.weights(places - first - (kernel.taps - 1) / 2)
    index = delays.row[facets, None] * length + (first[:, None] + np.arange(kernel.taps)) % length
    centre, width = (frequencies[0] + frequencies[-1]) / 2, frequencies[-1] - frequencies[0]
    nodes = chebyshev(centre, width, number)
    values = (
        amplitudes(facets, nodes)
        * np.exp(-2j * np.pi * (delays.delay[facets] * frequencies[n // 2] % 1))[:, None, None]
    )
    basis = lagrange(nodes, frequencies)
    offset = np.arange(n) - n // 2
    basis = basis / kernel.transform(offset / length)
    for m in range(number):
        for j in range(samples.shape[1]):
            spread = (weights * values[:, m, j, None]).ravel()
            flat = [np.bincount(index.ravel(), part, n_rows * length) for part in (spread.real, spread.imag)]
            spectrum = np.fft.fft((flat[0] + 1j * flat[1]).reshape(n_rows, length))
            samples[:, j] += spectrum[:, offset % length] * basis[m]
