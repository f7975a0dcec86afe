"""Occlusion of facets by facets, as seen from a viewpoint anywhere: by cells of a view, or rays through a tree."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..base.boxes import box
from ..base.morton import interleaved
from ..opencl.device import Device
from ..opencl.launch_numbers import launch_numbers
from ._frame import STEP, DeviceFacets, Frame
from ._light_buffer import LightBuffer, sees_from_outside

FAR = np.float32(4)  # coordinate of boxes that fill up a node: they are empty, and outside the scene


class Occluders:
    """Facets on a device, m (k, 3, 3), that occlude others: by cells from viewpoints outside, else by a tree."""

    def __init__(self, device: Device, triangles: np.ndarray, frame: Frame) -> None:
        self.device, self.frame = device, frame
        self._corners = ((triangles - frame.center) * frame.unit).astype(np.float32).reshape(-1, 9)
        self._bounds = box(self._corners.reshape(-1, 3)).astype(np.float64)
        self._uploaded: Any = None
        self._tree: BoxTree | None = None
        self._view: tuple[tuple[float, ...], LightBuffer] | None = None

    def hide(
        self, facets: DeviceFacets, index: Any, n: int, points: tuple[Any, int], viewpoint: np.ndarray,
        other: np.ndarray, hidden: Any,
    ) -> None:  # fmt: skip
        """Set the bits of occluded sample points.

        index (n,) int32: facets;  points  (buffer, number) of sample points;  hidden (n,) uint64, a bit per point
        other  the other antenna, m (3,), or `viewpoint`: it decides on which side of a facet that is edge-on to the
               viewpoint its sample points lie
        """
        if sees_from_outside(self.frame, self._bounds, viewpoint):
            self._buffer(viewpoint).hide(facets, index, n, points, other, hidden)
            return
        if self._tree is None:
            self._tree = BoxTree(self.device, self._corners.reshape(-1, 3, 3))
        self._tree.hide(facets, index, n, points, viewpoint, other, hidden)

    def _buffer(self, viewpoint: np.ndarray) -> LightBuffer:
        """The light buffer of a viewpoint; the last one is kept."""
        at = tuple(np.asarray(viewpoint, np.float64).tolist())
        if self._view is None or self._view[0] != at:
            self._view = None
            if self._uploaded is None:
                self._uploaded = self.device.upload(self._corners)
            n = len(self._corners)
            self._view = at, LightBuffer(self.device, self._uploaded, n, self._bounds, self.frame, viewpoint)
        return self._view[1]


class BoxTree:
    """Facets on a device, float32 (k, 3, 3) in units of the frame: a tree of boxes with eight children each."""

    def __init__(self, device: Device, corners: np.ndarray) -> None:
        self.device = device
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
        """Set the bits of occluded sample points: arguments as of `Occluders.hide`."""
        kernel = self.device.kernel("ray_casting.cl", "hidden")
        (*eye, shrink), (place, samples) = facets.frame.eye(viewpoint), points
        numbers = launch_numbers(
            "ray_casting.cl", "hidden", samples=samples, eye=eye, other=facets.frame.eye(other)[:3], shrink=shrink,
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
