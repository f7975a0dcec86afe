"""Antenna positions per pulse, and the records of them that kernels/geometry.clh reads.

Lengths are computed in extended precision here, and handed over as pairs of float32.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from ..base import float_pairs
from ..base.boxes import corners
from ..base.constants import SPEED_OF_LIGHT
from ..base.vectors import unit

UNLIMITED = 1e30  # m: a limit of a range window that no range reaches and that float32 holds
PER_PULSE = ("reference_range", "frequency", "frequency_step", "near", "far")


def half_path(tx: np.ndarray, rx: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Half the path from transmitters over points to receivers, m: all (..., 3), broadcast."""
    tx_range = np.linalg.norm(tx - points, axis=-1)
    return np.asarray(tx_range if rx is tx else (tx_range + np.linalg.norm(rx - points, axis=-1)) / 2)


@dataclass(frozen=True, eq=False)
class PulseGeometry:
    """Positions of transmitter and receiver at each of n pulses, and how the range profiles of these pulses lie.

    tx, rx           m (n, 3); a receiver that has the transmitter's positions is stored as `tx` itself
    reference_range  m (n,), range of zero phase
    frequency        Hz (n,), at which the phase along a profile has no slope;  frequency_step  Hz (n,), of its samples
    near, far        m (n,), range window about the reference range; default no limits
    wrap             range profiles repeat beyond the window
    beam             unit vectors (n, 3), and beam_angle, rad: only points within half the angle of a pulse's
                     direction, as its transmitter sees them, contribute to it; None: all do
    forward          the receiver sees what the transmitter lights from all sides (forward scatter of facets)
    runs             (first, stop) of each run of consecutive pulses along which the antennas move smoothly, where known
    """

    tx: np.ndarray
    rx: np.ndarray
    reference_range: np.ndarray = field(default_factory=lambda: np.zeros(()))
    frequency: np.ndarray = field(default_factory=lambda: np.zeros(()))
    frequency_step: np.ndarray = field(default_factory=lambda: np.zeros(()))
    near: np.ndarray = field(default_factory=lambda: np.full((), -UNLIMITED))
    far: np.ndarray = field(default_factory=lambda: np.full((), UNLIMITED))
    wrap: bool = False
    beam: np.ndarray | None = None
    beam_angle: float = 2 * np.pi
    runs: tuple[tuple[int, int], ...] = ()
    forward: bool = False

    def __post_init__(self) -> None:
        if self.rx is not self.tx and np.array_equal(self.rx, self.tx):
            object.__setattr__(self, "rx", self.tx)
        if self.rx is self.tx:
            object.__setattr__(self, "forward", False)
        for name in PER_PULSE:
            object.__setattr__(self, name, np.broadcast_to(getattr(self, name), len(self.tx)))

    @classmethod
    def sampled(
        cls, tx: np.ndarray, rx: np.ndarray, reference_range: np.ndarray, *, first: Any, step: Any, n_samples: int,
        window: tuple[Any, Any], **others: Any,
    ) -> PulseGeometry:  # fmt: skip
        """Geometry of pulses that have n_samples samples in frequency, from `first` on and `step` apart, Hz.

        window (near, far), m, about the reference range; these, first and step: (n,), or the same for all pulses
        """
        frequency, step, near, far = map(np.asarray, (first + n_samples // 2 * step, step, *window))
        return cls(tx, rx, reference_range, frequency, step, near, far, **others)

    def __len__(self) -> int:
        return len(self.tx)

    @property
    def is_monostatic(self) -> bool:
        """Whether the receiver stands where the transmitter does, at every pulse."""
        return self.rx is self.tx

    @property
    def ends(self) -> list[np.ndarray]:
        """Positions m (n, 3) of the transmitter, and of the receiver where they differ: the distinct ends of paths."""
        return [self.tx] if self.is_monostatic else [self.tx, self.rx]

    def picked(self, rows: np.ndarray) -> PulseGeometry:
        """The pulses `rows`, in this order. What remains of `runs` is not known."""
        fields: dict[str, Any] = {name: getattr(self, name)[rows] for name in ("tx", *PER_PULSE)}
        fields["rx"] = fields["tx"] if self.is_monostatic else self.rx[rows]
        return replace(self, **fields, beam=None if self.beam is None else self.beam[rows], runs=())

    def mean_direction(self, point: np.ndarray) -> np.ndarray:
        """Mean of the unit vectors from a point, m (3,), to both antennas, (n, 3): minus the gradient of half the path.

        NaN where an antenna stands at the point.
        """
        with np.errstate(invalid="ignore"):
            return np.asarray(sum(unit(end - point) for end in self.ends) / len(self.ends))

    def half_path(self, point: np.ndarray) -> np.ndarray:
        """Half the two-way path of every pulse to a point (3,), m (n,)."""
        return half_path(self.tx, self.rx, point)

    def distance(self, bounds: np.ndarray) -> float:
        """Smallest distance of any antenna from a box (2, 3), m; 0 inside it."""
        return min(float(np.linalg.norm(e - np.clip(e, *bounds), axis=1).min()) for e in self.ends)

    def depth(self, point: np.ndarray) -> np.ndarray:
        """Distance of a point (3,) from the nearer limit of each pulse's range window, m (n,); negative outside."""
        delta = self.half_path(point) - self.reference_range
        return np.asarray(np.minimum(delta - self.near, self.far - delta))

    def holds(self, bounds: np.ndarray) -> bool:
        """Whether a box, m (2, 3), lies in the range window of every pulse: the path over its corners is the longest,
        and that over the points nearest to the antennas at most the shortest."""
        shortest = sum(np.linalg.norm(end - np.clip(end, *bounds), axis=1) for end in self.ends) / len(self.ends)
        longest = half_path(self.tx, self.rx, corners(bounds)[:, None]).max(axis=0)
        inside = (shortest - self.reference_range >= self.near) & (longest - self.reference_range <= self.far)
        return bool(inside.all())

    def beam_depth(self, points: np.ndarray, rows: slice | int | np.ndarray = slice(None)) -> np.ndarray:
        """Distance of points, m (3,) or (n, 3), from the surface of the beams of pulses `rows`; negative outside.

        Behind the transmitter it is the distance from the cone's tip.
        """
        assert self.beam is not None
        d, half = points - self.tx[rows], self.beam_angle / 2
        along = (d * self.beam[rows]).sum(axis=-1)
        across = np.sqrt(np.maximum((d**2).sum(axis=-1) - along**2, 0))
        inside = along * np.sin(half) - across * np.cos(half)
        ahead = along * np.cos(half) + across * np.sin(half) > 0
        return np.asarray(np.where(ahead, inside, np.copysign(np.hypot(along, across), inside)))

    def packed(self, center: np.ndarray, length: int, start: int, stop: int, lanes: int) -> np.ndarray:
        """Records (2, components, n) float32 of pulses start ... stop - 1 for range profiles of `length` samples.

        n is rounded up to whole vectors of `lanes` by repeating the last pulse. Lengths are taken in extended
        precision, so that only their small difference from the reference is ever rounded.
        """
        n = -(-(stop - start) // lanes) * lanes
        rows = np.minimum(np.arange(start, start + n), stop - 1)
        c = center.astype(np.longdouble)
        tx = self.tx[rows].astype(np.longdouble) - c
        tx_length = np.sqrt((tx**2).sum(axis=1))
        rx, rx_length = tx, tx_length
        if not self.is_monostatic:
            rx = self.rx[rows].astype(np.longdouble) - c
            rx_length = np.sqrt((rx**2).sum(axis=1))
        delta = (tx_length + rx_length) / 2 - self.reference_range[rows]  # longdouble, perhaps thousands of kilometres
        kappa = np.longdouble(2) * self.frequency[rows] / SPEED_OF_LIGHT
        sigma = np.longdouble(2) * self.frequency_step[rows] * length / SPEED_OF_LIGHT
        position = delta * sigma
        if self.wrap:
            position = position - length * np.rint(position / length)
        # positions this far outside a profile only have to stay finite: points outside the window are tested in metres
        position = np.clip(position, -(2.0**30), 2.0**30)
        cycle = delta * kappa - np.rint(delta * kappa)
        near, far = self.near[rows] - delta, self.far[rows] - delta
        components = [*tx.T, tx_length, cycle, position, kappa, sigma, near, far]
        if not self.is_monostatic:
            components += [*rx.T, rx_length]
        if self.beam is not None:
            half = np.full(n, np.longdouble(self.beam_angle) / 2)
            components += [*self.beam[rows].T.astype(np.longdouble), np.cos(half), np.sin(half)]
        return float_pairs.wide(np.stack(components))
