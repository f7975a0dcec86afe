"""Images on maps: grids of a map's pixels, and GeoTIFF files of images on them or resampled to them."""

from __future__ import annotations

import builtins
import warnings
from dataclasses import replace

import numpy as np
import pytest
from helpers.cases import quick_of

import sarcl

rasterio = pytest.importorskip("rasterio", reason="no rasterio: pip install sarcl[maps]")
pyproj = pytest.importorskip("pyproj", reason="no pyproj: pip install sarcl[maps]")

LONGITUDE, LATITUDE, HEIGHT = 12.5, 41.9, 160.0
UTM = "EPSG:32633"
ORIGIN = sarcl.wgs84.ecef(LONGITUDE, LATITUDE, 0.0)
AXES = sarcl.wgs84.local_axes(LONGITUDE, LATITUDE)
X, Y = pyproj.Transformer.from_crs("EPSG:4326", UTM, always_xy=True).transform(LONGITUDE, LATITUDE)
CHIRP = sarcl.Waveform.chirp(center=9.6e9, bandwidth=150e6, duration=1e-6)
DEGREES = 0.004
MODEL = sarcl.ElevationModel(  # a slope with a hill on it
    LONGITUDE + np.linspace(-DEGREES, DEGREES, 61),
    LATITUDE + np.linspace(-DEGREES, DEGREES, 61),
    HEIGHT + 30 * np.linspace(-1, 1, 61)[:, None] + 20 * np.cos(np.linspace(-4, 4, 61))[None, :],
)
PLACE = LONGITUDE + 2e-4, LATITUDE - 1.5e-4  # of the reflector
TARGET = sarcl.wgs84.ecef(*PLACE, float(MODEL.heights_at(*PLACE)))


def local_track(start, velocity, n=201, aperture=300.0):
    """A straight track, local coordinates, m and a unit vector, Earth-fixed."""
    path = np.asarray(start, float) + np.linspace(-aperture / 2, aperture / 2, n)[:, None] * velocity
    return sarcl.Trajectory(np.arange(n) / 100, ORIGIN + path @ AXES)


AIRCRAFT = local_track((-9e3, 0.0, 10e3), (0, 1.0, 0))
BESIDE = local_track((-7e3, 4e3, 9e3), (0, 1.0, 0))
SATELLITE = local_track((-500e3, 0.0, 780e3), (0.1, 0.995, 0), aperture=9e3)
SECOND = local_track((-450e3, 60e3, 770e3), (0.1, 0.995, 0), aperture=9e3)
PASSES = {
    "aircraft": (AIRCRAFT, None), "aircraft, bistatic": (AIRCRAFT, BESIDE),
    "orbit": (SATELLITE, None), "orbit, bistatic": (SATELLITE, SECOND),
}  # fmt: skip


def echoes(track, receiver=None):
    return sarcl.echo(
        sarcl.Scene.points([TARGET]), CHIRP, track, receiver=receiver, reference=TARGET, range_window=(-150, 150)
    )


def focused(raw, grid, **options):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", sarcl.SarclWarning)
        return sarcl.backproject(raw, grid, **options)


def utm(half=40.0, spacing=0.5, heights=HEIGHT, dx=0.0, dy=0.0):
    x, y = pyproj.Transformer.from_crs("EPSG:4326", UTM, always_xy=True).transform(*PLACE)
    bounds = x - half + dx, y - half + dy, x + half + dx, y + half + dy
    return sarcl.ImageGrid.on_map(UTM, bounds=bounds, spacing=spacing, heights=heights)


@pytest.fixture(scope="module")
def raw():
    return echoes(SATELLITE)


@pytest.fixture(scope="module")
def image(raw):
    return focused(raw, utm(heights=MODEL), tolerance=1e-4)


def opened(path):
    """Band 1, row 0 in the south as in images, and the file's profile with overviews and tags."""
    with rasterio.open(path) as file:
        return file.read(1)[::-1], {**file.profile, "overviews": file.overviews(1), "tags": file.tags()}


def off_reflector(path):
    """Pixels from the brightest pixel's centre to the reflector's longitude and latitude, (column, row)."""
    with rasterio.open(path) as file:
        pixels = file.read(1)
        pixels = np.abs(pixels) if np.iscomplexobj(pixels) else pixels  # dB are negative
        row, column = np.unravel_index(int(np.nanargmax(pixels)), pixels.shape)
        to_map = pyproj.Transformer.from_crs("EPSG:4326", file.crs.to_wkt(), always_xy=True)
        place = fractional(file.transform, *to_map.transform(*PLACE))
    return np.array(place) - (column + 0.5, row + 0.5)


