"""Echo of facets with roughness finer than their size, in float64: re-irradiation diagrams of SARAS that keep power.

A smooth plate's bistatic pattern obeys  integral over the hemisphere of |I|^2 cos dOmega = lambda^2 A. A rough one
spreads the same power over its diagram D(delta), with a Rayleigh amplitude and a uniform phase:

    mean |I|^2 = lambda^2 A D(delta)/Omega,    Omega = integral over the hemisphere of D(delta) cos(delta) dOmega

which does not depend on how finely a surface is cut: sigma0 = pi |S|^2 D/Omega, Lambert's 4 |R|^2 cos^2 for an
isotropic diagram. (SARAS gives the shapes in eq. (11), not their scale.) With roughness of rms height h the coherent
part keeps exp(-(q.n h)^2) of its power; the rest is spread over the diagram.

source   Franceschetti et al. 1992 (SARAS), eq. (11); docs/theory/facets.md
"""

from __future__ import annotations

import numpy as np

from ..scene.material import Material


def rough_mean(
    mean: np.ndarray, material: Material, q: np.ndarray, normal: np.ndarray, area: np.ndarray,
    wavelength: float | np.ndarray, random: np.ndarray,
) -> np.ndarray:  # fmt: skip
    """Mean of exp(j q.rho) over rough facets, complex128 (..., k), from that of smooth ones.

    q  rad/m (..., k, 3), of wavelength, m (or (..., 1));  normal  unit (k, 3);  area  m^2 (k,)
    random  complex Gaussian of unit power (k,)
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
