"""Search for phases of few cosines: in crowded scenes free phases of single pulses make fewer points than there are."""

from __future__ import annotations

import numpy as np

from . import _phase_gradient, _phase_smoothing

MODES = 4, 8, 16, 32  # cosines over the aperture
STEPS = 15  # of the ascent, for each number of cosines


def curves(v: np.ndarray, width: float) -> list[np.ndarray]:
    """Phases (n,) of MODES cosines and a slope, each from the one before it, that sharpen contributions v (n, k).

    width  Doppler bins about 0, as of `_phase_gradient.sharpen`, whose steps are projected onto the cosines. MODES of
    half the pulses or more are left out.
    """
    phase, found = np.zeros(len(v)), []
    for modes in (m for m in MODES if 2 * m < len(v)):
        for _ in range(STEPS):
            step = _phase_gradient.sharpen(v, phase, width, steps=1) - phase
            phase = _phase_smoothing.lowest(phase + np.angle(np.exp(1j * step)), modes)
        found.append(phase)
    return found
