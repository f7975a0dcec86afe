"""The share of each facet that both antennas see, by blocks of pulses: back faces, terrain horizons, rays."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from ..base.errors import warn
from ..base.validation import array, choice, number, sealed
from ..opencl.choose_device import open_device
from ..opencl.device import Device, DeviceChoice
from ..opencl.memory_budget import budget
from ..scene.terrain import check_above, heights_of
from ._aspect_blocks import STRIDE, blocks_around, enough_looks, lever, pulse_blocks, reach, scene_box
from ._facet_samples import PROBES, SAMPLES, places
from ._ray_casting import Facets, Frame, Occluders
from ._terrain_horizon import Terrain

log = logging.getLogger(__name__)

FEW = 4096  # facets that get all their samples at once
LARGE = 4  # times the lower quartile of edges: facets on which a whole shadow may lie between corners and centre
CHUNK = 2**22  # facets at a time


@dataclass(frozen=True, eq=False)
class Span:
    """Pulses first ... stop - 1, and lit shares, uint8 (k,), at the first and at pulse `stop`."""

    first: int
    stop: int
    share: np.ndarray
    later: np.ndarray

    def moments(self, pulses: np.ndarray) -> np.ndarray:
        """How far from first to stop pulses (n,) are; 0 where nothing changes."""
        if self.later is self.share:
            return np.zeros(len(pulses), np.float32)
        return ((pulses - self.first) / np.float32(self.stop - self.first)).astype(np.float32)


@dataclass(frozen=True, eq=False)
class Lighting:
    """Shares of k facets that both antennas see, looked at once for all pulses of a block.

    blocks      first and last + 1 of the pulses, int64 (n_blocks, 2)
    viewpoints  the pulse of each block that was looked from (n_blocks,)
    dark        (k,) bool: facets no antenna pair ever sees any of
    full        (k,) bool: facets always seen as a whole
    dark_facets how many none of which is seen, of those wanted, in each block (n_blocks,)
    """

    blocks: np.ndarray
    viewpoints: np.ndarray
    dark: np.ndarray
    full: np.ndarray
    dark_facets: np.ndarray
    _usual: np.ndarray = field(repr=False)
    _changes: list[tuple[np.ndarray, np.ndarray]] = field(repr=False)
    _look: Callable[[int], np.ndarray] = field(repr=False)

    def __len__(self) -> int:
        return len(self.blocks)

    def share(self, block: int) -> np.ndarray:
        """Lit shares in a block, uint8 (k,): 255 is all of a facet. Looked up, or looked at again (max_bytes)."""
        if not -len(self) <= block < len(self):
            raise IndexError(f"block is {block}; there are {len(self)}")
        block %= len(self)
        if block >= len(self._changes):
            return self._look(block)
        out = self._usual.copy()
        index, value = self._changes[block]
        out[index] = value
        return out

    def fraction(self, block: int) -> np.ndarray:
        """Lit shares in a block, float32 (k,), 0 to 1."""
        return self.share(block) / np.float32(255)

    def block_of(self, pulse: int) -> int:
        """The block that holds a pulse."""
        if not 0 <= pulse < self.blocks[-1, 1]:
            raise IndexError(f"pulse is {pulse}; there are {self.blocks[-1, 1]}")
        return int(np.searchsorted(self.blocks[:, 0], pulse, side="right")) - 1

    def spans(self) -> Iterator[Span]:
        """The track from one pulse that was looked from to the next: shares change evenly between them."""
        n, held, start = int(self.blocks[-1, 1]), self.share(0), 0
        at = self.viewpoints.tolist()
        for i in range(1, len(self)):
            share = self.share(i)
            if not np.array_equal(share, held):
                if start < at[i - 1]:  # nothing has changed up to there
                    yield Span(start, at[i - 1], held, held)
                yield Span(at[i - 1], at[i], held, share)
                held, start = share, at[i]
        yield Span(start, n, held, held)

    def between(self, first: int, stop: int) -> Part:
        """Of pulses first ... stop - 1 alone, which then are pulses 0 ..."""
        return Part(self, first, stop)

    def fraction_at(self, pulse: int) -> np.ndarray:
        """Lit shares at a pulse, float32 (k,), 0 to 1: between those of the pulses looked from."""
        after = int(np.searchsorted(self.viewpoints, pulse, side="right"))
        one, two = max(after - 1, 0), min(after, len(self) - 1)
        before, behind = int(self.viewpoints[one]), int(self.viewpoints[two])
        part = np.float32((pulse - before) / (behind - before)) if behind > before and pulse > before else np.float32(0)
        return self.fraction(one) + part * (self.fraction(two) - self.fraction(one))

    def dark_pairs(self) -> int:
        """Pairs of a pulse and a wanted facet none of which is seen: facing away, or in shadow."""
        return int(((self.blocks[:, 1] - self.blocks[:, 0]) * self.dark_facets).sum())


@dataclass(frozen=True, eq=False)
class Part:
    """The lighting of pulses first ... stop - 1, counted from 0."""

    whole: Lighting
    first: int
    stop: int

    def spans(self) -> Iterator[Span]:
        """As `Lighting.spans`."""
        for span in self.whole.spans():
            first, stop = max(span.first, self.first), min(span.stop, self.stop)
            if first >= stop:
                continue
            if span.later is span.share:
                yield Span(first - self.first, stop - self.first, span.share, span.share)
                continue
            ends = span.moments(np.array([first, stop]))
            shares = [_mixed(span, moment) for moment in ends.tolist()]
            yield Span(first - self.first, stop - self.first, *shares)

    def between(self, first: int, stop: int) -> Part:
        """As `Lighting.between`."""
        return Part(self.whole, self.first + first, self.first + stop)

    def fraction_at(self, pulse: int) -> np.ndarray:
        """As `Lighting.fraction_at`."""
        return self.whole.fraction_at(pulse + self.first)


def _mixed(span: Span, moment: float) -> np.ndarray:
    """Shares at a moment of a span, uint8."""
    return np.rint(span.share + np.float32(moment) * (span.later - span.share.astype(np.float32))).astype(np.uint8)


class Light:
    """A scene on a device, ready to be looked at from antennas: arguments as of `lit`."""

    def __init__(
        self,
        device: Device,
        triangles: np.ndarray,
        *,
        heights: Any = None,
        on_heights: np.ndarray | None = None,
        two_sided: np.ndarray | bool = True,
        wanted: np.ndarray | None = None,
        tolerance: float = 0.25,
        engine: str = "opencl",
    ) -> None:
        self.device, k = device, len(triangles)
        on = np.full(k, heights is not None) if on_heights is None else on_heights
        self.frame = frame = Frame.around(scene_box(triangles, heights))
        self.terrain = None if heights is None else Terrain(device, heights, frame)
        one_sided = np.broadcast_to(~np.asarray(two_sided), k)
        self.facets = Facets(device, triangles, frame, one_sided)
        self.occluders: Any = None
        if not on.all():
            self.occluders = _caster(engine)(device, triangles[~on], frame)
        length = self.facets.length
        large = length > LARGE * np.quantile(length, 0.25) if k > FEW else np.ones(k, bool)
        keep = np.ones(k, bool) if wanted is None else wanted
        points = places(next(n for n, error in SAMPLES if error <= tolerance))
        self.n_samples = len(points)
        self._places = (device.upload(points), len(points))
        self._probes = (device.upload(PROBES), len(PROBES))
        if self.n_samples <= len(PROBES):
            large = np.ones(k, bool)
        self._large, self._small = np.flatnonzero(keep & large), np.flatnonzero(keep & ~large)

    def share(self, viewpoints: list[np.ndarray], slack: float = 0.0) -> np.ndarray:
        """Shares of facets that all viewpoints, m (3,), see: uint8 (k,), 255 for all of a facet, 0 if not wanted.

        slack  rad by which one-sided facets must turn away to be dark for that alone
        """
        out = np.zeros(len(self.facets.length), np.uint8)
        scans = [None if self.terrain is None else self.terrain.scan(v) for v in viewpoints]
        edge = [self._large]
        for part in _chunks(self._small):
            seen = self._count(part, self._probes, viewpoints, scans, slack)
            out[part] = np.where(seen == len(PROBES), 255, 0)
            edge.append(part[(seen > 0) & (seen < len(PROBES))])
        for part in _chunks(np.concatenate(edge)):
            seen = self._count(part, self._places, viewpoints, scans, slack)
            out[part] = np.rint(seen * (255 / self.n_samples))
        return out

    def _count(self, index: np.ndarray, places: Any, viewpoints: Any, scans: Any, slack: float) -> np.ndarray:
        """How many of its places, a buffer and their number, all viewpoints see of each facet: uint8 (n,)."""
        device, n = self.device, len(index)
        if n == 0:
            return np.zeros(0, np.uint8)
        which, hidden = device.upload(index.astype(np.int32)), device.empty(8 * n)
        face = device.kernel("ray_casting.cl", "face")
        for first, viewpoint in enumerate(viewpoints):
            eye = self.frame.eye(viewpoint)[:3]
            arguments = (self.facets.buffer, which, self.facets.side, *eye, np.float32(slack), int(first == 0), hidden)
            device.run(face, (n,), None, *arguments)
        for viewpoint, scan in zip(viewpoints, scans, strict=True):
            if scan is not None:
                scan.hide(self.facets, which, n, places, hidden)
            if self.occluders is not None:
                self.occluders.hide(self.facets, which, n, places, viewpoint, hidden)
        seen = device.empty(n)
        device.run(device.kernel("ray_casting.cl", "seen"), (n,), None, hidden, places[1], seen)
        return device.download(seen, np.empty(n, np.uint8))


def lit(
    triangles: np.ndarray,
    tx: np.ndarray,
    rx: np.ndarray | None = None,
    *,
    heights: Sequence[ArrayLike] | None = None,
    on_heights: np.ndarray | None = None,
    two_sided: np.ndarray | bool = True,
    wanted: np.ndarray | None = None,
    tolerance: float = 0.25,
    max_bytes: float | None = None,
    engine: Literal["opencl", "embree"] = "opencl",
    device: DeviceChoice | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Lighting:
    """Shares of facets, m (k, 3, 3), that both antennas, m (n_pulses, 3), see, in blocks of pulses.

    rx          default tx
    heights     (x, y, z) of a terrain as of Scene.from_heights: it shadows by horizons along range lines
    on_heights  (k,) bool: facets of that terrain, or of parts of it, which shadow as terrain only; default all of them.
                The others shadow by rays, from both sides
    two_sided   (k,) bool or one for all: the others are dark where they face away from an antenna
    wanted      (k,) bool: facets whose share is asked for; the others only shadow, their share is 0
    tolerance   by how much a facet's share errs at most where the edge of a shadow is straight (1/16 or more; 5/9: all
                or nothing by its centroid), and again at most between the pulses of a block, for the facet of middle
                size; see docs/theory/shadows.md
    max_bytes   of the shares kept, default a quarter of the memory blocks `echo` may use; the others are found anew
                each time they are asked for
    engine      "opencl", or "embree" for the rays (package embreex; edges may differ in single samples)
    progress    called as progress(block, blocks)

    ValueError for an antenna under the terrain. SarclWarning when nothing at all is lit.
    """
    tx = array("tx", tx, np.float64, ("n_pulses", 3))
    ends = [tx] if rx is None else [tx, array("rx", rx, np.float64, (len(tx), 3))]
    k = len(triangles)
    tolerance = number("tolerance", tolerance, least=SAMPLES[-1][1])
    choice("engine", engine, ("opencl", "embree"))
    grid = None if heights is None else heights_of(heights)
    masks = {"on_heights": on_heights, "two_sided": two_sided, "wanted": wanted}
    for name, mask in masks.items():
        if mask is not None and np.shape(mask) not in ((), (k,)):
            raise ValueError(f"{name} has shape {np.shape(mask)}; wanted one for each of {k} facets, ({k},)")
    if grid is not None:
        for name, end in zip(("tx", "rx"), ends, strict=False):
            check_above(name, grid, end)
    opened = open_device(device)
    if max_bytes is None:
        max_bytes = budget(opened, None) / 4
    if k == 0:
        nothing = np.zeros(0, np.uint8)
        none = np.zeros(0, bool)
        whole, first = np.array([[0, len(tx)]]), np.zeros(1, np.int64)
        return Lighting(whole, first, none, none, first, nothing, [], lambda block: nothing)
    bounds = scene_box(triangles, grid)
    # by all facets: what is left out for other reasons must not move the blocks
    limits = [tolerance * reach(triangles, e[len(e) // 2]) / max(lever(bounds, e), 1e-300) for e in ends]
    _, offered, turns = pulse_blocks(ends, bounds, limits)
    # what may turn towards an antenna before the next look
    slack = 2 * np.convolve(turns, np.ones(2 * STRIDE + 1))[STRIDE : STRIDE + len(turns)]
    light = Light(
        opened,
        triangles,
        heights=grid,
        on_heights=on_heights,
        two_sided=two_sided,
        wanted=wanted,
        tolerance=tolerance,
        engine=engine,
    )

    def look(place: int) -> np.ndarray:
        return light.share([e[offered[place]] for e in ends], slack=float(slack[place]))

    asked_for = k if wanted is None else int(np.sum(wanted))
    chosen: list[int] = []
    dark: list[int] = []
    kept = 0
    changes: list[tuple[np.ndarray, np.ndarray]] = []
    usual, ever, always = np.zeros(k, np.uint8), np.zeros(k, bool), np.ones(k, bool)
    for place, row in enough_looks(look, offered):
        if not chosen:
            usual = row
        if kept <= max_bytes and len(changes) == len(chosen):
            index = np.flatnonzero(row != usual).astype(np.int32)
            kept += 5 * len(index)
            if kept <= max_bytes:
                changes.append((index, row[index]))
        chosen.append(place)
        dark.append(asked_for - int(np.count_nonzero(row)))
        ever |= row > 0
        always &= row == 255
        if progress:
            progress(place + 1, len(offered))
    looks = offered[chosen]
    blocks = blocks_around(looks, len(tx))
    if not ever.any() and asked_for:
        warn(
            "the whole scene is in shadow: no facet faces the antennas with nothing between; check the side the track "
            "is on, the mesh's winding, and heights; or pass shadows=False"
        )
    log.info("%d pulses in %d blocks; %d of %d facets dark throughout", len(tx), len(blocks), k - ever.sum(), k)
    blocks, looks, usual, never = sealed(blocks), sealed(looks), sealed(usual), sealed(~ever)
    counts = sealed(np.array(dark, np.int64))
    return Lighting(blocks, looks, never, sealed(always), counts, usual, changes, lambda block: look(chosen[block]))


def _caster(engine: str) -> Any:
    if engine != "embree":
        return Occluders
    from ._embree_rays import EmbreeOccluders

    return EmbreeOccluders


def _chunks(index: np.ndarray) -> list[np.ndarray]:
    return [index[i : i + CHUNK] for i in range(0, len(index), CHUNK)]


def visible(triangles: np.ndarray, viewpoint: np.ndarray, *, device: Any = None) -> np.ndarray:
    """True (k,) for facets, m (k, 3, 3), whose centroid nothing hides from `viewpoint`, m (3,).

    Every facet hides what is behind it, from both sides. The viewpoint may stand anywhere, among the facets too.
    """

    if len(triangles) == 0:
        return np.ones(0, bool)
    light = Light(open_device(device), triangles, tolerance=1.0)
    return light.share([viewpoint]) > 0
