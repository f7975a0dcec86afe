"""The ground of the figures, and the radar for flat ground."""

from __future__ import annotations

import numpy as np

from ...scene.material import Material
from ..far_radar import FarRadar

# Figures 5, 9, 10 and 13 to 16
ROUGH, SMOOTH = (Material(eps_r=4.0, conductivity=1e-3, diagram=diagram) for diagram in ("cos2", "smooth"))
FLAT = FarRadar(look=np.radians(35), bandwidth=300e6, turn=0.05, n_pulses=52)
