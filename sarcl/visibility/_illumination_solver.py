"""Shares of facets that given viewpoints see: samples on lines, tested for occlusion by facets."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from ..opencl.device import Device
from ..opencl.launch_numbers import launch_numbers
from ._facet_samples import FEWEST_LINES, MOST_LINES, PER_LINE, SampleLines
from ._frame import DeviceFacets, DeviceSamples, Frame, box_of
from ._ray_casting import Occluders

CHUNK = 2**16  # facets per call of the kernels: bounds the memory


@dataclass(frozen=True, eq=False)
class Occlusion:
    """Occluders, m (n, 3, 3), the facets that they may hide (k,) bool, and whether none of these lies in the plane of
    one of the occluders."""

    occluders: np.ndarray
    hidden: np.ndarray
    apart: bool = False


@dataclass(frozen=True, eq=False)
class Look:
    """What viewpoints see of facets.

    levels   amplitudes, roots of the shares, uint8 (k,): 255 of a whole facet
    partly   the facets that are partly seen (n,), and `halves`, numbers of their samples that are seen on even and on
             odd lines (n, 2), of `samples` on each of the two
    by_rays  (n,) bool: whether single lines of sight told which are seen, for several samples each, not whole shadows
    """

    levels: np.ndarray
    partly: np.ndarray
    halves: np.ndarray
    samples: int
    by_rays: np.ndarray

    def spread(self, weights: np.ndarray) -> float:
        """Sum of weights (k,) times the squares of the errors of the levels, as shares are counted in samples.

        By rays what the halves of the lines differ by, for each facet: facets that cross it, and narrow shadows, fall
        between them. By whole shadows a quarter of it: half are errors of the mean of both where those of the halves
        are independent, and an eighth were found behind edges of wide shadows.
        """
        even, odd = np.sqrt(self.halves / self.samples).T
        return float(weights[self.partly] @ ((even - odd) / np.where(self.by_rays, 1, 4)) ** 2)


class IlluminationSolver:
    """A scene on a device, prepared to compute which share of each facet viewpoints see. Arguments as of
    `IlluminationTask`."""

    def __init__(
        self,
        device: Device,
        triangles: np.ndarray,
        *,
        two_sided: np.ndarray | bool = True,
        occlusions: Sequence[Occlusion] | None = None,
    ) -> None:
        self.device, k = device, len(triangles)
        occlusions = (Occlusion(triangles, np.ones(k, bool)),) if occlusions is None else occlusions
        self.frame = frame = Frame.around(box_of(triangles, *(part.occluders for part in occlusions)))
        self.facets = DeviceFacets(device, triangles, frame, np.broadcast_to(~np.asarray(two_sided), k))
        hiders = [
            (Occluders(device, part.occluders, frame, int(part.hidden.sum()), part.apart), part.hidden)
            for part in occlusions
            if len(part.occluders) and part.hidden.any()
        ]
        # facets (k,) bool in parts that share what may hide them
        kind = sum(hidden.astype(np.uint8) << i for i, (_, hidden) in enumerate(hiders)) + np.zeros(k, np.uint8)
        self._parts = [
            (kind == number, [hider for i, (hider, _) in enumerate(hiders) if number >> i & 1])
            for number in np.flatnonzero(np.bincount(kind)).tolist()
        ]
        self._words: dict[int, object] = {}  # of the samples of CHUNK facets on so many lines
        self._few = SampleLines.of_facets(device, FEWEST_LINES)
        self._more = self._few

    def take_lines(self, n: int) -> None:
        """Take samples on n lines, 16 to 256, of each facet; by rays, of those that are partly seen on 16."""
        self._more = SampleLines.of_facets(self.device, min(n, MOST_LINES))

    def share(self, viewpoints: list[np.ndarray], slack: float = 0.0) -> np.ndarray:
        """Shares of facets that all viewpoints, m (3,), see: uint8 (k,), 255 for a whole facet."""
        return np.rint(self.look(viewpoints, slack).levels.astype(np.float32) ** 2 / 255).astype(np.uint8)

    def look(self, viewpoints: list[np.ndarray], slack: float = 0.0, some: np.ndarray | None = None) -> Look:
        """What all viewpoints, m (3,), see.

        slack  rad; a one-sided facet counts as back-facing where it is turned away by more than this
        some   (k,) bool: facets that some antenna near sees partly; the others are not looked at
        """
        levels, partly, halves = np.zeros(self.facets.size, np.uint8), [], []
        by_rays = [np.zeros(0, bool)]
        most = self._more.count * PER_LINE // 2
        level_of = np.rint(255 * np.sqrt(np.arange(2 * most + 1) / np.float32(2 * most))).astype(np.uint8)
        both = list(range(len(viewpoints)))
        for index, hiders in self._chunks(some):
            rays = any(hider.by_rays(at) for hider in hiders for at in viewpoints)
            if rays and some is None and self._more is not self._few:
                # rays of more lines only where few tell that a facet is partly seen. By each antenna: facets that both
                # see a little of are not dark because few samples say so
                each = [_totals(self._count(index, hiders, self._few, viewpoints, [i], slack)) for i in both]
                whole = np.min(each, axis=0) == PER_LINE * self._few.count
                levels[index[whole]] = 255
                index = index[(np.min(each, axis=0) > 0) & ~whole]
            seen = self._count(index, hiders, self._more, viewpoints, both, slack)
            total = _totals(seen)
            levels[index] = level_of[total]
            between = (total > 0) & (total < 2 * most)
            partly.append(index[between])
            halves.append(seen[between])
            by_rays.append(np.full(len(partly[-1]), rays))
        none = np.zeros(0, np.int64), np.zeros((0, 2), np.uint16)
        facets, counts = np.concatenate([none[0], *partly]), np.concatenate([none[1], *halves])
        return Look(levels, facets, counts, most, np.concatenate(by_rays))

    def _chunks(self, some: np.ndarray | None) -> Iterator[tuple[np.ndarray, list[Occluders]]]:
        """Numbers of the facets to be looked at, of those in `some` (k,) bool alone, with what may hide them."""
        for part, hiders in self._parts:
            index = np.flatnonzero(part if some is None else part & some)
            for i in range(0, len(index), CHUNK):
                yield index[i : i + CHUNK], hiders

    def _count(
        self,
        index: np.ndarray,
        hiders: list[Occluders],
        lines: SampleLines,
        viewpoints: list[np.ndarray],
        of: list[int],
        slack: float,
    ) -> np.ndarray:
        """Numbers of samples of facets `index` that viewpoints number `of` see, on even and on odd lines, uint16
        (n, 2)."""
        device, n = self.device, len(index)
        if n == 0:
            return np.zeros((0, 2), np.uint16)
        which, seen = device.upload(index.astype(np.int32)), device.empty(4 * n)
        if lines.count not in self._words:  # one for all chunks, which follow one another: its pages are made once
            self._words[lines.count] = device.empty(4 * lines.count * min(CHUNK, self.facets.size))
        samples = DeviceSamples(self.facets, which, n, lines, self._words[lines.count])
        face, count = (device.kernel("ray_casting.cl", name, LINES=lines.count) for name in ("face", "seen"))
        for i in of:
            numbers = launch_numbers(
                "ray_casting.cl", "face", eye=self.frame.eye(viewpoints[i])[:3], slack=slack, fresh=i == of[0]
            )
            device.run(face, (n,), None, numbers, self.facets.buffer, which, self.facets.kind, samples.words)
        for i in of:
            for hider in hiders:
                hider.hide(samples, viewpoints[i], viewpoints[-1 - i])
        device.run(count, (n,), None, samples.words, seen)
        return device.download(seen, np.empty((n, 2), np.uint16))


def _totals(halves: np.ndarray) -> np.ndarray:
    """Samples on even and odd lines together, int32 (n,), of both (n, 2)."""
    return np.asarray(halves[:, 0] + halves[:, 1].astype(np.int32))
