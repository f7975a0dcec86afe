"""Physical optics of a planar facet in float64: phase integral, Fresnel coefficients, scattering matrix.

    a_rt = k/(2 sqrt(pi)) S_rt I,   |a|^2 = radar cross section, m^2;   k = 2 pi f/c;   time dependence exp(+j omega t)
    I    = integral over the facet of exp(+j q.rho) dA,   q = k (u_t + u_r), rho from the centroid

u_t, u_r are unit vectors FROM the facet TO the transmitter and the receiver: a point that moves towards them shortens
its path, so its phase -2 pi f tau grows. n is the unit normal that points out of the surface. Single scattering.
S_rt and matrices [r, t]: r received, t sent; 0 is H, 1 is V.

source   Franceschetti et al. 1992 (SARAS), eqs (1)-(10) and appendix; Tsang, Kong and Shin 1985 (tangent-plane
         approximation)

Where SARAS's print contradicts the physics, the equations are corrected:
- (A.7): R_q = (eps cos - root)/(eps cos + root). The print's sign would give a conducting facet S_HV != 0.
- (A.8): cos = -n.k, n of unit length and outward; the print has +n.k, and gradients for n.
- (A.15) is S_VV, printed S_VH.
- S_HV has the sign of v = x x k, as (A.9), (A.10) imply; (A.12) prints k x x.
"""

from __future__ import annotations

import math

import numpy as np

from ..base.constants import EDGE_ON
from ..base.vectors import cross, unit
from ..scene.material import Material

UP = (0.0, 0.0, 1.0)
WEAK = 0.1  # |eps - 1| below which differences in Fresnel's coefficients lose a digit or more


def triangle_mean(b: np.ndarray, c: np.ndarray) -> np.ndarray:
    """Mean of exp(j q.rho) over triangles, about the centroid, complex128 (...): I/A.

    b, c  phases q.(second - first vertex) and q.(third - first vertex), rad (...)

    I = 2 A exp[jx, jy, jz], the second divided difference of exp at the vertices' phases about the centroid, in any
    order. Sorted, x <= y <= z, with u = (z - y)/2 and v = (y - x)/2:

        I/A = exp(j (v - u)/6) [sinc((u + v)/2) (sinc u + sinc v)/2 - j cos((u + v)/2) (sinc u - sinc v)/(u + v)]

    sinc(x) = sin(x)/x. Only the last quotient can lose digits, where u + v is small: a series there. Error < 1e-14.
    """
    b, c = np.broadcast_arrays(np.asarray(b, float), np.asarray(c, float))
    x, y, z = np.sort(np.stack([np.zeros_like(b), b, c]), axis=0)
    u, v = (z - y) / 2, (y - x) / 2
    span = u + v
    small = span < 0.5
    quotient = (_sinc(u) - _sinc(v)) / np.where(small, 1, span)
    uu, vv = np.where(small, u * u, 0), np.where(small, v * v, 0)
    series, h, power = np.zeros(()), np.zeros(()), np.ones(())
    for m in range(1, 9):  # (sinc u - sinc v)/(u^2 - v^2): h is the sum of u^2i v^2(m-1-i)
        h, power = power + uu * h, power * vv
        series = series + (-1) ** m / math.factorial(2 * m + 1) * h
    quotient = np.where(small, (u - v) * series, quotient)
    bracket = _sinc(span / 2) * (_sinc(u) + _sinc(v)) / 2 - 1j * np.cos(span / 2) * quotient
    return np.asarray(np.exp(1j * (v - u) / 6) * bracket)


def _sinc(x: np.ndarray) -> np.ndarray:
    return np.sinc(x / np.pi)


