"""Fewer facets for the same waves: pairs of triangles of one plane, and bodies of which only the lit side shades.

A beam is what a convex facet lights of the next one: two triangles that tile a convex quadrilateral reflect the field
of one facet. Larger ones gain nothing: the shadows of a whole scene cut them into more parts than they replace.
"""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from ...base.vectors import cross, distinct, dot
from ...scattering.physical_optics import normals_and_areas
from ._polygons import Polygons

FLAT = 1e-9  # of the diagonal: corners nearer to a plane or a line lie in it


def joined_facets(triangles: np.ndarray, groups: np.ndarray, diagonal: float) -> tuple[Polygons, np.ndarray]:
    """Triangles, m (k, 3, 3), and convex quadrilaterals of two of them; and the first triangle of each (n,), rising.

    groups  (k,) int: triangles of different groups are not joined
    """
    edge, back = _shared_edges(triangles)
    is_first = edge < back
    edge, back = edge[is_first], back[is_first]
    own, other = edge // 3, back // 3
    begin, end = triangles[own, edge % 3], triangles[own, (edge + 1) % 3]
    tip, far = triangles[own, (edge + 2) % 3], triangles[other, (back + 2) % 3]
    normal = normals_and_areas(triangles)[0]
    across = far - tip
    turns = [dot(cross(corner - tip, across), normal[own]) * side for corner, side in ((begin, 1), (end, -1))]
    flat = FLAT * diagonal
    fits = (np.abs(dot(across, normal[own])) <= flat) & (groups[own] == groups[other])
    fits &= (dot(normal[own], normal[other]) > 0) & (np.minimum(*turns) > flat * np.linalg.norm(across, axis=1))
    # the longest edges first: halves of rectangles meet there
    order = np.flatnonzero(fits)[np.argsort(-np.linalg.norm(end - begin, axis=1)[fits], kind="stable")]
    is_free, pairs = [True] * len(triangles), []
    for pair, a, b in zip(order.tolist(), own[order].tolist(), other[order].tolist(), strict=True):
        if is_free[a] and is_free[b]:
            is_free[a] = is_free[b] = False
            pairs.append(pair)
    if not pairs:
        return Polygons.of(triangles), np.arange(len(triangles))
    corners = np.concatenate([triangles, triangles[:, :1]], axis=1)
    corners[own[pairs]] = np.stack([end, tip, begin, far], axis=1)[pairs]
    count = np.full(len(triangles), 3)
    count[own[pairs]], count[other[pairs]] = 4, 0
    first = np.flatnonzero(count)
    return Polygons(corners[first], count[first]), first


def closed(triangles: np.ndarray) -> np.ndarray:
    """True (k,) for triangles, m (k, 3, 3), of bodies with a closed surface turned outwards: each edge is that of one
    other triangle, which runs through it the other way."""
    edge, back = _shared_edges(triangles)
    number, size = np.bincount(edge, minlength=3 * len(triangles)), len(triangles)
    links = coo_array((np.ones(len(edge), bool), (edge // 3, back // 3)), shape=(size, size))
    n_bodies, body = connected_components(links, directed=False)
    spokes = triangles - triangles.reshape(-1, 3).mean(axis=0)
    volume = np.bincount(body, dot(spokes[:, 0], cross(spokes[:, 1], spokes[:, 2])), n_bodies)
    n_open = np.bincount(body, (number.reshape(-1, 3) != 1).any(axis=1), n_bodies)
    return np.asarray(((n_open == 0) & (volume > 0))[body])


def _shared_edges(triangles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Edges 3 i + j, from corner j of triangle i to the next one, and those that run the other way between the same
    places (n,), (n,), where there is one of each."""
    places, corner = distinct(triangles.reshape(-1, 3))
    corner = corner.reshape(-1, 3)
    begin, end = corner.ravel(), np.roll(corner, -1, axis=1).ravel()
    code, back = begin * len(places) + end, end * len(places) + begin
    order = np.argsort(code, kind="stable")
    rising = code[order]
    first = np.searchsorted(rising, back)
    is_single = [np.searchsorted(rising, key, "right") == np.searchsorted(rising, key) + 1 for key in (code, back)]
    edge = np.flatnonzero(is_single[0] & is_single[1])
    return edge, order[first[edge]]
