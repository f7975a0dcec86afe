"""Pairs of borders of flat faces, and the rays between them."""

from __future__ import annotations

from copy import copy
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ...base.vectors import cross, dot, unit
from ...scattering.double_diffraction import FaceBorders
from ...visibility.rays import SceneRays
from ._border_light import BorderLight
from ._edge_pieces import OFF, EdgePieces

if TYPE_CHECKING:
    from ...scene.facing_borders import FacingBorders

MOST_PARTS = 64  # of a pair, for the sake of lengths of rays
LEAST_SINE = 1e-6  # of the angle between a ray and the bisector of its borders


@dataclass(frozen=True, eq=False)
class Rays:
    """Rays of n pairs at m pulses, or at one for all of them; a ray is known by the mean c of the places of its ends.

    shift, slope  difference of those places at c = 0, m, and its derivative over c (m, n)
    low, high     c between which both ends are on their borders, m (m, n)
    """

    shift: np.ndarray
    slope: np.ndarray
    low: np.ndarray
    high: np.ndarray

    def chosen(self, rows: np.ndarray) -> Rays:
        """Those of some pairs."""
        return Rays(self.shift[:, rows], self.slope[:, rows], self.low[:, rows], self.high[:, rows])


class BorderPairs:
    """Pairs of borders, in pieces of equal length.

    Coordinates of a pair: places along the bisector t of its borders, and along x across it. Border 1 is the line
    x = x_1 - c tau, border 2 x = x_2 + c tau, tau the tangent of half the angle between them. A ray leads from the
    place c - m/2 to c + m/2. Its path is stationary over m where g.t = (u_2 - u_1).t/2 + tau (u_1 + u_2).x/2, g along
    the ray, u_i to the antennas.

    parts     pieces of each pair (n,);  pair, number  the pair of each piece, and its number in it (k,)
    shape     of both wedges;  along, across  t and x (n, 3);  tangent  tau (n,)
    is_fixed  rays of a single antenna are the same from everywhere: borders are parallel
    is_fine   pairs with coefficients that change along them: with directions, or with the lengths of rays (n,)
    open      0 where something stands on the face between the ends of a piece, else 1 (k,)
    """

    def __init__(
        self, borders: FacingBorders, edges: EdgePieces, longest: float, distance: float, error: float
    ) -> None:
        """longest  m, of a piece;  distance  m, of the nearest antenna;  error  of coefficients"""
        i, j = self._borders = borders.pairs[:, 0], borders.pairs[:, 1]
        x1, x2, self.normal = borders.inward[i], borders.inward[j], borders.normal[i]
        self.shape = FaceBorders((x1, x2), self.normal, (borders.number[i], borders.number[j]))
        self.across = unit(x1 - x2)
        self.along = cross(self.across, self.normal)
        self.cosine = dot(x1, self.across)
        self.tangent = dot(x1, self.along) / self.cosine
        self.is_fixed = bool((np.abs(self.tangent) < LEAST_SINE).all())
        ends = np.array([[borders.start[i], borders.end[i]], [borders.end[j], borders.start[j]]])
        self.middle = ends.mean(axis=(0, 1))
        self._reach = np.einsum("abnj,nj->abn", ends - self.middle, self.along)  # of each border along t
        at = np.einsum("anj,nj->an", (ends - self.middle)[:, 0], self.across)
        self._at = at + np.array([[1], [-1]]) * self.tangent * self._reach[:, 0]  # x_1, x_2 (2, n)
        length = np.diff(self._reach, axis=1)[:, 0].min(axis=0)
        taper = np.abs(self.tangent) * length
        taper = 2 * taper / np.maximum(self._at[1] - self._at[0] - taper, taper / MOST_PARTS)
        self.is_fine = np.maximum(np.linalg.norm(np.ptp(ends, axis=(0, 1)), axis=1) / distance, taper) > error
        least = np.minimum(taper / np.sqrt(error), MOST_PARTS)
        self.parts = np.maximum(np.ceil(np.maximum(length / longest, least)), 1).astype(int)
        self.light, self.open = BorderLight(borders, edges), np.ones(int(self.parts.sum()))
        self._count()

    def _count(self) -> None:
        self.pair, self.number = _counted(self.parts)
        self.corner_pair, self._corner = _counted(self.parts + 1)

    def chosen(self, rows: np.ndarray) -> BorderPairs:
        """Some of them: where rows (n,) is True."""
        out = copy(self)
        for name in ("normal", "across", "along", "middle", "cosine", "tangent", "parts", "is_fine"):
            setattr(out, name, getattr(self, name)[rows])
        out.shape, out._borders = self.shape.chosen(rows), (self._borders[0][rows], self._borders[1][rows])
        out._reach, out._at, out.open = self._reach[..., rows], self._at[:, rows], self.open[rows[self.pair]]
        out._count()
        return out

    def reached(self, rays: Rays, lit: list[np.ndarray | None]) -> np.ndarray:
        """Which pairs may send something at some pulse (n,); lit  as in `seen`."""
        out = (rays.high > rays.low).any(axis=0)
        for border, part in zip(self._borders, lit, strict=True):
            if part is not None:
                out &= self.light.reached(part)[border]
        return np.asarray(out)

    def __len__(self) -> int:
        """Number of pieces."""
        return len(self.pair)

    def block(self, rays: SceneRays) -> None:
        """Mark pieces across which something stands on the face: along straight rays, at the middle of each."""
        level = self.rays(np.zeros((1, len(self.parts))), np.zeros((1, len(self.parts))))
        share = (self.number + 0.5) / self.parts[self.pair]
        start, end = self.ends(level, np.zeros(len(self), int), self.pair, share)
        start, end = (place + OFF * rays.least * self.normal[self.pair] for place in (start, end))
        self.open = (~rays.any_hit(start, end)).astype(float)

    def rays(self, along: np.ndarray, across: np.ndarray) -> Rays:
        """along, across  (u_2 - u_1).t and (u_1 + u_2).x, u_i from the middle of each pair to the antennas (m, n)"""
        cosine = np.clip((along + self.tangent * across) / 2, -1, 1)
        cotangent = cosine / np.sqrt(np.maximum(1 - cosine**2, LEAST_SINE**2))
        shift, slope = (self._at[1] - self._at[0]) * cotangent, 2 * self.tangent * cotangent
        low, high = [], []
        for reach, sign in zip(self._reach, (-0.5, 0.5), strict=True):
            rise = 1 + sign * slope
            bounds = (reach[:, None] - sign * shift) / np.where(np.abs(rise) < LEAST_SINE, LEAST_SINE, rise)
            low.append(bounds.min(axis=0))
            high.append(bounds.max(axis=0))
        begin = np.maximum(*low)
        return Rays(shift, slope, begin, np.maximum(np.minimum(*high), begin))

    def ends(self, rays: Rays, pulse: np.ndarray, pair: np.ndarray, share: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Where rays leave border 1 and reach border 2, m (..., 3) each, at shares of the lengths of pairs (...)."""
        one, other = self._along(rays, pulse, pair, share)
        places = []
        for c, at, sign in ((one, self._at[0], -1), (other, self._at[1], 1)):
            x = at[pair] + sign * self.tangent[pair] * c
            places.append(self.middle[pair] + c[..., None] * self.along[pair] + x[..., None] * self.across[pair])
        return places[0], places[1]

    def _along(
        self, rays: Rays, pulse: np.ndarray, pair: np.ndarray, share: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        c = rays.low[pulse, pair] + share * (rays.high - rays.low)[pulse, pair]
        half = (rays.shift[pulse, pair] + rays.slope[pulse, pair] * c) / 2
        return c - half, c + half

    def corners(self, rays: Rays) -> tuple[np.ndarray, np.ndarray]:
        """Ends of the rays at the corners between pieces, pair by pair, m (m, k + n, 3) each."""
        share = self._corner / self.parts[self.corner_pair]
        return self.ends(rays, np.arange(len(rays.low))[:, None], self.corner_pair, share)

    def seen(self, rays: Rays, lit: list[np.ndarray | None]) -> tuple[np.ndarray, np.ndarray]:
        """The parts of pieces that the antennas at border 1 and border 2 see: where they begin and end, 0 to 1
        (m or 1, k, 2), and the reflectivity, 0 where something stands in the way (.., k).

        lit  what each sees of the pieces of edges, as in BorderLight
        """
        pair, share = self.corner_pair, self._corner / self.parts[self.corner_pair]
        places = self._along(rays, np.arange(len(rays.low))[:, None], pair, share)
        last, factor, bounds = np.cumsum(self.parts + 1)[:-1] - 1, self.open, []
        for c, border, reach, sign, part in zip(places, self._borders, self._reach, (1, -1), lit, strict=True):
            origin = self.light.origin[border] - sign * reach[(1 - sign) // 2] / self.cosine
            interval, weight = self.light.intervals(part, origin[pair] + sign * c / self.cosine[pair])
            bounds.append(np.delete(interval, last, axis=1))
            factor = factor * np.delete(weight, last, axis=1)
        begin = np.maximum(bounds[0][..., 0], bounds[1][..., 0])
        end = np.maximum(np.minimum(bounds[0][..., 1], bounds[1][..., 1]), begin)
        return np.stack([begin, end], axis=-1), factor


def _counted(sizes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The group of each member of groups of these sizes, and its number in it."""
    return np.repeat(np.arange(len(sizes)), sizes), np.arange(sizes.sum()) - np.repeat(np.cumsum(sizes) - sizes, sizes)
