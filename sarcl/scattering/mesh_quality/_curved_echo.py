"""Echoes of facets, and of the curved surface over them, at one pulse and frequency, for comparison.

    flat    = sum over facets of w integral of n.u exp(j q.x) dA             q = k (u_t + u_r), u = q/|q|
    curved  = sum of w integral of (n - grad h).u exp(j (q.x + q.n h)) dA    where that faces the antennas
    h       = 4 (h_1 l_1 l_2 + h_2 l_2 l_3 + h_3 l_3 l_1)                    l barycentric; h_i as of _curvature.py

(k^2/pi) |sum|^2 is the radar cross section, m^2, seen monostatically: S = 2 n.u of a conductor. Both sums are taken at
the same Gauss-Legendre nodes, so that errors of the quadrature cancel. w = reflectivity x |R| at normal incidence x
exp(-(q.n s)^2/2), s the rms height of all roughness; the power that it removes from the coherent echo is incoherent
power, in both.
"""

from __future__ import annotations

import functools
from dataclasses import dataclass

import numpy as np

from ...base.constants import SPEED_OF_LIGHT
from ...base.vectors import cross, dot
from ...numerics.pulse_geometry import PulseGeometry
from ...scene.material import Material
from ...scene.scene import Scene
from ...scene.triangles import centroids
from ..physical_optics import triangle_mean
from ._curvature import SurfaceCurvature

# rad of phase over an edge, beyond that which the curvature compensates: farther off specular both echoes are equal
NEAR = (25.0, 200.0)
ENOUGH = 5e5  # integrands per pulse and frequency: with more facets, only those nearer to specular are integrated
MOST_NODES = 56  # per side; facets that need more are computed by stationary phase
FEW = 4.0  # rad over a facet, for which seven nodes are enough
CHUNK = 2**16  # integrands at a time: they stay in the cache


@dataclass(frozen=True, eq=False)
class Sums:
    """Sums of n surfaces, seen on the side of their normals and on the other, (2, n).

    flat, curved  coherent sums, m^2;  flat_power, curved_power  incoherent power, m^4
    blame         difference that each facet makes, m^4 (k,);  cost  number of integrands, about
    """

    flat: np.ndarray
    curved: np.ndarray
    flat_power: np.ndarray
    curved_power: np.ndarray
    blame: np.ndarray
    cost: int


def sums(scene: Scene, b: SurfaceCurvature, antennas: PulseGeometry, row: int, frequency: float) -> Sums:
    """Sums over a scene's facets, with `b` of the same facets, at one row of the antennas and a frequency, Hz."""
    centers, n = centroids(scene.triangles), int(b.surface.max()) + 1
    ends = [positions[row] for positions in antennas.ends]
    path, look, cosines = np.full(len(centers), -float(antennas.reference_range[row])), np.zeros_like(centers), []
    for end in ends:
        away = end - centers
        distance = np.sqrt(dot(away, away))
        path += distance / len(ends)
        away /= np.maximum(distance, 1e-300)[:, None]
        look += away / len(ends)
        cosines.append(dot(b.normal, away))
    half = np.sqrt(dot(look, look))  # |q|/2k
    seen = (path >= antennas.near[row]) & (path <= antennas.far[row]) & (b.area > 0) & (half > 1e-6)
    if antennas.beam is not None:
        seen &= antennas.beam_depth(centers, row) >= 0
    # a bound on |grad h|: where facets hardly face away some of the curve still faces the antennas
    longest = np.sqrt(np.maximum.reduce([dot(e, e) for e in np.moveaxis(b.edge, 1, 0)]))
    lean = 4 * np.abs(b.height).sum(axis=1) * longest / np.maximum(b.area, 1e-300)
    wave, blame, cost, parts = 2 * np.pi * frequency / SPEED_OF_LIGHT, np.zeros(len(centers)), 4 * len(centers), []
    for side in (1, -1):
        facing = np.minimum.reduce([side * c for c in cosines])
        some = np.flatnonzero(seen & (facing + lean > 0) & (scene.two_sided | (b.turn == side)))
        if len(some) == 0:
            parts.append([np.zeros(n, np.complex128)] * 2 + [np.zeros(n)] * 2)
            continue
        f = _facets(b, some, side, facing[some], look[some] / half[some, None], 2 * wave * half[some])
        flat, curved, loose, spent = _integrals(f)
        amplitude, rough = _roughened(scene, some, b.normal[some], f, frequency, np.abs(flat) ** 2)
        blame[some] += amplitude**2 * (np.abs(flat - curved) ** 2 + loose)
        cost += spent
        wanted = amplitude * np.exp(-2j * wave * path[some])
        totals = wanted * flat, wanted * curved, rough, rough + amplitude**2 * loose
        parts.append([_total(b.surface[some], values, n) for values in totals])
    flat, curved, *powers = (np.stack(both) for both in zip(*parts, strict=True))
    return Sums(flat, curved, powers[0], powers[1], blame, cost)


