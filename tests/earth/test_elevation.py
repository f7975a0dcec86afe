"""Elevation models: heights at any place, grids on terrain, positions of terrain at a time and range."""

from __future__ import annotations

import warnings

import numpy as np
import pytest
from scipy.ndimage import map_coordinates

import sarcl

LON, LAT = 12 + 0.001 * np.arange(61), 42 - 0.001 * np.arange(41)


def hills(lon, lat):
    """Heights, m, that are bilinear in degrees, so that interpolation is exact."""
    return 300 + 2e4 * (lon - 12) - 1e4 * (lat - 42) + 1e6 * (lon - 12) * (lat - 42)


def model(z=None, lon=LON, lat=LAT):
    return sarcl.ElevationModel(lon, lat, hills(LON, LAT[:, None]) if z is None else z)


def test_heights_between_points_are_bilinear():
    random = np.random.default_rng(0)
    lon, lat = random.uniform(12, 12.06, (7, 5)), random.uniform(41.96, 42, (7, 5))
    assert np.abs(model().heights_at(lon, lat) - hills(lon, lat)).max() < 1e-8
    assert np.abs(model().heights_at(LON[-1], LAT) - hills(LON[-1], LAT)).max() < 1e-8  # the border is inside
    assert np.isnan(model().heights_at([11.9999, 12.0, 12.0], [42.0, 42.0001, 41.9599])).all()
    assert model().lowest == hills(LON, LAT[:, None]).min() and model().highest == hills(LON, LAT[:, None]).max()
    assert model().spacing == pytest.approx(np.radians(0.001) * 6378137 * np.cos(np.radians(41.98)), rel=5e-3)


def test_a_grid_that_is_even_in_a_map_projection_is_inverted():
    """Rows and columns turned by 20 degrees and bent: degrees are no longer a function of row or column alone."""
    i, j = np.meshgrid(np.arange(41.0), np.arange(61.0), indexing="ij")
    lon = 12 + 1e-3 * (0.94 * j + 0.34 * i) + 1e-8 * i * j
    lat = 42 - 1e-3 * (0.94 * i - 0.34 * j) - 2e-8 * i * j
    at = np.random.default_rng(1).uniform(0, 40, (2, 50))
    turned = sarcl.ElevationModel(lon, lat, 100 + 3 * i + 2 * j)
    there = turned.heights_at(*(map_coordinates(degrees, at, order=1) for degrees in (lon, lat)))
    assert np.abs(there - (100 + 3 * at[0] + 2 * at[1])).max() < 1e-6


def test_a_grid_on_a_turned_model_is_empty_outside_it():
    i, j = np.meshgrid(np.arange(41.0), np.arange(61.0), indexing="ij")
    turned = sarcl.ElevationModel(12 + 1e-3 * (0.94 * j + 0.34 * i), 42 - 1e-3 * (0.94 * i - 0.34 * j), 100 + 2 * j)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        grid = sarcl.ImageGrid.on_terrain(turned, 200.0, frame="ecef")
        assert np.isnan(turned.heights_at([np.nan, 12.01], [42.0, np.nan])).all()
    assert grid.empty is not None and 0.2 < grid.empty.mean() < 0.6


def test_missing_heights_are_missing_in_the_cells_around_them():
    z = hills(LON, LAT[:, None])
    z[10, 20] = np.nan
    holed = model(z)
    assert np.isnan(holed.heights_at(LON[20] + 0.0004, LAT[10] + 0.0003))
    assert holed.heights_at(LON[21], LAT[10]) == pytest.approx(z[10, 21], abs=1e-8)  # only what a cell needs


@pytest.mark.parametrize("step", [1e-2, 1e-6, 1e-8])
@pytest.mark.parametrize("longitude, latitude", [(97.3, -41.7), (-179.99999, 12.3), (0.1, 77.7), (12.0, 89.5)])
@pytest.mark.parametrize("turned", [0.0, 0.3])
def test_a_point_beside_missing_heights_has_its_own(longitude, latitude, step, turned):
    """Rounding of degrees is up to 3e-8 of a cell of 1e-6 degrees, 0.1 m: no part of a neighbour's NaN, also where
    longitudes are given a whole turn away, and where the model ends."""
    i, j = np.meshgrid(np.arange(5), np.arange(7), indexing="ij")
    lon = longitude + step * (np.cos(turned) * j + np.sin(turned) * i)
    lat = latitude + step * (-np.cos(turned) * i + np.sin(turned) * j)
    z = 100.0 + 10 * i + j
    z[(i + j) % 2 == 1] = np.nan
    holed = sarcl.ElevationModel(lon, lat, z)
    for turn in (0, 360, -360):
        assert np.array_equal(holed.heights_at(lon + turn, lat), z, equal_nan=True)
    full = sarcl.ElevationModel(lon, lat, 100.0 + 10 * i + j)
    between = [(values[:-1, :-1] + values[1:, 1:]) / 2 for values in (lon, lat)]
    assert np.abs(full.heights_at(*between) - (105.5 + 10 * i + j)[:-1, :-1]).max() < 1e-3


