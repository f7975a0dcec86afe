"""Elevation models: places on WGS84, heights above the ellipsoid, what is missing, and what is refused.

The formulas of WGS84 are written out here once more, so that nothing is compared with itself.
"""

from __future__ import annotations

import builtins
import logging

import numpy as np
import pytest

import sarcl
from sarcl.scene.triangles import centroids, normals

rasterio = pytest.importorskip("rasterio", reason="no rasterio: pip install sarcl[maps]")

A, F = 6378137.0, 1 / 298.257223563
E2 = F * (2 - F)
TOLERANCE = {
    "ecef": 2e-9,  # m: float64 at 6.4e6 m
    "local": 5e-9,  # m: the same, turned
    "map projection": 1e-4,  # m: what the projection library promises for UTM near its meridian
}


def ecef(lon, lat, h):
    lon, lat = np.radians(lon), np.radians(lat)
    n = A / np.sqrt(1 - E2 * np.sin(lat) ** 2)
    return np.stack(
        [
            (n + h) * np.cos(lat) * np.cos(lon),
            (n + h) * np.cos(lat) * np.sin(lon),
            (n * (1 - E2) + h) * np.sin(lat),
        ],
        axis=-1,
    )


def geodetic(p):
    """Longitude, latitude, degrees, and height, m, of ECEF positions (..., 3): fixed point, to float64."""
    x, y, z = np.moveaxis(p, -1, 0)
    rho, lat = np.hypot(x, y), np.arctan2(z, np.hypot(x, y) * (1 - E2))
    for _ in range(12):
        n = A / np.sqrt(1 - E2 * np.sin(lat) ** 2)
        lat = np.arctan2(z + E2 * n * np.sin(lat), rho)
    h = rho * np.cos(lat) + (z + E2 * n * np.sin(lat)) * np.sin(lat) - n
    return np.degrees(np.arctan2(y, x)), np.degrees(lat), h


def enu(p, lon, lat, h=0.0):
    """ECEF positions (..., 3) as east, north, up about a point."""
    origin = ecef(lon, lat, h)
    lon, lat = np.radians(lon), np.radians(lat)
    d = p - origin
    x, y, z = np.moveaxis(d, -1, 0)
    towards = np.cos(lon) * x + np.sin(lon) * y
    return np.stack(
        [
            -np.sin(lon) * x + np.cos(lon) * y,
            -np.sin(lat) * towards + np.cos(lat) * z,
            np.cos(lat) * towards + np.sin(lat) * z,
        ],
        axis=-1,
    )


def test_the_formulas_of_this_file_meet_known_places():
    assert ecef(0, 0, 0) == pytest.approx([A, 0, 0])
    assert ecef(90, 0, 10) == pytest.approx([0, A + 10, 0], abs=1e-9)
    assert ecef(0, 90, 0) == pytest.approx([0, 0, 6356752.314245], abs=1e-6)  # the semi-minor axis
    assert geodetic(ecef(12.5, 42, 100)) == pytest.approx((12.5, 42, 100), rel=1e-9)


# files made here

WEST, NORTH, STEP = 12.0, 42.0, 0.001
Z = np.add.outer(10.0 * np.arange(5), np.arange(7.0) ** 2).astype("f4")  # 5 rows down, 7 columns


def tif(path, z=Z, crs="EPSG:4979", transform=None, **more):
    """A GeoTIFF whose pixel middles begin at (WEST, NORTH) and go on in STEPs to the south and east."""
    attributes = {k: more.pop(k) for k in ("units", "scales", "offsets") if k in more}
    z = np.asarray(z)
    z = z if z.ndim == 3 else z[None]
    if transform is None:
        transform = rasterio.Affine(STEP, 0, WEST - STEP / 2, 0, -STEP, NORTH + STEP / 2)
    with rasterio.open(
        path, "w", driver="GTiff", height=z.shape[1], width=z.shape[2], count=len(z), dtype=z.dtype, crs=crs,
        transform=transform, **more,
    ) as file:  # fmt: skip
        file.write(z)
        for name, value in attributes.items():
            setattr(file, name, value)
    return path


def dem(folder, *args, heights="ellipsoid", bounds=None, center=None, frame="ecef", **made):
    options = {k: made.pop(k) for k in ("geoid", "nodata", "material", "materials", "roughness", "point_roughness")
               if k in made and not (k == "nodata" and made.get("declared"))}  # fmt: skip
    declared = made.pop("declared", None)
    if declared is not None:
        made["nodata"] = declared
    path = tif(folder / "a.tif", *args, **made)
    return sarcl.Scene.from_dem(path, heights=heights, bounds=bounds, center=center, frame=frame, **options)


