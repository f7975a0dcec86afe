"""GeoTIFF maps read back as images: sarcl's own, those that other programs changed, and theirs."""

from __future__ import annotations

import warnings

import numpy as np
import pytest

import sarcl

rasterio = pytest.importorskip("rasterio", reason="no rasterio: pip install sarcl[maps]")
pyproj = pytest.importorskip("pyproj", reason="no pyproj: pip install sarcl[maps]")

UTM = "EPSG:32633"
BOUNDS = 291000.3, 4641000.7, 291500.3, 4641400.7
RNG = np.random.default_rng(5)


def example(heights=100.0, dtype=np.complex64, gain=7.0):
    grid = sarcl.ImageGrid.on_map(UTM, bounds=BOUNDS, spacing=(2.0, 2.5), heights=heights)
    data = (RNG.normal(size=grid.shape) + 1j * RNG.normal(size=grid.shape)).astype(dtype)
    fields = {"tx": [1e6, 2e6, 3.3e6], "band": [9.5e9, 9.7e9], "time": [0.0, 1 / 3], "frequency": 9.6e9}
    return sarcl.Image(data, grid, gain=gain, window="taylor 35 5", polarization="VV", **fields)


@pytest.mark.parametrize("dtype", [np.complex64, np.complex128])
def test_complex_maps_return_bit_for_bit(tmp_path, dtype):
    image = example(dtype=dtype)
    image.save(tmp_path / "x.tif")
    back = sarcl.read(tmp_path / "x.tif")
    np.testing.assert_array_equal(back.data, image.normalized())
    assert back.dtype == dtype and back.gain == 1
    np.testing.assert_array_equal(back.grid.positions, image.grid.positions)
    np.testing.assert_array_equal(back.grid.map_axes, image.grid.map_axes)
    for name in ("tx", "band", "time", "frequency", "window", "polarization"):
        np.testing.assert_array_equal(getattr(back, name), getattr(image, name))
    assert back.frame == "earth-fixed" and back.grid.crs == UTM
    back.save(tmp_path / "y.tif")
    np.testing.assert_array_equal(sarcl.read(tmp_path / "y.tif").data, back.data)


@pytest.mark.parametrize("value", ["amplitude", "db"])
def test_amplitudes_and_decibels_return_as_intensities(tmp_path, value):
    image = example()
    image.save(tmp_path / "x.tif", value=value)
    back = sarcl.read(tmp_path / "x.tif")
    assert not back.is_complex
    np.testing.assert_allclose(back.decibels(), image.decibels(), atol=1e-5)
    back.save(tmp_path / "y.tif", value=value)
    with rasterio.open(tmp_path / "x.tif") as a, rasterio.open(tmp_path / "y.tif") as b:
        np.testing.assert_allclose(b.read(1), a.read(1), atol=0 if value == "amplitude" else 2e-6)


def test_pixels_without_data_have_no_gain(tmp_path):
    gain = np.full(example().shape, 3.0)
    gain[4:7, 5] = 0
    image = example(gain=gain)
    image.save(tmp_path / "x.tif")
    back = sarcl.read(tmp_path / "x.tif")
    np.testing.assert_array_equal(back.gain == 0, gain == 0)
    np.testing.assert_array_equal(back.data[gain > 0], image.normalized()[gain > 0].astype(np.complex64))
    assert (back.data[gain == 0] == 0).all()


@pytest.mark.parametrize("value", ["complex", "db"])
def test_heights_of_pixels_return(tmp_path, value):
    """Those of whole centimetres to the bit, others to 5 nm, which further copies keep to the bit."""
    shape = example().shape
    for heights, error in ((np.round(RNG.uniform(100, 3000, shape), 2), 0.0), (RNG.uniform(100, 3000, shape), 1e-8)):
        heights[3, 5] = np.nan
        image = example(heights=heights, dtype=np.complex128 if error else np.complex64)
        image.save(tmp_path / "x.tif", value=value)
        back = sarcl.read(tmp_path / "x.tif")
        np.testing.assert_allclose(back.grid.positions, image.grid.positions, rtol=0, atol=error)
        back.save(tmp_path / "y.tif", value=value)
        again = sarcl.read(tmp_path / "y.tif")
        np.testing.assert_array_equal(again.grid.positions, back.grid.positions)
        with rasterio.open(tmp_path / "x.tif") as file:
            assert file.descriptions == (value, "height", "height remainder") and file.units[1:] == ("m", "m")
            np.testing.assert_allclose(file.read(2).real[::-1], heights, atol=2e-4)


def test_a_hill_of_one_pixel_between_others_is_kept(tmp_path):
    heights = np.full(example().shape, 100.0)
    heights[77, 101] = 130.0
    image = example(heights=heights)
    image.save(tmp_path / "x.tif")
    np.testing.assert_array_equal(sarcl.read(tmp_path / "x.tif").grid.positions, image.grid.positions)