def test_a_column_and_the_same_after_a_turn_have_the_same_heights():
    lon, z = np.arange(0.0, 360.0, 0.1), np.full((2, 3600), np.nan)
    z[:, 0] = 5.0
    around = sarcl.ElevationModel(lon, [10.0, 10.1], z)
    assert np.array_equal(around.heights_at([-360.0, 0.0, 360.0, 720.0], 10.0), np.full(4, 5.0))


def test_a_model_across_the_antimeridian_has_no_seam():
    east = sarcl.ElevationModel(LON + 167.97, LAT, hills(LON, LAT[:, None]))
    for lon in (180.0, -180.0):
        assert east.heights_at(lon, 41.98) == pytest.approx(hills(12.03, 41.98), abs=1e-6)
    assert east.heights_at(-179.99, 41.98) == pytest.approx(hills(12.04, 41.98), abs=1e-6)


@pytest.mark.parametrize(
    "given, wanted",
    [
        ((LON, LAT, np.zeros((41, 60))), r"longitude has shape \(61,\), wanted \(60,\)"),
        ((LON, LAT, np.zeros(41)), r"height has shape \(41,\); wanted \(n_rows, n_columns\)"),
        ((LON, LAT, np.full((41, 61), np.nan)), "NaN everywhere"),
        ((LON, LAT + 60, np.zeros((41, 61))), "latitude reaches 102"),
        ((np.where(LON > 12.03, LON - 360, LON), LAT, np.zeros((41, 61))), "jumps by 180 degrees.*beyond 180"),
    ],
)
def test_bad_models_are_refused(given, wanted):
    with pytest.raises(ValueError, match=wanted):
        sarcl.ElevationModel(*given)


# grids on terrain


@pytest.mark.parametrize("frame", ["local", "ecef"])
def test_a_grid_on_terrain_is_even_over_the_ground_and_at_its_height(frame):
    grid = sarcl.ImageGrid.on_terrain(model(), (40, 25), frame=frame, center=(12.03, 41.98, 50.0))
    axes, origin = sarcl.wgs84.local_axes(12.03, 41.98), sarcl.wgs84.ecef(12.03, 41.98, 50.0)
    local = grid.positions if frame == "local" else (grid.positions - origin) @ axes.T
    assert grid.shape == (112, 199)  # 4.45 km north by 4.97 km east
    steps = np.diff(local[..., 1], axis=0), np.diff(local[..., 0], axis=1)
    for made, wanted in zip(steps, (40, 25), strict=True):
        assert np.abs(made[np.isfinite(made)] - wanted).max() < 1e-6
    lon, lat, height = sarcl.wgs84.geodetic(local @ axes + origin)
    inside = ~np.isnan(height)
    assert inside.mean() > 0.98 and np.abs(height - hills(lon, lat))[inside].max() < 1e-5
    assert (grid.empty is None) == inside.all()


def test_a_grid_on_terrain_lies_on_the_scene_of_the_same_file(data_folder):
    pytest.importorskip("rasterio", reason="no rasterio: pip install sarcl[maps]")
    path = data_folder / "dem/Rome-30m-DEM.tif"
    options = dict(bounds=(12.50, 41.95, 12.51, 41.96), heights="EGM96", geoid=48.3, center=(12.505, 41.955))
    scene = sarcl.Scene.from_dem(path, **options)
    grid = sarcl.ImageGrid.on_terrain(path, 30.0, **options)
    some = grid.positions[~np.isnan(grid.positions[..., 0])][::37]
    low, high = scene.bounds
    inside = some[((some > low + 1) & (some < high - 1))[:, :2].all(axis=1)]
    ground = np.array([scene.height_at(x, y) for x, y, _ in inside])
    assert len(inside) > 10 and np.abs(inside[:, 2] - ground).max() < 2.0  # bilinear against two facets per cell
    with pytest.raises(ValueError, match="not above the ellipsoid; give the undulation"):
        sarcl.ImageGrid.on_terrain(path, 30.0, heights="EGM96")