@dataclass(frozen=True, eq=False)
class _Facets:
    """Of n facets: phases over their edges, rad, heights, m, and gradients of the barycentric coordinates along u, 1/m,
    (n, 3); n.u, the smaller cosine to an antenna, area, m^2, |q|, rad/m (n,)."""

    phase: np.ndarray
    height: np.ndarray
    slope: np.ndarray
    along: np.ndarray
    facing: np.ndarray
    area: np.ndarray
    q: np.ndarray


def _facets(
    b: SurfaceCurvature, some: np.ndarray, side: int, facing: np.ndarray, u: np.ndarray, q: np.ndarray
) -> _Facets:
    """Facets `some` of b seen from direction u (n, 3), on the side their normals point to or on the other (-1)."""
    edge, area, normal = b.edge[some], b.area[some], b.normal[some]
    across = cross(u, normal) * (b.turn[some] / (2 * area))[:, None]
    slope = np.einsum("kij,kj->ki", np.roll(edge, -1, axis=1), across)
    phase = np.einsum("kij,kj->ki", edge, u) * q[:, None]
    return _Facets(phase, side * b.height[some], slope, side * dot(normal, u), facing, area, q)


def _integrals(f: _Facets) -> tuple[np.ndarray, np.ndarray, np.ndarray, int]:
    """(flat, curved) of each facet about its centroid, m^2, power whose phase is not certain, m^4, and the cost."""
    span, bend = np.abs(f.phase).max(axis=1, initial=0), f.q * np.abs(f.height).max(axis=1, initial=0)
    nodes = np.ceil((span + 4 * bend) / 4).astype(int) + 3
    nodes[span + 4 * bend < FEW] = 0
    near = np.clip(4 * (np.sqrt(ENOUGH / max(len(span), 1)) - 3), *NEAR)
    coarse = (nodes > MOST_NODES) & (span <= NEAR[0] + 4 * bend)
    far = ~coarse & ((nodes > MOST_NODES) | (span > near + 4 * bend))
    flat, curved = np.zeros(len(span), np.complex128), np.zeros(len(span), np.complex128)
    loose, alone = np.zeros(len(span)), far | coarse
    lit = np.where(f.facing > 0, f.along, 0.0)
    flat[alone] = (f.area * lit)[alone] * triangle_mean(f.phase[alone, 0], -f.phase[alone, 2])
    curved[far] = flat[far]
    loose[coarse] = _stationary(f, coarse) ** 2
    cost = 20 * int(alone.sum())
    for n in np.unique(nodes[~alone]):
        places, weights = _rule(int(n))
        which = np.flatnonzero(~alone & (nodes == n))
        cost += len(which) * len(weights)
        step = max(1, CHUNK // len(weights))
        for i in range(0, len(which), step):
            part = which[i : i + step]
            flat[part], curved[part] = _quadrature(f, part, places, weights)
    return flat, curved, loose, cost


def _quadrature(f: _Facets, part: np.ndarray, places: np.ndarray, weights: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Both integrals of some facets at barycentric places (p, 3) with weights (p,)."""
    p0 = (f.phase[part, 2] - f.phase[part, 0]) / 3
    corners = np.stack([p0, p0 + f.phase[part, 0], p0 - f.phase[part, 2]]).astype(np.float32)
    height, slope = (a[part].T.astype(np.float32) for a in (f.height, f.slope))
    along, facing, q = (a[part].astype(np.float32) for a in (f.along, f.facing, f.q))
    following = np.roll(places, -1, axis=1)
    phase = places @ corners  # (p, n)
    tilt = -4 * (following @ (height * slope) + places @ (height * np.roll(slope, -1, axis=0)))
    later = phase + 4 * ((places * following) @ height) * (q * along)
    lit = (along + tilt) * (facing + tilt > 0)
    flat = (weights @ np.cos(phase) + 1j * (weights @ np.sin(phase))) * (along * (facing > 0))
    curved = weights @ (lit * np.cos(later)) + 1j * (weights @ (lit * np.sin(later)))
    return f.area[part] * flat, f.area[part] * curved


def _stationary(f: _Facets, which: np.ndarray) -> np.ndarray:
    """Modulus of the curved integral of facets a point of which is specular, m^2: that of one or of two curvatures."""
    a, b, c = f.height[which].T * f.q[which]
    one = 0.886 / np.sqrt(np.maximum.reduce([np.abs(a), np.abs(b), np.abs(c)]))
    both = 4 * np.pi / np.sqrt(np.maximum(np.abs(64 * a * c - 16 * (b - a - c) ** 2), 1e-300))
    return np.asarray(f.area[which] * np.minimum(1.0, np.minimum(one, both)))


def _roughened(
    scene: Scene, some: np.ndarray, normal: np.ndarray, f: _Facets, frequency: float, flat: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """What facets `some` of a scene reflect as mirrors, a factor, and incoherently, m^4; flat: |flat integral|^2."""
    moved = scene.roughness[some] ** 2  # m^2 along the normal
    if scene.has_random_points:
        moved = moved + (np.einsum("kij,kj->ki", scene.point_roughness[some], normal) ** 2).mean(axis=1)
    material, along, wavelength = scene.material[some], f.q * f.along, SPEED_OF_LIGHT / frequency
    height, reflected = (
        np.array(values)[material]
        for values in ([m.height for m in scene.materials], [_reflection(m, frequency) for m in scene.materials])
    )
    kept, still = np.exp(-((along * height) ** 2)), np.exp(-(along**2) * moved)  # of the power
    power = kept * (1 - still) * flat
    for i, m in enumerate(scene.materials):
        if m.height > 0 and (of := material == i).any():
            lobe = m.lobe(np.arccos(np.clip(f.along[of], -1, 1))) / m.solid_angle
            power[of] += (1 - kept[of]) * lobe * wavelength**2 * f.area[of] * np.maximum(f.along[of], 0) ** 2
    amplitude = scene.reflectivity[some] * reflected
    return amplitude * np.sqrt(kept * still), amplitude**2 * power


def _reflection(material: Material, frequency: float) -> float:
    """|R| at normal incidence."""
    if material.conducting:
        return 1.0
    root = np.sqrt(complex(material.permittivity(frequency)))
    return float(abs((1 - root) / (1 + root)))


def _total(surface: np.ndarray, values: np.ndarray, n: int) -> np.ndarray:
    """Sums of values (k,) by surface (n,)."""
    out = np.bincount(surface, values.real, n)
    return out + 1j * np.bincount(surface, values.imag, n) if np.iscomplexobj(values) else out


@functools.cache
def _rule(n: int) -> tuple[np.ndarray, np.ndarray]:
    """Barycentric places (p, 3) and weights (p,) of n^2 nodes in a triangle, float32; for 0, seven (Radon's)."""
    if n == 0:
        r = np.sqrt(15.0)
        a, b = (6 - r) / 21, (6 + r) / 21
        rows = [[1 / 3] * 3, *(np.roll([1 - 2 * v, v, v], i) for v in (a, b) for i in range(3))]
        shares = [9 / 40, *[(155 - r) / 1200] * 3, *[(155 + r) / 1200] * 3]
        return np.array(rows, np.float32), np.array(shares, np.float32)
    x, w = np.polynomial.legendre.leggauss(n)
    x, w = (x + 1) / 2, w / 2
    s, t = (a.ravel() for a in np.meshgrid(x, x, indexing="ij"))
    places = np.stack([1 - s, s * (1 - t), s * t], axis=1)
    return places.astype(np.float32), (2 * s * np.outer(w, w).ravel()).astype(np.float32)
