"""Echo of triangular facets by physical optics: sums and integrals of sarcl/scattering/physical_optics.py; past thin
sheets: small pieces, each seen along a ray to each antenna, through what the ray meets."""

from __future__ import annotations

import math

import numpy as np

from ..base.constants import SPEED_OF_LIGHT
from ..base.vectors import unit
from ..scattering.physical_optics import (
    UP,
    normals_and_areas,
    polarisation,
    scattering_matrix,
    scattering_parts,
    triangle_integral,
)
from ..scene.scene import Scene
from .equations import excess_delay, triangle_nodes
from .geometry import half_path

ON_PLANE = 1e-6  # m: planes of facets that are no farther apart are one


def facet_amplitude(
    triangles: np.ndarray,
    permittivity: np.ndarray,
    frequency: float,
    to_tx: np.ndarray,
    to_rx: np.ndarray,
    up: tuple[float, float, float] = UP,
) -> np.ndarray:
    """k/(2 sqrt(pi)) S I of facets in plane waves, about their centroids, m complex128 (k, 2, 2).

    triangles m (k, 3, 3); permittivity () or (k,); frequency Hz; to_tx, to_rx unit vectors (3,) or (k, 3).
    """
    k = 2 * np.pi * frequency / SPEED_OF_LIGHT
    normals = normals_and_areas(triangles)[0]
    integral = triangle_integral(triangles, k * (np.asarray(to_tx) + to_rx))
    matrix = scattering_matrix(normals, to_tx, to_rx, permittivity, up)
    return np.asarray(k / (2 * math.sqrt(math.pi)) * matrix * integral[:, None, None])


def facet_echo(
    triangles: np.ndarray,
    permittivity: np.ndarray,
    frequencies: np.ndarray,
    tx: np.ndarray,
    rx: np.ndarray,
    reference_range: float,
    *,
    by_facet: bool = False,
    up: tuple[float, float, float] = UP,
) -> np.ndarray:
    """Sum over facets of k/(2 sqrt(pi)) integral S exp(-j 2 pi f (tau(x) - tau_ref)) dA, m complex128 (n_f, 2, 2).

    triangles     m (k, 3, 3), lit on the side their normals point to;  permittivity  (), (k,) or (n_f, k)
    frequencies   Hz (n_f,);  tx, rx  m (3,);  reference_range  m, tau_ref = 2 reference_range/c
    by_facet      True: S is that of a facet's centroid; False: that of every point

    tau(x) = (|tx - x| + |x - rx|)/c is exact: no expansion in frequency, space or range. Spreading loss is left out:
    it is a separate factor. Gauss-Legendre in both coordinates of the triangle shrunk to its first vertex; nodes by the
    largest phase along an edge, so cost grows with its square. Error below 1e-11 of the echo at normal incidence.
    """
    frequencies, tx, rx = np.asarray(frequencies, float), np.asarray(tx, float), np.asarray(rx, float)
    eps = np.broadcast_to(np.asarray(permittivity, complex), (len(frequencies), len(triangles)))
    normals = normals_and_areas(triangles)[0]
    out = np.zeros((len(frequencies), 2, 2), complex)
    for facet, normal, column in zip(triangles, normals, eps.T, strict=True):
        edges = facet - np.roll(facet, 1, axis=0)
        slope = unit(tx - facet) + unit(rx - facet)
        phase = 2 * np.pi * frequencies.max() / SPEED_OF_LIGHT * np.abs(slope @ edges.T).max()
        points, weight = triangle_nodes(facet, int(phase / 4) + 40)
        delay = excess_delay(tx, rx, points, reference_range)
        at = facet.mean(axis=0)[None] if by_facet else points
        for i, f in enumerate(frequencies):
            if i == 0 or column[i] != column[i - 1]:  # S changes with frequency only through the permittivity
                matrix = scattering_matrix(normal, unit(tx - at), unit(rx - at), column[i], up)
            wave = weight * np.exp(-2j * np.pi * ((np.longdouble(f) * delay) % 1).astype(float))
            k = 2 * np.pi * f / SPEED_OF_LIGHT
            total = matrix[0] * wave.sum() if by_facet else np.tensordot(wave, matrix, 1)
            out[i] += k / (2 * math.sqrt(math.pi)) * total
    return out


