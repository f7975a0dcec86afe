"""Edges of conductors cut into pieces, and the part of each that antennas see."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from ...base.vectors import dot
from ...opencl.device import Device
from ...scattering.edge_diffraction import WedgeShape
from ...scene.scene import Scene
from ...visibility.rays import SceneRays

if TYPE_CHECKING:
    from ...scene.facing_borders import FacingBorders

INSET = 1e-4  # of a piece's length: the ends of edges are looked at from so far inside, where only two facets meet
OFF = 4.0  # over the least distance of rays: points on an edge are moved out of the facets by so much
HALVINGS = 12  # of the piece in which a shadow ends: its length is then known to 1/4096


@dataclass(frozen=True, eq=False)
class EdgePieces:
    """Straight edges in pieces of equal length, and the corners between these, edge by edge.

    ends     m (e, 2, 3);  shape  of their wedges;  factor  reflectivity of their faces (e,)
    parts    number of pieces of each (e,)
    n_other  number of edges left out: not smooth perfect conductors on both faces
    """

    ends: np.ndarray
    shape: WedgeShape
    factor: np.ndarray
    parts: np.ndarray
    n_other: int

    def __len__(self) -> int:
        return int(self.parts.sum())

    @property
    def wedges(self) -> tuple[np.ndarray, WedgeShape]:
        """Ends of the edges, m (e, 2, 3), and their wedges."""
        return self.ends, self.shape

    @cached_property
    def edge(self) -> np.ndarray:
        """The edge of each piece (n,)."""
        return np.repeat(np.arange(len(self.parts)), self.parts)

    @cached_property
    def first(self) -> np.ndarray:
        """The corner at which each piece begins (n,); it ends at the next one."""
        return np.arange(len(self)) + self.edge

    @cached_property
    def corner_edge(self) -> np.ndarray:
        """The edge of each corner (n + e,)."""
        return np.repeat(np.arange(len(self.parts)), self.parts + 1)

    @cached_property
    def corner_share(self) -> np.ndarray:
        """Where on its edge each corner lies, 0 to 1 (n + e,)."""
        begins = np.cumsum(self.parts + 1) - self.parts - 1
        return np.asarray((np.arange(len(self.corner_edge)) - begins[self.corner_edge]) / self.parts[self.corner_edge])

    @cached_property
    def corners(self) -> np.ndarray:
        """m (n + e, 3)."""
        return self.places(self.corner_edge, self.corner_share)

    def places(self, edges: np.ndarray, shares: np.ndarray) -> np.ndarray:
        """Points on edges, m (..., 3)."""
        start = self.ends[edges, 0]
        return np.asarray(start + shares[..., None] * (self.ends[edges, 1] - start))

    @property
    def lengths(self) -> np.ndarray:
        """Of edges, m (e,)."""
        return np.asarray(np.linalg.norm(self.ends[:, 1] - self.ends[:, 0], axis=1))

    def shapes(self, edges: np.ndarray) -> WedgeShape:
        """Of some edges."""
        return WedgeShape(self.shape.inward[edges], self.shape.normal[edges], self.shape.number[edges])


def edge_pieces(scene: Scene, crease: float, longest: float) -> tuple[EdgePieces, FacingBorders]:
    """The edges of a scene's smooth perfect conductors, in pieces no longer than `longest`, m, and the borders of flat
    faces that they make up.

    crease  rad: facets whose normals differ by less have no edge between them
    """
    from ...scene.facing_borders import facing_borders  # imports scipy
    from ...scene.wedges import joined, wedges

    smooth = np.array([m.conducting and m.height == 0 for m in scene.materials], bool)[scene.material]
    conductor = smooth & (scene.roughness == 0) & (scene.reflectivity > 0)
    part = np.flatnonzero(joined(scene.triangles, conductor))
    every = wedges(scene.triangles[part], scene.two_sided[part], crease)
    of_conductors = conductor[part[every.faces]]
    mine = every.chosen(np.flatnonzero(of_conductors.all(axis=1)))
    length = np.linalg.norm(mine.ends[:, 1] - mine.ends[:, 0], axis=1)
    pieces = EdgePieces(
        mine.ends,
        WedgeShape(mine.inward, mine.normal, mine.number),
        scene.reflectivity[part[mine.faces]].mean(axis=1),
        np.maximum(np.ceil(length / longest), 1).astype(int),
        int(of_conductors.any(axis=1).sum()) - len(mine),
    )
    return pieces, facing_borders(scene.triangles[part], mine)


@dataclass(frozen=True, eq=False)
class EdgeKnots:
    """Points on edges, edge by edge, between which coefficients are linear; one in the middle of a short or far edge.

    edge    of each (k,);  places  m (k, 3);  first  of each edge (e,)
    spans   number of intervals between those of each edge (e,)
    """

    edge: np.ndarray
    places: np.ndarray
    first: np.ndarray
    spans: np.ndarray

    @classmethod
    def of(cls, pieces: EdgePieces, distance: float, tolerance: float) -> EdgeKnots:
        """Knots for antennas at least at a distance R, m: over a length L directions turn by L/R, by half of it to the
        middle, and coefficients deviate from a chord by an eighth of its square."""
        turn = pieces.lengths / distance
        spans = np.where(turn <= tolerance, 0, np.ceil(turn / np.sqrt(tolerance))).astype(int)
        edge = np.repeat(np.arange(len(spans)), spans + 1)
        first = np.cumsum(spans + 1) - spans - 1
        share = np.where(spans[edge] > 0, (np.arange(len(edge)) - first[edge]) / np.maximum(spans[edge], 1), 0.5)
        return cls(edge, pieces.places(edge, share), first, spans)

    def around(self, edges: np.ndarray, shares: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Of points at shares of the lengths of edges (n,): the knots before and after each (n,), and the weight of the
        latter."""
        spans = self.spans[edges]
        at = shares * spans
        number = np.minimum(at.astype(int), np.maximum(spans - 1, 0))
        before = self.first[edges] + number
        return before, before + (spans > 0), at - number