def places(rows=5, columns=7):
    return np.meshgrid(WEST + STEP * np.arange(columns), NORTH - STEP * np.arange(rows))


def corners(scene):
    """Its corners, each once, sorted."""
    return np.unique(scene.triangles.reshape(-1, 3), axis=0)


def assert_same(got, wanted, within):
    wanted = wanted.reshape(-1, 3)
    assert got.shape == wanted.shape
    distance = np.linalg.norm(got[:, None] - wanted, axis=-1)
    assert distance.min(axis=0).max() <= within and distance.min(axis=1).max() <= within


def test_points_are_the_middles_of_pixels_on_wgs84(tmp_path):
    scene = dem(tmp_path)
    assert len(scene.triangles) == 2 * 4 * 6 and not scene.two_sided.any()
    assert_same(corners(scene), ecef(*places(), Z), TOLERANCE["ecef"])


def test_a_file_that_says_it_stores_points_is_read_at_its_points(tmp_path):
    """AREA_OR_POINT=Point moves the georeference by half a pixel in the file; the reader moves it back."""
    path = tif(tmp_path / "a.tif")
    with rasterio.open(path, "r+") as file:
        file.update_tags(AREA_OR_POINT="Point")
    with rasterio.open(path) as file:
        assert file.tags()["AREA_OR_POINT"] == "Point"
        x, y = file.xy(0, 0)
    lon, lat, _ = geodetic(corners(sarcl.Scene.from_dem(path, frame="ecef")))
    assert (lon.min(), lat.max()) == pytest.approx((x, y), abs=1e-9)


def test_the_local_frame_is_east_north_up_about_its_center(tmp_path):
    for center in ((12.002, 41.999), (12.3, 42.2, 50.0)):
        scene = dem(tmp_path, frame="local", center=center)
        assert_same(corners(scene), enu(ecef(*places(), Z), *center), TOLERANCE["local"])
    middle = WEST + 3 * STEP, NORTH - 2 * STEP
    assert_same(corners(dem(tmp_path, frame="local")), enu(ecef(*places(), Z), *middle), TOLERANCE["local"])


def test_far_from_the_center_the_earth_falls_away(tmp_path):
    flat = np.zeros((2, 1001), "f4")
    scene = dem(tmp_path, flat, frame="local", center=(WEST, NORTH))
    x, _, z = scene.bounds[1] - scene.bounds[0]
    radius = A / np.sqrt(1 - E2 * np.sin(np.radians(NORTH)) ** 2)  # across the meridian, about
    assert z == pytest.approx(x**2 / 2 / radius, rel=0.02) and z > 500


def test_facets_face_up_whichever_way_the_rows_run(tmp_path):
    c, s = STEP * np.cos(0.5), STEP * np.sin(0.5)
    turned = rasterio.Affine(c, s, WEST, s, -c, NORTH)
    for transform in (
        None,
        rasterio.Affine(STEP, 0, WEST, 0, STEP, NORTH),  # south first
        rasterio.Affine(-STEP, 0, WEST, 0, -STEP, NORTH),  # east first
        rasterio.Affine(0, STEP, WEST, -STEP, 0, NORTH),
        turned,
    ):
        scene = dem(tmp_path, np.zeros((5, 7), "f4"), transform=transform)
        lon, lat, _ = (np.radians(v) for v in geodetic(centroids(scene.triangles)))
        up = np.stack([np.cos(lat) * np.cos(lon), np.cos(lat) * np.sin(lon), np.sin(lat)], axis=-1)
        assert (normals(scene.triangles) * up).sum(axis=1).min() > 1 - 1e-6
        local = dem(tmp_path, np.zeros((5, 7), "f4"), transform=transform, frame="local")
        assert normals(local.triangles)[:, 2].min() > 1 - 1e-6


def test_bounds_take_the_points_within(tmp_path):
    bounds = WEST + 0.9 * STEP, NORTH - 3 * STEP, WEST + 4 * STEP, NORTH - 0.5 * STEP
    lon, lat = places()
    inside = (lon > bounds[0]) & (lon < bounds[2] + 1e-9) & (lat > bounds[1] - 1e-9) & (lat < bounds[3])
    assert inside.sum() == 12
    wanted = ecef(lon[inside], lat[inside], Z[inside])
    assert_same(corners(dem(tmp_path, bounds=bounds)), wanted, TOLERANCE["ecef"])
    far = dem(tmp_path, bounds=(0, 0, 90, 89))
    assert_same(corners(far), ecef(lon, lat, Z), TOLERANCE["ecef"])


