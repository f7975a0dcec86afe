"""Rays between facets: what the reference finds, known distances, no gap between facets, none met by what leaves it."""

from __future__ import annotations

import re

import numpy as np
import pytest
import trimesh
from helpers.cases import thinned

from sarcl.base.vectors import unit
from sarcl.reference import rays as reference
from sarcl.scene.triangles import centroids, normals, of_grid
from sarcl.visibility.rays import RAYS, SceneRays

TOLERANCE = {
    "distance": 1e-12,  # relative: computed in float64, from the plane of the facet
    "place": 1e-6,  # of the scene's size: facets are found in float32
}
CUBE = 3.0  # m, half the side of the cubes here
DISTANCES = [0.0, 60.0, 800e3, 36e6]


def size(triangles):
    return np.ptp(triangles.reshape(-1, 3), axis=0).max()


def soup(n, length, seed):
    random = np.random.default_rng(seed)
    return random.uniform(-5, 5, (n, 1, 3)) + length * random.standard_normal((n, 3, 3))


def lines(triangles, n, distance, seed):
    """Origins around a soup, or in it, and points in it, half of them just beyond facets, m (n, 3) each."""
    random = np.random.default_rng(seed)
    origins = random.uniform(-5, 5, (n, 3)) + distance * unit(random.standard_normal((n, 3)))
    ends = random.uniform(-6, 6, (n, 3))
    aims = np.einsum("ni,nij->nj", random.dirichlet([1, 1, 1], n), triangles[random.integers(len(triangles), size=n)])
    beyond = aims + random.random((n, 1)) * unit(aims - origins)
    return origins, np.where(np.arange(n)[:, None] % 2, ends, beyond)


def cube(n):
    """A cube, 2 CUBE wide, with walls of 2 n^2 facets."""
    x = np.linspace(-CUBE, CUBE, n + 1)
    a, b = np.meshgrid(x, x, indexing="ij")
    sides = [
        of_grid(np.roll(np.stack([a, b, np.full_like(a, h)], axis=-1), k, axis=-1))
        for k in range(3)
        for h in (-CUBE, CUBE)
    ]
    return np.concatenate(sides)


def to_the_wall(origins, directions):
    """How far walls of the cube are from points in it, m (n,)."""
    u = unit(directions)
    with np.errstate(divide="ignore"):
        return ((np.copysign(CUBE, u) - origins) / u).min(axis=1)


def on_facets(triangles, n, seed):
    """Random points on facets, m (n, 3), the numbers of these (n,), and upward directions spread by their cosine."""
    random = np.random.default_rng(seed)
    facet = random.integers(len(triangles), size=n)
    points = np.einsum("ni,nij->nj", random.dirichlet([1, 1, 1], n), triangles[facet])
    return points, facet, normals(triangles)[facet] + unit(random.standard_normal((n, 3)))


# ---- against the reference


@pytest.mark.parametrize("n, length, distance", thinned([(1, 4.0), (7, 3.0), (9, 3.0), (600, 0.7)], DISTANCES))
def test_the_first_facet_is_that_of_the_reference_in_random_soups(device, distance, n, length):
    triangles = soup(n, length, n)
    origins, ends = lines(triangles, 300, distance, n + 1)
    scene, off = SceneRays(device, triangles), TOLERANCE["place"] * size(triangles)
    facet, met = scene.nearest(origins, 3.7 * (ends - origins))
    (small, near), (large, _) = (
        reference.nearest(triangles, origins, ends - origins, least=scene.least, margin=m) for m in (-off, off)
    )
    settled = small == large
    assert settled.mean() > 0.98 and (facet == small)[settled].all()
    hit = settled & (small >= 0)
    assert hit.any() and np.isinf(met[facet < 0]).all()
    assert met[hit] == pytest.approx(near[hit], rel=TOLERANCE["distance"])


@pytest.mark.parametrize("distance", DISTANCES)
@pytest.mark.parametrize("n, length", [(1, 4.0), (31, 2.0), (300, 0.3)])
def test_what_lies_between_two_points_is_what_the_reference_says(device, distance, n, length):
    triangles = soup(n, length, n)
    origins, ends = lines(triangles, 300, distance, n + 1)
    scene, off = SceneRays(device, triangles), TOLERANCE["place"] * size(triangles)
    found = scene.any_hit(origins, ends)
    small, large = (reference.any_hit(triangles, origins, ends, least=scene.least, margin=m) for m in (-off, off))
    settled = small == large
    assert settled.mean() > 0.98 and (found == small)[settled].all() and 0 < found.mean() < 1
    assert (scene.any_hit(ends, origins) == found)[settled].all()


