"""The image of plane waves, term by term, and the spreading of samples on a grid."""

from __future__ import annotations

import numpy as np

from ..model.phase_history import PhaseHistory
from ..numerics.interpolation import Interpolator
from .equations import plane_delay, row_image


def polar_format(
    raw: PhaseHistory,
    points: np.ndarray,
    center: np.ndarray,
    sample_weight: np.ndarray | None = None,
    row_weight: np.ndarray | None = None,
) -> tuple[np.ndarray, float]:
    """I(x) = sum_p sum_n s_p(f_n) exp(+j 2 pi f_n (tau - tau_ref)) at points, m (n, 3), for waves plane at `center`.

    Returns I complex128 (n,) and the norm it would have if samples had random phases.
    """
    sample_weight = np.ones(raw.n_samples) if sample_weight is None else sample_weight
    row_weight = np.ones(raw.n_rows) if row_weight is None else row_weight
    image, power = np.zeros(len(points), np.complex128), 0.0
    for p in range(raw.n_rows):
        delay = plane_delay(raw.tx[p], raw.rx[p], points, center, raw.reference_range[p])
        samples = raw.read(p, p + 1)[0] * (sample_weight * row_weight[p])
        image += row_image(samples, raw.frequency[p], raw.frequency_step[p], delay)
        power += float((abs(samples) ** 2).sum())
    return image, float(np.sqrt(len(points) * power))


def spread(samples: np.ndarray, position: np.ndarray, kernel: Interpolator, length: tuple[int, int]) -> np.ndarray:
    """Samples (n,) at positions (n, 2), in cells, on a grid complex128 of `length` that repeats: kernels/nufft2d.cl."""
    out = np.zeros(length, np.complex128)
    first = np.floor(position).astype(int) - kernel.taps // 2 + 1
    weights = kernel.weights(position % 1 - 0.5)
    for i in range(kernel.taps):
        for j in range(kernel.taps):
            at = (first[:, 0] + i) % length[0], (first[:, 1] + j) % length[1]
            np.add.at(out, at, samples * weights[:, 0, i] * weights[:, 1, j])
    return out
