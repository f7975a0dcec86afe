"""Scenes that no pulse can see, refused before anything is planned: outside the range window or the antennas' beams.

The bounds hold for whole boxes of scatterers. For an antenna at T with axes x ahead, y azimuth, z elevation, the limits
of a pattern say that its gain is 0 where d_y > limit |d|, d = point - T, alike on the other sides, and behind. As
limit |d| - d_y is convex in the point, it is negative all over a box if it is so at the corners. The half path is
convex too: it is largest at a corner.
"""

from __future__ import annotations

import numpy as np

from ..base.boxes import box, corners
from ..base.errors import NothingSeen
from ..base.rows import spread_over
from ..model.waveform import Waveform
from ..numerics.pulse_geometry import PulseGeometry
from ..scattering.antenna_weight_error import out_of_beam
from ..scattering.antenna_weights import AntennaWeights
from ..scene.scene import Scene
from ..scene.triangles import centroids

NO_GAIN = 1e-180  # of the peak: the square of a smaller gain is 0 in float64
HEIGHTS = 10.0  # standard deviations: no random height of a facet is larger
CELLS = 16  # per axis: boxes that a scene is divided into where the box of all is not conclusive
PULSES = 256  # per block
SAMPLES = 64  # scatterers, and pulses, that are tested first: more are tested only where none of these is in the beam

OUTSIDE_WINDOW = (
    "every scatterer is outside the range window of {:g} to {:g} m about the reference; widen range_window or move "
    "reference"
)
OUTSIDE_BEAM = "no scatterer in the range window is ever in the beam; aim the antenna with sarcl.pointing"


def refuse_unseen(
    scene: Scene, weights: AntennaWeights, waveform: Waveform, antennas: PulseGeometry, gated: bool, margin: float
) -> None:
    """NothingSeen where bounds prove that no pulse sees any of the scene; a scene that may be seen is never refused.

    gated   scatterers outside the range window contribute nothing
    margin  m: elements of an array stand up to this far from the positions in `antennas`
    """
    if weights.pair is None and not gated:
        return
    bounds = _Bounds(weights, waveform, antennas, gated, margin + HEIGHTS * float(scene.roughness.max(initial=0.0)))
    places = scene.positions
    if len(scene.triangles):
        places = np.concatenate([places, centroids(scene.triangles)])
    few = places[spread_over(len(places), SAMPLES)]
    pulses = spread_over(len(antennas), SAMPLES)
    if not len(few) or np.logical_and(*bounds.may_see(few[:, None], pulses)).any():
        return
    extent = box(np.concatenate([scene.positions, scene.triangles.reshape(-1, 3)]))
    ever_in_window = ever_in_beam = False
    cells: np.ndarray | None = None
    for start in range(0, len(antennas), PULSES):
        pulses = np.arange(start, min(start + PULSES, len(antennas)))
        in_window, in_beam = bounds.may_see(corners(extent)[None], pulses)
        unsure = pulses[(in_window & in_beam)[:, 0]]
        if len(unsure):
            cells = _cells(scene, places) if cells is None else cells
            in_window, in_beam = bounds.may_see(cells, unsure)
            if (in_window & in_beam).any():
                return
        ever_in_window, ever_in_beam = ever_in_window or bool(in_window.any()), ever_in_beam or bool(in_beam.any())
    if not ever_in_window:
        raise NothingSeen(OUTSIDE_WINDOW.format(float(antennas.near.min()), float(antennas.far.max())))
    raise NothingSeen(OUTSIDE_BEAM if ever_in_beam else out_of_beam(weights, scene))


class _Bounds:
    """Whether pulses may see boxes."""

    def __init__(
        self, weights: AntennaWeights, waveform: Waveform, antennas: PulseGeometry, gated: bool, margin: float
    ) -> None:
        self.weights, self.antennas, self.gated, self.margin = weights, antennas, gated, margin
        band = [waveform.center + side * waveform.bandwidth / 2 for side in (-1, 1)]
        self.limits = [np.max([one.limits(NO_GAIN, f) for f in band], axis=0) for one in weights.patterns]

    def may_see(self, boxes: np.ndarray, pulses: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Whether boxes, corners m (n, k, 3), may lie in the range windows and in the beams of pulses: (pulses, n)."""
        window, beam = np.ones((2, len(pulses), len(boxes)), bool)
        if self.gated:
            window = self._in_window(boxes, pulses)
        if self.weights.axes is not None:
            ends = self.weights.geometry.tx, self.weights.geometry.rx
            for limits, axes, end in zip(self.limits, self.weights.axes, ends, strict=False):
                beam &= self._in_beam(boxes, end[pulses], axes[pulses], limits)
        return window, beam

    def _in_window(self, boxes: np.ndarray, pulses: np.ndarray) -> np.ndarray:
        antennas, low, high = self.antennas, boxes.min(axis=1), boxes.max(axis=1)
        nearest, farthest = np.zeros((2, len(pulses), len(boxes)))
        for ends in antennas.ends:
            end = ends[pulses, None]
            nearest += np.linalg.norm(end - np.clip(end, low, high), axis=-1) / len(antennas.ends)
            corner = np.linalg.norm(end[:, :, None] - boxes, axis=-1)
            farthest += corner.max(axis=-1) / len(antennas.ends)
        reference, room = antennas.reference_range[pulses, None], 2 * self.margin  # of the scatterer and the reference
        near, far = antennas.near[pulses, None] - room, antennas.far[pulses, None] + room
        return np.asarray((farthest - reference >= near) & (nearest - reference <= far))

    def _in_beam(self, boxes: np.ndarray, ends: np.ndarray, axes: np.ndarray, limits: np.ndarray) -> np.ndarray:
        along = (boxes - ends[:, None, None]) @ axes[:, None]  # (pulses, boxes, corners, 3)
        distance = np.linalg.norm(along, axis=-1)
        x, out = along[..., 0], np.zeros(along.shape[:2], bool)
        for axis, limit in ((1, limits[0]), (2, limits[1])):
            for side in (-1, 1):  # a shift by the margin changes both terms by no more than it
                room = self.margin * (1 + limit)
                out |= (side * along[..., axis] > limit * distance + room).all(axis=-1)
        if limits[2]:
            out |= (x < -self.margin).all(axis=-1)
        return ~out


def _cells(scene: Scene, places: np.ndarray) -> np.ndarray:
    """Corners (n, 8, 3) of boxes that together hold a scene of scatterers at `places`, over CELLS x CELLS squares."""
    low, high = box(places)
    size = np.maximum(high - low, 1e-9)[:2]
    index = np.minimum((places[:, :2] - low[:2]) / size * CELLS, CELLS - 1).astype(int) @ [CELLS, 1]
    least = np.concatenate([scene.positions, scene.triangles.min(axis=1)])
    most = np.concatenate([scene.positions, scene.triangles.max(axis=1)])
    order = np.argsort(index, kind="stable")
    starts = np.flatnonzero(np.diff(index[order], prepend=-1))
    lows, highs = np.minimum.reduceat(least[order], starts), np.maximum.reduceat(most[order], starts)
    return np.stack([corners(bounds) for bounds in np.stack([lows, highs], axis=1)])