# ---- closed forms


@pytest.mark.parametrize("n", [1, 5])
def test_distances_from_within_a_cube_are_those_of_its_walls(device, n):
    origins = np.random.default_rng(0).uniform(-0.999 * CUBE, 0.999 * CUBE, (2000, 3))
    directions = np.random.default_rng(1).standard_normal((2000, 3))
    facet, met = SceneRays(device, cube(n)).nearest(origins, directions)
    assert met == pytest.approx(to_the_wall(origins, directions), rel=TOLERANCE["distance"])
    on_wall = origins + met[:, None] * unit(directions) - centroids(cube(n))[facet]
    assert np.abs((on_wall * normals(cube(n))[facet]).sum(axis=1)).max() < 1e-14 * 50


def test_a_cube_is_met_from_a_satellite_where_it_is_met_from_near(device):
    look = unit(np.array([3.0, 5, 7]))
    flat = np.random.default_rng(0).uniform(-CUBE, CUBE, (500, 2))
    points = np.column_stack([flat, np.full(500, CUBE)])
    for distance in (800e3, 36e6):
        facet, met = SceneRays(device, cube(4)).nearest(points + distance * look, np.tile(-look, (500, 1)))
        assert (facet >= 0).all() and met == pytest.approx(distance, rel=TOLERANCE["distance"])
        assert (centroids(cube(4))[facet][:, 2] == CUBE).all()


@pytest.mark.parametrize("tilt", [0.0, 0.3, 1.2])
def test_parallel_rays_count_the_area_of_a_plate(device, tilt):
    """A plate of 4 m by 2.4 m, tilted about x, under a net of rays: its shadow is 2.4 cos(tilt) long."""
    step = 0.04
    u, v = np.meshgrid(np.linspace(-2, 2, 8), np.linspace(-1.2, 1.2, 6), indexing="ij")
    plate = of_grid(np.stack([u, v * np.cos(tilt), v * np.sin(tilt)], axis=-1))
    x = (np.arange(-75, 75) + 0.5) * step
    net = np.stack([*np.meshgrid(x, x), np.full((150, 150), 1e3)], axis=-1).reshape(-1, 3)
    facet, met = SceneRays(device, plate).nearest(net, np.tile([0, 0, -2.0], (len(net), 1)))
    rows = 2 * np.floor(1.2 * np.cos(tilt) / step + 0.5)
    assert (facet >= 0).sum() == 100 * rows
    hit = facet >= 0
    assert met[hit] == pytest.approx(1e3 - net[hit, 1] * np.tan(tilt), rel=TOLERANCE["distance"])


# ---- no gap


def rough_ball(seed):
    """A closed body, every corner of which is seen from the origin."""
    ball = trimesh.creation.icosphere(subdivisions=3, radius=1.0)
    random = np.random.default_rng(seed)
    places = ball.vertices * random.uniform(0.7, 1.4, (len(ball.vertices), 1))
    return places @ np.linalg.qr(random.standard_normal((3, 3)))[0], ball.faces


@pytest.mark.parametrize("seed", [0, 1])
@pytest.mark.parametrize("where", [(0.0, 0.0, 0.0), (4.2e6, 1.7e5, 4.78e6)], ids=["origin", "on Earth"])
def test_rays_aimed_at_corners_and_edges_of_a_closed_body_never_slip_through(device, seed, where):
    places, faces = rough_ball(seed)
    places = places + np.array(where)
    edges = np.unique(np.sort(faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)), axis=0)
    aims = np.concatenate([places, places[edges].mean(axis=1)])
    random = np.random.default_rng(seed)
    along = places[edges[:, 1]] - places[edges[:, 0]]
    aims = np.concatenate([aims, places[edges[:, 0]] + random.random((len(edges), 1)) * along])
    scene = SceneRays(device, places[faces])
    for inside in (np.zeros(3), *random.uniform(-0.2, 0.2, (6, 3))):
        origins = np.tile(inside + where, (len(aims), 1))
        facet, met = scene.nearest(origins, aims - origins)
        away = np.linalg.norm(aims - origins, axis=1)
        assert (facet >= 0).all()
        assert scene.any_hit(origins, 4 * aims - 3 * origins).all()  # these ends are outside of the body
        if not inside.any():
            assert met == pytest.approx(away, abs=TOLERANCE["place"] * 3)


