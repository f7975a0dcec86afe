"""Measured data: AFRL Gotcha, pass 1, azimuth 1-2 deg, HH."""

from __future__ import annotations

import numpy as np
import pytest

import sarcl
from sarcl.reference.backproject import backproject

# The two bright point reflectors, m on z = 0 (read off the image; TRUTH there is the picture itself).
REFLECTORS = [(-15.6, 21.6), (-27.8, 38.8)]


@pytest.fixture(scope="module")
def raw(data_folder):
    folder = data_folder / "gotcha"
    if not folder.is_dir():
        pytest.skip("no Gotcha data in the data folder")
    return sarcl.read(sorted(folder.glob("*.mat")))


PATCH = sarcl.ImageGrid.plane(center=(*REFLECTORS[0], 0), shape=(64, 64), spacing=0.2)


@pytest.fixture(scope="module")
def exact(raw):
    """The image equation term by term, 4e8 of them: once for all devices."""
    return backproject(raw, PATCH.positions.reshape(-1, 3))[0].reshape(PATCH.shape)


def test_a_patch_equals_the_exact_sum_over_the_same_pulses(device, raw, exact):
    image = sarcl.backproject(raw, PATCH, tolerance=1e-3, device=device)
    error = np.linalg.norm(image.data - exact) / np.linalg.norm(exact)
    assert error <= image.report.predicted_error <= 1e-3


def test_the_two_brightest_points_are_the_reflectors(raw):
    grid = sarcl.ImageGrid.plane(shape=(500, 500), spacing=0.2)
    image = sarcl.backproject(raw, grid, tolerance=1e-3)
    level = np.array(image.decibels())
    for wanted in REFLECTORS:
        row, column = np.unravel_index(level.argmax(), level.shape)
        assert grid.at(row, column)[:2] == pytest.approx(wanted, abs=0.3)
        level[max(0, row - 25) : row + 26, max(0, column - 25) : column + 26] = -np.inf
    # nothing else comes within 4 dB of the weaker
    second = image.decibels()[tuple(np.rint(grid.index((*REFLECTORS[1], 0))).astype(int))]
    assert level.max() < second - 4


def test_a_reflector_is_as_sharp_as_band_and_arc_allow(raw):
    patch = sarcl.ImageGrid.plane(center=(*REFLECTORS[0], 0), shape=(256, 256), spacing=0.1)
    response = sarcl.measure(sarcl.backproject(raw, patch), near=(*REFLECTORS[0], 0))
    tx = raw.tx
    ground = np.cos(np.arcsin(tx[:, 2] / np.linalg.norm(tx, axis=1))).mean()
    azimuth = np.ptp(np.unwrap(np.arctan2(tx[:, 1], tx[:, 0])))
    theory = 0.886 * 299792458 / 2 / raw.bandwidth[0] / ground, 0.886 * 0.0312 / 2 / azimuth / ground
    assert response.irw == pytest.approx(theory, rel=0.15)
