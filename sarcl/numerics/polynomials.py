"""Lagrange polynomials through nodes, and Chebyshev nodes."""

from __future__ import annotations

import numpy as np


def lagrange(nodes: np.ndarray, at: np.ndarray) -> np.ndarray:
    """Lagrange polynomials at positions (m,) through nodes (n,), or through nodes (n, m) of each position: (n, m)."""
    out = np.ones((len(nodes), len(at)))
    for i, node in enumerate(nodes):
        for j, other in enumerate(nodes):
            if i != j:
                out[i] *= (at - other) / (node - other)
    return out


def chebyshev(center: float, width: float, n: int) -> np.ndarray:
    """The n Chebyshev nodes of an interval, from its upper end down, in the unit of its centre and width."""
    return center + width / 2 * np.cos(np.pi * (np.arange(n) + 0.5) / n)
