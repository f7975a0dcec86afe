"""The equations of the package in the order of a textbook, in float64: delay, echo, image, array, full-wave field.

Waves are exp(+j 2 pi f t), so that a path of delay tau has the phase -2 pi f tau. Delays of far places are longdouble:
whole cycles are removed from phases before these become float64. Tests hold the verbs to these equations, and the other
files of this room take them from here.
"""

from __future__ import annotations

import functools
import math

import numpy as np
from scipy.special import roots_legendre

from ..base.constants import SPEED_OF_LIGHT
from ..base.vectors import unit
from ..scattering.physical_optics import normals_and_areas, polarisation
from .geometry import half_path

# Delays


def excess_delay(tx: np.ndarray, rx: np.ndarray, points: np.ndarray, reference_range: float) -> np.ndarray:
    """tau - tau_ref = (|T - x| + |x - R|)/c - 2 reference_range/c, s longdouble (n,), of points x, m (n, 3).

    tx, rx  T and R, m (3,). Source: docs/theory/accuracy.md; Farooq 2009, equation 2.28, for each of both paths.
    """
    return 2 / np.longdouble(SPEED_OF_LIGHT) * half_path(tx, rx, points, reference_range)


def plane_delay(
    tx: np.ndarray, rx: np.ndarray, points: np.ndarray, center: np.ndarray, reference_range: float
) -> np.ndarray:
    """(|T - c| + |c - R| - (u + v).(x - c))/c - tau_ref, s longdouble (n,): the delay of waves that are plane at c.

    center  c, m (3,); u and v are the unit vectors from c to T and R. Source: Farooq 2009, equations 2.32 and 2.48.
    """
    away = (np.stack([tx, rx]) - center).astype(np.longdouble)
    along = (points - center) @ (away / np.sqrt((away**2).sum(axis=1, keepdims=True))).mean(axis=0)
    shift = half_path(tx, rx, center[None], reference_range)[0]
    return np.asarray(2 / np.longdouble(SPEED_OF_LIGHT) * (shift - along))


# Echoes


def point_echo(
    points: np.ndarray,
    amplitudes: np.ndarray,
    frequencies: np.ndarray,
    tx: np.ndarray,
    rx: np.ndarray,
    reference_range: float,
) -> np.ndarray:
    """s(f) = sum_k a_k exp(-j 2 pi f (tau_k - tau_ref)) at frequencies, Hz (n,), of one antenna pair: complex128 (n,).

    points m (k, 3), amplitudes m (k,), |a|^2 = RCS. Source: Farooq 2009, equation 2.32, of discrete scatterers.
    """
    delay = excess_delay(tx, rx, points, reference_range)
    out = np.zeros(len(frequencies), np.complex128)
    for n, f in enumerate(frequencies):
        cycles = ((np.longdouble(f) * delay) % 1).astype(np.float64)
        out[n] = (amplitudes * np.exp(-2j * np.pi * cycles)).sum()
    return out


def conductor_echo(
    triangle: np.ndarray,
    frequencies: np.ndarray,
    tx: np.ndarray,
    rx: np.ndarray,
    reference_range: float,
    nodes: int = 60,
) -> np.ndarray:
    """s_rt(f) = integral of k/(2 sqrt(pi)) e_r.(2 n x (k_i x e_t)) exp(-j 2 pi f (tau - tau_ref)) dA, m (n_f, 2, 2).

    The current 2 n x H of a conducting facet, m (3, 3), in spherical waves; r received, t sent: 0 is H, 1 is V.
    Source: Franceschetti et al. 1992, equation 2, with the current of physical optics; docs/theory/facets.md.
    """
    points, areas = triangle_nodes(triangle, nodes)
    normal, away, back = normals_and_areas(triangle[None])[0][0], unit(points - tx), unit(rx - points)
    current = [2 * np.cross(normal, np.cross(away, e)) for e in polarisation(away)]
    matrix = np.array([[(e * j).sum(axis=1) for j in current] for e in polarisation(-back)])
    matrix = matrix * ((away @ normal < 0) & (back @ normal > 0)) * areas
    delay = excess_delay(tx, rx, points, reference_range)
    cycles = ((np.longdouble(1) * frequencies[:, None] * delay) % 1).astype(np.float64)
    k = 2 * np.pi * frequencies / SPEED_OF_LIGHT
    return np.einsum("f,fn,rtn->frt", k / (2 * math.sqrt(math.pi)), np.exp(-2j * np.pi * cycles), matrix)