def test_a_map_projection_in_metres_is_taken_back_to_degrees(tmp_path):
    """UTM 33: easting 500 km is 15 degrees east, and 1 km of northing there 1/0.9996 km of meridian."""
    step = 1000.0
    transform = rasterio.Affine(step, 0, 499_500, 0, -step, 2_500)
    scene = dem(tmp_path, np.zeros((3, 2), "f4"), crs="EPSG:32633", transform=transform)
    on_meridian = corners(scene)[np.abs(geodetic(corners(scene))[0] - 15) < 1e-9]
    _, lat, h = geodetic(on_meridian)
    assert len(lat) == 3 and np.abs(h).max() < 1e-6
    # meridian arc near the equator: a (1 - e^2) (1 + 3 e^2 sin^2/2 ...) per radian
    fine = np.linspace(0, np.radians(np.sort(lat)), 2001)
    rate = A * (1 - E2) / (1 - E2 * np.sin(fine) ** 2) ** 1.5
    arc = ((rate[1:] + rate[:-1]) / 2 * np.diff(fine, axis=0)).sum(axis=0)
    assert arc * 0.9996 == pytest.approx([0, 1000, 2000], abs=TOLERANCE["map projection"])
    half = dem(
        tmp_path, np.zeros((3, 2), "f4"), crs="EPSG:32633", transform=transform, bounds=(14.9, -0.001, 15.1, 0.01)
    )
    assert len(half.triangles) == 2


def test_units_scales_and_offsets_of_heights(tmp_path):
    for more, factor, offset in (
        ({"units": ("foot",)}, 0.3048, 0),
        ({"units": ("US survey foot",)}, 1200 / 3937, 0),
        ({"scales": (0.1,), "offsets": (5.0,)}, 0.1, 5),
    ):
        _, _, h = geodetic(corners(dem(tmp_path, **more)))
        assert np.sort(np.unique(np.round(h, 6))) == pytest.approx(
            np.unique(np.round(Z * factor + offset, 6)), abs=1e-5
        )


# heights above a geoid


def test_heights_above_a_geoid_become_heights_above_the_ellipsoid(tmp_path):
    lon, lat = places()

    def undulation(lon, lat):
        return 48 + 20 * (lon - WEST) + 30 * (lat - NORTH)

    n = undulation(lon, lat)
    for geoid, wanted in ((48.5, 48.5), (n, n), (undulation, n)):
        scene = dem(tmp_path, heights="EGM96", geoid=geoid, crs="EPSG:4326")
        assert_same(corners(scene), ecef(lon, lat, Z + wanted), TOLERANCE["ecef"])
    # a raster of it, coarser: linear functions are read back exactly
    grid = undulation(*np.meshgrid(WEST - 0.1 + 0.05 * np.arange(6), NORTH + 0.1 - 0.05 * np.arange(6)))
    transform = rasterio.Affine(0.05, 0, WEST - 0.125, 0, -0.05, NORTH + 0.125)
    path = tif(tmp_path / "geoid.tif", grid, crs="EPSG:4326", transform=transform)
    scene = dem(tmp_path, heights="EGM96", geoid=str(path), crs="EPSG:4326")
    assert_same(corners(scene), ecef(lon, lat, Z + n), 1e-7)


@pytest.mark.parametrize("west", [-180.0, 0.0])
@pytest.mark.parametrize("longitude", [-0.3, 179.9, 100.0])
def test_a_raster_of_the_whole_earth_goes_round(tmp_path, west, longitude):
    """Global geoid grids begin at 0 or at -180 degrees; the seam must not show."""
    middle = west + np.arange(0, 360, 0.25) + 0.125
    grid = np.broadcast_to(30 * np.cos(np.radians(middle)), (720, 1440)).astype("f4")
    transform = rasterio.Affine(0.25, 0, west, 0, -0.25, 90)
    path = tif(tmp_path / "geoid.tif", grid, crs="EPSG:4326", transform=transform)
    at = rasterio.Affine(0.1, 0, longitude, 0, -0.1, NORTH)
    scene = dem(tmp_path, np.zeros((4, 7), "f4"), heights="EGM2008", geoid=path, crs="EPSG:4326", transform=at)
    lon, _, h = geodetic(corners(scene))
    assert np.abs(h - 30 * np.cos(np.radians(lon))).max() < 2e-4  # 30 (0.25 degrees)^2/8 by linear interpolation


