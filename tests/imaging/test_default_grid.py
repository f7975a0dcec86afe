"""The default grid of `sarcl focus`, chosen from the data."""

import numpy as np
import pytest

import sarcl
from sarcl import default_grid
from sarcl.base.constants import SPEED_OF_LIGHT
from sarcl.imaging.default_grid import choose_grid, needs_side


def seen(track, point, n_samples=64, bandwidth=300e6):
    r = np.linalg.norm(track.positions - point, axis=1)
    samples = np.ones((len(track), n_samples), np.complex64)
    return sarcl.PhaseHistory(samples, 9.6e9 - bandwidth / 2, bandwidth / n_samples, track.positions, r)


ARC = sarcl.Trajectory.circle(radius=7e3, height=5e3, start=-0.03, arc=0.06, n_pulses=2500)
ROUND = sarcl.Trajectory.circle(radius=7e3, height=5e3, arc=6.2, n_pulses=1000)
PASS = sarcl.Trajectory.line(start=(-9e3, -500, 5e3), velocity=(0, 100, 0), prf=50.0, n_pulses=512)


@pytest.mark.parametrize(
    ("track", "point", "center"),
    [
        (ARC, (0, 0, 0), (0, 0, 0)),
        (ARC, (100, 20, 0), (100, 20, 0)),
        (PASS, (300, 20, 0), (300, 20, 0)),
        (ROUND, (10, 20, 30), (10, 20, 30)),  # seen from all around, the height is known too
    ],
)
def test_the_default_grid_lies_where_the_reference_ranges_meet(track, point, center):
    np.testing.assert_allclose(default_grid(seen(track, point)).center, center, atol=2e-3)


def test_the_default_pixels_are_half_the_resolution_on_the_ground():
    grid = default_grid(seen(ARC, (0, 0, 0)))
    grazing = np.arctan2(5, 7)
    across = 0.886 * SPEED_OF_LIGHT / 9.6e9 / (2 * 0.06 * np.cos(grazing))
    along = 0.886 * SPEED_OF_LIGHT / (2 * 300e6 * np.cos(grazing))
    assert grid.spacing[0] == pytest.approx(across / 2, rel=0.05)
    assert grid.spacing[1] == pytest.approx(along / 2, rel=0.05)


def test_the_default_size_is_what_is_unambiguous_but_1024_pixels_at_most():
    few, many = (default_grid(seen(ARC, (0, 0, 0), n_samples=n)) for n in (64, 20_000))
    swath = SPEED_OF_LIGHT / (2 * 300e6 / 64) / np.cos(np.arctan2(5, 7))
    assert few.shape[1] * few.spacing[1] == pytest.approx(swath, rel=0.02)
    assert max(many.shape) == 1024


@pytest.mark.parametrize("n_samples", [1, 64])
def test_one_pulse_or_one_sample_still_gets_a_grid(n_samples):
    track = sarcl.Trajectory.circle(radius=7e3, height=5e3, arc=1.0, n_pulses=1)
    grid = default_grid(seen(track, (0, 0, 0), n_samples=n_samples))
    assert grid.size >= 1 and np.isfinite(grid.bounds).all()


def test_what_the_caller_names_is_kept():
    grid = choose_grid(seen(ARC, (0, 0, 0)), center=(1, 2, 3), shape=(5, 6), normal=(0, 1, 0)).grid
    assert grid.center.tolist() == [1, 2, 3] and grid.shape == (5, 6)
    np.testing.assert_allclose(grid.normal, (0, 1, 0), atol=1e-12)


@pytest.mark.parametrize("side", ["right", "left"])
def test_the_grid_of_an_orbit_touches_the_ellipsoid_where_the_ranges_meet(side):
    orbit = sarcl.Orbit.kepler(7.171e6, 0.001, 1.72, span=(-60, 60))
    point = orbit.geolocate(0.1, 1e6, heights=150.0, side=side)
    track = orbit.trajectory(start=0.0, prf=1000.0, n_pulses=200)
    raw = seen(track, point, bandwidth=100e6)
    assert needs_side(raw) and not needs_side(seen(ARC, (0, 0, 0)))
    grid = default_grid(raw, side=side, heights=150.0)
    assert np.linalg.norm(grid.center - point) < 1e-3
    up = sarcl.wgs84.up(*sarcl.wgs84.geodetic(point)[:2])
    assert grid.normal == pytest.approx(up, abs=1e-9) and abs(grid.x_axis[2]) < 1e-9
    longitude, latitude, _ = sarcl.wgs84.geodetic(point)
    level = sarcl.ElevationModel(longitude + np.array([-1, 1]), latitude + np.array([-1, 1]), np.full((2, 2), 150.0))
    assert np.linalg.norm(default_grid(raw, side=side, heights=level).center - point) < 1e-3
    given = default_grid(raw, center=point + 5 * up)  # the side does not matter
    assert given.normal == pytest.approx(up, abs=1e-9)
    with pytest.raises(ValueError, match="on either side of the track; give side='left' or 'right'"):
        default_grid(raw)
    # far away in local coordinates the origin is the scene
    far = sarcl.Trajectory.circle(radius=5e6, height=6e6, start=-0.03, arc=0.06, n_pulses=50)
    assert default_grid(seen(far, (0, 0, 0))).center.tolist() == [0, 0, 0]


def test_the_default_grid_is_a_public_verb_that_teaches():
    with pytest.raises(TypeError, match=r"raw is a int; wanted a sarcl\.PhaseHistory"):
        sarcl.default_grid(3)
    raw = seen(ARC, (0, 0, 0))
    assert sarcl.backproject(raw, sarcl.default_grid(raw, shape=8)).grid.shape == (8, 8)
