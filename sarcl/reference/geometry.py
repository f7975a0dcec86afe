"""Half the two-way path less the reference range, in extended precision."""

from __future__ import annotations

import numpy as np


def half_path(tx: np.ndarray, rx: np.ndarray, points: np.ndarray, reference_range: float) -> np.ndarray:
    """(|tx - x| + |x - rx|)/2 - reference_range, m (n,), of points x, m (n, 3); one antenna pair, m (3,)."""
    x = points.astype(np.longdouble)
    tx_range = np.sqrt(((x - tx) ** 2).sum(axis=-1))
    rx_range = np.sqrt(((x - rx) ** 2).sum(axis=-1))
    return (tx_range + rx_range) / 2 - np.longdouble(reference_range)
