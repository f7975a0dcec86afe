"""Antennas per pulse as kernels/geometry.clh reads them: extended precision here, pairs of float32 there."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..base import float_pairs
from ..base.constants import SPEED_OF_LIGHT


@dataclass(frozen=True, eq=False)
class Antennas:
    """Antenna positions, m (n, 3), of n rows, and what they mean at the scene's centre.

    rx is None where it equals tx. reference_range m, frequency (of zero phase slope) and frequency_step Hz,
    near and far (range window about the reference, m): each (n,). wrap: profiles repeat instead.
    beam, unit vectors (n, 3), and beam_angle, rad: only points no more than half the angle off a row's direction, as
    its transmitter sees them, have a part in it; None: all have.
    """

    tx: np.ndarray
    rx: np.ndarray | None
    reference_range: np.ndarray
    frequency: np.ndarray
    frequency_step: np.ndarray
    near: np.ndarray
    far: np.ndarray
    wrap: bool = False
    beam: np.ndarray | None = None
    beam_angle: float = 2 * np.pi

    def picked(self, rows: np.ndarray) -> Antennas:
        """These rows, in this order."""
        fields = ("tx", "rx", "reference_range", "frequency", "frequency_step", "near", "far", "beam")
        whole = {name: getattr(self, name) for name in fields}
        some: dict[str, Any] = {name: None if value is None else value[rows] for name, value in whole.items()}
        return replace(self, **some)

    def distance(self, bounds: np.ndarray) -> float:
        """Smallest distance of any antenna from a box (2, 3), m; 0 inside it."""
        ends = [self.tx] if self.rx is None else [self.tx, self.rx]
        return min(float(np.linalg.norm(e - np.clip(e, *bounds), axis=1).min()) for e in ends)

    def depth(self, point: np.ndarray) -> np.ndarray:
        """How far inside its range window every row sees a point, m (n,); negative outside."""
        ends = [self.tx] if self.rx is None else [self.tx, self.rx]
        delta = sum(np.linalg.norm(e - point, axis=1) for e in ends) / len(ends) - self.reference_range
        return np.asarray(np.minimum(delta - self.near, self.far - delta))

    def beam_depth(self, points: np.ndarray, rows: Any = slice(None)) -> np.ndarray:
        """How far inside the beam the transmitters of `rows` see points, m (3,) or (n, 3); negative outside.

        The distance to the cone's surface, at its tip to the tip.
        """
        assert self.beam is not None
        d, half = points - self.tx[rows], self.beam_angle / 2
        along = (d * self.beam[rows]).sum(axis=-1)
        across = np.sqrt(np.maximum((d**2).sum(axis=-1) - along**2, 0))
        inside = along * np.sin(half) - across * np.cos(half)
        ahead = along * np.cos(half) + across * np.sin(half) > 0
        return np.asarray(np.where(ahead, inside, np.copysign(np.hypot(along, across), inside)))

    def packed(self, center: np.ndarray, length: int, start: int, stop: int, lanes: int) -> np.ndarray:
        """Per-pulse array (2, components, n) float32 of rows start ... stop - 1 for profiles of `length` samples.

        n is rounded up to whole vectors of `lanes` by repeating the last row. Lengths are taken in extended
        precision, so that only their small difference from the reference is ever rounded.
        """
        n = -(-(stop - start) // lanes) * lanes
        rows = np.minimum(np.arange(start, start + n), stop - 1)
        c = center.astype(np.longdouble)
        tx = self.tx[rows].astype(np.longdouble) - c
        tx_length = np.sqrt((tx**2).sum(axis=1))
        rx, rx_length = tx, tx_length
        if self.rx is not None:
            rx = self.rx[rows].astype(np.longdouble) - c
            rx_length = np.sqrt((rx**2).sum(axis=1))
        delta = (tx_length + rx_length) / 2 - self.reference_range[rows]  # longdouble, perhaps thousands of kilometres
        kappa = np.longdouble(2) * self.frequency[rows] / SPEED_OF_LIGHT
        sigma = np.longdouble(2) * self.frequency_step[rows] * length / SPEED_OF_LIGHT
        place = delta * sigma
        if self.wrap:
            place = place - length * np.rint(place / length)
        # a centre this far outside the window has no place in a profile; the window test is in metres
        place = np.clip(place, -(2.0**30), 2.0**30)
        turn = delta * kappa - np.rint(delta * kappa)
        near, far = self.near[rows] - delta, self.far[rows] - delta
        components = [*tx.T, tx_length, turn, place, kappa, sigma, near, far]
        if self.rx is not None:
            components += [*rx.T, rx_length]
        if self.beam is not None:
            half = np.full(n, np.longdouble(self.beam_angle) / 2)
            components += [*self.beam[rows].T.astype(np.longdouble), np.cos(half), np.sin(half)]
        return float_pairs.wide(np.stack(components))
