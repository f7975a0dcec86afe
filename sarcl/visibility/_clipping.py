"""Facets clipped by the shadows on them, pulse by pulse: the engine of kernels/lit_parts.cl."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np

from ..base.vectors import cross, unit
from ..opencl.device import Device
from ..opencl.launch_numbers import launch_numbers
from ..scene.triangles import areas, centroids, edges, normals
from ._certain_shadows import COVERED, MISSED, UNDECIDED, certain_shadows
from ._shadow_pairs import PAIRS_AT_ONCE

KERNELS = "lit_parts.cl"
PARTS = {True: 16, False: 4}  # covered parts of an edge that are listed at once, by whether the device is a CPU
SHADOW = 15  # numbers of a shadow, as in the kernels
# Wavenumbers per launch, on CPUs and on other devices: GPUs keep the sums of no more in registers
MOST_WAVES = 8, 1
# Distance beside an edge at which the kernels look whether it is covered, relative to the facet's longest edge: above
# what rounding moves corners by
SLACK = 1e-12
# Pairs, and pulses, of which so few are clipped at every pulse: sorting shadows out takes longer than it saves
FEW_PAIRS, FEW_PULSES = 64, 2
# Pulses for which shadows that miss a facet, or cover it, are sorted out at once: of all facets, then of the rest
TOGETHER = 64, 16


@dataclass(frozen=True, eq=False)
class Receivers:
    """Facets whose lit part is computed: indices among all (k,), corners, m (k, 3, 3); whether both sides reflect, and
    whether the upper side of a terrain alone does (k,) bool; the number of the body of each (k,), for forward scatter
    alone."""

    index: np.ndarray
    triangles: np.ndarray
    two_sided: np.ndarray
    upper: np.ndarray
    body: np.ndarray | None = None
    center: np.ndarray = field(init=False)
    normal: np.ndarray = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "center", centroids(self.triangles))
        object.__setattr__(self, "normal", normals(self.triangles))

    def part(self, some: np.ndarray) -> Receivers:
        """Some of them."""
        body = None if self.body is None else self.body[some]
        return Receivers(self.index[some], self.triangles[some], self.two_sided[some], self.upper[some], body)

    def packed(self, which: np.ndarray, origin: np.ndarray, on_plane: float) -> np.ndarray:
        """Facets `which` as the kernels read them, about `origin` (n, RECEIVER)."""
        triangles, center, normal = self.triangles[which], self.center[which], self.normal[which]
        along = unit(triangles[:, 1] - triangles[:, 0])
        across = cross(normal, along)
        flat = np.stack(
            [((triangles - center[:, None]) * axis[:, None]).sum(axis=2) for axis in (along, across)], axis=2
        )
        longest = np.maximum.reduce(edges(triangles))
        slack = SLACK * longest
        columns = center - origin, along, across, normal, flat.reshape(-1, 6), areas(triangles)[:, None], slack[:, None]
        return np.concatenate([*columns, np.full((len(which), 1), on_plane)], axis=1)


@dataclass(frozen=True, eq=False)
class Clipper:
    """Occluders, m (n, 3, 3), whose shadows are cut off facets on a device.

    origin    of the kernels, m (3,);  on_plane  m: corners nearer to a facet's plane lie in it
    bodies    number of the body of each occluder (n,), for forward scatter alone: facets do not shade the receiver's
              view of those of their own body; None: for echoes of both antennas' sides
    clear     occluders that cast no shadow from each antenna (n, antennas) bool; None: all do
    """

    device: Device
    occluders: np.ndarray
    origin: np.ndarray
    on_plane: float
    max_bytes: float
    bodies: np.ndarray | None = None
    clear: np.ndarray | None = None

    def light(
        self, receivers: Receivers, which: np.ndarray, pairs: np.ndarray, antennas: np.ndarray, waves: np.ndarray,
        together: Sequence[int] = TOGETHER,
    ) -> Iterator[tuple[slice, np.ndarray, np.ndarray, np.ndarray]]:  # fmt: skip
        """Shares (n_pulses, n) and means (n_pulses, n, m) of some of `which`, increasing; in parts, each with its
        pulses, and with the places in `which` that it is of (n,). Others are seen whole, where no waves are asked for.

        pairs     (., 2), of these facets, in their order;  antennas  about the origin
        together  pulses for which shadows are sorted out at once, and then of these
        """
        if not len(antennas) or not len(which):
            return
        if len(pairs) < FEW_PAIRS or len(antennas) <= FEW_PULSES:
            clipped = np.flatnonzero(np.isin(which, pairs[:, 0]) | (len(waves) > 0))
            for pulses, part, share, mean in self._in_parts(receivers, which[clipped], pairs, antennas, waves):
                yield pulses, clipped[part], share, mean
            return
        for first in range(0, len(antennas), together[0]):
            block = antennas[first : first + together[0]]
            state = self.sorted_out(receivers, pairs, block)
            is_dark = np.isin(which, pairs[state == COVERED, 0])
            dark, shape = np.flatnonzero(is_dark), (len(block), int(is_dark.sum()))
            if len(dark):
                zeros = np.zeros(shape, np.float32), np.zeros((*shape, len(waves)), np.complex64)
                yield slice(first, first + len(block)), dark, *zeros
            undecided = pairs[state == UNDECIDED]
            undecided = undecided[~np.isin(undecided[:, 0], which[dark])]
            clipped = np.flatnonzero(~is_dark if len(waves) else np.isin(which, undecided[:, 0]))
            rest = receivers, which[clipped], undecided, block, waves
            for pulses, part, share, mean in self.light(*rest, together[1:]) if together[1:] else self._in_parts(*rest):
                yield slice(first + pulses.start, first + pulses.stop), clipped[part], share, mean

    def sorted_out(
        self, receivers: Receivers, pairs: np.ndarray, antennas: np.ndarray, margin: float = 0.0
    ) -> np.ndarray:
        """Of pairs (n, 2): whether shadows miss the receiver, or cover it, as antennas up to `margin`, m, from these
        cast them (n,)."""
        if self.bodies is None or receivers.body is None:
            state = self._state(receivers, pairs, antennas, margin)
            if self.clear is not None:  # the shadow that covers the receiver may be none
                state[(state == COVERED) & self.clear[pairs[:, 1]].any(axis=1)] = UNDECIDED
            return state
        # of forward scatter each antenna looks at its own side of a facet, and the second one past its own body
        tx, rx = (self._state(receivers, pairs, antennas[:, [end]], margin) for end in (0, 1))
        rx = np.where(self.bodies[pairs[:, 1]] == receivers.body[pairs[:, 0]], MISSED, rx)
        is_covered, is_missed = (tx == COVERED) | (rx == COVERED), (tx == MISSED) & (rx == MISSED)
        return np.where(is_covered, COVERED, np.where(is_missed, MISSED, UNDECIDED)).astype(np.uint8)

    def _state(self, receivers: Receivers, pairs: np.ndarray, antennas: np.ndarray, margin: float) -> np.ndarray:
        """As `sorted_out`, of antennas that look at one side of a facet."""
        state = np.empty(len(pairs), np.uint8)
        for first in range(0, len(pairs), PAIRS_AT_ONCE):
            part = slice(first, first + PAIRS_AT_ONCE)
            buffers = self._on_device(receivers, pairs[part])
            state[part] = certain_shadows(self.device, buffers, len(pairs[part]), antennas, margin)
        return state

    def _on_device(self, receivers: Receivers, pairs: np.ndarray) -> Sequence[object]:
        """Receivers of pairs, receiver and occluder of each, and occluders, as the kernels read them."""
        upload, n = self.device.upload, max(len(self.occluders), len(receivers.index))
        which, index = [], []
        for side in pairs.T:
            used = np.zeros(n, bool)
            used[side] = True
            which.append(np.flatnonzero(used))
            index.append((np.cumsum(used, dtype=np.int32) - 1)[side])
        solid = (self.occluders[which[1]] - self.origin).reshape(-1, 9)
        packed = receivers.packed(which[0], self.origin, self.on_plane)
        return upload(packed), upload(index[0]), upload(index[1]), upload(solid)

    def _in_parts(
        self, receivers: Receivers, which: np.ndarray, pairs: np.ndarray, antennas: np.ndarray, waves: np.ndarray
    ) -> Iterator[tuple[slice, np.ndarray, np.ndarray, np.ndarray]]:
        """Shares (n_pulses, n) and means (n_pulses, n, m) of `which`, increasing; in parts, each with all pulses and
        its places in `which`."""
        per_pair = antennas.shape[0] * antennas.shape[1] * (SHADOW * 8 + 1)
        most = int(np.clip(self.max_bytes / 2 / per_pair, 1, PAIRS_AT_ONCE))
        begins = np.searchsorted(pairs[:, 0], np.append(which, np.iinfo(np.int64).max))
        at = 0
        while at < len(which):
            until = max(at + 1, int(np.searchsorted(begins, begins[at] + most, "right")) - 1)
            some = slice(at, min(until, len(which), at + PAIRS_AT_ONCE))
            here = pairs[begins[some.start] : begins[some.stop], 1]
            light = self._computed(
                receivers, which[some], begins[some.start : some.stop + 1] - begins[at], here, antennas, waves
            )
            yield slice(0, len(antennas)), np.arange(some.start, some.stop), *light
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
        macros = {"ENDS": antennas.shape[1], "PARTS": PARTS[device.is_cpu], "FORWARD": int(self.bodies is not None)}
        cast = device.kernel(KERNELS, "cast_shadows", WAVES=0, **macros)
        receivers = device.upload(facets.packed(which, self.origin, self.on_plane))
        (pulses, ends), seen = antennas.shape[:2], device.upload(antennas)
        size = pulses * ends * n_pairs
        shadows, corners = device.empty(size * SHADOW * 8), device.empty(size)
        if len(occluder):
            picked, at = np.unique(occluder, return_inverse=True)
            solid = device.upload((self.occluders[picked] - self.origin).reshape(-1, 9))
            owner = np.repeat(np.arange(len(which), dtype=np.int32), np.diff(begins))
            if self.bodies is not None and facets.body is not None:
                at = np.where(self.bodies[occluder] == facets.body[which][owner], ~at, at)
            device.run(
                cast, (n_pairs, pulses * ends), None, launch_numbers(KERNELS, "cast_shadows", n_pairs=n_pairs),
                receivers, device.upload(owner), device.upload(at.astype(np.int32)), solid, seen, shadows, corners,
            )  # fmt: skip
            if self.clear is not None and self.clear[occluder].any():
                cast_by = device.download(corners, np.empty((pulses, ends, n_pairs), np.uint8))
                corners = device.upload(np.where(self.clear[occluder].T, np.uint8(0), cast_by))
        first, means = device.upload(begins.astype(np.int32)), []
        share = np.empty((pulses, len(which)), np.float32)
        most = MOST_WAVES[not device.is_cpu]
        for some in np.split(waves, range(most, len(waves), most)):
            light = device.kernel(KERNELS, "lit_parts", WAVES=len(some), **macros)
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
