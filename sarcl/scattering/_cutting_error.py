"""Errors of cut facets: how their echoes cancel, and what linear phases over each piece leave of the exact integral.

Errors of pieces add up as their echoes do. What all pieces of a facet have in common, such as the mean phase of the
wave's curvature over a piece, multiplies the echo of the whole facet: it cancels between pieces just as their echoes
cancel. What differs from piece to piece does not cancel: it adds up at random phases. Errors that repeat with a period
L would add up anew in a direction in which q L is a whole number of cycles, as those of a grating do. The period is
2^(1/2) times the longest edge of right-angled pieces: no such direction exists where q edge is below 2^(1/2) pi.

docs/theory/facets.md derives it; tests/scattering/test_facet_errors.py measures it against the exact integral.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from ..base.constants import SPEED_OF_LIGHT
from ..base.rows import spread_over
from ..base.vectors import unit
from ..opencl.device import Device
from ..scene.scene import Scene
from ..scene.terrain import Heights, above, is_overlooked
from ..scene.triangles import areas, bisect, centroids, cut, edges, normals
from ..visibility.lit_parts import ground_of
from ..visibility.rays import SceneRays
from . import facet_kinds
from ._facet_norm import (
    FACETS,
    FREQUENCIES,
    PIECES,
    Ends,
    FacetNorm,
    group_sums,
    lobe_wavenumbers,
    longest_piece,
    path_beyond,
    random_pieces,
)
from ._facet_sampling import drawn
from .facet_kinds import FacetView
from .mesh_quality.facet_groups import coplanar_groups
from .physical_optics import lit_share, normals_and_areas, scattering_matrix, triangle_integral, turned

GAIN_PULSES = 3
ERROR_PULSES = FEW_PULSES = 5
# pieces, pulses and frequencies at most at which the error of few looks at a small body is measured; fewest frequencies
MEASURED, FEWEST_FREQUENCIES = 12_000, 2
MEASURED_SAFETY = 1.5  # of pieces much longer than half a wavelength, parts may have more than a 16th of the error
SAFETY = 3.0  # the errors are estimated from samples, and may differ by regions of a facet rather than piece by piece
MOST_PHASE = np.pi  # rad along an edge: below, no direction exists in which the errors of pieces add up as in a grating


class CuttingError:
    """Errors of the coherent facets of a scene, cut to any edge; estimated from up to 200 of them."""

    def __init__(self, view: FacetView, steep: Sequence[Ends] = ()) -> None:
        """steep  antennas at other pulses at which errors are estimated too"""
        scene, mirror, antennas, vertical = view.scene, view.mirror, view.antennas, view.vertical
        some = np.flatnonzero(mirror)
        if len(some):
            length = np.maximum.reduce(edges(scene.triangles[some]))
            chosen = drawn(areas(scene.triangles[some]), FACETS, np.random.default_rng(0))[0]
            chosen[0] = np.argmax(length) if len(some) > FACETS else chosen[0]
            some = some[chosen]
        self._triangles, self._two_sided = scene.triangles[some], scene.two_sided[some]
        self._view, self._numbers = view, some
        self._length = np.maximum.reduce(edges(self._triangles)) if len(some) else np.zeros(0)
        self._every = len(some) == int(mirror.sum()) and len(antennas.tx) <= FEW_PULSES
        if self._every and len(some):
            self._plane = coplanar_groups(scene, some, facet_kinds.random(scene)[some])
            self._waves = lobe_wavenumbers(view.center, view.bandwidth, self._triangles, self._plane)
        self._columns, self._forward = view.columns, antennas.forward
        self._vertical = vertical[0], vertical[1], vertical[2]
        eps = np.array([m.permittivity(view.highest) for m in scene.materials], np.complex128)
        self._permittivity, self._reflectivity = eps[scene.material[some]], scene.reflectivity[some]
        self._wavenumber = 2 * np.pi * view.highest / SPEED_OF_LIGHT
        ends = antennas.tx, antennas.rx
        gain_ends = [(ends[0][row], ends[1][row]) for row in spread_over(len(ends[0]), GAIN_PULSES)]
        self._norm = FacetNorm(scene, mirror, gain_ends, view.center, view.bandwidth, self._sees)
        self._ends = [(ends[0][row], ends[1][row]) for row in spread_over(len(ends[0]), ERROR_PULSES)]
        self._error_ends = [*self._ends, *steep]
        self._phase: float | None = None
        self._measured: dict[float, float | None] = {}
        self._clips = False  # whether antennas have been found to see a part of some piece
        self._errors: dict[float, float] = {}

    @cached_property
    def _casters(self) -> _Casters | None:
        """What shades facets, None where all of them are seen whole."""
        view = self._view
        if view.shades is None or view.antennas.forward or len(view.scene.triangles) < 2:
            return None
        return _Casters.of(view.scene, view.antennas.ends, view.shades)

    def _sees(self, places: np.ndarray, facets: np.ndarray, ends: Ends) -> np.ndarray:
        """Whether antennas at `ends` see places, m (n, 3), on facets (n,) past others, from a side that reflects."""
        scene = self._view.scene
        n, to_tx, to_rx = normals(scene.triangles[facets]), unit(ends[0] - places), unit(ends[1] - places)
        behind = scene.two_sided[facets] & turned(n, to_tx, to_rx, self._forward)
        seen = lit_share(np.where(behind[:, None], -n, n), to_tx, to_rx, self._forward) > 0
        return seen if self._casters is None else seen & ~self._casters.hide(places, facets, ends)

    def gain(self, edge: float) -> float:
        """Norm of facets cut to `edge`, m (inf: not at all), over that of the facets as they are given, those of one
        plane as one, both added with random phases; at least 1."""
        return self._norm.gain(edge)

    def relative(self, edge: float) -> float:
        """Error of linear phases over pieces, relative to these at random phases; inf where pieces are too long.

        It is estimated from pieces drawn from those that cutting makes, at the highest frequency and five pulses.
        """
        if self._phase is None:
            self._phase = self._largest_phase()
        if not self._phase or self._phase * edge > MOST_PHASE:
            return float("inf")
        if edge not in self._errors:
            self._errors[edge] = self._error(edge, self._norm.gain_of_cutting(edge))
        return self._errors[edge]

    def measured(self, edge: float) -> float | None:
        """Error of all facets and pulses, relative to the facets as they are; None where that would take too long.

        Of few looks at a small body the errors of pieces are added up, each with its own phase: averages over pulses
        and frequencies say nothing of one look, in which the errors of pieces may all be in phase. Only what the
        antennas see past other facets counts: a bright facet in shadow would hide the errors of the others.
        """
        if not self._every:
            return None
        if edge not in self._measured:
            n = float(np.maximum(1.0, 1.5 * (self._length / edge) ** 2).sum()) * len(self._ends)
            frequencies = min(FREQUENCIES, int(MEASURED / n))
            self._measured[edge] = self._fallen(edge, frequencies) if frequencies >= FEWEST_FREQUENCIES else None
        return self._measured[edge]

    def _fallen(self, edge: float, frequencies: int) -> float | None:
        """As `measured`: where edges of shadows, known by rays to middles of parts alone, cross pieces, the errors of
        one length may cancel by chance. They fall with the square of the edge, and no more is trusted."""
        error, coarser = self._measure(edge, frequencies), min((one for one in self._measured if one > edge), default=0)
        before = self._measured.get(coarser) if self._clips else None
        return error if error is None or before is None else max(error, before * (edge / coarser) ** 2)

    def _measure(self, edge: float, frequencies: int) -> float | None:
        parts, of = cut(self._triangles, longest_piece(edge), MEASURED)
        plane, places = self._plane[of], centroids(parts)
        planes = np.unique(self._plane, return_index=True)[1]  # the first facet of each
        first = centroids(self._triangles)[planes]
        middle = first[plane]
        wrong, right = np.zeros(()), np.zeros(())
        for ends in self._ends:
            seen, path = self._seen(parts, of, ends, 4), path_beyond(ends, middle, places - middle)
            self._clips |= seen.is_clipped
            between = path_beyond(ends, first[:1], first - first[:1])
            for waves in self._waves.T[:: -(-FREQUENCIES // frequencies)]:
                k = waves[plane]
                echo, finer = seen.echoes(k)
                phase, phases = np.exp(-1j * k * path), np.exp(-1j * waves * between)
                for values, total in ((16 / 15 * (finer - echo), wrong), (finer, right)):
                    sums = np.stack([group_sums(plane, phase * column, len(first)) for column in values.T])
                    total += max(float((np.abs(sums) ** 2).sum()), float((np.abs(sums @ phases) ** 2).sum()))
        return MEASURED_SAFETY * float(np.sqrt(wrong / right)) if right else None

    def _largest_phase(self) -> float:
        """Largest component of q in the plane of a facet that both antennas see, rad/m; 0 where none is seen."""
        corners, most = self._triangles.reshape(-1, 3), 0.0
        n, two_sided = (np.repeat(a, 3, axis=0) for a in (normals_and_areas(self._triangles)[0], self._two_sided))
        for ends in self._ends:
            looks = [unit(end - corners) for end in ends]
            is_back = two_sided & turned(n, looks[0], looks[1], self._forward)
            seen = lit_share(np.where(is_back[:, None], -n, n), looks[0], looks[1], self._forward) > 0
            q = looks[0] + looks[1]
            across = np.linalg.norm(q - n * (n * q).sum(axis=1)[:, None], axis=1)
            most = max(most, float(across[seen].max(initial=0.0)))
        return most * self._wavenumber

    def _error(self, edge: float, gain: float) -> float:
        n, each = len(self._triangles), self._each
        pieces = random_pieces(np.repeat(self._triangles, each, axis=0), edge)
        of, weight = np.repeat(np.arange(n), each), np.repeat(areas(self._triangles), each) / areas(pieces)

        def summed(values: np.ndarray) -> np.ndarray:
            return np.asarray((weight * values.sum(axis=1)).reshape(n, each).sum(axis=1))

        common = rest = power = 0.0
        for ends in self._error_ends:
            seen = self._seen(pieces, of, ends, 2)
            echo, finer = seen.echoes(np.full(len(pieces), self._wavenumber))
            error = 4 / 3 * (finer - echo)  # pieces of half the size have a quarter of it
            powers = summed(np.abs(echo) ** 2)
            shared = summed(error * echo.conj()) / np.where(powers > 0, powers, 1)
            common += float((np.abs(shared) ** 2 * powers).sum())
            rest += float(summed(np.abs(error - np.repeat(shared, each)[:, None] * echo) ** 2).sum())
            power += float(powers.sum())
        return SAFETY * float(np.sqrt((common / gain**2 + rest) / power)) if power else float("inf")

    def _seen(self, pieces: np.ndarray, of: np.ndarray, ends: Ends, bisections: int) -> _Seen:
        """What antennas at `ends` see of pieces (n, 3, 3) past others of the scene, and of the 2^bisections parts of
        each; of  facets (n,)."""
        places, finer = centroids(pieces), [pieces]
        for _ in range(bisections):
            finer = [half for one in finer for half in bisect(one, np.asarray(edges(one)))]
        parts = [(pieces, np.zeros(len(pieces)))]
        parts += [(one, path_beyond(ends, places, centroids(one) - places)) for one in finer]
        seen = _Seen([(one, *self._scattering(one, of, ends), path) for one, path in parts])
        return seen if self._casters is None else seen.shaded(self._casters, self._numbers[of], ends)

    def _scattering(self, triangles: np.ndarray, of: np.ndarray, ends: Ends) -> tuple[np.ndarray, np.ndarray]:
        """S times the reflectivity, complex128 (n, n polarisations), and u_t + u_r (n, 3)."""
        places = centroids(triangles)
        to_tx, to_rx = (unit(end - places) for end in ends)
        normals = normals_and_areas(triangles)[0]
        behind = self._two_sided[of] & turned(normals, to_tx, to_rx, self._forward)
        normals = np.where(behind[:, None], -normals, normals)
        matrix = scattering_matrix(normals, to_tx, to_rx, self._permittivity[of], self._vertical, self._forward)
        return matrix.reshape(-1, 4)[:, self._columns] * self._reflectivity[of, None], to_tx + to_rx

    @property
    def _each(self) -> int:
        """Sampled pieces per facet."""
        return -(-PIECES // len(self._triangles))


@dataclass(frozen=True, eq=False)
class _Seen:
    """Pieces, then the parts of each: triangles (n, 3, 3), S (n, n polarisations), u_t + u_r (n, 3), and the two-way
    path beyond that of the piece's centroid, m (n,).

    lit  whether antennas see the middle of each part (n,); None: all of them
    """

    parts: list[tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]]
    lit: list[np.ndarray] | None = None

    @property
    def is_clipped(self) -> bool:
        """Whether antennas see a part of some piece."""
        return self.lit is not None and bool((np.any(self.lit, axis=0) & ~np.all(self.lit, axis=0)).any())

    def shaded(self, casters: _Casters, facet: np.ndarray, ends: Ends) -> _Seen:
        """The same with what antennas at `ends` see past others of the scene's facets; facet  of each piece (n,)."""
        places = [centroids(triangles) for triangles, *_ in self.parts[1:]]
        return replace(self, lit=[~casters.hide(one, facet, ends) for one in places])

    def echoes(self, k: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """S I of the pieces with linear phase, about their centroids, complex128 (n, n polarisations), and the same as
        sums over their parts; k  rad/m (n,)."""

        matrices, q, path = self._columns
        values = self._integrals(k, q, path)[..., None]
        if self.lit is None:
            return matrices[0] * values[0], np.asarray((matrices[1:] * values[1:]).sum(axis=0))
        lit = np.stack(self.lit)[..., None]
        finer = (lit * matrices[1:] * values[1:]).sum(axis=0)
        partly, echo = ~lit.all(axis=0), values[0]
        if partly.any():  # the linear phase of the piece, over its parts that are lit
            places = centroids(self._triangles).reshape(q.shape)
            linear = self._integrals(k, np.broadcast_to(q[0], q.shape), -(q[0] * (places - places[0])).sum(axis=-1))
            echo = np.where(partly, (lit * linear[1:, :, None]).sum(axis=0), echo)
        return matrices[0] * echo, finer

    @cached_property
    def _triangles(self) -> np.ndarray:
        """Pieces and parts in one array: where pieces are few, a call of NumPy for each takes ten times as long."""
        return np.concatenate([triangles for triangles, *_ in self.parts])

    @cached_property
    def _columns(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """S, u_t + u_r and the paths of pieces and parts: (1 + n parts, n, ...)."""
        matrices, q, path = (np.stack(column) for column in list(zip(*self.parts, strict=True))[1:])
        return matrices, q, path

    def _integrals(self, k: np.ndarray, q: np.ndarray, path: np.ndarray) -> np.ndarray:
        """I of pieces and parts, with the phases of `path`, complex128 (1 + n parts, n)."""
        integrals = triangle_integral(self._triangles, (k[:, None] * q).reshape(-1, 3)).reshape(path.shape)
        return np.asarray(integrals * np.exp(-1j * k * path))


@dataclass(frozen=True, eq=False)
class _Casters:
    """Facets of a scene that cast shadows: rays that meet them, and their numbers among these (k,), -1: none.

    heights  terrain that is not among them, None: it is, or there is none. Lines of sight that climb more steeply than
             it does are hidden by it where they begin below it
    """

    rays: SceneRays
    numbers: np.ndarray
    heights: Heights | None

    @classmethod
    def of(cls, scene: Scene, ends: Sequence[np.ndarray], device: Device) -> _Casters:
        """Those of a scene, seen from antennas, m (n_pulses, 3) each."""
        ground, heights = ground_of(scene, list(ends)), scene.heights
        rest = scene.triangles[~ground]
        if heights is None or len(rest) in (0, len(ground)) or not is_overlooked(heights, scene.bounds, list(ends)):
            return cls(SceneRays(device, scene.triangles), np.arange(len(ground)), None)
        return cls(SceneRays(device, rest), np.where(ground, -1, np.cumsum(~ground) - 1), heights)

    def hide(self, places: np.ndarray, facets: np.ndarray, ends: Ends) -> np.ndarray:
        """Whether other facets hide places, m (n, 3), on facets (n,), from one of both antennas."""
        ways, leaving = ends[:1] if np.array_equal(*ends) else ends, self.numbers[facets]
        out = np.any([self.rays.any_hit(places, np.tile(e, (len(places), 1)), leaving=leaving) for e in ways], axis=0)
        if self.heights is not None:
            out |= above(self.heights, places) < -self.rays.least
        return np.asarray(out)
