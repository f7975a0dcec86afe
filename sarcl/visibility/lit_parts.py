"""The part of each facet that both antennas see past other facets, at every pulse: its share and its phase integral."""

from __future__ import annotations

import copy
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from ..base.boxes import box
from ..base.constants import EDGE_ON
from ..base.vectors import dot, rising, unit
from ..opencl.choose_device import with_float64
from ..opencl.device import Device
from ..scene.scene import Scene
from ..scene.terrain import above
from ..scene.triangles import areas, normals
from ._aspect_blocks import pulse_blocks, shadow_length
from ._bodies import bodies_of
from ._certain_shadows import MISSED
from ._clipping import TOGETHER, Clipper, Receivers
from ._shadow_pairs import candidate_pairs

# Corners nearer to a facet's plane than this, relative to the scene's diagonal, lie in it: sheets that coincide, or
# touch within the digits of float32 files, do not shadow one another
ON_PLANE = 1e-6
# Of few facets among many occluders, those that count are found first for pulses that turn by up to WIDE, rad: where
# there are FEW times as many occluders at least, and up to so many pairs
WIDE, FEW, MOST_PAIRS = 0.1, 16, 2**24
MOST_TURN = 1.0  # of the usual occluder's width, by which shadows may move within a block of pulses


@dataclass(frozen=True, eq=False)
class _Span:
    """Pulses first ... stop - 1 as they are seen from one of them: `at`, m (3,), places of its antennas.

    turn      rad: directions from the others differ by no more;  reach  m: they stand no farther away
    antennas  of all of them, m (n_pulses, 1 or 2, 3), about the origin of the kernels
    """

    first: int
    stop: int
    at: list[np.ndarray]
    turn: float
    reach: float
    antennas: np.ndarray


@dataclass(frozen=True, eq=False)
class _Block:
    """Pairs (n, 2) of a partly lit piece and an occluder, in the order of pieces, for the pulses of a span.

    parents   pairs of a given facet that is not seen whole and an occluder;  pairs  None: to be found anew
    """

    span: _Span
    parents: np.ndarray
    pairs: np.ndarray | None


@dataclass(frozen=True, eq=False)
class FacetPieces:
    """Pieces of facets, m (k, 3, 3), whose lit parts are computed.

    two_sided  (k,) bool: the others are left out where they face away;  wanted  (k,) bool: the others are not computed
    given      facets, m (m, 3, 3), of which the pieces are parts, and  of  which (k,). What antennas see of these is
               computed first, and then of the pieces of those that are not seen whole
    ground     (n,) bool, or one for all: occluders that make up a complete terrain below all antennas
    upper      (m,) bool, or one for all: given facets from which waves leave above that terrain: those that stand above
               it, and its own of which the upper side alone reflects
    forward    a second antenna sees what the first one lights from any side, shaded by other bodies alone
    clear      occluders that cast no shadow from each antenna (n, antennas) bool; None: all do
    """

    triangles: np.ndarray
    two_sided: np.ndarray
    wanted: np.ndarray
    given: np.ndarray
    of: np.ndarray
    ground: np.ndarray | bool = False
    upper: np.ndarray | bool = False
    forward: bool = False
    clear: np.ndarray | None = None

    @classmethod
    def uncut(
        cls, triangles: np.ndarray, two_sided: np.ndarray, *, forward: bool = False, **ground: np.ndarray
    ) -> FacetPieces:
        """Facets that are not cut, all of them wanted."""
        k = len(triangles)
        return cls(triangles, two_sided, np.ones(k, bool), triangles, np.arange(k), forward=forward, **ground)


def ground_of(scene: Scene, ends: list[np.ndarray]) -> np.ndarray:
    """True (k,) for the facets of a scene that make up its terrain: where that is complete, and lies below all
    antennas, m (n_pulses, 3) each."""
    on = None
    if scene.heights is not None and all(above(scene.heights, end).min() >= 0 for end in ends):
        on = scene.on_heights
    return np.zeros(len(scene.triangles), bool) if on is None else on


def upper_sides(scene: Scene, ground: np.ndarray) -> np.ndarray:
    """True (k,) for facets of the ground (k,) bool of a scene whose upper side alone reflects."""
    return np.asarray(ground & ~scene.two_sided & (normals(scene.triangles)[:, 2] > 0))


