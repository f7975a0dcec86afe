"""The part of each facet that both antennas see past other facets, at every pulse: its share and its phase integral."""

from __future__ import annotations

import copy
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace

import numpy as np

from ..base.boxes import box
from ..base.constants import EDGE_ON
from ..base.vectors import dot, unit
from ..opencl.choose_device import with_float64
from ..opencl.device import Device
from ..opencl.launch_numbers import launch_numbers
from ..scene.triangles import areas, centroids, edges, normals
from ._aspect_blocks import pulse_blocks, shadow_length
from ._shadow_pairs import PAIRS_AT_ONCE, candidate_pairs

KERNELS = "lit_parts.cl"
SHADOW = 15  # numbers of a shadow, as in the kernels
# Wavenumbers per launch, on CPUs and on other devices: GPUs keep the sums of no more in registers
MOST_WAVES = 4, 1
# Distance beside an edge at which the kernels look whether it is covered, relative to the facet's longest edge: above
# what rounding moves corners by
SLACK = 1e-12
# Corners nearer to a facet's plane than this, relative to the scene's diagonal, lie in it: sheets that coincide, or
# touch within the digits of float32 files, do not shadow one another
ON_PLANE = 1e-6
MOST_TURN = 0.25  # of the usual occluder's width, by which shadows may move within a block of pulses


@dataclass(frozen=True, eq=False)
class _Block:
    """Pulses first ... stop - 1, and pairs (n, 2) of a partly lit piece and an occluder, in the order of pieces.

    antennas  m (3,), turn, rad, and reach, m: as `_pairs` takes them
    parents   pairs of a given facet that is not seen whole and an occluder;  pairs  None: to be found anew
    """

    first: int
    stop: int
    antennas: list[np.ndarray]
    turn: float
    reach: float
    parents: np.ndarray
    pairs: np.ndarray | None


