"""Rays between the facets of a scene: the first facet on each, and whether any facet lies between two points."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import ArrayLike, DTypeLike

from ..base.validation import array, values
from ..base.vectors import dot, unit
from ..opencl.device import Device
from ..scene.triangles import check_reach, normals, solid
from ._box_tree import BoxTree
from ._frame import STEP, Frame

KERNELS = "rays.cl"
RAYS = 2**16  # on the device at a time: 25 MB of the host's memory for what they are computed from
SPHERE = 1.75  # radius of the sphere around a frame's cube, whose corners are at 1.732


class SceneRays:
    """Facets on a device, m (k, 3, 3), float64, and rays that meet them, from both sides.

    A ray may begin anywhere, also at a satellite, or on a facet. It never slips through between two facets that share
    an edge or a corner, bit by bit. Which facets are met is decided in float32, with an error of place of about 3e-7 of
    the scene's size: the longest side of the box around its facets. Distances are computed in float64, from the
    facet's plane.

    Facets nearer than `least`, m, at most 1e-6 of the scene's size, are not met. A ray that leaves a facet should be
    told which, `leaving`: it then begins at the height `least` above that facet's plane, on the side to which it goes,
    and meets neither that facet, nor those that lie in one plane with it, nor another one in its place, at any grazing
    angle. Where it leaves none, it begins at `least` along the ray. In a corner of less than 90 deg, a ray that begins
    nearer to the other wall than `least` may begin beyond it.

    Facets without area (`scene.triangles.solid`) are never met.
    """

    def __init__(self, device: Device, triangles: ArrayLike) -> None:
        self.device, self._triangles = device, array("triangles", triangles, np.float64, ("k", 3, 3))
        check_reach("triangles", self._triangles)
        kept = np.flatnonzero(solid(self._triangles))
        self._normals = np.zeros((len(self._triangles), 3))
        self._normals[kept] = normals(self._triangles[kept])
        self._frame = Frame.around(self._triangles[kept if len(kept) else slice(None)].reshape(-1, 3))
        self.least = self._frame.lift
        self._tree: BoxTree | None = None
        self._facet = kept
        if len(kept):
            self._tree = BoxTree(device, self._placed(self._triangles[kept]).astype(np.float32))
            self._facet = kept[self._tree.order]  # at each place of the tree

    def nearest(
        self, origins: ArrayLike, directions: ArrayLike, *, leaving: ArrayLike | None = None
    ) -> tuple[np.ndarray, np.ndarray]:
        """The facet that each ray meets first, int64 (n,), and how far it is, m (n,); -1 and inf where it meets none.

        origins  m (n, 3);  directions  of any length but 0 (n, 3);  leaving  the facet that each ray leaves (n,), or -1
        """
        origins = _points("origins", origins)
        ahead = _rows("directions", directions, len(origins))
        longest = np.abs(ahead).max(axis=1, initial=0)
        if not longest.all():
            raise ValueError(f"directions[{int(longest.argmin())}] is (0, 0, 0); a direction needs a length")
        ahead = unit(ahead / longest[:, None])  # first, so that squares neither overflow nor vanish
        left = self._numbers("leaving", leaving, len(origins))
        facet, distance = np.full(len(origins), -1), np.full(len(origins), np.inf)
        for part in _parts(len(origins)):
            begin, lifted = self._lifted(self._placed(origins[part]), left[part], ahead[part])
            some, lines = _within(begin, ahead[part], np.where(lifted, 0, STEP), np.inf)
            place = self._launched("nearest", lines, np.int32, -1)
            met, place = some[place >= 0] + part.start, place[place >= 0]
            facet[met] = self._facet[place]
            distance[met] = self._distance(facet[met], origins[met], ahead[met])
        return facet, distance

    def any_hit(
        self,
        origins: ArrayLike,
        ends: ArrayLike,
        *,
        leaving: ArrayLike | None = None,
        reaching: ArrayLike | None = None,
    ) -> np.ndarray:
        """True (n,) where some facet lies between two points, m (n, 3) each, both excluded.

        leaving, reaching  the facets on which the points lie (n,), or -1: the line is lifted off both
        """
        origins = _points("origins", origins)
        ends = _points("ends", ends, len(origins))
        left, reached = (
            self._numbers(name, given, len(origins)) for name, given in (("leaving", leaving), ("reaching", reaching))
        )
        out = np.zeros(len(origins), bool)
        for part in _parts(len(origins)):
            begin, end = self._placed(origins[part]), self._placed(ends[part])
            begin, lifted = self._lifted(begin, left[part], end - begin)
            # as seen from the lifted point: two points of one plane are lifted to the same side
            end, landed = self._lifted(end, reached[part], begin - end)
            way = end - begin
            length = np.sqrt(dot(way, way))
            ahead = way / np.where(length > 0, length, 1)[:, None]
            some, lines = _within(begin, ahead, np.where(lifted, 0, STEP), length - np.where(landed, 0, STEP))
            out[some + part.start] = self._launched("any_hit", lines, np.uint8, 0) > 0
        return out

    def _numbers(self, name: str, given: ArrayLike | None, n: int) -> np.ndarray:
        """Numbers of facets (n,) as they were given, -1 for none."""
        if given is None or n == 0:
            return np.full(n, -1)
        number, k = array(name, given, np.int64, (n,)), len(self._triangles)
        wrong = (number < -1) | (number >= k)
        if wrong.any():
            at = int(wrong.argmax())
            raise ValueError(
                f"{name}[{at}] is {number[at]}; wanted the number of a facet, 0 to {k - 1}, or -1 for none"
            )
        return number

    def _placed(self, points: np.ndarray) -> np.ndarray:
        """Points, m (n, 3), in the frame."""
        return np.asarray((points - self._frame.center) * self._frame.unit)

    def _lifted(self, points: np.ndarray, facet: np.ndarray, ahead: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Points in the frame (n, 3), lifted off their facets (n,) to the side of `ahead` (n, 3); which were (n,)."""
        normal = self._normals[facet] * (facet >= 0)[:, None]
        side = np.where(dot(normal, ahead) < 0, -STEP, STEP)
        return points + side[:, None] * normal, normal.any(axis=1)

    def _launched(self, kernel: str, lines: np.ndarray, kind: DTypeLike, none: int) -> np.ndarray:
        """What a kernel finds on lines in the frame, float32 (n, 6): (n,) of type `kind`; `none` where nothing is."""
        out, tree = np.full(len(lines), none, kind), self._tree
        if tree is not None and len(lines):
            buffer = self.device.empty(out.nbytes)
            self.device.run(
                self.device.kernel(KERNELS, kernel), (len(lines),), None,
                tree.depth, self.device.upload(lines), tree.leaf, tree.node, tree.base, buffer,
            )  # fmt: skip
            self.device.download(buffer, out)
        return out

    def _distance(self, facet: np.ndarray, origins: np.ndarray, ahead: np.ndarray) -> np.ndarray:
        """Distance, m (n,), at which rays along unit vectors cross the planes of facets (n,) that they meet."""
        corners, normal = self._triangles[facet] - origins[:, None], self._normals[facet]
        depth = np.einsum("nij,nj->ni", corners, ahead)
        low, high = depth.min(axis=1), depth.max(axis=1)
        with np.errstate(divide="ignore", invalid="ignore"):
            distance = dot(normal, corners[:, 0]) / dot(normal, ahead)
        # seen edge-on, a plane may be crossed far from the facet; where the ray lies in it, the facet begins at `low`
        return np.maximum(np.clip(np.where(np.isfinite(distance), distance, low), low, high), 0)


