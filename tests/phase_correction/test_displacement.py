"""Displacements of bright places by a phase; corrections that move them against one another."""

from __future__ import annotations

from dataclasses import replace

import autofocus_trial as trials
import numpy as np
import pytest

import sarcl
from sarcl.base.constants import SPEED_OF_LIGHT
from sarcl.phase_correction import _displacement
from sarcl.phase_correction.autofocus import _aperture_view

N, CARRIER, BANDWIDTH, SAMPLES, RADIUS = 192, 24e9, 1.5e9, 64, 0.3  # pulses, Hz, Hz, samples, m
BEAM = np.radians(60)
TURN = np.linspace(-np.pi / 2, np.pi / 2, N)
HEADING = np.stack([np.cos(TURN), np.sin(TURN), np.zeros(N)], axis=1)
ANGLES = np.radians([-50.0, -20.0, 5.0, 35.0, 60.0])
POINTS = np.array([2.2, 3.1, 2.5, 2.9, 2.0])[:, None] * np.stack([np.cos(ANGLES), np.sin(ANGLES), 0 * ANGLES], axis=1)
GRID = sarcl.ImageGrid.plane(center=(2.0, 0, 0), shape=(281, 181), spacing=0.02)
FREQUENCY = CARRIER + (np.arange(SAMPLES) - (SAMPLES - 1) / 2) * BANDWIDTH / SAMPLES


def echo_of(point: np.ndarray, tx: np.ndarray) -> np.ndarray:
    """The echo equation of a point that is seen in the beam alone; the reference is 2 m (n, samples)."""
    away = np.linalg.norm(point - tx, axis=1)
    seen = ((point - tx) * HEADING).sum(axis=1) >= np.cos(BEAM / 2) * away
    return seen[:, None] * np.exp(-4j * np.pi / SPEED_OF_LIGHT * FREQUENCY * (away - 2.0)[:, None])


def history(samples: np.ndarray, tx: np.ndarray) -> sarcl.PhaseHistory:
    return sarcl.PhaseHistory(
        samples.astype(np.complex64), frequency=FREQUENCY[0], frequency_step=BANDWIDTH / SAMPLES, tx=tx,
        reference_range=2.0,
    )  # fmt: skip


def peak_of(point: np.ndarray, phase: np.ndarray) -> np.ndarray:
    """Highest place, m (3,), of the image of the point alone, near it and without the phase: by the formula."""
    samples = echo_of(point, RADIUS * HEADING) * np.exp(-1j * phase)[:, None]
    offsets = np.stack(np.meshgrid(np.linspace(-0.1, 0.1, 21), np.linspace(-0.3, 0.3, 61), indexing="ij"), axis=-1)
    ahead = point / np.linalg.norm(point)
    spots = point + offsets.reshape(-1, 2) @ np.stack([ahead, np.cross([0, 0, 1], ahead)])
    away = np.linalg.norm(spots - RADIUS * HEADING[:, None], axis=2) - 2.0
    seen = ((point - RADIUS * HEADING) * HEADING).sum(axis=1) >= np.cos(BEAM / 2) * np.linalg.norm(
        point - RADIUS * HEADING, axis=1
    )
    image = np.zeros(len(spots), complex)
    for k, frequency in enumerate(FREQUENCY):
        image += ((samples[:, k] * seen)[:, None] * np.exp(4j * np.pi / SPEED_OF_LIGHT * frequency * away)).sum(axis=0)
    return np.asarray(spots[np.abs(image).argmax()])


@pytest.mark.parametrize("given", [True, False], ids=["beam given", "beam not given"])
def test_displacements_are_those_of_the_peaks_in_images_of_each_point_alone(given):
    tx = RADIUS * HEADING
    raw = history(sum(echo_of(point, tx) for point in POINTS), tx)
    view = _aperture_view(raw, np.arange(N)[:, None], GRID)
    view = replace(view, beam=(BEAM, HEADING) if given else None, scale=float(np.abs(raw.samples).max()))
    phase = 9 * (TURN / (np.pi / 2)) ** 2 + 2 * TURN
    errors = phase, np.zeros(N)
    found = _displacement.displacements(view, errors, view.power(errors))
    assert len(found.places) == len(POINTS)
    for point, angle in zip(POINTS, ANGLES, strict=True):
        peak = peak_of(point, phase)
        k = int(np.linalg.norm(found.places - peak, axis=1).argmin())
        assert np.linalg.norm(found.places[k] - peak) <= 0.03  # a pixel and a half
        along = np.array([-np.sin(angle), np.cos(angle), 0])  # where the arm moves, before the point
        assert found.along[k] == pytest.approx((peak - point) @ along, abs=0.2 * found.cells[k])
        assert found.peaks[k] == pytest.approx((peak - point) @ along, abs=0.2 * found.cells[k])
        # the beam, 60 degrees, turns the direction to the point by its chord over the distance
        chord = 2 * RADIUS * np.sin(BEAM / 2)
        cell = SPEED_OF_LIGHT / CARRIER / 2 / (chord / np.linalg.norm(point))
        assert found.cells[k] == pytest.approx(cell, rel=0.25)
    assert found.apart > 1.0


