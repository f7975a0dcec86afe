"""An array, a track and a scene that several tests share, and the exact sum over the array's channels."""

from __future__ import annotations

import numpy as np

import sarcl
from sarcl.arrays.channels import channels_of, sampling
from sarcl.base.constants import SPEED_OF_LIGHT
from sarcl.model.antenna_array import AntennaArray

F0, STEP = 10e9, 20e6
TONE = sarcl.Waveform.tone(center=F0, duration=1 / STEP)
SCENE = sarcl.Scene.points([[0.0, 0, 0], [1.0, 2, 0.3], [-2, 0.5, -0.4]], [1.0, 0.7, 0.5j])
WINDOW = (-3.7, 3.7)
APART = {"zero reflectivity", "facing away", "range window", "out of beam"}  # every element by itself
EACH = APART | {"equal channels"}  # but nothing is interpolated between elements


def line(n=9, spacing=0.015, step=STEP, **options):
    return AntennaArray.linear(n, spacing=spacing, frequency_step=step, axis=(0, -1, 0), **options)


def passing(n=12, length=300.0, attitude=None):
    y = np.linspace(-length / 2, length / 2, n)
    return sarcl.Trajectory(np.arange(n) / 10, np.stack([np.full(n, -5e3), y, 0 * y + 800], axis=1), attitude=attitude)


def exact(raw, scene, waveform, array, track, receiver=None):
    """sum over channels and points at every sample of every row, complex128, from positions and carriers alone."""
    pulse = np.unique(raw.time, return_inverse=True)[1]
    f = raw.frequency[:, None] + raw.frequency_step[:, None] * np.arange(raw.n_samples)
    own = sampling(
        np.array([c.carrier for c in channels_of(array, waveform.center, len(track))]), waveform, *raw_window(raw), True
    )
    wanted = np.zeros(raw.samples.shape, np.complex128)
    for row in range(raw.n_rows):
        turn = np.eye(3) if track.attitude is None else track.attitude[pulse[row]]
        back = track if receiver is None else receiver
        turn_back = np.eye(3) if back.attitude is None else back.attitude[pulse[row]]
        heard = np.zeros(3) if raw.rx_channel is None else array.positions[raw.rx_channel[row]]
        if raw.rx_channel is not None and np.ptp(raw.rx_channel) == 0 and raw.rx_channel[row] == 0:
            heard = np.zeros(3)
        rx = (back.positions[pulse[row]] + turn_back @ heard).astype(np.longdouble)
        for n in range(array.n):
            if raw.tx_channel is not None and raw.tx_channel[row] != n:
                continue
            carrier = waveform.center + array.offsets_at(int(pulse[row]))[n]
            tx = (track.positions[pulse[row]] + turn @ array.positions[n]).astype(np.longdouble)
            x = scene.positions.astype(np.longdouble)
            path = np.sqrt(((tx - x) ** 2).sum(1)) + np.sqrt(((rx - x) ** 2).sum(1)) - 2 * raw.reference_range[row]
            turns = np.asarray(np.mod(np.outer(f[row], path / SPEED_OF_LIGHT), 1), np.float64)
            w = sarcl.Waveform.matched_spectrum(_moved(waveform, carrier), f[row])
            inside = np.abs(f[row] - carrier) <= own.width / 2 * own.step * (1 + 1e-9)
            wanted[row] += array.weights[n] * w * inside * (np.exp(-2j * np.pi * turns) @ scene.amplitudes)
    return wanted


def raw_window(raw):
    half = SPEED_OF_LIGHT / (4 * raw.frequency_step[0])
    return -half, half


def _moved(waveform, carrier):
    from dataclasses import replace

    return replace(waveform, center=carrier)


def error(raw, *arguments):
    wanted = exact(raw, *arguments)
    return np.linalg.norm(raw.samples - wanted) / np.linalg.norm(wanted)
