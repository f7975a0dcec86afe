"""Occlusion of facets by facets, as seen from one viewpoint outside the scene: cells of a perspective view.

All lines of sight end at the viewpoint. Each occluder stands in the cells that it is seen in, and a facet is tested
against the occluders of its own cells.

source   Haines and Greenberg 1986, "The light buffer: a shadow-testing accelerator"
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ..base.boxes import corners as corners_of_box
from ..opencl.device import Device
from ..opencl.launch_numbers import launch_numbers
from ._frame import DeviceSamples, Frame

KERNELS = "light_buffer.cl"
NEAREST = 1.5  # radii of the scene, from its middle: viewpoints nearer than this see it at angles too wide for a plane
CELLS, WIDEST = 2**20, 8.0  # cells, of which each occluder has 8 at most, and one at least
FEWEST, MOST = 16, 2048  # cells along a side
# Of the scene, by which a sample lies behind an occluder that hides it: a facet, its coplanar neighbours and its twin
# do not hide it, from whatever side they are seen; of occluders that lie in no facet's plane, what float32 resolves
BEHIND, RESOLVED = 2e-6, 3e-7
MOST_ENTRIES = 2**25  # occluders in all cells; with more, cells are made larger


class LightBuffer:
    """Facets that occlude others, as one viewpoint sees them; `Occluders` makes it."""

    def __init__(
        self, device: Device, occluders: object, n: int, bounds: np.ndarray, frame: Frame, viewpoint: np.ndarray,
        behind: float = BEHIND,
    ) -> None:  # fmt: skip
        """occluders  float32 (n, 9) on the device;  bounds  (2, 3) of these, in units of the frame"""
        self.device = device
        exact = (np.asarray(viewpoint, np.float64) - frame.center) * frame.unit
        distance = float(np.linalg.norm(exact))
        toward = exact / distance
        axes = np.linalg.svd(toward[None])[2][1:]
        box = corners_of_box(bounds)
        seen = (box @ axes.T) * (distance / (distance - box @ toward))[:, None]
        least, size = seen.min(axis=0), np.maximum(np.ptp(seen, axis=0), 1e-6)
        self._fixed: dict[str, Any] = dict(
            eye=frame.eye(viewpoint)[:3],
            across=axes[0],
            upward=axes[1],
            toward=toward,
            distance=distance,
            least=least,
            behind=behind,
        )
        self._planes = device.empty(64 * n)
        side = np.sqrt(size.prod() / (n * float(np.clip(CELLS / n, 1.0, WIDEST))))
        while True:
            cells = np.clip(np.ceil(size / side), FEWEST, MOST).astype(int)
            self._numbers = self._fixed | {"cells": cells, "per_cell": cells / size}
            total = int(cells.prod())
            counts, self._top = device.zeros(4 * total), device.zeros(4 * total)
            self._run("count_cells", n, occluders, counts, self._top)
            ends = np.cumsum(device.download(counts, np.empty(total, np.int32)), dtype=np.int64)
            if ends[-1] <= MOST_ENTRIES or (cells <= FEWEST).all():
                break
            side *= 2
        begins = np.concatenate([[0], ends[:-1]]).astype(np.int32)
        self._end, self._entries = device.copied(begins), device.empty(8 * max(int(ends[-1]), 1))
        self._run("fill_cells", n, occluders, self._end, self._entries)
        self._run("shadow_planes", n, occluders, self._planes)

    def hide(self, samples: DeviceSamples, other: np.ndarray) -> None:
        """Set the bits of occluded samples: arguments as of `Occluders.hide`."""
        facets, lines = samples.facets, samples.lines
        kernel = self.device.kernel(KERNELS, "shaded", LINES=lines.count)
        numbers = launch_numbers(KERNELS, "view", other=facets.frame.eye(other)[:3], **self._numbers)
        items = max(lines.count // 16, 1) if self.device.info.vector_width == 1 else 1  # ITEM_LINES of the kernel
        buffers = facets.buffer, samples.index, lines.inverses, self._planes, self._end, self._top, self._entries
        self.device.run(kernel, (samples.n, items), None, numbers, *buffers, samples.words)

    def _run(self, kernel: str, n: int, *buffers: object) -> None:
        numbers = launch_numbers(KERNELS, "view", other=np.zeros(3), **self._numbers)
        self.device.run(self.device.kernel(KERNELS, kernel), (n,), None, numbers, *buffers)


def sees_from_outside(frame: Frame, radius: float, viewpoint: np.ndarray) -> bool:
    """Whether a viewpoint, m (3,), is far enough from all that is seen, up to `radius` from the frame's center, in its
    units."""
    at = (np.asarray(viewpoint, np.float64) - frame.center) * frame.unit
    return float(np.sqrt(at @ at)) > NEAREST * radius