def test_heights_of_a_resampled_image_are_those_between_its_pixels(tmp_path):
    """A slope on a grid turned against the map: heights rise with the distance."""
    corner = sarcl.wgs84.ecef(12.49, 41.9, 100.0)
    east, north, up = sarcl.wgs84.local_axes(12.49, 41.9)
    along, across = np.cos(0.3) * east + np.sin(0.3) * north, np.cos(0.3) * north - np.sin(0.3) * east
    i, j = np.mgrid[:60, :80][..., None] * 2.0
    positions = corner + i * across + j * along + 0.2 * j * up
    image = sarcl.Image(
        np.ones((60, 80), np.complex64), sarcl.ImageGrid.points(positions), frequency=1e6, tx=2 * corner
    )
    image.save(tmp_path / "x.tif", value="amplitude", crs=UTM)
    places = sarcl.read(tmp_path / "x.tif").grid.positions
    places = places[np.isfinite(places[..., 0])] - corner
    assert len(places) > 3000
    np.testing.assert_allclose(places @ up, 0.2 * places @ along, atol=2e-3)


def test_heights_whose_bands_another_program_removed_are_told(tmp_path):
    shape = example().shape
    image = example(heights=np.linspace(100.0, 150.0, shape[0])[:, None] + np.zeros(shape))
    image.save(tmp_path / "x.tif")
    with rasterio.open(tmp_path / "x.tif") as file:
        pixels = file.read([1])
    changed(tmp_path / "x.tif", tmp_path / "y.tif", pixels=pixels, count=1)
    with pytest.warns(sarcl.SarclWarning, match="has pixels at 100 to 150 m: positions are 125 m above"):
        back = sarcl.read(tmp_path / "y.tif")
    np.testing.assert_allclose(sarcl.wgs84.geodetic(back.grid.positions)[2], 125.0, atol=1e-6)


def changed(source, target, **changes):
    """A copy by rasterio, as other programs make them, with another profile, pixels or tags."""
    pixels, tags = changes.pop("pixels", None), changes.pop("tags", None)
    with warnings.catch_warnings(), rasterio.open(source) as file:
        warnings.simplefilter("ignore")
        profile = {**file.profile, "driver": "GTiff", **changes}
        pixels = file.read() if pixels is None else pixels
        with rasterio.open(target, "w", **profile) as copy:
            copy.write(pixels)
            copy.update_tags(**(file.tags() if tags is None else tags))
    return target


@pytest.mark.filterwarnings("ignore:.*does not say the heights:sarcl.SarclWarning")
def test_positions_follow_the_map_of_a_part_by_another_program(tmp_path):
    """Cut by rasterio, with the tags of the map: places by pyproj."""
    example().save(tmp_path / "x.tif")
    window = rasterio.windows.Window(10, 20, 30, 40)
    with rasterio.open(tmp_path / "x.tif") as file:
        pixels, transform = file.read(window=window), file.transform
    a, e = transform.a, transform.e
    transform = rasterio.Affine(a, 0.0, transform.c + 10 * a, 0.0, e, transform.f + 20 * e)
    part = {"pixels": pixels, "transform": transform, "width": 30, "height": 40}
    back = sarcl.read(changed(tmp_path / "x.tif", tmp_path / "y.tif", **part))
    np.testing.assert_array_equal(back.data, pixels[0][::-1])
    longitude, latitude, height = sarcl.wgs84.geodetic(back.grid.positions[-1, 0])  # of the north-western pixel
    x, y = pyproj.Transformer.from_crs("EPSG:4326", UTM, always_xy=True).transform(longitude, latitude)
    np.testing.assert_allclose((x, y), (transform.c + transform.a / 2, transform.f + transform.e / 2), atol=1e-6)
    assert height == pytest.approx(100.0, abs=1e-6)


def test_complex_maps_of_other_programs_are_read(tmp_path):
    example().save(tmp_path / "x.tif")
    path = changed(tmp_path / "x.tif", tmp_path / "y.tif", tags={"TX": "not of sarcl"})
    with pytest.warns(sarcl.SarclWarning, match="does not say the heights of its pixels: positions are 0 m"):
        back = sarcl.read(path)
    assert back.frequency is None and back.is_complex


def test_files_that_are_no_image_are_refused_by_name(tmp_path):
    example().save(tmp_path / "x.tif")
    shape = example().shape
    data = (tmp_path / "x.tif").read_bytes()
    (tmp_path / "short.tif").write_bytes(data[: len(data) // 2])
    real, integers = RNG.normal(size=(1, *shape)).astype(np.float32), np.ones((1, *shape), np.uint8)
    turned = rasterio.Affine(2.0, 0.3, BOUNDS[0], 0.3, -2.0, BOUNDS[3])
    for name, changes, words in (
        ("crs", {"crs": None}, "no coordinate reference system"),
        ("turned", {"transform": turned}, "is rotated"),
        ("real", {"pixels": real, "dtype": "float32", "tags": {}}, "has float32 pixels, which may be"),
        ("byte", {"pixels": integers, "dtype": "uint8", "nodata": None, "tags": {}}, "has uint8 pixels"),
        ("said", {"pixels": real, "dtype": "float32"}, "is said to be complex"),
        ("infinite", {"pixels": np.full((1, *shape), np.inf, np.complex64)}, "infinite"),
        ("two", {"pixels": np.ones((2, *shape), np.complex64), "count": 2, "tags": {}}, "has 2 bands"),
        ("numbers", {"tags": {"SOFTWARE": "sarcl 1", "VALUE": "complex over", "TX": "1 2"}}, "the tag TX = '1 2'"),
        ("short", None, "truncated or damaged"),
    ):
        path = tmp_path / f"{name}.tif"
        if changes is not None:
            changed(tmp_path / "x.tif", path, **changes)
        with pytest.raises(ValueError, match=f"{name}.tif' {'.*' if name == 'short' else ''}.*{words}"):
            sarcl.read(path)
