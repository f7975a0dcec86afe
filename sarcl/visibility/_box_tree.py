"""A tree of boxes with eight children each, whose leaves hold eight facets: rays through it decide what is hidden."""

from __future__ import annotations

import numpy as np

from ..base.morton import interleaved
from ..opencl.device import Device
from ..opencl.launch_numbers import launch_numbers
from ._frame import STEP, DeviceSamples

RAY_STEP = 8  # samples that a ray decides on
FAR = np.float32(1e30)  # coordinate of boxes that fill up a node: no line reaches them


class BoxTree:
    """Facets on a device, float32 (k, 3, 3) in units of the frame: a tree of boxes with eight children each.

    order  (n,) int64: which of the facets stands at each place of the leaves, eight in each
    """

    def __init__(self, device: Device, corners: np.ndarray) -> None:
        self.device = device
        order = np.argsort(_curve(corners.mean(axis=1)), kind="stable")
        # the last facet fills up the last eight
        self.order = np.append(order, np.repeat(order[-1:], -len(order) % 8))
        corners = corners[self.order]
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

    def hide(self, samples: DeviceSamples, viewpoint: np.ndarray, other: np.ndarray, probe: bool) -> None:
        """Set the bits of occluded samples: arguments as of `Occluders.hide`.

        probe  lines of sight from a facet's corners and centre decide where they agree: no narrow shadows are expected
        """
        facets, lines, file = samples.facets, samples.lines, "ray_casting.cl"
        kernel = self.device.kernel(file, "hidden", LINES=lines.count)
        *eye, shrink = facets.frame.eye(viewpoint)
        step, other_eye = max(lines.step, RAY_STEP), facets.frame.eye(other)[:3]
        numbers = launch_numbers(
            file, "hidden", step=step, eye=eye, other=other_eye, shrink=shrink, depth=self.depth, probe=probe
        )
        buffers = facets.buffer, samples.index, facets.kind, lines.places, self.leaf, self.node, self.base
        self.device.run(kernel, (samples.n,), None, numbers, *buffers, samples.words)


def _curve(points: np.ndarray) -> np.ndarray:
    """Position (n,) of points (n, 3), between -1 and 1, on a space-filling curve (Morton 1966)."""
    return interleaved(np.clip((points + 1) * 2.0**20, 0, 2**21 - 1).astype(np.uint64))


def _padded(rows: np.ndarray) -> np.ndarray:
    """Rows filled up to a multiple of eight with FAR."""
    return np.concatenate([rows, np.full((-len(rows) % 8, *rows.shape[1:]), FAR, rows.dtype)])
