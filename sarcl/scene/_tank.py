"""The parts of a tank with its gun forward, for `shapes.tank`: closed convex prisms and solids of revolution.

Zou et al. 2021, table 2, print its overall size alone. Hull, turret and gun have the proportions of such a vehicle,
with plane and round parts that make edges, corners and dihedrals. Each part is a closed body; parts overlap where they
are joined, and share no corner. The gun and the mast are thicker than on a real vehicle, so that cells of 0.1 m still
see them.
"""

from __future__ import annotations

import numpy as np

from . import _solids

SIZE = (9.58, 4.01, 4.02)  # m, overall, along x, y, z

# outline (x, z) and y from, to, m
HULL = ((-4.5, 0.45), (1.1, 0.45), (2.11, 0.95), (0.55, 1.6), (-4.6, 1.6), (-4.79, 1.2)), (-1.45, 1.45)
TRACK = ((-3.9, 0.0), (1.2, 0.0), (2.0, 0.7), (2.0, 1.05), (-4.7, 1.05), (-4.7, 0.65)), (1.405, 2.005)
SIDE_BOX = ((-4.55, 0.9), (1.3, 0.9), (1.3, 1.4), (-4.55, 1.4)), (1.3, 1.95)
MANTLET = ((0.1, 1.65), (0.75, 1.7), (0.75, 2.1), (0.1, 2.15)), (-0.35, 0.35)

# (radius, height) from below, m
TURRET = (0, 1.55), (1.25, 1.55), (1.4, 1.85), (0.95, 2.35), (0, 2.35)
CUPOLA = (0, 2.2), (0.45, 2.2), (0.4, 2.75), (0, 2.75)
MAST = (0, 2.6), (0.13, 2.6), (0.13, 3.6), (0.22, 3.6), (0.22, 4.02), (0, 4.02)
GUN = (
    (0, 0.3),
    (0.14, 0.3),
    (0.14, 2.4),
    (0.19, 2.45),
    (0.19, 3.1),
    (0.12, 3.15),
    (0.12, 4.5),
    (0.15, 4.5),
    (0.15, 4.79),
    (0, 4.79),
)
DRUM = (0, 0.1), (0.27, 0.1), (0.27, 1.3), (0, 1.3)

TURRET_AT, TURRET_LONG = (-1.1, 0.0, 0.0), 1.15  # m; how much longer than wide it is
CUPOLA_AT = (-1.3, -0.5, 0.0)
GUN_HEIGHT = 1.9
DRUM_AT = (-4.5, 0.0, 1.85)
ALONG_X = np.array([[0, 1, 0], [0, 0, 1], [1, 0, 0]])  # cyclic, from z: triangles @ ALONG_X
ALONG_Y = np.array([[0, 0, 1], [1, 0, 0], [0, 1, 0]])


def triangles(edge: float | None, sections: int | None) -> np.ndarray:
    """Facets of all parts, body after body, m (k, 3, 3): tracks on z = 0, x and y from minus half to half the size.

    edge, sections  of round parts, as in `_solids.revolved`
    """

    def round_(profile: tuple[tuple[float, float], ...]) -> np.ndarray:
        return _solids.revolved(profile, edge, sections)

    parts = [_solids.prism(outline, *ends) for outline, ends in (HULL, MANTLET)]
    for outline, (low, high) in (TRACK, SIDE_BOX):
        parts += [_solids.prism(outline, low, high), _solids.prism(outline, -high, -low)]
    drum = round_(DRUM) @ ALONG_Y + DRUM_AT
    parts += [
        round_(TURRET) * (TURRET_LONG, 1, 1) + TURRET_AT,
        round_(GUN) @ ALONG_X + (0, 0, GUN_HEIGHT),
        round_(CUPOLA) + CUPOLA_AT,
        round_(MAST) + CUPOLA_AT,
        drum,
        drum - (0, DRUM[0][1] + DRUM[-1][1], 0),
    ]
    return np.concatenate(parts)
