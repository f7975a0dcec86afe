"""Facets on which no shadow falls at any pulse: certain, by the heights of all that the line of sight to any pulse
passes under. Rays and samples are needed for the others alone.

    a point x is hidden from an antenna E by a point y of an occluder only where, for the antenna E0 in the middle,
    h = t(y) - t(x) > 0,  |u(y) - u(x)| <= kappa h,  t = height towards E0,  u = place in perspective as E0 sees it

so that x is seen where t(x) >= max over u' of t(y at u') - |u' - u(x)|/kappa: a cone of slope 1/kappa slides over the
occluders. With D = |E0|, E = e T + E', T the unit vector to E0, and R the radius of all that is seen,

    kappa = (max |E'|/(min e - R) + R max |D - e|/((min e - R) (D - R))) D/(D - R),  along each of two axes

source   docs/theory/shadows.md; the cone is a grey-scale dilation, Serra 1982
"""

from __future__ import annotations

import numpy as np

from ..base.boxes import box, corners
from ..base.vectors import dot
from ..scene.triangles import BLOCK, edges, normals
from ._certain_shadows import box_about
from ._shadow_pairs import cells_of_boxes

NEAREST = 1.5  # radii of the scene, from its middle: antennas nearer than this settle nothing
CELLS = 256  # of the occluders in perspective, along each side, at most
REACH = 64  # cells over which a shadow may move; with more, cells are made larger
MOST_ENTRIES = 2**22  # occluders in all cells; with more, cells are made larger
# Of some drawn triangles, the part whose edges are no longer than a cell, so that they lie in four cells at most
USUAL, DRAWN = 0.75, 10_000
ROUNDING = 1e-9  # of the radius, of heights


def never_shaded(
    triangles: np.ndarray, two_sided: np.ndarray, occluders: np.ndarray, ends: list[np.ndarray]
) -> np.ndarray:
    """True (k,) for triangles, m (k, 3, 3), that all antennas, m (n_pulses, 3) each, are certain to see whole.

    two_sided  (k,) bool: the others count where they face all antennas;  occluders  m (n, 3, 3), not these triangles
    """
    is_lit = np.ones(len(triangles), bool)
    for end in ends if len(triangles) else []:
        is_lit[is_lit] = _sees_whole(triangles[is_lit], two_sided[is_lit], occluders, end)
    return is_lit


def far_slopes(terrain: np.ndarray, ends: list[np.ndarray]) -> np.ndarray:
    """Facets of a complete terrain, m (k, 3, 3), that some antenna above it, m (n_pulses, 3) each, may see from below
    (k,) bool.

    A line of sight from a facet that faces an antenna runs over the terrain, and enters it through one of these alone.
    """
    normal = normals(terrain)
    upward = np.sign(normal[:, 2:]) * normal
    is_far = np.zeros(len(terrain), bool)
    for end in ends:
        is_far |= ~_face(terrain, upward, box_about(end))
    return is_far


def _face(triangles: np.ndarray, normal: np.ndarray, eyes: np.ndarray) -> np.ndarray:
    """Which triangles, m (k, 3, 3), turn a normal (k, 3) towards all of some places, m (n, 3)."""
    return np.asarray((normal @ eyes.T).min(axis=1) > dot(normal, triangles[:, 0]))


