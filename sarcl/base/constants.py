"""Physical constants."""

from __future__ import annotations

SPEED_OF_LIGHT = 299_792_458.0  # m/s, exact
WIDEST_SWATH = 1e8  # m: twice as far as from a geostationary orbit to the far side of the Earth
LEAST_STEP = 1.49  # Hz, of frequencies: c/2 over WIDEST_SWATH, less 0.6 % for its rounding and the pulse
# Cosine to an antenna, per unit of |u_t - u_r|, within which a facet is edge-on: its echo fades between this and minus
# this (sarcl/scattering/physical_optics.py:lit_share). Ten thousand times the rounding of a cosine in float32;
# kernels/facet.clh has the same number.
EDGE_ON = 2e-3
