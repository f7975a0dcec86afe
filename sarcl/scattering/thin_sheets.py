"""What is seen through thin sheets: the part of each facet that lines of sight reach through which of them."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import combinations

import numpy as np

from ..base.constants import SPEED_OF_LIGHT
from ..base.errors import NotApplicable
from ..base.vectors import cross, unit
from ..opencl.device import Device
from ..scene.material import Material
from ..scene.scene import Scene
from ..scene.triangles import centroids, normals
from ..visibility.lit_parts import FacetPieces, LitParts
from .facets import POLARIZATIONS, FacetSet, Light
from .mesh_quality.facet_groups import coplanar_groups
from .physical_optics import UP, polarisation, slab, triangle_mean

MOST = 4  # sheets: the parts seen through each set of them need 2^MOST computations of lit parts
# angles of incidence at which the change of T is looked at, and rad beyond those of centroids
ANGLES, BEYOND = 256, 0.01
FAINT = 0.1  # |T|, as near grazing incidence, below which errors of T are relative to this


@dataclass(frozen=True, eq=False)
class ThinSheets:
    """Thin sheets of a scene: flat, each of one or more facets.

    scene  that they are in;  rows, group  its facets that are sheets (k,), and the sheet of each (k,)
    """

    scene: Scene
    rows: np.ndarray
    group: np.ndarray

    @classmethod
    def of(cls, scene: Scene, antennas: list[np.ndarray]) -> ThinSheets:
        """The sheets of a scene. NotApplicable for more than MOST, and for two antennas."""
        rows = np.flatnonzero(scene.sheets)
        sheets = cls(scene, rows, coplanar_groups(scene, rows, np.zeros(len(rows), bool)))
        if len(antennas) > 1 or len(sheets) > MOST:
            raise NotApplicable(
                f"the scene has {len(sheets)} thin sheets; what lies behind them is computed for up to {MOST}, and for "
                "one antenna: give shadows=False where nothing lies behind them"
            )
        return sheets

    def __len__(self) -> int:
        return len(self._first)

    @cached_property
    def _first(self) -> np.ndarray:
        return np.asarray(self.rows[np.unique(self.group, return_index=True)[1]])

    @cached_property
    def normals(self) -> np.ndarray:
        """Unit vectors (n, 3)."""
        return normals(self.scene.triangles[self._first])

    @cached_property
    def places(self) -> np.ndarray:
        """Points in their planes, m (n, 3)."""
        return centroids(self.scene.triangles[self._first])

    @cached_property
    def materials(self) -> tuple[Material, ...]:
        """Of each."""
        return tuple(self.scene.materials[i] for i in self.scene.material[self._first].tolist())

    def lit_parts(
        self,
        pieces: FacetPieces,
        antennas: list[np.ndarray],
        device: Device,
        max_bytes: float,
        progress: Callable[[int, int], object],
    ) -> dict[frozenset[int], LitParts]:
        """Lit parts of pieces of the scene's facets, past everything but each set of sheets."""
        out = {}
        for subset in subsets(range(len(self))):
            solid = np.ones(len(self.scene.triangles), bool)
            solid[self.rows[np.isin(self.group, list(subset))]] = False
            past = self.scene.triangles[solid]
            out[subset] = LitParts(device, pieces, past, antennas, max_bytes=max_bytes, progress=progress)
        return out

    def transmission(
        self,
        subset: frozenset[int],
        centers: np.ndarray,
        sight: np.ndarray,
        frequencies: np.ndarray,
        vertical: tuple[float, float, float] = UP,
    ) -> np.ndarray:
        """What sheets let through of waves along lines of sight (n, 3) from an antenna to facets, about `centers`,
        m (n, 3): complex128 (n, m, 2, 2), on H and V of the antenna, relative to the waves without them; transposed,
        of waves back there."""
        sheets, axes = sorted(subset), np.stack(polarisation(sight, vertical), axis=1)
        total = np.broadcast_to(np.eye(2, dtype=complex), (len(sight), len(frequencies), 2, 2))
        slope = sight @ self.normals[sheets].T
        with np.errstate(divide="ignore", invalid="ignore"):
            before = ((centers[:, None] - self.places[sheets]) * self.normals[sheets]).sum(axis=-1) / slope
        order = np.argsort(-before, axis=1)  # the nearest to the antenna first
        for column in order.T:
            step = np.empty(total.shape, complex)
            for i, sheet in enumerate(sheets):
                rows = np.flatnonzero(column == i)
                step[rows] = self._matrix(sheet, sight[rows], axes[rows], frequencies)
            total = step @ total
        return np.asarray(total)

    def _matrix(self, sheet: int, sight: np.ndarray, axes: np.ndarray, frequencies: np.ndarray) -> np.ndarray:
        """As `transmission`, of one sheet. axes  H and V (n, 2, 3)."""
        normal = np.broadcast_to(self.normals[sheet], sight.shape)
        across = cross(sight, normal)
        is_oblique = np.linalg.norm(across, axis=1, keepdims=True) > 1e-8
        along = np.where(is_oblique, unit(np.where(is_oblique, across, 1.0)), axes[:, 0])
        t_h, t_v = self._through(sheet, np.minimum(np.abs((normal * sight).sum(axis=1)), 1.0), frequencies)
        h, v = ((axes @ one[:, :, None])[..., 0] for one in (along, cross(sight, along)))
        return np.asarray(
            t_h[..., None, None] * (h[:, :, None] * h[:, None])[:, None]
            + t_v[..., None, None] * (v[:, :, None] * v[:, None])[:, None]
        )

    def _through(self, sheet: int, cosine: np.ndarray, frequencies: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """T_h, T_v of one sheet at cosines of incidence (n,), complex128 (n, m)."""
        material = self.materials[sheet]
        eps = np.asarray(material.permittivity(frequencies))
        return slab(cosine[:, None], eps, material.thickness * frequencies / SPEED_OF_LIGHT)[2:]

    def steepness(self, centers: np.ndarray, antennas: np.ndarray, frequencies: np.ndarray) -> float:
        """Change of T per angle of incidence relative to |T|, at least FAINT, 1/rad: the largest of each sheet, and
        their sum, of lines of sight from antennas, m (n, 3), to facets about `centers`, m (k, 3)."""
        sight, total = unit(centers - antennas[:, None]), 0.0
        for sheet, normal in enumerate(self.normals):
            angle = np.arccos(np.minimum(np.abs(sight @ normal), 1.0))
            at = np.linspace(angle.min() - BEYOND, angle.max() + BEYOND, ANGLES)
            step = float(at[1] - at[0]) / 2
            low, middle, high = (
                np.stack(self._through(sheet, np.abs(np.cos(at + move)), frequencies)) for move in (-step, 0.0, step)
            )
            total += float((np.abs(high - low) / (2 * step * np.maximum(np.abs(middle), FAINT))).max())
        return total


@dataclass(frozen=True, eq=False)
class SeenThrough:
    """What one antenna sees of facets, m (k, 3, 3), through sets of sheets.

    lit_parts  past everything but each set: `ThinSheets.lit_parts`
    """

    facets: np.ndarray
    lit_parts: dict[frozenset[int], LitParts]

    def between(self, first: int) -> SeenThrough:
        """The same, with pulses counted from `first`."""
        return replace(self, lit_parts={subset: parts.between(first) for subset, parts in self.lit_parts.items()})

    def means(self, p: int, antenna: np.ndarray, waves: np.ndarray) -> Iterator[tuple[frozenset[int], np.ndarray]]:
        """Sets of sheets, and means of exp(2j k u.rho) over the parts of facets that are seen through just these, from
        place number p of the antenna, complex128 (1, k, m); the whole facet counts as the area.

        antenna  m (1, 3);  waves  k, rad/m (m,)
        """
        edges = self.facets[:, 1:] - self.facets[:, :1]
        phases = 2 * edges @ unit(antenna[0] - self.facets.mean(axis=1))[:, :, None]
        whole = triangle_mean(phases[:, 0] * waves, phases[:, 1] * waves)
        past: dict[frozenset[int], np.ndarray] = {}
        for subset, parts in self.lit_parts.items():
            past[subset] = np.where(parts.dark[:, None], 0, whole)
            if parts.partly.any():
                past[subset][parts.partly] = parts.at(p, [antenna], waves)[1][0]
        for subset in self.lit_parts:
            part = sum((-1) ** (len(subset) - len(fewer)) * past[fewer] for fewer in subsets(subset))
            yield subset, np.asarray(part)[None]


@dataclass(frozen=True, eq=False)
class FacetsThrough:
    """The facets of a set as they are seen through some of the sheets before them."""

    part: FacetSet
    sheets: ThinSheets
    subset: frozenset[int]

    def __len__(self) -> int:
        return len(self.part)

    @property
    def triangles(self) -> np.ndarray:
        """The facets, m (k, 3, 3)."""
        return self.part.triangles

    def share_at(self, pulse: int) -> np.ndarray:
        """As of `FacetSet`."""
        return self.part.share_at(pulse)

    def amplitudes(
        self, tx: np.ndarray, rx: np.ndarray, frequencies: np.ndarray, polarizations: Sequence[str],
        vertical: np.ndarray, light: Light,
    ) -> np.ndarray:  # fmt: skip
        """As of `FacetSet`, times what the sheets let through there and back; tx is rx."""
        matrix = self.part.amplitudes(tx, rx, frequencies, POLARIZATIONS, vertical, light)
        matrix = matrix.reshape(*matrix.shape[:2], 2, 2)
        centers, up = centroids(self.triangles), tuple(vertical.tolist())
        through = self.sheets.transmission(self.subset, centers, unit(centers - tx), frequencies, up).swapaxes(0, 1)
        out = np.swapaxes(through, -1, -2) @ matrix @ through
        return np.asarray(out.reshape(*out.shape[:2], 4)[..., [POLARIZATIONS.index(name) for name in polarizations]])


def may_hide(scene: Scene) -> bool:
    """Whether a scene has thin sheets and facets beside them, in other planes: these may lie behind them."""
    every = np.arange(len(scene.triangles))
    return bool(scene.sheets.any() and coplanar_groups(scene, every, np.zeros(len(every), bool)).any())


def subsets(of: Iterable[int]) -> list[frozenset[int]]:
    """All sets of some of these numbers, smaller ones first."""
    numbers = sorted(of)
    return [frozenset(subset) for n in range(len(numbers) + 1) for subset in combinations(numbers, n)]
