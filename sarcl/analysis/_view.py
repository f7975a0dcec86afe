"""From where a point was seen: the antennas in the middle of the rows that saw it."""

from __future__ import annotations

import numpy as np

from ..model.image import Image

Ends = tuple[np.ndarray, np.ndarray]  # transmitter and receiver, m (3,) each


def ends_at(image: Image, position: np.ndarray) -> Ends:
    """Mean positions of transmitter and receiver over the rows that saw a position, m (3,); image.tx and image.rx
    where all rows saw all pixels, or none saw this one."""
    assert image.tx is not None
    whole = image.tx, image.tx if image.rx is None else image.rx
    if image.aperture is None:
        return whole
    tx, rx, beam, cosine, near, far, weight = np.split(image.aperture, (3, 6, 9, 10, 11, 12), axis=1)
    away, back = position - tx, position - rx
    there = np.linalg.norm(away, axis=1)
    path = (there + np.linalg.norm(back, axis=1)) / 2
    seen = (path >= near[:, 0]) & (path <= far[:, 0]) & ((away * beam).sum(axis=1) >= cosine[:, 0] * there)
    share = seen * weight[:, 0]
    if not share.any():
        return whole
    return share @ tx / share.sum(), share @ rx / share.sum()
