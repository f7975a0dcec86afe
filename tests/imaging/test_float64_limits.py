"""Difficult float64 backprojection: window edges, many pulses, high contrast, little memory; refusals."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from helpers.cases import REPEATED, noise_history
from helpers.float64_cases import decimal_image, error, focus, task_of

import sarcl
from sarcl.base.constants import SPEED_OF_LIGHT
from sarcl.base.stage_timer import Clock
from sarcl.imaging.float64.direct import DirectFloat64
from sarcl.imaging.float64.plan import WIDE, make_plan
from sarcl.numerics import interpolation
from sarcl.opencl.choose_device import open_device
from sarcl.reference.backproject import backproject as exact_image

PLANE = sarcl.ImageGrid.plane(center=(1, 2, 0), shape=(9, 11), spacing=(0.9, 0.7))


def test_wrap_repeats_the_window(double):
    raw = noise_history(n_rows=9, n_samples=16)
    for center in ((9, 0, 0), (5e3, 0, 0)):
        grid = sarcl.ImageGrid.plane(center=center, shape=(10, 30), spacing=(0.4, 0.9))
        data, plan, _ = focus(raw, grid, 1e-9, double, wrap=True)
        assert error(data, raw, grid, wrap=True) <= plan.predicted_error <= 1e-9
    raw = replace(raw, tx=raw.tx * 3600, reference_range=0)
    data, plan, _ = focus(raw, grid, 1e-9, double, wrap=True)
    assert error(data, raw, grid, wrap=True) <= plan.predicted_error <= 1e-9


def test_pixels_outside_the_range_window_get_nothing(double):
    raw = noise_history(n_rows=10, n_samples=16)  # a swath of 4 m
    grid = sarcl.ImageGrid.plane(shape=(40, 60), spacing=0.5)
    data, plan, skipped = focus(raw, grid, 1e-9, double)
    assert error(data, raw, grid) <= plan.predicted_error <= 1e-9
    assert skipped > 0
    whole, _, none = focus(raw, grid, 1e-9, double, skips=())
    assert np.array_equal(whole, data) and none == 0
    far = sarcl.ImageGrid.plane(center=(300, 0, 0), shape=(40, 40), spacing=0.2)
    for skips in ((), ("range window",)):
        data, _, skipped = focus(raw, far, 1e-9, double, skips=skips)
        assert not data.any() and skipped == (10 * far.size if skips else 0)


def test_a_pixel_on_the_windows_edge_belongs_to_it(double):
    # limit and paths are whole metres here, so the edge is a matter of equality
    step = SPEED_OF_LIGHT / 2**6  # half a window: 16 m
    raw = sarcl.PhaseHistory(
        np.arange(8.0)[None] + 1j, frequency=2**33, frequency_step=step, tx=[[0, 0, 1024.0]], reference_range=1024
    )
    edges = np.array([16.0, -16.0])
    for offset, seen in ((0.0, True), (-(2.0**-40), True), (2.0**-40, False)):
        heights = edges + np.sign(edges) * offset
        grid = sarcl.ImageGrid.points(np.stack([0 * heights, 0 * heights, heights], axis=1))
        data, _, _ = focus(raw, grid, 1e-9, double)
        assert (data != 0).tolist() == [seen, seen]


def test_antennas_among_and_on_the_pixels_are_right(double):
    raw = noise_history(distance=30.0, n_rows=9)
    raw = replace(raw, frequency_step=raw.frequency_step / 40)  # a swath that holds them
    grid = sarcl.ImageGrid.points(np.stack([raw.tx[4], raw.tx[4] * 1.2, raw.tx[0], raw.tx[8] + [0, 1e-9, 0]]))
    data, plan, _ = focus(raw, grid, 1e-9, double)
    assert plan.order == WIDE
    assert error(data, raw, grid) <= plan.predicted_error <= 1e-9


@pytest.mark.parametrize("wrap, bistatic", [(False, False), (True, True)])
def test_a_beam_is_part_of_the_model_and_leaving_pairs_out_is_not(double, wrap, bistatic):
    raw = noise_history(n_rows=9, n_samples=24, bistatic=bistatic)
    toward = np.array([0.3, -0.2, 0.0]) + np.linspace(-15, 15, 9)[:, None] * [0, 1, 0] - raw.tx
    grid = sarcl.ImageGrid.plane(shape=(60, 70), spacing=0.4)
    picked = np.random.default_rng(0).permutation(grid.size)[:500]
    places = grid.positions.reshape(-1, 3)[picked]
    for angle in (2 * 6 / 10e3, 0.9 * np.pi, 1.2 * np.pi):
        wanted, norm = exact_image(raw, places, wrap=wrap, beam=(angle, toward))
        whole, plan, none = focus(raw, grid, 1e-9, double, wrap=wrap, beam=(angle, toward), skips=())
        assert (
            np.linalg.norm(whole.ravel()[picked] - wanted) / max(np.linalg.norm(wanted), norm) <= plan.predicted_error
        )
        fewer, _, skipped = focus(raw, grid, 1e-9, double, wrap=wrap, beam=(angle, toward))
        assert np.array_equal(fewer, whole) and none == (0, 0)
        assert (skipped[1] > 0.2 * 9 * grid.size) == (angle < 1) and (skipped[0] == 0) == wrap


def test_tiles_about_the_antennas_see_their_beams_right(double):
    raw = noise_history(n_rows=4, distance=8.0, n_samples=16)
    raw = replace(raw, frequency_step=raw.frequency_step / 200)
    grid = sarcl.ImageGrid.points(np.random.default_rng(1).uniform(-15, 15, (400, 3)))
    for angle in (0.5, 2.0, 4.0, 6.0):
        wanted, norm = exact_image(raw, grid.positions, beam=(angle, np.array([1.0, 2.0, 0.5])))
        data, plan, _ = focus(raw, grid, 1e-9, double, beam=(angle, (1.0, 2.0, 0.5)))
        assert np.linalg.norm(data - wanted) <= plan.predicted_error * max(np.linalg.norm(wanted), norm)


def test_empty_cells_are_zero_and_the_rest_is_right(double):
    raw = noise_history(n_rows=5)
    positions = np.random.default_rng(2).uniform(-3, 3, (20, 30, 3))
    valid = np.random.default_rng(3).random((20, 30)) < 0.3
    data, plan, _ = focus(raw, sarcl.ImageGrid.points(positions, valid=valid), 1e-9, double)
    assert not data[~valid].any()
    assert error(data[valid], raw, sarcl.ImageGrid.points(positions[valid])) <= plan.predicted_error <= 1e-9


@pytest.mark.parametrize("budget", [1e5, 3e6])
def test_memory_limit_does_not_change_the_image(double, budget):
    raw = noise_history(n_rows=70)
    grid = sarcl.ImageGrid.plane(shape=(60, 150), spacing=0.1)
    whole, _, missed = focus(raw, grid, 1e-8, double)
    parts, _, again = focus(raw, grid, 1e-8, double, budget=budget)
    assert np.linalg.norm(parts - whole) <= 1e-13 * np.linalg.norm(whole) and missed == again
    same, _, _ = focus(raw, grid, 1e-8, double, budget=budget)
    assert np.array_equal(same, parts)


def test_progress_counts_rows_up_to_all_of_them(double):
    raw = noise_history(n_rows=200)
    task = task_of(raw, sarcl.ImageGrid.plane(shape=(40, 300), spacing=0.03))
    engine = DirectFloat64(double, task, *make_plan(task, 1e-7))
    for budget in (1e5, 1e8):
        for first, last in engine.blocks(budget):
            calls = []
            engine.fill(first, last, np.empty((40, 300), complex), budget, Clock(), calls.append)
            assert calls == sorted(calls) and 0 < calls[0] and calls[-1] == 200
    with pytest.raises(MemoryError, match=r"max_bytes is 1 kB but the range profile of one row.*give max_bytes="):
        engine.blocks(1e3)


def coherent(n_rows, grid):
    """Rows of four samples that add up in phase at the grid's middle, and the exact image, row by row in float64.

    Every row is the same, so the sum is n_rows times one contribution.
    """
    random = np.random.default_rng(2)
    samples = np.broadcast_to(random.standard_normal((1, 4)) + 1j * random.standard_normal((1, 4)), (n_rows, 4))
    tx = np.broadcast_to(np.array([[7e3, 0, 7e3]]), (n_rows, 3))
    raw = sarcl.PhaseHistory(samples, frequency=9.6e9, frequency_step=1e6, tx=tx, reference_range=9.9e3)
    return raw, n_rows * decimal_image(raw[:1], grid.positions.reshape(-1, 3))[0]


@pytest.mark.parametrize("n_rows", [1_000, pytest.param(1_000_000, marks=REPEATED)])
def test_error_does_not_grow_with_the_number_of_pulses(double, n_rows):
    grid = sarcl.ImageGrid.plane(shape=(4, 4), spacing=0.5)
    raw, wanted = coherent(n_rows, grid)
    task = task_of(raw, grid)
    plan, _ = make_plan(task, 1e-8)
    # with an interpolation error of 1e-14 only the error of the sum remains
    plan = replace(plan, interpolator=interpolation.deconvolved(14, 4.0, 7, np.float64), length=64, order=WIDE)
    data, _, _ = focus(raw, grid, 1e-8, double, plan=plan)
    assert np.linalg.norm(data.ravel() - wanted) <= 3e-14 * np.linalg.norm(wanted)


def test_a_weak_point_120_db_below_its_neighbour_is_found(double):
    track = sarcl.Trajectory.circle(radius=7e3, height=5e3, arc=0.05, n_pulses=40)
    rows = np.arange(40)
    f = 9.6e9 + 4e6 * (np.arange(64) - 32)
    places, amplitudes = np.array([[0.0, 0, 0], [1.1, 1.4, 0]]), (1.0, 1e-6)
    wide = np.longdouble
    paths = [
        np.sqrt(((track.positions.astype(wide) - x) ** 2).sum(axis=1)) - np.linalg.norm(track.positions[rows], axis=1)
        for x in places
    ]
    turns = [(-2 / wide(SPEED_OF_LIGHT) * r[:, None] * f) % 1 for r in paths]
    echoes = [a * np.exp(2j * np.pi * t.astype(np.float64)) for a, t in zip(amplitudes, turns, strict=True)]
    raw = sarcl.PhaseHistory(
        echoes[0] + echoes[1],
        frequency=f[0],
        frequency_step=4e6,
        tx=track.positions,
        reference_range=np.linalg.norm(track.positions, axis=1),
    )
    grid = sarcl.ImageGrid.plane(center=(1, 1, 0), shape=(31, 31), spacing=0.1)
    data, _, _ = focus(raw, grid, 1e-7, double)
    strong, _ = exact_image(replace(raw, samples=echoes[0]), grid.positions.reshape(-1, 3))
    left = np.abs(data - strong.reshape(grid.shape))
    at = np.unravel_index(np.argmax(left), left.shape)
    assert np.linalg.norm(grid.positions[at] - places[1]) <= 0.15
    assert abs(20 * np.log10(left[at] / (40 * 64 * 1e-6))) <= 1


def test_denormal_and_huge_samples_keep_their_relative_error(double):
    raw = noise_history(n_rows=4)
    for scale in (1e250, 1e-290):
        data, _, _ = focus(replace(raw, samples=raw.samples * np.complex128(scale)), PLANE, 1e-8, double)
        unscaled, _, _ = focus(raw, PLANE, 1e-8, double)
        assert np.linalg.norm(data / scale - unscaled) <= 1e-12 * np.linalg.norm(unscaled)
    tiny = focus(replace(raw, samples=raw.samples * np.complex128(1e-310)), PLANE, 1e-8, double)[0]
    assert np.isfinite(tiny).all()
    with pytest.raises(ValueError, match="scale the samples down"):
        focus(replace(raw, samples=raw.samples * np.complex128(1e295)), PLANE, 1e-8, double)


def test_a_device_without_float64_is_refused_by_name():
    device = open_device().without_fp64()
    with pytest.raises(ValueError, match=r"need float64.*lacks; its best is 1e-6.*device="):
        focus(noise_history(n_rows=2), PLANE, 1e-8, device)


def test_what_cannot_be_met_names_the_best_and_the_best_can_be_asked_for():
    task = task_of(noise_history(n_rows=2), PLANE)
    with pytest.raises(ValueError, match=r"cannot be met in complex128; the best here is") as caught:
        make_plan(task, 1e-16)
    named = float(str(caught.value).split()[-1])
    assert make_plan(task, named)[0].predicted_error <= named < 1e-10
    with pytest.raises(ValueError, match="cycles of phase"):
        make_plan(task_of(replace(noise_history(n_rows=2), reference_range=1e15), PLANE), 1e-8)


def test_complex128_samples_are_kept_as_they_are(tmp_path):
    raw = noise_history(n_rows=4)
    samples = raw.samples + np.float64(1e-12)
    raw = replace(raw, samples=samples)
    raw.save(tmp_path / "raw.h5")
    lazy = sarcl.read(tmp_path / "raw.h5")
    for kept in (raw, lazy, lazy[[1, 2, 3]], sarcl.concatenate([raw, lazy])):
        assert kept.read(0, 3).dtype == np.complex128
    assert np.array_equal(lazy.read(0, 4), samples)
    assert np.array_equal(sarcl.concatenate([lazy, raw]).read(4, 8), samples)