def test_bad_grids_on_terrain_are_refused():
    with pytest.raises(ValueError, match=r"spacing\[0\] is 0"):
        sarcl.ImageGrid.on_terrain(model(), 0)
    with pytest.raises(ValueError, match="are for files"):
        sarcl.ImageGrid.on_terrain(model(), 10, geoid=48.0)
    with pytest.raises(MemoryError, match="larger spacing"):
        sarcl.ImageGrid.on_terrain(model(), 0.1)
    with pytest.raises(ValueError, match="frame is 'enu'"):
        sarcl.ImageGrid.on_terrain(model(), 10, frame="enu")


# geolocation on terrain


@pytest.fixture(scope="module")
def passing():
    """An orbit past (12.03, 41.98) at 850 km, and the time and range of positions there."""
    x = sarcl.wgs84.ecef(12.03, 41.98, 0.0)
    orbit = sarcl.Orbit.kepler(7.07e6, 0.001, 1.71, span=(-86400, 86400))
    best = min(
        (orbit.locate(x, span=(s, s + 7200)) for s in range(-86400, 79200, 7200) if _seen(orbit, x, s)),
        key=lambda found: abs(found[1] - 9e5),
    )
    p, v = orbit.positions(best[0]), orbit.velocities(best[0])
    right = np.cross(v, p) @ (x - p) > 0
    return orbit, "right" if right else "left"


def _seen(orbit, x, start):
    t = np.linspace(start, start + 7200, 400)
    up = x / np.linalg.norm(x)
    return ((orbit.positions(t) - x) @ up).max() > 2e5


def test_positions_on_terrain_are_located_again_and_lie_at_its_height(passing):
    orbit, side = passing
    gentle = model(0.05 * hills(LON, LAT[:, None]) + 200)
    random = np.random.default_rng(2)
    lon, lat = random.uniform(12.01, 12.05, 60), random.uniform(41.97, 41.99, 60)
    x = sarcl.wgs84.ecef(lon, lat, gentle.heights_at(lon, lat))
    t, r = orbit.locate(x)
    back = orbit.geolocate(t, r, gentle, side=side)
    assert np.linalg.norm(back - x, axis=1).max() < 1e-5
    there = sarcl.wgs84.geodetic(back)
    assert np.abs(there[2] - gentle.heights_at(there[0], there[1])).max() < 1e-6
    flat = model(np.full((41, 61), 321.0))
    level = sarcl.wgs84.ecef(lon, lat, 321.0)
    t, r = orbit.locate(level)
    assert np.abs(orbit.geolocate(t, r, flat, side=side) - orbit.geolocate(t, r, 321.0, side=side)).max() < 1e-6


def test_of_a_layover_the_point_nearest_to_the_track_is_taken(passing):
    """A mountain whose slope towards the radar is steeper than the look angle: three points lie at one range."""
    orbit, side = passing
    ridge = 200 + 400 * np.exp(-(((LON - 12.03) / 0.003) ** 2)) + 0 * LAT[:, None]
    steep = model(ridge)
    top = sarcl.wgs84.ecef(12.03, 41.98, 600.0)
    t, r = orbit.locate(top)
    found = orbit.geolocate(t, r, steep, side=side)
    seen = orbit.view(t, np.stack([found, top]))
    assert seen.slant_range == pytest.approx(np.array([r, r]), abs=1e-6) and abs(seen.squint[0]) < 1e-9
    assert seen.ground_range[0] < seen.ground_range[1] - 500  # the foot of the mountain, or before it
    lon, lat, height = sarcl.wgs84.geodetic(found)
    assert height == pytest.approx(float(steep.heights_at(lon, lat)), abs=1e-6)


def test_ranges_beyond_the_model_name_where_it_ends(passing):
    orbit, side = passing
    t, r = orbit.locate(sarcl.wgs84.ecef([12.03, 12.3], 41.98, 300.0))
    with pytest.raises(
        ValueError, match=r"slant range\[1\] = .* meets no terrain of the elevation model: near longitude"
    ):
        orbit.geolocate(t, r, model(np.full((41, 61), 300.0)), side=side)


@pytest.mark.parametrize("middle", [(1e6, -3e5), (3e5, 0.0), (1e5, 1e4), (0.0, 0.0)])
def test_a_polar_map_is_read_beside_and_over_the_pole(middle):
    pyproj = pytest.importorskip("pyproj")
    to_degrees = pyproj.Transformer.from_crs(3413, 4326, always_xy=True)  # polar stereographic, m
    x, y = (m + np.linspace(-2e5, 2e5, 81) for m in middle)
    model = sarcl.ElevationModel(*to_degrees.transform(*np.meshgrid(x, y)), np.tile(x / 1e3, (81, 1)))
    some = np.random.default_rng(0).uniform(-0.99, 0.99, (2, 300)) * 2e5 + np.array(middle)[:, None]
    found = model.heights_at(*to_degrees.transform(*some))
    # bilinear in another projection than the map's: (5 km/(2 x 6371 km))^2 of a cell's 5 m, and the scale's change
    assert np.abs(found - some[0] / 1e3).max() <= 2e-3
    outside = to_degrees.transform(middle[0] + np.array([2.1e5, 0, 9e5]), middle[1] + np.array([0, -2.1e5, 3e5]))
    assert np.isnan(model.heights_at(*outside)).all()
    assert np.isnan(model.heights_at(0.0, -90.0))


