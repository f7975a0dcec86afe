"""Sample points of facets, on lines parallel to an edge: each represents an equal part of the area."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ..opencl.device import Device

FEWEST_LINES, MOST_LINES, PER_LINE = (
    16,
    256,
    32,
)  # lines of a facet, and samples on each, as in kernels/facet_points.clh


def line_places(n: int) -> np.ndarray:
    """Places v of n lines that fill a facet evenly, (n,)."""
    return np.asarray(1 - np.sqrt(1 - (np.arange(n) + 0.5) / n))


def sample_points(n: int) -> np.ndarray:
    """Barycentric coordinates of the samples on n lines, line by line (32 n, 2)."""
    v = np.repeat(line_places(n), PER_LINE)
    return np.stack([(1 - v) * np.tile((np.arange(PER_LINE) + 0.5) / PER_LINE, n), v], axis=1)


@dataclass(frozen=True, eq=False)
class SampleLines:
    """Lines of samples on a device: places v, and 1/(1 - v), float32 (count,).

    step  samples that one line of sight decides on, where they are looked along one by one: all 32 of a point
    """

    places: Any
    inverses: Any
    count: int
    step: int = 1

    @classmethod
    def of_facets(cls, device: Device, n: int) -> SampleLines:
        """n lines of facets: 16, 32, 64, 128 or 256."""
        v = line_places(n)
        return cls(device.upload(v.astype(np.float32)), device.upload((1 / (1 - v)).astype(np.float32)), n)

    @classmethod
    def of_points(cls, device: Device) -> SampleLines:
        """Of points: one line of sight each."""
        return cls(device.upload(np.zeros(1, np.float32)), device.upload(np.ones(1, np.float32)), 1, PER_LINE)
