"""Shadows of terrain obey geometry at any distance."""

from __future__ import annotations

import numpy as np
import pytest
from helpers.cases import thinned

import sarcl
from sarcl.scene.terrain import above
from sarcl.scene.triangles import centroids, normals
from sarcl.visibility.illumination import lit


def facets_of(grid):
    return sarcl.Scene.from_heights(*grid).triangles


def shares(device, triangles, eye):
    """Shares of facets that an antenna sees from the front, uint8 (k,)."""
    return lit(triangles, np.array([eye], float), two_sided=False, device=device).share(0)


def walled(wall, n=241, size=240.0):
    """Flat ground with height `wall(x, y)` on it."""
    x = np.linspace(-size / 2, size / 2, n)
    return x, x, wall(*np.meshgrid(x, x))


@pytest.mark.parametrize("side, turned", thinned([1, -1], [False, True]))
def test_a_ridge_shadows_the_ground_up_to_where_the_line_over_its_top_ends(device, turned, side):
    """A radar H high sees over a ridge h high, g away, what is beyond g H/(H - h): not a plane wave's h tan."""
    h, high, g = 20.0, 100.0, 90.0
    grid = walled(lambda x, y: np.where((y if turned else x) == side * -10.0, h, 0.0))
    eye = np.array([side * 80.0, 0.3, high])
    if turned:
        eye = eye[[1, 0, 2]]
    triangles = facets_of(grid)
    share = shares(device, triangles, eye) / 255
    place = centroids(triangles)[:, :: -1 if turned else 1][:, 1 if turned else 0] * -side  # outwards from the centre
    end = g * high / (high - h) - 80.0
    assert 100 * h / high > 15 and end == pytest.approx(32.5)
    assert (share[(place > 11.5) & (place < end - 1)] == 0).all() and (share[place > end + 1] == 1).all()
    assert (share[place < 8.5] == 1).all()


def test_a_ring_wall_shadows_a_ring_around_the_point_under_the_radar(device):
    h, high, radius = 10.0, 50.0, 40.0
    grid = walled(lambda x, y: np.where(np.abs(np.hypot(x, y) - radius) < 1.0, h, 0.0))
    triangles = facets_of(grid)
    share = shares(device, triangles, [0, 0, high])
    away = np.hypot(*centroids(triangles)[:, :2].T)
    assert (share[(away > radius + 2.6) & (away < radius * high / (high - h) - 2)] == 0).all()
    assert (share[(away < radius - 2.6) | (away > radius * high / (high - h) + 2)] == 255).all()


@pytest.mark.parametrize("elevation, tilt", thinned([0.5, 3, 30, 88], [[0, 0], [0.004, -0.003], [0.2, -0.3]]))
def test_nothing_is_hidden_on_a_plane(device, elevation, tilt):
    x, y = np.linspace(-90, 90, 91), np.linspace(-50, 70, 131)
    z = tilt[0] * x + tilt[1] * y[:, None] + 400
    triangles = facets_of((x, y, z))
    for azimuth in (0, 33, 90, 200):
        a, e = np.deg2rad([azimuth, elevation])
        for distance in (300, 1e4, 3.6e7):
            eye = distance * np.array([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)]) + np.array([0, 0, 400])
            if (normals(triangles[:1]) @ (eye - triangles[0, 0]))[0] < 0 or above((x, y, z), eye[None])[0] < 0:
                continue
            assert (shares(device, triangles, eye) == 255).all()


def test_a_house_on_terrain_and_the_terrain_shadow_one_another(device):
    grid = walled(lambda x, y: np.where(x == 20.0, 15.0, 0.0), n=121)
    terrain = facets_of(grid)
    floor = np.array([[-4.0, -4, 0], [4, -4, 0], [4, 4, 0], [-4, 4, 0]])
    roof = floor + np.array([0, 0, 6.0])
    walls = [[floor[i], floor[i - 1], roof[i]] for i in range(4)] + [
        [floor[i - 1], roof[i - 1], roof[i]] for i in range(4)
    ]
    house = np.array([*walls, roof[[0, 1, 2]], roof[[0, 2, 3]]])
    scene = np.concatenate([terrain, house])
    eye = np.array([9e3, 0.5, 9e3])  # 45 deg: the ridge's shadow ends at x = 5, the house's at x = -10
    share = shares(device, scene, eye)
    place = centroids(terrain)
    in_line = np.abs(place[:, 1]) < 3
    x, ground = place[:, 0], share[: len(terrain)]
    assert (ground[in_line & (x > 6.5) & (x < 17)] == 0).all()
    assert (ground[in_line & (x > -8.5) & (x < -4.1)] == 0).all()
    assert (ground[in_line & (x < -12)] == 255).all() and (share[-2:] == 255).all()
    # 20 deg lower the ridge's shadow covers a part of the house too
    low = shares(device, scene, [9e3, 0.5, 9e3 * np.tan(np.deg2rad(25))])
    assert (low[len(terrain) :] < 255).any() and (low[-2:] > 0).any()
    alone = shares(device, terrain, eye)
    assert (alone[in_line & (x > -8.5) & (x < -4.1)] == 255).all()


def test_heights_above_the_terrain_are_those_above_its_triangles():
    random, axis = np.random.default_rng(0), np.linspace(-10, 12, 20)
    grid = axis, 1.1 * axis, random.normal(size=(20, 20))
    triangles = facets_of(grid)
    weight = random.dirichlet([1, 1, 1], len(triangles))
    points = np.einsum("kc,kci->ki", weight, triangles) + np.array([0, 0, 2.5])
    assert above(grid, points) == pytest.approx(2.5, abs=1e-9)
    assert np.isinf(above(grid, np.array([[1e3, 0, 0.0]])))
