"""Arrays in scenario files."""

from __future__ import annotations

import numpy as np
import pytest

import sarcl
from sarcl.scenario import scenario

TEXT = """
[waveform.tone]
center = 10e9
duration = 5e-8

[trajectory.line]
start = [-5000, -100, 0]
velocity = [0, 100, 0]
prf = 10.0
n_pulses = 20

[array.linear]
n = 9
spacing = 0.015
frequency_step = 20e6
axis = [0, -1, 0]

[[scene.points]]
positions = [[0, 0, 0], [1, 0.5, 0]]

[grid.plane]
shape = [16, 16]
spacing = [0.2, 0.2]

[echo]
range_window = [-3.5, 3.5]
reference = [0, 0, 0]
receive = "reference"
"""


def test_a_scenario_with_an_array_echoes_and_focuses():
    read = scenario.loads(TEXT)
    raw = read.simulate()
    assert raw.samples.shape == (20, 9) and raw.array.n == 9 and raw.array.frequency_step == 20e6
    image = read.focus(raw, mapping="channels")
    row, column = np.unravel_index(np.abs(image.data).argmax(), image.data.shape)
    assert np.linalg.norm(image.grid.positions[row, column]) < 0.3 or np.abs(image.data).max() > 0.9 * image.gain


@pytest.mark.parametrize(
    ("table", "rows"),
    [
        ('[backproject]\nmapping = "channels"\ncheck = false\n', 9 * 20),
        ('[backproject.mapping]\nmapping = "corrected"\ncenter = [0, 0, 0]\nquadratic = false\n', 20),
    ],
    ids=["kind", "table"],
)
def test_a_mapped_image_is_planned_and_made_from_one_table(table, rows):
    read = scenario.loads(TEXT + table)
    raw = read.simulate()
    forecast, image = read.plan_focus(raw), read.focus(raw)
    assert forecast.plan == dict(image.report.plan) and forecast.predicted_error == image.report.predicted_error
    assert image.report.contributions_done + sum(image.report.contributions_skipped.values()) == rows * 256
    tight = read.plan_focus(raw, sarcl.ImageGrid.plane(shape=(8, 8), spacing=0.2), tolerance=1e-5)
    assert tight.predicted_error <= 1e-5 < forecast.predicted_error


@pytest.mark.parametrize("verb", ["focus", "plan_focus"])
def test_an_unknown_mapping_is_named_with_its_line(verb):
    read = scenario.loads(TEXT + '[backproject]\nmapping = "sideways"\n')
    with pytest.raises(ValueError, match=r"scenario:30: \[backproject\] mapping .*corrected"):
        getattr(read, verb)(read.simulate())


@pytest.mark.parametrize(
    "array", [sarcl.AntennaArray.linear(3, spacing=0.1, frequency_step=1e6), sarcl.AntennaArray.planar(
        (2, 2), spacing=(0.1, 0.2), weights=[1, 1j, 0.5, -2]).mirrored(2, 5)]
)  # fmt: skip
def test_an_array_becomes_a_table_and_comes_back(array):
    again = scenario.loads(sarcl.Scenario(array=array).dumps()).build_array()
    for name in array.__dataclass_fields__:
        np.testing.assert_array_equal(getattr(again, name), getattr(array, name))


def test_unknown_keys_of_arrays_are_named_with_their_line():
    with pytest.raises(ValueError, match=r"scenario:14: \[array\.linear\] unknown key 'step'"):
        scenario.loads(TEXT.replace("spacing =", "step =")).build_array()
