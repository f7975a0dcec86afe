"""Facets of a scene that are mirrors, that are random, and that are alike; and how antennas see them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..numerics.pulse_geometry import PulseGeometry
from ..opencl.device import Device
from ..scene.material import COHERENT
from ..scene.scene import Scene

DRAWN = 1000  # facets that tell whether most of a scene differ


@dataclass(frozen=True, eq=False)
class FacetView:
    """Facets of a scene as antennas see them over a band, center and bandwidth in Hz, in some polarisations.

    vertical  unit vector (3,): V lies in the plane of it and the line of sight
    shades    device by which shadows of facets on one another are found; None: all are seen whole
    """

    scene: Scene
    antennas: PulseGeometry
    center: float
    bandwidth: float
    polarizations: Sequence[str]
    vertical: np.ndarray
    shades: Device | None = None

    @cached_property
    def mirror(self) -> np.ndarray:
        """Facets (k,) that have a coherent part: those that are cut to the edges of a plan."""
        return coherent(self.scene)

    @property
    def highest(self) -> float:
        """Highest frequency of the band, Hz."""
        return self.center + self.bandwidth / 2

    @property
    def columns(self) -> list[int]:
        """Elements of a flattened 2 x 2 scattering matrix, one per polarisation."""
        return [2 * "HV".index(name[0]) + "HV".index(name[1]) for name in self.polarizations]


def coherent(scene: Scene) -> np.ndarray:
    """Facets (k,) that have a coherent part, reflected as by a mirror of their size."""
    return np.array([np.isfinite(m.height) for m in scene.materials], bool)[scene.material]


def rough(scene: Scene) -> np.ndarray:
    """Facets (k,) that have an incoherent part."""
    return np.array([m.diagram not in COHERENT and m.height > 0 for m in scene.materials], bool)[scene.material]


def random(scene: Scene) -> np.ndarray:
    """Facets (k,) that have an incoherent part, or a random height."""
    return np.asarray(rough(scene) | (scene.roughness > 0))


def kinds(scene: Scene, some: np.ndarray | slice = slice(None)) -> np.ndarray:
    """A number for each facet, or each of some, int64 (k,): facets that differ in more than their places have different
    ones."""
    kind = np.zeros(len(scene.material[some]), np.int64)
    for values in (part[some] for part in (scene.material, scene.two_sided, scene.reflectivity, scene.roughness)):
        if (values != values[0]).any():
            names, index = np.unique(values, return_inverse=True)
            kind = kind * len(names) + index
    return kind


def examples(scene: Scene, some: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """A facet of each kind among some (k,), as positions in these (n,), and the kind of each, 0 to n - 1 (k,).

    Where most differ, as on ground of varying reflectivity, each counts as a kind: sorting them would take longer.
    """
    drawn = some[:: len(some) // DRAWN + 1]
    if 2 * len(np.unique(kinds(scene, drawn))) > len(drawn):
        every = np.arange(len(some))
        return every, every
    _, first, kind = np.unique(kinds(scene, some), return_index=True, return_inverse=True)
    return first, kind
