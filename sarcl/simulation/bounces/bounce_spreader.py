"""Echoes of beams that two facets or more reflect one after the other, added to samples on the host in float64."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, TypeAlias

import numpy as np

from ...base.boxes import box
from ...base.constants import SPEED_OF_LIGHT
from ...base.errors import warn
from ...base.stage_timer import Clock
from ...numerics.polynomials import chebyshev, lagrange
from ...scattering.edge_diffraction import WedgeShape
from ...scene.scene import Scene
from ...scene.triangles import bisect, edges, solid
from ..spreading import ChannelView, Counts
from . import _sums
from ._amplitudes import Coatings, Facets
from ._beams import Beams, Ground, Surfaces, in_blocks
from ._facet_tree import MOST_PAIRS, PAIR_BYTES
from ._flat_facets import closed, joined_facets, tiles
from ._paths import BeamLimits, LitBeams, Paths, blocks
from ._polygons import Polygons, joined
from ._transitions import LARGEST, LONGEST_DETOUR, Transitions, free_edges
from ._weak_beams import Budget

PULSES_AT_ONCE, BEAMS_AT_ONCE = 128, 60_000  # pulses of a block, and pairs of these and facets that reflect to others
WEAK = 0.1  # of the tolerance: sum of the bounds of beams that are left out
CURVATURE = 0.9  # rad over the tolerance: rms phase of the wave's curvature over a triangle; the rest is for weak beams
# Rms of what curvature, less its mean, adds over a triangle, over what it adds at the corner that is farthest from the
# centroid: 0.15 to 0.20 of needles, 0.19 of equilateral triangles
ROOT_MEAN_SQUARE = 0.2
DIRECTION = 0.5  # rad over the root of the tolerance: by which directions change over a triangle
PROFILES = 1 / 300  # of the tolerance: error of sums over frequencies
MOST_SHADING = 20_000  # facets that only cast shadows, from which on joining them would take longer than it saves
FLATNESS = 0.25  # rad over the tolerance: phases of corners of a flat part, by their distances from its plane
NARROW = 0.5  # share of the area in facets narrower than a wavelength from which on there is a warning
CELLS, CELL = 200_000, 0.5  # parts of facets beside edges that are held together, area over tolerance wavelength^2
NODES = 6  # frequencies at which matrices of dispersive materials are computed

DiffractingEdges: TypeAlias = tuple[np.ndarray, WedgeShape]  # ends, m (e, 2, 3), and wedges


@dataclass(frozen=True, eq=False)
class BounceScene:
    """Facets of a scene that reflect to one another, about `origin`, m (3,).

    bounces    of the last order that is followed;  tolerance  relative to the bounced echoes at random phases
    flat       m: parts of a mesh are joined where their corners are no farther from one plane
    """

    surfaces: Surfaces
    coatings: Coatings
    origin: np.ndarray
    bounces: int
    tolerance: float
    flat: float
    limits: BeamLimits = field(default_factory=BeamLimits)

    @classmethod
    def of(
        cls, scene: Scene, bounces: int, tolerance: float, frequency: float, max_bytes: float = np.inf
    ) -> BounceScene | None:
        """The facets of a scene, None where no two of them reflect.

        frequency  the highest, Hz;  max_bytes  for beams at a time
        """
        if bounces == 1:
            return None
        fine = np.array([m.height for m in scene.materials])[scene.material]
        is_solid = solid(scene.triangles)
        mirrors = np.isfinite(fine) & (scene.reflectivity != 0) & is_solid
        if mirrors.sum() < 2:
            return None
        ground, origin = None, box(scene.triangles[is_solid].reshape(-1, 3)).mean(axis=0)
        if scene.heights is not None and (~mirrors).sum() > MOST_SHADING:
            on = scene.on_heights
            if on is not None and not mirrors[on].any():
                ground = Ground(scene.triangles[on & is_solid] - origin, scene.heights, origin)
                is_solid &= ~on
        solids = np.flatnonzero(is_solid)
        triangles, mirrors = scene.triangles[solids], mirrors[solids]
        height = np.hypot(np.where(mirrors, fine[solids], 0.0), scene.roughness[solids])
        coatings = Coatings(scene.material[solids], scene.materials, scene.reflectivity[solids], height)
        polygons, is_closed = Polygons.of(triangles - origin), closed(triangles)
        surfaces = Surfaces(polygons, scene.two_sided[solids], mirrors, is_closed, ground=ground)
        flat = FLATNESS * tolerance * SPEED_OF_LIGHT / frequency / (4 * np.pi)
        limits = BeamLimits(most_pairs=int(min(MOST_PAIRS, max_bytes / PAIR_BYTES)))
        return cls(surfaces, coatings, origin, bounces, tolerance, flat, limits)

    def refuse_many(self, tx: np.ndarray, rx: np.ndarray) -> None:
        """MemoryError where facets may reflect to one another in too many ways, as seen from antennas, m (n, 3), at the
        pulses that are looked at first, in the middle and last."""
        tx, rx = tx - self.origin, rx - self.origin
        surfaces = self.joined[0].seen_from(np.concatenate([tx, rx]))
        rows = list(blocks(surfaces, tx, rx, PULSES_AT_ONCE))
        for i in sorted({0, len(rows) // 2, len(rows) - 1}):
            paths = Paths(surfaces, tx[rows[i]], rx[rows[i]], self.bounces, self.limits)
            number = paths.first_facets[1]
            if number > self.limits.most_ways:
                raise MemoryError(
                    f"facets of this scene may reflect to one another in about {number:.0e} ways, more than the "
                    f"{self.limits.most_ways:.0e} that are followed; take fewer bounces, a coarser mesh, or rough "
                    "materials (height inf) for what need not reflect to others"
                )

    @cached_property
    def joined(self) -> tuple[Surfaces, Coatings]:
        """These facets, triangles of one plane and material joined where together they are convex."""
        surfaces, coatings = self.surfaces, self.coatings
        joins = surfaces.mirrors | ((~surfaces.mirrors).sum() <= MOST_SHADING)
        joinable, single = np.flatnonzero(joins), np.flatnonzero(~joins)
        alike = coatings.material, coatings.reflectivity, coatings.height, surfaces.two_sided, surfaces.mirrors
        groups = np.unique(np.stack([values[joinable] for values in alike], axis=1), axis=0, return_inverse=True)[
            1
        ].ravel()
        polygons, first = joined_facets(surfaces.corners[joinable], groups, surfaces.diagonal, self.flat)
        polygons = joined([polygons, surfaces.polygons[single]]) if len(single) else polygons
        polygons, first = tiles(polygons, np.append(joinable[first], single), surfaces.diagonal)
        coatings = Coatings(
            coatings.material[first], coatings.materials, coatings.reflectivity[first], coatings.height[first]
        )
        flags = surfaces.two_sided[first], surfaces.mirrors[first], surfaces.closed[first]
        return Surfaces(polygons, *flags, self.limits.most_pairs, surfaces.ground), coatings

    def narrow_share(self, wavelength: float) -> float:
        """Share of the area that reflects to others in facets narrower than a wavelength, m, once flat parts are
        joined."""
        polygons = self.joined[0].polygons[self.joined[0].mirrors]
        area, length = polygons.area, 2 * polygons.spheres[1]
        return float(area[area < wavelength * length].sum() / area.sum())

    @cached_property
    def mirrors(self) -> np.ndarray:
        """Numbers of the facets that reflect."""
        return np.flatnonzero(self.surfaces.mirrors)


class BounceSpreader:
    """Adds the echoes of 2 ... n reflections in a channel: the part of each beam that lights a facet and that the
    receiver sees, by physical optics on that facet.

    predicted_error  relative to these echoes at random phases
    narrow           share of the area in facets narrower than a wavelength
    """

    def __init__(self, scene: BounceScene, view: ChannelView, diffracting: DiffractingEdges | None = None) -> None:
        self.scene, self.view = scene, view
        self.predicted_error = scene.tolerance
        surfaces, self._coatings = scene.joined
        antennas = np.concatenate([view.antennas.tx, view.antennas.rx]) - scene.origin
        self._surfaces = surfaces.seen_from(antennas)
        wavelength = SPEED_OF_LIGHT / float(np.median(view.frequencies))
        self._free: np.ndarray | None = None
        self._beside = dict[str, Any]()
        if diffracting is not None and surfaces.diagonal > LARGEST * wavelength:
            left_out = f"left out, the scene is larger than {LARGEST:.0f} wavelengths (docs/theory/edges.md)"
            self._beside = {"waves beside edges, between reflections": left_out}
        elif diffracting is not None:
            self._free = free_edges(surfaces, diffracting[0] - scene.origin, diffracting[1])
            self._beside = {"waves beside edges, between reflections": f"{int(self._free.any(axis=-1).sum())} edges"}
        self.narrow = scene.narrow_share(wavelength)
        if self.narrow > NARROW:
            warn(
                f"mesh too fine for bounces={scene.bounces}: {self.narrow:.0%} of the reflecting area is in facets "
                f"narrower than the wavelength, {wavelength:.2g} m, whose waves spread more than those of geometrical "
                "optics; take a coarser mesh of curved parts (flat ones are joined), or a higher frequency",
                "narrow facets",
            )

    @property
    def has_transitions(self) -> bool:
        """Whether waves beside free edges are computed."""
        return self._free is not None

    def describe(self) -> dict[str, Any]:
        """Words and numbers for a report."""
        narrow = {"facets narrower than a wavelength": f"{self.narrow:.0%} of the area"} if self.narrow > NARROW else {}
        return narrow | self._beside

    def add(
        self, samples: np.ndarray, pulses: Sequence[int], clock: Clock, on_progress: Callable[[int], object]
    ) -> Counts:
        """Add to samples (n_pulses, n_polarizations, n_samples) of consecutive `pulses` of the antennas."""
        clock.lap("echo")
        counts, numbers = Counts(), np.asarray(pulses)
        for rows in self._blocks(numbers):
            values, part = self.values(numbers[rows], self.view.frequencies)
            samples[rows] += values.astype(np.complex64)
            counts += replace(part, power=float((np.abs(samples[rows]) ** 2).sum() / samples.shape[-1]))
            on_progress(counts.pairs)
        clock.lap("bounces")
        return counts

    def exactly(self, pulses: np.ndarray, frequencies: np.ndarray) -> Iterator[tuple[slice, np.ndarray]]:
        """Echoes of blocks of pulses (n,), and which these are, added one by one: see `values`."""
        for rows in self._blocks(pulses):
            yield rows, self.values(pulses[rows], frequencies, exact=True)[0]

    def _blocks(self, pulses: np.ndarray) -> Iterator[slice]:
        """Slices of pulses that are looked at together."""
        antennas = self.view.antennas
        tx, rx = (end[pulses] - self.scene.origin for end in (antennas.tx, antennas.rx))
        return blocks(self._surfaces, tx, rx, PULSES_AT_ONCE)

    def values(self, pulses: np.ndarray, frequencies: np.ndarray, *, exact: bool = False) -> tuple[np.ndarray, Counts]:
        """Echoes of pulses (n,) at frequencies, Hz, complex128 (n, n_polarizations, n_f); exact: added one by one."""
        view, scene = self.view, self.scene
        out = np.zeros((len(pulses), len(view.polarizations), len(frequencies)), np.complex128)
        counts, tx, rx = Counts(), *(end[pulses] - scene.origin for end in (view.antennas.tx, view.antennas.rx))
        paths, half = Paths(self._surfaces, tx, rx, scene.bounces, scene.limits), len(pulses) // 2
        if len(paths.first_facets[0]) * len(pulses) > BEAMS_AT_ONCE and half:
            (a, counts), (b, more) = (self.values(p, frequencies, exact=exact) for p in (pulses[:half], pulses[half:]))
            return np.concatenate([a, b]), counts + more
        share = 0.0 if exact or view.weights.is_needed else WEAK * scene.tolerance
        zeros = np.zeros((2, len(pulses)))
        budget = Budget(self._coatings, frequencies, len(view.polarizations), share, *zeros)
        for lit in paths.followed(budget):
            echo, outside, late, latest = np.zeros_like(out), 0, 0.0, -np.inf
            for rows in self._pieces_at_once(lit, rx):
                triangles = self._facets(lit.beams, lit.pieces[np.arange(rows.start, rows.stop)], lit.of[rows], rx)
                inside = self._inside(triangles, pulses)
                hidden = np.setdiff1d(triangles.of, inside.of)
                self._add(echo, pulses, frequencies, inside, exact)
                if len(hidden):
                    power, last = self._late(triangles, hidden, pulses)
                    outside, late, latest = outside + len(hidden), late + power, max(latest, last)
            budget.power += (np.abs(echo) ** 2).sum(axis=1).mean(axis=1)
            out += echo
            if self._free is not None:
                numbers = np.unique(lit.of)
                numbers = numbers[self._free[lit.beams.chains[:, :-1]].any(axis=(1, 2, 3))[lit.beams.chain[numbers]]]
                if len(numbers):
                    out += self._transitions(self._free, paths, lit.part(numbers), pulses, frequencies, exact)
            done = len(np.unique(lit.of)) - outside
            orders = (0,) * (lit.beams.order - 1) + (done,)
            unseen = lit.n_pairs - lit.n_weak - outside - done
            counts += Counts(lit.n_pairs, outside, 0, 0, unseen, lit.n_weak, orders, late, latest=latest)
        return out, counts

    def _transitions(
        self,
        free: np.ndarray,
        paths: Paths,
        lit: LitBeams,
        pulses: np.ndarray,
        frequencies: np.ndarray,
        exact: bool,
    ) -> np.ndarray:
        """What Fresnel's transitions at free edges (k, n, 2) of facets change of the echoes of beams: as `values`."""
        out = np.zeros((2, len(pulses), len(self.view.polarizations), len(frequencies)), np.complex128)
        sharp = self._facets(lit.beams, lit.pieces, lit.of, paths.rx)
        self._add(out[0], pulses, frequencies, self._inside(sharp, pulses), exact)
        edges, polygons = Transitions.of(self._surfaces, free, lit.beams)
        beams = replace(lit.beams, polygons=polygons)
        pieces, of = paths.unshaded(beams)
        facets, rx = self._facets(beams, pieces, of, paths.rx) if len(of) else sharp, paths.rx[beams.pulse]
        highest, tolerance = float(frequencies.max()), self.scene.tolerance
        cell = CELL * tolerance * (SPEED_OF_LIGHT / highest) ** 2
        for rows in in_blocks(1 + (facets.areas / cell).astype(int), CELLS):
            triangles, of = edges.cut(facets.triangles[rows], facets.of[rows], rx, highest, tolerance)
            if len(of):
                cells = Facets(triangles, beams[of], rx[of], of)
                self._add(out[1], pulses, frequencies, self._inside(cells, pulses), exact, edges)
        return np.asarray(out[1] - out[0])

    def _pieces_at_once(self, lit: LitBeams, rx: np.ndarray) -> list[slice]:
        """Slices of the pieces of beams, each with all pieces of a beam, whose triangles memory holds."""
        beams, rows = lit.beams, lit.of
        bend = sum(1 / np.linalg.norm(end[rows] - lit.pieces.center, axis=1) for end in (beams.apex, rx[beams.pulse]))
        number = 1 + lit.pieces.area / self._longest(np.asarray(bend)) ** 2
        first = np.searchsorted(rows, np.unique(rows))
        parts = in_blocks(np.add.reduceat(number, first), self.scene.limits.most_pairs) if len(rows) else []
        ends = np.append(first, len(rows))
        return [slice(ends[part.start], ends[part.stop]) for part in parts]

    def _longest(self, bend: np.ndarray) -> np.ndarray:
        """Longest distance of a triangle's corner from its centroid, m (n,); bend  sum of curvatures, 1/m."""
        wave = 2 * np.pi * float(self.view.frequencies[-1]) / SPEED_OF_LIGHT
        # a triangle has the gain of its centroid: smaller ones where gains change over a beam
        share = 1.0 if self.view.weights.is_needed else ROOT_MEAN_SQUARE
        curved = np.sqrt(CURVATURE * self.scene.tolerance / (share * wave / 2 * bend))
        return np.asarray(np.minimum(curved, DIRECTION * np.sqrt(self.scene.tolerance) / bend))

    def _facets(self, beams: Beams, pieces: Polygons, of: np.ndarray, rx: np.ndarray) -> Facets:
        """Triangles that are together the pieces of beams, small enough for plane waves."""
        triangles, piece = pieces.triangles
        of = of[piece]
        parts, numbers = [], []
        while len(triangles):
            center = triangles.mean(axis=1)
            radius = np.linalg.norm(triangles - center[:, None], axis=-1).max(axis=1)
            bend = sum(1 / np.linalg.norm(end[of] - center, axis=1) for end in (beams.apex, rx[beams.pulse]))
            long = radius > self._longest(np.asarray(bend))
            parts.append(triangles[~long])
            numbers.append(of[~long])
            triangles, of = (
                np.concatenate(bisect(triangles[long], np.asarray(edges(triangles[long])))),
                np.tile(of[long], 2),
            )
        of = np.concatenate(numbers)
        return Facets(np.concatenate(parts), beams[of], rx[beams.pulse[of]], of)

    def _inside(self, facets: Facets, pulses: np.ndarray) -> Facets:
        """The triangles inside the range window, and the parts inside it of those that its edges cross.

        These are cut along lines of constant half path, which is taken as linear over a triangle, as its phase is.
        """
        if not self.view.gated:
            return facets
        antennas, row = self.view.antennas, pulses[facets.beams.pulse]
        delta, reach = facets.path / 2 - antennas.reference_range[row], facets.widest / 2
        from_near, to_far = delta - antennas.near[row], antennas.far[row] - delta
        least = np.minimum(from_near, to_far)
        at_edge = np.flatnonzero((least > -reach) & (least < reach))
        is_inside = least >= 0
        is_inside[at_edge] = False
        rows_inside = np.flatnonzero(is_inside)
        if not len(at_edge):
            return facets.chosen(rows_inside)
        parts = Polygons.of(facets.triangles[at_edge])
        for sign, distance in ((-0.5, from_near), (0.5, to_far)):
            rise = np.einsum("nij,nj->ni", parts.corners - facets.center[at_edge, None], sign * facets.both[at_edge])
            parts = parts.clipped(distance[at_edge, None] + rise)
        triangles, part = parts.triangles
        rows = np.concatenate([rows_inside, at_edge[part]])
        order = np.argsort(rows, kind="stable")  # triangles in the order in which they came
        corners = np.concatenate([facets.triangles[rows_inside], triangles])[order]
        rows = rows[order]
        return Facets(corners, facets.beams[rows], facets.rx[rows], facets.of[rows])

    def _late(self, triangles: Facets, beams: np.ndarray, pulses: np.ndarray) -> tuple[float, float]:
        """Power of beams of these numbers (n,) in a sample, and the latest half path about the reference, m."""
        late = triangles.chosen(np.flatnonzero(np.isin(triangles.of, beams)))
        delta = late.path / 2 - self.view.antennas.reference_range[pulses[late.beams.pulse]]
        frequency = float(np.median(self.view.frequencies))
        sent = late.shapes(np.array([frequency]), self._coatings) * self._weighted(late, pulses, frequency)
        sent *= np.exp(-4j * np.pi * frequency / SPEED_OF_LIGHT * delta)[:, None]
        sums = np.zeros((int(late.of.max()) + 1, sent.shape[1]), np.complex128)
        np.add.at(sums, late.of, sent)
        return float((np.abs(sums) ** 2).sum()), float(delta.max())

    def _add(
        self,
        out: np.ndarray,
        pulses: np.ndarray,
        frequencies: np.ndarray,
        facets: Facets,
        exact: bool,
        transitions: Transitions | None = None,
    ) -> None:
        view, scene, coatings = self.view, self.scene, self._coatings
        row = facets.beams.pulse
        delay = (facets.path - 2 * view.antennas.reference_range[pulses[row]]) / SPEED_OF_LIGHT
        band = np.array([frequencies.min(), frequencies.max()])
        varies = coatings.disperses or view.weights.varies_over_band
        at = chebyshev(band.mean(), float(np.ptp(band)), NODES) if varies and np.ptp(band) else band[:1]
        matrices = np.stack([self._weighted(facets, pulses, float(f)) for f in at], axis=1)

        def amplitudes(rows: np.ndarray, wanted: np.ndarray) -> np.ndarray:
            basis = lagrange(at, wanted)
            triangles = facets.chosen(rows)
            shapes = triangles.shapes(wanted, coatings)
            if transitions is not None:
                shapes *= transitions.factors(triangles.of, triangles.center, wanted)
            return np.asarray(shapes[:, :, None] * np.einsum("nmj,mf->nfj", matrices[rows], basis))

        error = PROFILES * scene.tolerance
        extra = 1 + (NODES - 1) * varies + 4 * bool(coatings.height.any())
        widest = facets.widest + (0 if transitions is None else LONGEST_DETOUR * SPEED_OF_LIGHT / band[0])
        nodes = _sums.nodes_for(np.pi * float(np.ptp(band)) / SPEED_OF_LIGHT * widest, error, extra)
        if exact:  # at any frequencies
            nodes = np.full(len(nodes), len(frequencies))
        _sums.add(out, frequencies, _sums.Delays(row, delay), amplitudes, nodes, error)

    def _weighted(self, facets: Facets, pulses: np.ndarray, frequency: float) -> np.ndarray:
        """Matrices of triangles times the weights of the antennas, complex128 (n, n_polarizations)."""
        view, beams = self.view, facets.beams
        numbers, antennas = pulses[beams.pulse], view.antennas
        is_reciprocal = view.weights.is_same_both_ways & (antennas.tx[numbers] == antennas.rx[numbers]).all(axis=1)
        out = facets.matrices(frequency, self._coatings, view.polarizations, view.vertical, is_reciprocal)
        if not view.weights.is_needed:
            return out
        leaving = facets.rays()[0] * np.linalg.norm(facets.center - beams.apex, axis=1)[:, None]
        for row in np.unique(beams.pulse).tolist():
            rows = np.flatnonzero(beams.pulse == row)
            ways = leaving[rows], (facets.center - facets.rx)[rows]
            out[rows] *= view.weights.of_paths(*ways, int(pulses[row]), frequency)[:, None]
        return out
