"""Facets that a scene holds twice, and antennas inside bodies: scenes that are hardly meant as they are."""

from __future__ import annotations

import numpy as np

from ..base.boxes import box
from ..base.errors import NothingSeen, warn
from ..base.rows import spread_over
from ..base.vectors import cross, dot
from ..scene.scene import Scene

EQUAL = 1e-9  # of the scene's size: corners nearer to one another are one
AXES = np.array([(0.61, 0.35, 0.71), (0.27, -0.83, 0.49)])  # of the numbers by which triangles are sorted
PLACES = 256  # of antennas that are looked at
INSIDE = 0.75  # winding number of a closed surface: 1 within it, 0 outside, 1/2 below a plane


def warn_of_coincident(scene: Scene) -> None:
    """Warn of facets that lie on one another and are seen from one side: each of them counts."""
    facet = np.flatnonzero(scene.reflectivity > 0)
    triangles = scene.triangles if len(facet) == len(scene.triangles) else scene.triangles[facet]
    if len(triangles) < 2:
        return
    bounds = box(triangles.reshape(-1, 3))
    size = max(float(np.linalg.norm(bounds[1] - bounds[0])), np.finfo(float).tiny)
    corners = (triangles.reshape(-1, 3) - bounds[0]) / size
    one, two, three = (corners @ AXES[0] + (corners @ AXES[1]) ** 2).reshape(-1, 3).T
    number = one + two + three  # the same, but for rounding, for any order of the corners
    order = np.argsort(number, kind="stable")
    near = np.flatnonzero(np.diff(number[order]) < 6 * EQUAL)
    one, other = triangles[order[near]], triangles[order[near + 1]]
    distance = np.linalg.norm(one[:, :, None] - other[:, None], axis=-1).min(axis=2).max(axis=1)
    sides = [cross(t[:, 1] - t[:, 0], t[:, 2] - t[:, 0]) for t in (one, other)]
    faces = (dot(*sides) > 0) | scene.two_sided[facet[order[near]]] | scene.two_sided[facet[order[near + 1]]]
    twice = np.flatnonzero((distance < EQUAL * size) & faces & sides[0].any(axis=1))
    if len(twice):
        first = sorted((int(facet[order[near[twice[0]]]]), int(facet[order[near[twice[0]] + 1]])))
        number = "1 facet lies on another" if len(twice) == 1 else f"{len(twice)} facets lie on others"
        warn(
            f"{number}, such as facet {first[1]} on facet {first[0]}: each of them counts, so that their echo is twice "
            "as strong; leave them out (was a scene added to itself?)",
            "coincident facets",
        )


def refuse_inside(scene: Scene, *ends: np.ndarray) -> None:
    """NothingSeen where an antenna, m (n, 3), stands inside a closed body, whose facets reflect on the outside."""
    triangles = scene.triangles[~scene.two_sided]
    if not len(triangles):
        return
    low, high = box(triangles.reshape(-1, 3))
    for name, end in zip(("the track", "the receiver"), ends, strict=False):
        within = np.flatnonzero(((end > low) & (end < high)).all(axis=1))
        for pulse in within[spread_over(len(within), PLACES)].tolist() if len(within) else []:
            if _winding(triangles, end[pulse]) > INSIDE:
                x, y, z = end[pulse].tolist()
                raise NothingSeen(
                    f"pulse {pulse} of {name}, at ({x:.4g}, {y:.4g}, {z:.4g}) m, is inside a closed body, whose facets "
                    "reflect on their outside alone: move it, or give the facets of a room that is seen from "
                    "within two_sided=True"
                )


def _winding(triangles: np.ndarray, place: np.ndarray) -> float:
    """Solid angle of triangles, m (n, 3, 3), from a place, m (3,), over 4 pi, positive from behind.

    Source: van Oosterom and Strackee 1983, IEEE Trans. Biomed. Eng. 30(2), 125-126.
    """
    a, b, c = (triangles - place).transpose(1, 0, 2)
    x, y, z = (np.linalg.norm(one, axis=1) for one in (a, b, c))
    below = x * y * z + dot(a, b) * z + dot(b, c) * x + dot(c, a) * y
    return float(np.arctan2(dot(a, cross(b, c)), below).sum() / (2 * np.pi))