def test_geoid_zero_is_said_to_be_wrong_by_the_undulation(tmp_path):
    with pytest.warns(
        sarcl.SarclWarning, match=r"heights above 'EGM96', taken as heights above the ellipsoid \(geoid=0\)"
    ):
        scene = dem(tmp_path, heights="EGM96", geoid=0, crs="EPSG:4326")
    assert_same(corners(scene), ecef(*places(), Z), TOLERANCE["ecef"])


def test_a_file_may_say_what_its_heights_are_above(tmp_path):
    above_ellipsoid, above_geoid = tif(tmp_path / "e.tif"), tif(tmp_path / "g.tif", crs="EPSG:9707")
    sarcl.Scene.from_dem(above_ellipsoid)
    with pytest.raises(ValueError, match=r"'g\.tif' has heights above 'EGM96 height', not above the ellip"):
        sarcl.Scene.from_dem(above_geoid)
    with pytest.raises(ValueError, match=r"heights is 'ellipsoid', but DEM 'g\.tif' says .*'EGM96 height'"):
        sarcl.Scene.from_dem(above_geoid, heights="ellipsoid")
    with pytest.raises(ValueError, match="would count the undulation twice"):
        sarcl.Scene.from_dem(above_ellipsoid, geoid=48.0)
    with pytest.raises(ValueError, match="does not say what its heights are above; pass heights='ellipsoid', or the"):
        sarcl.Scene.from_dem(tif(tmp_path / "n.tif", crs="EPSG:4326"))
    assert len(sarcl.Scene.from_dem(above_geoid, heights="egm96", geoid=1.0).triangles) == 48


# what is missing


@pytest.mark.parametrize("hole", ["declared", "told", "nan"])
def test_cells_without_data_have_no_facets_and_are_counted(tmp_path, hole, caplog):
    z = Z.copy()
    z[2, 3] = np.nan if hole == "nan" else -9999
    with caplog.at_level(logging.INFO, "sarcl"):
        scene = dem(tmp_path, z, **{"declared": {"declared": -9999}, "told": {"nodata": -9999}, "nan": {}}[hole])
    assert len(scene.triangles) == 48 - 6  # six triangles share a point within
    assert "left out 6 of 48 facets: no data" in caplog.text and "1 without data" in caplog.text
    _, _, h = geodetic(corners(scene))
    assert h.min() > -1


def test_materials_and_roughness_follow_the_files_rows_past_holes(tmp_path):
    z, kind = Z.copy(), np.zeros((4, 6), int)
    z[0, 0], kind[0], kind[3, 5] = np.nan, 1, 2
    scene = dem(tmp_path, z, material=kind, materials=["sand", "glass", 0.5], roughness=kind / 10.0)
    _, lat, _ = geodetic(centroids(scene.triangles))
    north = lat > NORTH - STEP
    assert {scene.materials[i].name for i in scene.material[north]} == {"glass"} and north.sum() == 10
    assert (scene.roughness[north] == 0.1).all() and (scene.reflectivity == 0.5).sum() == 2


def test_points_move_along_the_vertical_of_their_own_place(tmp_path):
    for frame in ("ecef", "local"):
        still = dem(tmp_path, point_roughness=2.0, frame=frame, center=None)
        moved = still.realized(3)
        origin = (WEST + 3 * STEP, NORTH - 2 * STEP)
        step = (moved.triangles - still.triangles).reshape(-1, 3)
        lon, lat, _ = geodetic(ecef(*places(), Z))
        up = ecef(lon, lat, 1.0) - ecef(lon, lat, 0.0)
        if frame == "local":
            up = enu(up + ecef(*origin, 0.0), *origin)
        length = np.linalg.norm(step, axis=1)
        assert 0.5 < length.max() < 10
        aligned = np.abs(step @ up.reshape(-1, 3).T).max(axis=1) / length
        assert aligned.min() > 1 - 1e-6


# what is refused


def refuse(folder, message, kind=ValueError, **given):
    with pytest.raises(kind, match=message):
        dem(folder, **given)


