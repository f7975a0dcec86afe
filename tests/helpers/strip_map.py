"""A strip map at C band with a down-chirp and squint: points that a beam with sharp edges lights while it passes."""

from __future__ import annotations

import numpy as np

import sarcl
from sarcl.base.constants import SPEED_OF_LIGHT

CARRIER, BANDWIDTH, DURATION, RATE = 5.3e9, 60e6, 10e-6, 75e6
NEAR, SQUINT, ANGLE = 10e3, 0.1, 0.03  # m; rad; rad, full angle of the beam
N_ROWS, STEP = 1200, 0.75  # rows, m along y
DIRECTION = np.array([np.cos(SQUINT), np.sin(SQUINT), 0.0])
BEAM = (ANGLE, DIRECTION)
TX = np.stack([np.zeros(N_ROWS), (np.arange(N_ROWS) - N_ROWS / 2) * STEP, np.zeros(N_ROWS)], axis=1)
AHEAD = NEAR * np.tan(SQUINT)  # m along y from the antenna to the point in the middle of its beam
# m along y about AHEAD: the first and the last of the fully seen part, and two between
PLACES = (-280.0, -120.0, 60.0, 270.0)
POINTS = np.array([[NEAR + dx, AHEAD + y, 0.0] for dx, y in zip((-20.0, 15.0, 0.0, 8.0), PLACES, strict=True)])


def seen(points, tx=TX, angle=ANGLE):
    """Whether rows see points: bool (n, n_rows), in the formula of the beam."""
    away = points[:, None] - tx
    return away @ DIRECTION >= np.cos(angle / 2) * np.linalg.norm(away, axis=-1)


def history(points=POINTS, lit=True):
    """Echoes of unit points, compressed from raw records of the down-chirp; lit: each row only of those in its beam."""
    pulse = sarcl.Waveform.chirp(center=CARRIER, bandwidth=BANDWIDTH, duration=DURATION, down=True)
    reach = np.linalg.norm(points[:, None] - TX, axis=-1)
    delay = 2 * reach / SPEED_OF_LIGHT
    start = delay.min() - 1e-6
    t = start + np.arange(int((np.ptp(delay) + DURATION + 2e-6) * RATE)) / RATE
    record = np.zeros((N_ROWS, len(t)), np.complex128)
    for k in range(len(points)):
        since = t - delay[k][:, None] - DURATION / 2
        inside = (np.abs(since) < DURATION / 2) & (seen(points[k : k + 1])[0][:, None] | (not lit))
        row, column = np.nonzero(inside)
        phase = np.pi * pulse.sweep_rate * since[row, column] ** 2 - 2 * np.pi * CARRIER * delay[k][row]
        record[row, column] += np.exp(1j * phase)
    raw = sarcl.PhaseHistory.from_time(
        record, rate=RATE, start=start, tx=TX, kind="chirped", waveform=pulse, time=np.arange(N_ROWS) / 100
    )
    return sarcl.compress(raw)


def unit_points(points=POINTS, n_samples=256):
    """Echoes of unit points from the image equation: every sample has modulus 1, and each row those in its beam."""
    frequency = CARRIER + (np.arange(n_samples) - (n_samples - 1) / 2) * BANDWIDTH / n_samples
    reference = NEAR / np.cos(SQUINT)
    samples = np.zeros((N_ROWS, n_samples), np.complex128)
    for point, lit in zip(points, seen(points), strict=True):
        path = np.linalg.norm(TX[lit] - point, axis=1) - reference
        samples[lit] += np.exp(-4j * np.pi / SPEED_OF_LIGHT * path[:, None] * frequency)
    return sarcl.PhaseHistory(
        samples.astype(np.complex64), frequency=frequency[0], frequency_step=BANDWIDTH / n_samples, tx=TX,
        reference_range=reference, time=np.arange(N_ROWS) / 100,
    )  # fmt: skip


def scene_grid(along=0.35, across=1.0):
    """One grid that holds all points, and 28 m beyond them."""
    y = AHEAD + np.mean(PLACES[:: len(PLACES) - 1])
    return sarcl.ImageGrid.plane(
        center=(NEAR, y, 0), shape=(int(606 / along), int(96 / across)), spacing=(along, across)
    )
