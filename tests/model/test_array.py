"""AntennaArray: positions, carriers, plans of carriers over the pulses, and refusals."""

from __future__ import annotations

import numpy as np
import pytest

import sarcl
from sarcl.model.antenna_array import AntennaArray

C = 299_792_458.0


def test_linear_and_planar_number_their_elements_from_the_reference():
    line = AntennaArray.linear(4, spacing=0.5, frequency_step=-3.0, axis=(0, 0, 2))
    assert np.array_equal(line.positions, [[0, 0, 0], [0, 0, 0.5], [0, 0, 1], [0, 0, 1.5]])
    assert np.array_equal(line.offsets, [[0, -3, -6, -9]])
    assert (line.n, line.frequency_step, line.center, line.span, line.is_constant) == (4, -3, -4.5, 9, False)
    plane = AntennaArray.planar((3, 2), spacing=(1, 10), frequency_step=(100, 7))
    assert np.array_equal(plane.positions[5], [0, 2, 10]) and plane.offsets[0, 5] == 207
    assert np.array_equal(plane.offsets, [[0, 7, 100, 107, 200, 207]])
    assert plane.frequency_step is None
    assert np.array_equal(AntennaArray.planar((3, 2), spacing=(1, 1)).weights, np.ones(6))


def test_a_negative_spacing_is_the_axis_turned_round():
    there = AntennaArray.linear(5, spacing=-0.015, frequency_step=1e6)
    papers = AntennaArray.linear(5, spacing=0.015, frequency_step=1e6, axis=(0, -1, 0))
    assert np.array_equal(there.positions, papers.positions)


def test_without_steps_the_array_is_constant_and_one_element_sends_f0():
    single = AntennaArray.single()
    assert single.n == 1 and single.is_constant and not single.positions.any() and single.frequency_step == 0
    constant = AntennaArray.linear(9, spacing=0.015)
    assert constant.is_constant and constant.frequency_step == 0 and constant.span == 0
    assert constant.with_offsets(np.full(9, 5.0)).is_constant


@pytest.mark.parametrize("step", [1e6 / 3, 0.1, -123456.789])
def test_the_step_survives_rounding_and_random_offsets_have_none(step):
    line = AntennaArray.linear(1000, spacing=0.015, frequency_step=step)
    assert line.frequency_step == pytest.approx(step, rel=1e-12)
    random = np.random.default_rng(1).uniform(-1, 1, 1000)
    assert line.with_offsets(random).frequency_step is None


@pytest.mark.parametrize("n", [1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 12, 45, 225, 448, 996])
def test_costas_sends_every_carrier_once_and_repeats_no_difference(n):
    order = np.rint(AntennaArray.costas(n, spacing=0.015, frequency_step=2e6).offsets[0] / 2e6).astype(int)
    assert sorted(order) == list(range(n))
    for lag in range(1, min(n, 60)):
        steps = order[lag:] - order[:-lag]
        assert len(set(steps.tolist())) == n - lag


def test_sizes_without_a_costas_array_name_their_neighbours():
    with pytest.raises(ValueError, match=r"13 elements.*nearest sizes are 12 and 14"):
        AntennaArray.costas(13, spacing=1, frequency_step=1)
    with pytest.raises(ValueError, match="448 and 454"):
        AntennaArray.costas(450, spacing=1, frequency_step=1)


def test_mirroring_turns_the_progression_and_keeps_the_centre():
    array = AntennaArray.linear(45, spacing=0.015, frequency_step=20e6).mirrored(3, 8)
    before, after = array.offsets_at(2), array.offsets_at(3)
    assert before[0] == 0 and after[0] == 44 * 20e6 and after[44] == 0  # Farooq: f0' = f0 + (N - 1) df
    assert np.array_equal(np.diff(after), np.full(44, -20e6))
    assert array.center_jump == 0 and array.frequency_step is None and array.center == 440e6
    assert np.array_equal(array.plan, [0, 0, 0, 1, 1, 1, 1, 1])


def test_a_switch_without_moving_the_base_jumps_by_n_minus_1_steps():
    line = AntennaArray.linear(450, spacing=0.015, frequency_step=2e6)
    array = line.switched(line.with_offsets(-line.offsets[0]), 5, 10)
    assert array.center_jump == 449 * 2e6 and array.span == 2 * 449 * 2e6
    assert np.array_equal(array.centers, [449e6, -449e6])


def test_switches_nest():
    line = AntennaArray.linear(3, spacing=1, frequency_step=1.0)
    twice = line.switched(line.with_offsets([7, 7, 7]), 2, 6).switched(line.with_offsets([9, 9, 9]), 4, 6)
    assert [twice.offsets_at(p)[1] for p in range(6)] == [1, 1, 7, 7, 9, 9]
    back = twice.mirrored(5, 6)
    assert np.array_equal(back.offsets_at(5), [9, 9, 9]) and np.array_equal(back.offsets_at(0), [0, 1, 2])


