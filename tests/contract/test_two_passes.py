"""Interferometry: two passes see one random surface, whose echoes decorrelate as their directions part."""

from __future__ import annotations

import numpy as np
import pytest

import sarcl

DISTANCE, INCIDENCE, CENTER, BAND = 20e3, np.deg2rad(45), 9.6e9, 150e6
# m: passes whose directions differ so much see the ground's spectrum shifted by the whole band, f dtheta/tan(theta)
CRITICAL = DISTANCE * np.tan(INCIDENCE) * BAND / CENTER
CHIRP = sarcl.Waveform.chirp(center=CENTER, bandwidth=BAND, duration=1e-6)
GROUND = sarcl.ImageGrid.plane(shape=(140, 140), spacing=(0.5, 0.5))


def field():
    axis = np.linspace(-45, 45, 10)
    return sarcl.Scene.from_heights(axis, axis, np.zeros((10, 10)), material=sarcl.Material(diagram="cos"))


def image(baseline, tolerance):
    """Of a field of rough ground, from a line `baseline`, m, across the line of sight from where the first one is."""
    sine, cosine = np.sin(INCIDENCE), np.cos(INCIDENCE)
    x, z = DISTANCE * sine - baseline * cosine, DISTANCE * cosine + baseline * sine
    line = sarcl.Trajectory.line(start=(x, -120, z), velocity=(0, 160, 0), prf=50.0, n_pulses=76)
    raw = sarcl.echo(field(), CHIRP, line, tolerance=tolerance, seed=4)
    return sarcl.backproject(raw, GROUND, tolerance=tolerance, window=None).data


@pytest.mark.parametrize("part", [0.25, 0.5])
def test_coherence_falls_to_none_at_the_critical_baseline(part):
    """1 - B/B_crit, to 0.02; the second pass is computed at another tolerance, which does not change the surface."""
    one, two = image(0, 1e-2), image(part * CRITICAL, 1e-1)
    coherence = np.vdot(two, one) / (np.linalg.norm(one) * np.linalg.norm(two))
    assert abs(coherence) == pytest.approx(1 - part, abs=0.02)
    assert abs(np.angle(coherence)) < 0.05  # rad: flat ground, focused where it is
