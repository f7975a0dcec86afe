"""Autofocus on the scenes of bench/autofocus_trial.py: correct data are not harmed, errors are removed."""

from __future__ import annotations

from dataclasses import replace

import autofocus_trial as trials
import numpy as np
import pytest

import sarcl
from sarcl.base.constants import SPEED_OF_LIGHT

RAIL = 10
LEAK = 6  # a rail, five points and a leak of 5 dB: the halves of the band agree on a phase that focuses the leak


def test_the_peak_of_a_point_falls_as_its_image_does():
    made = trials.scene("error", RAIL)
    zero = np.zeros(made.raw.n_rows)
    wanted, blurred = (trials.peaks(made, phase, zero)[0] for phase in (zero, made.error))
    alone = made.points[0]
    grid = sarcl.ImageGrid.plane(center=alone, shape=(160, 40), spacing=(0.004, 0.02))
    turned = np.asarray(made.raw.samples) * np.exp(-1j * made.error)[:, None]
    right = made.raw.__class__(
        turned.astype(np.complex64), frequency=made.raw.frequency, frequency_step=made.raw.frequency_step,
        tx=made.raw.tx, reference_range=made.raw.reference_range,
    )  # fmt: skip
    levels = [np.abs(sarcl.backproject(raw, grid, beam=made.beam).data).max() for raw in (made.raw, right)]
    # other points and the noise are in the image too
    assert 20 * np.log10(levels[0] / levels[1]) == pytest.approx(20 * np.log10(blurred / wanted), abs=1.0)
    assert levels[1] == pytest.approx(wanted * made.raw.n_samples, rel=0.1)


def test_a_leak_is_not_focused_at_the_cost_of_the_points():
    made = trials.scene("correct", LEAK)
    assert "leak 5 dB" in made.words
    better, errors = sarcl.autofocus(made.raw, made.grid)
    assert better is made.raw and not errors.found
    assert errors.gain > 5 and errors.agreement > 0.4  # what one half of the band shows, the other confirms
    assert "leak of constant delay" in errors.reason and errors.reason in str(errors)


# 110 and 164: clutter, or three points of an arm, gain 2 to 5 % in sharpness by a phase that blurs the brightest ones
@pytest.mark.parametrize(
    "seed", [2, *(pytest.param(k, marks=pytest.mark.slow) for k in (0, 1, *range(3, 10), 110, 164))]
)
def test_correct_data_are_not_harmed(seed):
    row = trials.trial("correct", seed)
    assert not row["harmed"], row


@pytest.mark.slow
def test_smooth_errors_are_removed():
    rows = [trials.trial("error", seed) for seed in range(10)]
    assert not any(row["harmed"] for row in rows), rows
    assert sum(row["restored"] for row in rows) >= 9, rows


@pytest.mark.slow
@pytest.mark.parametrize("seed", [25, 195])
def test_phases_of_single_pulses_that_agree_by_their_smooth_curve_alone_are_enough(seed):
    # 20 points of a rail, and 2 points in clutter: unsmoothed, the halves of the band agree to 0.35 and 0.38
    row = trials.trial("error", seed)
    assert row["found"] and row["restored"] and not row["harmed"], row


# rails with 40 points: free phases of the pulses sharpen a half of the band to fewer points than there are, 3 to 5
# times sharper than the true phase, and agree to 0.5 with those of the other half. 2014, 2038: they agree to 0.41 and
# 0.62, and sharpen the other half less than smooth curves do
@pytest.mark.parametrize(
    "seed", [140, 2038, *(pytest.param(k, marks=pytest.mark.slow) for k in (58, 67, 103, 158, 2014))]
)
def test_phases_of_crowded_scenes_are_searched_as_smooth_curves(seed):
    row = trials.trial("error", seed)
    assert row["found"] and row["restored"] and not row["harmed"] and not row["distorted"], row


@pytest.mark.slow
def test_three_points_close_in_range_are_corrected():
    # within 1.6 range cells of half the band: of the far places all but side lobes lay between the sets
    row = trials.trial("error", 1088)
    assert row["found"] and row["restored"] and not row["harmed"] and not row["distorted"], row


@pytest.mark.slow
def test_what_is_corrected_on_arms_is_neither_harmed_nor_distorted():
    rows = [trials.trial("arm", seed) for seed in (3, 13, 15, 20, 21, 44, 50, 51, 55, 80, 89, 140)]
    assert not any(row["harmed"] or row["distorted"] for row in rows), rows
    assert any(row["found"] for row in rows), rows


@pytest.mark.slow
def test_the_trial_tells_what_the_error_has_moved_apart_from_what_the_correction_moves():
    # two points of an arm, which no pulse sees together: the error moves them by 2.3 cells against one another
    row = trials.trial("arm", 1091)
    assert row["found"] and row["apart_before"] > 2 and abs(row["apart"] - row["apart_before"]) <= trials.APART, row


def test_the_trial_finds_points_that_a_phase_moves_against_one_another():
    made = trials.scene("arm", 1)
    raw, zero = made.raw, np.zeros(made.raw.n_rows)
    assert np.abs(trials.places(made, zero, zero)).max() <= 0.1
    turn = np.linspace(-np.pi / 2, np.pi / 2, len(zero))
    phase = 10 * turn**2  # even: no part of it displaces the whole scene
    found = trials.places(made, phase, zero)[:, 1]
    for k, point in enumerate(made.points):
        alone, _ = trials._echoes(
            point[None], np.ones(1), raw.tx, made.beam[1], raw.reference_range, 24e9, 1.5e9, raw.n_samples
        )
        blurred = replace(alone, samples=(alone.samples * np.exp(1j * phase)[:, None]).astype(np.complex64))
        grid = sarcl.ImageGrid.plane(center=point, shape=(121, 121), spacing=0.01)
        level = np.abs(sarcl.backproject(blurred, grid, beam=made.beam).data)
        peak = grid.at(*np.unravel_index(level.argmax(), level.shape)) - point
        seen = made.seen[:, k] * (((point - raw.tx) * made.beam[1]).sum(axis=1)
                                  >= np.cos(trials.BEAM / 2) * np.linalg.norm(point - raw.tx, axis=1)) > 0  # fmt: skip
        look = point - raw.tx[seen]
        ahead = look.mean(axis=0) / np.linalg.norm(look.mean(axis=0))
        across = np.array([-ahead[1], ahead[0], 0])
        cell = SPEED_OF_LIGHT / 24e9 / 2 / np.ptp((look / np.linalg.norm(look, axis=1)[:, None]) @ across)
        assert found[k] == pytest.approx(peak @ across / cell, abs=0.3)
    assert np.ptp(found) > 2
