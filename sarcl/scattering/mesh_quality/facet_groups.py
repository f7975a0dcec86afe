"""Neighbours in one plane that are one facet to a wave."""

from __future__ import annotations

import numpy as np

from ...scene.scene import Scene
from ..facet_kinds import kinds
from ._adjacency import PLANE, adjacency_of, components


def coplanar_groups(scene: Scene, some: np.ndarray, apart: np.ndarray) -> np.ndarray:
    """The number of the group each of facets `some` (n,) is in (n,): alike, joined by edges, in one plane.

    apart  facets that are groups of their own (n,) bool
    """
    kind = kinds(scene)[some]
    j = adjacency_of(scene.triangles[some])
    one, other = j.one // 3, j.other // 3
    flat = (j.tilt > 1 - PLANE) & ~j.against & (kind[one] == kind[other]) & ~apart[one] & ~apart[other]
    return components(len(some), one[flat], other[flat])