def test_rays_from_far_away_through_corners_of_a_convex_body_never_slip_through(device):
    ball = trimesh.creation.icosphere(subdivisions=3, radius=2.0)
    random = np.random.default_rng(0)
    scene = SceneRays(device, ball.triangles)
    for distance in (10.0, 800e3, 36e6):
        for look in unit(random.standard_normal((4, 3))):
            aims = ball.vertices[ball.vertices @ look > 1.0]  # all facets around them are turned here
            origins = np.tile(distance * look, (len(aims), 1))
            facet, met = scene.nearest(origins, aims - origins)
            assert (facet >= 0).all()
            assert np.abs(met - np.linalg.norm(aims - origins, axis=1)).max() < 4 * 4e-6
            assert scene.any_hit(origins, 3 * aims - 2 * origins).all()


def test_rays_along_the_axes_through_a_lattice_of_corners_never_slip_through(device):
    """Corners, edges and walls of boxes of the tree lie in planes that hold the rays."""
    x = np.linspace(-CUBE, CUBE, 9)
    corner = np.stack(np.meshgrid(x[1:-1], x[1:-1], [0.0], indexing="ij"), axis=-1).reshape(-1, 3)
    scene = SceneRays(device, cube(8))
    for axis, sign in [(a, s) for a in range(3) for s in (-1, 1)]:
        origins = np.roll(corner, axis + 1, axis=1)
        direction = sign * np.eye(3)[axis]
        facet, met = scene.nearest(origins, np.tile(direction, (len(origins), 1)))
        assert (facet >= 0).all() and (met == CUBE).all()


# ---- leaving a facet


@pytest.mark.parametrize("where", [(0.0, 0.0, 0.0), (4.2e6, 1.7e5, 4.78e6)], ids=["origin", "on Earth"])
def test_a_ray_that_leaves_a_sheet_meets_neither_it_nor_neighbours_nor_a_twin_at_any_angle(device, where):
    turn = np.linalg.qr(np.random.default_rng(5).standard_normal((3, 3)))[0]
    x = np.linspace(-20, 20, 24)
    fine, coarse = (of_grid(np.stack([*np.meshgrid(g, g), np.zeros((len(g),) * 2)], axis=-1)) for g in (x, x[::4]))
    sheets = np.concatenate([fine, fine[:, ::-1], coarse]) @ turn + np.array(where)
    points, facet, _ = on_facets(sheets, 4000, 0)
    random = np.random.default_rng(1)
    angle, rise = random.uniform(0, 2 * np.pi, 4000), random.choice([0, 1e-7, 1e-5, 1e-3, 0.1, 1], 4000)
    level = np.column_stack([np.cos(angle), np.sin(angle), rise * random.choice([-1, 1], 4000)])
    scene = SceneRays(device, sheets)
    assert (scene.nearest(points, level @ turn, leaving=facet)[0] == -1).all()
    assert not scene.any_hit(points, points + 30 * level @ turn, leaving=facet)[rise >= 1e-5].any()
    # between two points of the sheet there is nothing
    assert not scene.any_hit(points, points[::-1], leaving=facet, reaching=facet[::-1]).any()


def test_rays_that_leave_walls_of_a_cube_arrive_at_the_others(device):
    walls = cube(6)
    points, facet, ahead = on_facets(walls, 3000, 0)
    axis, row = np.abs(normals(walls)[facet]).argmax(axis=1), np.arange(3000)
    points[row, axis] = np.copysign(CUBE, points[row, axis])
    u = unit(ahead)
    u[row, axis] = -np.copysign(u[row, axis], points[row, axis])  # inwards
    scene = SceneRays(device, walls)
    found, met = scene.nearest(points, u, leaving=facet)
    assert (found >= 0).all() and met == pytest.approx(to_the_wall(points, u), rel=TOLERANCE["distance"])
    ends = points + met[:, None] * u
    assert not scene.any_hit(points, ends, leaving=facet, reaching=found).any()
    assert scene.any_hit(points, ends + 0.1 * u, leaving=facet).all()


