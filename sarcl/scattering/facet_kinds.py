"""Which facets of a scene are mirrors, which are random, and which are alike."""

from __future__ import annotations

import numpy as np

from ..scene.material import COHERENT
from ..scene.scene import Scene


def coherent(scene: Scene) -> np.ndarray:
    """Facets (k,) that have a coherent part, reflected as by a mirror of their size."""
    return np.array([np.isfinite(m.height) for m in scene.materials])[scene.material]


def rough(scene: Scene) -> np.ndarray:
    """Facets (k,) that have an incoherent part."""
    return np.array([m.diagram not in COHERENT and m.height > 0 for m in scene.materials])[scene.material]


def random(scene: Scene) -> np.ndarray:
    """Facets (k,) that have an incoherent part, or a random height."""
    return np.asarray(rough(scene) | (scene.roughness > 0))


def kinds(scene: Scene) -> np.ndarray:
    """A number for each facet, int64 (k,): facets that differ in more than their places have different ones."""
    kind = np.zeros(len(scene.triangles), np.int64)
    for values in (scene.material, scene.two_sided, scene.reflectivity, scene.roughness):
        if (values != values[0]).any():
            names, index = np.unique(values, return_inverse=True)
            kind = kind * len(names) + index
    return kind
