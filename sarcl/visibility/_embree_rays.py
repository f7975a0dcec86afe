"""Rays by Embree (package embreex), in place of kernels/ray_casting.cl: faster on few processors, no part of sarcl."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..opencl.device import Device
from ._ray_casting import Facets, Frame

CHUNK = 2**18  # facets at a time: their rays stand in the host's memory


class EmbreeOccluders:
    """Facets, m (k, 3, 3), as those who hide. ImportError without embreex."""

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
        # the scene does not keep what it is made of
        self._mesh = TriangleMesh(self._scene, ((triangles - frame.center) * frame.unit).astype(np.float32))

    def hide(self, facets: Facets, index: Any, n: int, places: Any, viewpoint: np.ndarray, hidden: Any) -> None:
        """Set the bits of hidden samples: as `_ray_casting.Occluders.hide`."""
        samples = places[1]
        row = self.device.download(facets.buffer, np.empty((facets.size, 12), np.float32))
        row = row[self.device.download(index, np.empty(n, np.int32))]
        uv = self.device.download(places[0], np.empty((samples, 2), np.float32))
        eye = (viewpoint - self.frame.center) * self.frame.unit
        found = np.empty((n, samples), np.uint8)
        for first in range(0, n, CHUNK):
            part = row[first : first + CHUNK]
            side = np.sign(np.einsum("ij,ij->i", part[:, 9:], eye - part[:, :3]))[:, None] * part[:, 9:]
            for s, (u, v) in enumerate(uv):
                start = part[:, :3] + u * part[:, 3:6] + v * part[:, 6:9] + side
                ahead = eye - start
                far = np.linalg.norm(ahead, axis=1)
                way = (ahead / far[:, None]).astype(np.float32)
                # what lies beyond the viewpoint hides nothing
                hit = self._scene.run(start.astype(np.float32), way, dists=far.astype(np.float32), query="OCCLUDED")
                found[first : first + CHUNK, s] = hit != -1
        join = self.device.kernel("ray_casting.cl", "join")
        buffer = self.device.upload(found)
        self.device.run(join, (n,), None, buffer, samples, hidden)
        self.device.finish()