def test_subarrays_share_a_carrier_and_steer_their_groups():
    array = AntennaArray.linear(12, spacing=0.015, frequency_step=10e6).subarrays(3, steer=(0.4, 0.0), frequency=10e9)
    assert np.array_equal(array.offsets[0], np.repeat([0, 40e6, 80e6], 4))
    direction = np.array([np.cos(0.4), np.sin(0.4), 0])
    other = AntennaArray.linear(12, spacing=0.015, frequency_step=10e6).subarrays(3, steer=direction, frequency=10e9)
    assert np.allclose(array.weights, other.weights, atol=1e-12)
    for group in range(3):  # in phase with its first element, in the far field there, at its own carrier
        k = 2 * np.pi * (10e9 + 40e6 * group) / C
        each = slice(4 * group, 4 * group + 4)
        arrives = array.weights[each] * np.exp(1j * k * array.positions[each] @ direction)
        assert np.allclose(arrives, arrives[0], atol=1e-12)
    with pytest.raises(ValueError, match="5 equal groups"):
        array.subarrays(5)
    with pytest.raises(ValueError, match="go together"):
        array.subarrays(3, steer=(0, 0))
    assert np.array_equal(AntennaArray.linear(4, spacing=1).subarrays(4).weights, np.ones(4))


def test_fields_are_read_only_and_public():
    array = sarcl.AntennaArray.linear(3, spacing=1)
    for field in (array.positions, array.offsets, array.weights):
        with pytest.raises(ValueError, match="read-only"):
            field[0] = 1


@pytest.mark.parametrize(
    "make, message",
    [
        (lambda: AntennaArray.linear(0, spacing=1), "n is 0; it must be at least 1"),
        (lambda: AntennaArray.linear(2.5, spacing=1), "whole number"),
        (lambda: AntennaArray.linear(10_001, spacing=1), "at most 10000"),
        (lambda: AntennaArray.planar((101, 100), spacing=(1, 1)), "at most 10000"),
        (lambda: AntennaArray.planar((2,), spacing=(1, 1)), r"give \(N, P\)"),
        (lambda: AntennaArray.planar((2, 0), spacing=(1, 1)), r"shape\[1\] is 0"),
        (lambda: AntennaArray.linear(3, spacing=float("nan")), "spacing is nan"),
        (lambda: AntennaArray.linear(3, spacing=1, frequency_step=float("inf")), "frequency_step is inf"),
        (lambda: AntennaArray.linear(3, spacing=1, axis=(0, 0, 0)), "a direction needs a length"),
        (lambda: AntennaArray.linear(3, spacing=1, weights=[1, 2]), r"weights has shape \(2,\), wanted \(3,\)"),
        (lambda: AntennaArray.linear(3, spacing=1, weights=[0, 0, 0]), "zero everywhere"),
        (lambda: AntennaArray.linear(3, spacing=1).with_offsets([1, 2]), r"offsets has shape"),
        (lambda: AntennaArray.linear(2, spacing=1).with_offsets([1, float("nan")]), "finite"),
        (lambda: AntennaArray(positions=[[0, 0]], offsets=[[0]]), r"positions has shape"),
        (lambda: AntennaArray(positions=[[0, 0, 0]], offsets=[[0]], plan=[0, 1]), r"plan\[1\] is 1"),
        (lambda: AntennaArray.single().mirrored(5, 4), "within the 4 pulses"),
        (lambda: AntennaArray.single().mirrored(2, 4).offsets_at(4), "pulses 0 to 3"),
        (lambda: AntennaArray.single().mirrored(2, 4).mirrored(1, 5), "plan has 4 pulses, wanted 5"),
        (lambda: AntennaArray.single().switched(AntennaArray.linear(2, spacing=1), 1, 2), "positions of its own"),
        (
            lambda: AntennaArray.linear(2, spacing=1).switched(AntennaArray.linear(2, spacing=1, weights=[1, 2]), 1, 2),
            "weights of its own",
        ),
        (lambda: AntennaArray.linear(2, spacing=1).subarrays(2, steer=(0, 0), frequency=-1), "greater than 0"),
    ],
)
def test_what_does_not_fit_is_refused_by_name(make, message):
    with pytest.raises(ValueError, match=message):
        make()


def test_an_array_says_what_it_is_in_a_line():
    text = repr(AntennaArray.linear(45, spacing=0.015, frequency_step=20e6).mirrored(2, 4))
    assert text == "AntennaArray(45 elements over 0.66 m, offsets 0 to 8.8e+08 Hz, 2 plans)"
