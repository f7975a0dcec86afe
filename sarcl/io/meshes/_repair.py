"""Repairs of meshes: faces that collapse or repeat, one winding for neighbours, closed bodies that face outwards."""

from __future__ import annotations

import logging

import numpy as np

log = logging.getLogger(__name__)

SAME_PLACE = 1e-8  # distance over the mesh's size, below which corners are one
SEEN_FROM = 8  # faces of a body whose middles tell whether it lies inside another


def repaired(vertices: np.ndarray, faces: np.ndarray, repair: bool, what: str) -> tuple[np.ndarray, np.ndarray, bool]:
    """(kept, turned, closed): faces to keep (k,), faces to reverse (k,), and whether there is an outside."""
    label = _weld(vertices)
    place = label[faces]  # corners by position: many formats store a corner once per face
    kept = (place != np.roll(place, 1, axis=1)).all(axis=1)
    if not kept.any():
        raise ValueError(f"all {len(faces)} facets are degenerate (zero area); nothing would reflect: check the {what}")
    turned = np.zeros(len(faces), bool)
    collapsed, repeated, closed = len(faces) - int(kept.sum()), 0, False
    # bodies that touch are closed before their corners are merged, and may not be closed afterwards
    for corners in (faces, place):
        if repair:
            turned = _faces_to_reverse(corners, kept, vertices[faces])
            # closed bodies may share a wall with two faces; elsewhere faces that differ in winding alone are one face
            alike = _is_closed(_turn(corners, turned)[kept])
            first = _without_repeats(_turn(place, turned), kept, alike)
            repeated += int(kept.sum() - first.sum())
            kept = first
            if not alike:  # repeated faces have hidden which faces are neighbours
                turned = _faces_to_reverse(corners, kept, vertices[faces])
        closed = _is_closed(_turn(corners, turned)[kept])
        if closed:
            break
    if not closed and repair and not _is_oriented(place, turned, kept):
        log.info("%s has faces that no winding could make agree with their neighbours", what)
    for n, why in (
        (collapsed, "left out: two of their corners are one"),
        (repeated, "left out: they repeat another"),
        (int(turned[kept].sum()), "turned round: wound against their neighbours, or inwards"),
    ):
        if n:
            log.info("%s: %d of %d faces %s", what, n, len(faces), why)
    return kept, turned, closed


def _weld(vertices: np.ndarray) -> np.ndarray:
    """Numbers of corners (n,): those at the same position share one."""
    size = float(np.ptp(vertices, axis=0).max()) or 1.0
    cell = np.rint((vertices - vertices.min(axis=0)) / (SAME_PLACE * size)).astype(np.int64)
    return np.unique(cell, axis=0, return_inverse=True)[1].reshape(-1)


def _turn(faces: np.ndarray, turned: np.ndarray) -> np.ndarray:
    return np.where(turned[:, None], faces[:, ::-1], faces)


def _without_repeats(faces: np.ndarray, kept: np.ndarray, alike: bool) -> np.ndarray:
    """`kept` without faces that repeat an earlier one: the same corners, and if `alike` the same winding."""
    start = faces.argmin(axis=1)[:, None]
    key = np.take_along_axis(faces, (start + np.arange(3)) % 3, axis=1) if alike else np.sort(faces, axis=1)
    rows = np.flatnonzero(kept)
    out = np.zeros(len(faces), bool)
    out[rows[np.unique(key[kept], axis=0, return_index=True)[1]]] = True
    return out


