"""How scatterers are spread into range profiles: what points and facets have in common."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..base.boxes import box
from ..base.morton import morton_order
from ..numerics.error_bounds import FLOAT32
from ..numerics.plan import LEAST_TOLERANCE, Plan, carrier_steps, cheapest, least
from ..numerics.pulse_geometry import PulseGeometry
from ..numerics.tiles import Tiles, tile_points
from ..opencl.device import Device

PER_TILE = (256, 64)


@dataclass(frozen=True)
class Band:
    """The band of a row of samples: how many, over which bandwidth, Hz, about which carrier, Hz."""

    n_samples: int
    bandwidth: float
    carrier: float

    def least_tolerance(self, n_scatterers: int, tolerance: float) -> float:
        """The smallest tolerance that `plan_tiles` meets.

        tolerance  that is asked for: it says how many scatterers are summed in float32
        """
        steps = carrier_steps(self.carrier, self.n_samples, self.bandwidth)
        return least(self.n_samples, _chunk(n_scatterers, tolerance), steps)


def plan_tiles(
    positions: np.ndarray, center: np.ndarray, antennas: PulseGeometry, bandwidth: float, n_samples: int,
    tolerance: float, least_tolerance: float = LEAST_TOLERANCE,
) -> tuple[Plan, Tiles, np.ndarray]:  # fmt: skip
    """The cheapest plan for scatterers at positions, m (n, 3), about `center`, their tiles and their order in them."""
    order = morton_order(positions)
    made = {n: tile_points(positions, center, n, order) for n in PER_TILE}
    plan = cheapest(
        tolerance,
        [(n, float(tiles.radius.max())) for n, (tiles, _) in made.items()],
        distance=antennas.distance(box(positions)),
        frequency=float(antennas.frequency.max()) + bandwidth / 2,
        bandwidth=bandwidth,
        n_samples=n_samples,
        points_per_row=len(positions),
        chunk=_chunk(len(positions), tolerance),
        least_tolerance=least_tolerance,
        carrier=float(antennas.frequency.mean()),
    )
    return plan, *made[plan.per_tile]


def _chunk(n_scatterers: int, tolerance: float) -> int:
    """Scatterers summed in float32."""
    return min(n_scatterers, max(min(PER_TILE), int(terms(tolerance))))


def splits(device: Device, n_pulses: int, tiles: Tiles) -> int:
    """Partial sums a row: enough work-items for the device."""
    return int(min(max(1, -(-4 * device.info.units // n_pulses)), tiles.n_tiles, 64))


def terms(tolerance: float) -> float:
    """Terms that may join one float32 sum: n like ones err by up to n/2 roundings, a fifth of the tolerance."""
    return 0.2 * tolerance * 2 / FLOAT32.unit
