"""An FMCW radar on a rail, with a leak from transmitter to receiver: beat samples in, calibrated points out."""

from __future__ import annotations

import numpy as np
import pytest

import sarcl
from sarcl.base.constants import SPEED_OF_LIGHT

N, CARRIER, BANDWIDTH, RATE = 256, 24e9, 1.5e9, 1e6
SWEEP = BANDWIDTH * RATE / N  # Hz/s
TX = np.stack([np.zeros(160), np.linspace(-0.48, 0.48, 160), np.zeros(160)], axis=1)
POINTS = np.array([[3.0, 0.3, 0.0], [4.2, -0.5, 0.0], [3.6, 0.6, 0.0]])
LEAK = 0.3, 10.0  # m of half a path, 20 dB above a point
GRID = sarcl.ImageGrid.plane(center=(3.6, 0, 0), shape=(200, 100), spacing=(0.012, 0.03))


def beats(form, leak):
    """What is recorded: the echo times the sweep that is sent, by the phase of the sweep alone."""
    t = (np.arange(N) - N / 2) / RATE
    ranges = [np.linalg.norm(TX - point, axis=1) for point in POINTS]
    echoes = [(r, 1.0) for r in ranges] + ([(np.full(len(TX), LEAK[0]), LEAK[1])] if leak else [])
    total = np.zeros((len(TX), N), np.complex128)
    for distance, amplitude in echoes:
        tau = 2 * distance[:, None] / SPEED_OF_LIGHT
        total += amplitude * np.exp(2j * np.pi * (CARRIER * tau + SWEEP * tau * t - SWEEP * tau**2 / 2))
    return {"positive": total, "negative": total.conj(), "real": total.real}[form]


def history(form, leak=True):
    return sarcl.PhaseHistory.from_time(
        beats(form, leak), rate=RATE, start=-N / 2 / RATE, carrier=CARRIER, tx=TX, kind="dechirped", sweep_rate=SWEEP,
        beat=None if form == "real" else form, scene_range=3.6,
    )  # fmt: skip


def levels(raw):
    """dBsm of the points, where they are."""
    image = sarcl.backproject(raw, GRID, window="hamming", tolerance=1e-3)
    seen = sarcl.measure(image, near=POINTS)
    for point, one in zip(POINTS, seen, strict=True):
        assert np.linalg.norm(one.position - point) < 0.01
    return np.array([10 * np.log10(one.rcs) for one in seen])


@pytest.mark.parametrize("form", ["positive", "negative", "real"])
def test_points_read_0_dbsm_beside_a_leak_of_20_db(form):
    found = levels(history(form))
    print(f"{form}: {found.round(3)} dBsm")
    assert found == pytest.approx(0, abs=0.05)


def test_autofocus_leaves_them_as_they_are():
    raw = history("positive")
    better, errors = sarcl.autofocus(raw, GRID)
    assert levels(better) == pytest.approx(levels(raw), abs=0.1), errors
