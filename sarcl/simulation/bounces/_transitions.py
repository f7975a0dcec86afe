"""Waves beside the free edges of the facets that reflected them before: Fresnel's integral in place of a sharp beam.

    W(x) = product over free edges e of facets 1 ... m - 1 of  F(v_e),    v_e = +-2 (D_e/wavelength)^(1/2)

F       of half_plane.py;  v_e > 0 where x is in the light of the facet
D_e     detour: length of the shortest path T', edge e, x, less |x - T'|, with all edges mirrored as T' is
source  docs/theory/edges.md
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...base.constants import SPEED_OF_LIGHT
from ...base.vectors import dot, unit
from ...scattering.edge_diffraction import WedgeShape
from ...scattering.half_plane import FADING, transition
from ._beams import Beams, Surfaces, mirrored
from ._polygons import Polygons, folded

SAME_PLANE = 0.99  # cosine between normals of a facet and of a wedge's face on it
SAME_LINE = 1e-5  # of a scene's diagonal, and rad: lines nearer to each other are one
# Diagonal of a scene in wavelengths up to which transitions are computed: what a corner loses by them falls as the root
# of the wavelength over its arm, 1 dB at 12 wavelengths; cells are parts of a wavelength, and their number grows
LARGEST = 24.0
LONGEST_DETOUR = FADING[1] ** 2 / 4  # wavelengths, over an edge, of waves that count
CHANGE, PHASE = 7.0, 5.0  # changes of v (1 + pi |v|)^(1/2), and rad, over a triangle, over the root of the tolerance
LEAST_CELL = 0.1  # of tolerance times wavelength^2: smaller triangles are not cut
ROUNDS = 60  # of cutting triangles in two


def free_edges(surfaces: Surfaces, ends: np.ndarray, shape: WedgeShape) -> np.ndarray:
    """Which edges of facets, from each corner to the next, have their middle on one of the edges that diffract, with
    ends, m (e, 2, 3), on the sides of the facet behind and in front: bool (k, n, 2).

    A fold of sheets is a wedge on their backs, and none on the sides that face one another.
    """
    from scipy.spatial import cKDTree

    corners, size = surfaces.corners, surfaces.diagonal
    after = np.roll(corners, -1, axis=1)
    out = np.zeros((*corners.shape[:2], 2), bool)
    facet, number = np.nonzero((np.abs(after - corners).max(axis=-1) > surfaces.snap) & surfaces.mirrors[:, None])
    if not len(ends) or not len(facet):
        return out
    start, middle = corners[facet, number], (corners[facet, number] + after[facet, number]) / 2

    def lines(way: np.ndarray, place: np.ndarray) -> np.ndarray:
        return np.concatenate([way, np.cross(place, way) / size], axis=1)

    way, other = unit(ends[:, 1] - ends[:, 0]), unit(after[facet, number] - start)
    tree = cKDTree(np.concatenate([lines(way, ends[:, 0]), lines(-way, ends[:, 0])]))
    near = tree.query_ball_point(lines(other, middle), SAME_LINE)
    owner = np.repeat(np.arange(len(near)), [len(one) for one in near])
    edge = np.array([e for one in near for e in one], np.int64) % len(ends)
    along = dot(middle[owner] - ends[edge, 0], way[edge])
    is_on = (along > 0) & (along < np.linalg.norm(ends[edge, 1] - ends[edge, 0], axis=1))
    free, edge, angle = owner[is_on], edge[is_on], np.pi * shape.number[:, None]
    second = np.sin(angle) * shape.inward - np.cos(angle) * shape.normal  # outward normal of face 2
    for side, sign in enumerate((-1.0, 1.0)):
        normal = sign * surfaces.normals[facet[free]]
        is_face = np.maximum(dot(normal, shape.normal[edge]), dot(normal, second[edge])) > SAME_PLANE
        rows = free[is_face]
        out[facet[rows], number[rows], side] = True
    return out


@dataclass(frozen=True, eq=False)
class Transitions:
    """Free edges of the facets before the last of beams, mirrored to where these come straight from their apex.

    apex  m (k, 3);  start, way  a corner, m, and the direction of each edge (k, e, 3)
    plane  unit normals (k, e, 3) of the planes through edges and apex, towards the light;  free  bool (k, e)
    """

    apex: np.ndarray
    start: np.ndarray
    way: np.ndarray
    plane: np.ndarray
    free: np.ndarray

    @classmethod
    def of(cls, surfaces: Surfaces, free: np.ndarray, beams: Beams) -> tuple[Transitions, Polygons]:
        """Those of beams, where facets have `free` edges (k, n, 2); and all of each last facet that a wave reaches
        beside these edges: it ends at other edges, and where it would come from behind a facet."""
        chains, normals = beams.chains[beams.chain], beams.normals[beams.chain]
        polygons = surfaces.polygons[beams.last]
        starts, ways, planes, frees = [], [], [], []
        for i in range(beams.order - 1):
            facet = chains[:, i]
            corners, count = surfaces.corners[facet], surfaces.polygons.count[facet]
            is_free = free[facet, :, surfaces.side(facet, normals[:, i])]
            # an edge on another facet of the beam is a fold: no end of it
            for j in set(range(beams.order)) - {i}:
                point = surfaces.centers[chains[:, j]]
                is_on = Polygons(corners, count).heights(normals[:, j], point, surfaces.on_plane) == 0
                is_free = is_free & ~(is_on & np.roll(is_on, -1, axis=1))
            point = surfaces.centers[facet]
            side = point + surfaces.diagonal * normals[:, i]
            for j in range(i + 1, beams.order - 1):
                mirror = normals[:, j], surfaces.centers[chains[:, j]]
                corners, point, side = (mirrored(places, *mirror) for places in (corners, point, side))
            polygons = polygons.clipped(polygons.heights(unit(side - point), point, surfaces.on_plane))
            plane = Polygons(corners, count).edge_planes(beams.apex)
            sharp = np.where(is_free[..., None], 0.0, plane)
            polygons = polygons.seen_through(sharp, corners, surfaces.snap)
            length = np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=-1, keepdims=True)
            starts.append(corners)
            ways.append((np.roll(corners, -1, axis=1) - corners) / np.where(length > 0, length, 1))
            planes.append(plane)
            frees.append(is_free & folded(np.logical_or, plane != 0))
        arrays = (np.concatenate(parts, axis=1) for parts in (starts, ways, planes, frees))
        return cls(beams.apex, *arrays), polygons

    def __getitem__(self, rows: np.ndarray) -> Transitions:
        return Transitions(*(getattr(self, name)[rows] for name in self.__dataclass_fields__))

    def arguments(self, of: np.ndarray, places: np.ndarray) -> np.ndarray:
        """v_e over the root of the frequency, s^(1/2) (n, e), at places, m (n, 3), of beams `of` (n,); inf: no edge."""
        row, edge = np.nonzero(self.free[of])
        beam = of[row]
        way, start = self.way[beam, edge], self.start[beam, edge]
        tx, x = self.apex[beam] - start, places[row] - start
        height, rise = dot(tx, way), dot(x, way)
        tx_across, across = tx - height[:, None] * way, x - rise[:, None] * way
        far, near = np.linalg.norm(tx_across, axis=1), np.linalg.norm(across, axis=1)
        direct = np.linalg.norm(tx - x, axis=1)
        over = near + dot(tx_across, across) / np.maximum(far, np.finfo(float).tiny)
        detour = 2 * far * np.maximum(over, 0) / (np.hypot(far + near, height - rise) + direct)
        out = np.full((len(of), self.free.shape[1]), np.inf)
        side = np.where(dot(self.plane[beam, edge], x) > 0, 2.0, -2.0)
        out[row, edge] = side * np.sqrt(detour / SPEED_OF_LIGHT)
        return out

    def factors(self, of: np.ndarray, places: np.ndarray, frequencies: np.ndarray) -> np.ndarray:
        """W at frequencies, Hz: complex128 (n, n_f)."""
        arguments, roots = self.arguments(of, places), np.sqrt(frequencies)
        out = np.ones((len(of), len(frequencies)), complex)
        for e in np.flatnonzero(np.isfinite(arguments).any(axis=0)):
            rows = np.flatnonzero(arguments[:, e] * roots.max() < FADING[1])
            out[rows] *= transition(arguments[rows, e, None] * roots)
        return out

    def cut(
        self, triangles: np.ndarray, of: np.ndarray, rx: np.ndarray, frequency: float, tolerance: float
    ) -> tuple[np.ndarray, np.ndarray]:
        """Triangles, m (n, 3, 3), of beams `of` (n,), cut until W is constant over each up to a frequency, beside the
        phase of paths to receivers, m (k, 3); those in the dark are left out."""
        wave = 2 * np.pi * frequency / SPEED_OF_LIGHT
        least, root = LEAST_CELL * tolerance * (2 * np.pi / wave) ** 2, np.sqrt(tolerance)
        parts, numbers = [], []
        for last in np.arange(ROUNDS) == ROUNDS - 1:
            places = triangles.reshape(-1, 3)
            v = self.arguments(np.repeat(of, 3), places).reshape(len(of), 3, -1) * np.sqrt(frequency)
            v = np.clip(v, -FADING[1], FADING[1])
            is_lit = ~(v.max(axis=1) <= -FADING[1]).any(axis=1)
            triangles, of, v = triangles[is_lit], of[is_lit], v[is_lit]
            change = np.abs(np.roll(v, -1, axis=1) - v) * np.sqrt(1 + np.pi * np.abs(v).min(axis=1, keepdims=True))
            change = change.max(axis=2, initial=0) / (CHANGE * root)
            middle, sides = triangles.mean(axis=1), np.roll(triangles, -1, axis=1) - triangles
            both = unit(self.apex[of] - middle) + unit(rx[of] - middle)
            phase = np.abs(wave * np.einsum("nij,nj->ni", sides, both)) / (PHASE * root)
            most = change.max(axis=1)
            area = np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1) / 2
            is_fine = (most <= 1) & (most * phase.max(axis=1) <= 1) | (area <= least) | last
            parts.append(triangles[is_fine])
            numbers.append(of[is_fine])
            rows = np.flatnonzero(~is_fine)
            if not len(rows):
                break
            side = (change + np.minimum(most, 1)[:, None] * phase)[rows].argmax(axis=1)
            a, b, c = (triangles[rows, (side + i) % 3] for i in range(3))
            middle = (a + b) / 2
            triangles = np.concatenate([np.stack([a, middle, c], axis=1), np.stack([middle, b, c], axis=1)])
            of = np.tile(of[rows], 2)
        return np.concatenate(parts), np.concatenate(numbers)
