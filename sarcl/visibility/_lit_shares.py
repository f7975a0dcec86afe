"""What antennas see of facets at every pulse, and of the ground at every pixel: for labels and masks of images."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ..base import arguments
from ..base.boxes import box
from ..base.validation import instance, number, room
from ..base.vectors import unit
from ..model.image_grid import ImageGrid
from ..model.trajectory import Trajectory, receiver_positions
from ..opencl.choose_device import open_device
from ..opencl.device import DeviceChoice
from ..opencl.memory_budget import budget
from ..scene.scene import Scene
from ..scene.triangles import centroids, normals
from ._frame import DevicePoints, Frame
from ._ray_casting import Occluders
from .lit_parts import FacetPieces, LitParts, ground_of, upper_sides

AT_ONCE = 64  # pulses whose lit parts are computed together
FIRST_LOOKS = 9  # pulses from which pixels are looked at first
PER_PIXEL = 200.0  # bytes, of positions, rows of numbers on the device, and counts
LEFT = 1e-3  # of the pixels, which may change by more than the tolerance


def facet_shares(
    scene: Scene,
    track: Trajectory,
    *,
    receiver: Trajectory | None = None,
    device: DeviceChoice | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> np.ndarray:
    """Share of the area of each facet that both antennas see at each pulse, 0 to 1: float32 (n_pulses, k).

    Exact, as `echo` takes it: facets are clipped along the shadows' edges, and one-sided ones that face away are dark.

    track, receiver  of the transmitter, and of the receiver where it is another one
    device           leaves this to another device on the machine where it has no float64
    progress         called as progress(pulse, pulses)

    ValueError for a scene without facets, or a receiver of another length; MemoryError for more shares than memory
    holds; NoDeviceError where no device has float64. Source: docs/theory/shadows.md.

    >>> box = sarcl.shapes.box((4, 2, 3))
    >>> shares = sarcl.illumination.facet_shares(box, track)
    >>> shares.shape, float(shares.min()), float(shares.max())
    ((64, 12), 0.0, 1.0)
    """
    instance("scene", scene, Scene)
    ends = _ends(track, receiver)
    arguments.progress(progress, "progress(pulse, pulses)")
    k, n = len(scene.triangles), len(ends[0])
    if not k:
        raise ValueError("scene has no facets, and points cast and receive no shadow; give it facets")
    room(f"shares of {k} facets at {n} pulses", 4.0 * k * n, "take fewer pulses: track.picked(slice)")
    opened = open_device(device)
    triangles, out = scene.triangles, np.ones((n, k), np.float32)
    places, normal, one_sided = centroids(triangles), normals(triangles), ~scene.two_sided
    ground = ground_of(scene, ends)
    pieces = FacetPieces.uncut(triangles, scene.two_sided, ground=ground, upper=upper_sides(scene, ground))
    parts = LitParts(opened, pieces, triangles, ends, max_bytes=budget(opened, None) / 4)
    for first in range(0, n, AT_ONCE):
        some = slice(first, min(first + AT_ONCE, n))
        antennas = [end[some] for end in ends]
        out[some, parts.dark] = 0
        out[some, parts.partly] = parts.at(first, antennas, np.zeros(0))[0]
        for end in antennas:
            for pulse, at in enumerate(end, first):
                out[pulse, one_sided & (((at - places) * normal).sum(axis=1) < 0)] = 0
        if progress:
            progress(some.stop, n)
    return out


def pixel_shares(
    scene: Scene, grid: ImageGrid, track: Trajectory, *, receiver: Trajectory | None = None, tolerance: float = 0.02,
    device: DeviceChoice | None = None, progress: Callable[[int, int], None] | None = None,
) -> np.ndarray:  # fmt: skip
    """Share of the pulses at which both antennas see the ground at each pixel, past the facets of a scene, 0 to 1.

    float32, of the shape of the grid; NaN at empty cells. A shadow mask is `pixel_shares(...) < 0.5`. Pixels are where
    the grid puts them: give a grid on the ground (ImageGrid.on_terrain), since those below it are in shadow.

    track, receiver  of the transmitter, and of the receiver where it is another one
    tolerance  looks are taken from more and more pulses, until twice as many change no more than one pixel in 1000 by
               more than this
    device     see `sarcl.devices`
    progress   called as progress(look, looks), of the looks that are taken at that time

    Facets within 1e-6 of the scene's size of a pixel do not hide it. ValueError for a scene without facets, a receiver
    of another length, or a tolerance of 0. Source: docs/theory/shadows.md.

    >>> box = sarcl.shapes.box((4, 2, 3))
    >>> shadow = sarcl.illumination.pixel_shares(box, grid, track) < 0.5
    >>> bool(shadow[64, 64])  # the ground below the box too
    True
    """
    instance("scene", scene, Scene)
    instance("grid", grid, ImageGrid)
    ends = _ends(track, receiver)
    tolerance = number("tolerance", tolerance, above=0)
    arguments.progress(progress, "progress(look, looks)")
    if not len(scene.triangles):
        raise ValueError("scene has no facets, and points cast no shadow; give it facets")
    room(f"looks at {grid.size} pixels", PER_PIXEL * grid.size, "take rows of the grid: ImageGrid.points(grid.at(...))")
    places = grid.positions.reshape(-1, 3)
    filled = np.flatnonzero(np.isfinite(places).all(axis=1))
    opened, n = open_device(device), len(ends[0])
    frame = Frame.around(np.concatenate([scene.triangles.reshape(-1, 3), box(places[filled])]))
    middle = sum(end.mean(axis=0) for end in ends) / len(ends)
    points = DevicePoints(opened, places[filled], frame, unit(middle - places[filled]))
    occluders = Occluders(opened, scene.triangles, frame, len(filled))
    seen, looked = np.zeros(len(filled)), np.zeros(0, np.int64)
    before, looks = None, min(FIRST_LOOKS, n)
    while True:
        pulses = np.unique(np.linspace(0, n - 1, looks).round().astype(np.int64))
        fresh = np.setdiff1d(pulses, looked)
        for i, pulse in enumerate(fresh.tolist()):
            seen += points.seen(occluders, [end[pulse] for end in ends])
            if progress:
                progress(i + 1, len(fresh))
        looked = np.union1d(looked, pulses)
        share = seen / len(looked)
        settled = before is not None and (np.abs(share - before) > tolerance).mean() <= LEFT
        if settled or len(looked) == n:
            break
        before, looks = share, min(2 * looks - 1, n)
    out = np.full(len(places), np.nan, np.float32)
    out[filled] = share
    return out.reshape(grid.shape)


def _ends(track: Trajectory, receiver: Trajectory | None) -> list[np.ndarray]:
    """Positions of the antennas, m (n_pulses, 3), one or two."""
    instance("track", track, Trajectory)
    return [track.positions] if receiver is None else [track.positions, receiver_positions(track, receiver)]
