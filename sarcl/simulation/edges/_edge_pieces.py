"""Edges of conductors cut into pieces, the part of each that antennas see, and its amplitude."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...numerics.pulse_geometry import PulseGeometry
from ...opencl.device import Device
from ...scattering.edge_diffraction import WedgeShape, edge_matrix
from ...scene.scene import Scene
from ...visibility.rays import SceneRays

INSET = 1e-4  # of an edge's length: its ends are looked at from so far inside, where only two facets meet
OFF = 4.0  # over the least distance of rays: points on an edge are moved out of the facets by so much
HALVINGS = 12  # of the piece in which a shadow ends: its length is then known to 1/4096


@dataclass(frozen=True, eq=False)
class EdgePieces:
    """Pieces of straight edges.

    ends    m (n, 2, 3);  shape  of their wedges;  factor  reflectivity of their faces (n,)
    n_edges, n_other  numbers of edges, and of those left out: not smooth perfect conductors on both faces
    longest_edge  m
    """

    ends: np.ndarray
    shape: WedgeShape
    factor: np.ndarray
    n_edges: int
    n_other: int
    longest_edge: float

    def __len__(self) -> int:
        return len(self.ends)

    @property
    def centers(self) -> np.ndarray:
        """m (n, 3)."""
        return np.asarray(self.ends.mean(axis=1))

    @property
    def lengths(self) -> np.ndarray:
        """m (n,)."""
        return np.asarray(np.linalg.norm(self.ends[:, 1] - self.ends[:, 0], axis=1))

    def chosen(self, rows: np.ndarray) -> EdgePieces:
        """Some of them."""
        shape = WedgeShape(self.shape.inward[rows], self.shape.normal[rows], self.shape.number[rows])
        return EdgePieces(self.ends[rows], shape, self.factor[rows], self.n_edges, self.n_other, self.longest_edge)

    def amplitudes(
        self,
        antennas: PulseGeometry,
        pulse: int,
        lit: np.ndarray,
        waves: np.ndarray,
        polarizations: Sequence[str],
        vertical: np.ndarray,
    ) -> tuple[np.ndarray, np.ndarray]:
        """Amplitudes of the pieces at a pulse, complex128 (n, n_polarizations, m), |a|^2 in m^2, and their ranges about
        the pulse's reference range, m, longdouble (n,), that these refer to.

        lit    where the part that both antennas see begins and ends, 0 to 1 along each piece (n, 2)
        waves  wave numbers 2 pi f/c, rad/m (m,)

        a = F L integral exp(j psi (s - 1/2)) ds over the lit part, where psi is k times the difference of the paths
        over both ends: phases meet from piece to piece, so that errors of their curvature are not added up along an
        edge. F is that of the middle of the lit part, between both ends.
        """
        ends = [antennas.tx[pulse], antennas.rx[pulse]][: 1 if antennas.is_monostatic else 2]
        up = tuple(float(x) for x in vertical)
        paths, matrices = [], []
        for places in self.ends.transpose(1, 0, 2):
            steps = [end.astype(np.longdouble) - places for end in ends]
            lengths = [np.sqrt((step**2).sum(axis=1)) for step in steps]
            paths.append(sum(lengths) / len(ends))
            looks = [(step / length[:, None]).astype(np.float64) for step, length in zip(steps, lengths, strict=True)]
            matrices.append(edge_matrix(self.shape, looks[0], looks[-1], up))  # type: ignore[arg-type]
        columns = [("HV".index(name[0]), "HV".index(name[1])) for name in polarizations]
        begin, end = ([matrix[:, r, t] for r, t in columns] for matrix in matrices)
        slope, center = np.subtract(end, begin), np.add(begin, end) / 2
        part, middle = lit[:, 1] - lit[:, 0], lit.sum(axis=1) / 2 - 0.5
        phase = waves * (2 * (paths[0] - paths[1])).astype(np.float64)[:, None]
        line = (self.factor * self.lengths * part)[:, None] * np.sinc(phase * part[:, None] / (2 * np.pi))
        sums = (center + slope * middle)[..., None] * line * np.exp(1j * phase * middle[:, None])
        reference = np.longdouble(antennas.reference_range[pulse])
        return np.asarray(sums.transpose(1, 0, 2)), (paths[0] + paths[1]) / 2 - reference


def edge_pieces(scene: Scene, crease: float, longest: float) -> EdgePieces:
    """The edges of a scene's smooth perfect conductors, in pieces no longer than `longest`, m.

    crease  rad: facets whose normals differ by less have no edge between them
    """
    from ...scene.wedges import joined, wedges  # imports scipy

    smooth = np.array([m.conducting and m.height == 0 for m in scene.materials], bool)[scene.material]
    conductor = smooth & (scene.roughness == 0) & (scene.reflectivity > 0)
    part = np.flatnonzero(joined(scene.triangles, conductor))
    every = wedges(scene.triangles[part], scene.two_sided[part], crease)
    of_conductors = conductor[part[every.faces]]
    mine = every.chosen(np.flatnonzero(of_conductors.all(axis=1)))
    faces = part[mine.faces]
    length = np.linalg.norm(mine.ends[:, 1] - mine.ends[:, 0], axis=1)
    parts = np.maximum(np.ceil(length / longest), 1).astype(int)
    row = np.repeat(np.arange(len(mine)), parts)
    at = (np.arange(len(row)) - np.repeat(np.cumsum(parts) - parts, parts))[:, None] + [0, 1]
    start, way = mine.ends[row, 0], mine.ends[row, 1] - mine.ends[row, 0]
    ends = start[:, None] + (at / parts[row][:, None])[..., None] * way[:, None]
    return EdgePieces(
        ends,
        WedgeShape(mine.inward[row], mine.normal[row], mine.number[row]),
        scene.reflectivity[faces].mean(axis=1)[row],
        len(mine),
        int(of_conductors.any(axis=1).sum()) - len(mine),
        float(length.max(initial=0.0)),
    )


class EdgeLight:
    """What antennas see of pieces of edges past the facets of a scene.

    Both ends of a piece are looked at. Where one is seen and the other is not, the end of the shadow is searched for by
    halving. Shadows that begin and end within one piece are missed.
    """

    def __init__(self, pieces: EdgePieces, device: Device, scene: Scene) -> None:
        self.pieces, self.rays = pieces, SceneRays(device, scene.triangles)
        half = np.pi * pieces.shape.number[:, None] / 2  # along the middle of the space outside
        self._out = OFF * self.rays.least * (np.cos(half) * pieces.shape.inward + np.sin(half) * pieces.shape.normal)

    def lit(self, antennas: Sequence[np.ndarray]) -> np.ndarray:
        """Where the part of each piece begins and ends that antennas at places, m (3,), all see: (n, 2), 0 to 1."""
        n = len(self.pieces)
        every = np.arange(n)
        seen = np.stack([self._seen(every, np.full(n, s), antennas) for s in (INSET, 1 - INSET)], axis=1)
        lit = np.where(seen.all(axis=1, keepdims=True), [0.0, 1.0], 0.0)
        part = np.flatnonzero(seen[:, 0] != seen[:, 1])
        begins = seen[part, 0]
        low, high = np.zeros(len(part)), np.ones(len(part))
        for _ in range(HALVINGS if len(part) else 0):
            middle = (low + high) / 2
            is_lit = self._seen(part, middle, antennas)
            low, high = np.where(is_lit == begins, middle, low), np.where(is_lit == begins, high, middle)
        border = (low + high) / 2
        lit[part] = np.where(begins[:, None], np.stack([0 * border, border], 1), np.stack([border, 0 * border + 1], 1))
        return lit

    def _seen(self, rows: np.ndarray, at: np.ndarray, antennas: Sequence[np.ndarray]) -> np.ndarray:
        """Whether all antennas see points at shares `at` of the lengths of pieces `rows`: (n,)."""
        ends = self.pieces.ends[rows]
        places = ends[:, 0] + at[:, None] * (ends[:, 1] - ends[:, 0]) + self._out[rows]
        seen = np.ones(len(rows), bool)
        for antenna in antennas:
            left = np.flatnonzero(seen)
            hidden = self.rays.any_hit(places[left], np.broadcast_to(antenna, (len(left), 3)))
            seen[left[hidden]] = False
        return seen


def longest_piece(wavelength: float, cell: float, distance: float, tolerance: float) -> float:
    """Length, m, up to which phase and amplitude are linear along a piece, and its amplitude smooth over the band.

    wavelength  m, the shortest;  cell  m, of range resolution;  distance  m, of the nearest antenna

    The two-way phase over the middle of a piece of length L differs by 2 k L^2/(8 R) from the mean of those over its
    ends, and directions turn by L/R, of which the square matters.
    """
    bent = np.sqrt(2 * tolerance * distance * wavelength / np.pi)
    return float(min(bent, np.sqrt(tolerance) * distance, cell / 4))
