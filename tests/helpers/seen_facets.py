"""Whether an antenna sees the centroids of facets, past facets or a terrain."""

from __future__ import annotations

from sarcl.opencl.choose_device import open_device
from sarcl.scene.triangles import centroids, normals
from sarcl.visibility._aspect_blocks import scene_box
from sarcl.visibility._frame import DevicePoints, Frame
from sarcl.visibility._ray_casting import Occluders
from sarcl.visibility._terrain_horizon import Terrain


def seen_centroids(device, triangles, viewpoint, *, heights=None, by_rays=False):
    """True (k,) where a viewpoint, m (3,), sees the centroid of a facet, m (k, 3, 3).

    heights  (x, y, z) of a terrain, which hides instead of the facets;  by_rays  through a tree from anywhere
    """
    opened = open_device(device)
    frame = Frame.around(scene_box(triangles, heights))
    points = DevicePoints(opened, centroids(triangles), frame, normals(triangles))
    if heights is not None:
        return points.seen(Terrain(opened, heights, frame), [viewpoint])
    return points.seen(Occluders(opened, triangles, frame, 0 if by_rays else len(triangles)), [viewpoint])
