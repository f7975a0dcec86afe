"""The exact sum at some pixels, fast enough for apertures of thousands of pulses.

`sarcl.reference.backproject` evaluates exp(j 2 pi f_n delay) for every sample. Here f_n = f_0 + n df is split at
n = b c + d, so that exp(j 2 pi f_n delay) = coarse[c] fine[d] costs 2 sqrt(n_samples) exponentials per pixel, and
the sum over samples is a small product of matrices. All in float64; phases are reduced to one cycle in extended
precision. The two agree to 1e-11.
"""

from __future__ import annotations

import itertools
import math
import os
from concurrent.futures import ThreadPoolExecutor

import numpy as np

from ..base.constants import SPEED_OF_LIGHT
from ..model.phase_history import PhaseHistory
from ..reference.geometry import half_path

Errors = tuple[float, float]  # relative to the norm of docs/theory/accuracy.md, and to the norm of the exact result


def relative(values: np.ndarray, wanted: np.ndarray, norm: float) -> Errors:
    """Errors of values against the exact ones, whose norm would be `norm` with random phases."""
    wrong, own = float(np.linalg.norm(values - wanted)), float(np.linalg.norm(wanted))
    return wrong / max(own, norm), wrong / own


def phases(delay: np.ndarray, frequency: float, step: float, n_samples: int) -> tuple[np.ndarray, np.ndarray]:
    """(coarse (m, c), fine (m, b)) with exp(+j 2 pi (frequency + n step) delay) = coarse[:, n // b] fine[:, n % b].

    delay  s, longdouble (m,)
    """
    b = int(2 ** np.ceil(np.log2(max(n_samples, 1)) / 2))
    c = -(-n_samples // b)
    each = (step * delay) % 1
    block, first = ((each * b) % 1).astype(np.float64), ((frequency * delay) % 1).astype(np.float64)
    coarse = np.exp(2j * np.pi * (first[:, None] + block[:, None] * np.arange(c)))
    return coarse, np.exp(2j * np.pi * each.astype(np.float64)[:, None] * np.arange(b))


def backproject(raw: PhaseHistory, points: np.ndarray) -> tuple[np.ndarray, float]:
    """I complex128 (m,) at points, m (m, 3), and its norm if contributions had random phases; on all processors."""
    n = os.cpu_count() or 1
    parts = [raw[a:b] for a, b in itertools.pairwise(np.linspace(0, raw.n_rows, n + 1).astype(int)) if a < b]
    with ThreadPoolExecutor(n) as pool:
        images, norms = zip(*pool.map(lambda part: _backproject(part, points), parts), strict=True)
    return np.sum(images, axis=0), math.hypot(*norms)


def _backproject(raw: PhaseHistory, points: np.ndarray) -> tuple[np.ndarray, float]:
    """As `backproject`, on one processor."""
    image, power = np.zeros(len(points), np.complex128), 0.0
    for p in range(raw.n_rows):
        delay = 2 / np.longdouble(SPEED_OF_LIGHT) * half_path(raw.tx[p], raw.rx[p], points, raw.reference_range[p])
        coarse, fine = phases(delay, float(raw.frequency[p]), float(raw.frequency_step[p]), raw.n_samples)
        samples = np.zeros(coarse.shape[1] * fine.shape[1], np.complex128)
        samples[: raw.n_samples] = raw.read(p, p + 1)[0]
        profile = ((coarse @ samples.reshape(coarse.shape[1], fine.shape[1])) * fine).sum(axis=1)
        profile *= abs(delay) <= 1 / (2 * raw.frequency_step[p])
        image += profile
        power += float((abs(profile) ** 2).sum())
    return image, float(np.sqrt(power))


def echo(
    tx: np.ndarray,
    reference_range: np.ndarray,
    frequency: float,
    step: float,
    n_samples: int,
    positions: np.ndarray,
    amplitudes: np.ndarray,
) -> np.ndarray:
    """s_p(f_n) = sum_k a_k exp(-j 2 pi f_n (tau - tau_ref)), complex64 (n_pulses, n_samples), of points, m (k, 3)."""
    samples = np.empty((len(tx), n_samples), np.complex64)
    for p in range(len(tx)):
        delay = -2 / np.longdouble(SPEED_OF_LIGHT) * half_path(tx[p], tx[p], positions, reference_range[p])
        coarse, fine = phases(delay, frequency, step, n_samples)
        samples[p] = ((coarse * amplitudes[:, None]).T @ fine).ravel()[:n_samples]
    return samples
