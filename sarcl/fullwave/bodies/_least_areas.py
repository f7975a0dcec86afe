"""The least free areas of cut faces with which the time steps are stable.

Fields with free areas A of faces and free lengths l of edges are stable where s^2 times the largest eigenvalue of
A^-1 C^T l C is below 4, s = c dt/dx and C the curl, whose entries are +-1. By Gershgorin's theorem it is below the
largest sum of any row, whatever positive weights d the faces are given. Face f is therefore stable with

    A_f >= s^2/4 sum over its edges i of l_i sum over the faces g at edge i of d_g/d_f

Weights d = A^-1/2 enlarge few areas, and these little. They are at most (12/MARGIN - 1)/3: whole faces, whose weight is
1, are then stable beside faces of any weight, because 4 s^2/4 (1 + 3 d) MARGIN is at most 1 for s^2 = 1/12.
"""

from __future__ import annotations

import numpy as np

from ..lattice import COURANT

MARGIN = 1.02  # rounding of fields in float32 needs a little
HEAVIEST = (1 / COURANT**2 / MARGIN - 1) / 3


def weights(area: np.ndarray) -> np.ndarray:
    """Weights d of cut faces of free areas (n,), relative to a cell."""
    return np.asarray(np.minimum(np.maximum(area, 1e-6) ** -0.5, HEAVIEST))


def least_areas(weight: np.ndarray, axis: int, at: np.ndarray, lengths: np.ndarray) -> np.ndarray:
    """Least areas of faces `at` (n,) across an axis, whose edges c(+b), c, b(+c), b have free lengths (4, n).

    weight  d of all faces (3, *shape): 1 of whole faces, 0 of faces inside a conductor
    """
    b, c = (axis + 1) % 3, (axis + 2) % 3
    node = np.stack(np.unravel_index(at, weight.shape[1:]))
    last = np.array(weight.shape[1:])[:, None] - 1

    def of(face: int, *steps: tuple[int, int]) -> np.ndarray:
        place = node.copy()
        for along, by in steps:
            place[along] += by
        return np.asarray(weight[(face, *np.clip(place, 0, last))])

    total = np.zeros(len(at))
    edges = (c, (b, 1)), (c, (b, 0)), (b, (c, 1)), (b, (c, 0))
    for length, (direction, to) in zip(lengths, edges, strict=True):
        p, q = (direction + 1) % 3, (direction + 2) % 3
        total += length * (of(p, to) + of(p, to, (q, -1)) + of(q, to) + of(q, to, (p, -1)))
    return np.asarray(MARGIN * COURANT**2 / 4 * total / weight[axis].flat[at])
