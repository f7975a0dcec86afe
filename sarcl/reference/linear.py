"""The echo of points as a matrix, term by term."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from ..base.constants import SPEED_OF_LIGHT
from ..base.vectors import unit
from ..model.phase_history import PhaseHistory
from ..numerics.pulse_geometry import PulseGeometry
from ..scattering.antenna_weights import AntennaWeights
from .equations import excess_delay

STEP = 2e-4
SIXTH_ORDER = ((1, 3 / 4), (2, -3 / 20), (3, 1 / 60))  # f'(0) = sum of w (f(k) - f(-k))


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


def gain_derivatives(antenna: AntennaWeights, points: np.ndarray) -> dict[str, np.ndarray]:
    """Gains (n_rows, n), and their derivatives by "tx", "rx" and "pointing" (n_rows, n, 3) of points, m (n, 3).

    Central differences of sixth order, over 2e-4 of the angle in which gains change by their peak: errors are 1e-12 of
    the largest derivative, but at the knots of a table, where the third derivative jumps, 1e-11.
    """
    geometry, axes = antenna.geometry, antenna.axes
    assert axes is not None
    angle = STEP / max(one.slope(antenna.frequency) for one in antenna.patterns)
    reach = angle * min(np.linalg.norm(end[:, None] - points, axis=-1).min() for end in geometry.ends)

    def gains(moved: AntennaWeights) -> np.ndarray:
        return np.stack([moved.weights(points, p, antenna.frequency) for p in range(len(geometry.tx))])

    def at(kind: str, by: np.ndarray) -> AntennaWeights:
        if kind == "pointing":
            turn = Rotation.from_rotvec(by).as_matrix()
            return replace(antenna, axes=(turn @ axes[0], turn @ axes[1]))
        tx, rx = geometry.tx + by * (kind == "tx"), geometry.rx + by * (kind == "rx")
        return replace(antenna, geometry=PulseGeometry(tx, rx))

    out = {"gains": gains(antenna)}
    for kind, step in (("tx", reach), ("rx", reach), ("pointing", angle)):
        terms = [
            [w / step * (gains(at(kind, k * step * i)) - gains(at(kind, -k * step * i))) for k, w in SIXTH_ORDER]
            for i in np.eye(3)
        ]
        out[kind] = np.sum(terms, axis=1).transpose(1, 2, 0)
    return out


def gradients(
    raw: PhaseHistory,
    points: np.ndarray,
    m: np.ndarray,
    x: np.ndarray,
    y: np.ndarray,
    antenna: AntennaWeights | None = None,
) -> dict[str, np.ndarray]:
    """Derivatives of Re sum conj(y) s, s = m times matrix times x with respect to each parameter.

    m, y  (n_rows, n_samples);  x  (n,);  antenna  gains of the matrix, None: 1

    Returns "positions" (n, 3), "tx", "rx" (n_rows, 3), "reference_range", "phase" (n_rows,), "amplitudes" (n,), float64
    or complex128, and with an antenna "pointing" (n_rows, 3): d s = -j 2 pi f/c d(path) s, where the path grows by the
    cosines of the angles to the antennas, and d s = s d g/g of gains.
    """
    plain = y.conj()[..., None] * m[..., None] * matrix(raw, points) * x  # (p, n, k)
    of_gain = None if antenna is None else gain_derivatives(antenna, points)
    share = np.ones((raw.n_rows, len(points))) if of_gain is None else of_gain["gains"]
    terms = plain * share[:, None]
    frequencies = raw.frequency[:, None] + np.arange(raw.n_samples) * raw.frequency_step[:, None]
    slopes = -2j * np.pi / SPEED_OF_LIGHT * np.einsum("pn,pnk->pk", frequencies, terms)
    to_tx, to_rx = (unit(end[:, None] - points) for end in (raw.tx, raw.rx))
    each = {"tx": slopes[..., None] * to_tx, "rx": slopes[..., None] * to_rx, "pointing": 0 * slopes[..., None]}
    if of_gain is not None:
        each = {kind: value + plain.sum(axis=1)[..., None] * of_gain[kind] for kind, value in each.items()}
    return {kind: value.sum(axis=1).real for kind, value in each.items()} | {
        "positions": -(each["tx"] + each["rx"]).sum(axis=0).real,
        "reference_range": -2 * slopes.sum(axis=1).real,
        "phase": (1j * terms.sum(axis=(1, 2))).real,
        "amplitudes": np.einsum("pnk,pk,pn,pn->k", matrix(raw, points).conj(), share.conj(), m, y),
    }
