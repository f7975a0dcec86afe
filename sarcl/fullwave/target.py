"""What a target is to the grid: lists of edges and faces that are not vacuum."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..base.constants import SPEED_OF_LIGHT
from .lattice import Lattice

VACUUM_PERMITTIVITY = 1 / (4e-7 * np.pi * SPEED_OF_LIGHT**2)  # F/m, with the permeability 4 pi 1e-7 H/m


@dataclass(frozen=True, eq=False)
class Target:
    """Lists of the cells that hold a target; places as in Lattice, each at most once.

    edges   places of E (n,);  share  (2, n): E = share[0] E_old + share[1] E_vacuum; both 0 in a conductor
    faces   places of H (m,);  weight (4, m): free length over free area of the edges c(+b), c, b(+c), b of a face in
            direction a, with b and c the directions after a
    resting  cells inside conductors that need no updates, int (k, 4): see _resting:resting_rows; None: none
    """

    edges: np.ndarray
    share: np.ndarray
    faces: np.ndarray
    weight: np.ndarray
    resting: np.ndarray | None = None

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
