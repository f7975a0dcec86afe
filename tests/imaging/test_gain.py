"""The gain of an image: in every pixel the sum of the weights of the rows that saw it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from helpers import strip_map
from helpers.cases import noise_history

import sarcl
from sarcl.base.constants import SPEED_OF_LIGHT
from sarcl.reference.backproject import backproject as exact


def gain_of(raw, grid, **options):
    return sarcl.backproject(raw, grid, **({"tolerance": 0.1} | options), check=False).gain


def by_hand(raw, points, beam=None, weights=None, wrap=False):
    """sum_p v_p(x) w_p n_samples of points, m (n, 3), row by row."""
    total = np.zeros(len(points))
    for p in range(raw.n_rows):
        there, back = (np.linalg.norm(points - end[p], axis=1) for end in (raw.tx, raw.rx))
        inside = np.abs((there + back) / 2 - raw.reference_range[p]) <= SPEED_OF_LIGHT / (4 * raw.frequency_step[p])
        inside |= wrap
        if beam is not None:
            toward = np.broadcast_to(beam[1], (raw.n_rows, 3))[p] / np.linalg.norm(np.broadcast_to(beam[1], (3,)))
            inside &= (points - raw.tx[p]) @ toward >= np.cos(beam[0] / 2) * there
        total += inside * (1 if weights is None else weights[p])
    return total * raw.n_samples


def strip(n_samples=4, n_rows=300, wide=75.0, step=3.0):
    """A strip map without echoes, in a range window `wide` m wide."""
    along = (np.arange(n_rows) - n_rows / 2) * step
    tx = np.stack([0 * along, along, 0 * along + 500], axis=1)
    return sarcl.PhaseHistory(
        np.zeros((n_rows, n_samples), np.complex64),
        frequency=5.3e9,
        frequency_step=SPEED_OF_LIGHT / 2 / wide,
        tx=tx,
        reference_range=np.hypot(5000.0, 500.0),
    )


GRID = sarcl.ImageGrid.plane(center=(5000, 40, 0), shape=(70, 90), spacing=(5.0, 1.0))
LISTED = sarcl.ImageGrid.points(
    GRID.positions[::2, ::2] + np.random.default_rng(0).uniform(-1, 1, (35, 45, 3)),
    valid=np.random.default_rng(1).uniform(size=(35, 45)) > 0.2,
)
LOOK = (0.04, (5000.0, 300.0, -500.0))


@pytest.mark.parametrize("grid", [GRID, LISTED], ids=["plane", "points"])
@pytest.mark.parametrize("beam", [None, LOOK], ids=["window", "beam"])
@pytest.mark.parametrize("bistatic", [False, True], ids=["monostatic", "bistatic"])
@pytest.mark.parametrize("wrap", [False, True], ids=["", "wrap"])
def test_the_gain_is_the_sum_of_the_weights_of_the_rows_that_saw_the_pixel(grid, beam, bistatic, wrap):
    raw = strip()
    if bistatic:
        raw = replace(raw, rx=raw.tx + np.array([30.0, 60.0, 0.0]))
    weights = np.random.default_rng(2).uniform(0.5, 1, raw.n_rows)
    gain = gain_of(raw, grid, weights=weights, wrap=wrap, beam=beam)
    if beam is None and wrap:
        assert gain == pytest.approx(weights.sum() * raw.n_samples)
        return
    assert gain.shape == grid.shape and gain.dtype == np.float32
    index, points = grid.sample(2000, seed=4)
    wanted = by_hand(raw, points, beam, weights, wrap)
    assert np.ptp(wanted) > 0.1 * wanted.max()
    assert gain[index] == pytest.approx(wanted, rel=1e-6)
    if grid.empty is not None:
        assert not gain[grid.empty].any()


def test_a_unit_point_has_the_gain_as_its_value():
    # the closed form: at its own place every sample of a unit point adds in phase, in those rows alone that see it
    raw = strip_map.history()
    small = sarcl.ImageGrid.points(strip_map.POINTS)
    gain = gain_of(raw, small, beam=strip_map.BEAM, tolerance=1e-8)
    for point, g in zip(strip_map.POINTS, gain, strict=True):
        path = np.linalg.norm(raw.tx - point, axis=1) - raw.reference_range
        f = raw.frequency[:, None] + raw.frequency_step[:, None] * np.arange(raw.n_samples)
        lit = strip_map.seen(point[None])[0][:, None]
        unit = replace(raw, samples=lit * np.exp(-4j * np.pi / SPEED_OF_LIGHT * f * path[:, None]))
        value = exact(unit, point[None], beam=strip_map.BEAM)[0][0]
        assert abs(value) == pytest.approx(g, rel=1e-9)
        assert g < 0.4 * raw.samples.size  # about a third of the rows sees it


def test_a_gain_that_does_not_vary_is_a_number():
    raw, far = strip(), sarcl.ImageGrid.plane(center=(5e4, 0, 0), shape=(8, 8), spacing=1.0)
    wide = strip(wide=3000.0)
    for beam, grid, of in ((None, GRID, wide), ((np.pi, LOOK[1]), GRID, wide), (None, far, raw)):
        gain = gain_of(of, grid, beam=beam)
        assert gain == of.samples.size  # also where no pixel is seen, and the image is zero
        assert isinstance(gain, float)
    assert isinstance(gain_of(raw, GRID), np.ndarray)


@pytest.mark.parametrize("method", ["direct", "factorized"])
def test_every_method_gives_the_same_gain(method, tmp_path):
    raw = strip(n_rows=400, wide=600.0, step=0.15)
    raw = replace(raw, samples=np.random.default_rng(5).standard_normal(raw.samples.shape) + 0j)
    grid, beam = (
        sarcl.ImageGrid.plane(center=(5000, 40, 0), shape=(128, 128), spacing=0.5),
        (0.01, (5000.0, 40.0, -500.0)),
    )
    wanted = by_hand(raw, grid.positions.reshape(-1, 3), beam).reshape(grid.shape)
    assert np.ptp(wanted) > 0
    image = sarcl.backproject(raw, grid, method=method, beam=beam, tolerance=1e-1, out=tmp_path / "a.h5")
    assert image.report.plan["method"] == method
    assert np.array_equal(image.gain, wanted)  # as it was in the file
    if method == "direct":
        fine = sarcl.backproject(raw, grid.part(slice(0, 8)), beam=beam, tolerance=1e-8)
        assert fine.gain.dtype == np.float64 and np.array_equal(fine.gain, wanted[:8])


def test_a_gain_without_memory_is_refused_before_any_work():
    side = 2**28
    grid = sarcl.ImageGrid.plane(shape=(side, side), spacing=0.1)
    with pytest.raises(MemoryError, match="the gain of 268435456 x 268435456 pixels"):
        sarcl.backproject(noise_history(), grid, out="never.h5", beam=0.1)
