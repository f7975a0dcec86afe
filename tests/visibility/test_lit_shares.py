"""Shares of facets and pixels that antennas see, for labels and masks: against closed forms."""

from __future__ import annotations

import numpy as np
import pytest

import sarcl
from sarcl.scene.triangles import areas
from sarcl.visibility.illumination import facet_shares, pixel_shares

FAR = 1e5


def track(incidence=0.6, n=9, arc=0.3, azimuth=0.0):
    turn = azimuth + np.linspace(-arc / 2, arc / 2, n)
    sight = np.c_[np.sin(incidence) * np.cos(turn), np.sin(incidence) * np.sin(turn), np.full(n, np.cos(incidence))]
    return sarcl.Trajectory(np.arange(n) / 100, FAR * sight)


def plates(width=0.5, height=1.0, wide=6.0):
    return sarcl.shapes.plate((wide, wide)) + sarcl.shapes.plate((width, width)).moved((0, 0, height))


def shadow_of(antenna, width, height):
    """Least and largest (x, y) of the shadow of a square of side `width`, m, at a height, on z = 0."""
    stretch = antenna[2] / (antenna[2] - height)
    middle = -antenna[:2] * height / (antenna[2] - height)
    return middle - stretch * width / 2, middle + stretch * width / 2


def test_the_dark_area_of_a_plate_is_that_of_the_shadow_at_every_pulse(device):
    scene, looks = plates(), track()
    shares = facet_shares(scene, looks, device=device)
    assert shares.shape == (9, 4) and shares.dtype == np.float32
    for antenna, share in zip(looks.positions, shares, strict=True):
        low, high = shadow_of(antenna, 0.5, 1.0)
        dark = ((1 - share) * areas(scene.triangles))[:2].sum()
        assert dark == pytest.approx(np.prod(high - low), rel=1e-5)
        assert (share[2:] == 1).all()


def test_faces_of_a_box_that_are_turned_away_are_dark_and_two_sided_ones_are_not():
    box, looks = sarcl.shapes.box((1, 1, 1)), track(n=3, azimuth=0.7)
    shares = facet_shares(box, looks)
    assert set(np.unique(shares)) == {0, 1} and (shares.sum(axis=1) == 6).all()  # three faces of two facets each
    sheet = sarcl.shapes.plate((1, 1), two_sided=True)
    under = sarcl.Trajectory(looks.times, -looks.positions)
    assert (facet_shares(sheet, under) == 1).all()


def test_a_plate_under_a_larger_one_is_dark_at_every_pulse():
    shares = facet_shares(plates(width=6.0, height=0.5, wide=1.0), track(incidence=0.2))
    assert (shares[:, :2] == 0).all() and (shares[:, 2:] == 1).all()


def test_two_antennas_must_both_see_a_part():
    scene, looks = plates(), track(n=3)
    other = sarcl.Trajectory(looks.times, looks.positions * [-1, 1, 1])
    both = facet_shares(scene, looks, receiver=other)
    one, two = facet_shares(scene, looks), facet_shares(scene, other)
    # the shadows lie apart
    dark = [((1 - share) * areas(scene.triangles))[:, :2].sum(axis=1) for share in (both, one, two)]
    np.testing.assert_allclose(dark[0], dark[1] + dark[2], rtol=1e-5)


def test_pixels_are_dark_where_the_shadow_falls_and_half_lit_where_it_passes(device):
    scene, looks = plates(), track()
    grid = sarcl.ImageGrid.plane(shape=(80, 90), spacing=(0.05, 0.05))
    share = pixel_shares(scene, grid, looks, device=device)
    wanted, edge = np.zeros(grid.shape), np.zeros(grid.shape, bool)
    x, y = grid.positions[..., 0], grid.positions[..., 1]
    for antenna in looks.positions:
        low, high = shadow_of(antenna, 0.5, 1.0)
        inside = np.minimum.reduce([x - low[0], high[0] - x, y - low[1], high[1] - y])
        wanted += inside < 0
        edge |= np.abs(inside) < 2e-5
    np.testing.assert_allclose(share[~edge], (wanted / 9)[~edge], atol=1e-6)
    assert share.shape == grid.shape and 0 < (share == 0).sum() and ((share > 0) & (share < 1)).any()


def test_pixels_in_a_room_are_seen_from_within_it():
    """Viewpoints inside the scene, which a plane of perspective does not hold."""
    scene = sarcl.shapes.box((8, 8, 3)) + sarcl.shapes.plate((1, 1)).moved((0, 0, 1.0))
    inside = sarcl.Trajectory(np.arange(4) / 10, [[0.1 * i, 0.2, 2.0] for i in range(4)])
    grid = sarcl.ImageGrid.plane(shape=(61, 61), spacing=(0.1, 0.1))
    share = pixel_shares(scene, grid, inside)
    x, y = grid.positions[..., 0], grid.positions[..., 1]
    wanted, edge = np.zeros(grid.shape), np.zeros(grid.shape, bool)
    for antenna in inside.positions:
        low, high = shadow_of(antenna, 1.0, 1.0)
        beyond = np.minimum.reduce([x - low[0], high[0] - x, y - low[1], high[1] - y])
        wanted += beyond < 0
        edge |= np.abs(beyond) < 1e-4
    np.testing.assert_allclose(share[~edge], (wanted / 4)[~edge], atol=1e-6)


def test_empty_cells_stay_empty_and_bad_input_is_named():
    scene, looks = plates(), track(n=3)
    places = np.zeros((2, 2, 3))
    places[0, 0] = np.nan
    places[1, 1] = (2.0, 2.0, 0.0)
    share = pixel_shares(scene, sarcl.ImageGrid.points(places), looks)
    assert np.isnan(share[0, 0]) and share[1, 1] == 1
    points = sarcl.Scene.points([[0, 0, 0]])
    with pytest.raises(ValueError, match="scene has no facets"):
        facet_shares(points, looks)
    with pytest.raises(ValueError, match="scene has no facets"):
        pixel_shares(points, sarcl.ImageGrid.plane(shape=(2, 2), spacing=(1, 1)), looks)
    with pytest.raises(ValueError, match="receiver has 2 positions but track has 3"):
        facet_shares(scene, looks, receiver=looks.picked(slice(2)))
    with pytest.raises(ValueError, match="tolerance"):
        pixel_shares(scene, sarcl.ImageGrid.plane(shape=(2, 2), spacing=(1, 1)), looks, tolerance=0)
    with pytest.raises(TypeError, match="scene"):
        facet_shares(None, looks)