class LitParts:
    """Pieces of facets, m (k, 3, 3), and others that occlude them, m (n, 3, 3), from antennas along a track.

    A device without float64 leaves this to another one on the machine; NoDeviceError where there is none.
    dark    (k,) bool: pieces of which no pulse sees anything
    partly  (k,) bool: the other pieces of which some pulse sees a part, or nothing
    """

    def __init__(
        self,
        device: Device,
        triangles: np.ndarray,
        occluders: np.ndarray,
        ends: list[np.ndarray],
        *,
        two_sided: np.ndarray,
        wanted: np.ndarray,
        max_bytes: float,
        margin: float = 0.0,
        given: np.ndarray | None = None,
        of: np.ndarray | None = None,
        progress: Callable[[int, int], object] | None = None,
    ) -> None:
        """ends  positions of the transmitter, and of a receiver elsewhere, m (n_pulses, 3) each
        two_sided  (k,) bool: the others are left out where they face away;  wanted  (k,) bool: pieces whose lit part
        is computed;  max_bytes  on the device;  margin  m: antennas asked for later stand up to this far from `ends`
        given  facets, m (m, 3, 3), of which the pieces are parts, and `of` which (k,): default each its own. What
               pulses see of these is found first, and then of the pieces of those that are not seen whole
        progress  called as progress(pulse, pulses)
        """
        self.device, self.max_bytes, self._margin, self._first = with_float64(device), max_bytes, margin, 0
        if given is None or of is None:
            given, of = triangles, np.arange(len(triangles))
        bounds = box(np.concatenate([given.reshape(-1, 3), occluders.reshape(-1, 3)]))
        self._origin = bounds.mean(axis=0)
        self._on_plane = ON_PLANE * float(np.linalg.norm(bounds[1] - bounds[0]))
        keep = np.flatnonzero(wanted & (areas(triangles) > 0))
        self._bounds, self._occluders = bounds, occluders[areas(occluders) > 0]
        self._pieces = Receivers(keep, triangles[keep], two_sided[keep])
        self._parent, first = np.unique(of[keep], return_index=True)
        parents = Receivers(self._parent, given[self._parent], two_sided[keep][first])
        self._child = np.searchsorted(self._parent, of[keep])  # the parent of each piece
        self._cut = len(parents.index) < len(keep)
        self._blocks: list[_Block] = []
        self.dark, self.partly = np.zeros((2, len(triangles)), bool)
        if len(keep) and len(self._occluders):
            self._look(parents, ends, progress)
        self._rows = np.flatnonzero(self.partly[keep])

    def _look(self, parents: Receivers, ends: list[np.ndarray], progress: Callable[[int, int], object] | None) -> None:
        """Find blocks of pulses, the pairs of each within `max_bytes`, and which pieces are dark or partly lit."""
        bounds, kept = self._bounds, 0
        width = float(np.median(np.sqrt(areas(self._occluders))))
        limits = [MOST_TURN * width / max(shadow_length(bounds, end), 1e-300) for end in ends]
        blocks, viewpoints, turns = pulse_blocks(ends, bounds, limits)
        dark_pulses = np.zeros(len(self._child), np.int64)
        changing = np.zeros(len(self._child), bool)
        for (first, stop), viewpoint, turn in zip(blocks.tolist(), viewpoints.tolist(), turns.tolist(), strict=True):
            at, antennas = [end[viewpoint] for end in ends], [end[first:stop] for end in ends]
            reach = self._margin + max(
                float(np.linalg.norm(end[first:stop] - end[viewpoint], axis=1).max()) for end in ends
            )
            pairs = self._pairs(parents, at, turn, reach, self._occluders)
            if self._cut:
                here, _ = self._seen(parents, pairs, antennas)
                pairs = pairs[here[pairs[:, 0]]]
            block = _Block(first, stop, at, turn, reach, pairs, None)
            pairs = self._pairs_of_pieces(block)
            here, dark = self._seen(self._pieces, pairs, antennas)
            dark_pulses += dark
            changing |= here
            pairs = pairs[here[pairs[:, 0]]]
            kept += pairs.nbytes
            self._blocks.append(replace(block, pairs=pairs if kept <= self.max_bytes else None))
            if progress:
                progress(stop, len(ends[0]))
        dark = dark_pulses == len(ends[0])
        self.dark[self._pieces.index], self.partly[self._pieces.index] = dark, changing & ~dark

    def _seen(
        self, receivers: Receivers, pairs: np.ndarray, antennas: list[np.ndarray]
    ) -> tuple[np.ndarray, np.ndarray]:
        """Receivers of which some pulse does not see the whole (n,) bool, and how many pulses see nothing of each."""
        which = np.unique(pairs[:, 0])
        here, dark = np.zeros(len(receivers.index), bool), np.zeros(len(receivers.index), np.int64)
        if self._margin:  # other antennas may see what these do not
            here[which] = True
            return here, dark
        for some, share, _ in self._light(receivers, which, pairs, antennas, np.zeros(0)):
            dark[which[some]] = (share == 0).sum(axis=0)
            here[which[some]] = (share < 1).any(axis=0)
        return here, dark

    def _pairs_of(self, block: _Block) -> np.ndarray:
        """The pairs of a block, of the pieces that are partly lit."""
        pairs = self._pairs_of_pieces(block) if block.pairs is None else block.pairs
        return np.asarray(pairs[self.partly[self._pieces.index[pairs[:, 0]]]])

    def _pairs_of_pieces(self, block: _Block) -> np.ndarray:
        """Pairs of a piece and an occluder that may shade it, among the pairs of the facets that they are parts of."""
        if not self._cut:
            return block.parents
        parents = np.unique(block.parents[:, 0])
        solid = np.unique(block.parents[:, 1])
        some = np.flatnonzero(np.isin(self._child, parents))
        pairs = self._pairs(self._pieces.part(some), block.antennas, block.turn, block.reach, self._occluders[solid])
        return np.stack([some[pairs[:, 0]], solid[pairs[:, 1]]], axis=1)

    def _pairs(
        self, r: Receivers, antennas: list[np.ndarray], turn: float, reach: float, solid: np.ndarray
    ) -> np.ndarray:
        """Pairs of a receiver and an occluder, m (n, 3, 3), that may cast a shadow on it from pulses near one."""
        away = min(float(np.linalg.norm(at - np.clip(at, *self._bounds))) for at in antennas)
        turn = min(turn + 1e-6 + (2 * self._margin / away if away else 2.0) * (self._margin > 0), 2.0)
        cosines = [dot(r.normal, unit(at - r.center)) for at in antennas]
        # a facet is not seen from a side that is turned away from an antenna by more than directions change
        # and between two antennas, one of which may be edge-on to it (scattering/physical_optics.py:lit_share)
        away_by = 2 * turn + (2 * EDGE_ON if len(antennas) == 2 else 0.0)
        front = np.all([c > -away_by for c in cosines], axis=0)
        back = r.two_sided & np.all([c < away_by for c in cosines], axis=0)
        seen = np.flatnonzero(front | back)

        def found(at: np.ndarray) -> np.ndarray:
            ahead = at - r.center
            distance = np.sqrt(dot(ahead, ahead))
            look = ahead / distance[:, None]
            corners = r.triangles - r.center[:, None]
            radius = np.sqrt((corners**2).sum(axis=2).max(axis=1))
            nearest = np.einsum("kij,kj->ki", corners, look).min(axis=1)
            # by what a direction to the antenna differs from `look`, anywhere on the facet and at any pulse
            astray = turn + radius / np.maximum(distance - radius, 1e-300)

            def casts(pairs: np.ndarray) -> np.ndarray:
                which = seen[pairs[:, 0]]
                places = solid[pairs[:, 1]] - r.center[which, None]
                heights = (places * r.normal[which, None]).sum(axis=2)
                above, below = heights.max(axis=1) > self._on_plane, heights.min(axis=1) < -self._on_plane
                furthest = np.sqrt((places**2).sum(axis=2).max(axis=1)) + radius[which]
                ahead = (places * look[which, None]).sum(axis=2).max(axis=1) - nearest[which]
                ahead += furthest * astray[which]  # no shadow falls towards the antenna
                return np.asarray(((front[which] & above) | (back[which] & below)) & (ahead > 0))

            return candidate_pairs(r.triangles[seen], solid, at, turn, reach, casts)

        found_of = [found(at) for at in antennas]
        pairs = found_of[0] if len(found_of) == 1 else np.unique(np.concatenate(found_of), axis=0)
        pairs[:, 0] = seen[pairs[:, 0]]
        return pairs

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
            here = slice(max(block.first - first, 0), min(block.stop - first, n))
            if here.start < here.stop:
                antennas = [end[here] for end in ends]
                for some, part_share, part_mean in self._light(
                    self._pieces, self._rows, self._pairs_of(block), antennas, waves
                ):
                    share[here, some], mean[here, some] = part_share, part_mean
        return share, mean

    def occluders_at(self, pulse: int, row: int) -> np.ndarray:
        """Facets that may cast a shadow on partly lit facet number `row`, as a pulse sees it, m (n, 3, 3)."""
        pulse += self._first
        block = next(block for block in self._blocks if block.first <= pulse < block.stop)
        pairs = self._pairs_of(block)
        begin, end = np.searchsorted(pairs[:, 0], [self._rows[row], self._rows[row] + 1])
        return np.asarray(self._occluders[pairs[begin:end, 1]])

    @property
    def on_plane(self) -> float:
        """Distance, m, from the plane of a facet below which corners of occluders lie in it."""
        return self._on_plane

    def between(self, first: int) -> LitParts:
        """The same, with pulses counted from `first`."""
        out = copy.copy(self)
        out._first = self._first + first
        return out

    def _light(
        self, receivers: Receivers, which: np.ndarray, pairs: np.ndarray, ends: list[np.ndarray], waves: np.ndarray
    ) -> Iterator[tuple[slice, np.ndarray, np.ndarray]]:
        """Shares (n_pulses, n) and means (n_pulses, n, m) of `which`, increasing; in parts, each with its slice.

        pairs  (., 2), of these facets, in their order
        """
        antennas = np.stack([end - self._origin for end in ends], axis=1)
        per_pair = antennas.shape[0] * len(ends) * (SHADOW * 8 + 1)
        most = int(np.clip(self.max_bytes / 2 / per_pair, 1, PAIRS_AT_ONCE))
        begins = np.searchsorted(pairs[:, 0], np.append(which, np.iinfo(np.int64).max))
        at = 0
        while at < len(which):
            until = max(at + 1, int(np.searchsorted(begins, begins[at] + most, "right")) - 1)
            some = slice(at, min(until, len(which), at + PAIRS_AT_ONCE))
            here = pairs[begins[some.start] : begins[some.stop], 1]
            yield (
                some,
                *self._computed(
                    receivers, which[some], begins[some.start : some.stop + 1] - begins[at], here, antennas, waves
                ),
            )
            at = some.stop

    def _computed(
        self,
        facets: Receivers,
        which: np.ndarray,
        begins: np.ndarray,
        occluder: np.ndarray,
        antennas: np.ndarray,
        waves: np.ndarray,
    ) -> tuple[np.ndarray, np.ndarray]:
        """Shares (n_pulses, n) and means (n_pulses, n, m) of facets `which`, of whose pairs these are the occluders."""
        device, n_pairs = self.device, max(len(occluder), 1)
        cast = device.kernel(KERNELS, "cast_shadows", ENDS=antennas.shape[1], WAVES=0)
        receivers = device.upload(facets.packed(which, self._origin, self._on_plane))
        (pulses, ends), seen = antennas.shape[:2], device.upload(antennas)
        size = pulses * ends * n_pairs
        shadows, corners = device.empty(size * SHADOW * 8), device.empty(size)
        if len(occluder):
            picked, at = np.unique(occluder, return_inverse=True)
            solid = device.upload((self._occluders[picked] - self._origin).reshape(-1, 9))
            owner = np.repeat(np.arange(len(which), dtype=np.int32), np.diff(begins))
            device.run(
                cast, (n_pairs, pulses * ends), None, launch_numbers(KERNELS, "cast_shadows", n_pairs=n_pairs),
                receivers, device.upload(owner), device.upload(at.astype(np.int32)), solid, seen, shadows, corners,
            )  # fmt: skip
        first, means = device.upload(begins.astype(np.int32)), []
        share = np.empty((pulses, len(which)), np.float32)
        most = MOST_WAVES[not device.is_cpu]
        for some in np.split(waves, range(most, len(waves), most)):
            light = device.kernel(KERNELS, "lit_parts", ENDS=antennas.shape[1], WAVES=len(some))
            mean = np.empty((pulses, len(which), len(some)), np.complex64)
            out = device.empty(share.nbytes), device.empty(max(mean.nbytes, 8))
            device.run(
                light, (len(which), pulses), None,
                launch_numbers(KERNELS, "lit_parts", n_pairs=n_pairs),
                receivers, first, seen, shadows, corners, device.upload(np.append(some, 0.0)), *out,
            )  # fmt: skip
            device.download(out[0], share)
            means.append(device.download(out[1], mean) if len(some) else mean)
        return share, np.concatenate(means, axis=2)


