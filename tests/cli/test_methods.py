"""`sarcl focus --method`: each method's image is its function's, and options of other methods are refused."""

from __future__ import annotations

import numpy as np
import pytest

import sarcl
from sarcl.cli import parser
from sarcl.papers import listing

ORBIT = sarcl.Orbit.kepler(7.171e6, 0.001, 1.72, span=(-60, 60))
CENTER = ORBIT.geolocate(0.064, 1e6, heights=200.0)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A folder with orbit.h5: echoes of a point 200 m above the ellipsoid, right of an orbit's track, and local.h5."""
    here = tmp_path_factory.mktemp("raw")
    chirp = sarcl.Waveform.chirp(center=5.4e9, bandwidth=60e6, duration=10e-6)
    track = ORBIT.trajectory(start=0.0, prf=1000.0, n_pulses=128)
    point = sarcl.Scene.points([CENTER])
    sarcl.echo(point, chirp, track, range_window=(-150, 150), check=False).save(here / "orbit.h5")
    line = sarcl.Trajectory.line(start=(-3e3, -20, 3e3), velocity=(0, 100, 0), prf=200.0, n_pulses=80)
    sarcl.echo(sarcl.Scene.points([[0, 0, 0]]), chirp, line, range_window=(-60, 60), check=False).save(
        here / "local.h5"
    )
    return here


@pytest.fixture
def here(folder, monkeypatch):
    monkeypatch.chdir(folder)
    return folder


def run(*argv):
    assert parser.main([str(a) for a in argv]) == 0


def refused(capsys, *argv):
    assert parser.main([str(a) for a in argv]) == 2
    said = capsys.readouterr().err
    assert said.startswith("sarcl: error: ") and said.count("\n") == 1
    return said


def test_range_doppler_is_the_function(here, capsys):
    argv = ["focus", "orbit.h5", "--method", "range_doppler", "--side", "right", "--heights", "200"]
    run(*argv, "-o", "rd.h5", "-o", "rd.png", "--window", "hamming")
    image = sarcl.read("rd.h5")
    wanted = sarcl.range_doppler(sarcl.read("orbit.h5"), side="right", heights=200.0, window="hamming")
    assert np.array_equal(image.data, wanted.data) and np.array_equal(image.grid.positions, wanted.grid.positions)
    assert np.array_equal(image.grid.times, wanted.grid.times) and (here / "rd.png").stat().st_size > 1000
    assert "1.0e-02 allowed" in capsys.readouterr().out
    run("measure", "rd.h5", "--near", *CENTER)
    assert "peak/gain        1" in capsys.readouterr().out
    run(*argv, "--dry-run", "--tolerance", "2e-2", "--times", "0.05", "0.08", "--ranges", "999990", "1000010")
    said = capsys.readouterr().out
    assert "range-Doppler: about" in said and "zero-Doppler times x slant ranges" in said
    run(
        *argv,
        "--times",
        "0.05",
        "0.08",
        "--ranges",
        "999990",
        "1000010",
        "--azimuth-beam",
        "0.3",
        "--doppler",
        "0",
        "-o",
        "b.h5",
    )
    image = sarcl.read("b.h5")
    assert image.grid.times[0] == 0.05 and image.grid.times[-1] <= 0.08 and image.grid.ranges[0] == 999990


def test_heights_may_be_an_elevation_model(here, capsys):
    rasterio = pytest.importorskip("rasterio", reason="no rasterio: pip install sarcl[maps]")
    longitude, latitude, _ = sarcl.wgs84.geodetic(CENTER)
    with rasterio.open(
        "dem.tif", "w", driver="GTiff", height=21, width=21, count=1, dtype="float32", nodata=-9999, crs="EPSG:4326",
        transform=rasterio.Affine(0.002, 0, float(longitude) - 0.021, 0, -0.002, float(latitude) + 0.021),
    ) as file:  # fmt: skip
        file.write(np.full((21, 21), 180.0, np.float32), 1)
    argv = ["focus", "orbit.h5", "--method", "range_doppler", "--side", "right", "--heights", "dem.tif"]
    assert "heights='EGM96' for SRTM" in refused(capsys, *argv, "-o", "x.h5")
    run(*argv, "--heights-above", "EGM96", "--geoid", "20", "-o", "dem.h5")
    heights = sarcl.wgs84.geodetic(sarcl.read("dem.h5").grid.positions)[2]
    assert heights == pytest.approx(200.0, abs=1e-3)


