"""Facets on a device in the coordinates of a scene, float32, with the points from which light is looked for."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ..base.boxes import box
from ..opencl.device import Device
from ..scene.triangles import BLOCK, edges, normals
from ._facet_samples import SampleLines

if TYPE_CHECKING:
    from ._ray_casting import Occluders

# Height above a facet at which rays start, relative to the scene: float32 resolves 1e-7 of it. Coplanar neighbours, and
# sheets that are modelled twice, do not occlude one another.
STEP = 1e-6
ONE_SIDED, ALL_SAMPLES = 1, 2  # bits of a facet's kind, as in the kernels
FEW = 4096  # facets; in smaller scenes every facet gets all its samples
# times the lower quartile of the edges: a shadow may fall wholly between the probes of facets longer than this
LARGE = 4


def box_of(*triangles: np.ndarray) -> np.ndarray:
    """The box of all corners of triangles, m (k, 3, 3) each, one of them not empty: (2, 3)."""
    return box(np.concatenate([box(some.reshape(-1, 3)) for some in triangles if len(some)]))


@dataclass(frozen=True, eq=False)
class Frame:
    """Coordinates of facets in float32: (x - center) unit, at most 1 for all corners; unit is a power of two, 1/m."""

    center: np.ndarray
    unit: float

    @classmethod
    def around(cls, points: np.ndarray) -> Frame:
        """The smallest frame that holds points, m (n, 3)."""
        corners = box(points)
        half = float((corners[1] - corners[0]).max()) / 2
        return cls(corners.mean(axis=0), 2.0 ** -np.ceil(np.log2(half)) if half else 1.0)

    @property
    def lift(self) -> float:
        """Height above a facet at which rays start, m."""
        return STEP / self.unit

    def eye(self, viewpoint: np.ndarray) -> tuple[np.float32, np.float32, np.float32, np.float32]:
        """A viewpoint, m (3,), in the frame, and the power of two that scales its distance to about 1."""
        at = (np.asarray(viewpoint, np.float64) - self.center) * self.unit
        shrink = 2.0 ** -np.ceil(np.log2(max(float(np.abs(at).max()), 1.0)))
        x, y, z = at.astype(np.float32)
        return x, y, z, np.float32(shrink)


class DeviceFacets:
    """Facets on a device, m (k, 3, 3), whose illumination is computed.

    frame      holds all that can occlude them too
    one_sided  (k,) bool: not illuminated from behind
    """

    def __init__(self, device: Device, triangles: np.ndarray, frame: Frame, one_sided: np.ndarray) -> None:
        self.device, self.frame, self.size = device, frame, len(triangles)
        length = np.maximum.reduce(edges(triangles))
        large = length > LARGE * np.quantile(length, 0.25) if len(length) > FEW else np.ones(len(length), bool)
        rows = np.empty((len(triangles), 12), np.float32)
        for first in range(0, len(triangles), BLOCK):  # so few at a time stay in the processor's cache
            block = triangles[first : first + BLOCK]
            a, out = block[:, 0], rows[first : first + BLOCK]
            out[:, :3] = (a - frame.center) * frame.unit
            out[:, 3:6] = (block[:, 1] - a) * frame.unit
            out[:, 6:9] = (block[:, 2] - a) * frame.unit
            out[:, 9:] = normals(block) * STEP
        self.buffer = device.upload(rows)
        self.kind = device.upload((ONE_SIDED * one_sided + ALL_SAMPLES * large).astype(np.uint8))


class DevicePoints:
    """Points on a device, m (n, 3), looked at from antennas; `up` unit vectors (n, 3) out of the ground, about."""

    def __init__(self, device: Device, places: np.ndarray, frame: Frame, up: np.ndarray) -> None:
        self.device, self.frame, self.size = device, frame, len(places)
        rows = np.zeros((max(len(places), 1), 12), np.float32)
        rows[: len(places), :3], rows[: len(places), 9:] = (places - frame.center) * frame.unit, up * STEP
        self.buffer = device.upload(rows)
        self.kind = device.upload(np.full(len(rows), ALL_SAMPLES, np.uint8))
        self._index = device.upload(np.arange(len(rows), dtype=np.int32))
        self._line = SampleLines.of_points(device)

    def seen(self, occluders: Occluders, viewpoints: list[np.ndarray]) -> np.ndarray:
        """Points that all viewpoints, m (3,), see past `occluders` (n,) bool."""
        words = self.device.zeros(4 * max(self.size, 1))
        samples = DeviceSamples(self, self._index, self.size, self._line, words)
        for at, other in zip(viewpoints, viewpoints[::-1], strict=True):
            occluders.hide(samples, at, other)
        return self.device.download(words, np.empty(max(self.size, 1), np.uint32))[: self.size] == 0


@dataclass(frozen=True, eq=False)
class DeviceSamples:
    """Samples on lines of n facets or points, whose occlusion is noted on the device.

    index  (n,) int32: of the facets;  words  uint32 (n, lines.count), a bit per sample: both buffers
    """

    facets: DeviceFacets | DevicePoints
    index: object
    n: int
    lines: SampleLines
    words: object
