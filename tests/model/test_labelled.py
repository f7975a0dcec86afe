"""Images and echoes as datasets of xarray, and images in Zarr stores and NetCDF files, to the bit."""

from __future__ import annotations

import builtins
import warnings
from dataclasses import fields, replace

import numpy as np
import pytest

import sarcl

xarray = pytest.importorskip("xarray", reason="no xarray: pip install sarcl[xarray]")
pytest.importorskip("zarr", reason="no zarr: pip install sarcl[xarray]")
pytest.importorskip("h5netcdf", reason="no h5netcdf: pip install sarcl[xarray]")

CHIRP = sarcl.Waveform.chirp(center=9.6e9, bandwidth=600e6, duration=1e-6)
TRACK = sarcl.Trajectory.line(start=(-500, 0, 800), velocity=(0, 50, 0), prf=100, n_pulses=9)
RAW = sarcl.echo(sarcl.Scene.points([[0, 0, 0]]), CHIRP, TRACK)
PLANE = sarcl.backproject(RAW, sarcl.ImageGrid.plane(shape=(20, 30), spacing=(0.2, 0.1)), window="hamming")
FILES = ["image.zarr", "image.nc"]


def of_points(shape):
    points = np.random.default_rng(1).normal(size=(*shape, 3))
    points.reshape(-1, 3)[0] = np.nan  # an empty cell
    return sarcl.backproject(RAW, sarcl.ImageGrid.points(points))


def of_an_orbit():
    orbit = sarcl.Orbit.kepler(7.171e6, 0.001, 1.72, span=(-60, 60))
    point = orbit.geolocate(0.1, 1e6, heights=150.0, side="right")
    track = orbit.trajectory(start=0.0, prf=1000.0, n_pulses=100)
    chirp = sarcl.Waveform.chirp(center=9.6e9, bandwidth=60e6, duration=1e-6)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", sarcl.SarclWarning)
        raw = sarcl.echo(sarcl.Scene.points([point]), chirp, track)
        return sarcl.range_doppler(raw, side="right", heights=150.0), point


IMAGES = {
    "plane": lambda: PLANE,
    "part": lambda: PLANE[3:7, ::2],
    "intensity": lambda: PLANE.multilook((2, 3)),
    "gain of each pixel": lambda: replace(PLANE, gain=np.linspace(0, 3, 600).reshape(20, 30)),
    "list": lambda: of_points((7,)),
    "terrain": lambda: of_points((4, 5)),
    "volume": lambda: of_points((2, 3, 4)),
    "upright plane": lambda: sarcl.Image(
        np.ones((3, 4)), sarcl.ImageGrid.plane(shape=(3, 4), spacing=1, normal=(0, 1, 0))
    ),
    "double": lambda: sarcl.Image(np.full((1, 1), 1 / 3 + 2j / 3), sarcl.ImageGrid.plane(shape=1, spacing=1 / 3)),
    "orbit": lambda: of_an_orbit()[0],
}  # fmt: skip


def assert_same(got, wanted):
    for name in (field.name for field in fields(wanted)):
        a, b = getattr(got, name), getattr(wanted, name)
        if name == "grid":
            assert_same(a, b)
        elif name == "report" and b is not None:
            assert a.to_dict() == b.to_dict()
        elif isinstance(b, np.ndarray) or name == "data":
            a, b = np.asarray(a), np.asarray(b)
            assert a.dtype == b.dtype and a.shape == b.shape and a.tobytes() == b.tobytes(), name
        else:
            assert type(a) is type(b) and a == b, name


@pytest.mark.parametrize("file", FILES)
@pytest.mark.parametrize("case", IMAGES)
def test_an_image_comes_back_bit_for_bit(tmp_path, case, file):
    image = IMAGES[case]()
    image.save(tmp_path / file)
    image.save(tmp_path / file)  # in place of the first
    assert [p.name for p in tmp_path.iterdir()] == [file]
    assert_same(sarcl.read(tmp_path / file), image)


def test_others_read_the_pixels_with_their_positions_and_units(tmp_path):
    for file in FILES:
        PLANE.save(tmp_path / file)
    zarr, netcdf = xarray.open_zarr(tmp_path / FILES[0], consolidated=False), xarray.open_dataset(tmp_path / FILES[1])
    assert (zarr["data"].values == PLANE.data).all()
    assert (netcdf["data_real"].values + 1j * netcdf["data_imag"].values == PLANE.data).all()
    for dataset in (zarr, netcdf):
        pixel = dataset.sel(x=-1.5, y=1.0, method="nearest")
        place = [float(pixel[axis]) for axis in "xyz"]
        assert place == list(PLANE.grid.at(15, 0)) and dataset["x"].attrs["units"] == "m"
        assert (
            complex(pixel["data"] if "data" in pixel else pixel["data_real"] + 1j * pixel["data_imag"])
            == PLANE.data[15, 0]
        )
        assert dataset.attrs["polarization"] == "HH" and dataset.attrs["window"] == "hamming"
        dataset.close()


def test_pixels_of_an_orbit_have_longitude_and_latitude():
    image, point = of_an_orbit()
    dataset = image.to_xarray()
    row, column = np.unravel_index(np.abs(image.data).argmax(), image.shape)
    place = [float(dataset[name][row, column]) for name in ("longitude", "latitude", "height")]
    assert np.linalg.norm(sarcl.wgs84.ecef(*place) - image.grid.at(row, column)) < 1e-6
    assert np.linalg.norm(sarcl.wgs84.ecef(*place) - point) < 10
    assert dataset["times"].dims == ("row",) and dataset["latitude"].attrs["units"] == "degrees_north"


