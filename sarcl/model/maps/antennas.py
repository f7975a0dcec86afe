"""Positions of the antennas that saw a part of an image, from the geometry that the image keeps."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ...base.vectors import Floats

if TYPE_CHECKING:
    from ..image import Image

Ends = tuple[np.ndarray, np.ndarray]  # transmitter and receiver, m (3,) each


def antennas_of(image: Image, what: str, positions: Floats) -> Ends:
    """Transmitter and receiver that saw each of some positions, m (n, 3) each: as `ends_at`; for an image by
    `range_doppler` where they pass the position, on a straight line. ValueError, which begins with `what`, where the
    image does not know its antennas."""
    if image.tx is None:
        raise ValueError(
            f"{what} needs the antennas' positions, which this image does not have; give them with "
            "dataclasses.replace(image, tx=..., rx=...), Earth-fixed, m"
        )
    rx = image.tx if image.rx is None else image.rx
    if image.aperture is not None:
        both = [ends_at(image, position) for position in positions]
        return np.array([tx for tx, _ in both]), np.array([rx for _, rx in both])
    if image.grid.times is None or image.tx_velocity is None:
        return np.broadcast_to(image.tx, positions.shape), np.broadcast_to(rx, positions.shape)
    along = image.tx_velocity / np.linalg.norm(image.tx_velocity)
    ahead = ((positions - image.tx) @ along)[:, None] * along
    return image.tx + ahead, rx + ahead


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