def film(
    cosine: np.ndarray, permittivity: complex | np.ndarray, thickness: float, frequency: float | np.ndarray
) -> tuple[np.ndarray, ...]:
    """R_h, R_v, T_h, T_v complex128 (n,) of a sheet by its characteristic matrix (Abeles), phases about its middle.

    (B, C) = ((cos d, j sin d/Y), (j Y sin d, cos d)) (1, Y_0), R = (Y_0 B - C)/(Y_0 B + C), T = 2 Y_0/(Y_0 B + C), with
    Y the admittances; R_v is that of the magnetic field.
    """
    k, root = 2 * np.pi * frequency / SPEED_OF_LIGHT, np.sqrt(permittivity - 1 + cosine**2 + 0j)
    depth, middle = k * thickness * root, np.exp(1j * k * thickness * cosine)
    reflected, passed = [], []
    for outer, inner in ((cosine, root), (1 / cosine, permittivity / root)):
        b = np.cos(depth) + 1j * np.sin(depth) * outer / inner
        c = 1j * inner * np.sin(depth) + np.cos(depth) * outer
        reflected.append((outer * b - c) / (outer * b + c) * middle)
        passed.append(2 * outer / (outer * b + c) * middle)
    return reflected[0], -reflected[1], *passed


def sheet_echo(
    scene: Scene,
    frequencies: np.ndarray,
    antennas: tuple[np.ndarray, np.ndarray],
    reference_range: float,
    *,
    size: float,
) -> np.ndarray:
    """Echo of the smooth facets of a scene, past opaque ones and through sheets, m complex128 (n_f, 2, 2) [r, t].

    antennas  places of transmitter and receiver, m (3,);  reference_range  m
    size      m, longest edge of pieces: each is dark, or seen whole, as the ray from its centroid to each antenna is
              free of opaque facets, and has the transmission of that ray on each way
    """
    corners, of = _pieces(scene, size)
    middle, total = corners.mean(axis=1), []
    looks = [unit(end - middle) for end in antennas]
    normal = normals_and_areas(corners)[0]
    back = (normal * (looks[0] + looks[1])).sum(axis=1) < 0
    corners = np.where((back & scene.two_sided[of])[:, None, None], corners[:, ::-1], corners)
    met = [_met(scene, middle, end) for end in antennas]
    is_sheet = scene.sheets
    seen = ~np.any([(distance < np.inf)[:, ~is_sheet].any(axis=1) for distance in met], axis=0)
    path = half_path(*antennas, middle, reference_range)
    for f in frequencies.tolist():
        matrix = np.zeros((len(of), 2, 2), complex)
        for number, material in enumerate(scene.materials):
            rows = np.flatnonzero(seen & (scene.material[of] == number))
            eps, sides = material.permittivity(f), (looks[0][rows], looks[1][rows])
            if material.thickness:
                matrix[rows] = _sheet_amplitude(corners[rows], (eps, material.thickness), f, sides)
            else:
                matrix[rows] = facet_amplitude(corners[rows], eps, f, *sides)
        ways = [_through(scene, distance, -look, f) for distance, look in zip(met, looks, strict=True)]
        wave = np.exp(-2j * np.pi * ((2 * np.longdouble(f) * path / np.longdouble(SPEED_OF_LIGHT)) % 1).astype(float))
        total.append(ways[1].swapaxes(1, 2) @ matrix @ ways[0] * (wave * scene.reflectivity[of])[:, None, None])
    return np.array(total).sum(axis=1)


def _pieces(scene: Scene, size: float) -> tuple[np.ndarray, np.ndarray]:
    """Congruent pieces of facets, m (n, 3, 3), and the facets that they are of (n,)."""
    out, of = [], []
    for number, (a, b, c) in enumerate(scene.triangles):
        n = math.ceil(max(np.linalg.norm(b - a), np.linalg.norm(c - b), np.linalg.norm(a - c)) / size)
        i, j = (index.ravel() for index in np.indices((n, n)))
        upright, other = i + j < n, i + j < n - 1
        u, v = (
            np.concatenate([np.stack(x, axis=1)[upright], np.stack(y, axis=1)[other]])[..., None] / n
            for x, y in (((i, i + 1, i), (i + 1, i + 1, i)), ((j, j, j + 1), (j, j + 1, j + 1)))
        )
        out.append(a + u * (b - a) + v * (c - a))
        of.append(np.full(len(u), number))
    return np.concatenate(out), np.concatenate(of)


