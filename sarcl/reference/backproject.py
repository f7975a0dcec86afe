"""The image equation, term by term."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..base.constants import SPEED_OF_LIGHT
from ..model.phase_history import PhaseHistory
from .equations import excess_delay


class PerPoint(NamedTuple):
    """Weights of rows in each point, such as those of a tapered beam, and m added to half the paths: (n, n_rows)."""

    share: np.ndarray | float = 1.0
    longer: np.ndarray | float = 0.0


def backproject(
    raw: PhaseHistory,
    points: np.ndarray,
    sample_weight: np.ndarray | None = None,
    row_weight: np.ndarray | None = None,
    wrap: bool = False,
    beam: tuple[float, np.ndarray] | None = None,
    edge: float = 0.0,
    per_point: PerPoint | None = None,
) -> tuple[np.ndarray, float]:
    """I(x) = sum_p v_p(x) sum_n s_p(f_n) exp(+j 2 pi f_n (tau - tau_ref)) at points, m (n, 3).

    v_p(x) is 1 in the range window and in the beam: (full angle, rad, and directions, (3,) or (n_rows, 3), from tx).
    Points nearer than `edge` to the edge of a window (relative to half of it) or beam (rad) come out NaN: rounding
    may put them on either side.

    Returns I complex128 (n,) and the norm it would have if contributions had random phases.
    """
    # n = width a + b: exp(j 2 pi n s) is a product of one power for each digit, which takes far fewer exponentials
    width = int(np.ceil(np.sqrt(raw.n_samples)))
    digits = np.arange(-(-raw.n_samples // width)) * width, np.arange(width)
    padding = digits[0].size * width - raw.n_samples
    sample_weight = np.ones(raw.n_samples) if sample_weight is None else sample_weight
    row_weight = np.ones(raw.n_rows) if row_weight is None else row_weight
    share, longer = (np.broadcast_to(v, (len(points), raw.n_rows)) for v in per_point or PerPoint())
    image, power = np.zeros(len(points), np.complex128), np.zeros(len(points))
    clear = np.ones(len(points), bool)
    for p in range(raw.n_rows):
        delay = excess_delay(raw.tx[p], raw.rx[p], points, raw.reference_range[p])
        delay = delay + 2 / np.longdouble(SPEED_OF_LIGHT) * longer[:, p]
        position = abs(delay) * (2 * raw.frequency_step[p])
        seen = wrap | (position <= 1)
        clear &= wrap | (abs(position - 1) >= edge)
        if beam is not None:
            toward = np.broadcast_to(beam[1], (raw.n_rows, 3))[p]
            away = points - raw.tx[p]
            reach = np.linalg.norm(away, axis=1) * np.linalg.norm(toward)
            ahead = away @ toward - np.cos(beam[0] / 2) * reach
            seen = seen & (ahead >= 0)
            clear &= abs(ahead) >= edge * max(np.sin(beam[0] / 2), edge) * reach
        samples = raw.read(p, p + 1)[0] * (sample_weight * row_weight[p])
        # the carrier's cycles are reduced in extended precision, the rest in float64
        first = (raw.frequency[p] * delay) % 1
        step = (raw.frequency_step[p] * delay) % 1
        high, low = (np.exp(2j * np.pi * (step.astype(np.float64)[:, None] * n)) for n in digits)
        sums = np.einsum("pa,ab,pb->p", high, np.pad(samples, (0, padding)).reshape(-1, width), low)
        profile = np.exp(2j * np.pi * first.astype(np.float64)) * sums * seen * share[:, p]
        image += profile
        power += abs(profile) ** 2
    image[~clear] = np.nan
    return image, float(np.sqrt(power[clear].sum()))