def fractional(transform, x, y):
    """(column, row) of map coordinates, from the outer corner of the first pixel."""
    return (x - transform.c) / transform.a, (y - transform.f) / transform.e


# ---- grids


def test_pixels_of_a_map_lie_at_its_coordinates_on_the_terrain():
    grid = sarcl.ImageGrid.on_map(UTM, bounds=(X, Y, X + 40, Y + 30), spacing=(2, 5), heights=MODEL)
    assert grid.shape == (15, 8) and grid.crs == UTM
    longitude, latitude, height = sarcl.wgs84.geodetic(grid.positions)
    x, y = pyproj.Transformer.from_crs("EPSG:4326", UTM, always_xy=True).transform(longitude, latitude)
    assert np.allclose(x, X + 2.5 + 5 * np.arange(8), atol=1e-6)
    assert np.allclose(y.T, Y + 1 + 2 * np.arange(15), atol=1e-6)
    assert np.allclose(height, MODEL.heights_at(longitude, latitude), atol=1e-6)
    part = grid.part(slice(3, None, 2), slice(1, 7))
    assert np.allclose(part.map_axes, (X + 7.5, Y + 7, 5, 4))


def test_a_map_takes_bounds_and_spacing_of_the_elevation_model():
    grid = sarcl.ImageGrid.on_map("EPSG:4326", heights=MODEL)
    x, y, dx, dy = grid.map_axes
    assert np.isclose(x - dx / 2, MODEL.longitude.min()) and np.isclose(y - dy / 2, MODEL.latitude.min())
    across = np.linalg.norm(grid.positions[30, 31] - grid.positions[30, 30])
    assert abs(across / MODEL.spacing - 1) < 0.02
    heights = np.arange(6.0).reshape(2, 3)
    listed = sarcl.ImageGrid.on_map(4326, bounds=(12, 41, 12.3, 41.2), spacing=0.1, heights=heights)
    assert np.allclose(sarcl.wgs84.geodetic(listed.positions)[2], heights)


BAD = [
    ("no coordinate reference system", {"crs": "EPSG:999999", "bounds": (0, 0, 1, 1), "spacing": 0.1}),
    ("neither geographic nor projected", {"crs": "EPSG:4978", "bounds": (0, 0, 1, 1), "spacing": 0.1}),
    (r"on_map needs bounds=.*\(deg\)", {"crs": 4326, "spacing": 0.1}),
    (r"on_map needs spacing=.*\(m\)", {"crs": UTM, "bounds": (X, Y, X + 9, Y + 9)}),
    (r"west < east", {"crs": UTM, "bounds": (X, Y, X - 9, Y + 9), "spacing": 1}),
    (r"1 x 1 pixels; give both .* CRS \(deg\)", {"crs": 4326, "bounds": (12, 41, 12.1, 41.1), "spacing": 1}),
    (r"units of the CRS EPSG:32633 \(m\)", {"crs": UTM, "bounds": (12, 41, 12.1, 41.1), "spacing": 1e-3}),
    (r"units of the CRS EPSG:4326 \(deg\)", {"crs": 4326, "bounds": (X, Y, X + 9, Y + 9), "spacing": 1}),
    (
        "EPSG:27700 does not reach .*made for longitudes -9.01 to 2.01 .* take crs='EPSG:3263",
        {"crs": 27700, "heights": MODEL},
    ),
    (r"heights has shape \(2, 2\), but the map \(9, 9\)",
     {"crs": UTM, "bounds": (X, Y, X + 9, Y + 9), "spacing": 1, "heights": np.zeros((2, 2))}),
    ("no data within bounds", {"crs": UTM, "bounds": (X + 9e3, Y, X + 9009, Y + 9), "spacing": 1, "heights": MODEL}),
]  # fmt: skip


@pytest.mark.parametrize(("words", "options"), BAD, ids=[words[:30] for words, _ in BAD])
def test_bad_maps_are_refused_with_what_to_give(words, options):
    with pytest.raises(ValueError, match=words):
        sarcl.ImageGrid.on_map(**options)


# ---- files


