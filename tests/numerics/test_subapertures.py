"""Geometry of sub-apertures."""

import numpy as np
import pytest

from sarcl.numerics.pulse_geometry import PulseGeometry
from sarcl.numerics.subapertures import rates


@pytest.mark.parametrize("receiver_turns, share", [(None, 1.0), (0, 0.5), (1, 1.0)])
def test_directions_to_an_antenna_on_a_circle_change_by_its_chord(receiver_turns, share):
    angle = np.arange(50) * 0.01

    def circle(radius, turns):
        return radius * np.stack([np.cos(turns * angle), np.sin(turns * angle), 0 * angle], axis=1)

    tx = circle(3e3, 1)
    rx = tx if receiver_turns is None else circle(5e3, receiver_turns)
    track = PulseGeometry(tx, rx, runs=((0, 50),))
    for axes in (None, np.eye(3)[:2]):
        assert rates(track, np.zeros((1, 3)), axes) == pytest.approx([share * 2 * np.sin(0.005)], rel=1e-9)
    assert rates(track, np.zeros((1, 3)), np.array([[0, 0, 1.0], [0, 0, 1.0]])) == pytest.approx([0], abs=1e-12)
