"""Plans by lines of pixels: what pulses of a group share."""

from __future__ import annotations

import numpy as np
import pytest
from helpers.cases import noise_on, straight

import sarcl
from sarcl.base.constants import SPEED_OF_LIGHT
from sarcl.imaging.direct import line_plan
from sarcl.imaging.focusing_task import make_task


def bend(antenna, center, steps, i, j):
    """Range over a line's pixels j beyond its linear part, less that at j = 0: float64 is enough at 2 km."""

    def curved(i, j):
        offset = i * steps[1] + j * steps[0]
        toward = (center - antenna) / np.linalg.norm(center - antenna)
        return np.linalg.norm(center + offset - antenna) - np.linalg.norm(center - antenna) - toward @ offset

    return curved(i, j) - curved(i, 0)


@pytest.mark.parametrize("side", [16, 32])
def test_limits_of_lines_bound_the_curvature_that_pulses_of_a_group_do_not_share(side):
    raw = noise_on(straight(64, aperture=400.0, distance=2e3), bandwidth=100e6, n_samples=128)
    grid = sarcl.ImageGrid.plane(shape=(128, 128), spacing=0.2)
    task = make_task(raw, grid, None, None, False, True)
    plan = line_plan.choose(task, task.antennas, 0.9, sides=(side,))
    assert plan is not None and plan.side == side
    # lines run along x, the axis that the line of sight has most of
    steps, largest = np.array([[0.2, 0, 0], [0, 0.2, 0]]), 0.0
    for first in range(0, 64 - plan.group, plan.group):
        ends = raw.tx[[first, first + plan.group // 2, first + plan.group]]
        for i, j in ((-1, 1), (0, 1), (1, 1), (1, -1), (-1, -1)):
            bends = [bend(end, np.zeros(3), steps, i * side / 2, j * side / 2) for end in ends]
            largest = max(largest, abs(bends[0] - bends[1]), abs(bends[2] - bends[1]))
    cycles = 2 * (raw.frequency.max() + 100e6) / SPEED_OF_LIGHT * largest
    assert cycles <= plan.limits["limit_cycles"] <= 2 * cycles