@pytest.mark.parametrize("name", quick_of(["aircraft", "orbit, bistatic"], PASSES))
def test_a_reflector_lies_within_half_a_pixel_of_its_longitude_and_latitude(tmp_path, name):
    """On a map of terrain, pixels as they are; and on planes and other maps, resampled."""
    data = echoes(*PASSES[name])
    on_terrain = focused(data, utm(heights=MODEL))
    height = float(MODEL.heights_at(*PLACE))
    turned = sarcl.ImageGrid.plane(shape=(150, 170), spacing=(0.6, 0.5), x_axis=(0.8, 0.6, 0))
    plane = focused(data, turned.on_earth(*PLACE, height))
    for image, crs in ((on_terrain, None), (on_terrain, "EPSG:4326"), (plane, None), (plane, "EPSG:3857")):
        for value in ("complex", "amplitude", "db"):
            image.save(tmp_path / "x.tif", value=value, crs=crs)
            assert np.abs(off_reflector(tmp_path / "x.tif")).max() <= 0.5, (crs, value)


def test_pixels_on_the_map_itself_are_written_as_they_are(tmp_path, image):
    for value, wanted in (
        ("complex", image.normalized()), ("amplitude", np.abs(image.normalized())), ("db", image.decibels())
    ):  # fmt: skip
        image.save(tmp_path / "x.tif", value=value)
        got, profile = opened(tmp_path / "x.tif")
        # a rounding of float32 amplitudes is 1e-6 dB, also of a pixel near 0 dB
        assert np.allclose(got, wanted, rtol=1e-6, atol=2e-6 if value == "db" else 0) and got.dtype == wanted.dtype
        assert profile["crs"] == rasterio.CRS.from_string(UTM) and np.isnan(profile["nodata"])
        assert profile["tags"]["POLARIZATION"] == "HH" and profile["tags"]["VALUE"].startswith(value)
    assert [p.name for p in tmp_path.iterdir()] == ["x.tif"]


def test_empty_cells_and_pixels_that_no_row_saw_have_no_data(tmp_path, image):
    positions, gain = image.grid.positions.copy(), np.full(image.shape, float(image.gain))
    positions[:20], gain[:, :10] = np.nan, 0.0
    grid = replace(sarcl.ImageGrid.points(positions), crs=image.grid.crs, map_axes=image.grid.map_axes)
    holes = replace(image, grid=grid, gain=gain)
    for options in ({}, {"spacing": 0.5}):
        holes.save(tmp_path / "x.tif", value="db", **options)
        got, profile = opened(tmp_path / "x.tif")
        x, y, _, _ = grid.map_axes
        column, row = fractional(
            profile["transform"], x, y
        )  # of the grid's first pixel: resampled maps begin elsewhere
        i = np.arange(len(got))[:, None] - (len(got) - 0.5 - row)
        j = np.arange(got.shape[1]) - (column - 0.5)
        has_data = (i > 20) & (j > 10) & (i < 159) & (j < 159)
        assert np.isfinite(got[has_data]).all() and has_data.sum() > 130 * 140
        assert np.isnan(got[(i < 19) | (j < 8)]).all()


def test_complex_values_between_pixels_are_those_of_an_image_focused_there(tmp_path, raw):
    """Resampled from a map in degrees to metres: within 3e-4 of the norm, for kernels of 77 dB and sums to 1e-5."""
    height = float(MODEL.heights_at(*PLACE))
    direct = focused(raw, utm(half=15.0, heights=height), tolerance=1e-5)
    half = np.array([40 / 82.9e3, 40 / 111e3])  # degrees
    bounds = (*(np.array(PLACE) - half), *(np.array(PLACE) + half))
    degrees = sarcl.ImageGrid.on_map(4326, bounds=bounds, spacing=(4e-6, 5e-6), heights=height)
    other = focused(raw, degrees, tolerance=1e-5)
    other.save(tmp_path / "x.tif", crs=UTM, spacing=0.5)
    got, profile = opened(tmp_path / "x.tif")
    x, y, _, _ = direct.grid.map_axes
    # the map's pixels begin at multiples of the spacing; the direct image is focused again at these
    column, row = fractional(profile["transform"], x, y)
    shift = (column - 0.5) % 1 * 0.5, (got.shape[0] - row - 0.5) % 1 * 0.5
    direct = focused(raw, utm(half=15.0, heights=height, dx=-shift[0], dy=-shift[1]), tolerance=1e-5).normalized()
    i, j = int(got.shape[0] - row - 0.5), int(column - 0.5)
    part = got[i : i + direct.shape[0], j : j + direct.shape[1]]
    assert np.linalg.norm(part - direct) < 3e-4 * np.linalg.norm(direct)


