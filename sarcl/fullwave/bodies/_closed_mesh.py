"""A closed mesh in whole numbers, so that what is inside of it is decided exactly; and refusals of open meshes.

Corners are moved to the nearest multiple of a small fraction of a cell, and corners that are then beside each other
become one. Facets that meet still meet, and every test of a grid line against a facet is a sum of products of whole
numbers that int64 holds.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...base.validation import array
from ..lattice import Lattice

FINEST = 20  # corners are multiples of 2^-FINEST cells, 1e-6: float32 fields do not feel less
WIDEST = 29  # bits of a coordinate: sums of products of two differences then stay below 2^62
SAME = 4  # multiples: corners that are closer are one corner
MENDED = 1e-3  # cells: so are corners at open edges, which closes cracks and pinholes


@dataclass(frozen=True, eq=False)
class ClosedMesh:
    """Facets whose edges cancel: each edge is passed as often one way as the other.

    corners  coordinates as whole numbers of 1/unit cells from node (0, 0, 0), int64 (k, 3, 3)
    body     which facets are joined by edges: the number of each facet's body, (k,), counted from 0
    unit     parts of a cell
    """

    corners: np.ndarray
    body: np.ndarray
    unit: int


def closed_mesh(lattice: Lattice, triangles: np.ndarray) -> ClosedMesh:
    """Facets from corners, m (k, 3, 3), counter-clockwise seen from outside.

    ValueError: they reach beyond the grid, enclose nothing, are open at an edge, or neighbours differ in winding.
    """
    triangles = array("triangles", triangles, np.float64, ("k", 3, 3))
    place = (triangles.reshape(-1, 3) - lattice.origin) / lattice.cell
    room = np.array(lattice.shape) - 1
    if not ((place > 0) & (place < room)).all():
        low, high = (np.array2string(f(triangles.reshape(-1, 3), 0), precision=4) for f in (np.min, np.max))
        end = np.array2string(lattice.origin + lattice.cell * room, precision=4)
        raise ValueError(
            f"triangles reach from {low} to {high} m, the grid from {np.array2string(lattice.origin, precision=4)} to "
            f"{end} m: the body must lie inside; make the grid with lattice_around(low, high, ...) of the body's box"
        )
    unit = 2 ** min(FINEST, WIDEST - int(np.ceil(np.log2(max(lattice.shape)))))
    corners, label = np.unique(np.rint(place * unit).astype(np.int64), axis=0, return_inverse=True)
    faces = _welded(corners, label.reshape(-1, 3), np.arange(len(corners)), SAME)
    edge, forward, uses = _edges(faces)
    if len(faces) and (uses % 2).any():
        faces = _welded(corners, faces, _open_corners(faces, edge, uses), MENDED * unit)
        edge, forward, uses = _edges(faces)
    if not len(faces):
        raise ValueError(
            f"all {len(triangles)} triangles are smaller than {SAME / unit:.1g} cells of {lattice.cell:g} m; give "
            "triangles in metres, or smaller cells"
        )
    _check_edges(lattice, corners / unit, faces, edge, forward, uses)
    return ClosedMesh(corners[faces], _bodies(edge, forward), unit)


def _welded(corners: np.ndarray, faces: np.ndarray, some: np.ndarray, reach: float) -> np.ndarray:
    """Faces (k, 3) whose corners, of those numbered `some`, are the first of all within reach; none has two alike."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components
    from scipy.spatial import cKDTree

    pairs = some[cKDTree(corners[some]).query_pairs(reach, output_type="ndarray")]
    n = len(corners)
    links = coo_array((np.ones(len(pairs), bool), (pairs[:, 0], pairs[:, 1])), shape=(n, n))
    group = connected_components(links, directed=False)[1]
    faces = np.unique(group, return_index=True)[1][group[faces]]
    return np.asarray(faces[(faces != np.roll(faces, 1, axis=1)).all(axis=1)])


def _open_corners(faces: np.ndarray, edge: np.ndarray, uses: np.ndarray) -> np.ndarray:
    """Numbers of the corners of edges that an odd number of facets uses."""
    open_ = uses[edge] % 2 == 1
    return np.union1d(faces[open_], np.roll(faces, -1, axis=1)[open_])


def _edges(faces: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Number of each facet's three edges and their direction, +1 or -1, (k, 3); how many facets use an edge (n,)."""
    after = np.roll(faces, -1, axis=1)
    low, high = np.minimum(faces, after), np.maximum(faces, after)
    _, edge, uses = np.unique(low * (faces.max(initial=0) + 1) + high, return_inverse=True, return_counts=True)
    return edge.reshape(faces.shape), np.where(faces < after, 1, -1), uses


def _check_edges(
    lattice: Lattice, place: np.ndarray, faces: np.ndarray, edge: np.ndarray, forward: np.ndarray, uses: np.ndarray
) -> None:
    """ValueError where edges do not cancel; place (n, 3) in cells."""
    balance = np.bincount(edge.ravel(), weights=forward.ravel())

    def at(wrong: np.ndarray) -> str:
        face, side = np.argwhere(wrong[edge])[0]
        ends = place[faces[face, [side, (side + 1) % 3]]] * lattice.cell + lattice.origin
        return " to ".join(np.array2string(end, precision=4) for end in ends)

    if (odd := uses % 2 == 1).any():
        raise ValueError(
            f"triangles are open at {int(odd.sum())} of {len(uses)} edges, one from {at(odd)} m: these have an odd "
            "number of facets, wanted a closed surface; close it in a program for meshes, or build it of sarcl.shapes"
        )
    if (wrong := balance != 0).any():
        raise ValueError(
            f"triangles have neighbours of opposite winding at {int(wrong.sum())} of {len(uses)} edges, one from "
            f"{at(wrong)} m; wanted counter-clockwise corners seen from outside: load the mesh with "
            "Scene.from_mesh(..., repair=True)"
        )


def _bodies(edge: np.ndarray, forward: np.ndarray) -> np.ndarray:
    """Number of the body of each facet (k,), from edges that cancel.

    At an edge of more than two facets, where bodies touch, each facet that passes it one way is joined to one that
    passes it the other way, in the order in which they are given. Bodies given one after the other stay apart: each of
    them passes the edge as often both ways.
    """
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    facet = np.repeat(np.arange(len(edge)), 3)
    order = np.argsort(edge.ravel(), kind="stable")
    ways = forward.ravel()[order]
    one, other = facet[order[ways > 0]], facet[order[ways < 0]]
    links = coo_array((np.ones(len(one), bool), (one, other)), shape=(len(edge), len(edge)))
    return np.asarray(connected_components(links, directed=False)[1])
