"""Occlusion of facets by facets, as seen from a viewpoint anywhere: rays through a tree of boxes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ..base.boxes import box
from ..base.morton import interleaved
from ..opencl.device import Device
from ..opencl.launch_numbers import launch_numbers
from ..scene.triangles import edges, normals

# Height above a facet at which rays start, relative to its longest edge: so coplanar and touching neighbours, and
# sheets modelled twice, do not occlude one another.
LIFT = 1e-3
# Least height at which rays start, and margin of boxes, relative to the scene: float32 resolves 1e-7 of it
STEP = 1e-6
FAR = np.float32(4)  # coordinate of boxes that fill up a node: they are empty, and outside the scene


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
        self.length = np.maximum.reduce(edges(triangles))
        a = triangles[:, 0]
        lift = np.maximum(LIFT * self.length * frame.unit, STEP)
        parts = (
            (a - frame.center) * frame.unit,
            (triangles[:, 1] - a) * frame.unit,
            (triangles[:, 2] - a) * frame.unit,
            normals(triangles) * lift[:, None],
        )
        self.buffer = device.upload(np.concatenate(parts, axis=1, dtype=np.float32, casting="same_kind"))
        self.side = device.upload(one_sided.astype(np.uint8))


class Occluders:
    """Facets on a device, m (k, 3, 3), that occlude others: a tree of boxes with eight children each."""

    def __init__(self, device: Device, triangles: np.ndarray, frame: Frame) -> None:
        self.device, self.frame = device, frame
        corners = ((triangles - frame.center) * frame.unit).astype(np.float32)
        order = np.argsort(_curve(corners.mean(axis=1)), kind="stable")
        # the last facet fills up the last eight
        corners = corners[np.append(order, np.repeat(order[-1:], -len(order) % 8))]
        leaf = np.ascontiguousarray(corners.reshape(-1, 8, 3, 3).transpose(0, 2, 3, 1))
        low = leaf.min(axis=(1, 3)) - np.float32(2 * STEP)
        high = leaf.max(axis=(1, 3)) + np.float32(2 * STEP)
        levels = []
        while True:
            low, high = (_padded(side).reshape(-1, 8, 3) for side in (low, high))
            levels.append(np.stack([low, high], axis=1).transpose(0, 1, 3, 2))
            if len(low) == 1:
                break
            # boxes that only fill up a node do not extend its parent
            low, high = low.min(axis=1), np.where(high == FAR, -FAR, high).max(axis=1)
        levels.reverse()
        self.depth = len(levels)
        base = np.cumsum([0, *(len(level) for level in levels[:-1])])
        self.leaf = device.upload(leaf)
        self.node = device.upload(np.concatenate(levels))
        self.base = device.upload(base.astype(np.int32))

    def hide(
        self, facets: DeviceFacets, index: Any, n: int, points: Any, viewpoint: np.ndarray, other: np.ndarray,
        hidden: Any,
    ) -> None:  # fmt: skip
        """Set the bits of occluded sample points.

        index (n,) int32: facets;  points  (buffer, number) of sample points;  hidden (n,) uint64, a bit per point
        other  the other antenna, m (3,), or `viewpoint`: it decides on which side of a facet that is edge-on to the
               viewpoint its sample points lie
        """
        kernel = self.device.kernel("ray_casting.cl", "hidden")
        (*eye, shrink), (place, samples) = self.frame.eye(viewpoint), points
        numbers = launch_numbers(
            "ray_casting.cl", "hidden", samples=samples, eye=eye, other=self.frame.eye(other)[:3], shrink=shrink,
            depth=self.depth,
        )  # fmt: skip
        buffers = facets.buffer, index, place, self.leaf, self.node, self.base, hidden
        self.device.run(kernel, (n,), None, numbers, *buffers)


def _curve(points: np.ndarray) -> np.ndarray:
    """Position (n,) of points (n, 3), between -1 and 1, on a space-filling curve (Morton 1966)."""
    return interleaved(np.clip((points + 1) * 2.0**20, 0, 2**21 - 1).astype(np.uint64))


def _padded(rows: np.ndarray) -> np.ndarray:
    """Rows filled up to a multiple of eight with FAR."""
    return np.concatenate([rows, np.full((-len(rows) % 8, *rows.shape[1:]), FAR, rows.dtype)])