class EdgeLight:
    """What an antenna sees of pieces of edges past the facets of a scene.

    Corners of pieces are looked at. Where one end of a piece is seen and the other is not, the end of the shadow is
    searched for by halving. Shadows that begin and end within one piece are missed.
    """

    def __init__(self, pieces: EdgePieces, device: Device, scene: Scene) -> None:
        self.pieces, self.rays = pieces, SceneRays(device, scene.triangles)
        half = np.pi * pieces.shape.number[:, None] / 2  # along the middle of the space outside
        self._out = OFF * self.rays.least * (np.cos(half) * pieces.shape.inward + np.sin(half) * pieces.shape.normal)

    def lit(self, antenna: np.ndarray) -> np.ndarray:
        """Where the part of each piece begins and ends that an antenna sees: (m, n, 2), 0 to 1.

        antenna  its places, m (m, 3), at m pulses
        """
        pieces = self.pieces
        pulse, corner = np.nonzero(self._faced(antenna)[:, pieces.corner_edge])
        edge = pieces.corner_edge[corner]
        inset = INSET / pieces.parts[edge]
        seen = np.zeros((len(antenna), len(pieces.corner_edge)), bool)
        share = np.clip(pieces.corner_share[corner], inset, 1 - inset)
        seen[pulse, corner] = self._seen(edge, share, antenna[pulse])
        begins, ends = seen[:, pieces.first], seen[:, pieces.first + 1]
        lit = np.where((begins & ends)[..., None], [0.0, 1.0], 0.0)
        pulse, piece = np.nonzero(begins != ends)
        is_begun, edge = begins[pulse, piece], pieces.edge[piece]
        start, part = pieces.corner_share[pieces.first[piece]], 1 / pieces.parts[edge]
        low, high = np.zeros(len(pulse)), np.ones(len(pulse))
        for _ in range(HALVINGS if len(pulse) else 0):
            middle = (low + high) / 2
            is_lit = self._seen(edge, start + middle * part, antenna[pulse])
            low, high = np.where(is_lit == is_begun, middle, low), np.where(is_lit == is_begun, high, middle)
        border = (low + high) / 2
        lit[pulse, piece, 0], lit[pulse, piece, 1] = np.where(is_begun, 0, border), np.where(is_begun, border, 1)
        return lit

    def _faced(self, antenna: np.ndarray) -> np.ndarray:
        """Whether an antenna is outside of the wedges of edges, which may be seen only from there: (m, e)."""
        pieces, shape = self.pieces, self.pieces.shape
        angle = np.pi * shape.number[:, None]
        normals = shape.normal, np.sin(angle) * shape.inward - np.cos(angle) * shape.normal
        above = [antenna @ normal.T - dot(pieces.ends[:, 0], normal) for normal in normals]
        return np.asarray((above[0] >= 0) | (above[1] >= 0))

    def _seen(self, edges: np.ndarray, shares: np.ndarray, antenna: np.ndarray) -> np.ndarray:
        """Whether an antenna, m (n, 3), sees points on edges (n,) at shares of their lengths: (n,)."""
        return ~self.rays.any_hit(self.pieces.places(edges, shares) + self._out[edges], antenna)


def longest_piece(wavelength: float, cell: float, distance: float, tolerance: float) -> float:
    """Length, m, up to which phase and amplitude are linear along a piece, and its amplitude smooth over the band.

    wavelength  m, the shortest;  cell  m, of range resolution;  distance  m, of the nearest antenna

    The two-way phase over the middle of a piece of length L differs by 2 k L^2/(8 R) from the mean of those over its
    ends, and directions turn by L/R, of which the square matters.
    """
    bent = np.sqrt(2 * tolerance * distance * wavelength / np.pi)
    return float(min(bent, np.sqrt(tolerance) * distance, cell / 4))
