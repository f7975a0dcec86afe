"""Occlusion of facets by facets, as seen from a viewpoint anywhere: by cells of a view, or rays through a tree."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..base.boxes import box
from ..base.morton import interleaved
from ..opencl.device import Device
from ..opencl.launch_numbers import launch_numbers
from ._facet_samples import SampleLines
from ._frame import STEP, DeviceFacets, DevicePoints, Frame
from ._light_buffer import LightBuffer, sees_from_outside

RAY_STEP = 8  # samples that a ray decides on
FEW = 100  # occluders of each facet, from which on rays through a tree take less time than to put them into cells
FAR = np.float32(4)  # coordinate of boxes that fill up a node: they are empty, and outside the scene


class Occluders:
    """Facets on a device, m (k, 3, 3), that occlude others: by cells from viewpoints outside, else by a tree.

    n  of the others; where they are few, a tree that serves every viewpoint takes less time than cells of each
    """

    def __init__(self, device: Device, triangles: np.ndarray, frame: Frame, n: int) -> None:
        self.device, self.frame, self._few = device, frame, FEW * n < len(triangles)
        self._corners = ((triangles - frame.center) * frame.unit).astype(np.float32).reshape(-1, 9)
        self._bounds = box(self._corners.reshape(-1, 3)).astype(np.float64)
        self._uploaded: Any = None
        self._tree: BoxTree | None = None
        self._views: list[tuple[np.ndarray, LightBuffer]] = []

    def hide(
        self, facets: DeviceFacets | DevicePoints, index: Any, n: int, lines: SampleLines, viewpoint: np.ndarray,
        other: np.ndarray, words: Any,
    ) -> None:  # fmt: skip
        """Set the bits of occluded samples.

        index  (n,) int32: facets;  words  uint32 (n, lines.count), a bit per sample
        other  the other antenna, m (3,), or `viewpoint`: it decides on which side of a facet that is edge-on to the
               viewpoint its sample points lie
        """
        if not self._few and sees_from_outside(self.frame, self._bounds, viewpoint):
            self._buffer(viewpoint).hide(facets, index, n, lines, other, words)
            return
        if self._tree is None:
            self._tree = BoxTree(self.device, self._corners.reshape(-1, 3, 3))
        self._tree.hide(facets, index, n, lines, viewpoint, other, words)

    def _buffer(self, viewpoint: np.ndarray) -> LightBuffer:
        """The light buffer of a viewpoint; the last two are kept."""
        for at, known in self._views:
            if np.array_equal(at, viewpoint):
                return known
        self._views = self._views[-1:]
        if self._uploaded is None:
            self._uploaded = self.device.upload(self._corners)
        buffer = LightBuffer(self.device, self._uploaded, len(self._corners), self._bounds, self.frame, viewpoint)
        self._views.append((np.array(viewpoint, np.float64), buffer))
        return buffer


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
        self, facets: DeviceFacets | DevicePoints, index: Any, n: int, lines: SampleLines, viewpoint: np.ndarray,
        other: np.ndarray, words: Any,
    ) -> None:  # fmt: skip
        """Set the bits of occluded samples: arguments as of `Occluders.hide`."""
        kernel = self.device.kernel("ray_casting.cl", "hidden", LINES=lines.count)
        *eye, shrink = facets.frame.eye(viewpoint)
        numbers = launch_numbers(
            "ray_casting.cl", "hidden", step=max(lines.step, RAY_STEP), eye=eye,
            other=facets.frame.eye(other)[:3], shrink=shrink, depth=self.depth,
        )  # fmt: skip
        buffers = facets.buffer, index, facets.kind, lines.places, self.leaf, self.node, self.base, words
        self.device.run(kernel, (n,), None, numbers, *buffers)


def _curve(points: np.ndarray) -> np.ndarray:
    """Position (n,) of points (n, 3), between -1 and 1, on a space-filling curve (Morton 1966)."""
    return interleaved(np.clip((points + 1) * 2.0**20, 0, 2**21 - 1).astype(np.uint64))


def _padded(rows: np.ndarray) -> np.ndarray:
    """Rows filled up to a multiple of eight with FAR."""
    return np.concatenate([rows, np.full((-len(rows) % 8, *rows.shape[1:]), FAR, rows.dtype)])
