"""Convex polygons in space, many at a time: clipping by planes, areas, and what shadows leave of them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...base.vectors import cross

SHORT = 1e-9  # of a polygon's longest edge: shorter ones are rounding, and have no direction
PAIRS_AT_ONCE = 200_000  # of a piece and a shadow that are looked at together
MOST_PIECES = 4_000_000  # polygons that shadows may leave: about 1 GB


class TooManyAtOnce(MemoryError):
    """Pairs of facets, or parts of polygons, that memory does not hold together: those of fewer beams are fewer."""


@dataclass(frozen=True, eq=False)
class Polygons:
    """Convex polygons: corners m (k, n, 3), of which the first `count` (k,) count; the others repeat the first."""

    corners: np.ndarray
    count: np.ndarray

    def __len__(self) -> int:
        return len(self.count)

    @classmethod
    def of(cls, corners: np.ndarray) -> Polygons:
        """Polygons of n corners each, m (k, n, 3)."""
        return cls(corners, np.full(len(corners), corners.shape[1]))

    def __getitem__(self, rows: np.ndarray) -> Polygons:
        return Polygons(self.corners[rows], self.count[rows])

    @property
    def valid(self) -> np.ndarray:
        """Corners that count (k, n) bool."""
        return np.arange(self.corners.shape[1]) < self.count[:, None]

    @property
    def twice_areas(self) -> np.ndarray:
        """Normals, right-handed about the corners, as long as twice the areas, m^2 (k, 3)."""
        spokes = self.corners[:, 1:] - self.corners[:, :1]
        return folded(np.add, cross(spokes[:, :-1], spokes[:, 1:]).swapaxes(1, 2))

    @property
    def area(self) -> np.ndarray:
        """Areas, m^2 (k,)."""
        return np.asarray(np.where(self.count > 2, np.sqrt(folded(np.add, self.twice_areas**2)) / 2, 0.0))

    @property
    def center(self) -> np.ndarray:
        """Means of the corners, m (k, 3)."""
        total = folded(np.add, self.corners.swapaxes(1, 2))
        padding = self.corners.shape[1] - self.count
        return np.asarray((total - padding[:, None] * self.corners[:, 0]) / np.maximum(self.count, 1)[:, None])

    def heights(self, normal: np.ndarray, point: np.ndarray, snap: float) -> np.ndarray:
        """Heights of the corners over planes, m (k, n): 0 where they are at most `snap`; normal, point (k, 3)."""
        height = np.matmul(self.corners - point[:, None], normal[:, :, None])[..., 0]
        return np.where(np.abs(height) <= snap, 0.0, height)

    def clipped(self, height: np.ndarray) -> Polygons:
        """The parts of which the height, (k, n) at the corners, is at least 0."""
        is_outside = folded(np.minimum, height) < 0  # padding repeats a corner
        rows = np.flatnonzero(is_outside)
        count = np.where(is_outside, 0, self.count)
        if not len(rows):
            return self
        corners, height, valid = self.corners[rows], height[rows], self.valid[rows]
        after, height_after = np.roll(corners, -1, axis=1), np.roll(height, -1, axis=1)
        is_crossing = valid & (height * height_after < 0)
        part = height / np.where(is_crossing, height - height_after, 1)
        crossing = corners + part[..., None] * (after - corners)
        corners_and_crossings = np.stack([corners, crossing], axis=2).reshape(len(rows), -1, 3)
        keep = np.stack([(height >= 0) & valid, is_crossing], axis=2).reshape(len(rows), -1)
        number = folded(np.add, keep.astype(np.int64))
        number[number < 3] = 0
        keep &= number[:, None] > 0
        size = max(int(number.max(initial=0)), int(count.max(initial=0)), 3)
        out = np.repeat(self.corners[:, :1], size, axis=1)
        n = min(size, self.corners.shape[1])
        out[:, :n] = self.corners[:, :n]
        out[rows] = corners_and_crossings[np.arange(len(rows)), keep.argmax(axis=1)][:, None]
        row, column = np.nonzero(keep)
        out[rows[row], (np.cumsum(keep, axis=1) - 1)[row, column]] = corners_and_crossings[row, column]
        count[rows] = number
        return Polygons(out, count)

    @property
    def triangles(self) -> tuple[np.ndarray, np.ndarray]:
        """Triangles that are together these polygons, m (n, 3, 3), and of which polygon each is a part (n,)."""
        fans = [(i, np.flatnonzero(self.count > i + 1)) for i in range(1, self.corners.shape[1] - 1)]
        corners = np.concatenate([self.corners[rows][:, [0, i, i + 1]] for i, rows in fans])
        return corners, np.concatenate([rows for _, rows in fans])

    def edge_planes(self, apex: np.ndarray) -> np.ndarray:
        """Unit normals (k, n, 3) of planes through each edge and an apex, m (k, 3), that point inwards; 0 for edges
        without a direction. A plane holds the corner at which its edge begins."""
        along = np.roll(self.corners, -1, axis=1) - self.corners
        normal = cross(self.corners - apex[:, None], along)
        length, size = (np.sqrt(folded(np.add, vectors**2)) for vectors in (along, normal))
        inwards = np.sign(folded(np.add, normal * (self.center[:, None] - self.corners)))
        is_edge = (length > SHORT * folded(np.maximum, length)[:, None]) & (size > 0)
        return np.where(is_edge[..., None], normal * (inwards / np.where(is_edge, size, 1))[..., None], 0.0)

    def seen_through(self, planes: np.ndarray, corners: np.ndarray, snap: float) -> Polygons:
        """The parts (k) inside windows: `edge_planes` of these (k, m, 3), and their corners, m (k, m, 3)."""
        out = self
        for edge in range(planes.shape[1]):
            out = out.clipped(out.heights(planes[:, edge], corners[:, edge], snap))
        return out

    @property
    def spheres(self) -> tuple[np.ndarray, np.ndarray]:
        """Centres, m (k, 3), and radii, m (k,), of spheres about the polygons."""
        low, high = self.corners.min(axis=1), self.corners.max(axis=1)
        return (low + high) / 2, np.linalg.norm(high - low, axis=1) / 2


def apart(corners: np.ndarray, planes: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Whether polygons with corners m (k, n, 3) lie outside one of the planes (k, m, 3) through points, m (k, m, 3)."""
    heights = np.matmul(planes, corners.swapaxes(1, 2))
    base = planes[..., 0] * points[..., 0] + planes[..., 1] * points[..., 1] + planes[..., 2] * points[..., 2]
    return folded(np.logical_or, folded(np.maximum, heights) < base)


