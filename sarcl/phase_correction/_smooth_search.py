"""Search for phases of few cosines: in crowded scenes free phases of single pulses make fewer points than there are."""

from __future__ import annotations

import numpy as np

from . import _phase_gradient, _phase_smoothing

MODES = 4, 8, 16, 32  # cosines over the aperture
STEPS = 15  # steps of the ascent, for each number of cosines


def curves(v: np.ndarray, free: np.ndarray, width: float) -> list[np.ndarray]:
    """Phases (n,) of MODES cosines and a slope that sharpen contributions v (n, k).

    free   phase (n,) of the same contributions, each pulse by itself, which is a start besides the curve of fewer
           cosines: a large error is far from no phase at all. The sharper of the two is taken
    width  Doppler bins about 0, as of `_phase_gradient.sharpen`, whose steps are projected onto the cosines. MODES of
           half the pulses or more are left out.
    """
    phase, phases = np.zeros(len(v)), []
    for modes in (m for m in MODES if 2 * m < len(v)):
        ends = [_ascended(v, start, modes, width) for start in (phase, _phase_smoothing.smooth(free, modes))]
        phase = max(ends, key=lambda end: _phase_gradient.sharpness(v, end, width))
        phases.append(phase)
    return phases


def _ascended(v: np.ndarray, phase: np.ndarray, modes: int, width: float) -> np.ndarray:
    """The phase (n,) of so many cosines near `phase` that sharpens contributions v (n, k)."""
    for _ in range(STEPS):
        step = _phase_gradient.sharpen(v, phase, width, steps=1) - phase
        phase = _phase_smoothing.lowest(phase + np.angle(np.exp(1j * step)), modes)
    return phase
