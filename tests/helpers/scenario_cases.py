"""A scenario file that simulates two points from an arc."""

from __future__ import annotations

SCENARIO = """\
[waveform.chirp]
center = 9.6e9
bandwidth = 300e6
duration = 1e-6

[trajectory.circle]
radius = 7e3
height = 5e3
arc = 0.03
n_pulses = 48

[[scene.points]]
positions = [[0, 0, 0], [3, 2, 0]]
amplitudes = [1, 0.1]
"""
