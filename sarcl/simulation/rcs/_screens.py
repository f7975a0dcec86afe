"""What is seen through thin sheets: the part of each facet that lines of sight reach through which of them."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from ...base.constants import SPEED_OF_LIGHT
from ...base.errors import NotApplicable
from ...base.vectors import cross, unit
from ...opencl.device import Device
from ...scattering.mesh_quality.facet_groups import coplanar_groups
from ...scattering.physical_optics import polarisation, slab, triangle_mean
from ...scene.material import Material
from ...scene.scene import Scene
from ...scene.triangles import centroids, normals
from ...visibility.lit_parts import FacetPieces, LitParts

MOST = 4  # sheets: the parts seen through each set of them need 2^MOST computations of lit parts


@dataclass(frozen=True, eq=False)
class Screens:
    """Thin sheets that facets are seen through, by one antenna.

    facets     those that are seen, m (k, 3, 3);  normals, places, materials  of the sheets
    lit_parts  of the facets, past everything but a set of sheets
    """

    facets: np.ndarray
    normals: np.ndarray
    places: np.ndarray
    materials: tuple[Material, ...]
    lit_parts: dict[frozenset[int], LitParts]

    @classmethod
    def of(
        cls,
        scene: Scene,
        keep: np.ndarray,
        antennas: list[np.ndarray],
        device: Device,
        max_bytes: float,
        progress: Callable[[int, int], None],
    ) -> Screens:
        """The sheets of a scene before its facets `keep`. NotApplicable for two antennas, and for more than MOST."""
        rows = np.flatnonzero(scene.sheets)
        group = coplanar_groups(scene, rows, np.zeros(len(rows), bool))
        first = np.unique(group, return_index=True)[1]
        if len(antennas) > 1 or len(first) > MOST:
            raise NotApplicable(
                f"the scene has {len(first)} thin sheets; what lies behind them is computed for up to {MOST}, and for "
                "one antenna: give shadows=False where nothing lies behind them"
            )
        pieces, parts = FacetPieces.uncut(scene.triangles[keep], scene.two_sided[keep]), {}
        for some in subsets(range(len(first))):
            solid = np.ones(len(scene.triangles), bool)
            solid[rows[np.isin(group, list(some))]] = False
            past = scene.triangles[solid]
            parts[some] = LitParts(device, pieces, past, antennas, max_bytes=max_bytes, progress=progress)
        places = np.array([centroids(scene.triangles[rows[group == g]]).mean(axis=0) for g in np.unique(group)])
        materials = tuple(scene.materials[scene.material[rows[i]]] for i in first)
        return cls(scene.triangles[keep], normals(scene.triangles[rows[first]]), places, materials, parts)

    def means(self, p: int, antenna: np.ndarray, waves: np.ndarray) -> Iterator[tuple[frozenset[int], np.ndarray]]:
        """Sets of sheets, and means of exp(2j k u.rho) over the parts of facets that are seen through just these, in
        direction number p, complex128 (1, k, m); the whole facet counts as the area.

        antenna  m (1, 3);  waves  k, rad/m (m,)
        """
        edges = self.facets[:, 1:] - self.facets[:, :1]
        phases = 2 * edges @ unit(antenna[0] - self.facets.mean(axis=1))[:, :, None]
        whole = triangle_mean(phases[:, 0] * waves, phases[:, 1] * waves)
        past: dict[frozenset[int], np.ndarray] = {}
        for some, parts in self.lit_parts.items():
            past[some] = np.where(parts.dark[:, None], 0, whole)
            if parts.partly.any():
                past[some][parts.partly] = parts.at(p, [antenna], waves)[1][0]
        for some in self.lit_parts:
            part = sum((-1) ** (len(some) - len(fewer)) * past[fewer] for fewer in subsets(some))
            yield some, np.asarray(part)[None]

    def transmission(self, some: frozenset[int], to_tx: np.ndarray, frequencies: np.ndarray) -> np.ndarray:
        """What sheets let through of a wave from a direction (3,), complex128 (m, 2, 2), on H and V of the antenna,
        relative to the wave without them; transposed, of a wave back there."""
        axes = np.stack(polarisation(-to_tx))
        total = np.broadcast_to(np.eye(2, dtype=complex), (len(frequencies), 2, 2))
        for sheet in sorted(some, key=lambda i: -float(self.places[i] @ to_tx)):  # the nearest to the antenna first
            normal, material = self.normals[sheet], self.materials[sheet]
            across = cross(-to_tx, normal)
            along = unit(across) if np.linalg.norm(across) > 1e-8 else axes[0]
            wave = frequencies / SPEED_OF_LIGHT
            cosine = np.full(len(wave), min(abs(float(normal @ to_tx)), 1.0))
            eps = np.asarray(material.permittivity(frequencies))
            t_h, t_v = slab(cosine, eps, material.thickness * wave)[2:]
            h, v = axes @ along, axes @ cross(-to_tx, along)
            total = (t_h[:, None, None] * np.outer(h, h) + t_v[:, None, None] * np.outer(v, v)) @ total
        return np.asarray(total)


def subsets(of: Iterable[int]) -> list[frozenset[int]]:
    """All sets of some of these numbers, smaller ones first."""
    numbers = sorted(of)
    return [frozenset(some) for n in range(len(numbers) + 1) for some in combinations(numbers, n)]
