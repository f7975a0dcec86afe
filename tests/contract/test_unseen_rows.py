"""Rows and pixels outside the planner's samples: its prediction must hold for them, or its failure be detected."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from helpers.cases import image_error, noise_on, straight, thinned

import sarcl
from sarcl.base.rows import spread_over
from sarcl.imaging.direct import line_plan


def holds(raw, grid, tolerance, **options):
    """Focus, and hold the contract at 200 random pixels; the image."""
    image = sarcl.backproject(raw, grid, tolerance=tolerance, check=False, **options)
    assert image_error(image, raw, most=200) <= image.report.predicted_error <= tolerance * (1 + 1e-12)
    return image


@pytest.mark.parametrize("n_samples, tolerance", thinned([1, 2, 4, 7, 10], [1e-1, 1e-3]))
def test_sub_apertures_of_rows_shorter_than_what_their_tiles_reach(n_samples, tolerance):
    raw = noise_on(straight(1024, aperture=30.0), n_samples=n_samples, bandwidth=20e6)
    grid = sarcl.ImageGrid.plane(shape=(160, 160), spacing=0.05)
    assert holds(raw, grid, tolerance, method="factorized").report.plan["method"] == "factorized"


@pytest.mark.slow
def test_a_few_rows_off_a_smooth_track():
    # half a metre in 5 rows of 1024: decimation would have an error of a radian there
    tx = straight(1024, aperture=300.0)
    tx[[77, 300, 503, 504, 900]] += [0, 0.5, 0.5]
    raw, grid = noise_on(tx, n_samples=128, bandwidth=300e6), sarcl.ImageGrid.plane(shape=(128, 128), spacing=0.5)
    for tolerance in (1e-2, 1e-3):
        holds(raw, grid, tolerance)
    with pytest.raises(ValueError, match="sub-apertures"):
        sarcl.backproject(raw, grid, tolerance=1e-2, method="factorized")


def test_an_antenna_low_over_a_wide_grid_sees_longer_steps_beside_it_than_at_the_corners():
    n, n_samples, bandwidth = 8, 2048, 52e6
    tx = np.stack([np.linspace(-0.5, 0.5, n), np.zeros(n), np.full(n, 500.0)], axis=1)
    samples = np.zeros((n, n_samples), np.complex64)
    samples[:, [0, -1]] = 1  # all energy at the band's edges
    raw = sarcl.PhaseHistory(
        samples, frequency=3e8, frequency_step=bandwidth / n_samples, tx=tx, reference_range=1500.0
    )
    holds(raw, sarcl.ImageGrid.plane(shape=(1500, 1500), spacing=2.0), 3e-2, method="direct")


@pytest.mark.parametrize("tolerance", [1e-3, 1e-4])
def test_pulses_that_see_the_grid_more_grazing_than_the_sampled_ones(tolerance):
    # rows that a plan samples look down steeply, the others at grazing angles
    n = 1600
    sampled = np.zeros(n, bool)
    for group in line_plan.GROUP_SIZES:
        starts = np.arange(0, n - group + 1, group)
        for start in starts[spread_over(len(starts), 24)]:
            sampled[start : start + group + 1] = True
    assert sampled.sum() < n / 2
    angle = np.where(sampled, 0.3, 1.4)
    tx = np.stack([-3e4 * np.sin(angle), np.linspace(-20, 20, n), 3e4 * np.cos(angle)], axis=1)
    raw = noise_on(tx, n_samples=256, bandwidth=300e6)
    holds(raw, sarcl.ImageGrid.plane(shape=(128, 128), spacing=1.0), tolerance, method="direct")


@pytest.mark.parametrize("tolerance", [1e-3, 1e-5])
def test_a_glint_off_the_grid_in_one_row(tolerance):
    raw = noise_on(straight(300, aperture=20.0), n_samples=512, bandwidth=300e6)
    samples = np.array(raw.samples)
    beat = np.exp(-2j * np.pi * 0.25 * np.arange(512)) * np.hanning(512)  # a quarter of the window away
    samples[151] += (3e5 * beat).astype(np.complex64)
    holds(replace(raw, samples=samples), sarcl.ImageGrid.plane(shape=(64, 64), spacing=0.3), tolerance)


@pytest.mark.parametrize("scale", [1e-41, 1e-60])
def test_samples_too_small_for_complex64_are_refused_or_kept_in_complex128(scale):
    raw, grid = noise_on(straight(16), n_samples=32), sarcl.ImageGrid.plane(shape=(16, 16), spacing=0.3)
    tiny = replace(raw, samples=raw.samples.astype(np.complex128) * scale)
    with pytest.raises(ValueError, match="scale the samples up"):
        sarcl.backproject(tiny, grid)
    holds(tiny, grid, 1e-7)