def test_echoes_have_the_coordinates_of_their_rows():
    dataset = RAW.to_xarray()
    assert dataset["samples"].dims == ("row", "sample") and (dataset["samples"].values == RAW.samples[:]).all()
    assert dataset["frequency"].dims == ("sample",) and dataset["frequency"].attrs["units"] == "Hz"
    assert float(dataset["frequency"][3]) == RAW.frequency[0] + 3 * RAW.frequency_step[0]
    assert float(dataset["tx"].sel(axis="z")[4]) == RAW.tx[4, 2] and (dataset["time"].values == RAW.time).all()
    other = replace(RAW, frequency=RAW.frequency + np.arange(9) * 1e6)
    assert float(other.to_xarray()["frequency"][2, 3]) == other.frequency[2] + 3 * other.frequency_step[2]


@pytest.mark.parametrize("file", FILES)
def test_a_long_report_comes_back(tmp_path, file):
    report = replace(PLANE.report, plan={"words": "x" * 100_000})
    replace(PLANE, report=report).save(tmp_path / file)
    assert sarcl.read(tmp_path / file).report.plan["words"] == "x" * 100_000


def test_bad_datasets_are_refused_in_words(tmp_path):
    with pytest.raises(ValueError, match=r"not an image of this sarcl .* open it with xarray"):
        xarray.Dataset({"data": ("x", [1.0])}).to_netcdf(tmp_path / "other.nc", engine="h5netcdf")
        sarcl.read(tmp_path / "other.nc")
    for file in FILES:
        PLANE.to_xarray().drop_vars("data").assign_attrs(sarcl_file="image", format=1).to_zarr(
            tmp_path / "no_data.zarr", mode="w", consolidated=False
        )
        with pytest.raises(ValueError, match="damaged: it holds no whole image"):
            sarcl.read(tmp_path / "no_data.zarr")
        (tmp_path / "folder" / file).mkdir(parents=True)
        (tmp_path / "folder" / file / "mine.txt").touch()
        with pytest.raises(OSError, match=r"cannot write .*(by what is no Zarr store|it is a folder)"):
            PLANE.save(tmp_path / "folder" / file)
        assert (tmp_path / "folder" / file / "mine.txt").exists()
        with pytest.raises(FileNotFoundError, match="there is no folder"):
            PLANE.save(tmp_path / "nowhere" / file)
    PLANE.save(tmp_path / "cut.nc")
    whole = (tmp_path / "cut.nc").read_bytes()
    (tmp_path / "cut.nc").write_bytes(whole[: len(whole) // 2])
    with pytest.raises(ValueError, match=r"truncated|damaged"):
        sarcl.read(tmp_path / "cut.nc")
    PLANE.save(tmp_path / "cut.zarr")
    (tmp_path / "cut.zarr" / "zarr.json").write_text("{")
    with pytest.raises(ValueError, match="damaged or no dataset"):
        sarcl.read(tmp_path / "cut.zarr")


def test_netcdf_files_have_checksums_which_other_programs_remove_and_damage_is_refused_without_them(tmp_path):
    h5py, path = pytest.importorskip("h5py"), tmp_path / "image.nc"
    PLANE.save(path)
    data = bytearray(path.read_bytes())
    place = data.index(PLANE.data.real.tobytes())
    data[place] ^= 1
    path.write_bytes(data)
    with pytest.raises(ValueError, match="is damaged: data_real is not as it was written"):
        sarcl.read(path)
    with h5py.File(path, "r+") as file:
        file["data_real"][0, 0] = 7.0
    assert sarcl.read(path).data[0, 0].real == 7.0
    changed = path.read_bytes()
    path.write_bytes(changed.replace(b"OHDR", b"OHDX"))
    with pytest.raises(ValueError, match=r"image\.nc' is damaged"):
        sarcl.read(path)
    path.write_bytes(changed)
    with h5py.File(path, "r+") as file:
        file["more"] = h5py.ExternalLink("other.nc", "/data")
    with pytest.raises(ValueError, match=r"image\.nc' leads into another file"):
        sarcl.read(path)


@pytest.mark.parametrize("missing", ["xarray", "zarr", "h5netcdf"])
def test_a_missing_package_is_an_error_that_names_the_extra(tmp_path, monkeypatch, missing):
    original = builtins.__import__

    def without(name, *args, **options):
        if name == missing:
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)
        return original(name, *args, **options)

    monkeypatch.setattr(builtins, "__import__", without)
    with pytest.raises(ImportError, match=rf"needs the package {missing}: pip install sarcl\[xarray\]"):
        PLANE.save(tmp_path / ("image.nc" if missing == "h5netcdf" else "image.zarr"))
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("file", FILES)
@pytest.mark.parametrize("error", [KeyboardInterrupt(), OSError(28, "No space left on device")])
@pytest.mark.parametrize("moves", [0, 1])
def test_what_stood_there_stays_where_a_file_cannot_be_finished(tmp_path, monkeypatch, file, error, moves):
    PLANE.save(tmp_path / file)
    rename = type(tmp_path).rename

    def stopped(path, target):
        if path.name == "new" or (path.name == file and not moves):
            raise error
        return rename(path, target)

    monkeypatch.setattr(type(tmp_path), "rename", stopped)
    with pytest.raises(
        type(error), match="^$" if isinstance(error, KeyboardInterrupt) else "cannot write .* No space left"
    ):
        replace(PLANE, data=2 * PLANE.data).save(tmp_path / file)
    assert [p.name for p in tmp_path.iterdir()] == [file]
    assert_same(sarcl.read(tmp_path / file), PLANE)
