"""Sample points of facets, on lines parallel to an edge: each represents an equal part of the area."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..opencl.device import Device

FEWEST_LINES, MOST_LINES = 16, 256  # of a facet
PER_LINE = 32  # samples, as in kernels/facet_points.clh


def line_places(n: int) -> np.ndarray:
    """Places v of n lines that fill a facet evenly, (n,)."""
    return np.asarray(1 - np.sqrt(1 - (np.arange(n) + 0.5) / n))


def line_shifts(n: int) -> np.ndarray:
    """By how many samples those of n lines lie off the middle, -0.45 to 0.45 (n,): multiples of the golden ratio, which
    fill this evenly for any n (Weyl's sequence)."""
    return np.asarray(0.9 * (np.arange(n) * (np.sqrt(5) - 1) / 2 % 1 - 0.5))


def sample_points(n: int) -> np.ndarray:
    """Barycentric coordinates of the samples on n lines, line by line (32 n, 2)."""
    v = np.repeat(line_places(n), PER_LINE)
    along = (np.arange(PER_LINE) + 0.5 + line_shifts(n)[:, None]) / PER_LINE
    return np.stack([(1 - v) * along.ravel(), v], axis=1)


@dataclass(frozen=True, eq=False)
class SampleLines:
    """Lines of samples on a device: places v, and 1/(1 - v), both with the shifts, float32 (2, count).

    step  samples that one line of sight decides on, where they are looked along one by one: all 32 of a point
    """

    places: object
    inverses: object
    count: int
    step: int = 1

    @classmethod
    def of_facets(cls, device: Device, n: int) -> SampleLines:
        """n lines of facets: 16, 32, 64, 128 or 256."""
        v, shifts = line_places(n), line_shifts(n)
        places, inverses = (np.stack([row, shifts]).astype(np.float32) for row in (v, 1 / (1 - v)))
        return cls(device.upload(places), device.upload(inverses), n)

    @classmethod
    def of_points(cls, device: Device) -> SampleLines:
        """Of points: one line of sight each."""
        places, inverses = (np.array([[v], [0.0]], np.float32) for v in (0, 1))
        return cls(device.upload(places), device.upload(inverses), 1, PER_LINE)
