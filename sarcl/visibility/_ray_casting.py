"""Occlusion of facets by facets, as seen from a viewpoint anywhere: by cells of a view, or rays through a tree."""

from __future__ import annotations

import numpy as np

from ..base.boxes import box, corners
from ..opencl.device import Device
from ._box_tree import BoxTree
from ._frame import DeviceSamples, Frame
from ._light_buffer import BEHIND, RESOLVED, LightBuffer, sees_from_outside

FEW = 100  # occluders of each facet, from which on rays through a tree take less time than to put them into cells


class Occluders:
    """Facets on a device, m (k, 3, 3), that occlude others: by cells from viewpoints outside, else by a tree.

    n      of the others; where they are few, a tree that serves every viewpoint takes less time than cells of each
    apart  whether no other facet lies in the plane of one of these
    """

    def __init__(self, device: Device, triangles: np.ndarray, frame: Frame, n: int, apart: bool = False) -> None:
        self.device, self.frame, self._few = device, frame, FEW * n < len(triangles)
        self._behind = RESOLVED if apart else BEHIND
        self._corners = ((triangles - frame.center) * frame.unit).astype(np.float32).reshape(-1, 9)
        self._bounds = box(self._corners.reshape(-1, 3)).astype(np.float64)
        self._radius = float(np.linalg.norm(corners(self._bounds), axis=1).max())
        self._uploaded: object = None
        self._tree: BoxTree | None = None
        self._views: list[tuple[np.ndarray, LightBuffer]] = []

    def hide(self, samples: DeviceSamples, viewpoint: np.ndarray, other: np.ndarray) -> None:
        """Set the bits of occluded samples.

        other  the other antenna, m (3,), or `viewpoint`: it decides on which side of a facet that is edge-on to the
               viewpoint its sample points lie
        """
        if not self.by_rays(viewpoint):
            self._buffer(viewpoint).hide(samples, other)
            return
        if self._tree is None:
            self._tree = BoxTree(self.device, self._corners.reshape(-1, 3, 3))
        outside = sees_from_outside(self.frame, self._radius, viewpoint)
        self._tree.hide(samples, viewpoint, other, outside)

    def by_rays(self, viewpoint: np.ndarray) -> bool:
        """Whether rays through a tree tell what a viewpoint, m (3,), sees."""
        return self._few or not sees_from_outside(self.frame, self._radius, viewpoint)

    def _buffer(self, viewpoint: np.ndarray) -> LightBuffer:
        """The light buffer of a viewpoint; the last two are kept."""
        for at, buffer in self._views:
            if np.array_equal(at, viewpoint):
                return buffer
        self._views = self._views[-1:]
        if self._uploaded is None:
            self._uploaded = self.device.upload(self._corners)
        solid = self._uploaded, len(self._corners), self._bounds
        buffer = LightBuffer(self.device, *solid, self.frame, viewpoint, self._behind)
        self._views.append((np.array(viewpoint, np.float64), buffer))
        return buffer
