"""Shadows: what one ray a facet sees equals the test of every ray against every facet, and obeys geometry.

Shares of facets, blocks of pulses and outlines of bodies: test_illumination.py. Terrain: test_terrain_shadow.py.
"""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from helpers.cases import thinned

import sarcl
from sarcl.opencl.choose_device import open_device
from sarcl.reference.shadow import hidden
from sarcl.scene.triangles import centroids, normals
from sarcl.visibility._frame import DevicePoints, Frame
from sarcl.visibility._ray_casting import Occluders

TOLERANCE = {
    "borderline": (0.0, 4.0),  # times the height at which rays start, 1e-6 of the scene: float32 places are as coarse
}
DISTANCES = [60.0, 10e3, 800e3, 36e6]


def direction(azimuth_deg, incidence_deg):
    a, i = np.deg2rad(azimuth_deg), np.deg2rad(incidence_deg)
    return np.array([np.sin(i) * np.cos(a), np.sin(i) * np.sin(a), np.cos(i)])


def seen_centroids(device, triangles, viewpoint, *, by_rays=False):
    """True (k,) where a viewpoint, m (3,), sees the centroid of a facet, m (k, 3, 3); by_rays  through a tree."""
    opened = open_device(device)
    frame = Frame.around(triangles.reshape(-1, 3))
    points = DevicePoints(opened, centroids(triangles), frame, normals(triangles))
    return points.seen(Occluders(opened, triangles, frame, 0 if by_rays else len(triangles)), [viewpoint])


def visible(triangles, viewpoint, *, device):
    """Whether nothing occludes the centroid of each facet."""
    return seen_centroids(device, triangles, viewpoint)


def disagreements(triangles, viewpoint, device):
    """Facets on which kernel and reference differ although a somewhat different allowance changes nothing."""
    lift = Frame.around(triangles.reshape(-1, 3)).lift
    near, far = (hidden(triangles, viewpoint, lift=lift * times)[:, 0] for times in TOLERANCE["borderline"])
    seen = visible(triangles, viewpoint, device=device)
    return ((seen == near) & (near == far)).sum()


def ground(n=40, size=40.0, height=0.0):
    """Flat ground of 2 n^2 facets."""
    x = np.linspace(-size / 2, size / 2, n + 1)
    return sarcl.Scene.from_heights(x, x, np.full((n + 1, n + 1), height)).triangles


def plate(low, high, height):
    """A level rectangle of two facets."""
    (x0, y0), (x1, y1) = low, high
    a, b, c, d = ([x0, y0, height], [x1, y0, height], [x1, y1, height], [x0, y1, height])
    return np.array([[a, b, c], [a, c, d]], float)


@pytest.mark.parametrize(
    "n, size, distance",
    thinned([(1, 1.0), (2, 2.0), (31, 3.0), (33, 0.2), (400, 0.5), (300, 2.0)], DISTANCES),
)
def test_visible_is_what_the_reference_does_not_hide_in_random_soups(device, distance, n, size):
    random = np.random.default_rng(n)
    for incidence in (10, 50, 120):
        triangles = random.uniform(-5, 5, (n, 1, 3)) + size * random.standard_normal((n, 3, 3))
        viewpoint = distance * direction(random.uniform(0, 360), incidence)
        assert disagreements(triangles, viewpoint, device) == 0


@pytest.mark.parametrize("distance", DISTANCES)
def test_visible_is_what_the_reference_does_not_hide_for_a_sphere_over_ground(device, distance):
    sphere = trimesh.creation.icosphere(subdivisions=2, radius=4).triangles + np.array([1, 2, 5])
    scene = np.concatenate([ground(14), sphere])
    viewpoint = distance * direction(25, 40)
    assert disagreements(scene, viewpoint, device) == 0
    seen = visible(scene, viewpoint, device=device)
    assert 0.4 < seen[-len(sphere) :].mean() < 0.6 and 0.8 < seen[: -len(sphere)].mean() < 0.99


def test_the_far_side_of_a_sphere_is_dark(device):
    sphere = trimesh.creation.icosphere(subdivisions=4, radius=4).triangles
    look = direction(70, 55)
    facing = centroids(sphere) @ look / 4
    seen = visible(sphere, 36e6 * look, device=device)
    assert seen[facing > 0.05].all() and not seen[facing < -0.05].any()