def folded(function: np.ufunc, values: np.ndarray) -> np.ndarray:
    """`function` over the last axis of values (..., n): NumPy's own takes ten times as long along an axis so short."""
    out = values[..., 0].copy()
    for i in range(1, values.shape[-1]):
        function(out, values[..., i], out=out)
    return np.asarray(out)


def joined(parts: list[Polygons]) -> Polygons:
    """Polygons one after the other."""
    size = max(part.corners.shape[1] for part in parts)
    padded = [
        np.concatenate([p.corners, np.repeat(p.corners[:, :1], size - p.corners.shape[1], axis=1)], axis=1)
        for p in parts
    ]
    return Polygons(np.concatenate(padded), np.concatenate([part.count for part in parts]))


@dataclass(frozen=True, eq=False)
class Shadows:
    """Occluders before the polygons `of` (n,) on which their shadows may fall: their corners, and planes through their
    edges and the place from where the shadows fall, as of `edge_planes`, (n, m, 3) each."""

    of: np.ndarray
    corners: np.ndarray
    planes: np.ndarray

    def __getitem__(self, rows: np.ndarray) -> Shadows:
        return Shadows(self.of[rows], self.corners[rows], self.planes[rows])

    @classmethod
    def joined(cls, parts: list[Shadows]) -> Shadows:
        """Shadows one after the other."""
        size = max(part.corners.shape[1] for part in parts)
        corners = [np.pad(part.corners, ((0, 0), (0, size - part.corners.shape[1]), (0, 0))) for part in parts]
        planes = [np.pad(part.planes, ((0, 0), (0, size - part.planes.shape[1]), (0, 0))) for part in parts]
        return cls(np.concatenate([part.of for part in parts]), np.concatenate(corners), np.concatenate(planes))

    @classmethod
    def falling_on(
        cls, polygons: Polygons, apex: np.ndarray, of: np.ndarray, occluders: Polygons, least: np.ndarray, snap: float
    ) -> Shadows:
        """Those of occluders (n,) whose shadows from an apex, m (k, 3), on polygons `of` (n,) are larger than `least`,
        m^2 (k,); the largest first, since nothing is left to cut where they cover all."""
        if not len(of):
            return cls(of, occluders.corners, occluders.corners)
        planes = polygons.edge_planes(apex)
        rows = np.flatnonzero(~apart(occluders.corners, planes[of], polygons.corners[of]))
        of, occluders = of[rows], occluders[rows]
        away = polygons.center[of] - apex[of]  # nothing behind the apex casts a shadow
        front = occluders.clipped(occluders.heights(away, apex[of] + 1e-9 * away, 0.0))
        rows = np.flatnonzero(front.count > 0)
        of, occluders = of[rows], front[rows]
        planes = occluders.edge_planes(apex[of])
        rows = np.flatnonzero(~apart(polygons.corners[of], planes, occluders.corners))
        out = cls(of[rows], occluders.corners[rows], planes[rows])
        area = polygons[out.of].seen_through(out.planes, out.corners, snap).area
        rows = np.flatnonzero(area > least[out.of])
        return out[rows[np.argsort(-area[rows])]]


