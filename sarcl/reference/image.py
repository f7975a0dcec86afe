"""Multilooking, block by block."""

from __future__ import annotations

import numpy as np


def multilook(data: np.ndarray, looks: tuple[int, int]) -> np.ndarray:
    """Mean of |data|^2 over blocks of looks (rows, columns); a remainder is cut off: float64."""
    a, b = looks
    out = np.zeros((data.shape[0] // a, data.shape[1] // b))
    for i in range(out.shape[0]):
        for j in range(out.shape[1]):
            out[i, j] = (np.abs(data[i * a : i * a + a, j * b : j * b + b].astype(np.complex128)) ** 2).mean()
    return out
