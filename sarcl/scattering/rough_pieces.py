"""Pieces of the rough facets of a scene: cut, placed and given their random numbers on a device, which reads them.

The host works facet by facet, as they were given. Only what is asked for comes back: pieces of some facets, as samples
for planners, or all, for sums in float64. The surface is that of random_surface.py.

source   docs/theory/facets.md; kernels/facet_pieces.cl
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from ..base import counter_rng
from ..base.boxes import box
from ..base.morton import morton_order
from ..opencl.device import GROUP, Device
from ..opencl.launch_numbers import launch_numbers
from ..scene.scene import Scene
from ..scene.triangles import areas, centroids, cut_lengths, edges, normals, refuse_many, too_many
from ..visibility.illumination import Illumination
from . import facet_kinds
from .facet_plan import MOST_FACETS
from .facets import FacetSet
from .random_surface import RANDOM_STREAMS, ROUND, with_facets

KERNELS = "facet_pieces.cl"
PIECE_BYTES = 84  # bytes of a piece on the device: offsets, edges, reflectivity, random numbers
# of edges of what a work-item cuts, over those of pieces: some hundred pieces each, of which a path has a dozen cuts
COARSE = 16
FARTHEST = 1e9  # m, of corners: millionths of a metre of random numbers are counted exactly up to twice that
STEEPEST = 9.0  # standard deviations of random heights: no number of counter_rng.py is larger


def in_groups(items: float) -> tuple[int]:
    """Global size of at least so many work-items, in whole groups of every device."""
    return (int(np.ceil(items / GROUP)) * GROUP,)


@dataclass(frozen=True, eq=False)
class RoughPieces:
    """Rough facets of a scene in Morton order, and the numbers of pieces into which a device cuts them.

    cell    m, to which edges are cut, inf: not at all;  seed  of the random surface
    facets  m (k, 3, 3), parts of the scene's facets `of` (k,): large ones in several parts;  counts  of pieces (k,)
    lengths  of the facets' edges, m (k, 3), by which their longest is chosen
    subset  numbers, rising, of the pieces that count (n,); None: all of these facets
    block   pieces that are on the device together: some 200 MB of them, beside as many that are being made
    """

    device: Device
    scene: Scene
    cell: float
    seed: int
    facets: np.ndarray
    lengths: np.ndarray
    of: np.ndarray
    counts: np.ndarray
    subset: np.ndarray | None = None
    block: int = 2**21

    @classmethod
    def cut(
        cls, device: Device, scene: Scene, cell: float, seed: int, is_cut: np.ndarray, most: int = MOST_FACETS
    ) -> RoughPieces:
        """Pieces of facets (k,) bool, which must be `suited` to a device. MemoryError above `most` pieces."""
        of = np.flatnonzero(is_cut)
        facets = scene.triangles if is_cut.all() else scene.triangles[of]
        lengths = edges(facets).T
        longest = lengths.max(axis=1)
        refuse_many(facets, ROUND * cell, most)
        if np.maximum(longest / (ROUND * cell), 1.0).sum() > most:  # pieces along one edge of each
            raise too_many(facets, ROUND * cell, most)
        large = longest > COARSE * ROUND * cell
        if large.any():
            parts, sizes, whole = cut_lengths(facets[large], COARSE * ROUND * cell, most)
            facets, of = np.concatenate([facets[~large], parts]), np.concatenate([of[~large], of[large][whole]])
            lengths = np.concatenate([lengths[~large], sizes])
        order = morton_order(centroids(facets))
        counts = np.zeros(len(of), np.int32)
        pieces = cls(device, scene, cell, seed, facets[order], lengths[order], of[order], counts)
        pieces = replace(pieces, counts=pieces._counted())
        if len(pieces) > most or pieces.counts.min(initial=1) == 0:
            raise too_many(facets, ROUND * cell, most)
        return pieces

    @staticmethod
    def suited(device: Device, scene: Scene) -> np.ndarray:
        """Facets of a scene that a device can cut (k,) bool: rough ones without a coherent part."""
        within = max(scene.triangles.max(initial=0), -scene.triangles.min(initial=0)) < FARTHEST
        rough = facet_kinds.rough(scene) & ~facet_kinds.coherent(scene)
        return rough if device.info.fp64 and within else np.zeros_like(rough)

    def __len__(self) -> int:
        return int(self.counts.sum(dtype=np.int64)) if self.subset is None else len(self.subset)

    @cached_property
    def bounds(self) -> np.ndarray:
        """Box that holds the pieces, m (2, 3)."""
        reach = STEEPEST * float(self.scene.roughness.max())
        return box(self.facets.reshape(-1, 3)) + np.array([[-reach], [reach]])

    def number_of(self, given: np.ndarray) -> int:
        """Number of the pieces of some of the scene's facets (k,) bool."""
        return int(self.counts[given[self.of]].sum(dtype=np.int64))

    def within(self, given: np.ndarray) -> RoughPieces:
        """The pieces of some of the scene's facets (k,) bool."""
        index = np.flatnonzero(given[self.of])
        return self if len(index) == len(self.of) else self.rows(index)

    def rows(self, index: np.ndarray | slice) -> RoughPieces:
        """All pieces of facets `index` of these, in this order."""
        parts = {name: getattr(self, name)[index] for name in ("facets", "lengths", "of", "counts")}
        return replace(self, **parts, subset=None)

    def blocks(self) -> Iterator[tuple[slice, RoughPieces]]:
        """The pieces in parts of about `block`, all of each facet in one: numbers of the pieces, and these."""
        ends, first = np.cumsum(self.counts, dtype=np.int64), 0
        while first < len(ends):
            begin = int(ends[first] - self.counts[first])
            stop = int(np.searchsorted(ends, begin + self.block)) + 1
            last = int(ends[min(stop, len(ends)) - 1])
            part, numbers = self.rows(slice(first, stop)), slice(begin, last)
            if self.subset is not None:
                numbers = slice(*np.searchsorted(self.subset, [begin, last]).tolist())
                part = replace(part, subset=self.subset[numbers] - begin)
            if numbers.start < numbers.stop:
                yield numbers, part
            first = stop

    def picked(self, numbers: np.ndarray) -> RoughPieces:
        """Pieces of these numbers, rising, alone."""
        return self if len(numbers) == len(self) else replace(self, subset=numbers)

    def sampled_cells(self, most: int) -> tuple[Scene, float]:
        """About `most` of the pieces as a scene, drawn with all of their facet, and the number that each represents."""
        random = np.random.default_rng(0)
        order = random.permutation(len(self.counts)) if len(self) > most else np.arange(len(self.counts))
        n = int(np.searchsorted(np.cumsum(self.counts[order], dtype=np.int64), most)) + 1
        corners, row = self.rows(order[:n]).corners()
        if len(corners) > most:
            sample = random.choice(len(corners), most, replace=False)
            corners, row = corners[sample], row[sample]
        return with_facets(self.scene, corners, self.of[order[row]]), len(self) / len(corners)

    def corners(self) -> tuple[np.ndarray, np.ndarray]:
        """All pieces without random heights, m (n, 3, 3), and which of these facets each is a part of (n,)."""
        n = len(self)
        facets, owners, paths = self._listed()
        corners = self.device.empty(72 * n)
        kernel = self.device.kernel(KERNELS, "piece_corners")
        self.device.run(kernel, in_groups(n / self.device.info.vector_width), None, n, facets, owners, paths, corners)
        row = np.repeat(np.arange(len(self.counts)), self.counts)
        return self.device.download(corners, np.empty((n, 3, 3))), row if self.subset is None else row[self.subset]

    def placed(self, surfaces: np.ndarray, kinds: np.ndarray, stride: int) -> tuple[Any, Any]:
        """Buffers of the centres of pieces, m float64 (3, stride), and of their numbers
        as facet_amplitudes.cl reads them, float32 (., stride).

        surfaces  (n, n_kinds): what pieces of a kind share, as place_pieces of the kernels reads it
        kinds     of these facets (k,)
        """
        device, has_heights = self.device, bool(self.scene.roughness.any())
        facets, owners, paths = self._listed()
        centers = device.empty(24 * stride)
        planes = device.empty(4 * (8 + len(surfaces) - has_heights) * stride)
        heights, real, imag = (counter_rng.start_of(self.seed, stream) for stream in (0, *RANDOM_STREAMS))
        numbers = launch_numbers(
            KERNELS, "place_pieces", n=len(self), stride=stride, n_kinds=surfaces.shape[1], n_surface=len(surfaces),
            has_heights=has_heights, heights=heights, real=real, imag=imag,
        )  # fmt: skip
        device.run(
            device.kernel(KERNELS, "place_pieces"), (stride // device.info.vector_width,), None, numbers,
            facets, owners, paths, device.upload(kinds.astype(np.int32)),
            device.upload(surfaces.astype(np.float64)), centers, planes,
        )  # fmt: skip
        return centers, planes

    def _counted(self) -> np.ndarray:
        """Number of the pieces of each facet, int32 (k,): 0 of those that are cut too often."""
        counts = self.device.empty(4 * len(self.facets))
        self._walk(0, counts, counts, counts, counts)
        return self.device.download(counts, np.empty(len(self.facets), np.int32))

    def _listed(self) -> tuple[Any, Any, Any]:
        """Buffers of the facets, and of the facet and the path of each piece."""
        starts = np.cumsum(self.counts, dtype=np.int64) - self.counts
        n = int(self.counts.sum(dtype=np.int64))
        owners, paths = (self.device.empty(size * n) for size in (4, 8))
        facets = self._walk(1, self.device.upload(starts.astype(np.int32)), owners, owners, paths)
        if self.subset is not None:
            listed = ((owners, np.empty(n, np.int32)), (paths, np.empty(n, np.uint64)))
            owners, paths = (self.device.upload(self.device.download(*part)[self.subset]) for part in listed)
        return facets, owners, paths

    def _walk(self, listed: int, *buffers: object) -> object:
        """Run walk_pieces on its last four buffers; returns that of the facets."""
        device, k = self.device, len(self.facets)
        facets = device.upload(np.concatenate([self.facets.reshape(k, 9), self.lengths], axis=1))
        limit = np.array(ROUND * self.cell).view(np.uint64)
        numbers = launch_numbers(KERNELS, "walk_pieces", n_facets=k, listed=listed, limit=limit)
        kernel = device.kernel(KERNELS, "walk_pieces")
        device.run(kernel, in_groups(k / device.info.vector_width), None, numbers, facets, *buffers)
        return facets


class RoughFacets(FacetSet):
    """Pieces on a device as a set of facets. What is asked of single pieces comes from the device, and stays."""

    pieces: RoughPieces

    def __init__(
        self, pieces: RoughPieces, illumination: Illumination | None = None, kept: np.ndarray | None = None
    ) -> None:
        """illumination  None: every pulse sees all of them;  kept  numbers of the pieces in it (k,)"""
        vars(self).update(pieces=pieces, materials=pieces.scene.materials, illumination=illumination)
        if kept is not None:
            vars(self).update(kept=kept)

    def __len__(self) -> int:
        return len(self.pieces)

    @property
    def bounds(self) -> np.ndarray:
        """As of FacetSet: about."""
        return self.pieces.bounds

    @cached_property
    def _host(self) -> FacetSet:
        pieces, scene = self.pieces, self.pieces.scene
        corners, row = pieces.corners()
        of, places = pieces.of[row], centroids(corners)
        real, imag = (counter_rng.gaussian(places, pieces.seed, stream) for stream in RANDOM_STREAMS)
        if scene.roughness.any():
            height = counter_rng.gaussian(places, pieces.seed) * scene.roughness[of]
            corners = corners + (height[:, None] * normals(corners))[:, None]
        return FacetSet(
            corners, scene.reflectivity[of], scene.two_sided[of], scene.material[of], scene.materials,
            self.illumination, vars(self).get("kept", np.arange(len(of))),
            ((real + 1j * imag) / np.sqrt(2)).astype(np.complex64),
        )  # fmt: skip

    def __getattr__(self, name: str) -> np.ndarray:
        if name in ("triangles", "reflectivity", "two_sided", "material", "kept", "random"):
            return np.asarray(getattr(self._host, name))
        raise AttributeError(f"{type(self).__name__} has no {name}")

    @property
    def is_mirror(self) -> bool:
        """As of FacetSet: none is."""
        return False

    @property
    def is_incoherent(self) -> np.ndarray:
        """As of FacetSet: all are."""
        return np.ones(len(self), bool)

    def between(self, first: int, stop: int) -> FacetSet:
        """As of FacetSet."""
        light = self.illumination
        return self if light is None else RoughFacets(self.pieces, light.between(first, stop), self.kept)

    def chosen(self, index: np.ndarray) -> FacetSet:
        """As of FacetSet."""
        subset = index if self.pieces.subset is None else self.pieces.subset[index]
        return RoughFacets(
            replace(self.pieces, subset=subset), self.illumination, self.kept[index] if self.illumination else None
        )

    def places(self, numbers: np.ndarray) -> np.ndarray:
        """As of FacetSet: random points on the facets that were cut into these pieces."""
        pieces = self.pieces
        subset = numbers if pieces.subset is None else pieces.subset[numbers]
        facets = pieces.facets[np.searchsorted(np.cumsum(pieces.counts, dtype=np.int64), subset, side="right")]
        weights = np.random.default_rng(0).dirichlet((1.0, 1.0, 1.0), len(subset))
        return np.asarray(np.einsum("nc,ncx->nx", weights, facets))

    def drawn(self, most: int, random: np.random.Generator) -> tuple[FacetSet, np.ndarray]:
        """Up to `most` pieces, and the number that each represents: as _facet_sampling.py draws them, half of them by
        their areas and half alike; first facets, then a piece of each."""
        pieces, n = self.pieces, int(self.pieces.counts.sum(dtype=np.int64))  # in shadow or not
        if len(self) <= most:
            return self._host.picked(np.arange(len(self))), np.ones(len(self))
        size = areas(pieces.facets)
        chance = 0.5 * pieces.counts / n + 0.5 * size / size.sum()
        facets = random.choice(len(chance), most, p=chance / chance.sum())
        parts = RoughFacets(pieces.rows(facets))._host
        likely = 0.5 / n + 0.5 * areas(parts.triangles) / size.sum()
        ends = np.cumsum(pieces.counts[facets])
        first, sums = ends - pieces.counts[facets], np.concatenate([[0.0], np.cumsum(likely)])
        places = sums[first] + random.random(most) * (sums[ends] - sums[first])
        sample = np.clip(np.searchsorted(sums, places, side="right") - 1, first, ends - 1)
        return parts.picked(sample), 1 / (most * likely[sample])

    def tiling_numbers(self, nodes: np.ndarray, metal: bool, dispersive: bool) -> tuple[np.ndarray, np.ndarray]:
        """Arguments `surfaces` and `kinds` of `RoughPieces.placed`."""
        scene, of = self.pieces.scene, self.pieces.of
        example, kinds = facet_kinds.examples(scene, of)
        example = of[example]
        alike = FacetSet(
            scene.triangles[example], scene.reflectivity[example], scene.two_sided[example], scene.material[example],
            scene.materials, None, example, np.zeros(len(example), np.complex64),
        )  # fmt: skip
        rows = np.delete(alike.planes(np.arange(len(example)), nodes, metal, dispersive), [*range(6), 11, 12], axis=0)
        return np.concatenate([rows, *([scene.roughness[None, example]] if scene.roughness.any() else [])]), kinds
