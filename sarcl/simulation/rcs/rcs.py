"""Radar cross sections of points and facets in directions."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from ...base.forecast import Plan
from ...base.verb import verb
from ...scene.scene import Scene
from ._rcs_options import RcsOptions
from ._rcs_plan import RcsPlan
from ._rcs_task import rcs_task


@verb(RcsOptions)
def rcs(
    scene: Scene, azimuth: ArrayLike, elevation: ArrayLike, frequency: ArrayLike, options: RcsOptions
) -> Plan[np.ndarray]:
    """Scattering amplitudes s of a scene for plane waves: |s|^2 is the radar cross section, m^2.

    s(f) = sum_k a_k(f) exp(+j k (u_t + u_r).x_k),   k = 2 pi f/c

    the echo of `echo` from far away, with the origin as reference: points, and facets by physical optics with the
    materials' Fresnel coefficients, once reflected unless `bounces` asks for more (docs/theory/facets.md). u_t, u_r
    point from the scene to transmitter and receiver.

    azimuth       rad, from x to y;  elevation  rad, from the xy plane to z; they broadcast
    frequency     Hz, one or (n,)
    {options}

    Returns complex128 of the directions' shape, with frequency as the last axis where several are given, and one more
    for a tuple of polarisations. The tolerance is that of the norm over all values of one call. ValueError for angles
    in degrees, for surfaces with a random echo, and for what else does not fit; ToleranceUnreachable, a ValueError, for
    a tolerance below the rounding of these sums.
    Source: the echo equation of sarcl/__init__.py, for antennas at infinity.

    >>> plate, wavelength = sarcl.shapes.plate((1, 1)), 299792458 / 9.6e9
    >>> amplitude = sarcl.rcs(plate, azimuth=0.0, elevation=np.pi / 2, frequency=9.6e9)
    >>> round(float(abs(amplitude) ** 2 / (4 * np.pi / wavelength**2)), 4)  # over that in closed form
    1.0
    """
    return RcsPlan(rcs_task(scene, azimuth, elevation, frequency, options))
