"""What is seen through thin sheets: the part of each facet that lines of sight reach through which of them."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import combinations, product

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

# Sheets, of one antenna and of two: the parts seen through each set of them, on each way, need 2^4 and 2^6 computations
# of lit parts
MOST = 4, 3
# angles of incidence at which the change of T is looked at, and rad beyond those of centroids
ANGLES, BEYOND = 256, 0.01
FAINT = 0.1  # |T|, as near grazing incidence, below which errors of T are relative to this


Ways = tuple[frozenset[int], ...]  # sheets that are passed on the way to the antenna, or to each of two


@dataclass(frozen=True, eq=False)
class ThinSheets:
    """Thin sheets of a scene: flat, each of one or more facets.

    scene  that they are in;  rows, group  its facets that are sheets (k,), and the sheet of each (k,)
    """

    scene: Scene
    rows: np.ndarray
    group: np.ndarray

    @classmethod
    def of(cls, scene: Scene, antennas: list[np.ndarray], *, forward: bool = False) -> ThinSheets:
        """The sheets of a scene. NotApplicable for more than MOST, and for forward scatter to a second antenna."""
        rows = np.flatnonzero(scene.sheets)
        sheets = cls(scene, rows, coplanar_groups(scene, rows, np.zeros(len(rows), bool)))
        if len(sheets) > MOST[len(antennas) - 1]:
            raise NotApplicable(
                f"the scene has {len(sheets)} thin sheets; what lies behind them is computed for up to {MOST[0]}, and "
                f"for up to {MOST[1]} with a receiver elsewhere: give shadows=False where nothing lies behind them"
            )
        if forward and len(antennas) > 1:
            raise NotApplicable(
                "what lies behind thin sheets (a material with a thickness) is not computed with forward=True: leave "
                "it out, or give shadows=False where nothing lies behind them"
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
    ) -> dict[Ways, LitParts]:
        """Lit parts of pieces of the scene's facets, past everything but a set of sheets on the way to each antenna."""
        out = {}
        for ways in product(subsets(range(len(self))), repeat=len(antennas)):
            clear = np.zeros((len(self.scene.triangles), len(ways)), bool)
            for column, through in zip(clear.T, ways, strict=True):
                column[self.rows[np.isin(self.group, list(through))]] = True
            solid = ~clear.all(axis=1)
            unshaded = replace(pieces, clear=clear[solid] if clear[solid].any() else None)
            past = self.scene.triangles[solid]
            out[ways] = LitParts(device, unshaded, past, antennas, max_bytes=max_bytes, progress=progress)
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
    """What one antenna sees of facets, m (k, 3, 3), through sets of sheets, or two, each through its own.

    lit_parts  past everything but each set: `ThinSheets.lit_parts`
    """

    facets: np.ndarray
    lit_parts: dict[Ways, LitParts]

    def between(self, first: int) -> SeenThrough:
        """The same, with pulses counted from `first`."""
        return replace(self, lit_parts={ways: parts.between(first) for ways, parts in self.lit_parts.items()})

    def means(self, p: int, tx: np.ndarray, rx: np.ndarray, waves: np.ndarray) -> Iterator[tuple[Ways, np.ndarray]]:
        """Sheets on each way, and means of exp(j k (u_t + u_r).rho) over the parts of facets that are seen through just
        these, from place number p of the antennas, complex128 (1, k, m); the whole facet counts as the area.

        tx, rx  m (3,), the same where lit parts are of one antenna;  waves  k, rad/m (m,)
        """
        edges, middle = self.facets[:, 1:] - self.facets[:, :1], self.facets.mean(axis=1)
        phases = edges @ (unit(tx - middle) + unit(rx - middle))[:, :, None]
        whole = triangle_mean(phases[:, 0] * waves, phases[:, 1] * waves)
        past: dict[Ways, np.ndarray] = {}
        for ways, parts in self.lit_parts.items():
            past[ways] = np.where(parts.dark[:, None], 0, whole)
            if parts.partly.any():
                past[ways][parts.partly] = parts.at(p, [tx[None], rx[None]][: len(ways)], waves)[1][0]
        for ways in self.lit_parts:
            n, fewer = sum(map(len, ways)), product(*(subsets(through) for through in ways))
            yield ways, np.asarray(sum((-1) ** (n - sum(map(len, some))) * past[some] for some in fewer))[None]


@dataclass(frozen=True, eq=False)
class FacetsThrough:
    """The facets of a set as they are seen through sheets, on the ways to one antenna or to two."""

    part: FacetSet
    sheets: ThinSheets
    ways: Ways

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
        """As of `FacetSet`, times what the sheets let through there and back."""
        matrix = self.part.amplitudes(tx, rx, frequencies, POLARIZATIONS, vertical, light)
        matrix = matrix.reshape(*matrix.shape[:2], 2, 2)
        centers, up = centroids(self.triangles), tuple(vertical.tolist())
        passed = [
            self.sheets.transmission(through, centers, unit(centers - end), frequencies, up).swapaxes(0, 1)
            for through, end in zip(self.ways, (tx, rx), strict=False)
        ]
        out = np.swapaxes(passed[-1], -1, -2) @ matrix @ passed[0]
        return np.asarray(out.reshape(*out.shape[:2], 4)[..., [POLARIZATIONS.index(name) for name in polarizations]])


def may_hide(scene: Scene) -> bool:
    """Whether a scene has thin sheets and facets beside them, in other planes: these may lie behind them."""
    every = np.arange(len(scene.triangles))
    return bool(scene.sheets.any() and coplanar_groups(scene, every, np.zeros(len(every), bool)).any())


def subsets(of: Iterable[int]) -> list[frozenset[int]]:
    """All sets of some of these numbers, smaller ones first."""
    numbers = sorted(of)
    return [frozenset(subset) for n in range(len(numbers) + 1) for subset in combinations(numbers, n)]
