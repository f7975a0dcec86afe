"""Equivalent straight tracks: the speed of a line, an orbit as a line, and the sign of the Doppler centroid."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import sarcl
from sarcl.base.constants import SPEED_OF_LIGHT

CHIRP = sarcl.Waveform.chirp(center=5.4e9, bandwidth=30e6, duration=1e-6)
LINE = sarcl.Trajectory.line(start=(0, -60, 0), velocity=(0, 120, 0), prf=400.0, n_pulses=401)


def test_a_line_has_its_own_speed_time_and_range():
    v = sarcl.effective_velocity(LINE, (8e3, 12, 0))
    assert v.speed == pytest.approx(120, rel=1e-9) and v.time == pytest.approx(72 / 120, abs=1e-9)
    assert v.range == pytest.approx(8e3, rel=1e-12) and v.residual <= 1e-8


def test_an_orbit_is_seen_as_a_line_of_less_than_its_speed():
    """Height 700 km over a sphere at rest: v^2 = (w R)^2 (R_e/R) cos(Earth angle), w R the speed of the satellite."""
    big, small, rate = 7.078e6, 6.378e6, np.sqrt(3.986004418e14 / 7.078e6**3)
    t = np.linspace(-0.3, 0.3, 301)
    track = sarcl.Trajectory(t, big * np.stack([np.sin(rate * t), 0 * t, np.cos(rate * t)], axis=1))
    angle = 0.05
    v = sarcl.effective_velocity(track, small * np.array([0, np.sin(angle), np.cos(angle)]))
    # R^2 = big^2 + small^2 - 2 big small cos(angle) cos(rate t)
    assert v.speed == pytest.approx(rate * np.sqrt(big * small * np.cos(angle)), rel=1e-6)
    assert abs(v.time) <= 1e-6 and v.residual <= 1e-4 and v.speed < rate * big


@pytest.mark.parametrize("squint", [-0.02, 0.0, 0.013])
@pytest.mark.parametrize("moving", [False, True])
def test_the_doppler_centroid_is_positive_for_a_beam_that_looks_forward(squint, moving):
    v, wavelength = 120.0, SPEED_OF_LIGHT / CHIRP.center
    track = sarcl.Trajectory.line(start=(0, -4, 0), velocity=(0, v, 0), prf=400.0, n_pulses=27)
    point = np.array([8e3 * np.cos(squint), 8e3 * np.sin(squint), 0])
    raw = sarcl.echo(sarcl.Scene.points([point]), CHIRP, track)
    if not moving:  # a constant reference range
        r = 8e3
        f = raw.frequency[:, None] + raw.frequency_step[:, None] * np.arange(raw.n_samples)
        turn = np.exp(4j * np.pi / SPEED_OF_LIGHT * f * (r - raw.reference_range)[:, None])
        raw = replace(raw, samples=raw.samples * turn, reference_range=r)
    wanted = 2 * v / wavelength * np.sin(squint)
    found = sarcl.doppler_centroid(raw, near=wanted + 150)
    assert found == pytest.approx(wanted, abs=0.5)
    assert sarcl.doppler_centroid(raw, near=wanted - 400) == pytest.approx(wanted - 400, abs=0.5)


def test_what_has_no_velocity_or_centroid_is_refused():
    with pytest.raises(ValueError, match="has 2 pulses; the ranges of at least 3"):
        sarcl.effective_velocity(LINE.picked(slice(0, 2)), (8e3, 0, 0))
    ring = sarcl.Trajectory.circle(radius=100, height=0, arc=0.5, n_pulses=20, prf=10.0)
    with pytest.raises(ValueError, match="does not grow on both sides of a closest approach"):
        sarcl.effective_velocity(ring, (-20, -5, 0))
    raw = sarcl.PhaseHistory(np.zeros((4, 8), complex), 1e9, 1e6, np.zeros((4, 3)), 10.0)
    with pytest.raises(ValueError, match="at least 2 rows and their times"):
        sarcl.doppler_centroid(raw)
    with pytest.raises(ValueError, match="does not increase in even steps"):
        sarcl.doppler_centroid(replace(raw, time=[0, 0, 1, 1]))
    with pytest.raises(ValueError, match="echoes are zero"):
        sarcl.doppler_centroid(replace(raw, time=np.arange(4)))
