"""Shares of facets that given viewpoints see: sample points on facets, tested for occlusion by facets and terrain."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..opencl.device import Device
from ..opencl.launch_numbers import launch_numbers
from ._aspect_blocks import scene_box
from ._facet_samples import PROBES, SAMPLES, sample_points
from ._frame import DeviceFacets, Frame
from ._ray_casting import Occluders
from ._terrain_horizon import Horizons, Terrain

FEW = 4096  # facets; in smaller scenes every facet gets all its samples
# times the lower quartile of the edges: a shadow may fall wholly between the probes of facets longer than this
LARGE = 4
CHUNK = 2**22  # facets per call of the kernels: bounds the memory


class IlluminationSolver:
    """A scene on a device, prepared to compute which share of each facet viewpoints see. Arguments as of `lit`."""

    def __init__(
        self,
        device: Device,
        triangles: np.ndarray,
        *,
        heights: Any = None,
        on_heights: np.ndarray | None = None,
        two_sided: np.ndarray | bool = True,
        wanted: np.ndarray | None = None,
        tolerance: float = 0.25,
        by_facets: np.ndarray | bool = True,
        occluders: np.ndarray | None = None,
    ) -> None:
        self.device, k = device, len(triangles)
        on = np.full(k, heights is not None) if on_heights is None else on_heights
        solid = triangles[~on] if occluders is None else np.reshape(occluders, (-1, 3, 3))
        self.frame = frame = Frame.around(scene_box(np.concatenate([triangles, solid]), heights))
        self.terrain = None if heights is None else Terrain(device, heights, frame)
        one_sided = np.broadcast_to(~np.asarray(two_sided), k)
        self.facets = DeviceFacets(device, triangles, frame, one_sided)
        self.occluders: Any = None
        self._by_facets = np.broadcast_to(np.asarray(by_facets), k)
        if self._by_facets.any() and len(solid):
            self.occluders = Occluders(device, solid, frame)
        length = self.facets.length
        large = length > LARGE * np.quantile(length, 0.25) if k > FEW else np.ones(k, bool)
        keep = np.ones(k, bool) if wanted is None else wanted
        points = sample_points(next(n for n, error in SAMPLES if error <= tolerance))
        self.n_samples = len(points)
        self._samples = (device.upload(points), len(points))
        self._probes = (device.upload(PROBES), len(PROBES))
        if self.n_samples <= len(PROBES):
            large = np.ones(k, bool)
        self._large, self._small = np.flatnonzero(keep & large), np.flatnonzero(keep & ~large)

    def share(self, viewpoints: list[np.ndarray], slack: float = 0.0) -> np.ndarray:
        """Shares of facets that all viewpoints, m (3,), see: uint8 (k,), 255 for a whole facet, 0 where not wanted.

        slack  rad; a one-sided facet counts as back-facing where it is turned away by more than this
        """
        out = np.zeros(len(self.facets.length), np.uint8)
        horizons = [None if self.terrain is None else self.terrain.sweep(v) for v in viewpoints]
        partly = [self._large]
        for part in self._chunks(self._small):
            seen = self._count(part, self._probes, viewpoints, horizons, slack)
            out[part] = np.where(seen == len(PROBES), 255, 0)
            partly.append(part[(seen > 0) & (seen < len(PROBES))])
        for part in self._chunks(np.concatenate(partly)):
            seen = self._count(part, self._samples, viewpoints, horizons, slack)
            out[part] = np.rint(seen * (255 / self.n_samples))
        return out

    def _count(
        self, index: np.ndarray, points: tuple[Any, int], viewpoints: list[np.ndarray],
        horizons: list[Horizons | None], slack: float,
    ) -> np.ndarray:  # fmt: skip
        """Number of sample points of each facet in `index` that all viewpoints see, uint8 (n,).

        index   facets that are all occluded by facets, or all by the terrain alone
        points  buffer of barycentric coordinates, and their number
        """
        device, n = self.device, len(index)
        if n == 0:
            return np.zeros(0, np.uint8)
        which, hidden = device.upload(index.astype(np.int32)), device.empty(8 * n)
        face = device.kernel("ray_casting.cl", "face")
        for first, viewpoint in enumerate(viewpoints):
            numbers = launch_numbers(
                "ray_casting.cl", "face", eye=self.frame.eye(viewpoint)[:3], slack=slack, fresh=first == 0
            )
            device.run(face, (n,), None, numbers, self.facets.buffer, which, self.facets.side, hidden)
        for viewpoint, other, horizon in zip(viewpoints, viewpoints[::-1], horizons, strict=True):
            if horizon is not None:
                horizon.hide(self.facets, which, n, points, other, hidden)
            if self.occluders is not None and self._by_facets[index[0]]:
                self.occluders.hide(self.facets, which, n, points, viewpoint, other, hidden)
        seen = device.empty(n)
        device.run(device.kernel("ray_casting.cl", "seen"), (n,), None, hidden, points[1], seen)
        return device.download(seen, np.empty(n, np.uint8))

    def _chunks(self, index: np.ndarray) -> list[np.ndarray]:
        """Facets in parts that `_count` takes."""
        by_facets = self._by_facets[index]
        kinds = index[by_facets], index[~by_facets]
        return [kind[i : i + CHUNK] for kind in kinds for i in range(0, len(kind), CHUNK)]