def less_shadows(
    pieces: Polygons, of: np.ndarray, shadows: Shadows, least: np.ndarray, snap: float
) -> tuple[Polygons, np.ndarray]:
    """Convex polygons that together are pieces of polygons `of` (n,) less their shadows; and of which each is a piece,
    in rising order.

    least  m^2, of each polygon: smaller pieces are left out
    """
    shadows = shadows[np.argsort(shadows.of, kind="stable")]
    number = np.bincount(shadows.of, minlength=len(least))
    owner, shadow = _repeated((np.cumsum(number) - number)[of], number[of])
    unshaded: list[tuple[Polygons, np.ndarray]] = []
    while True:  # of each piece, the shadows that are still to be cut off, those first that came first
        pairs = _near(pieces, owner, shadows, shadow)
        owner, shadow = owner[pairs], shadow[pairs]
        number = np.bincount(owner, minlength=len(of))
        unshaded.append((pieces[number == 0], of[number == 0]))
        shaded = np.flatnonzero(number)
        if not len(shaded):
            break
        first = (np.cumsum(number) - number)[shaded]
        parts, part_of = _cut_once(pieces[shaded], shadows[shadow[first]], least[of[shaded]], snap)
        owner, pair = _repeated(first[part_of] + 1, number[shaded][part_of] - 1)
        pieces, of, shadow = parts, of[shaded][part_of], shadow[pair]
        if len(of) > MOST_PIECES:
            raise TooManyAtOnce(
                f"shadows cut what facets reflect to one another into more than {MOST_PIECES:,} parts at a time; take "
                "fewer bounces or a coarser mesh"
            )
    of = np.concatenate([owners for _, owners in unshaded])
    order = np.argsort(of, kind="stable")
    return joined([part for part, _ in unshaded])[order], of[order]


def _repeated(start: np.ndarray, number: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Places i (p,) in lists start, number (n,), and start_i, start_i + 1 ... of `number` values for each."""
    place = np.repeat(np.arange(len(number)), number)
    return place, np.arange(len(place)) + np.repeat(start - (np.cumsum(number) - number), number)


def _near(pieces: Polygons, owner: np.ndarray, shadows: Shadows, shadow: np.ndarray) -> np.ndarray:
    """Pairs of a piece and a shadow (p,) that no plane of the shadow keeps apart."""
    is_near = np.zeros(len(owner), bool)
    for begin in range(0, len(owner), PAIRS_AT_ONCE):
        rows = slice(begin, begin + PAIRS_AT_ONCE)
        is_near[rows] = ~apart(pieces.corners[owner[rows]], shadows.planes[shadow[rows]], shadows.corners[shadow[rows]])
    return np.flatnonzero(is_near)


def _cut_once(pieces: Polygons, shadows: Shadows, least: np.ndarray, snap: float) -> tuple[Polygons, np.ndarray]:
    """Pieces less one shadow each, larger than `least`, m^2 (n,); and of which piece each is a part."""
    inner, inner_parts = pieces, []
    for edge in range(shadows.planes.shape[1]):
        height = inner.heights(shadows.planes[:, edge], shadows.corners[:, edge], snap)
        inner_parts.append((inner, height))
        inner = inner.clipped(height)
    is_shaded = inner.area > least
    rows = np.flatnonzero(~is_shaded)
    parts, owners = [pieces[rows]], [rows]
    for edge, (inner, height) in enumerate(inner_parts):
        is_edge = folded(np.logical_or, shadows.planes[:, edge] != 0)
        rows = np.flatnonzero(is_shaded & is_edge & (folded(np.minimum, height) < 0))
        part = inner[rows].clipped(-height[rows])
        is_large = part.area > least[rows]
        parts.append(part[is_large])
        owners.append(rows[is_large])
    return joined(parts), np.concatenate(owners)