@dataclass(frozen=True, eq=False)
class Receivers:
    """Facets whose lit part is computed: indices among all (k,), corners, m (k, 3, 3); whether both sides reflect."""

    index: np.ndarray
    triangles: np.ndarray
    two_sided: np.ndarray
    center: np.ndarray = field(init=False)
    normal: np.ndarray = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "center", centroids(self.triangles))
        object.__setattr__(self, "normal", normals(self.triangles))

    def part(self, some: np.ndarray) -> Receivers:
        """Some of them."""
        return Receivers(self.index[some], self.triangles[some], self.two_sided[some])

    def packed(self, which: np.ndarray, origin: np.ndarray, on_plane: float) -> np.ndarray:
        """Facets `which` as the kernels read them, about `origin` (n, RECEIVER)."""
        triangles, center, normal = self.triangles[which], self.center[which], self.normal[which]
        along = unit(triangles[:, 1] - triangles[:, 0])
        across = np.cross(normal, along)
        flat = np.stack(
            [((triangles - center[:, None]) * axis[:, None]).sum(axis=2) for axis in (along, across)], axis=2
        )
        longest = np.maximum.reduce(edges(triangles))
        slack = SLACK * longest
        columns = center - origin, along, across, normal, flat.reshape(-1, 6), areas(triangles)[:, None], slack[:, None]
        return np.concatenate([*columns, np.full((len(which), 1), on_plane)], axis=1)
