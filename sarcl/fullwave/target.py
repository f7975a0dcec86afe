"""What a target is to the grid: lists of edges and faces that are not vacuum."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from ..base.constants import SPEED_OF_LIGHT
from .lattice import LANES, Lattice

VACUUM_PERMITTIVITY = 1 / (4e-7 * np.pi * SPEED_OF_LIGHT**2)  # F/m, with the permeability 4 pi 1e-7 H/m


@dataclass(frozen=True, eq=False)
class Target:
    """Lists of the cells that hold a target; places as in Lattice, each at most once.

    edges   places of E (n,);  share  (2, n): E = share[0] E_old + share[1] E_vacuum; both 0 in a conductor
    faces   places of H (m,);  weight (4, m): free length over free area of the edges c(+b), c, b(+c), b of a face in
            direction a, with b and c the directions after a
    resting  cells inside conductors that need no updates, int (k, 4): see resting_rows; None: none
    coupled  places of those of the edges (k,) whose field depends on D across them as well;  coupling  (4, k): weights
            of D along b at the nodes before and after the edge, and of D along c, with b and c the directions after
    lagging  (4, k): weights of what lags behind D in the same way, in lossy bodies;  keep  part of it that each step
            keeps
    gap     width, m, of gaps between conductors that are narrower than a cell; None: none
    strip_area  m^2, of strips of conductors thinner than a cell, which are sheets on the grid
    """

    edges: np.ndarray
    share: np.ndarray
    faces: np.ndarray
    weight: np.ndarray
    resting: np.ndarray | None = None
    gap: float | None = None
    strip_area: float = 0.0
    coupled: np.ndarray = field(default_factory=lambda: np.zeros(0, np.int64))
    coupling: np.ndarray = field(default_factory=lambda: np.zeros((4, 0)))
    lagging: np.ndarray = field(default_factory=lambda: np.zeros((4, 0)))
    keep: float = 0.0

    @classmethod
    def nothing(cls) -> Target:
        """The target of an empty grid."""
        none = np.zeros(0, np.int64)
        return cls(none, np.zeros((2, 0)), none, np.zeros((4, 0)))


def material_edges(lattice: Lattice, edges: np.ndarray, permittivity: np.ndarray, conductivity: np.ndarray) -> Target:
    """Edges in materials of a relative permittivity and a conductivity, S/m, (n,) each.

    The field is the mean of both steps where it drives the current: E <- p E + q (E + s curl H), so that p + q is
    (1 - x)/(1 + x) and q = 1/(permittivity (1 + x)), with x = conductivity dt/(2 permittivity eps_0).
    """
    x = conductivity * lattice.time_step / (2 * permittivity * VACUUM_PERMITTIVITY)
    new = 1 / (permittivity * (1 + x))
    share = np.stack([(1 - x) / (1 + x) - new, new])
    return Target(edges, share, np.zeros(0, np.int64), np.zeros((4, 0)))


def resting_rows(inside: np.ndarray, low: np.ndarray) -> np.ndarray:
    """Rows with cells in which no field ever changes, int (n, 4): plane, row, and the longest stretch of such cells in
    it, as its first cell and the first one after it.

    inside  nodes inside conductors, in a box of the grid whose first node is `low` (3,), bool
    A cell rests where its node and the 26 nodes about it are inside: each of its edges and all faces beside them are
    then in the conductor. Stretches are whole vectors of LANES cells.
    """
    before = int(low[2]) % LANES
    held = np.pad(inside, ((0, 0), (0, 0), (before, -(before + inside.shape[2]) % LANES)))
    for axis in range(3):
        line = np.moveaxis(held, axis, 0)  # a view
        both = line[:-1] & line[1:]
        line[0] = line[-1] = False
        line[1:-1] = both[:-1] & both[1:]
    vectors = np.asarray(held.reshape(*held.shape[:2], -1, LANES).all(axis=3))
    length = np.zeros(vectors.shape, np.int64)  # of the stretch that ends here, vectors
    for v in range(vectors.shape[2]):
        length[..., v] = vectors[..., v] * (1 + (length[..., v - 1] if v else 0))
    plane, row = np.nonzero(length.any(axis=2))
    longest, end = length[plane, row].max(axis=1), length[plane, row].argmax(axis=1) + 1
    cells = low[2] - before + LANES * np.stack([end - longest, end])
    return np.stack([plane + low[0], row + low[1], *cells], axis=1)