def _sees_whole(triangles: np.ndarray, two_sided: np.ndarray, occluders: np.ndarray, end: np.ndarray) -> np.ndarray:
    is_lit, eyes, swept = np.zeros(len(triangles), bool), box_about(end), None
    if len(occluders):
        bounds = box(np.concatenate([box(part.reshape(-1, 3)) for part in (triangles, occluders) if len(part)]))
        drawn = triangles[:: len(triangles) // DRAWN + 1]
        width = float(np.quantile(np.maximum.reduce(edges(drawn)), USUAL)) if len(drawn) else 0.0
        swept = _SweptHeights.of(occluders, bounds, end, width)
        if swept is None:
            return is_lit
    for first in range(0, len(triangles), BLOCK):  # so few stay in the processor's cache
        block = slice(first, first + BLOCK)
        part = triangles[block]
        faces = two_sided[block] | _face(part, normals(part), eyes)
        is_lit[block] = faces & swept.lie_above(part) if swept is not None else faces
    return is_lit


class _SweptHeights:
    """Heights towards the middle antenna below which shadows may fall at some pulse: a grid in perspective.

    view    rows: the axes of the grid and the direction of the antenna (3, 3);  distance  of it, m, from `middle` (3,)
    least   m, corner of the grid;  cell  m, of its cells (2,);  heights  m (n, m): -inf where no shadow falls
    """

    def __init__(
        self, view: np.ndarray, distance: float, middle: np.ndarray, occluders: np.ndarray, kappa: np.ndarray,
        radius: float, width: float,
    ) -> None:  # fmt: skip
        """kappa  by which shadows move along the axes, over the height that they fall from (2,)
        radius    m, of all that is seen about the middle;  width  m, of cells at least
        """
        self.view, self.distance, self.middle, self.rounding = view, distance, middle, ROUNDING * radius
        low, high, _, top = self._seen(occluders)
        reach = kappa * 2 * radius
        self.cell = np.maximum(
            np.maximum(np.ptp([low.min(axis=0), high.max(axis=0)], axis=0) / CELLS, width), reach / REACH
        )
        self.cell = np.where(self.cell > 0, self.cell, radius)
        while (np.ceil((high - low) / self.cell) + 1).prod(axis=1).sum() > MOST_ENTRIES:
            self.cell = 1.5 * self.cell
        steps = np.ceil(reach / self.cell).astype(int) + 1
        self.least, most = low.min(axis=0) - (steps + 1) * self.cell, high.max(axis=0) + (steps + 1) * self.cell
        shape = np.ceil((most - self.least) / self.cell).astype(int) + 1
        heights = np.full(shape.prod(), -np.inf)
        place, occluder = cells_of_boxes(low, high, self.least, most, self.cell)
        np.maximum.at(heights, place, top[occluder])
        self.heights = _under_cones(heights.reshape(shape), self.cell, kappa, steps)

    @classmethod
    def of(cls, occluders: np.ndarray, bounds: np.ndarray, end: np.ndarray, width: float) -> _SweptHeights | None:
        """Heights under occluders, m (n, 3, 3), in bounds, m (2, 3), from antennas, m (n_pulses, 3); None: these are
        near."""
        middle = bounds.mean(axis=0)
        radius = float(np.linalg.norm(corners(bounds) - middle, axis=1).max())
        away = end - middle
        distance = float(np.linalg.norm(away[len(end) // 2]))
        if not distance > NEAREST * radius:
            return None
        toward = away[len(end) // 2] / distance
        across = np.linalg.svd(toward[None])[2][1:]
        places, rise = away @ across.T, away @ toward
        axes = np.linalg.eigh(places.T @ places)[1].T @ across  # antennas spread along the second more than any other
        least = float(rise.min())
        if not least > NEAREST * radius:
            return None
        kappa = np.abs(away @ axes.T).max(axis=0) / (least - radius)
        kappa += radius * float(np.abs(distance - rise).max()) / ((least - radius) * (distance - radius))
        kappa *= distance / (distance - radius)
        return cls(np.stack([*axes, toward]), distance, middle, occluders, kappa, radius, width)

    def lie_above(self, triangles: np.ndarray) -> np.ndarray:
        """Which triangles, m (k, 3, 3), lie above all that may shade them; those in more than four cells do not."""
        low, high, height, _ = self._seen(triangles)
        first, last = (
            np.clip(np.floor((side - self.least) / self.cell), 0, np.array(self.heights.shape) - 1).astype(np.int64)
            for side in (low, high)
        )
        shade = np.maximum.reduce([self.heights[i[:, 0], j[:, 1]] for i in (first, last) for j in (first, last)])
        return np.asarray((height - self.rounding >= shade) & (last - first <= 1).all(axis=1))

    def _seen(self, triangles: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Least and largest place in perspective, m (k, 2) each, and height, m (k,) each, of triangles."""
        along = (triangles.reshape(-1, 3) - self.middle) @ self.view.T
        height = along[:, 2].reshape(-1, 3)
        places = (along[:, :2] * (self.distance / (self.distance - along[:, 2]))[:, None]).reshape(-1, 3, 2)
        return places.min(axis=1), places.max(axis=1), height.min(axis=1), height.max(axis=1)


def _under_cones(heights: np.ndarray, cell: np.ndarray, kappa: np.ndarray, steps: np.ndarray) -> np.ndarray:
    """The largest of heights in cells, less by the distance of the cells over kappa along the axis where that is more.

    steps  cells beyond which none counts (2,)
    """
    from scipy.ndimage import grey_dilation

    drops = []
    for i in (0, 1):
        gap = np.maximum(np.abs(np.arange(-steps[i], steps[i] + 1)) - 1, 0) * cell[i]  # between the cells
        drops.append(np.divide(gap, kappa[i], out=np.where(gap > 0, np.inf, 0.0), where=kappa[i] > 0))
    drop = np.maximum(drops[0][:, None], drops[1])
    return np.asarray(grey_dilation(heights, structure=-drop, mode="constant", cval=-np.inf))
