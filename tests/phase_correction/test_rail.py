"""Autofocus of beat samples of a ground radar on a rail, whose scene reaches from close by to ten times as far."""

from __future__ import annotations

import numpy as np
import pytest

import sarcl
from sarcl.base.constants import SPEED_OF_LIGHT
from sarcl.model.phase_history import PhaseHistory

LOW, HIGH, SAMPLES, PULSES, LENGTH = 3.4e9, 4.6e9, 360, 600, 2.0  # Hz, Hz, per sweep, positions, m
RATE = 1e6  # samples per s
SWEEP_RATE = (HIGH - LOW) / SAMPLES * RATE  # Hz/s
NEAREST, FARTHEST = 3.0, 20.0  # m
GRID = sarcl.ImageGrid.plane(center=(11.5, 0, 0), shape=(110, 142), spacing=(0.18, 0.12))


def smooth_phase(seed: int) -> np.ndarray:
    """Three falling cosines without slope, whose largest value is 10 rad."""
    random = np.random.default_rng(seed)
    t = (np.arange(PULSES) + 0.5) / PULSES
    curve = sum(random.standard_normal() / k * np.cos(np.pi * k * t) for k in (1, 2, 3))
    curve = curve - np.polyval(np.polyfit(t, curve, 1), t)
    return np.asarray(10 * curve / np.abs(curve).max())


def beats(seed: int, phase: np.ndarray) -> PhaseHistory:
    """Complex beats of twelve points and sixty faint ones, by the formula of the mixer, with a phase per sweep."""
    random = np.random.default_rng(seed)
    tx = np.stack([np.zeros(PULSES), np.linspace(-LENGTH / 2, LENGTH / 2, PULSES), np.full(PULSES, 1.0)], axis=1)
    away, angle = random.uniform(NEAREST, FARTHEST, 72), random.uniform(-0.6, 0.6, 72)
    points = np.stack([away * np.cos(angle), away * np.sin(angle), np.zeros(72)], axis=1)
    level = np.concatenate([10 ** (-random.uniform(0, 10, 12) / 20), np.full(60, 0.05)])
    level = level * np.exp(2j * np.pi * random.random(72))
    delay = 2 * np.linalg.norm(points - tx[:, None], axis=2) / SPEED_OF_LIGHT
    term = level * np.exp(-2j * np.pi * (LOW * delay - SWEEP_RATE * delay**2 / 2))
    ramp = np.exp(-2j * np.pi * SWEEP_RATE / RATE * delay)
    samples = np.empty((PULSES, SAMPLES), np.complex128)
    for k in range(SAMPLES):
        samples[:, k] = term.sum(axis=1)
        term *= ramp
    samples += 0.05 * (random.standard_normal(samples.shape) + 1j * random.standard_normal(samples.shape))
    return PhaseHistory.from_time(
        samples * np.exp(1j * phase)[:, None], rate=RATE, carrier=LOW, tx=tx, kind="dechirped", sweep_rate=SWEEP_RATE,
        beat="negative", scene_range=(NEAREST + FARTHEST) / 2,
    )  # fmt: skip


def highest(raw: PhaseHistory) -> float:
    return float(np.abs(sarcl.backproject(raw, GRID).data).max())


@pytest.mark.parametrize(
    "seed, range_errors", [(4, False), *(pytest.param(seed, True, marks=pytest.mark.slow) for seed in (0, 1, 5))]
)
def test_a_smooth_error_is_removed_where_far_points_are_blurred_over_more_metres(seed, range_errors):
    phase = smooth_phase(seed + 10)
    plain, blurred = beats(seed, 0 * phase), beats(seed, phase)
    assert highest(blurred) < 0.5 * highest(plain)
    better, errors = sarcl.autofocus(blurred, GRID, range_errors=range_errors)
    assert errors.found, errors.reason
    assert 20 * np.log10(highest(better) / highest(plain)) == pytest.approx(0, abs=0.1)
