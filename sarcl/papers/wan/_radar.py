"""The radar for flat ground. The paper gives neither wavelength nor resolution: heights of 0.08 to 0.23 m need a long
wave. L band has facets of three wavelengths, and resolution cells of a hundred facets."""

from __future__ import annotations

import numpy as np

from ..far_radar import FarRadar


def l_band(n_pulses: int) -> FarRadar:
    """L band, 30 deg off the vertical."""
    return FarRadar(look=np.radians(30), bandwidth=50e6, turn=0.05, n_pulses=n_pulses, center=1.27e9)