def test_images_become_maps_where_their_place_is_known(here, capsys):
    rasterio = pytest.importorskip("rasterio", reason="no rasterio: pip install sarcl[maps]")
    argv = ["focus", "orbit.h5", "--side", "right", "--heights", "200", "--shape", "40", "40"]
    run(*argv, "-o", "x.tif", "-o", "x.h5", "--map-value", "db", "--map-crs", "EPSG:4326")
    with rasterio.open("x.tif") as file:
        assert file.crs.to_epsg() == 4326 and file.descriptions == ("db",)
        longitude, latitude, _ = sarcl.wgs84.geodetic(sarcl.read("x.h5").grid.center)
        assert file.bounds.left < longitude < file.bounds.right and file.bounds.bottom < latitude < file.bounds.top
    assert "no coordinate reference system" in refused(capsys, *argv, "-o", "y.tif", "--map-crs", "UTM")
    assert "local frame" in refused(capsys, "focus", "local.h5", "-o", "y.tif")
    assert not (here / "y.tif").exists()


def test_polar_format_and_backproject_choose_a_plane_on_the_earth(here, capsys):
    argv = ["focus", "orbit.h5", "--side", "right", "--heights", "200", "--shape", "32", "32", "--spacing", "3", "3"]
    run(*argv, "--method", "polar_format", "-o", "p.h5")
    run(*argv, "--tolerance", "1e-2", "-o", "d.h5")
    polar, exact = sarcl.read("p.h5"), sarcl.read("d.h5")
    assert np.linalg.norm(polar.grid.center - CENTER) < 20  # where the reference ranges meet: half a delay later
    assert np.array_equal(polar.grid.center, exact.grid.center)
    assert polar.grid.normal == pytest.approx(sarcl.wgs84.up(*sarcl.wgs84.geodetic(CENTER)[:2]), abs=1e-5)
    neglected = float(polar.report.plan["plane-wave phase error"].split()[0])
    difference = np.asarray(polar.data) - np.asarray(exact.data)
    assert np.linalg.norm(difference) <= (neglected + 0.02) * np.linalg.norm(np.asarray(exact.data))
    capsys.readouterr()
    run(*argv, "--method", "polar_format", "--dry-run")
    assert "polar format: about" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--method", "range_doppler"], "give side='left' or side='right'"),
        (["--method", "range_doppler", "--side", "right", "--near", 5], "near is for doppler='data'"),
        (["--near", 5], "--near is for range_doppler; --method auto"),
        ([], r"give side='left' or 'right' of it (--side)"),
        (
            ["--method", "range_doppler", "--side", "right", "--center", 1, 2, 3],
            "--center is for backproject or polar_format",
        ),
        (
            ["--method", "range_doppler", "--side", "right", "--grid", "x.toml"],
            "--grid is for backproject or polar_format",
        ),
        (["--method", "polar_format", "--side", "right", "--wrap"], "--wrap is for backproject; --method polar_format"),
        (["--method", "polar_format", "--tile", "1/2"], "--tile is for backproject"),
        (["--times", 0, 1], "--times is for range_doppler; --method auto"),
        (["--center", *CENTER, "--side", "right"], "--side places the grid that is chosen"),
        (
            ["--method", "range_doppler", "--side", "left", "--heights", "none.tif"],
            "DEM file 'none.tif' does not exist",
        ),
        (["--method", "range_doppler", "--side", "left", "--geoid", "3"], "--geoid is for --heights FILE"),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)
def test_what_a_method_does_not_take_is_refused(here, capsys, options, said):
    assert said in refused(capsys, "focus", "orbit.h5", *options)


def test_local_echoes_take_no_side_of_the_earth(here, capsys):
    assert "the echoes are in local coordinates" in refused(capsys, "focus", "local.h5", "--side", "left")
    run("focus", "local.h5", "--method", "range_doppler", "-o", "local_rd.h5")  # the side is told by the origin
    assert np.abs(sarcl.read("local_rd.h5").grid.positions[..., 2]).max() < 1e-6


def test_help_names_every_paper(capsys):
    with pytest.raises(SystemExit):
        parser.main(["papers", "--help"])
    said = capsys.readouterr().out
    for line in listing().splitlines():
        assert line.split()[0] in said
