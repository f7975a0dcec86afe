"""Shadows that certainly miss a facet, or cover it, from any antenna of some: by the planes of edges, in float64."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from .lit_part import plane_axes

MISSED, UNDECIDED, COVERED = 0, 1, 2
IN_PLANE = 0.1  # of `slack`, as in the kernel


def certain_shadow(
    facet: np.ndarray, occluder: np.ndarray, boxes: Sequence[np.ndarray], on_plane: float, slack: float
) -> int:
    """Whether the shadows of an occluder, m (3, 3), on a facet, m (3, 3), are all MISSED, or all COVERED.

    boxes  corners of boxes that hold the antennas, m (n, 3) each: of the transmitter, and of a receiver elsewhere
    """
    center, axes = facet.mean(axis=0), plane_axes(facet)
    flat, solid = ((corners - center) @ axes.T for corners in (facet, occluder))
    flat[:, 2] = 0
    solid[np.abs(solid[:, 2]) <= on_plane, 2] = 0
    normal = np.cross(solid[1] - solid[0], solid[2] - solid[0])
    missed, covered, looks = [], [], []
    for eyes in [(box - center) @ axes.T for box in boxes]:
        facing, side = _sign((eyes - solid[0]) @ normal), _sign(eyes[:, 2])
        insides = facing * _inside(solid, eyes, flat)
        others = side * _inside(flat, eyes, solid)
        beyond = [(from_edges <= IN_PLANE * slack).all(axis=(1, 2)).any() for from_edges in (insides, others)]
        elevated = (np.abs(eyes[:, 2]) > 1e-6 * np.linalg.norm(eyes, axis=1)).all()
        between = 0 < (side * solid[:, 2]).max() < 0.99 * np.abs(eyes[:, 2]).min()
        behind = (facing * ((flat - solid[0]) @ normal) <= 0).all()
        missed.append((facing != 0 and beyond[0]) or (side != 0 and beyond[1]))
        covered.append(facing and side and elevated and between and behind and (insides >= 0).all())
        looks.append(side)
    if all(missed):
        return MISSED
    return COVERED if any(covered) and len(set(looks)) == 1 else UNDECIDED


def _inside(triangle: np.ndarray, eyes: np.ndarray, others: np.ndarray) -> np.ndarray:
    """Distances, m (3, n, 3), of three places from the planes through each edge of a triangle and each eye (n, 3):
    positive on the inner side, where eyes see the triangle anticlockwise."""
    along = np.roll(triangle, -1, axis=0) - triangle
    normal = np.cross(along[:, None], eyes[None] - triangle[:, None])
    normal /= np.linalg.norm(normal, axis=2, keepdims=True)
    return -np.einsum("iek,ijk->iej", normal, others[None] - triangle[:, None])


def _sign(values: np.ndarray) -> int:
    """1 where all are positive, -1 where all are negative, else 0."""
    return int((values > 0).all()) - int((values < 0).all())
