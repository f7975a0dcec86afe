"""Image of a wall on ground: the line that wall and ground make together stands at the foot of the wall."""

from __future__ import annotations

import numpy as np
import pytest

import sarcl

CELL = 0.5  # m, in slant range and along the wall
CHIRP = sarcl.Waveform.chirp(center=9.6e9, bandwidth=299_792_458.0 / (2 * CELL), duration=1e-6)
ARC = 299_792_458.0 / CHIRP.center / (2 * CELL)  # rad
WIDTH, HEIGHT = 3.0, 5.0  # m, of the wall
INCIDENCE, DISTANCE = np.radians(50), 10e3  # rad, m
SURFACES = {  # wall, ground, extent of the ground before the wall, m; that of 4 m lights 3.4 m of the wall
    "metal": ("metal", "metal", 20.0),
    "concrete": ("concrete", "dry soil", 20.0),
    "rough": (sarcl.Material(5.24, 0.28, height=3e-3, diagram="cos"), "dry soil", 20.0),
    "short ground": ("concrete", "moist soil", 4.0),
}


@pytest.mark.parametrize("surface", SURFACES)
def test_the_line_of_a_wall_stands_at_its_foot(surface):
    wall, ground, extent = SURFACES[surface]
    y = WIDTH / 2
    quads = np.array(
        [
            [(0, -y, 0), (0, y, 0), (0, y, HEIGHT), (0, -y, HEIGHT)],
            [(0, -10, 0), (extent, -10, 0), (extent, 10, 0), (0, 10, 0)],
        ],
        float,
    )
    scene = sarcl.Scene.facets(
        quads[:, [[0, 1, 2], [0, 2, 3]]].reshape(-1, 3, 3), material=[0, 0, 1, 1], materials=[wall, ground]
    )
    track = sarcl.Trajectory.circle(
        radius=DISTANCE * np.sin(INCIDENCE), height=DISTANCE * np.cos(INCIDENCE), start=-ARC / 2, arc=ARC, n_pulses=32
    )
    raw = sarcl.echo(scene, CHIRP, track, bounces=2, tolerance=1e-2, reference=(0, 0, 0), range_window=(-6, 6))
    grid = sarcl.ImageGrid.plane(shape=(21, 81), spacing=(0.1, 0.05))
    power = np.abs(sarcl.backproject(raw, grid, window="hamming", tolerance=1e-3).data) ** 2
    x = grid.positions[0, :, 0]
    line = power @ x / power.sum(axis=1)  # m, at each place along the wall
    assert power.max(axis=1).min() > 0.1 * power.max()  # a line, as long as the part of the wall that is shown
    assert np.abs(line).max() * np.sin(INCIDENCE) < CELL / 10
