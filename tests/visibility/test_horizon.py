"""Terrain: horizons along range lines equal ray casting on the same triangles, and obey geometry at any distance."""

from __future__ import annotations

import numpy as np
import pytest
from helpers.lit_cases import seen_centroids
from scipy.ndimage import gaussian_filter

import sarcl
from sarcl.opencl.choose_device import open_device
from sarcl.reference.shadow import CENTROID, overshadowed, sample
from sarcl.scene.terrain import above
from sarcl.scene.triangles import areas, centroids, normals
from sarcl.visibility._frame import Frame
from sarcl.visibility._illumination_solver import IlluminationSolver
from sarcl.visibility._terrain_horizon import Terrain
from sarcl.visibility.illumination import lit

TOLERANCE = {
    "borderline": 0.01,  # rad up and down, thrice aside: horizons are interpolated between lines half a cell apart
    "twin": 1e-3,  # of facets: what still lies that near to a shadow's edge, far behind what casts it
    "power": 1e-3,  # lit area seen by the radar that differs from ray casting, of all of it
    "facets": 0.01,  # of the facets facing the radar whose share differs by more than the sampling
}


def hills(n=160, spacing=1.0, height=4.0, seed=0):
    """Smooth random terrain about the origin: (x, y, z)."""
    z = gaussian_filter(np.random.default_rng(seed).standard_normal((n, n + 7)), 8)
    x = (np.arange(n + 7) - n / 2) * spacing
    return x, x[:n] * 1.1, height * z / z.std()


def facets_of(grid):
    return sarcl.Scene.from_heights(*grid).triangles


def horizon_and_rays(grid, viewpoint, device=None):
    """Lit shares by horizons and by ray casting, and the cosine of incidence."""
    triangles, opened = facets_of(grid), open_device(device)
    shares = [
        IlluminationSolver(opened, triangles, heights=h, two_sided=False).share([viewpoint]) / 255 for h in (grid, None)
    ]
    way = viewpoint - centroids(triangles)
    return *shares, np.einsum("ij,ij->i", normals(triangles), way) / np.linalg.norm(way, axis=1)


VIEWPOINTS = {
    "far": (7e3, 300, 2.5e3),
    "spaceborne": (-6e5, 4e5, 2e5),
    "low, across the diagonal": (5e3, -6e3, 1200.0),
    "beside it": (30.0, -110.0, 60.0),
    "above it": (11.3, -7.2, 30.0),
    "under its edge": (40.0, 400.0, 30.0),
}


@pytest.mark.parametrize("viewpoint", VIEWPOINTS.values(), ids=VIEWPOINTS)
@pytest.mark.parametrize("seed", [0, 1])
def test_horizons_light_what_rays_light(viewpoint, seed):
    grid = hills(seed=seed)
    horizon, rays, cosine = horizon_and_rays(grid, np.array(viewpoint))
    seen = np.maximum(cosine, 0) * areas(facets_of(grid))
    differ = np.abs(horizon - rays)
    assert seen @ differ < TOLERANCE["power"] * (seen @ rays)
    assert (differ[cosine > 0.02] > 1 / 8).mean() < TOLERANCE["facets"]
    assert (horizon < 1).mean() > 0.002  # something is in shadow


@pytest.mark.parametrize("viewpoint", VIEWPOINTS.values(), ids=VIEWPOINTS)
def test_horizons_equal_their_twin_away_from_edges(device, viewpoint):
    grid, viewpoint = hills(n=70, height=9.0), np.array(viewpoint)
    triangles = facets_of(grid)
    some = slice(None, None, 11)  # the twin takes its time
    points = sample(triangles[some], viewpoint, CENTROID, Frame.around(triangles.reshape(-1, 3)).lift)[:, 0]
    way = viewpoint / np.linalg.norm(viewpoint[:2])
    shifts = TOLERANCE["borderline"] * np.linalg.norm(viewpoint) * np.array([[0, 0, 1], [-3 * way[1], 3 * way[0], 0]])
    near = np.array([overshadowed(grid, points, viewpoint + s * shift) for s in (-1, 1) for shift in shifts])
    sure = (near == near[0]).all(axis=0)
    dark = ~seen_centroids(device, triangles, viewpoint, heights=grid)[some]
    assert (dark != near[0])[sure].mean() < TOLERANCE["twin"]
    assert sure.mean() > 0.85 and near[0][sure].sum() > 5


