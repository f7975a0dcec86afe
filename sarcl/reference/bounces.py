"""Echoes that facets reflect to one another, by every sequence of facets: each beam followed forwards, leg by leg."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from ..base.constants import SPEED_OF_LIGHT
from ..base.vectors import unit
from ..scattering.physical_optics import UP, fresnel, lit_share, polarisation, scattering_matrix
from .equations import excess_delay, triangle_nodes
from .lit_part import area, cut_away, intersection, plane_axes, shadow

LEAST_AREA = 1e-12  # of a facet: smaller polygons are rounding
WINDOW_BOW = 1e-4  # wavelengths: distance of the edge of a window from a straight line over a triangle
BISECTIONS = 30  # of a side that crosses the edge of a window
NO_WINDOW = (-np.inf, np.inf)


@dataclass(frozen=True, eq=False)
class Reflectors:
    """Facets that reflect to one another.

    triangles m (k, 3, 3);  two_sided bool (k,);  permittivity complex (n_f, k), inf: conductor
    reflectivity, height  factor on the amplitude, and rms height of the roughness, m (k,)
    """

    triangles: np.ndarray
    two_sided: np.ndarray
    permittivity: np.ndarray
    reflectivity: np.ndarray
    height: np.ndarray

    def facing(self, k: int, place: np.ndarray) -> np.ndarray | None:
        """Unit normal of facet k on the side of a place, m (3,), None where that side does not reflect."""
        if not self.reflectivity[k]:
            return None
        normal = plane_axes(self.triangles[k])[2]
        side = float(normal @ unit(place - self.triangles[k].mean(axis=0)))
        if abs(side) < 1e-9 or (side < 0 and not self.two_sided[k]):
            return None
        return normal if side > 0 else -normal


@dataclass(frozen=True, eq=False)
class _Beam:
    """What facets (m,) have reflected one after the other: convex polygons, m (n, 3), on the last of them, seen from
    the transmitter's image in all before it, m (3,); normals of the facets on the side that reflects."""

    facets: tuple[int, ...]
    normals: tuple[np.ndarray, ...]
    image: np.ndarray
    polygons: list[np.ndarray]


def bounce_echo(
    scene: Reflectors,
    frequencies: np.ndarray,
    antennas: tuple[np.ndarray, np.ndarray],
    reference_range: float,
    *,
    bounces: int,
    up: tuple[float, float, float] = UP,
    on_plane: float = 1e-9,
    window: tuple[float, float] = NO_WINDOW,
) -> np.ndarray:
    """Echoes of 1, 2 ... `bounces` reflections, m complex128 (bounces, n_f, 2, 2): every sequence of facets.

    antennas  places of transmitter and receiver, m (3,) each;  reference_range  m
    on_plane  m: corners nearer to a plane lie in it
    window  least and greatest half path about the reference range, m: places of the last facet beyond it are left out

    Flat facets i, j ... l reflect geometrically; the last one, m, radiates by physical optics:
        k/(2 sqrt(pi)) integral of S(x) J(x) exp(-j k (|x - T'| + |x - R| - 2 R_ref)) dA,   T' = M_l ... M_j M_i T
    over what the beam lights of m and R sees. J: what the reflections do to fields of H and V. Where R = T, HV and
    VH are their mean, by reciprocity: the last facet radiates unlike the others, hence a reversed sequence differs.
    """
    tx, rx = (np.asarray(place, float) for place in antennas)
    out = np.zeros((bounces, len(frequencies), 2, 2), complex)
    beams = [_Beam((), (), tx, [])]
    for order in range(bounces):
        beams = [beam for old in beams for k in range(len(scene.triangles)) if (beam := _onto(scene, old, k, on_plane))]
        for beam in beams:
            for triangle in _seen(scene, beam, rx, on_plane):
                for part in _within(triangle, beam.image, rx, reference_range, window, max(frequencies)):
                    out[order] += _triangle_echo(scene, beam, part, frequencies, rx, reference_range, up)
    return (out + out.swapaxes(-1, -2)) / 2 if np.array_equal(tx, rx) else out


def _onto(scene: Reflectors, beam: _Beam, k: int, on_plane: float) -> _Beam | None:
    """The beam on its way to facet k, None where nothing of it arrives."""
    if beam.facets and k == beam.facets[-1]:
        return None
    image, last = beam.image, beam.facets[-1] if beam.facets else None
    if last is not None:
        image = image - 2 * ((image - scene.triangles[last][0]) @ beam.normals[-1]) * beam.normals[-1]
    normal, facet = scene.facing(k, image), scene.triangles[k]
    if normal is None:
        return None
    others = [other for i, other in enumerate(scene.triangles) if i not in (k, last)]
    if last is not None:  # nothing behind the facet that the beam leaves lies in its way
        others = [_in_front(other, scene.triangles[last][0], beam.normals[-1], on_plane) for other in others]
    axes, center = plane_axes(facet), facet.mean(axis=0)
    outline = (facet - center) @ axes[:2].T
    pieces = [outline]
    if last is not None:
        windows = [shadow(facet, polygon, image, on_plane) for polygon in beam.polygons]
        pieces = [intersection(outline, window) for window in windows if len(window) and area(window) > 0]
    pieces = cut_away(pieces, _shadows(facet, others, image, on_plane))
    pieces = [piece for piece in pieces if len(piece) > 2 and area(piece) > LEAST_AREA * area(outline)]
    polygons = [center + piece @ axes[:2] for piece in pieces]
    return _Beam((*beam.facets, k), (*beam.normals, normal), image, polygons) if polygons else None