def test_facets_nearer_than_a_millionth_of_the_scene_are_not_met(device):
    walls = cube(1)
    scene = SceneRays(device, walls)
    assert 0 < scene.least <= 1e-6 * 2 * CUBE
    ahead = np.tile([1.0, 0, 0], (2, 1))
    origins = np.array([CUBE, 0.1, 0.2]) - np.array([[0.5], [2.0]]) * scene.least * ahead
    assert (scene.nearest(origins, ahead)[0] >= 0).tolist() == [False, True]
    assert scene.any_hit(origins, origins + ahead).tolist() == [False, True]
    assert scene.any_hit(origins - ahead, origins + scene.least * ahead).tolist() == [False, False]
    # told which facet they leave, they do not skip others
    assert (scene.nearest(origins, ahead, leaving=[0, 0])[0] >= 0).all()


# ---- odd scenes and calls


def test_facets_without_area_are_never_met_and_the_others_keep_their_numbers(device):
    random = np.random.default_rng(0)
    good = cube(2)
    ends = random.uniform(-CUBE, CUBE, (60, 2, 3))
    needles = np.concatenate([ends, ends.mean(axis=1, keepdims=True)], axis=1)
    needles[:10, 1:] = needles[:10, :1]  # points
    mixed = np.concatenate([needles[:30], good, needles[30:]])
    aims = np.concatenate([needles.mean(axis=1), needles[:, 0], random.uniform(-CUBE, CUBE, (300, 3))])
    origins = np.tile([0.1, 0.2, 0.3], (len(aims), 1))
    facet, met = SceneRays(device, good).nearest(origins, aims - origins)
    found = SceneRays(device, mixed).nearest(origins, aims - origins)
    assert (facet >= 0).all() and (found[0] == facet + 30).all() and (found[1] == met).all()
    none = SceneRays(device, needles)
    assert (none.nearest(origins, aims - origins, leaving=np.zeros(len(aims), int))[0] == -1).all()
    assert not none.any_hit(origins, aims).any()


def test_numbers_of_facets_are_those_of_the_callers_order(device):
    triangles = soup(200, 0.8, 3)
    origins, ends = lines(triangles, 400, 20.0, 4)
    order = np.random.default_rng(5).permutation(len(triangles))
    facet, met = SceneRays(device, triangles).nearest(origins, ends - origins)
    other, same = SceneRays(device, triangles[order]).nearest(origins, ends - origins)
    hit = facet >= 0
    assert (order[other[hit]] == facet[hit]).all() and (met == same).all() and (other[~hit] == -1).all()


def test_doubled_sheets_are_met_once_at_their_distance(device):
    sheet = cube(3)
    origins, directions = np.zeros((500, 3)), np.random.default_rng(0).standard_normal((500, 3))
    facet, met = SceneRays(device, np.concatenate([sheet, sheet[:, ::-1]])).nearest(origins, directions)
    assert met == pytest.approx(to_the_wall(origins, directions), rel=TOLERANCE["distance"])
    single, _ = SceneRays(device, sheet).nearest(origins, directions)
    assert (facet % len(sheet) == single).all()


def test_batches_do_not_show(device):
    """More rays than are on the device at a time are those of two calls."""
    triangles = soup(50, 2.0, 0)
    scene, (origins, ends) = SceneRays(device, triangles), lines(triangles, RAYS + 101, 7.0, 1)
    whole = (*scene.nearest(origins, ends - origins), scene.any_hit(origins, ends))
    halves = [
        (*scene.nearest(origins[part], ends[part] - origins[part]), scene.any_hit(origins[part], ends[part]))
        for part in (slice(0, 40_000), slice(40_000, None))
    ]
    assert all(np.array_equal(a, np.concatenate(b)) for a, b in zip(whole, zip(*halves, strict=True), strict=True))