def _points(name: str, given: ArrayLike, n: int | str = "n") -> np.ndarray:
    """Points, m (n, 3), of which there may be none."""
    made = _rows(name, given, n)
    check_reach(name, made)
    return made


def _rows(name: str, given: ArrayLike, n: int | str) -> np.ndarray:
    """Vectors (n, 3), of which there may be none."""
    if np.shape(values(name, given)) == (0, 3) and n in ("n", 0):
        return np.empty((0, 3))
    return array(name, given, np.float64, (n, 3))


def _parts(n: int) -> Iterator[slice]:
    """Slices of n rays, so many as are on the device at a time."""
    return (slice(first, min(first + RAYS, n)) for first in range(0, n, RAYS))


def _within(
    begin: np.ndarray, ahead: np.ndarray, first: np.ndarray, last: np.ndarray | float
) -> tuple[np.ndarray, np.ndarray]:
    """Rays, of those from (n, 3) along unit vectors, that pass the frame, and both ends of their part in it.

    first, last  (n,) distances on each ray between which it counts
    Returns numbers (m,) of rays, and float32 (m, 6).
    """
    middle = -dot(begin, ahead)
    foot = begin + middle[:, None] * ahead  # of the perpendicular from the centre
    half = np.sqrt(np.maximum(SPHERE**2 - dot(foot, foot), 0))
    one, two = np.maximum(first - middle, -half), np.minimum(last - middle, half)
    some = np.flatnonzero(one < two)
    ends = [foot[some] + to[some, None] * ahead[some] for to in (one, two)]
    return some, np.concatenate(ends, axis=1).astype(np.float32)