@pytest.mark.parametrize("incidence", [20, 45, 70])
@pytest.mark.parametrize("azimuth", [0, 90, 200])
def test_a_plate_hides_its_outline_moved_by_height_times_tangent_of_incidence(device, azimuth, incidence):
    height, low, high = 3.3, np.array([-4.05, -2.05]), np.array([3.05, 5.05])
    floor = ground(80, 40)
    # the shadow falls away from the radar
    moved = -height * np.tan(np.deg2rad(incidence)) * direction(azimuth, 90)[:2]
    place = centroids(floor)[:, :2]
    inside = ((place > low + moved) & (place < high + moved)).all(axis=1)
    edge = np.abs(np.stack([place - low - moved, place - high - moved])).min(axis=(0, 2)) < 1e-3
    seen = visible(
        np.concatenate([floor, plate(low, high, height)]), 36e6 * direction(azimuth, incidence), device=device
    )
    assert (seen[: len(floor)] == ~inside)[~edge].all() and seen[len(floor) :].all()
    assert inside.sum() == pytest.approx(8 * np.prod(high - low), rel=0.05)  # 8 facets a square metre


def test_a_wall_casts_a_shadow_of_height_times_tangent_of_incidence(device):
    floor, height, incidence = ground(100, 50), 6.0, 60
    wall = plate((-10, 0), (10, height), 0.0)[..., [0, 2, 1]]  # upright in the plane y = 0
    seen = visible(np.concatenate([floor, wall]), 36e6 * direction(-90, incidence), device=device)[: len(floor)]
    place = centroids(floor)
    behind = np.abs(place[:, 0]) < 10
    length = place[behind & ~seen, 1]
    assert length.min() > 0
    assert length.max() == pytest.approx(height * np.tan(np.deg2rad(incidence)), abs=0.5)  # one facet
    assert seen[~behind].all()


@pytest.mark.parametrize("incidence", [0, 30, 60, 85, 89])
@pytest.mark.parametrize("distance", [10e3, 800e3, 36e6])
def test_nothing_is_hidden_on_a_flat_plane(device, distance, incidence):
    viewpoint = distance * direction(33, incidence)
    assert visible(ground(100), viewpoint, device=device).all()
    raised = np.array([0, 0, 400.0])
    assert visible(ground(100) + raised, viewpoint + raised, device=device).all()


@pytest.mark.parametrize("incidence", [10, 50, 80])
def test_two_sheets_in_one_place_do_not_hide_one_another(device, incidence):
    sheet = ground(30)
    for twin in (sheet, sheet[:, ::-1], sheet + np.array([0, 0, 1e-5]), np.roll(sheet, 1, axis=0)):
        assert visible(np.concatenate([sheet, twin]), 10e3 * direction(70, incidence), device=device).all()


def test_coarse_and_fine_cuts_of_one_sheet_do_not_hide_one_another(device):
    both = np.concatenate([ground(40), ground(7)])
    assert visible(both, 10e3 * direction(70, 50), device=device).all()


def test_a_sheet_below_another_is_dark(device):
    both = np.concatenate([ground(30, 40), ground(20, 10, height=-3)])
    seen = visible(both, 10e3 * direction(70, 40), device=device)
    assert seen[:1800].all() and not seen[1800:].any()


def test_both_sides_of_a_facet_hide(device):
    for roof in (plate((-5, -5), (5, 5), 4), plate((-5, -5), (5, 5), 4)[:, ::-1]):
        both = np.concatenate([roof, ground(10, 4)])
        assert not visible(both, 10e3 * direction(0, 0), device=device)[2:].any()


def test_36000_km_is_as_sharp_as_10_km(device):
    random = np.random.default_rng(3)
    roofs = [plate(c - 2.52, c + 2.52, 5 + i) for i, c in enumerate(random.integers(-8, 8, (12, 2)))]
    scene = np.concatenate([ground(20), *roofs])
    look = direction(15, 35)
    near, far = (visible(scene, distance * look, device=device) for distance in (10e3, 36e6))
    exact = ~hidden(scene, 36e6 * look)[:, 0]
    moved = ~hidden(scene, 10e3 * look)[:, 0] != exact  # perspective differs by (size/distance) size, 4 cm here
    assert (near == far)[~moved].all() and (far == exact).all()
    assert moved.mean() < 0.02 and 0.4 < far.mean() < 0.95


