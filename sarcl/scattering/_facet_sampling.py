"""Random samples of the facets or points of a scene, from which planners estimate errors."""

from __future__ import annotations

import numpy as np

from ..scene.scene import Scene
from .facets import FacetSet


def drawn(size: np.ndarray, most: int, random: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Indices of up to `most` of n elements, and the number of the n that each represents.

    size  (n,), such as areas or powers: half of the draws are as likely as the size, half alike for all. Sums over the
          draws, each times the number it represents, estimate sums over all without bias.
    """
    if len(size) <= most:
        return np.arange(len(size)), np.ones(len(size))
    some, chance = draws_and_chances(size, most, random)
    return some, 1 / (most * chance[some])


def draws_and_chances(size: np.ndarray, most: int, random: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Indices of up to `most` of n elements, and the chance of each of the n at each draw (n,).

    Of no more than `most` each is drawn once. Arguments as of `drawn`.
    """
    n = len(size)
    chance = 0.5 / n + (0.5 * size / size.sum() if size.any() else np.full(n, 0.5 / n))
    if n <= most:
        return np.arange(n), chance
    return random.choice(n, most, p=chance / chance.sum()), chance


def facets_at(scene: Scene, some: np.ndarray, triangles: np.ndarray) -> FacetSet:
    """Facets `some` of a scene, all of each seen, in place of whose triangles stand `triangles`, m (k, 3, 3)."""
    return FacetSet(
        triangles, scene.reflectivity[some], scene.two_sided[some], scene.material[some], scene.materials, None, some,
        np.ones(len(some), np.complex64),
    )  # fmt: skip