def _edges(faces: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(number of each edge, its direction, its face), each (3 k,): face by face."""
    ends = faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)
    forward = ends[:, 0] < ends[:, 1]
    low, high = ends.min(axis=1), ends.max(axis=1)
    number = np.unique(low * (int(high.max(initial=0)) + 1) + high, return_inverse=True)[1].reshape(-1)
    return number, forward, np.repeat(np.arange(len(faces)), 3)


def _is_closed(faces: np.ndarray) -> bool:
    """True where every edge belongs to two faces that pass it in opposite directions."""
    number, forward, _ = _edges(faces)
    return bool(
        len(number) and (np.bincount(number) == 2).all() and (np.bincount(number, weights=forward * 2 - 1.0) == 0).all()
    )


def _is_oriented(faces: np.ndarray, turned: np.ndarray, kept: np.ndarray) -> bool:
    """True where no two faces that alone share an edge pass it in the same direction."""
    number, forward, _ = _edges(_turn(faces, turned)[kept])
    pair = np.bincount(number) == 2
    return bool((np.bincount(number, weights=forward * 2 - 1.0)[pair] == 0).all())


def _faces_to_reverse(faces: np.ndarray, kept: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Faces to reverse, of those kept, so that neighbours have one winding and closed bodies face outwards.

    A closed body inside another is turned round only with it: wound inwards, it is the wall of a cavity.

    Every face is two nodes of a graph, one for each winding; neighbours link the nodes that agree. The two halves of
    a body are then two components, of which the one that reverses fewer faces is taken. A body that is one component
    (a Moebius strip) has no sides and stays as it is. (trimesh.repair goes face by face and needs networkx.)
    """
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    rows = np.flatnonzero(kept)
    k = len(rows)
    number, forward, face = _edges(faces[rows])
    uses = np.bincount(number)
    order = np.argsort(number, kind="stable")
    first = order[np.flatnonzero(np.diff(number[order], prepend=-1))][uses == 2]
    second = order[np.flatnonzero(np.diff(number[order], append=-1))][uses == 2]
    a, b, against = face[first], face[second], forward[first] == forward[second]
    ends = np.concatenate([a, a + k]), np.concatenate([np.where(against, b + k, b), np.where(against, b, b + k)])
    links = coo_array((np.ones(len(ends[0]), bool), ends), shape=(2 * k, 2 * k))
    n, component = connected_components(links, directed=False)
    plain, mirror = component[:k], component[k:]
    size = np.bincount(plain, minlength=n)  # faces that a component leaves as they are
    turn = (size[mirror] > size[plain]) | ((size[mirror] == size[plain]) & (mirror < plain))
    body = np.minimum(plain, mirror)
    volume = np.linalg.det(triangles[rows] - triangles[rows].reshape(-1, 3).mean(axis=0)) * np.where(turn, -1, 1)
    size_of = np.bincount(body, weights=volume, minlength=n)
    shut = np.bincount(body[face], weights=uses[number] != 2, minlength=n) == 0
    inwards = (size_of < 0) & shut & (np.bincount(body, minlength=n) > 0)
    if inwards.any():
        bodies = np.flatnonzero(shut & (size_of != 0) & (np.bincount(body, minlength=n) > 0))
        around = _outermost(triangles[rows], body, bodies, np.abs(size_of[bodies]))
        inwards[bodies] = inwards[around]
    out = np.zeros(len(faces), bool)
    out[rows] = (turn ^ inwards[body]) & (plain != mirror)
    return out


def _outermost(triangles: np.ndarray, body: np.ndarray, bodies: np.ndarray, volume: np.ndarray) -> np.ndarray:
    """Largest body that holds each of the closed `bodies` (m,), or itself; body (k,) of triangles (k, 3, 3)."""
    order = np.argsort(body, kind="stable")
    begin, end = np.searchsorted(body[order], [bodies, bodies + 1])
    parts = [triangles[order[a:b]] for a, b in zip(begin, end, strict=True)]
    low, high = (np.array([f(p.reshape(-1, 3), axis=0) for p in parts]).reshape(-1, 3) for f in (np.min, np.max))
    low_x, high_x, out = low[:, 0].copy(), high[:, 0].copy(), bodies.copy()
    for i, part in enumerate(parts):
        around = np.flatnonzero((low_x < low_x[i]) & (high_x > high_x[i]))  # few of many bodies, and soon found
        around = around[(low[around] < low[i]).all(axis=1) & (high[around] > high[i]).all(axis=1)]
        places = part[:: -(-len(part) // SEEN_FROM)].mean(axis=1)
        for j in around[np.argsort(-volume[around], kind="stable")]:
            if _turns_about(parts[j], places) > 0.75:  # 1 inside, 0 outside
                out[i] = bodies[j]
                break
    return out


def _turns_about(triangles: np.ndarray, places: np.ndarray) -> float:
    """Winding number of closed triangles (k, 3, 3) about places (n, 3), the mean of |number|.

    The sum of their solid angles over 4 pi: of a triangle a, b, c as seen from 0, twice the angle whose tangent is
    a.(b x c) / (|a||b||c| + a.b |c| + b.c |a| + c.a |b|).
    """
    angle = 0.0
    for place in places:
        a, b, c = np.moveaxis(triangles - place, 1, 0)
        la, lb, lc = (np.linalg.norm(v, axis=1) for v in (a, b, c))
        over = np.einsum("ij,ij->i", a, np.cross(b, c))
        under = la * lb * lc + (a * b).sum(1) * lc + (b * c).sum(1) * la + (c * a).sum(1) * lb
        angle += abs(float(np.arctan2(over, under).sum()))
    return angle / (2 * np.pi * len(places))