def triangle_nodes(triangle: np.ndarray, n: int) -> tuple[np.ndarray, np.ndarray]:
    """Points, m (n^2, 3), and areas, m^2 (n^2,), whose sums are integrals over a triangle, m (3, 3).

    Gauss-Legendre in both coordinates of the triangle shrunk to its first vertex.
    """
    nodes, weights = _legendre(n)
    s, t = nodes[:, None, None], nodes[None, :, None]
    points = triangle[0] + s * ((1 - t) * (triangle[1] - triangle[0]) + t * (triangle[2] - triangle[0]))
    areas = 2 * normals_and_areas(triangle[None])[1] * nodes[:, None] * weights[:, None] * weights
    return points.reshape(-1, 3), areas.ravel()


@functools.cache
def _legendre(n: int) -> tuple[np.ndarray, np.ndarray]:
    """Gauss-Legendre nodes and weights on [0, 1]."""
    x, w = roots_legendre(n)
    return (x + 1) / 2, w / 2


def matched_filter(samples: np.ndarray, pulse: np.ndarray) -> np.ndarray:
    """Samples (n_rows, n) times the conjugate of a pulse spectrum (n,): complex128. Source: docs/theory/radar.md."""
    return samples.astype(np.complex128) * np.conj(pulse)


# Images


def row_image(samples: np.ndarray, first: float, step: float, delay: np.ndarray) -> np.ndarray:
    """sum_n s_n exp(+j 2 pi f_n (tau - tau_ref)), f_n = first + n step, Hz: complex128 (k,) at k places.

    samples (n,);  delay  tau - tau_ref, s longdouble (k,). Source: docs/theory/accuracy.md.
    """
    cycles = ((first * delay) % 1).astype(np.float64), ((step * delay) % 1).astype(np.float64)
    turn = np.exp(2j * np.pi * (cycles[0][:, None] + cycles[1][:, None] * np.arange(len(samples))))
    return np.asarray((turn * samples).sum(axis=1))


def image(samples: np.ndarray, first: float, step: float, delays: np.ndarray, wrap: bool = False) -> np.ndarray:
    """I(x) = sum_p v_p(x) sum_n s_pn exp(+j 2 pi f_n (tau_p(x) - tau_ref)): complex128 (k,) at k places.

    samples (n_rows, n), delays s longdouble (n_rows, k): those of `excess_delay` make the backprojected image, those of
    `plane_delay`, with wrap, polar format. v_p is 1 where |tau - tau_ref| <= 1/(2 step), else 0; with wrap always 1.
    Source: docs/theory/polar_format.md; Farooq 2009, equation 2.64 without its interpolation.
    """
    seen = wrap | (abs(delays) <= 1 / (2 * step))
    rows = [row_image(row, first, step, delay) for row, delay in zip(samples, delays, strict=True)]
    return np.asarray((seen * rows).sum(axis=0))


# Arrays whose elements send a carrier each


