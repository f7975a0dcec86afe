"""Height of the curved surface that a mesh approximates over its flat facets.

    h = (n_b - n_a).e/8      over the middle of an edge e from corner a to corner b, along the facets' normals

n_a is the surface's unit normal at a corner: the mean of the facets' around it with weights
sin(angle)/(|e_1| |e_2|), exact on spheres and circular cylinders however they are meshed (Max 1999). Three rules
distinguish curves from edges:

- facets that tilt by more than 35 deg from their neighbour meet at an edge; so do a narrow and a wide one, by more than
  a factor of 3 across what they share: there a rounded corner ends and a plane begins
- over one edge curvature changes little: |(n_a + n_b).e| <= |(n_b - n_a).e|/2. It is 0 on a circle; where two planes
  meet, as in a roof, both are equal
- a surface, and the body it is part of, bends one way rather than both, or 40 % of the edges over which it bends obey
  the rule above: heights that differ at random from neighbour to neighbour are relief, no curve (white noise 13 %,
  mountains 20 to 30 %)

source   Max 1999, "Weights for computing vertex normals from facet normals", J. Graphics Tools 4(2);
         docs/theory/facets.md
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...base.vectors import dot
from ._adjacency import MeshAdjacency, components

CREASE = np.cos(np.radians(35))  # largest tilt between neighbours of one surface: eleven facets make a full circle
UNLIKE = 3.0  # ratio of the widths of neighbours, from which on they are not of the same curve
FLAT = 1e-3  # rad, tilt between neighbours, below which they continue a plane
BENDS = 0.5  # |(n_a + n_b).e|/|(n_b - n_a).e| of an edge that follows a curve
SMOOTH = 0.4  # share of a surface's edges that must follow a curve


@dataclass(frozen=True, eq=False)
class SurfaceCurvature:
    """Heights of the smooth surface over k facets.

    height   m (k, 3): over the middle of the edges from corner i to i + 1, along `normal`; 0 where nothing is curved
    normal   unit (k, 3), of neighbours on the same side of their surface; without area 0
    turn     (k,): 1 where that is the side the corners turn counter-clockwise on, else -1
    area     m^2 (k,);  edge  from corner i to i + 1, m (k, 3, 3)
    surface  (k,): the number of the smooth surface a facet belongs to
    """

    height: np.ndarray
    normal: np.ndarray
    turn: np.ndarray
    area: np.ndarray
    edge: np.ndarray
    surface: np.ndarray


def curvature_of(triangles: np.ndarray, two_sided: np.ndarray, j: MeshAdjacency) -> SurfaceCurvature:
    """Heights of the surface that triangles, m (k, 3, 3), with their adjacency approximate.

    two_sided  (k,): such facets need not be wound as their neighbours
    """
    k = len(triangles)
    edge = np.roll(triangles, -1, axis=1) - triangles
    square = np.einsum("kij,kij->ki", edge, edge).ravel()
    f, g = j.one // 3, j.other // 3
    wide = j.twice[f], j.twice[g]  # both over the same edge
    smooth = (j.tilt > CREASE) & ((np.maximum(*wide) < UNLIKE * np.minimum(*wide)) | (j.tilt > np.cos(FLAT)))
    smooth &= ~j.against | (two_sided[f] & two_sided[g])
    surface, turn, normal = components(k, f[smooth], g[smooth]), np.ones(k), j.normal
    body = surface if smooth.all() else components(k, f, g)
    one, other, f, g, against = (a[smooth] for a in (j.one, j.other, f, g, j.against))
    if against.any():  # every facet is two nodes, as it is and turned, and neighbours link those that agree
        mirror = np.where(against, g + k, g), np.where(against, g, g + k)
        both = components(2 * k, np.concatenate([f, f + k]), np.concatenate(mirror))
        turn = np.where(both[:k] <= both[k:], 1.0, -1.0)
        normal = normal * turn[:, None]
    at = _corner_normals(j, one, other, against, normal, square)
    following = np.roll(at, -1, axis=1)
    bend = np.einsum("kij,kij->ki", following - at, edge)
    uneven = np.abs(np.einsum("kij,kij->ki", following + at, edge))
    bends = np.abs(bend) + uneven > FLAT * np.sqrt(square).reshape(k, 3)
    even = uneven <= BENDS * np.abs(bend)
    share = [np.count_nonzero(b, axis=1) * j.twice for b in (bends, bends & even)]
    share += [b[:, 0] + b[:, 1] + b[:, 2] for b in (bend, np.abs(bend))]
    curved = np.ones(k, bool)
    for whole in (surface, body):
        tried, kept, one_way, either = (np.bincount(whole, a) for a in share)
        curved &= ((kept >= SMOOTH * tried) | (np.abs(one_way) >= either / 2))[whole]
    height = np.where(even & curved[:, None], bend / 8, 0.0)
    return SurfaceCurvature(height, normal, turn, j.twice / 2, edge, surface)


def _corner_normals(
    j: MeshAdjacency, one: np.ndarray, other: np.ndarray, against: np.ndarray, normal: np.ndarray, square: np.ndarray
) -> np.ndarray:
    """The smooth surface's unit normals at facets' corners (k, 3, 3), the same for all that smooth edges join there.

    one, other  edges that are smooth;  square  of the edges' lengths (3 k,)
    """
    start, end = j.corner.ravel(), np.roll(j.corner, -1, axis=1).ravel()
    fan, joined, frayed = start.copy(), np.zeros(len(start), bool), np.zeros(j.places, bool)
    joined[one] = joined[other] = True
    frayed[start[~joined]] = frayed[end[~joined]] = True  # some edge ends a surface here: facets around may be apart
    some = np.flatnonzero(frayed[start])
    if len(some):
        place = np.full(len(fan), -1)
        place[some] = np.arange(len(some))
        last, other_last = _next(one), _next(other)
        a = np.concatenate([place[one], place[last]])
        b = np.concatenate([place[np.where(against, other, other_last)], place[np.where(against, other_last, other)]])
        fan[some] = j.places + components(len(some), a[a >= 0], b[a >= 0])
    square = square.reshape(-1, 3)
    weight = (j.twice[:, None] / np.maximum(square * np.roll(square, 1, axis=1), 1e-300)).ravel()
    weight /= weight.max(initial=0.0) or 1.0
    out = np.stack([np.bincount(fan, weight * np.repeat(n, 3)) for n in normal.T], axis=1)
    out = out / np.maximum(np.sqrt(dot(out, out)), 1e-300)[:, None]
    return np.take(out, fan, axis=0).reshape(-1, 3, 3)


def _next(edge: np.ndarray) -> np.ndarray:
    """The edge that begins where an edge ends, in the same facet."""
    return np.where(edge % 3 == 2, edge - 2, edge + 1)
