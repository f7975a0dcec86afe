"""A whole run: samples in time, cells that are left out, its end, its memory and cost."""

from __future__ import annotations

import tracemalloc
from dataclasses import replace

import numpy as np
import pyopencl
import pytest
from helpers.devices import opened, variants
from helpers.far_field import amplitude
from helpers.fdtd_cases import random_target, sphere_intervals

from sarcl import shapes
from sarcl.base.constants import SPEED_OF_LIGHT
from sarcl.fullwave.bodies.cut_cells import conductor
from sarcl.fullwave.bodies.mesh_lines import mesh_lines
from sarcl.fullwave.currents import Decay, RunOptions, box_of, currents, sample_period
from sarcl.fullwave.fields import BLOCK, SAMPLES, Fields
from sarcl.fullwave.incident import PlaneWave, wave_table
from sarcl.fullwave.lattice import Lattice
from sarcl.fullwave.pulse import Pulse
from sarcl.fullwave.runs import run_bytes
from sarcl.fullwave.target import Target, material_edges, resting_rows

CELL = 0.01  # m
TOP = SPEED_OF_LIGHT / (10 * CELL)  # Hz: ten cells per wavelength
ABSORBER, GAP = 8, 3
FREQUENCIES = np.linspace(0.2, 1, 5)

on_devices = pytest.mark.parametrize("param", variants(names=()))
on_twins = pytest.mark.parametrize("param", variants(names=("one-lane",)))  # the form for GPUs