def test_no_rays_one_facet_rays_that_pass_by_and_points_that_coincide(device):
    scene = SceneRays(device, [[[0, 0, 0], [1, 0, 0], [0, 1, 0]]])
    facet, met = scene.nearest(np.empty((0, 3)), np.empty((0, 3)), leaving=[])
    assert facet.shape == met.shape == (0,) and facet.dtype == np.int64 and met.dtype == np.float64
    assert scene.any_hit(np.empty((0, 3)), np.empty((0, 3))).shape == (0,)
    origins = np.array([[0.2, 0.2, 5], [0.2, 0.2, -5], [0.9, 0.9, 5], [0.2, 0.2, 5], [0.2, 0.2, 5]])
    directions = [[0, 0, -1e-200], [0, 0, 1e200], [0, 0, -1], [0, 0, 1], [1, 0, 0]]
    facet, met = scene.nearest(origins, directions)
    assert facet.tolist() == [0, 0, -1, -1, -1] and met.tolist() == [5, 5, np.inf, np.inf, np.inf]
    assert not scene.any_hit(origins, origins).any()
    assert facet.dtype == np.int64


GOOD = {"origins": np.ones((4, 3)), "directions": np.ones((4, 3)), "leaving": None}


@pytest.mark.parametrize(
    "wrong, message",
    [
        ({"origins": [[0, 0, np.nan]] * 4}, "origins[0, 2] is nan; every value must be finite"),
        ({"origins": np.ones((4, 2))}, "origins has shape (4, 2), wanted (n, 3)"),
        ({"origins": np.full((4, 3), 1e71)}, "origins: lengths up to 1e+71 m, whose areas overflow; give metres"),
        ({"origins": np.ones(3)}, "origins has shape (3,), wanted (n, 3)"),
        ({"directions": np.ones((3, 3))}, "directions has shape (3, 3), wanted (4, 3)"),
        ({"directions": np.empty((0, 3))}, "directions has shape (0, 3), wanted (4, 3)"),
        ({"directions": [[1, 0, 0], [0, 0, 0], [0, 0, 1], [1, 1, 1]]}, "directions[1] is (0, 0, 0); a direction needs"),
        ({"directions": [[np.inf, 0, 0]] * 4}, "directions[0, 0] is inf; every value must be finite"),
        ({"directions": "up"}, "directions must be numbers that fit float64, got 'up'"),
        ({"leaving": [0, 1, -1, 24]}, "leaving[3] is 24; wanted the number of a facet, 0 to 11, or -1 for none"),
        ({"leaving": [0, -2, -1, 4]}, "leaving[1] is -2; wanted the number of a facet, 0 to 11, or -1 for none"),
        ({"leaving": [0, 1]}, "leaving has shape (2,), wanted (4,)"),
        ({"leaving": [0, 1, 1.5, 1]}, "leaving must be numbers that fit int64"),
    ],
)  # fmt: skip
def test_wrong_rays_are_refused_with_their_name_and_what_is_wanted(device, wrong, message):
    scene = SceneRays(device, cube(1))
    with pytest.raises(ValueError, match=re.escape(message)):
        scene.nearest(**GOOD | wrong)


@pytest.mark.parametrize(
    "wrong, message",
    [
        (np.full((2, 3, 3), np.nan), "triangles[0, 0, 0] is nan"),
        (np.ones((2, 3)), "triangles has shape (2, 3), wanted (k, 3, 3)"),
        (np.empty((0, 3, 3)), "triangles is empty (shape (0, 3, 3)), wanted (k, 3, 3) with at least one element"),
        (np.full((1, 3, 3), 1e80), "triangles: lengths up to 1e+80 m, whose areas overflow; give metres"),
    ],
)
def test_wrong_facets_are_refused(device, wrong, message):
    with pytest.raises(ValueError, match=re.escape(message)):
        SceneRays(device, wrong)


@pytest.mark.parametrize(
    "wrong, message",
    [
        ({"ends": np.ones((3, 3))}, "ends has shape (3, 3), wanted (4, 3)"),
        ({"ends": np.full((4, 3), np.nan)}, "ends[0, 0] is nan"),
        ({"reaching": [0, 1, 2, 12]}, "reaching[3] is 12; wanted the number of a facet, 0 to 11, or -1 for none"),
    ],
)
def test_wrong_ends_are_refused(device, wrong, message):
    scene = SceneRays(device, cube(1))
    with pytest.raises(ValueError, match=re.escape(message)):
        scene.any_hit(**{"origins": np.ones((4, 3)), "ends": np.zeros((4, 3))} | wrong)