@pytest.mark.filterwarnings("ignore::rasterio.errors.NotGeoreferencedWarning")
def test_what_is_no_elevation_model_of_a_place_is_refused(tmp_path):
    refuse(tmp_path, "DEM 'a.tif' has no CRS, so its heights belong to no place", crs=None)
    refuse(tmp_path, "has no georeferencing", transform=rasterio.Affine.identity())
    refuse(tmp_path, "has 3 bands; an elevation model has one", z=np.stack([Z] * 3))
    refuse(tmp_path, "has 1 x 7 points; a cell needs two", z=Z[:1])
    refuse(tmp_path, "holds complex64; heights are real", z=Z.astype("c8"))
    refuse(tmp_path, "heights in 'fathom'; known units are metre", units=("fathom",))
    refuse(tmp_path, "every height is nodata", z=np.full((5, 7), -9999.0), declared=-9999)
    void = Z.copy()
    void[1, 2] = -32768
    refuse(tmp_path, "height of -32768 m at row 1, column 2 .*pass nodata=-32768", z=void)
    lonely = np.full((5, 7), np.nan, "f4")
    lonely[::2, ::2] = 1
    refuse(tmp_path, "no cell has heights at all its corners", z=lonely)
    with pytest.raises(FileNotFoundError, match=r"nowhere\.tif' does not exist"):
        sarcl.Scene.from_dem(tmp_path / "nowhere.tif")
    (tmp_path / "text.tif").write_text("no raster")
    with pytest.raises(ValueError, match=r"'text\.tif' cannot be read .*damaged or no raster"):
        sarcl.Scene.from_dem(tmp_path / "text.tif")


@pytest.mark.parametrize("crs, at", [("EPSG:4979", 94.0), ("EPSG:4979", np.inf), ("EPSG:32633", 1e40)])
def test_a_raster_beyond_the_earth_is_refused(tmp_path, crs, at):
    beyond = rasterio.Affine(STEP, 0, WEST, 0, -STEP, at)
    message = "DEM 'a.tif' (has points that are on no place of the Earth|cannot be read)"
    refuse(tmp_path, message, crs=crs, transform=beyond)


def test_invalid_places_are_refused(tmp_path):
    refuse(tmp_path, r"bounds hold no cell of DEM 'a.tif', which reaches over \(11.99950, ", bounds=(1, 2, 3, 4))
    refuse(tmp_path, r"give \(west, south, east, north\) in degrees", bounds=(13, 42, 12, 43))
    refuse(tmp_path, r"give \(west, south, east, north\) in degrees", bounds=(5e5, 4e6, 6e5, 5e6))
    refuse(tmp_path, r"bounds has shape \(3,\)", bounds=(1, 2, 3))
    refuse(tmp_path, r"center \(42, 12\) is more than 1000 km from the heights", frame="local", center=(42, 12))
    refuse(tmp_path, "center has 1 numbers", frame="local", center=(42,))
    refuse(tmp_path, "leave it out with frame='ecef'", center=(12, 42))
    refuse(tmp_path, "frame is 'utm'; choose one of 'local', 'ecef'", frame="utm")
    refuse(tmp_path, "point_roughness reaches -1 m", point_roughness=-1.0)


def test_invalid_geoids_are_refused(tmp_path):
    for geoid, message in (
        (np.zeros((2, 2)), r"geoid has shape \(2, 2\), wanted \(5, 7\)"),
        (np.nan, "geoid is nan"),
        (lambda lon, lat: lon * np.nan, r"geoid\[0, 0\] is nan"),
        (tmp_path / "none.tif", r"none\.tif' does not exist"),
    ):
        with pytest.raises((ValueError, FileNotFoundError), match=message):
            dem(tmp_path, heights="EGM96", geoid=geoid, crs="EPSG:4326")
    path = tif(tmp_path / "small.tif", np.ones((4, 4)), crs="EPSG:4326", transform=rasterio.Affine(1, 0, 0, 0, -1, 10))
    with pytest.raises(ValueError, match=r"geoid 'small.tif' covers .* not all of the heights"):
        dem(tmp_path, heights="EGM96", geoid=path, crs="EPSG:4326")


def test_without_rasterio_the_message_says_what_to_install(tmp_path, monkeypatch):
    real = builtins.__import__

    def without(name, *args, **kwargs):
        if name.startswith("rasterio"):
            raise ImportError(name)
        return real(name, *args, **kwargs)

    path = tif(tmp_path / "a.tif")
    monkeypatch.setattr(builtins, "__import__", without)
    with pytest.raises(ImportError, match=r"pip install sarcl\[maps\]"):
        sarcl.Scene.from_dem(path)