def grid_of(n):
    return Lattice(CELL, (n, n, -(-n // 16) * 16), np.zeros(3))


def ball(grid, radius):
    return conductor(grid, sphere_intervals(grid, grid.centre + 0.13 * CELL, radius * CELL))


def wave_along(travel=(0.5, -0.3, -0.8)):
    return PlaneWave(np.array(travel) / np.linalg.norm(travel), np.array([1, 0.3, 0]), Pulse.gaussian(0.1 * TOP, TOP))


def run(param, grid, target, **options):
    k = 2 * np.pi * FREQUENCIES * TOP / SPEED_OF_LIGHT
    return currents(
        opened(param), grid, target, wave_along(), k, absorber=ABSORBER, gap=GAP, options=RunOptions(**options)
    )


def echo(result):
    return amplitude(result, -result.wave.travel, result.wave.polarization)


# samples in time


@pytest.mark.parametrize("cells, every", [(20, 8), (10, 8), (5, 4), (2.6, 2)])
def test_samples_are_as_far_apart_as_the_highest_frequency_of_the_pulse_allows(cells, every):
    top = SPEED_OF_LIGHT / (cells * CELL)
    step = grid_of(32).time_step
    omega = 2 * np.pi * np.linspace(0.1, 1, 10) * top
    pulse = Pulse.gaussian(0.1 * top, top)
    assert sample_period(pulse, omega, step) == every
    assert 1 / (every * step) > top + pulse.highest  # no frequency of the pulse falls on one that is asked for
    assert sample_period(pulse, np.array([2 * np.pi * (1 / (8 * step) - 0.5 * top)]), step) < 8


@on_devices
def test_sums_over_every_eighth_step_are_those_over_every_step(param):
    """Residuals of one run, summed in float64: only the frequencies that fall on each other can make a difference."""
    grid, wave = grid_of(32), wave_along()
    low, high = box_of(grid, ABSORBER, GAP)
    fields = Fields(
        opened(param), grid, ball(grid, 4), absorber=ABSORBER, wave=wave_table(grid, wave, low, high, grid.centre)
    )
    steps = []
    for _ in range(800 // BLOCK):
        fields.advance(BLOCK)
        steps.append(np.concatenate([fields.edges.residuals(BLOCK), fields.faces.residuals(BLOCK)], axis=1))
    residual = np.concatenate(steps).astype(float)
    omega = 2 * np.pi * FREQUENCIES * TOP
    turns = np.exp(-1j * np.outer(omega, np.arange(len(residual)) * grid.time_step))
    every, eighth = turns @ residual, 8 * turns[:, 7::8] @ residual[7::8]
    assert sample_period(wave.pulse, omega, grid.time_step) == 8
    # rounding of float32 fields has all frequencies, and falls on those that are asked for
    assert np.linalg.norm(eighth - every, axis=1).max() < 1e-5 * np.linalg.norm(every, axis=1).max()
    coarse = 20 * turns[:, 19::20] @ residual[19::20]  # the test can fail
    assert np.linalg.norm(coarse - every, axis=1).max() > 1e-2 * np.linalg.norm(every, axis=1).max()


@on_twins
def test_kept_samples_are_those_of_every_step(param):
    grid, rng = grid_of(16), np.random.default_rng(2)
    target = random_target(grid, rng)
    e, h = rng.uniform(-1, 1, (2, 3, *grid.shape))
    kept = {}
    for every in (1, 4):
        fields = Fields(opened(param), grid, target, every=every)
        fields.start(e, h)
        found = []
        for _ in range(4):
            fields.advance(BLOCK)
            found.append([part.residuals(SAMPLES) for part in (fields.edges, fields.faces)])
        kept[every] = [np.concatenate([block[n] for block in found]) for n in (0, 1)]
    for n in (0, 1):
        assert np.array_equal(kept[4][n][-SAMPLES:], kept[1][n][3::4])


# cells that are left out


def test_resting_rows_are_the_longest_stretches_of_vectors_inside():
    inside, low = np.zeros((5, 6, 50), bool), np.array([2, 3, 8])
    inside[1:4, 1:5, 7:42] = True  # cells 15 to 49 of the grid
    assert resting_rows(inside, low).tolist() == [[4, 5, 16, 48], [4, 6, 16, 48]]
    inside[2, 2, 40] = False  # a hole
    assert resting_rows(inside, low).tolist() == [[4, 5, 16, 32], [4, 6, 16, 32]]


@on_twins
def test_cells_inside_a_conductor_may_be_left_out_bit_by_bit(param):
    grid, rng = grid_of(44), np.random.default_rng(3)
    target = ball(grid, 18)
    assert (target.resting[:, 3] - target.resting[:, 2]).sum() > 0.03 * np.prod(grid.shape)
    node = np.stack(np.indices(grid.shape)) - (grid.centre / CELL)[:, None, None, None]
    e, h = rng.uniform(-1, 1, (2, 3, *grid.shape)) * (np.linalg.norm(node, axis=0) > 20)  # nothing inside
    ends = []
    for listed in (target, replace(target, resting=None)):
        fields = Fields(opened(param), grid, listed)
        fields.start(e, h)
        for _ in range(3):
            fields.advance(BLOCK)
        ends.append([*fields.download(), fields.edges.residuals(BLOCK), fields.faces.residuals(BLOCK)])
    for fast, slow in zip(*ends, strict=True):
        assert np.abs(slow).max() > 0.1
        assert np.array_equal(fast, slow)


@on_twins
def test_cells_at_rest_are_left_as_they_are(param):
    grid, rng = grid_of(44), np.random.default_rng(4)
    target, (e, h) = ball(grid, 18), rng.uniform(-1, 1, (2, 3, *grid.shape)).astype(np.float32)
    fields = Fields(opened(param), grid, target)
    fields.start(e, h)
    fields.advance(BLOCK)
    plane, row, first, last = target.resting[len(target.resting) // 2]
    for begun, ended in zip((e, h), fields.download(), strict=True):
        assert np.array_equal(begun[:, plane, row, first:last], ended[:, plane, row, first:last])
        assert (begun[:, plane, row, :first] != ended[:, plane, row, :first]).all()


@on_twins
@pytest.mark.parametrize("travel", [(0.5, -0.3, -0.8), (0, 0, 1), (-1, 0, 0), (0.6, 0.8, 0)])
def test_fields_ahead_of_the_wave_are_below_rounding(param, travel):
    grid, wave = grid_of(48), wave_along(travel)
    low, high = box_of(grid, ABSORBER, GAP)
    table = wave_table(grid, wave, low, high, grid.centre)
    target = ball(grid, 8)
    dark, full = (Fields(opened(param), grid, target, absorber=ABSORBER, wave=table, tile=t) for t in (None, 5))
    full._dark = False
    for steps in (-wave.pulse.half_length / grid.time_step, 0):  # the front, and the peak, are in the middle
        while dark.step < table.delay / grid.time_step + steps:
            dark.advance(BLOCK)
            full.advance(BLOCK)
        both = [np.stack(fields.download()) for fields in (dark, full)]
        assert np.abs(both[0] - both[1]).max() < (5e-6 if steps == 0 else 1e-7)  # of the peak of the wave
        assert steps == 0 or (both[0] == 0).sum() > 0.05 * both[0].size + (both[1] == 0).sum()
    assert np.abs(both[1]).max() > 0.5


@on_devices
def test_tiles_give_the_same_bits_while_the_wave_enters(param):
    grid = grid_of(40)
    whole, tiled = (run(param, grid, ball(grid, 6), most_steps=320, tile=tile) for tile in (100, 7))
    assert np.abs(whole.electric).max() > 0.01
    assert np.array_equal(whole.electric, tiled.electric) and np.array_equal(whole.magnetic, tiled.magnetic)


# the end of a run


def test_decay_is_estimated_from_the_slowest_frequency():
    decay, sums, change = Decay(1e-3, 64), np.array([1.0, 4.0]), np.array([0.5, 0.5])
    total = []
    for _ in range(50):
        change = change * np.array([0.5, 0.8])
        decay.add(change**2, sums)
        total.append(decay.left)
        if decay.ended:
            break
    left = change[1] * 0.8 / 0.2 / 2  # the sum of all later changes, over the phasor
    assert decay.ended == "decayed" and left < decay.left < 3 * left
    assert total[6] == 1 and decay.missing_steps() == 0


def test_changes_that_do_not_fall_end_a_run_only_where_they_are_rounding():
    resonant, rounding = (Decay(1e-4, 64) for _ in range(2))
    for n in range(40):
        resonant.add(np.array([1e-3]) * 0.999**n, np.array([1.0]))
        rounding.add(np.array([5e-6]) ** 2, np.array([1.0]))
    assert resonant.ended is None and resonant.left > 0.1 and resonant.missing_steps() == 0
    assert rounding.ended == "rounding" and np.isclose(rounding.left, 2e-5)


@on_devices
def test_a_run_ends_where_later_steps_change_less_than_the_tolerance(param):
    grid = grid_of(40)
    early = run(param, grid, ball(grid, 7), tolerance=1e-2)
    late = run(param, grid, ball(grid, 7), tolerance=1e-5)
    assert early.ended == late.ended == "decayed"
    assert early.left <= 1e-2 and early.n_steps < late.n_steps
    off = np.linalg.norm(early.electric - late.electric, axis=1) / np.linalg.norm(late.electric, axis=1)
    assert off.max() < early.left
    assert np.abs(echo(early) - echo(late)).max() < early.left * np.abs(echo(late)).max()


@on_devices
def test_a_run_that_is_asked_for_more_than_float32_has_says_so(param):
    grid = grid_of(36)
    ended = run(param, grid, ball(grid, 5), tolerance=1e-9)
    assert ended.ended == "rounding" and ended.left < 1e-4 and ended.n_steps < 4000
    cut = run(param, grid, ball(grid, 5), most_steps=400)
    assert cut.ended == "most_steps" and cut.n_steps == 448


def open_box(grid, mouth):
    """A cube of 16 cells with walls of 2 cells, and a square mouth in one side, in cells."""
    middle, side, wall = grid.centre, 16 * CELL, 2 * CELL

    def box(size, at):
        return shapes.box(size, position=np.subtract(at, (0, 0, size[2] / 2))).triangles

    parts = [box((side, side, wall), np.add(middle, (0, 0, wall / 2 - side / 2)))]
    for x, y in ((1, 0), (-1, 0), (0, 1), (0, -1)):
        across, lid = np.array([x, y, 0]) * (side - wall) / 2, (side - mouth * CELL) / 2
        parts.append(box((wall if x else side, wall if y else side, side), middle + across))
        across = np.array([x, y, 0]) * (side - lid) / 2 + [0, 0, (side - wall) / 2]
        parts.append(box((lid if x else side, lid if y else side, wall), middle + across))
    return conductor(grid, mesh_lines(grid, np.concatenate(parts)).intervals)


@pytest.mark.slow
@on_devices
def test_a_run_goes_on_while_a_target_rings_or_says_what_is_left(param):
    grid = grid_of(44)
    cube = run(param, grid, ball(grid, 8), tolerance=1e-2)
    cup = run(param, grid, open_box(grid, 12), tolerance=1e-2)
    late = run(param, grid, open_box(grid, 12), tolerance=1e-3)
    assert cube.ended == cup.ended == late.ended == "decayed"
    assert cup.n_steps > 1.3 * cube.n_steps
    assert np.abs(echo(cup) - echo(late)).max() < cup.left * np.abs(echo(late)).max()
    cavity = run(param, grid, open_box(grid, 8), tolerance=1e-2, most_steps=cup.n_steps)
    assert cavity.ended == "most_steps" and cavity.left > 0.1


@on_devices
def test_a_run_with_nothing_in_it_ends_when_the_wave_has_left(param):
    empty = run(param, grid_of(32), Target.nothing())
    assert empty.ended == "decayed" and empty.left == 0 and empty.electric.shape == (5, 0)


# memory and cost


def kept_bytes(monkeypatch, device):
    """Bytes of the buffers of a device that are not released: {"now": ..., "most": ...}."""
    kept = {"now": 0, "most": 0}

    class Counted(pyopencl.Buffer):
        def __init__(self, nbytes):
            super().__init__(device.context, pyopencl.mem_flags.READ_WRITE, nbytes)
            kept["now"] += nbytes
            kept["most"] = max(kept.values())

        def __del__(self):
            kept["now"] -= self.size

    monkeypatch.setattr(device, "empty", Counted)
    return kept


@on_devices
@pytest.mark.parametrize("material", [False, pytest.param(True, marks=pytest.mark.slow)])
def test_a_run_takes_the_memory_and_about_the_steps_that_were_foretold(param, monkeypatch, material):
    grid = grid_of(48)
    target = ball(grid, 10)
    if material:
        target = material_edges(grid, target.edges, np.full(len(target.edges), 3.0), np.full(len(target.edges), 0.1))
    on_device, in_all = run_bytes(
        np.array(grid.shape), len(target.edges), len(target.faces), len(FREQUENCIES), absorber=ABSORBER, gap=GAP,
        conductor=not material,
    )  # fmt: skip
    kept, calls = kept_bytes(monkeypatch, opened(param)), []
    tracemalloc.start()
    try:
        result = run(param, grid, target, progress=lambda *steps: calls.append(steps))
        _, host = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert kept["now"] == 0  # everything is free again
    assert 0.95 < kept["most"] / on_device < 1.05
    assert 0.8 < (kept["most"] + host) / in_all < 1.05
    done, expected = np.array(calls).T
    assert (np.diff(done) == 64).all() and done[-1] == result.n_steps and expected[-1] >= done[-1]
    assert (expected >= done).all() and 0.7 < result.n_steps / expected[0] < 1.3
