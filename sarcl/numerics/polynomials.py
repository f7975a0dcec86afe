"""Lagrange polynomials through nodes, and Chebyshev nodes."""

from __future__ import annotations

import numpy as np


def lagrange_shares(knots: np.ndarray, at: np.ndarray) -> np.ndarray:
    """What each of knots (n, order) counts for at places (n,)."""
    out = np.ones(knots.shape)
    for i in range(knots.shape[1]):
        for j in range(knots.shape[1]):
            if i != j:
                out[:, i] *= (at - knots[:, j]) / (knots[:, i] - knots[:, j])
    return out


def lagrange(nodes: np.ndarray, frequencies: np.ndarray) -> np.ndarray:
    """Lagrange's polynomials of nodes, Hz (n,), at frequencies, Hz (m,): (n, m)."""
    out = np.ones((len(nodes), len(frequencies)))
    for i, node in enumerate(nodes):
        for j, other in enumerate(nodes):
            if i != j:
                out[i] *= (frequencies - other) / (node - other)
    return out


def chebyshev(center: float, bandwidth: float, n: int) -> np.ndarray:
    """n nodes over the band, Hz."""
    return center + bandwidth / 2 * np.cos(np.pi * (np.arange(n) + 0.5) / n)
