"""The part of a facet that is in no shadow, and in a range window: every occluder, every edge, in float64."""

from __future__ import annotations

import numpy as np

from ..base.vectors import unit
from ..scattering.physical_optics import triangle_mean


def shadow(
    facet: np.ndarray, occluder: np.ndarray, antenna: np.ndarray, on_plane: float, axes: np.ndarray | None = None
) -> np.ndarray:
    """Shadow of an occluder, m (3, 3), on the plane of a facet, m (3, 3), about its centroid: corners (n, 2), n 0 to 5.

    on_plane  m: corners nearer to the plane lie in it;  axes  plane_axes(facet), where these are known
    """
    axes, center = plane_axes(facet) if axes is None else axes, facet.mean(axis=0)
    eye = (antenna - center) @ axes.T
    solid = (occluder - center) @ axes.T
    solid[:, 2] *= np.sign(eye[2])
    solid[np.abs(solid[:, 2]) <= on_plane, 2] = 0
    height = abs(eye[2])
    if solid[:, 2].max() <= 0:
        return np.zeros((0, 2))
    for limit, sign in ((0.0, 1), (0.999999 * height, -1)):
        rest = []
        for a, b in zip(solid, np.roll(solid, -1, axis=0), strict=True):
            above, next_above = sign * (a[2] - limit), sign * (b[2] - limit)
            if above >= 0:
                rest.append(a)
            if above * next_above < 0:
                rest.append(a + above / (above - next_above) * (b - a))
        solid = np.array(rest).reshape(-1, 3)
    if len(solid) < 3:
        return np.zeros((0, 2))
    flat = solid[:, :2] + (solid[:, :2] - eye[:2]) * (solid[:, 2] / (height - solid[:, 2]))[:, None]
    return flat[::-1] if area(flat) < 0 else flat


def plane_axes(facet: np.ndarray) -> np.ndarray:
    """Unit vectors x along the first edge of a facet, y, and z along its normal (3, 3)."""
    x, z = unit(facet[1] - facet[0]), unit(np.cross(facet[1] - facet[0], facet[2] - facet[0]))
    return np.stack([x, np.cross(z, x), z])


def area(corners: np.ndarray) -> float:
    """Area of a polygon (n, 2), positive anticlockwise."""
    after = np.roll(corners, -1, axis=0)
    return float((corners[:, 0] * after[:, 1] - corners[:, 1] * after[:, 0]).sum() / 2)


def lit_pieces(facet: np.ndarray, shadows: list[np.ndarray]) -> list[np.ndarray]:
    """Convex polygons (n, 2) that together are a facet less its shadows."""
    return cut_away([(facet - facet.mean(axis=0)) @ plane_axes(facet)[:2].T], shadows)


def cut_away(pieces: list[np.ndarray], shadows: list[np.ndarray]) -> list[np.ndarray]:
    """Convex polygons (n, 2) less shadows: each shadow cut off edge by edge."""
    for corners in shadows:
        left, sides, low, high = [], _edges(corners), corners.min(axis=0), corners.max(axis=0)
        for piece in pieces:
            if len(piece) < 3:
                continue
            if (piece.max(axis=0) < low).any() or (piece.min(axis=0) > high).any():
                left.append(piece)
                continue
            for a, b in sides:
                outside, piece = _halves(piece, a, b)
                if len(outside) > 2:
                    left.append(outside)
                if len(piece) < 3:
                    break
        pieces = left
    return pieces


def intersection(piece: np.ndarray, window: np.ndarray) -> np.ndarray:
    """The part of a convex polygon (n, 2) inside a convex one, anticlockwise (m, 2)."""
    for a, b in _edges(window):
        piece = _halves(piece, a, b)[1]
        if len(piece) < 3:
            break
    return piece


def _edges(corners: np.ndarray) -> list[tuple[np.ndarray, np.ndarray]]:
    """Ends of the edges of a polygon (n, 2), but those between corners that rounding alone keeps apart."""
    after = np.roll(corners, -1, axis=0)
    lengths = np.linalg.norm(after - corners, axis=1)
    return [(a, b) for a, b, n in zip(corners, after, lengths, strict=True) if n > 1e-9 * lengths.max()]


