"""The phase between two passes over one rough surface, in the mean over surfaces: bias beside its own uncertainty."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.interpolate import RegularGridInterpolator

import sarcl

CHIRP = sarcl.Waveform.chirp(center=9.6e9, bandwidth=150e6, duration=1e-6)
DISTANCE, INCIDENCE, SEEDS = 20e3, np.radians(45), 12
CRITICAL = DISTANCE * np.tan(INCIDENCE) * CHIRP.bandwidth / CHIRP.center  # m, baseline without coherence on flat ground
GATE = 0.006  # rad


def line(across):
    x = DISTANCE * np.sin(INCIDENCE) - across * np.cos(INCIDENCE)
    z = DISTANCE * np.cos(INCIDENCE) + across * np.sin(INCIDENCE)
    return sarcl.Trajectory.line(start=(x, -120, z), velocity=(0, 160, 0), prf=50.0, n_pulses=76)


def coherences(top, share):
    """Complex coherence on a hill of height `top`, m, for each seed; baseline  share of the critical one."""
    axis = np.linspace(-36, 36, 25)
    hill = top * np.exp(-(axis[:, None] ** 2 + axis**2) / 400)
    ground = sarcl.Scene.from_heights(axis, axis, hill, material=sarcl.Material(eps_r=4, diagram="cos"))
    x, y = np.meshgrid(np.linspace(-27, 27, 109), np.linspace(-27, 27, 109))
    height = RegularGridInterpolator((axis, axis), hill)((y, x))
    surface = sarcl.ImageGrid.points(np.stack([x, y, height], axis=-1))
    tracks = [line(0), line(share * CRITICAL)]
    for seed in range(4, 4 + SEEDS):
        raws = sarcl.echo(ground, CHIRP, tracks, tolerance=1e-2, seed=seed)
        first, second = (sarcl.backproject(raw, surface, tolerance=1e-2).data for raw in raws)
        yield np.vdot(second, first) / (np.linalg.norm(first) * np.linalg.norm(second))


@pytest.mark.slow
@pytest.mark.parametrize("top, share", [(3, 0.25), (3, 0.1), (0, 0.25)])
def test_the_phase_of_a_surface_focused_where_it_is_has_no_bias_above_the_gate(top, share):
    found = np.array(list(coherences(top, share)))
    bias, uncertainty = np.angle(found).mean(), np.angle(found).std(ddof=1) / np.sqrt(SEEDS)
    print(f"hill {top} m, {share} of the critical baseline: {bias:.4f} +- {uncertainty:.4f} rad")
    assert abs(np.abs(found).mean() - (1 - share)) < 0.03
    assert abs(bias) + 2 * uncertainty < GATE
    if top == 0:
        assert abs(bias) < 3 * uncertainty
