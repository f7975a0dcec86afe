"""Physical constants."""

from __future__ import annotations

SPEED_OF_LIGHT = 299_792_458.0  # m/s, exact
# Cosine to an antenna, per unit of |u_t - u_r|, within which a facet is edge-on: its echo fades between this and minus
# this (sarcl/scattering/physical_optics.py:lit_share). Ten thousand times the rounding of a cosine in float32;
# kernels/facet.clh has the same number.
EDGE_ON = 2e-3
