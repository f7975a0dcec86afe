"""The echo of points as a matrix, term by term."""

from __future__ import annotations

import numpy as np

from ..base.constants import SPEED_OF_LIGHT
from ..base.vectors import unit
from ..model.phase_history import PhaseHistory
from .equations import excess_delay


def matrix(
    raw: PhaseHistory,
    points: np.ndarray,
    wrap: bool = False,
    beam: tuple[float, np.ndarray] | None = None,
    share: np.ndarray | float = 1.0,
) -> np.ndarray:
    """v_p(x) g_p(x) exp(-j 2 pi f_pn (tau - tau_ref)), complex128 (n_rows, n_samples, n), of points x, m (n, 3).

    v_p is 1 in the range window and in the beam: (full angle, rad, and directions, (n_rows, 3), from tx)
    share  g_p(x), (n, n_rows)
    Phases are reduced in extended precision.
    """
    share = np.broadcast_to(share, (len(points), raw.n_rows))
    out = np.empty((raw.n_rows, raw.n_samples, len(points)), np.complex128)
    for p in range(raw.n_rows):
        delay = excess_delay(raw.tx[p], raw.rx[p], points, raw.reference_range[p])
        seen = wrap | (abs(delay) * (2 * raw.frequency_step[p]) <= 1)
        if beam is not None:
            away, toward = points - raw.tx[p], beam[1][p]
            reach = np.linalg.norm(away, axis=1) * np.linalg.norm(toward)
            seen = seen & (away @ toward >= np.cos(beam[0] / 2) * reach)
        frequencies = raw.frequency[p] + np.arange(raw.n_samples, dtype=np.longdouble) * raw.frequency_step[p]
        cycles = ((frequencies[:, None] * delay) % 1).astype(np.float64)
        out[p] = np.exp(-2j * np.pi * cycles) * seen * share[:, p]
    return out


def spread(raw: PhaseHistory, points: np.ndarray, amplitudes: np.ndarray, wrap: bool = False) -> np.ndarray:
    """s_p(f_n) = sum_x v_p(x) a(x) exp(-j 2 pi f_pn (tau - tau_ref)), complex128 (n_rows, n_samples)."""
    return np.asarray(matrix(raw, points, wrap) @ amplitudes)


def gradients(
    raw: PhaseHistory, points: np.ndarray, m: np.ndarray, x: np.ndarray, y: np.ndarray
) -> dict[str, np.ndarray]:
    """Derivatives of Re sum conj(y) s, s = m times matrix times x with respect to each parameter.

    m, y  (n_rows, n_samples);  x  (n,)

    Returns "positions" (n, 3), "tx", "rx" (n_rows, 3), "reference_range", "phase" (n_rows,), "amplitudes" (n,), float64
    or complex128: d s = -j 2 pi f/c d(path) s, where the path grows by the cosines of the angles to the antennas.
    """
    terms = y.conj()[..., None] * m[..., None] * matrix(raw, points) * x  # (p, n, k)
    frequencies = raw.frequency[:, None] + np.arange(raw.n_samples) * raw.frequency_step[:, None]
    slopes = -2j * np.pi / SPEED_OF_LIGHT * np.einsum("pn,pnk->pk", frequencies, terms)
    to_tx, to_rx = (unit(end[:, None] - points) for end in (raw.tx, raw.rx))
    return {
        "positions": -np.einsum("pk,pki->ki", slopes, to_tx + to_rx).real,
        "tx": np.einsum("pk,pki->pi", slopes, to_tx).real,
        "rx": np.einsum("pk,pki->pi", slopes, to_rx).real,
        "reference_range": -2 * slopes.sum(axis=1).real,
        "phase": (1j * terms.sum(axis=(1, 2))).real,
        "amplitudes": np.einsum("pnk,pn,pn->k", matrix(raw, points).conj(), m, y),
    }
