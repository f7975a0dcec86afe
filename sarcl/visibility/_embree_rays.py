"""Occlusion of facets by rays of Embree (optional package embreex): faster than kernels/ray_casting.cl on few cores."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..base.constants import EDGE_ON
from ..base.vectors import dot, unit
from ..opencl.device import Device
from ._frame import DeviceFacets, Frame

CHUNK = 2**18  # facets per array operation: bounds the memory on the host


class EmbreeOccluders:
    """Facets, m (k, 3, 3), that occlude others. Raises ImportError without embreex."""

    def __init__(self, device: Device, triangles: np.ndarray, frame: Frame) -> None:
        try:
            from embreex import rtcore_scene
            from embreex.mesh_construction import TriangleMesh
        except ImportError as exc:
            raise ImportError(
                "engine='embree' needs the package embreex: pip install embreex, or leave it out"
            ) from exc
        self.device, self.frame = device, frame
        self._scene = rtcore_scene.EmbreeScene()
        # kept here: the scene holds no reference to its mesh
        self._mesh = TriangleMesh(self._scene, ((triangles - frame.center) * frame.unit).astype(np.float32))

    def hide(
        self, facets: DeviceFacets, index: Any, n: int, points: Any, viewpoint: np.ndarray, other: np.ndarray,
        hidden: Any,
    ) -> None:  # fmt: skip
        """Set the bits of occluded sample points: arguments as of `_ray_casting.Occluders.hide`."""
        samples = points[1]
        row = self.device.download(facets.buffer, np.empty((facets.size, 12), np.float32))
        row = row[self.device.download(index, np.empty(n, np.int32))]
        uv = self.device.download(points[0], np.empty((samples, 2), np.float32))
        eye, beside = ((at - self.frame.center) * self.frame.unit for at in (viewpoint, other))
        found = np.empty((n, samples), np.uint8)
        for first in range(0, n, CHUNK):
            part = row[first : first + CHUNK]
            normal = unit(part[:, 9:])
            above, below = (dot(normal, unit(end - part[:, :3])) for end in (eye, beside))
            side = np.sign(np.where(np.abs(above) <= 2 * EDGE_ON, above + below, above))[:, None] * part[:, 9:]
            for s, (u, v) in enumerate(uv):
                start = part[:, :3] + u * part[:, 3:6] + v * part[:, 6:9] + side
                ahead = eye - start
                far = np.linalg.norm(ahead, axis=1)
                way = (ahead / far[:, None]).astype(np.float32)
                # facets beyond the viewpoint do not occlude
                hit = self._scene.run(start.astype(np.float32), way, dists=far.astype(np.float32), query="OCCLUDED")
                found[first : first + CHUNK, s] = hit != -1
        join = self.device.kernel("ray_casting.cl", "join")
        buffer = self.device.upload(found)
        self.device.run(join, (n,), None, buffer, samples, hidden)
        self.device.finish()
