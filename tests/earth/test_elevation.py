"""Elevation models: heights at any place, grids on terrain, positions of terrain at a time and range."""

from __future__ import annotations

import warnings

import numpy as np
import pytest

import sarcl
from sarcl.earth.elevation import _bilinear

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
    there = turned.heights_at(_bilinear(lon, at), _bilinear(lat, at))
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
    pytest.importorskip("rasterio", reason="no rasterio: pip install sarcl[dem]")
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
