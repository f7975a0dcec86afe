"""Fields that several facets reflect one after the other, and the physical-optics echo of the last one, in float64.

    a_rt(f) = k/(2 sqrt(pi)) [S(n_m, u_t', u_r) J]_rt A mean(exp(j k (u_t' + u_r).rho)) rho_1 ... rho_m

u_t', u_r  from the last facet to the transmitter's image and to the receiver; A, rho  area and places of a triangle
J          fields H and V of the wave that arrives at the last facet, for H and V that were sent: each facet before it
           reflects the field across its plane of incidence by R_h, the magnetic field across it by R_v
           One antenna that sends and receives alike: HV and VH are equal by reciprocity, and both are their mean
rho_i      reflectivity, and what roughness leaves: exp(-(2 k h cos t)^2/2), at the last facet exp(-(q.n h)^2/2)
source     docs/theory/bounces.md; scattering/physical_optics for S, R_h and R_v
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ...base.constants import SPEED_OF_LIGHT
from ...base.vectors import cross, dot, unit
from ...scattering.physical_optics import fresnel, polarisation, scattering_parts, triangle_mean
from ...scene.material import Material
from ._beams import Beams


@dataclass(frozen=True, eq=False)
class Coatings:
    """Materials of facets: index (k,) into materials; reflectivity, and rms height of all roughness, m (k,)."""

    material: np.ndarray
    materials: tuple[Material, ...]
    reflectivity: np.ndarray
    height: np.ndarray

    def permittivity(self, frequency: float) -> np.ndarray:
        """Relative permittivity of every material, complex128; inf: conductor."""
        return np.array([m.permittivity(frequency) for m in self.materials], np.complex128)

    @property
    def disperses(self) -> bool:
        """Whether reflection coefficients depend on frequency."""
        return any(m.disperses for m in self.materials)


@dataclass(frozen=True, eq=False)
class Facets:
    """Triangles, m (n, 3, 3), on the last facets of beams, and how antennas see them.

    beams   one for each triangle, with the number `of` (n,) among those of a block;  rx  receivers, m (n, 3)
    path    |x - T'| + |x - R| of the centroids, with the mean of what the wave's curvature adds, m (n,)
    slopes  changes of the path from the first corner to the two others, m (n, 2), with the opposite sign
    """

    triangles: np.ndarray
    beams: Beams
    rx: np.ndarray
    of: np.ndarray

    def __post_init__(self) -> None:
        center = self.triangles.mean(axis=1)
        path, both = np.zeros(len(center)), np.zeros(center.shape)
        corners = self.triangles - center[:, None]
        square = (corners**2).sum(axis=-1)
        for end in (self.beams.apex, self.rx):
            look = end - center
            distance = np.sqrt((look**2).sum(axis=1))
            look = look / distance[:, None]
            both += look
            across = square - np.einsum("nij,nj->ni", corners, look) ** 2
            path += distance + across.sum(axis=1) / (24 * distance)
        slopes = np.einsum("nij,nj->ni", self.triangles[:, 1:] - self.triangles[:, :1], both)
        for name, value in (("center", center), ("path", path), ("slopes", slopes), ("both", both)):
            object.__setattr__(self, name, value)

    center: np.ndarray = None  # type: ignore[assignment]
    path: np.ndarray = None  # type: ignore[assignment]
    slopes: np.ndarray = None  # type: ignore[assignment]
    both: np.ndarray = None  # type: ignore[assignment]

    def __len__(self) -> int:
        return len(self.triangles)

    @cached_property
    def chains(self) -> np.ndarray:
        """Facets that have reflected (n, m)."""
        return self.beams.chains[self.beams.chain]

    @cached_property
    def normals(self) -> np.ndarray:
        """Their unit normals on the sides that reflect (n, m, 3)."""
        return self.beams.normals[self.beams.chain]

    def chosen(self, rows: np.ndarray) -> Facets:
        """The triangles `rows` (n,)."""
        return (
            self
            if len(rows) == len(self)
            else Facets(self.triangles[rows], self.beams[rows], self.rx[rows], self.of[rows])
        )

    @property
    def areas(self) -> np.ndarray:
        """Areas, m^2 (n,)."""
        spokes = self.triangles[:, 1:] - self.triangles[:, :1]
        return np.asarray(np.linalg.norm(cross(spokes[:, 0], spokes[:, 1]), axis=-1) / 2)

    @property
    def widest(self) -> np.ndarray:
        """Largest difference of the path between a corner and the centroid, m (n,)."""
        p, q = self.slopes.T
        return np.asarray(np.maximum.reduce([np.abs(p + q), np.abs(2 * p - q), np.abs(2 * q - p)]) / 3)

    def rays(self) -> list[np.ndarray]:
        """Directions in which the wave travels to each facet of the beams, unit vectors (n, 3)."""
        rays = [unit(self.center - self.beams.apex)]
        for number in range(self.beams.order - 2, -1, -1):
            normal = self.normals[:, number]
            rays.insert(0, rays[0] - 2 * dot(rays[0], normal)[:, None] * normal)
        return rays

    def shapes(self, frequencies: np.ndarray, coatings: Coatings) -> np.ndarray:
        """Amplitude less its matrix: k/(2 sqrt(pi)) A mean times what reflectivities and roughness leave, (n, n_f)."""
        waves = 2 * np.pi * frequencies / SPEED_OF_LIGHT
        mean = triangle_mean(waves * self.slopes[:, :1], waves * self.slopes[:, 1:])
        facets, normals = self.chains, self.normals
        heights = [
            2 * dot(ray, normals[:, i]) * coatings.height[facets[:, i]] for i, ray in enumerate(self.rays()[:-1])
        ]
        heights.append(dot(self.both, normals[:, -1]) * coatings.height[facets[:, -1]])
        square = sum(height**2 for height in heights)
        size = self.areas * coatings.reflectivity[facets].prod(axis=1)
        out = mean * (size[:, None] * (waves / (2 * np.sqrt(np.pi))))
        if np.any(square):
            out *= np.exp(-np.multiply.outer(square, waves**2) / 2)
        return np.asarray(out)

    def matrices(
        self,
        frequency: float,
        coatings: Coatings,
        polarizations: Sequence[str],
        up: np.ndarray,
        is_reciprocal: np.ndarray,
    ) -> np.ndarray:
        """Matrix of the amplitude S J at one frequency, in polarisations: complex128 (n, n_polarizations).

        is_reciprocal  triangles (n,) of which HV and VH are their mean: the sum with the path the other way round
        """
        eps, upward = coatings.permittivity(frequency)[coatings.material[self.chains]], tuple(up.tolist())
        rays, normals = self.rays(), self.normals
        fields = [field.astype(complex) for field in polarisation(rays[0], upward)]
        for i, ray in enumerate(rays[:-1]):
            fields = _reflected(fields, ray, rays[i + 1], normals[:, i], eps[:, i])
        cosine, parts = scattering_parts(normals[:, -1], -rays[-1], unit(self.rx - self.center), upward)
        r_h, r_v = (r[:, None, None] for r in fresnel(np.clip(cosine, 0, 1), eps[:, -1]))
        basis = polarisation(rays[-1], upward)
        arriving = np.stack([np.stack([(b * f).sum(axis=1) for f in fields], axis=-1) for b in basis], axis=-2)
        matrix = (parts[0] + r_h * parts[1] + r_v * parts[2]) @ arriving
        matrix = np.where(is_reciprocal[:, None, None], (matrix + matrix.swapaxes(1, 2)) / 2, matrix)
        return np.stack([matrix[:, "HV".index(name[0]), "HV".index(name[1])] for name in polarizations], axis=-1)


def _reflected(
    fields: list[np.ndarray], ray: np.ndarray, out: np.ndarray, normal: np.ndarray, eps: np.ndarray
) -> list[np.ndarray]:
    """Fields (n, 3) of plane waves along rays (n, 3) after a plane has reflected them along `out` (n, 3).

    With t across the plane of incidence and d = ray x t: E_t -> R_h E_t, E_d -> R_v E_(out x t), as R_v is the
    coefficient of the magnetic field, whose component along t is -E_d.
    """
    across = cross(ray, normal)
    length = np.linalg.norm(across, axis=1, keepdims=True)
    is_normal = length < 1e-8  # any tangent does: R_v = -R_h
    t = np.where(is_normal, polarisation(ray)[0], across / np.where(is_normal, 1, length))
    r_h, r_v = fresnel(np.clip(-dot(ray, normal), 0, 1), eps)
    incident, reflected = cross(ray, t), cross(out, t)
    return [
        (r_h * (f * t).sum(axis=1))[:, None] * t + (r_v * (f * incident).sum(axis=1))[:, None] * reflected
        for f in fields
    ]