def walled(wall, n=241, size=240.0):
    """Flat ground with height `wall(x, y)` on it."""
    x = np.linspace(-size / 2, size / 2, n)
    return x, x, wall(*np.meshgrid(x, x))


@pytest.mark.parametrize("turned", [False, True])
@pytest.mark.parametrize("side", [1, -1])
def test_a_ridge_shadows_the_ground_up_to_where_the_line_over_its_top_ends(turned, side):
    """A radar H high sees over a ridge h high, g away, what is beyond g H/(H - h): not a plane wave's h tan."""
    h, high, g = 20.0, 100.0, 90.0
    grid = walled(lambda x, y: np.where((y if turned else x) == side * -10.0, h, 0.0))
    eye = np.array([side * 80.0, 0.3, high])
    if turned:
        eye = eye[[1, 0, 2]]
    triangles = facets_of(grid)
    share = IlluminationSolver(open_device(), triangles, heights=grid, two_sided=False).share([eye]) / 255
    place = centroids(triangles)[:, :: -1 if turned else 1][:, 1 if turned else 0] * -side  # outwards from the centre
    end = g * high / (high - h) - 80.0
    assert 100 * h / high > 15 and end == pytest.approx(32.5)
    assert (share[(place > 11.5) & (place < end - 1)] == 0).all() and (share[place > end + 1] == 1).all()
    assert (share[place < 8.5] == 1).all()


def test_a_ring_wall_shadows_a_ring_around_the_point_under_the_radar(device):
    h, high, radius = 10.0, 50.0, 40.0
    grid = walled(lambda x, y: np.where(np.abs(np.hypot(x, y) - radius) < 1.0, h, 0.0))
    triangles = facets_of(grid)
    share = IlluminationSolver(device, triangles, heights=grid, two_sided=False).share([np.array([0, 0, high])])
    away = np.hypot(*centroids(triangles)[:, :2].T)
    assert (share[(away > radius + 2.6) & (away < radius * high / (high - h) - 2)] == 0).all()
    assert (share[(away < radius - 2.6) | (away > radius * high / (high - h) + 2)] == 255).all()


@pytest.mark.parametrize("elevation", [0.5, 3, 30, 88])
@pytest.mark.parametrize("tilt", [(0, 0), (0.004, -0.003), (0.2, -0.3)])
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
            assert (IlluminationSolver(device, triangles, heights=(x, y, z)).share([eye]) == 255).all()


def test_x_and_y_are_alike():
    x, y, z = hills()
    eye = np.array([4e3, 1500.0, 1800.0])
    share = IlluminationSolver(open_device(), facets_of((x, y, z)), heights=(x, y, z)).share([eye])
    turned = (y, x, np.ascontiguousarray(z.T))
    other = IlluminationSolver(open_device(), facets_of(turned), heights=turned).share([eye[[1, 0, 2]]])
    # from_heights cuts every cell from south-west to north-east: the halves change places
    a, b = share.reshape(len(y) - 1, len(x) - 1, 2), other.reshape(len(x) - 1, len(y) - 1, 2)
    turned_back = b.transpose(1, 0, 2)[..., ::-1].astype(int)  # lines of samples are parallel to another edge
    assert (np.abs(a - turned_back) <= 255 / 16).mean() > 0.999 and 0.01 < (share == 0).mean() < 0.9


def test_uneven_grid_lines_are_as_good_as_even_ones():
    random = np.random.default_rng(5)
    x = np.sort(random.choice(np.linspace(-60, 60, 481), 200, replace=False))
    y = np.concatenate([np.linspace(-60, 0, 30, endpoint=False), np.linspace(0, 60, 120)])
    z = 5 * np.sin(x / 7) * np.cos(y[:, None] / 9)
    for viewpoint in ((3e3, 1e3, 900.0), (-400.0, 3e3, 800.0)):
        horizon, rays, cosine = horizon_and_rays((x, y, z), np.array(viewpoint))
        seen = np.maximum(cosine, 0) * areas(facets_of((x, y, z)))
        assert seen @ np.abs(horizon - rays) < 3 * TOLERANCE["power"] * (seen @ rays) and (rays == 0).mean() > 0.02