def test_a_slope_is_the_least_squares_fit_and_steps_of_two_pi_do_not_count():
    random = np.random.default_rng(0)
    n = 200
    along = 30 * np.sin(np.linspace(-0.8, 0.9, n))
    seen = (np.arange(n) >= 40) & (np.arange(n) < 130)
    smooth = 0.7 * along + 4 * np.cos(np.linspace(0, 3, n))
    wanted = np.polyfit(along[seen], smooth[seen], 1)[0]
    assert _displacement._slope(smooth, along, seen.astype(float)) == pytest.approx(wanted, abs=1e-3)
    slips = smooth + 0.5 * random.standard_normal(n) + 2 * np.pi * np.cumsum(random.integers(0, 10, n) == 0)
    assert _displacement._slope(slips, along, seen.astype(float)) == pytest.approx(wanted, abs=0.05)
    assert np.polyfit(along[seen], slips[seen], 1)[0] > wanted + 0.5


def test_the_peak_of_a_place_goes_where_most_pulses_move_it():
    along = 20 * np.sin(np.linspace(-0.7, 0.7, 200))
    # three quarters of the pulses are displaced by 1.5 m, six cells, the others not at all: the fit lies between
    phase = 1.5 * np.minimum(along, along[150])
    assert _displacement._slope(phase, along, np.ones(200)) < 1.35
    assert _displacement._peak(phase, along, np.ones(200)) == pytest.approx(1.5, abs=0.05)


def test_the_weakest_link_is_the_least_common_share_of_the_strongest_chain():
    seen = np.zeros((100, 4))
    for k, first in enumerate((0, 60, 20, 45)):  # windows of 40 pulses: 0 and 20 share half, 20 and 45 share 15
        seen[first : first + 40, k] = 1
    assert _displacement._weakest_link(seen) == pytest.approx(15 / 40)
    assert _displacement._weakest_link(seen[:, :2]) == 0.0
    assert _displacement._weakest_link(seen[:, :1]) == 1.0


# 20: three points in clutter, halves of the band agree to 0.83; 30, 71: three and five points that agree to more than
# 0.97, and have few pulses in common: 1.9, 7.7 and 3.1 cells against one another, in images of each point alone
@pytest.mark.parametrize("seed", [20, *(pytest.param(seed, marks=pytest.mark.slow) for seed in (1, 17, 30, 71))])
def test_a_correction_that_moves_points_of_an_arm_against_one_another_is_refused(seed):
    made = trials.scene("arm", seed)
    better, errors = sarcl.autofocus(made.raw, made.grid, beam=made.beam if made.given else None)
    assert better is made.raw and not errors.found and not errors.phase.any()
    assert "against one another" in errors.reason and "antenna positions" in errors.reason
    assert errors.displacements.shape == errors.places.shape[:1]
    assert np.ptp(errors.displacements) > 0.02  # m; cells are 0.03 to 0.1 m


@pytest.mark.parametrize(
    "seed, share",
    [(26, 0.93), *(pytest.param(*task, marks=pytest.mark.slow) for task in ((3, 0.97), (3, 0.93), (8, 0.93)))],
)
def test_a_wrong_radius_of_an_arm_is_not_taken_for_a_phase(seed, share):
    made = trials.scene("correct", seed)
    assert made.words.startswith("arm")
    wrong = replace(made.raw, tx=share * made.raw.tx)
    better, errors = sarcl.autofocus(wrong, made.grid, beam=made.beam)
    # the phase sharpens what it was not found from, and stretches the scene
    assert errors.gain > 1.1 and np.ptp(errors.displacements) > 0.05
    assert better is wrong and not errors.found
    assert "against one another" in errors.reason and "radius" in errors.reason


def test_what_a_correction_moves_is_said():
    row = trials.trial("error", 0)  # a rail, 20 points, 18.7 rad: what one point is moved, the next is too
    assert row["restored"] and row["apart"] <= 0.5
    made = trials.scene("error", 0)
    _, errors = sarcl.autofocus(made.raw, made.grid)
    assert errors.agreement >= 0.95
    assert "bright places move by up to" in str(errors)
    assert 1 < len(errors.displacements) <= 10 and errors.places.shape == (len(errors.displacements), 3)
