"""Norms of a scene's facets at random phases: as they are given, and cut into pieces.

A tolerance is relative to the facets as they are given, of which neighbours in one plane, of one material, count as
one: where a plate ends, and not how a mesh divides it, is what its echo depends on. Facets and their pieces make more
edges, whose echoes cancel again; their errors do not. The gain says by how much their norm is larger.

docs/theory/facets.md derives it; tests/scattering/test_facet_errors.py measures it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from ..base.constants import SPEED_OF_LIGHT
from ..base.fingerprint import checksum
from ..base.vectors import unit
from ..scene.scene import Scene
from ..scene.triangles import areas, bisect, centroids, cut, edges
from . import facet_kinds
from ._facet_sampling import draws_and_chances
from .mesh_quality.facet_groups import coplanar_groups
from .physical_optics import triangle_integral

Ends = tuple[np.ndarray, np.ndarray]  # positions of transmitter and receiver, m (3,) each
Sees = Callable[[np.ndarray, np.ndarray, Ends], np.ndarray]  # whether antennas see places, m (n, 3), on facets (n,)
FACETS = 200  # sampled facets
PIECES = 2048  # sampled pieces of all these facets
MOST_MEMBERS = 20_000  # facets of the planes that are added up; of planes with more, each facet counts alone
FREQUENCIES = 16
MOST_LOBE = 0.5  # of the carrier: planes below a wavelength have no nulls
MARGIN = 1.1  # the gain is estimated from samples
WHOLE_PIECES, FINEST_WHOLE = 50_000, 64  # pieces from which whole facets are added up: of all, and along an edge
WHOLE_PHASE = 0.5  # rad, of the wave's curvature over these pieces


def longest_piece(max_edge: float) -> float:
    """Edge, m, down to which facets are cut for a plan with `max_edge`: slightly longer.

    Plans halve the longest edge of a facet, and so does cutting: rounding alone would decide which pieces are cut once
    more, and different pieces side by side have errors that do not cancel.
    """
    return max_edge * (1 + 1e-6)


def lobe_wavenumbers(center: float, bandwidth: float, triangles: np.ndarray, of: np.ndarray) -> np.ndarray:
    """Wavenumbers, rad/m (m, 16), at which the power of m planes is averaged: over the band, Hz, and at least over one
    lobe of the plane's pattern, in whose nulls nothing could be within a tolerance.

    triangles  m (k, 3, 3);  of  the plane of each (k,)
    """
    n = int(of.max(initial=-1)) + 1
    low, high = np.full((n, 3), np.inf), np.full((n, 3), -np.inf)
    for corner in range(3):
        np.minimum.at(low, of, triangles[:, corner])
        np.maximum.at(high, of, triangles[:, corner])
    lobe = np.minimum(SPEED_OF_LIGHT / (2 * np.linalg.norm(high - low, axis=1)), MOST_LOBE * center)
    # random: a pattern may have evenly spaced nulls
    offset = (np.arange(FREQUENCIES) + np.random.default_rng(2).random(FREQUENCIES)) / FREQUENCIES - 0.5
    return np.asarray(2 * np.pi / SPEED_OF_LIGHT * (center + np.maximum(bandwidth, lobe)[:, None] * offset))


class FacetNorm:
    """Norms of coherent facets, estimated from the planes of up to 200 of them. Facets are perfect conductors here.

    Only what antennas see counts: an echo that is in shadow would make the errors of the others small beside it.
    """

    def __init__(
        self, scene: Scene, mirror: np.ndarray, ends: Sequence[Ends], center: float, bandwidth: float, sees: Sees
    ) -> None:
        """mirror  True for coherent facets (k,);  ends  antennas at some pulses;  center, bandwidth  Hz"""
        self._ends, self._kept, self._mirror, self._sees = ends, scene.kept, checksum(mirror), sees
        group, self._weight = self._kept.of(
            ("sampled planes", self._mirror), lambda: _sampled_planes(scene, np.flatnonzero(mirror))
        )
        self._numbers = np.concatenate(group) if group else np.zeros(0, int)
        self._triangles = scene.triangles[self._numbers]
        self._group = np.repeat(np.arange(len(group)), [len(g) for g in group])
        self._length = np.maximum.reduce(edges(self._triangles)) if group else np.zeros(0)
        if group:
            self._wavenumbers = lobe_wavenumbers(center, bandwidth, self._triangles, self._group)
        self._planes: np.ndarray | None = None
        self._facets: np.ndarray | None = None
        self._gains: dict[float, tuple[float, float]] = {}

    def gain(self, edge: float) -> float:
        """Norm of facets cut to `edge`, m (inf: not at all), over that of planes, both at random phases; at least 1."""
        return self._both(edge)[0]

    def gain_of_cutting(self, edge: float) -> float:
        """The same over the norm of the facets, each alone, of those alone that are cut."""
        return self._both(edge)[1]

    def _both(self, edge: float) -> tuple[float, float]:
        if not len(self._length):
            return 1.0, 1.0
        edge = max(edge, float(self._length.max()) / FINEST_WHOLE)
        if edge not in self._gains:
            long = self._length > longest_piece(edge)
            grouped = len(self._group) > len(self._weight)
            if not long.any() and not grouped:
                self._gains[edge] = 1.0, 1.0
            else:
                self._gains[edge] = self._compared(edge, long)
        return self._gains[edge]

    def _compared(self, edge: float, long: np.ndarray) -> tuple[float, float]:
        if self._facets is None:
            self._facets, self._planes = self._whole_powers()
        assert self._planes is not None
        powers = self._facets.copy()
        if long.any():
            powers[long] = self._powers_of_pieces(long, edge)
        plane = float((self._weight * self._planes).sum())
        cuts, facets = float(powers[long].sum()), float(self._facets[long].sum())
        both = float((self._weight[self._group] * powers).sum())
        gains = [float(np.sqrt(a / b)) if b else 1.0 for a, b in ((both, plane), (cuts, facets))]
        return max(1.0, MARGIN * gains[0]), max(1.0, MARGIN * gains[1])

    def _powers_of_pieces(self, some: np.ndarray, edge: float) -> np.ndarray:
        """Sums of the squares of the integrals over the pieces of triangles `some`, m^4 (n,), from samples."""
        triangles = self._triangles[some]
        n = len(triangles)
        each = -(-PIECES // n)
        pieces = self._kept.of(  # `some` follows from the edge
            ("random pieces", self._mirror, edge), lambda: random_pieces(np.repeat(triangles, each, axis=0), edge)
        )
        share = np.repeat(areas(triangles), each) / (each * areas(pieces))  # pieces that each represents
        powers, places = np.zeros(n), centroids(pieces)
        planes, facets = np.repeat(self._group[some], each), np.repeat(self._numbers[some], each)
        waves = self._wavenumbers[planes, np.random.default_rng(3).integers(0, FREQUENCIES, len(pieces))]
        for ends in self._ends:
            q = unit(ends[0] - places) + unit(ends[1] - places)
            power = FREQUENCIES * np.abs(triangle_integral(pieces, waves[:, None] * q)) ** 2
            powers += (share * self._sees(places, facets, ends) * power).reshape(n, each).sum(axis=1)
        return powers

    def _whole_powers(self) -> tuple[np.ndarray, np.ndarray]:
        """Squares of the integrals of facets (n,) and of planes (m,), m^4, summed over pulses and frequencies.

        Pieces that are small beside the curvature of the wave are added up, each with its own distance: where a facet
        lies in the near field, its linear phase alone would give another echo. Of a plane too large for that a part
        of the same shape represents the whole one; its echo falls with its size no slower than that of the pieces.
        """
        triangles, n_planes = self._triangles, len(self._weight)
        away = min(float(np.linalg.norm(end - triangles, axis=-1).min()) for ends in self._ends for end in ends)
        finest = self._length.max() / np.clip(np.sqrt(WHOLE_PIECES / (2 * len(triangles))), 8, FINEST_WHOLE)
        flat = 1.5 * np.sqrt(WHOLE_PHASE * away / float(self._wavenumbers.max()))
        shrink = max(1.0, finest / flat) if flat else 1.0
        middle = _means(self._group, centroids(triangles), areas(triangles), n_planes)[self._group]
        parts, of = cut(
            middle[:, None] + (triangles - middle[:, None]) / shrink, max(flat, finest / shrink), 100 * WHOLE_PIECES
        )
        facets, planes, places = np.zeros(len(triangles)), np.zeros(n_planes), centroids(parts)
        on_facets = middle[of] + shrink * (places - middle[of])
        for ends in self._ends:
            seen = self._sees(on_facets, self._numbers[of], ends)
            q = unit(ends[0] - places) + unit(ends[1] - places)
            path = path_beyond(ends, middle[of], places - middle[of])
            unshaded, lit = np.zeros(n_planes), np.zeros(n_planes)
            for k in self._wavenumbers[self._group[of]].T:
                integrals = triangle_integral(parts, k[:, None] * q) * np.exp(-1j * k * path)
                sums = group_sums(of, seen * integrals, len(triangles))
                facets += np.abs(sums) ** 2
                lit += np.abs(group_sums(self._group, sums, n_planes)) ** 2
                unshaded += np.abs(group_sums(self._group[of], integrals, n_planes)) ** 2
            planes += np.minimum(unshaded, lit)  # a shadow that ends in steps of the parts' size has an echo of its own
        return facets, planes


def _sampled_planes(scene: Scene, some: np.ndarray) -> tuple[list[np.ndarray], np.ndarray]:
    """Indices of the facets of up to 200 planes, drawn from facets `some`, and the number of planes that each plane
    represents."""
    if not len(some):
        return [], np.zeros(0)
    of = coplanar_groups(scene, some, apart=facet_kinds.random(scene)[some])
    members = np.bincount(of)
    order, first = np.argsort(of, kind="stable"), np.concatenate([[0], np.cumsum(members)])
    size = areas(scene.triangles[some])
    chosen, chance = draws_and_chances(size, FACETS, np.random.default_rng(0))
    longest = np.argmax(np.maximum.reduce(edges(scene.triangles[some])))
    if len(some) > FACETS:
        chosen[0] = longest
    groups: list[np.ndarray] = []
    weights: list[float] = []
    room = MOST_MEMBERS
    chance_of_plane = np.bincount(of, chance)
    taken: dict[int, int] = {}
    for facet in chosen.tolist():
        plane = int(of[facet])
        many = int(members[plane])
        is_one = many <= room or plane in taken
        key, likely = (plane, chance_of_plane[plane]) if is_one else (-1 - facet, chance[facet])
        if key in taken:
            if len(some) > FACETS:
                weights[taken[key]] += 1 / (len(chosen) * likely)
            continue
        taken[key] = len(groups)
        groups.append(some[order[first[plane] : first[plane + 1]]] if is_one else some[[facet]])
        weights.append(1 / (len(chosen) * likely) if len(some) > FACETS else 1.0)
        room -= many if is_one else 1
    return groups, np.array(weights)


def _means(of: np.ndarray, places: np.ndarray, weight: np.ndarray, n: int) -> np.ndarray:
    """Weighted means of places (k, 3) by the groups that they belong to (n, 3)."""
    total = np.bincount(of, weight, n)
    return np.stack([np.bincount(of, weight * axis, n) for axis in places.T], axis=1) / total[:, None]


def path_beyond(ends: Ends, places: np.ndarray, step: np.ndarray) -> np.ndarray:
    """Two-way path to places + step less that to places, m (n,), as a quotient: it does not cancel at any distance."""
    out = np.zeros(len(step))
    for end in ends:
        look = end - places
        lengths = np.linalg.norm(look, axis=-1) + np.linalg.norm(look - step, axis=-1)
        out += ((step - 2 * look) * step).sum(axis=-1) / lengths
    return out


def group_sums(of: np.ndarray, values: np.ndarray, n: int = 0) -> np.ndarray:
    """Sums of complex values (k,) by the groups that they belong to (n,)."""
    return np.asarray(np.bincount(of, values.real, n) + 1j * np.bincount(of, values.imag, n))


def random_pieces(triangles: np.ndarray, edge: float) -> np.ndarray:
    """One of the pieces of each triangle (n, 3, 3), as `Scene.split` makes them, with a chance that is its area."""
    out, random = triangles.copy(), np.random.default_rng(1)
    while True:
        lengths = np.asarray(edges(out))
        long = np.flatnonzero(np.maximum.reduce(lengths) > longest_piece(edge))
        if len(long) == 0:
            return out
        first, second = bisect(out[long], lengths[:, long])  # of the same area
        out[long] = np.where(random.random(len(long))[:, None, None] < 0.5, first, second)