def _halves(piece: np.ndarray, a: np.ndarray, b: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The parts of a convex polygon to the right and to the left of the line from a to b."""
    right, left = [], []
    side = (b[0] - a[0]) * (piece[:, 1] - a[1]) - (b[1] - a[1]) * (piece[:, 0] - a[0])
    for i, point in enumerate(piece):
        if side[i] <= 0:
            right.append(point)
        if side[i] >= 0:
            left.append(point)
        j = (i + 1) % len(piece)
        if side[i] * side[j] < 0:
            middle = point + side[i] / (side[i] - side[j]) * (piece[j] - point)
            right.append(middle)
            left.append(middle)
    return np.array(right).reshape(-1, 2), np.array(left).reshape(-1, 2)


def _beyond(piece: np.ndarray, along: np.ndarray, limit: float) -> np.ndarray:
    """The part of a convex polygon (n, 2) where along.rho is at least `limit`."""
    if not np.isfinite(limit):
        return piece
    rest = []
    for a, b in zip(piece, np.roll(piece, -1, axis=0), strict=True):
        above, next_above = along @ a - limit, along @ b - limit
        if above >= 0:
            rest.append(a)
        if above * next_above < 0:
            rest.append(a + above / (above - next_above) * (b - a))
    return np.array(rest).reshape(-1, 2)


def lit_part(
    facet: np.ndarray,
    occluders: np.ndarray,
    antennas: list[np.ndarray],
    waves: np.ndarray,
    on_plane: float = 1e-9,
    others: np.ndarray | None = None,
    *,
    window: tuple[float, float] = (-np.inf, np.inf),
) -> tuple[float, np.ndarray]:
    """Share of a facet, m (3, 3), that one antenna or two, m (3,), see past occluders, m (k, 3, 3), and the mean over
    the whole facet of exp(j k (u_t + u_r).rho) on that part, rho from the centroid, at wavenumbers k, rad/m: (m,).

    An antenna that is edge-on to the facet, or behind the side that both look at, casts no shadow. Of forward scatter,
    `others`, bool (k,), are occluders of other bodies: these alone cast shadows from the second antenna, which looks at
    the facet from any side. `window`, m: only the part with (u_t + u_r).rho between these counts."""
    axes = plane_axes(facet)
    up = axes[2]
    sines = [float(unit(antenna - facet.mean(axis=0)) @ up) for antenna in antennas]
    side = -1.0 if sum(sines) < 0 else 1.0
    forward = others is not None and len(antennas) == 2
    casters = [occluders, occluders[others] if forward else occluders]
    shadows = [
        shadow(facet, other, antenna, on_plane, axes)
        for antenna, sine, solid in zip(antennas, sines, casters[: len(antennas)], strict=True)
        if (abs(sine) if forward else side * sine) > 1e-6
        for other in solid
    ]
    pieces = lit_pieces(facet, [s for s in shadows if len(s) and area(s) > 0])
    center = facet.mean(axis=0)
    sights = [unit(antenna - center) for antenna in antennas]
    both = axes[:2] @ (2 * sights[0] if len(sights) == 1 else sights[0] + sights[1])
    total = float(np.linalg.norm(np.cross(facet[1] - facet[0], facet[2] - facet[0]))) / 2
    share, mean = 0.0, np.zeros(len(waves), np.complex128)
    for piece in pieces:
        for limit, side in zip(window, (1.0, -1.0), strict=True):
            piece = _beyond(piece, side * both, side * limit)
        for i in range(1, len(piece) - 1):
            corners = piece[[0, i, i + 1]]
            phases = np.outer(waves, corners @ both)
            part = area(corners) / total
            share += part
            about = np.exp(1j * phases.mean(axis=1))
            mean += part * about * triangle_mean(phases[:, 1] - phases[:, 0], phases[:, 2] - phases[:, 0])
    return max(share, 0.0), mean  # areas of slivers may be -1e-17
