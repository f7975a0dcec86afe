"""The random surface of a scene: cells that depend on nothing but the scene and the waveform, and a number for each.

A rough facet sends back one random amplitude, and random heights move it along its normal. What counts as one facet is
a cell: facets bisected at their longest edges down to about half a resolution cell in range. Neither the track nor the
tolerance has any influence, so that two passes see one surface. Coherent parts may have to be cut more finely: the
pieces keep the height of their cell, and the cell's random amplitude stays a facet of its own (`Pieces.incoherent`).

source   docs/theory/facets.md
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ..base import counter_rng, validation
from ..base.constants import SPEED_OF_LIGHT
from ..model.waveform import Waveform
from ..scene.scene import Scene
from ..scene.triangles import centroids, cut, edges
from . import facet_kinds
from .facet_plan import MOST_FACETS

RANDOM_STREAMS = (2, 3)  # of counter_rng.py's numbers: real and imaginary parts of the incoherent echo of rough facets
ROUND = 1.05  # edges of cells may be longer by so much: not every facet a little too long is halved


@dataclass(frozen=True, eq=False)
class Pieces:
    """The facets of a scene as they are added up.

    original    the scene that was cut
    of          index of the original facet that each piece is a part of (k,)
    scene       of the pieces, without random heights, and without points
    cells       the scene's facets, cut where they are random
    height      by which random heights move each piece along its normal, m (k,)
    random      complex Gaussian numbers of unit power, complex64 (k,), of incoherent echoes; 0 where there is none
    incoherent  pieces of which the incoherent part alone counts: others carry the coherent one (k,) bool
    """

    original: Scene
    of: np.ndarray
    scene: Scene
    cells: Scene
    height: np.ndarray
    random: np.ndarray
    incoherent: np.ndarray

    def __len__(self) -> int:
        return len(self.height)


def cell_edge(waveform: Waveform) -> float:
    """Length, m, of half a resolution cell in slant range, to which random facets are cut."""
    return SPEED_OF_LIGHT / (4 * waveform.bandwidth)


def pieces_of(scene: Scene, cell: float, edge: float, seed: int, some: np.ndarray | None = None) -> Pieces:
    """A scene's facets, random ones cut to cells of about `cell`, m, and coherent ones to `edge`, m; inf: not at all.

    some  facets that count (k,) bool; None: all
    MemoryError above 50 million facets.
    """
    if some is not None and not some.all():
        rows = np.flatnonzero(some)
        part = pieces_of(with_facets(scene, scene.triangles[rows], rows), cell, edge, seed)
        return replace(part, original=scene, of=rows[part.of])
    triangles, cell_of = _cut(scene.triangles, np.where(facet_kinds.random(scene), ROUND * cell, np.inf))
    cells = with_facets(scene, triangles, cell_of)
    rough, places = facet_kinds.rough(cells), centroids(triangles)
    height, random = np.zeros(len(places)), np.zeros(len(places), np.complex64)
    some = cells.roughness > 0
    height[some] = counter_rng.gaussian(places[some], seed) * cells.roughness[some]
    # from the cells' own positions: order and neighbours have no influence
    where = places if rough.all() else places[rough]
    parts = [counter_rng.gaussian(where, seed, stream) for stream in RANDOM_STREAMS]
    random[rough] = (parts[0] + 1j * parts[1]) / np.sqrt(2)
    mirror = facet_kinds.coherent(cells)
    triangles, of = _cut(cells.triangles, np.where(mirror, edge, np.inf))
    if len(triangles) == len(cells.triangles):  # cutting moves facets, if it cuts any
        return Pieces(scene, cell_of, cells, cells, height, random, np.zeros(len(height), bool))
    divided = np.bincount(of, minlength=len(mirror)) > 1
    alone = np.flatnonzero(divided & rough)
    pieces = with_facets(cells, np.concatenate([triangles, cells.triangles[alone]]), np.concatenate([of, alone]))
    random_of = np.concatenate([np.where(divided[of], 0, random[of]), random[alone]]).astype(np.complex64)
    incoherent = np.arange(len(random_of)) >= len(of)
    of = np.concatenate([of, alone])
    return Pieces(scene, cell_of[of], pieces, cells, height[of], random_of, incoherent)


def _cut(triangles: np.ndarray, longest: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Triangles bisected until no edge is longer than the `longest` of each, m (k,); and which each is a part of.

    In the given order where none is cut.
    """
    rows, long = np.arange(len(triangles)), np.isfinite(longest)
    long[long] = np.maximum.reduce(edges(triangles[long])) > longest[long]
    if not long.any():
        return triangles, rows
    if long.all() and np.ptp(longest) == 0:
        return cut(triangles, float(longest[0]), MOST_FACETS)
    parts_and_rows = [(triangles[~long], rows[~long])]
    for length in np.unique(longest[long]).tolist():
        which = np.flatnonzero(long & (longest == length))
        parts, of = cut(triangles[which], length, MOST_FACETS)
        parts_and_rows.append((parts, which[of]))
    return np.concatenate([part for part, _ in parts_and_rows]), np.concatenate([of for _, of in parts_and_rows])


def with_facets(scene: Scene, triangles: np.ndarray, of: np.ndarray) -> Scene:
    """The scene without points, its facets replaced by parts of them, m (n, 3, 3); `of`: which each belongs to (n,)."""
    if triangles is scene.triangles and not len(scene.positions):
        return scene
    names = "reflectivity", "roughness", "two_sided", "material"
    kept = {name: validation.sealed(getattr(scene, name)[of]) for name in names}
    return Scene(
        np.zeros((0, 3)),
        np.zeros(0, np.complex128),
        validation.sealed(triangles),  # so that no copy is made
        materials=scene.materials,
        heights=scene.heights,
        **kept,
    )