def _largest(values: np.ndarray) -> np.ndarray:
    """Largest of three values at the corners of each facet (n, 3): numpy takes ten times as long along so short an
    axis."""
    return np.maximum(np.maximum(values[:, 0], values[:, 1]), values[:, 2])


class LitParts:
    """Lit parts of pieces of facets, past others that occlude them, m (n, 3, 3), from antennas along a track.

    A device without float64 leaves this to another one on the machine; NoDeviceError where there is none.
    dark    (k,) bool: pieces of which no pulse sees anything
    partly  (k,) bool: the other pieces of which some pulse sees a part, or nothing
    """

    def __init__(
        self,
        device: Device,
        pieces: FacetPieces,
        occluders: np.ndarray,
        ends: list[np.ndarray],
        *,
        max_bytes: float,
        margin: float = 0.0,
        progress: Callable[[int, int], object] | None = None,
    ) -> None:
        """ends  positions of the transmitter, and of a receiver elsewhere, m (n_pulses, 3) each
        max_bytes  on the device;  margin  m: antennas asked for later stand up to this far from `ends`
        progress  called as progress(pulse, pulses)
        """
        self.max_bytes, self._margin, self._first = max_bytes, margin, 0
        triangles, two_sided, of = pieces.triangles, pieces.two_sided, pieces.of
        bounds = box(np.concatenate([pieces.given.reshape(-1, 3), occluders.reshape(-1, 3)]))
        self._origin = bounds.mean(axis=0)
        self._on_plane = ON_PLANE * float(np.linalg.norm(bounds[1] - bounds[0]))
        keep = np.flatnonzero(pieces.wanted & (areas(triangles) > 0))
        solid = areas(occluders) > 0
        self._bounds, self._occluders = bounds, occluders[solid]
        upward = np.where(np.broadcast_to(pieces.ground, len(solid))[solid, None], normals(self._occluders), 0.0)
        self._upward = upward * np.sign(upward[:, 2:])  # normals of the ground, 0 of other occluders
        own = others = None
        if pieces.forward and len(ends) == 2:
            body = bodies_of(np.concatenate([pieces.given, self._occluders]))
            own, others = body[: len(pieces.given)], body[len(pieces.given) :]
        frame = self._origin, self._on_plane, max_bytes
        clear = None if pieces.clear is None else pieces.clear[solid]
        self._clipper = Clipper(with_float64(device), self._occluders, *frame, others, clear)
        upper = np.broadcast_to(pieces.upper, len(pieces.given))
        self._parent, first = np.unique(of[keep], return_index=True)
        bodies = (None, None) if own is None else (own[of[keep]], own[self._parent])
        self._pieces = Receivers(keep, triangles[keep], two_sided[keep], upper[of[keep]], bodies[0])
        sides = two_sided[keep][first], upper[self._parent]
        parents = Receivers(self._parent, pieces.given[self._parent], *sides, bodies[1])
        self._child = np.searchsorted(self._parent, of[keep])  # the parent of each piece
        self._cut = len(parents.index) < len(keep)
        self._blocks: list[_Block] = []
        self.dark, self.partly = np.zeros((2, len(triangles)), bool)
        if len(keep) and len(self._occluders):
            self._look(parents, ends, progress)
        self._rows = np.flatnonzero(self.partly[keep])

    def _look(self, parents: Receivers, ends: list[np.ndarray], progress: Callable[[int, int], object] | None) -> None:
        """Find blocks of pulses, the pairs of pieces of each within `max_bytes`, and which are dark or partly lit."""
        kept = 0
        dark_pulses = np.zeros(len(self._child), np.int64)
        changing = np.zeros(len(self._child), bool)
        limits, n = self._limits(ends, np.arange(len(self._occluders))), len(parents.index)
        for outer in self._spans(ends, [max(WIDE, limit) for limit in limits]):
            within = [end[outer.first : outer.stop] for end in ends]
            spans = list(self._spans(within, limits, outer.first))
            casters = self._casters(parents, outer)
            if len(spans) > 2 and FEW * n <= len(self._occluders) and n * len(casters) <= MOST_PAIRS:
                casters = rising(self._pairs(parents, outer, casters)[:, 1])
                limits_of = self._limits(within, casters) if len(casters) else None
                spans = [outer] if limits_of is None else list(self._spans(within, limits_of, outer.first))
            for span in spans:
                pairs = self._pairs(parents, span, casters)
                if self._cut:
                    is_shaded, _ = self._seen(parents, pairs, span.antennas)
                    pairs = pairs[is_shaded[pairs[:, 0]]]
                block = _Block(span, pairs, None)
                pairs = self._pairs_of_pieces(block)
                is_shaded, dark = self._seen(self._pieces, pairs, span.antennas)
                dark_pulses += dark
                changing |= is_shaded
                pairs = pairs[is_shaded[pairs[:, 0]]]
                kept += pairs.nbytes
                self._blocks.append(replace(block, pairs=pairs if kept <= self.max_bytes else None))
                if progress:
                    progress(span.stop, len(ends[0]))
        dark = dark_pulses == len(ends[0])
        self.dark[self._pieces.index], self.partly[self._pieces.index] = dark, changing & ~dark

    def _casters(self, receivers: Receivers, span: _Span) -> np.ndarray:
        """Numbers of the occluders that may shade receivers from antennas of a span: a line of sight that leaves a
        terrain upwards enters it again only where that slopes away from the antenna."""
        if not (self._upward.any() and receivers.upper.all()):
            return np.arange(len(self._occluders))
        return np.flatnonzero(~np.all([self._is_near(at, self._turned(span)) for at in span.at], axis=0))

    def _is_near(self, at: np.ndarray, turn: float) -> np.ndarray:
        """Occluders of the terrain that face antennas within `turn`, rad, of a place, m (3,): (n,) bool."""
        is_near = self._upward[:, 2] > 0
        rows = np.flatnonzero(is_near)
        is_near[rows] = dot(self._upward[rows], unit(at - self._occluders[rows, 0])) > turn
        return np.asarray(is_near)

    def _limits(self, ends: list[np.ndarray], casters: np.ndarray) -> list[float]:
        """Angles, rad, by which each antenna may turn within a block of pulses for which these occluders count."""
        width = float(np.median(np.sqrt(areas(self._occluders[casters]))))
        return [MOST_TURN * width / max(shadow_length(self._bounds, end), 1e-300) for end in ends]

    def _spans(self, ends: list[np.ndarray], limits: list[float], first: int = 0) -> Iterator[_Span]:
        """Pulses from number `first` on, in blocks in each of which antennas turn by no more than limits, rad."""
        blocks, viewpoints, turns = pulse_blocks(ends, self._bounds, limits)
        for (start, stop), viewpoint, turn in zip(blocks.tolist(), viewpoints.tolist(), turns.tolist(), strict=True):
            at, places = [end[viewpoint] for end in ends], [end[start:stop] for end in ends]
            reach = max(float(np.linalg.norm(end - one, axis=1).max()) for end, one in zip(places, at, strict=True))
            antennas = np.stack(places, axis=1) - self._origin
            yield _Span(first + start, first + stop, at, turn, self._margin + reach, antennas)

    def _seen(self, receivers: Receivers, pairs: np.ndarray, antennas: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Receivers of which some pulse does not see the whole (n,) bool, and how many pulses see nothing of each: of
        those of which some pulse sees a part, too few."""
        which = rising(pairs[:, 0])
        is_shaded, dark = np.zeros(len(receivers.index), bool), np.zeros(len(receivers.index), np.int64)
        if self._margin:  # other antennas may see what these do not
            is_shaded[which] = True
            return is_shaded, dark
        partly = np.zeros(len(receivers.index), bool)
        for first, stop in ((0, 1), (1, len(antennas))):
            for _, rows, share, _ in self._clipper.light(receivers, which, pairs, antennas[first:stop], np.zeros(0)):
                dark[which[rows]] += (share == 0).sum(axis=0)
                is_shaded[which[rows]] |= (share < 1).any(axis=0)
                partly[which[rows]] |= ((share > 0) & (share < 1)).any(axis=0)
            # the first pulse tells of most: nothing else is asked of these
            which, pairs = which[~partly[which]], pairs[~partly[pairs[:, 0]]]
        return is_shaded, dark

    def _pairs_of(self, block: _Block) -> np.ndarray:
        """The pairs of a block, of the pieces that are partly lit."""
        pairs = self._pairs_of_pieces(block) if block.pairs is None else block.pairs
        return np.asarray(pairs[self.partly[self._pieces.index[pairs[:, 0]]]])

    def _pairs_of_pieces(self, block: _Block) -> np.ndarray:
        """Pairs of a piece and an occluder that may shade it, among the pairs of the facets that they are parts of."""
        if not self._cut:
            return block.parents
        is_shaded = np.zeros(len(self._parent), bool)
        is_shaded[block.parents[:, 0]] = True
        rows = np.flatnonzero(is_shaded[self._child])
        pairs = self._pairs(self._pieces.part(rows), block.span, rising(block.parents[:, 1]))
        pairs[:, 0] = rows[pairs[:, 0]]
        return pairs

    def _turned(self, span: _Span) -> float:
        """Angle, rad, by which directions to antennas differ from that to the one from which a span is seen."""
        away = min(float(np.linalg.norm(at - np.clip(at, *self._bounds))) for at in span.at)
        return min(span.turn + 1e-6 + (2 * self._margin / away if away else 2.0) * (self._margin > 0), 2.0)

    def _pairs(self, r: Receivers, span: _Span, numbers: np.ndarray) -> np.ndarray:
        """Pairs of a receiver and an occluder, of these numbers, that may cast a shadow on it from pulses of a span."""
        antennas, solid = span.at, self._occluders[numbers]
        about = solid - self._origin
        turn = self._turned(span)
        cosines = [dot(r.normal, unit(at - r.center)) for at in antennas]
        # a facet is not seen from a side that is turned away from an antenna by more than directions change
        # and between two antennas, one of which may be edge-on to it (physical_optics.py:lit_share)
        away_by = 2 * turn + (2 * EDGE_ON if len(antennas) == 2 else 0.0)
        fronts, backs = [c > -away_by for c in cosines], [c < away_by for c in cosines]
        if r.body is None:
            both = np.all(fronts, axis=0), r.two_sided & np.all(backs, axis=0)
            sides = [both] * len(antennas)
        else:  # the receiver may look at either side of what the transmitter lights
            sides = [(fronts[0], r.two_sided & backs[0]), (fronts[1], backs[1])]
        seen, level = np.flatnonzero(sides[0][0] | sides[0][1]), dot(r.normal, r.center - self._origin)

        def found(at: np.ndarray, front: np.ndarray, back: np.ndarray) -> Iterator[np.ndarray]:
            ahead = at - r.center
            distance = np.sqrt(dot(ahead, ahead))
            look = ahead / distance[:, None]
            corners = r.triangles - r.center[:, None]
            radius = np.sqrt((corners**2).sum(axis=2).max(axis=1))
            nearest = np.einsum("kij,kj->ki", corners, look).min(axis=1)
            # by what a direction to the antenna differs from `look`, anywhere on the facet and at any pulse
            astray = turn + radius / np.maximum(distance - radius, 1e-300)

            def casts(which: np.ndarray, casters: np.ndarray) -> np.ndarray:
                heights = np.einsum("ncj,nj->nc", about[casters], r.normal[which]) - level[which, None]
                above, below = _largest(heights) > self._on_plane, -_largest(-heights) < -self._on_plane
                shading = np.flatnonzero((front[which] & above) | (back[which] & below))
                which, casters = which[shading], casters[shading]
                places = solid[casters] - r.center[which, None]
                furthest = np.sqrt(_largest(np.einsum("ncj,ncj->nc", places, places))) + radius[which]
                ahead = _largest(np.einsum("ncj,nj->nc", places, look[which])) - nearest[which]
                ahead += furthest * astray[which]  # no shadow falls towards the antenna
                casting = np.zeros(len(heights), bool)
                casting[shading[ahead > 0]] = True
                return casting

            def among(which: np.ndarray, casters: np.ndarray) -> np.ndarray:
                facets, others = r.triangles[which], solid[casters]
                pairs = candidate_pairs(
                    facets, others, at, turn, span.reach, lambda pairs: casts(which[pairs[:, 0]], casters[pairs[:, 1]])
                )
                return which[pairs[:, 0]] * len(solid) + casters[pairs[:, 1]]

            # a line of sight that leaves the ground upwards enters it again only where it slopes away from the antenna
            near = self._is_near(at, turn)[numbers]
            yield among(seen, np.flatnonzero(~near))
            yield among(seen[~r.upper[seen]], np.flatnonzero(near))

        found_of = (found(at, *side) for at, side in zip(antennas, sides, strict=True))
        key = rising(np.concatenate([part for parts in found_of for part in parts]))
        pairs = np.stack([key // len(solid), numbers[key % len(solid)]], axis=1)
        return np.asarray(pairs[self._clipper.sorted_out(r, pairs, span.antennas, self._margin) != MISSED])

    def at(self, first: int, ends: list[np.ndarray], waves: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """What consecutive pulses from `first` on see of the partly lit facets, in their order.

        ends   antennas of these pulses, m (n, 3), one or two;  waves  wavenumbers k_m, rad/m (m,)
        Returns shares of the areas, 0 to 1, float32 (n, r), and the means of exp(j k_m (u_t + u_r).rho) over whole
        facets that count lit parts alone, rho from the centroid, complex64 (n, r, m).
        """
        n, first = len(ends[0]), first + self._first
        share = np.ones((n, len(self._rows)), np.float32)
        mean = np.empty((n, len(self._rows), len(waves)), np.complex64)
        for block in self._blocks:
            part = slice(max(block.span.first - first, 0), min(block.span.stop - first, n))
            if part.start < part.stop:
                antennas = np.stack([end[part] - self._origin for end in ends], axis=1)
                # the pairs of a span have been sorted out for all of its pulses
                together = TOGETHER if block.span.stop - block.span.first > TOGETHER[0] else TOGETHER[1:]
                for pulses, rows, part_share, part_mean in self._clipper.light(
                    self._pieces, self._rows, self._pairs_of(block), antennas, waves, together
                ):
                    share[part][pulses, rows] = part_share
                    mean[part][pulses, rows] = part_mean
        return share, mean

    def occluders_at(self, pulse: int, row: int) -> tuple[np.ndarray, np.ndarray | None]:
        """Facets that may cast a shadow on partly lit facet number `row`, as a pulse sees it, m (n, 3, 3); and which of
        them belong to other bodies (n,), of forward scatter alone."""
        pulse += self._first
        block = next(block for block in self._blocks if block.span.first <= pulse < block.span.stop)
        pairs = self._pairs_of(block)
        begin, end = np.searchsorted(pairs[:, 0], [self._rows[row], self._rows[row] + 1])
        some, bodies = pairs[begin:end, 1], self._clipper.bodies
        if bodies is None or self._pieces.body is None:
            return self._occluders[some], None
        return self._occluders[some], bodies[some] != self._pieces.body[self._rows[row]]

    def of_triangles(
        self, pulse: int, rows: np.ndarray, triangles: np.ndarray, ends: list[np.ndarray], waves: np.ndarray
    ) -> np.ndarray:
        """Means over triangles, m (n, 3, 3), that lie in partly lit facets of these numbers (n,), as `at` has them of
        whole facets: about their own centroids, complex64 (n, m).

        ends  antennas of the pulse, m (3,), one or two
        """
        pulse += self._first
        block = next(block for block in self._blocks if block.span.first <= pulse < block.span.stop)
        pairs, places = self._pairs_of(block), self._rows[rows]
        begin, end = (np.searchsorted(pairs[:, 0], places, side) for side in ("left", "right"))
        index = [np.arange(a, b) for a, b in zip(begin.tolist(), end.tolist(), strict=True)]
        own = np.repeat(np.arange(len(rows)), end - begin)
        clipped = replace(self._pieces.part(places), index=np.arange(len(rows)), triangles=triangles)
        of_own = np.stack([own, pairs[np.concatenate(index), 1]], axis=1) if len(own) else np.zeros((0, 2), pairs.dtype)
        antennas = np.stack([one - self._origin for one in ends])[None]
        mean = np.empty((len(rows), len(waves)), np.complex64)
        for _, part, _, values in self._clipper.light(clipped, np.arange(len(rows)), of_own, antennas, waves):
            mean[part] = values[0]
        return mean

    def facet_at(self, row: int) -> np.ndarray:
        """Corners of partly lit facet number `row`, m (3, 3), not moved by random heights, which shift no shadow."""
        return np.asarray(self._pieces.triangles[self._rows[row]])

    @property
    def on_plane(self) -> float:
        """Distance, m, from the plane of a facet below which corners of occluders lie in it."""
        return self._on_plane

    def between(self, first: int) -> LitParts:
        """The same, with pulses counted from `first`."""
        out = copy.copy(self)
        out._first = self._first + first
        return out