def _met(scene: Scene, places: np.ndarray, antenna: np.ndarray) -> np.ndarray:
    """Distance, m (n, k), from places at which rays to an antenna meet each facet; inf where they do not, and of facets
    in one plane with the place. Of a sheet of several facets the first one counts.

    Source: Moeller and Trumbore 1997.
    """
    out = np.full((len(places), len(scene.triangles)), np.inf)
    ray = antenna - places
    normal = normals_and_areas(scene.triangles)[0]
    for number, (a, b, c) in enumerate(scene.triangles):
        p, s = np.cross(ray, c - a), places - a
        q, det = np.cross(s, b - a), p @ (b - a)
        with np.errstate(divide="ignore", invalid="ignore"):
            u, v, t = (s * p).sum(axis=1) / det, (q * ray).sum(axis=1) / det, q @ (c - a) / det
            is_met = (u >= 0) & (v >= 0) & (u + v <= 1) & (t > 0) & (t < 1)
        is_met &= np.abs(s @ normal[number]) > ON_PLANE
        in_plane = np.abs((scene.triangles - a) @ normal[number]).max(axis=1) < ON_PLANE
        if scene.sheets[number]:
            is_met &= np.isinf(out[:, in_plane]).all(axis=1)
        out[is_met, number] = (t * np.linalg.norm(ray, axis=1))[is_met]
    return out


def _through(scene: Scene, distance: np.ndarray, sight: np.ndarray, frequency: float) -> np.ndarray:
    """What sheets let through of H and V of an antenna, complex128 (n, 2, 2), along lines of sight (n, 3), which meet
    facets at `distance` (n, k), m, from their far ends."""
    axes = np.stack(polarisation(sight), axis=1)
    field = np.swapaxes(axes, 1, 2).astype(complex)  # columns: unit fields along H, V
    normal = normals_and_areas(scene.triangles)[0]
    order = np.argsort(-np.where(np.isinf(distance), -1, distance), axis=1)
    for column in order.T:
        for number in np.flatnonzero(scene.sheets).tolist():
            rows = np.flatnonzero((column == number) & np.isfinite(distance[:, number]))
            material, s = scene.materials[scene.material[number]], sight[rows]
            across = np.cross(s, normal[number])
            length = np.linalg.norm(across, axis=1, keepdims=True)
            across = np.where(length > 1e-9, across / np.maximum(length, 1e-9), axes[rows, 0])
            along, cosine = np.cross(s, across), np.minimum(np.abs(s @ normal[number]), 1)
            _, _, *passed = film(cosine, material.permittivity(frequency), material.thickness, frequency)
            field[rows] = sum(
                t[:, None, None] * e[:, :, None] * (e[:, None] @ field[rows])
                for t, e in zip(passed, (across, along), strict=True)
            )
    return np.asarray(axes @ field)


def _sheet_amplitude(
    corners: np.ndarray,
    slab: tuple[complex | np.ndarray, float],
    frequency: float,
    looks: tuple[np.ndarray, np.ndarray],
) -> np.ndarray:
    """As `facet_amplitude`, of pieces of a sheet of a permittivity and a thickness, m: what lies behind counts too."""
    k = 2 * np.pi * frequency / SPEED_OF_LIGHT
    normal = normals_and_areas(corners)[0]
    cosine, parts = scattering_parts(normal, *looks, UP)
    r_h, r_v, t_h, t_v = (a[:, None, None] for a in film(np.clip(cosine, 1e-12, 1), *slab, frequency))
    matrix = parts[0] + r_h * parts[1] + r_v * parts[2] - t_h * parts[3] - t_v * (parts[0] - parts[3])
    integral = triangle_integral(corners, k * (looks[0] + looks[1]))
    return np.asarray(k / (2 * math.sqrt(math.pi)) * matrix * integral[:, None, None])