def test_the_same_on_every_device(device):
    grid = hills(height=7.0)
    triangles, eye = facets_of(grid), np.array(VIEWPOINTS["far"])
    here, there = (IlluminationSolver(d, triangles, heights=grid).share([eye]) for d in (device, open_device()))
    assert (here == there).all() and 0.02 < (here == 0).mean() < 0.5


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
    on = np.arange(len(scene)) < len(terrain)
    eye = np.array([[9e3, 0.5, 9e3]])  # 45 deg: the ridge's shadow ends at x = 5, the house's at x = -10
    share = lit(scene, eye, heights=grid, on_heights=on, device=device).share(0)
    place = centroids(terrain)
    in_line = np.abs(place[:, 1]) < 3
    x = place[:, 0]
    ground = share[on]
    assert (ground[in_line & (x > 6.5) & (x < 17)] == 0).all() and (
        ground[in_line & (x > -8.5) & (x < -4.1)] == 0
    ).all()
    assert (ground[in_line & (x < -12)] == 255).all() and (share[~on][-2:] == 255).all()
    # 10 deg lower the ridge's shadow covers the house too
    low = lit(scene, np.array([[9e3, 0.5, 9e3 * np.tan(np.deg2rad(25))]]), heights=grid, on_heights=on).share(0)
    assert (low[~on] < 255).any() and (low[~on][-2:] > 0).any()
    alone = lit(scene, eye, heights=grid, on_heights=np.ones(len(scene), bool), device=device).share(0)
    assert (alone[on][in_line & (x > -8.5) & (x < -4.1)] == 255).all()  # nothing but the terrain shadows


@pytest.mark.parametrize("which", ["tx", "rx"])
def test_an_antenna_under_the_terrain_is_refused(which):
    grid = walled(lambda x, y: 30 + 0 * x, n=31)
    track = np.array([[0, 0, 90.0], [1, 0, 80.0], [2, 0, 26.8]])
    good = track + np.array([0, 0, 10])
    pair = (track, None) if which == "tx" else (good, track)
    with pytest.raises(ValueError, match=rf"{which}\[2\] stands 3.2 m under the terrain; raise the track"):
        lit(facets_of(grid), *pair, heights=grid)


def test_heights_above_the_terrain_are_those_above_its_triangles():
    grid = hills(n=20)
    triangles = facets_of(grid)
    random = np.random.default_rng(0)
    weight = random.dirichlet([1, 1, 1], len(triangles))
    points = np.einsum("kc,kci->ki", weight, triangles) + np.array([0, 0, 2.5])
    assert above(grid, points) == pytest.approx(2.5, abs=1e-9)
    assert np.isinf(above(grid, np.array([[1e3, 0, 0.0]])))


def test_lines_reach_every_part_of_the_terrain():
    """Every sample finds its two range lines, wherever the radar stands: a spike at any place casts a shadow."""
    random = np.random.default_rng(1)
    x = np.linspace(-30, 30, 61)
    for _ in range(20):
        i, j = random.integers(4, 57, 2)
        z = np.zeros((61, 61))
        z[j - 1 : j + 2, i - 1 : i + 2] = 6.0
        a = random.uniform(0, 2 * np.pi)
        eye = np.array([x[i] + 20 * np.cos(a), x[j] + 20 * np.sin(a), 12.0]) * random.choice([1, 2, 1e3])
        if abs(eye[:2]).max() < 1e3:
            eye[2] = 12.0
        way = np.array([x[i], x[j]]) - eye[:2]
        way /= np.linalg.norm(way)
        behind = np.array([x[i], x[j]]) + 4.0 * way
        triangles = facets_of((x, x, z))
        share = IlluminationSolver(open_device(), triangles, heights=(x, x, z)).share([eye])
        at = np.argmin(np.linalg.norm(centroids(triangles)[:, :2] - behind, axis=1))
        if np.abs(behind).max() < 29 and (eye[2] - 6) / np.linalg.norm(eye[:2] - [x[i], x[j]]) < 1:
            assert share[at] == 0


def test_tables_are_no_larger_than_a_few_numbers_a_cell():
    device, grid = open_device(), hills(n=120)
    frame = Frame.around(facets_of(grid).reshape(-1, 3))
    for eye in VIEWPOINTS.values():
        scan = Terrain(device, grid, frame).sweep(np.array(eye))
        assert scan.table.size < 4 * 9 * grid[2].size
