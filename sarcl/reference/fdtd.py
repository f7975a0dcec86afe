"""Layers, bodies and incident waves of a Yee grid: kernels/fdtd_vacuum.cl, fdtd_lists.cl and fdtd_coupled.cl.

Fields are float64 (3, nx, ny, nz): component a of E stands at half a cell along axis a, of H at half a cell along the
other two. H is the magnetic field times the impedance of vacuum. Fields, `old` and `psi` are changed in place. Cells of
lists are given as places in the raveled field.
"""

from __future__ import annotations

import numpy as np

from .equations import CYCLIC, after, before, update_e


def absorb(
    to: np.ndarray, source: np.ndarray, psi: np.ndarray, axis: int, beta: np.ndarray, gamma: np.ndarray, s: float
) -> None:
    """The correction by layers that absorb along an axis: E (to) from H (source) with s > 0, H from E with s < 0.

    psi  (2, nx, ny, nz);  beta, gamma  of each cell along the axis, gamma 0 outside the layers
    """
    a, b, c = CYCLIC[axis]
    difference = before if s > 0 else after
    along = tuple(slice(None) if n == axis else None for n in range(3))
    for part, (target, field, sign) in enumerate(((b, c, -1), (c, b, 1))):
        psi[part] = beta[along] * psi[part] + gamma[along] * difference(source[field], a)
        to[target] += sign * s * psi[part]


def edges(e: np.ndarray, at: np.ndarray, share: np.ndarray, old: np.ndarray) -> np.ndarray:
    """E = p E_old + q E at places `at` (n,), share (2, n) holds p and q: the change of E, (n,)."""
    vacuum = e.flat[at]
    old[:] = share[0] * old + share[1] * vacuum
    e.flat[at] = old
    return np.asarray(old - vacuum)


def couple(
    e: np.ndarray, h: np.ndarray, at: np.ndarray, weight: np.ndarray, late: np.ndarray, lagging: np.ndarray,
    keep: float, s: float,
) -> np.ndarray:  # fmt: skip
    """E += sum of weights (4, n) times s curl H of the edges across those at places `at` (n,), plus what lags behind,
    late <- keep late + (1 - keep) times the same sum by weights `lagging` (4, n): what was added, (n,).
    """
    curl = np.zeros_like(h)
    update_e(curl, h, s)
    added = _across(curl, at, weight)
    late[:] = keep * late + (1 - keep) * _across(curl, at, lagging)
    e.flat[at] += added + late
    return added + late


def _across(curl: np.ndarray, at: np.ndarray, weight: np.ndarray) -> np.ndarray:
    """Sum of weights (4, n) times the curl (3, *shape) at the edges across those at places `at` (n,)."""
    added = np.zeros(len(at))
    component, *node = np.unravel_index(at, curl.shape)
    for a, b, c in CYCLIC:
        of_component = component == a
        cell = [x[of_component] for x in node]
        for along, first in ((b, 0), (c, 2)):
            for ahead in (0, 1):
                for side in (0, 1):
                    place = (x + (n == a) * ahead - (n == along) * side for n, x in enumerate(cell))
                    added[of_component] += weight[first + ahead][of_component] * curl[(along, *place)]
    return added


def faces(e: np.ndarray, h: np.ndarray, at: np.ndarray, weight: np.ndarray, old: np.ndarray, s: float) -> np.ndarray:
    """H = H_old - s (weighted sum of E about the face) at places `at` (n,), weight (4, n): the change of H, (n,)."""
    vacuum = h.flat[at]
    a, *cell = np.unravel_index(at, h.shape)
    b, c = (a + 1) % 3, (a + 2) % 3
    padded = np.pad(e, ((0, 0), (0, 1), (0, 1), (0, 1)))

    def edge(component: np.ndarray, along: np.ndarray | None) -> np.ndarray:
        return np.asarray(padded[(component, *(x if along is None else x + (along == n) for n, x in enumerate(cell)))])

    old -= s * (weight[0] * edge(c, b) - weight[1] * edge(c, None) - weight[2] * edge(b, c) + weight[3] * edge(b, None))
    h.flat[at] = old
    return np.asarray(old - vacuum)


def incident(field: np.ndarray, at: np.ndarray, values: np.ndarray, rest: np.ndarray, amount: np.ndarray) -> None:
    """Field += amount u at places `at` (n,): u from 6 values (n, 6) at -2 ... 3, read at `rest` (n,)."""
    u = np.zeros(len(at))
    for i, node in enumerate(range(-2, 4)):
        others = [other for other in range(-2, 4) if other != node]
        u += values[:, i] * np.prod([(rest - other) / (node - other) for other in others], axis=0)
    field.flat[at] += amount * u


def transform(residual: np.ndarray, times: np.ndarray, omega: np.ndarray) -> np.ndarray:
    """sum_b r_b exp(-j omega_f t_b) of residuals (n_steps, n): complex128 (n_frequencies, n)."""
    return np.asarray(np.exp(-1j * np.outer(omega, times)) @ residual)