def field(
    elements: np.ndarray, offsets: np.ndarray, weights: np.ndarray, f0: float, times: np.ndarray, points: np.ndarray
) -> np.ndarray:
    """sum_n w_n exp(+j 2 pi f_n (t - |x - x_n|/c)), f_n = f0 + offset: complex128 times.shape + points.shape[:-1].

    elements x_n (n, 3) m and points x (..., 3) m in one frame, offsets (n,) Hz, times s.
    Source: Farooq 2009, equations 3.6 and 3.11, without the far-field approximation.
    """
    times, points = np.asarray(times, np.longdouble), np.asarray(points, np.longdouble)
    out = np.zeros(times.shape + points.shape[:-1], np.complex128)
    for element, offset, weight in zip(np.asarray(elements, np.longdouble), offsets, weights, strict=True):
        delay = np.sqrt(((points - element) ** 2).sum(axis=-1)) / np.longdouble(SPEED_OF_LIGHT)
        cycles = (np.longdouble(f0) + np.longdouble(offset)) * np.subtract.outer(times, delay)
        out += weight * np.exp(2j * np.pi * (cycles - np.rint(cycles)).astype(np.float64))
    return out


def array_factor(
    f0: float, step: float, n: int, spacing: float, cosine: np.ndarray, retarded: np.ndarray
) -> np.ndarray:
    """sum over i < n of exp(j 2 pi i (step (t - r/c) + f0 spacing cosine/c)): depends on range and time, complex128.

    step  Hz;  spacing  m along an axis;  cosine  between axis and direction (...);  retarded  t - r/c, s (...)
    Source: Farooq 2009, equation 3.43 along one axis, where elements stand at -i spacing: - cosine for + cosine.
    """
    cycles = step * np.asarray(retarded) + f0 * spacing * np.asarray(cosine) / SPEED_OF_LIGHT
    return np.asarray(np.exp(2j * np.pi * cycles[..., None] * np.arange(n)).sum(axis=-1))


# Full-wave fields: E at half a cell along its axis, H, times the impedance of vacuum, at half a cell along both others

CYCLIC = ((0, 1, 2), (1, 2, 0), (2, 0, 1))


def before(field: np.ndarray, axis: int) -> np.ndarray:
    """field[i] - field[i - 1] along an axis; beyond the grid fields are 0."""
    return np.diff(field, axis=axis, prepend=0)


def after(field: np.ndarray, axis: int) -> np.ndarray:
    """field[i + 1] - field[i] along an axis; beyond the grid fields are 0."""
    return np.diff(field, axis=axis, append=0)


def update_e(e: np.ndarray, h: np.ndarray, s: float) -> None:
    """E += s curl H, s = c dt/dx; fields (3, nx, ny, nz). Source: docs/theory/full_wave.md, after Yee 1966."""
    for a, b, c in CYCLIC:
        e[a] += s * (before(h[c], b) - before(h[b], c))


def update_h(e: np.ndarray, h: np.ndarray, s: float) -> None:
    """H -= s curl E, s = c dt/dx; fields (3, nx, ny, nz). Source: docs/theory/full_wave.md, after Yee 1966."""
    for a, b, c in CYCLIC:
        h[a] -= s * (after(e[c], b) - after(e[b], c))


def current_sums(
    offset: np.ndarray,
    current: np.ndarray,
    travel: np.ndarray,
    sent: np.ndarray,
    received: np.ndarray,
    tx: np.ndarray,
    rx: np.ndarray,
) -> np.ndarray:
    """sum_n J_n exp(-j k ((|T - y_n| - |T|) - d.y_n) - j k_r (|R - y_n| - |R|)): waveform forming, complex128 (P, F).

    offset, current  cells y from the centre, m (n, 3), and their currents (F, n) in a wave along `travel`, d (3,)
    sent, received   k, rad/m (F,), and k_r (P, F);  tx, rx  T and R from the centre, m (P, 3)
    Source: Zou, Jia and Qiao 2021, equations 4 to 6; docs/theory/waveform_forming.md.
    """
    there, back = (np.linalg.norm(a[:, None] - offset, axis=2) - np.linalg.norm(a, axis=1)[:, None] for a in (tx, rx))
    out = np.empty(received.shape, complex)
    for f, values in enumerate(current):
        paths = sent[f] * (there - offset @ travel) + received[:, f, None] * back
        out[:, f] = np.exp(-1j * paths) @ values.astype(complex)
    return out