def test_wide_pixels_hold_the_mean_power(tmp_path, image):
    """Energy per area stays; the mean of two by two pixels that coincide is that of multilook."""
    image.save(tmp_path / "x.tif", value="amplitude", spacing=4.0)
    got, _ = opened(tmp_path / "x.tif")
    energy = np.sum(np.abs(image.normalized()) ** 2) * 0.25
    assert abs(np.nansum(got.astype(float) ** 2) * 16 / energy - 1) < 0.02
    detected = image.multilook(2)
    detected.save(tmp_path / "x.tif", value="amplitude")
    got, profile = opened(tmp_path / "x.tif")
    assert np.allclose(got, np.sqrt(detected.data) / image.gain, rtol=1e-5) and profile["transform"].a == 1.0
    detected.save(tmp_path / "x.tif", value="db", crs=4326)
    assert np.abs(off_reflector(tmp_path / "x.tif")).max() <= 0.5


def test_range_doppler_images_become_maps(tmp_path):
    orbit = sarcl.Orbit.kepler(7.171e6, 0.001, 1.72, span=(-60, 60))
    point = orbit.geolocate(0.1, 9.5e5, heights=HEIGHT, side="right")
    track = orbit.trajectory(center=0.1, prf=1200.0, n_pulses=600)
    chirp = sarcl.Waveform.chirp(center=5.4e9, bandwidth=60e6, duration=1e-6)
    data = sarcl.echo(sarcl.Scene.points([point]), chirp, track, range_window=(-90, 90), reference=point)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", sarcl.SarclWarning)
        image = sarcl.range_doppler(data, side="right", heights=HEIGHT)
    image.save(tmp_path / "x.tif")
    with rasterio.open(tmp_path / "x.tif") as file:
        pixels = np.abs(file.read(1))
        place = np.array(np.unravel_index(int(np.nanargmax(pixels)), pixels.shape)) + 0.5
        to_map = pyproj.Transformer.from_crs("EPSG:4326", file.crs.to_wkt(), always_xy=True)
        longitude, latitude, _ = sarcl.wgs84.geodetic(point)
        column, row = fractional(file.transform, *to_map.transform(float(longitude), float(latitude)))
        direct = focused(data, sarcl.ImageGrid.points(point[None])).normalized()[0]
        assert abs(row - place[0]) <= 0.5 and abs(column - place[1]) <= 0.5
        assert 0.9 < np.nanmax(pixels) / abs(direct) < 1.01


def test_overviews_halve_and_average_in_power(tmp_path, image):
    rng = np.random.default_rng(0)
    grid = sarcl.ImageGrid.on_map(UTM, bounds=(X, Y, X + 1301, Y + 1100), spacing=1.0, heights=0.0)
    speckle = rng.normal(size=grid.shape) + 1j * rng.normal(size=grid.shape)
    wide = replace(image, data=speckle.astype(np.complex64), grid=grid, gain=1.0)
    for value in ("db", "amplitude", "complex"):
        wide.save(tmp_path / "x.tif", value=value)
        fine, profile = opened(tmp_path / "x.tif")
        assert profile["overviews"] == [2, 4]
        with rasterio.open(tmp_path / "x.tif", overview_level=0) as file:
            coarse = file.read(1)[:, :-1]  # the last column has one pixel
        fine = fine[::-1, :1300]
        if value == "complex":
            assert (coarse == fine[::2, ::2]).all()
            continue
        power = 10 ** (fine / 10) if value == "db" else fine**2
        mean = power.reshape(550, 2, 650, 2).mean(axis=(1, 3))
        assert np.allclose(coarse, 10 * np.log10(mean) if value == "db" else np.sqrt(mean), rtol=1e-4, atol=1e-4)


def test_layers_are_those_of_the_pixels(tmp_path, image):
    layers = image.layers(MODEL)
    assert {n: (v.shape, v.dtype.name) for n, v in layers.items()} == {
        "layover": (image.shape, "bool"), "shadow": (image.shape, "bool"), "incidence": (image.shape, "float64"),
    }  # fmt: skip
    towards = image.tx - image.grid.positions[80, 80]
    rise = [
        image.grid.positions[81, 80] - image.grid.positions[80, 80],
        image.grid.positions[80, 81] - image.grid.positions[80, 80],
    ]
    normal = np.cross(rise[1], rise[0])
    angle = np.arccos(normal @ towards / np.linalg.norm(normal) / np.linalg.norm(towards))
    assert abs(layers["incidence"][80, 80] - angle) < 1e-3 and not layers["shadow"].any()
    image.save(tmp_path / "x.tif", value="db", layers=MODEL)
    with rasterio.open(tmp_path / "x.tif") as file:
        assert file.descriptions == ("db", "layover", "shadow", "incidence", "height", "height remainder")
        assert np.allclose(file.read(4)[::-1], layers["incidence"], atol=1e-6)