def test_shadows_lie_where_the_scene_lies_on_the_earth(device):
    scene = np.concatenate([ground(20), plate((-4, -4), (4, 4), 3.0)])
    look = direction(15, 35)
    far_away = np.array([4.2e6, 1.7e5, 4.78e6])  # float64 places there are multiples of 1e-9 m
    here = visible(scene, 700e3 * look, device=device)
    there = visible(scene + far_away, 700e3 * look + far_away, device=device)
    assert (here == there).all() and not here.all()


def test_a_facet_seen_edge_on_hides_nothing(device):
    edge_on = np.array([[[0, -9, 3], [0, 9, 3], [0, 0, 9.0]]])  # in the plane x = 0, which holds the viewpoint
    scene = np.concatenate([ground(11), edge_on])
    assert visible(scene, np.array([0, 0, 1e4]), device=device).all()


def test_few_large_facets_among_many_small_ones_fill_no_memory(device):
    random = np.random.default_rng(0)
    small = random.uniform(-5, 5, (1000, 1, 3)) + 0.01 * random.standard_normal((1000, 3, 3))
    large = random.uniform(-60, 60, (90, 3, 3)) * [1, 1, 0.01] - [0, 0, 8]
    assert disagreements(np.concatenate([small, large]), 10e3 * direction(0, 37), device) == 0


@pytest.mark.parametrize("n, size, distance", thinned([(31, 3.0), (400, 0.5), (300, 2.0)], [0.0, 2.0, 5.0, 9.0]))
def test_a_viewpoint_among_or_beside_the_facets_sees_what_the_reference_does_not_hide(device, distance, n, size):
    random = np.random.default_rng(n + int(distance))
    for incidence in (10, 90, 170):
        triangles = random.uniform(-5, 5, (n, 1, 3)) + size * random.standard_normal((n, 3, 3))
        viewpoint = distance * direction(random.uniform(0, 360), incidence)
        assert disagreements(triangles, viewpoint, device) == 0
        seen = visible(triangles, viewpoint, device=device)
        assert not seen.all()


@pytest.mark.parametrize("viewpoint", [(5, 0, 1), (-12, 12, 0.1), (19, -19, 3), (25, 0, 0.5)], ids=str)
def test_an_antenna_just_above_or_beside_the_ground_sees_all_of_it_but_not_behind_a_wall(device, viewpoint):
    viewpoint = np.array(viewpoint, float)
    assert visible(ground(), viewpoint, device=device).all()
    wall = plate((-20, 0), (20, 40), 0.0)[..., [2, 0, 1]] + np.array([-16.05, 0, 0])  # upright in the plane x = -16.05
    seen = visible(np.concatenate([ground(), wall]), viewpoint, device=device)
    beyond = centroids(ground())[:, 0] < -16.05
    assert (seen[:-2] == ~beyond).all() and seen[-2:].all()


def test_facets_that_share_edges_leave_no_gap(device):
    """Rays through the edges and corners of a lid, cut as the ground beneath it: none comes through."""
    lid, floor = ground(32, 60.0) + np.array([0, 0, 4.0]), ground(16, 15.0)
    for look in (direction(0, 0), direction(0, 45), direction(45, 54.7356), direction(30, 60)):
        assert not visible(np.concatenate([floor, lid]), 1e4 * look, device=device)[: len(floor)].any()


def test_a_shadowed_point_is_seen_but_a_shadowed_facet_is_not():
    tile = plate((-0.1, -0.1), (0.1, 0.1), 0.0)
    roof, wave = plate((-3, -3), (3, 3), 4.0), sarcl.Waveform.chirp(center=1e9, bandwidth=2e8, duration=1e-6)
    track = sarcl.Trajectory.circle(radius=1e3, height=1e4, n_pulses=3, arc=1e-3)
    both = sarcl.Scene.facets(np.concatenate([tile, roof])) + sarcl.Scene.points([[0, 0, 0]])
    dark, lit = (sarcl.echo(both, wave, track, tolerance=1e-2, shadows=s).report for s in (True, False))
    hidden_pairs = dark.contributions_skipped["shadowed"]
    assert hidden_pairs > 0 and hidden_pairs % 3 == 0 and lit.contributions_skipped["shadowed"] == 0
    assert lit.contributions_done - dark.contributions_done == hidden_pairs
