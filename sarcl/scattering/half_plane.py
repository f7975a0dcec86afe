"""Waves beside the edge of a half-plane that reflects them: Fresnel's integral in place of a sharp border.

    F(v) = 1/2 + (1 + j)/2 [C(v) - j S(v)],    v = +-2 (D/wavelength)^(1/2)

D is the detour of the shortest path over the edge, C and S are Fresnel's integrals; v > 0 in the light.

source  Sommerfeld's exact field of a half-plane, of which F(v) is the part that goes with the reflected wave, for both
        polarisations; docs/theory/edges.md
"""

from __future__ import annotations

import numpy as np

FADING = (3.0, 5.0)  # |v| from which on F goes over into a step, and at which it is one


def transition(v: np.ndarray) -> np.ndarray:
    """F(v), complex128, of the shape of v; a step far from the border, 0 in the shadow."""
    from scipy.special import fresnel

    near = np.clip(v, -FADING[1], FADING[1])
    sine, cosine = fresnel(near)
    field, step = 0.5 + (0.5 + 0.5j) * (cosine - 1j * sine), (v > 0) * 1.0
    fade = np.clip((np.abs(near) - FADING[0]) / (FADING[1] - FADING[0]), 0, 1)
    return np.asarray(step + (field - step) * np.cos(np.pi / 2 * fade) ** 2)
