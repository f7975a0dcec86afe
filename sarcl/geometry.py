"""Antennas and tiles of points as kernels/geometry.clh wants them: extended precision here, float32 pairs there."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from . import cl
from .check import SPEED_OF_LIGHT
from .scene import box


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
        return cl.wide(np.stack(components))


@dataclass(frozen=True, eq=False)
class Tiles:
    """Points in tiles of `per_tile`, each about its own reference, so that float32 carries them.

    references  m about the scene's centre (n_tiles, 3), float64
    radius      m (n_tiles,): distance of the farthest point of the tile
    offsets     m, hi then lo parts (6, n_points) float32; one tile's points when `shared`
    shared      every tile has the same offsets
    """

    per_tile: int
    references: np.ndarray
    radius: np.ndarray
    offsets: np.ndarray
    shared: bool

    @property
    def n_tiles(self) -> int:
        return len(self.references)

    def tile_offsets(self, tiles: np.ndarray) -> np.ndarray:
        """Offsets of these tiles only, (6, n_points)."""
        if self.shared:
            return self.offsets
        return self.offsets.reshape(6, -1, self.per_tile)[:, tiles].reshape(6, -1)


def tile_points(
    positions: np.ndarray, center: np.ndarray, per_tile: int, order: np.ndarray | None = None
) -> tuple[Tiles, np.ndarray]:
    """Tiles of points, m (n, 3), near one another along a space-filling curve, and the order of the points.

    The order has whole tiles; the last point fills up the last tile. Give `order` where it is known.
    """
    order = morton_order(positions) if order is None else order
    n_tiles = -(-len(order) // per_tile)
    order = np.concatenate([order, np.repeat(order[-1:], n_tiles * per_tile - len(order))])
    local = (positions[order] - center).reshape(n_tiles, per_tile, 3)
    references = (local.min(axis=1) + local.max(axis=1)) / 2
    offsets = local - references[:, None]
    radius = np.sqrt((offsets**2).sum(axis=-1).max(axis=1))
    packed = cl.wide(offsets.reshape(-1, 3).T).reshape(6, -1)
    return Tiles(per_tile, references, radius, packed, shared=False), order


def morton_order(positions: np.ndarray) -> np.ndarray:
    """Order of points (n, 3) along the Z curve of the cube that holds them (1024 cells a side and more)."""
    low, high = box(positions)
    extent = float((high - low).max()) or 1.0
    cell = ((positions - low) * ((2**20 - 1) / extent)).astype(np.uint64)
    return np.argsort(interleaved(cell), kind="stable")


def interleaved(cell: np.ndarray) -> np.ndarray:
    """Place on the Z curve (Morton 1966) of cells (n, 3), uint64 below 2^21: uint64 (n,)."""
    code = np.zeros(len(cell), np.uint64)
    for axis in range(3):
        x = cell[:, axis]
        for shift, mask in (
            (32, 0x1F00000000FFFF),
            (16, 0x1F0000FF0000FF),
            (8, 0x100F00F00F00F00F),
            (4, 0x10C30C30C30C30C3),
            (2, 0x1249249249249249),
        ):
            x = (x | (x << np.uint64(shift))) & np.uint64(mask)
        code |= x << np.uint64(axis)
    return code