def _in_front(polygon: np.ndarray, point: np.ndarray, normal: np.ndarray, on_plane: float) -> np.ndarray:
    """The part of a convex polygon, m (n, 3), in front of a plane; (0, 3) where that lies in the plane."""
    height, corners = (polygon - point) @ normal, []
    if height.max() <= on_plane:
        return np.zeros((0, 3))
    for i in range(len(polygon)):
        j = (i + 1) % len(polygon)
        if height[i] >= 0:
            corners.append(polygon[i])
        if height[i] * height[j] < 0:
            corners.append(polygon[i] + height[i] / (height[i] - height[j]) * (polygon[j] - polygon[i]))
    return np.array(corners)


def _shadows(facet: np.ndarray, others: list[np.ndarray], eye: np.ndarray, on_plane: float) -> list[np.ndarray]:
    shadows = [shadow(facet, other, eye, on_plane) for other in others if len(other)]
    return [one for one in shadows if len(one) and area(one) > 0]


def _seen(scene: Reflectors, beam: _Beam, rx: np.ndarray, on_plane: float) -> Iterator[np.ndarray]:
    """Triangles, m (3, 3), of what a beam lights on its last facet: the part that the receiver sees."""
    k = beam.facets[-1]
    facet, normal = scene.triangles[k], beam.normals[-1]
    axes, center = plane_axes(facet), facet.mean(axis=0)
    pieces = [(polygon - center) @ axes[:2].T for polygon in beam.polygons]
    if normal @ unit(rx - center) > 1e-6:
        others = [other for i, other in enumerate(scene.triangles) if i != k]
        pieces = cut_away(pieces, _shadows(facet, others, rx, on_plane))
    for piece in pieces:
        for i in range(1, len(piece) - 1):
            corners = piece[[0, i, i + 1]]
            if area(corners) > LEAST_AREA * area((facet - center) @ axes[:2].T):
                yield center + corners @ axes[:2]


def _within(
    triangle: np.ndarray,
    image: np.ndarray,
    rx: np.ndarray,
    reference_range: float,
    window: tuple[float, float],
    frequency: float,
) -> Iterator[np.ndarray]:
    """Triangles that are together the part of one, m (3, 3), inside a range window: cut where its sides cross the
    window's edge, and halved before until the edge is straight."""

    def half_path(place: np.ndarray) -> float:
        return (
            float(np.sqrt(((place - image) ** 2).sum())) + float(np.sqrt(((place - rx) ** 2).sum()))
        ) / 2 - reference_range

    sides = np.linalg.norm(np.roll(triangle, -1, axis=0) - triangle, axis=1)
    middle, reach = half_path(triangle.mean(axis=0)), sides.max()
    if window[0] <= middle - reach and middle + reach <= window[1]:
        yield triangle
    elif middle + reach >= window[0] and middle - reach <= window[1]:
        distance = min(np.linalg.norm(triangle - end, axis=1).min() for end in (image, rx))
        if sides.max() ** 2 > 8 * distance * WINDOW_BOW * SPEED_OF_LIGHT / frequency:
            i = int(sides.argmax())
            half = triangle[[i, (i + 1) % 3]].mean(axis=0)
            for start in (i, (i + 1) % 3):
                part = triangle.copy()
                part[start] = half
                yield from _within(part, image, rx, reference_range, window, frequency)
            return
        polygon = triangle
        polygon = _cut(polygon, lambda places: half_path(places) - window[0])
        polygon = _cut(polygon, lambda places: window[1] - half_path(places))
        yield from (polygon[[0, i, i + 1]] for i in range(1, len(polygon) - 1))


def _cut(polygon: np.ndarray, height: Callable[[np.ndarray], float]) -> np.ndarray:
    """The part of a convex polygon, m (n, 3), of which `height` of places, m (3,), is at least 0: (k, 3)."""
    corners = []
    for one, other in zip(polygon, np.roll(polygon, -1, axis=0), strict=True):
        first, last = height(one), height(other)
        if first >= 0:
            corners.append(one)
        if (first >= 0) != (last >= 0):
            low, high = (one, other) if first >= 0 else (other, one)
            for _ in range(BISECTIONS):
                middle = (low + high) / 2
                low, high = (middle, high) if height(middle) >= 0 else (low, middle)
            corners.append(low)
    return np.array(corners).reshape(-1, 3)