def test_a_map_across_the_antimeridian_has_longitudes_of_either_sign():
    x, y = np.meshgrid(np.linspace(-1, 1, 41), np.linspace(-17, -16, 21))
    model = sarcl.ElevationModel((180 + x + 0.1 * y + 180) % 360 - 180, y, 100 * x)
    at = np.array([-0.7, -0.1, 0.0, 0.3])
    assert model.heights_at(180 + at - 1.65, np.full(4, -16.5)) == pytest.approx(100 * at, abs=0.02)
    grid = sarcl.ImageGrid.on_terrain(model, spacing=5e3)
    assert np.nanmax(np.abs(grid.positions[..., :2])) < 1.5e5  # the local frame is at the middle of the map


@pytest.mark.parametrize("first", [-180.0, 0.0])
def test_the_last_column_around_the_earth_is_followed_by_the_first(first):
    longitude, latitude = first + np.arange(360.0), np.linspace(-90, 90, 181)
    height = 100 * np.cos(np.radians(longitude)) * np.cos(np.radians(latitude))[:, None]
    model = sarcl.ElevationModel(longitude, latitude, height)
    at = np.array([179.5, -179.5, 180.0, -180.0, 359.7, -0.3, 0.0])
    wanted = 100 * np.cos(np.radians(at)) * np.cos(np.radians(10))
    assert model.heights_at(at, np.full(7, 10.0)) == pytest.approx(wanted, abs=0.005)
    assert model.heights_at(33.0, 90.0) == pytest.approx(0, abs=1e-9)


@pytest.mark.parametrize("change", ["rows", "columns", "both"])
def test_rows_and_columns_may_descend_and_be_uneven(change):
    longitude, latitude = np.cumsum([12.0, 0.01, 0.03, 0.02]), np.cumsum([47.0, 0.02, 0.01])
    height = 1e3 * longitude + 500 * latitude[:, None] - 1.4e5
    rows, columns = (slice(None, None, -1 if change in (name, "both") else 1) for name in ("rows", "columns"))
    model = sarcl.ElevationModel(longitude[columns], latitude[rows], height[rows, columns] % 20e3 / 10)
    assert model.heights_at(12.035, 47.011) == pytest.approx(((12035 + 23505.5 - 1.4e5) % 20e3) / 10, abs=1e-6)


@pytest.mark.parametrize(
    ("longitude", "latitude", "height", "wanted"),
    [
        ([8.0, 8.2, 8.1], [47.0, 47.1], 0.0, r"longitude 8.1 at 2 follows 8.2; it must increase or decrease"),
        ([8.0, 8.1, 8.1], [47.0, 47.1], 0.0, r"longitude 8.1 at 2 follows 8.1"),
        ([8.0, 8.1, 8.2], [47.0, 47.0], 0.0, r"latitude 47 at 1 follows 47"),
        ([8.0, 8.1, 8.2], [47.0, 47.1], 1e6, r"height reaches 1e\+06 m, which no land has; give metres"),
    ],
)
def test_axes_that_go_back_and_heights_of_no_land_are_refused(longitude, latitude, height, wanted):
    with pytest.raises(ValueError, match=wanted):
        sarcl.ElevationModel(longitude, latitude, np.full((2, 3), height))


def test_a_folded_map_is_refused():
    x, y = np.meshgrid([0.0, 1.0, 2.0, 3.0], [0.0, 1.0, 2.0])
    x[1, 2] = 0.5
    with pytest.raises(ValueError, match="folded"):
        sarcl.ElevationModel(x, y + 0.1 * x, np.zeros((3, 4))).heights_at(0.5, 0.5)


def test_places_without_a_number_have_no_height_and_shapes_must_fit():
    model = sarcl.ElevationModel([8.0, 9.0], [47.0, 48.0], [[1.0, 1.0], [1.0, 1.0]])
    assert np.isnan(model.heights_at([np.nan, np.inf, 8.5], [47.5, 47.5, np.nan])).all()
    with pytest.raises(ValueError, match=r"longitude has shape \(3,\) and latitude \(2,\)"):
        model.heights_at([1, 2, 3], [1, 2])
