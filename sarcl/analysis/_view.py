"""Antennas in the middle of the rows that saw a point."""

from __future__ import annotations

import numpy as np

from ..model.image import Image

Ends = tuple[np.ndarray, np.ndarray]  # transmitter and receiver, m (3,) each


def ends_at(image: Image, position: np.ndarray) -> Ends:
    """Mean positions of transmitter and receiver over the rows that saw a position, m (3,); image.tx and image.rx
    where all rows saw all pixels, or none saw this one."""
    assert image.tx is not None
    middle = image.tx, image.tx if image.rx is None else image.rx
    if image.aperture is None:
        return middle
    tx, rx, beam, cosine, near, far, weight = np.split(image.aperture, (3, 6, 9, 10, 11, 12), axis=1)
    to_tx, to_rx = position - tx, position - rx
    tx_range = np.linalg.norm(to_tx, axis=1)
    path = (tx_range + np.linalg.norm(to_rx, axis=1)) / 2
    is_seen = (path >= near[:, 0]) & (path <= far[:, 0]) & ((to_tx * beam).sum(axis=1) >= cosine[:, 0] * tx_range)
    share = is_seen * weight[:, 0]
    if not share.any():
        return middle
    return share @ tx / share.sum(), share @ rx / share.sum()