def _triangle_echo(
    scene: Reflectors,
    beam: _Beam,
    triangle: np.ndarray,
    frequencies: np.ndarray,
    rx: np.ndarray,
    reference_range: float,
    up: tuple[float, float, float],
) -> np.ndarray:
    """The integral over a triangle by Gauss-Legendre quadrature, everything computed at every point."""
    waves = 2 * np.pi * np.asarray(frequencies) / SPEED_OF_LIGHT
    slope = unit(beam.image - triangle) + unit(rx - triangle)
    phase = waves.max() * np.abs(slope @ (triangle - np.roll(triangle, 1, axis=0)).T).max()
    points, weight = triangle_nodes(triangle, int(phase / 4) + 16)
    delay = excess_delay(beam.image, rx, points, reference_range)
    to_image, to_rx = unit(beam.image - points), unit(rx - points)
    out, facets, normal = np.zeros((len(waves), 2, 2), complex), list(beam.facets), beam.normals[-1]
    if not lit_share(normal, to_image, to_rx).any():
        return out
    rays = _rays(beam, -to_image)
    along = [2 * ray @ n for ray, n in zip(rays[:-1], beam.normals, strict=False)]
    along.append((to_image + to_rx) @ normal)
    lost = sum((height * cosine) ** 2 for height, cosine in zip(scene.height[facets], along, strict=True))
    weight = weight * scene.reflectivity[facets].prod()
    for i, (f, wave) in enumerate(zip(np.asarray(frequencies, float), waves, strict=True)):
        eps = scene.permittivity[i][facets]
        if i == 0 or (eps != scene.permittivity[i - 1][facets]).any():
            matrix = scattering_matrix(normal, to_image, to_rx, eps[-1], up) @ _jones(beam, rays, eps, up)
            rows = np.ascontiguousarray(matrix.reshape(-1, 4).T)  # a product of few rows takes a tenth of the time
        amplitude = weight * np.exp(-(wave**2) * lost / 2 - 2j * np.pi * ((np.longdouble(f) * delay) % 1).astype(float))
        out[i] = wave / (2 * np.sqrt(np.pi)) * (rows @ amplitude).reshape(2, 2)
    return out


def _rays(beam: _Beam, ray: np.ndarray) -> list[np.ndarray]:
    """Directions (n, 3) in which rays that arrive at the last facet along `ray` travel to each facet."""
    rays = [ray]
    for normal in beam.normals[-2::-1]:  # a mirror is its own inverse
        rays.insert(0, rays[0] - 2 * (rays[0] @ normal)[:, None] * normal)
    return rays


def _jones(beam: _Beam, rays: list[np.ndarray], eps: np.ndarray, up: tuple[float, float, float]) -> np.ndarray:
    """Fields H and V of rays (n, 3) at the last facet, of waves sent as H and V: complex128 (n, 2, 2)."""
    fields = [field.astype(complex) for field in polarisation(rays[0], up)]
    for normal, ray, one in zip(beam.normals[:-1], rays, eps, strict=False):
        fields = [_reflected(field, ray, normal, complex(one)) for field in fields]
    basis = polarisation(rays[-1], up)
    return np.stack([np.stack([(b * f).sum(axis=1) for f in fields], axis=-1) for b in basis], axis=-2)


def _reflected(field: np.ndarray, ray: np.ndarray, normal: np.ndarray, eps: complex) -> np.ndarray:
    """The field (n, 3) of plane waves along rays (n, 3) that a plane reflects: -E + 2 (n.E) n on a conductor."""
    if np.isinf(eps):
        return np.asarray(2 * (field @ normal)[:, None] * normal - field)
    across = np.cross(ray, normal)
    length = np.linalg.norm(across, axis=1, keepdims=True)
    straight = length < 1e-8
    across = np.where(straight, polarisation(ray)[0], across / np.where(straight, 1, length))
    r_h, r_v = fresnel(np.clip(-(ray @ normal), 0, 1), np.asarray(eps))
    out = ray - 2 * (ray @ normal)[:, None] * normal
    horizontal, vertical = (field * across).sum(axis=1), (field * np.cross(ray, across)).sum(axis=1)
    return np.asarray((r_h * horizontal)[:, None] * across + (r_v * vertical)[:, None] * np.cross(out, across))


def reflectors(scene: object, frequencies: Sequence[float]) -> Reflectors:
    """The facets of a sarcl.Scene as reflectors: those whose coherent part is not lost in roughness."""
    from ..scene.scene import Scene

    assert isinstance(scene, Scene)
    table = [m.permittivity(np.asarray(frequencies, float)) for m in scene.materials]
    height = np.array([m.height for m in scene.materials])[scene.material]
    reflectivity = scene.reflectivity * np.isfinite(height)
    height = np.hypot(np.where(np.isfinite(height), height, 0.0), scene.roughness)
    eps = np.stack(table, axis=-1)[:, scene.material]
    return Reflectors(scene.triangles, scene.two_sided, eps, reflectivity, height)