def triangle_integral(triangles: np.ndarray, q: np.ndarray) -> np.ndarray:
    """Integral of exp(j q.rho) dA about each centroid, m^2 (k,); triangles m (k, 3, 3), q rad/m (3,) or (k, 3).

    The sign of q.rho: SARAS (2), (3) print exp(2j k.rho) with k along propagation; a point nearer to the radar has the
    larger phase, so k points from the target to the radar here. A rectangle hides it, a triangle does not.
    """
    edges = triangles[:, 1:] - triangles[:, :1]
    phases = (edges * np.asarray(q)[..., None, :]).sum(axis=-1)
    return normals_and_areas(triangles)[1] * triangle_mean(phases[:, 0], phases[:, 1])


def normals_and_areas(triangles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Unit normals (k, 3), right-handed about the vertices, and areas, m^2 (k,); a facet without area has normal 0."""
    across = cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    twice = np.linalg.norm(across, axis=1)
    return across / np.where(twice > 0, twice, 1)[:, None], twice / 2


def fresnel(cosine: np.ndarray, permittivity: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """R_h, R_v complex128 (...): SARAS (A.7), R_q with the sign that (A.13) to (A.15) need (-1, +1 for a conductor).

    cosine        of the angle of incidence, 0..1;  permittivity  relative, eps_r - j sigma/(omega eps0), inf: conductor
    R_v is that of the magnetic field: R_v = -R_h at normal incidence. The root has Im <= 0: fields decay inside.
    Where eps is close to 1 differences would lose it to rounding: they are products with the factor eps - 1 there.
    """
    c, eps = np.broadcast_arrays(np.asarray(cosine, float), np.asarray(permittivity, complex))
    conductor, vacuum = np.isinf(eps), eps == 1
    eps = np.where(conductor | vacuum, 2, eps)
    root = np.sqrt(eps - 1 + c * c)
    contrast = eps - 1
    is_weak = np.abs(contrast) < WEAK
    of_h, of_v = c + root, eps * c + root
    difference_h = np.where(is_weak, -contrast / of_h, c - root)
    difference_v = np.where(is_weak, contrast * ((eps + 1) * c * c - 1) / of_v, eps * c - root)
    sides = difference_h / of_h, difference_v / of_v
    h, v = (np.where(vacuum, 0, np.where(conductor, limit, r)) for r, limit in zip(sides, (-1, 1), strict=True))
    return h, v


def slab(
    cosine: np.ndarray, permittivity: np.ndarray, cycles: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """R_h, R_v, T_h, T_v complex128 (...) of a sheet in vacuum, with its middle as the plane of zero phase.

        R = r (1 - p^2)/(1 - r^2 p^2) s,   T = (1 - r^2) p/(1 - r^2 p^2) s
        p = exp(-2j pi d sqrt(eps - sin^2)),   s = exp(2j pi d cos)

    cosine, permittivity  as of `fresnel`, whose coefficients r are;  cycles  d, thickness over wavelength
    s: each face lies half a thickness before the plane, and T is relative to the wave without the sheet.
    Source: ITU-R P.2040-3, section 2.2.2, single-layer slab; Born and Wolf, Principles of Optics, section 1.6.4.
    """
    c, eps = np.broadcast_arrays(np.asarray(cosine, float), np.asarray(permittivity, complex))
    path = np.exp(-2j * np.pi * cycles * np.sqrt(eps - 1 + c * c))
    middle = np.exp(2j * np.pi * cycles * c)
    both = [(r, middle / (1 - (r * path) ** 2)) for r in fresnel(c, eps)]
    r_h, r_v = (r * (1 - path**2) * factor for r, factor in both)
    t_h, t_v = ((1 - r**2) * path * factor for r, factor in both)
    return r_h, r_v, t_h, t_v


def polarisation(sight: np.ndarray, up: tuple[float, float, float] = UP) -> tuple[np.ndarray, np.ndarray]:
    """Unit vectors h = s x up/|s x up| and v = h x s of lines of sight s, (..., 3), from an antenna to a facet.

    Along `up` (|s x up| < 1e-6) h takes y for up, or x where up is y.
    """
    s = np.asarray(sight, float)
    h = cross(s, np.asarray(up, float))
    is_along = np.linalg.norm(h, axis=-1, keepdims=True) < 1e-6
    if is_along.any():
        h = np.where(is_along, cross(s, np.array([0.0, 1.0, 0.0] if abs(up[1]) < 0.9 else [1.0, 0.0, 0.0])), h)
    h = unit(h)
    return h, cross(h, s)


def lit_share(normal: np.ndarray, to_tx: np.ndarray, to_rx: np.ndarray, forward: bool = False) -> np.ndarray:
    """Share (...) of the physical-optics echo that a facet sends back: 1 in front of both antennas, 0 behind either.

    normal, to_tx, to_rx  unit vectors (..., 3), the last two from the facet to the antennas

        share = max(L(n.u_t) + L(n.u_r) - 1, 0),   L(c) = clamp((1 + c/w)/2, 0, 1),   w = EDGE_ON |u_t - u_r|

    Physical optics doubles the incident magnetic field on a surface in front of the transmitter, and has none behind
    it. With two antennas its echo therefore jumps where a facet turns through the plane that holds one of them, and
    rounding would decide. Along a conducting plane a wave whose electric field is normal to the plane meets the
    boundary condition as it is, undoubled: half of the echo, the mean of both sides, is the limit. The echo fades over
    cosines between -w and w. On a sheet with both antennas in its plane the currents of both sides cancel: share 0. The
    echo of a facet for one antenna falls with the cosine, without a jump: w = 0, and nothing changes.

    forward  True: what the transmitter lights sends to all sides, through its own body too: share = L(n.u_t)
    """
    n, u, r = (np.asarray(a, float) for a in (normal, to_tx, to_rx))
    width = np.maximum(EDGE_ON * np.linalg.norm(u - r, axis=-1), 1e-30)
    each = [np.clip(0.5 + 0.5 * (n * look).sum(axis=-1) / width, 0, 1) for look in (u, r)]
    return np.asarray(each[0] if forward else np.maximum(each[0] + each[1] - 1, 0))


def turned(normal: np.ndarray, to_tx: np.ndarray, to_rx: np.ndarray, forward: bool = False) -> np.ndarray:
    """True (...) where the antennas look at the back of a facet: n.(u_t + u_r) < 0, n.u_t < 0 for forward scatter. On
    the side that they look at, `lit_share` is that of a sheet, which reflects on both sides."""
    return np.asarray((normal * (to_tx if forward else to_tx + to_rx)).sum(axis=-1) < 0)


def scattering_matrix(
    normal: np.ndarray,
    to_tx: np.ndarray,
    to_rx: np.ndarray,
    permittivity: np.ndarray,
    up: tuple[float, float, float] = UP,
    forward: bool = False,
) -> np.ndarray:
    """S, complex128 (..., 2, 2), of facets with unit normals: times `lit_share`, 0 where an antenna lies behind one.

    normal, to_tx, to_rx  unit vectors (..., 3), the last two from the facet to the antennas;  permittivity  (...)

    Incident k_i = -u_t, t = k_i x n/|k_i x n|, d = k_i x t, scattered k_s = u_r:
        n x E     = (1 + R_h)(e.t)(n x t) - (1 - R_v)(n.k_i)(e.d) t
        eta n x H = -[(1 - R_h)(n.k_i)(e.t) t + (1 + R_v)(e.d)(n x t)]
        S_rt      = e_r . k_s x [n x E - k_s x (eta n x H)]
    A perfect conductor seen monostatically has S_HH = S_VV = 2 cos, S_HV = 0. Reciprocal (S_HV = S_VH) monostatically;
    bistatically the tangent-plane approximation is not.
    """
    cosine, parts = scattering_parts(normal, to_tx, to_rx, up, forward)
    r_h, r_v = (a[..., None, None] for a in fresnel(np.clip(cosine, 0, 1), permittivity))
    return np.asarray(parts[0] + r_h * parts[1] + r_v * parts[2], complex)


def scattering_parts(
    normal: np.ndarray,
    to_tx: np.ndarray,
    to_rx: np.ndarray,
    up: tuple[float, float, float] = UP,
    forward: bool = False,
) -> tuple[np.ndarray, np.ndarray]:
    """Cosine of the angle of incidence (...), and the real matrices (4, ..., 2, 2) P in S = P_0 + R_h P_1 + R_v P_2.

    What does not depend on the frequency. The last one is the part of P_0 of waves with the electric field along the
    plane: of a sheet, the field behind it counts against that in front: S - T_h P_3 - T_v (P_0 - P_3).
    By e_r.k_s = 0: e_r.k_s x a = (e_r x k_s).a and e_r.k_s x (k_s x a) = -e_r.a.
    """
    n, u, r = np.broadcast_arrays(*(np.asarray(a) for a in (normal, to_tx, to_rx)))
    k = -u
    cosine = (n * u).sum(axis=-1)
    lit = lit_share(n, u, r, forward)
    across = cross(k, n)
    length = np.linalg.norm(across, axis=-1, keepdims=True)
    # at normal incidence any tangent does: R_v = -R_h there
    t, is_normal = across / np.where(length > 0, length, 1), length < 1e-8
    if is_normal.any():
        t = np.where(is_normal, polarisation(k)[0], t)
    d, nt = cross(k, t), cross(n, t)
    h, v = polarisation(-r, up)
    turned = -v, h  # e_r x k_s
    out = np.empty((4, *lit.shape, 2, 2))
    for j, e in enumerate(polarisation(k, up)):
        et, ed = _dot(e, t), _dot(e, d)
        for i, (received, across) in enumerate(zip((h, v), turned, strict=True)):
            horizontal = et * _dot(across, nt), cosine * et * _dot(received, t)  # of n x E, and of eta n x H
            vertical = cosine * ed * _dot(across, t), -ed * _dot(received, nt)
            along = sum(horizontal)
            parts = along + sum(vertical), horizontal[0] - horizontal[1], vertical[1] - vertical[0], along
            for part, value in zip(out, parts, strict=True):
                part[..., i, j] = np.where(lit > 0, lit * value, 0)
    return cosine, out


def _dot(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return np.asarray(np.einsum("...i,...i->...", a, b))


def rough_mean(
    mean: np.ndarray, material: Material, q: np.ndarray, normal: np.ndarray, area: np.ndarray,
    wavelength: float | np.ndarray, random: np.ndarray,
) -> np.ndarray:  # fmt: skip
    """Mean of exp(j q.rho) over rough facets, complex128 (..., k), from that of smooth ones.

    A smooth plate's bistatic pattern obeys  integral over the hemisphere of |I|^2 cos dOmega = lambda^2 A. A rough one
    spreads the same power over its diagram D(delta), with a Rayleigh amplitude and a uniform phase:

        mean |I|^2 = lambda^2 A D(delta)/Omega,    Omega = integral over the hemisphere of D(delta) cos(delta) dOmega

    which does not depend on how finely a surface is cut: sigma0 = pi |S|^2 D/Omega, Lambert's 4 |R|^2 cos^2 for an
    isotropic diagram. (SARAS gives the shapes in eq. (11), not their scale.) With roughness of rms height h the
    coherent part keeps exp(-(q.n h)^2) of its power; the rest is spread over the diagram.

    q  rad/m (..., k, 3), of wavelength, m (or (..., 1));  normal  unit (k, 3);  area  m^2 (k,)
    random  complex Gaussian of unit power (k,)
    Source: Franceschetti et al. 1992 (SARAS), eq. (11); docs/theory/facets.md
    """
    along = (q * normal).sum(axis=-1)
    delta = np.arccos(np.clip(along / np.linalg.norm(q, axis=-1), -1, 1))
    with np.errstate(invalid="ignore"):
        fall = (
            np.exp(-(np.where(along == 0, 0, along * material.height) ** 2))
            if material.height
            else np.ones(along.shape)
        )
    power = wavelength**2 * material.lobe(delta) / material.solid_angle * (1 - fall) / area
    return np.asarray(np.sqrt(fall) * mean + np.sqrt(power) * random)