# files that nobody here made


def a_file(folder, name):
    path = folder / "dem" / name
    if not path.is_file():
        pytest.skip(f"no dem/{name} in the data folder: set SARCL_DATA")
    return path


def test_rome(data_folder):
    """360 x 360 points of one second of arc from 12.45 E, 42.05 N, whole metres above EGM96."""
    path = a_file(data_folder, "Rome-30m-DEM.tif")
    with pytest.raises(ValueError, match="above 'EGM96 height'"):
        sarcl.Scene.from_dem(path)
    undulation = 48.0
    scene = sarcl.Scene.from_dem(path, geoid=undulation, frame="ecef")
    lon, lat, h = geodetic(scene.triangles.reshape(-1, 3))
    assert np.abs(h - undulation - np.rint(h - undulation)).max() < 1e-6
    assert (h.min(), h.max()) == pytest.approx((5 + undulation, 115 + undulation), abs=1e-6)
    column, row = (lon - 12.45) * 3600, (42.05 - lat) * 3600
    for v in (column, row):
        assert np.abs(v - np.rint(v)).max() < 1e-5 and (round(v.min()), round(v.max())) == (0, 359)
    with rasterio.open(path) as file:
        stored = file.read(1)
    assert (stored[np.rint(row).astype(int), np.rint(column).astype(int)] == np.rint(h - undulation)).all()
    assert len(scene.triangles) == 2 * 359 * 359 and not scene.two_sided.any()

    bounds, center = (12.48, 41.98, 12.50, 42.00), (12.49, 41.99)
    local = sarcl.Scene.from_dem(path, geoid=undulation, bounds=bounds, center=center)
    inside = (lon > 12.48 - 1e-9) & (lon < 12.5 + 1e-9) & (lat > 41.98 - 1e-9) & (lat < 42 + 1e-9)
    wanted = enu(np.unique(scene.triangles.reshape(-1, 3)[inside], axis=0), *center)
    assert len(local.triangles) == 2 * 72 * 72 and len(wanted) == 73 * 73
    got = corners(local)
    order = [np.lexsort(np.round(p[:, 1::-1] / 5).T) for p in (got, wanted)]  # points are 20 m apart and more
    assert np.abs(got[order[0]] - wanted[order[1]]).max() <= TOLERANCE["local"]
    # 72 seconds of latitude and of longitude, by the radii of curvature at 41.99 degrees
    s2 = np.sin(np.radians(41.99)) ** 2
    north = A * (1 - E2) / (1 - E2 * s2) ** 1.5 * np.radians(0.02)
    east = A / np.sqrt(1 - E2 * s2) * np.cos(np.radians(41.98)) * np.radians(0.02)  # widest in the south
    size = local.bounds[1] - local.bounds[0]
    assert size[:2] == pytest.approx([east, north], rel=3e-4)  # heights of 150 m widen it by 2e-5, slopes of rows more


def test_himalaya(data_folder):
    """360 x 504 points from 81.405 E, 28.345 N that do not say what they are above."""
    path = a_file(data_folder, "dem_himalayas_E81p5_N28p3_short.tiff")
    with pytest.raises(ValueError, match="does not say what its heights are above"):
        sarcl.Scene.from_dem(path)
    scene = sarcl.Scene.from_dem(path, heights="ellipsoid", frame="ecef", material="dry soil")
    assert len(scene.triangles) == 2 * 359 * 503 and scene.materials[0].name == "dry soil"
    lon, lat, h = geodetic(corners(scene))
    assert len(h) == 360 * 504
    assert (lon.min(), lon.max()) == pytest.approx((81.405, 81.405 + 503 / 3600), abs=1e-7)
    assert (lat.min(), lat.max()) == pytest.approx((28.345 - 359 / 3600, 28.345), abs=1e-7)
    with rasterio.open(path) as file:
        stored = file.read(1)
    assert np.sort(h) == pytest.approx(np.sort(stored.ravel().astype(float)), abs=1e-6)
    # 5 m a pixel of relief on cells of 27 x 31 m: every facet still faces up
    up = np.stack(
        [np.cos(np.radians(28.3)) * np.cos(np.radians(81.47)), np.cos(np.radians(28.3)) * np.sin(np.radians(81.47)),
         np.sin(np.radians(28.3))]
    )  # fmt: skip
    assert (normals(scene.triangles) @ up).min() > 0.1
