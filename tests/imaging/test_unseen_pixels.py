"""Pixels that no row sees are counted, and a warning gives their share, the cause and the cure."""

from __future__ import annotations

import re
import warnings
from dataclasses import replace

import numpy as np
import pytest

import sarcl
from sarcl.base.constants import SPEED_OF_LIGHT


def rail(n_samples=64, step=5e6):
    """Echoes of a point at 20 m, 24 rows; reference_range 0: the window is -15 to 15 m."""
    tx = np.stack([np.zeros(24), np.linspace(-0.3, 0.3, 24), np.zeros(24)], axis=1)
    r = np.linalg.norm(tx - [20, 0, 0], axis=1)
    f = 9e9 + step * np.arange(n_samples)
    return sarcl.PhaseHistory(np.exp(-4j * np.pi / SPEED_OF_LIGHT * r[:, None] * f), 9e9, step, tx, 0.0)


GRID = sarcl.ImageGrid.plane(center=(15, 0, 0), shape=(8, 60), spacing=0.5)  # x: 0 to 29.5 m


def test_data_that_start_at_range_0_say_wrap_and_are_focused_with_it():
    raw = rail()
    half = SPEED_OF_LIGHT / (4 * 5e6)
    outside = (np.linalg.norm(raw.tx[:, None, None] - GRID.positions, axis=-1) > half).all(axis=0).mean()
    with pytest.warns(sarcl.SarclWarning, match=r"-14.9896 to 14.9896 m.*pass wrap=True for data that start") as caught:
        image = sarcl.backproject(raw, GRID)
    share = float(re.search(r"(\d+) % of the pixels|(\d+)% of the pixels", str(caught[0].message))[2]) / 100
    assert share == pytest.approx(outside, abs=0.006)
    count = round(outside * GRID.size)
    assert image.report.plan["pixels outside every range window"].startswith(f"{count} of {GRID.size} tried")
    with pytest.warns(sarcl.SarclWarning, match="of the pixels lie outside"):  # before the work too
        assert sarcl.plan(raw, GRID).plan["pixels outside every range window"].startswith(f"{count} of {GRID.size}")
    assert (image.data == 0).mean() == pytest.approx(outside, abs=1e-9)
    whole = sarcl.backproject(raw, GRID, wrap=True)  # no warning: it would be an error here
    assert np.unravel_index(np.abs(whole.data).argmax(), GRID.shape)[1] == 40


def test_a_grid_beside_the_window_says_move_it():
    raw = rail()
    phase = np.exp(4j * np.pi / SPEED_OF_LIGHT * 20 * (9e9 + 5e6 * np.arange(64)))
    raw = replace(raw, samples=raw.samples * phase, reference_range=20.0)
    with pytest.warns(
        sarcl.SarclWarning, match="of the pixels lie outside .* Move the grid into the window, or pass wrap"
    ):
        sarcl.backproject(raw, GRID)
    inside = sarcl.ImageGrid.plane(center=(20, 0, 0), shape=(8, 40), spacing=0.5)
    image = sarcl.backproject(raw, inside)
    assert "pixels outside every range window" not in image.report.plan


def test_of_records_in_time_nobody_is_told_to_make_them_so():
    """A record that starts at range 0 has a window from -c/(4 rate) on; dechirped ones are told of scene_range=."""
    tx = rail().tx
    far = sarcl.ImageGrid.plane(center=(60, 0, 0), shape=(8, 60), spacing=0.5)
    given = {"rate": 150e6, "start": 0.0, "carrier": 9e9, "tx": tx}
    record = sarcl.PhaseHistory.from_time(np.ones((24, 64), np.complex64), **given)
    assert record.reference_range[0] < SPEED_OF_LIGHT / (4 * record.frequency_step[0])
    with pytest.warns(sarcl.SarclWarning, match="Move the grid into the window, or pass wrap=True") as caught:
        sarcl.backproject(record, far)
    assert "from_time" not in str(caught[0].message)
    beats = {**given, "kind": "dechirped", "sweep_rate": 2e14, "beat": "positive"}
    with pytest.warns(
        sarcl.SarclWarning, match=r"pass wrap=True for data that start.*dechirped ones with scene_range="
    ):
        sarcl.backproject(sarcl.PhaseHistory.from_time(np.ones((24, 64), np.complex64), **beats), far)


def test_less_than_one_percent_is_counted_without_a_warning():
    raw = rail()
    grid = sarcl.ImageGrid.plane(center=(7, 0, 0), shape=(10, 32), spacing=0.5)  # the last column passes the window
    edge = sarcl.ImageGrid.points(np.concatenate([grid.positions.reshape(-1, 3)[:199], [[15.5, 0, 0]]]))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        image = sarcl.backproject(raw, edge)
    assert image.report.plan["pixels outside every range window"] == "1 of 200 tried, 0.5%"
