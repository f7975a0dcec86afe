"""Physical constants."""

from __future__ import annotations

SPEED_OF_LIGHT = 299_792_458.0  # m/s, exact