def test_images_that_make_no_map_are_refused_with_what_to_do(tmp_path, image):
    path = tmp_path / "x.tif"
    local = sarcl.Image(np.ones((4, 4)), sarcl.ImageGrid.plane(shape=(4, 4), spacing=1.0))
    cases = [
        (ValueError, r"local frame.*ImageGrid.on_map", lambda: local.save(path)),
        (ValueError, "no complex values", lambda: image.multilook(2).save(path)),
        (ValueError, r"would alias in complex pixels; give spacing=\(", lambda: image.save(path, spacing=6.0)),
        (ValueError, "does not reach", lambda: image.save(path, crs=27700)),
        (ValueError, "no coordinate reference system", lambda: image.save(path, crs="UTM 33")),
        (ValueError, "value is 'dB'; choose one of", lambda: image.save(path, value="dB")),
        (ValueError, "layers are real bands", lambda: image.save(path, layers=MODEL)),
        (TypeError, "layers is a bool", lambda: image.save(path, value="db", layers=True)),
        (TypeError, "'spacings'; did you mean 'spacing'", lambda: image.save(path, spacings=1.0)),
        (ValueError, r"value: for maps \(.tif\), and", lambda: image.save(tmp_path / "x.png", value="db")),
        (ValueError, "needs the antennas' positions", lambda: replace(image, tx=None).save(path, spacing=0.4)),
        (ValueError, "needs its centre frequency", lambda: replace(image, frequency=None).save(path, spacing=0.4)),
        (ValueError, "layers needs the antennas", lambda: replace(image, tx=None).layers(MODEL)),
        (FileNotFoundError, "there is no folder", lambda: image.save(tmp_path / "no" / "x.tif")),
    ]
    for kind, words, call in cases:
        with pytest.raises(kind, match=words):
            call()
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("missing", ["rasterio", "pyproj"])
def test_a_missing_package_is_an_error_that_names_the_extra(tmp_path, monkeypatch, image, missing):
    original = builtins.__import__

    def without(name, *args, **options):
        if name == missing:
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)
        return original(name, *args, **options)

    monkeypatch.setattr(builtins, "__import__", without)
    with pytest.raises(ImportError, match=rf"package {missing}: pip install sarcl\[maps\]"):
        image.save(tmp_path / "x.tif")
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("error", [KeyboardInterrupt(), OSError(28, "No space left on device")])
def test_what_stood_there_stays_where_a_file_cannot_be_finished(tmp_path, monkeypatch, image, error):
    (tmp_path / "x.tif").write_text("mine")

    def stopped(*_):
        raise error

    monkeypatch.setattr(type(tmp_path), "rename", stopped)
    with pytest.raises(type(error)):
        image.save(tmp_path / "x.tif")
    assert [(p.name, p.read_text()) for p in tmp_path.iterdir()] == [("x.tif", "mine")]


def test_a_grid_of_a_map_comes_back_from_files(tmp_path, image):
    image.save(tmp_path / "x.h5")
    again = sarcl.read(tmp_path / "x.h5")
    assert again.grid.crs == UTM and (again.grid.map_axes == image.grid.map_axes).all()
    assert (again[4:8, 2:].grid.map_axes == image[4:8, 2:].grid.map_axes).all()


def test_pictures_have_the_axes_of_the_map(image):
    from sarcl.figures.decibels import PixelAxes

    axes = PixelAxes((1e-5, 2e-5), (41.9, 12.5), ("latitude", "longitude"), "deg", (111e3, 83e3))
    assert axes.axis(100, 0)[:3] == pytest.approx(("latitude (deg)", 41.899495, 41.900495))
    shape = image.show().info["frame"]
    assert shape[2] - shape[0] == shape[3] - shape[1]  # as many metres, as many pixels of the picture
    low = np.array(PLACE) - 2e-4
    grid = sarcl.ImageGrid.on_map(4326, bounds=(*low, *(low + 4e-4)), spacing=1e-5, heights=HEIGHT)
    box = replace(image, data=np.ones(grid.shape), grid=grid).show().info["frame"]
    assert (box[2] - box[0]) / (box[3] - box[1]) == pytest.approx(np.cos(np.radians(LATITUDE)), rel=0.02)
