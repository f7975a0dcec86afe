"""Tasks at the ends of what is legal: images and echoes are right there, or refused in words; never a crash."""

from __future__ import annotations

import numpy as np
import pytest
from helpers.cases import noise_on

import sarcl
from sarcl.base.errors import ToleranceUnreachable

OVERHEAD = np.stack([np.zeros(16), np.linspace(-5, 5, 16), np.full(16, 1e3)], axis=1)


@pytest.mark.parametrize("spacing", [1e-20, 1e-26, 1e-50, 5e-324])
@pytest.mark.parametrize("tolerance", [1e-2, 1e-4, 1e-8])
def test_pixels_closer_than_float32_resolves_are_all_alike(spacing, tolerance):
    raw = noise_on(OVERHEAD, n_samples=32)
    image = sarcl.backproject(raw, sarcl.ImageGrid.plane(shape=(20, 20), spacing=spacing), tolerance=tolerance)
    wanted = sarcl.backproject(raw, sarcl.ImageGrid.points([[0.0, 0, 0]]), tolerance=1e-8).data[0]
    assert np.abs(image.data - wanted).max() <= 10 * tolerance * abs(wanted)


@pytest.mark.parametrize("tolerance", [1e-2, 1e-4, 1e-8])
def test_one_pulse_straight_above_one_pixel_is_focused(tolerance):
    raw = noise_on(OVERHEAD[:1] * [1, 0, 1], n_samples=32)
    image = sarcl.backproject(raw, sarcl.ImageGrid.plane(shape=1, spacing=0.1), tolerance=tolerance)
    wanted = sarcl.backproject(raw, sarcl.ImageGrid.points([[0.0, 0, 0]]), tolerance=1e-8).data[0]
    assert np.abs(image.data - wanted).max() <= 10 * tolerance * abs(wanted)


def test_facets_are_cut_within_max_bytes():
    square = np.array([[[0, 0, 0], [0.1, 0, 0], [0, 0.1, 0]], [[0.1, 0, 0], [0.1, 0.1, 0], [0, 0.1, 0]]])
    scene = sarcl.Scene.facets(square, two_sided=True)
    track = sarcl.Trajectory.line(start=(0, -0.5, 0.3), velocity=(0, 1, 0), prf=16.0, n_pulses=16)
    chirp = sarcl.Waveform.chirp(center=9e9, bandwidth=1e9, duration=1e-6)
    with pytest.raises(ToleranceUnreachable, match=r"more than 19,531 .*max_bytes, 10 MB.*or a larger max_bytes"):
        sarcl.plan_echo(scene, chirp, track, max_bytes=1e7)
    sarcl.plan_echo(scene, chirp, track, max_bytes=1e7, tolerance=0.1)
