"""Scenarios of orbits: state vectors, places on the Earth, and the functions that make echoes and images."""

from __future__ import annotations

import numpy as np
import pytest

import sarcl
from sarcl.scenario.scenario import Scenario, load, loads

TEXT = """
[waveform.chirp]
center = 5.4e9
bandwidth = 40e6
duration = 10e-6

[orbit.kepler]
semi_major_axis = 7.17e6
eccentricity = 0.001
inclination = 1.72
epoch = "2024-03-01T05:00:00"
span = [-300, 300]

[trajectory.orbit]
prf = 1000
duration = 0.2

[place]
longitude = 127.86
latitude = 6.74
height = 250

[[scene.points]]
positions = [[0, 0, 0], [30, 20, 5]]

[echo]
range_window = [-250, 250]
reference = [30, 20, 5]
"""
ORBIT = sarcl.Orbit.kepler(7.17e6, 0.001, 1.72, epoch="2024-03-01T05:00:00", span=(-300, 300))
PLACE = (127.86, 6.74, 250.0)
ORIGIN, AXES = sarcl.wgs84.ecef(*PLACE), sarcl.wgs84.local_axes(*PLACE[:2])


def test_a_scenario_of_an_orbit_is_its_calls():
    scenario = loads(TEXT)
    t, _ = ORBIT.locate(ORIGIN)
    track = ORBIT.trajectory(center=float(t), prf=1000, duration=0.2)
    made = scenario.build_track()
    assert len(made) == 200 and not made.stop_and_go
    assert np.array_equal(made.positions, track.positions) and np.array_equal(made.times, track.times)
    local = np.array([[0.0, 0, 0], [30, 20, 5]])
    scene = sarcl.Scene.points(ORIGIN + local @ AXES)
    assert np.abs(scenario.build_scene().positions - scene.positions).max() < 1e-8
    raw = scenario.simulate()
    chirp = sarcl.Waveform.chirp(center=5.4e9, bandwidth=40e6, duration=10e-6)
    wanted = sarcl.echo(scene, chirp, track, range_window=(-250, 250), reference=scene.positions[1])
    assert raw.report.plan["receiver"] == "at the echo's arrival"
    assert np.linalg.norm(raw.samples - wanted.samples) <= 1e-6 * np.linalg.norm(wanted.samples)


@pytest.mark.parametrize(
    ("table", "t"),
    [
        ("start = 99.0", 99.0),
        ('start = "2024-03-01T05:01:39"', 99.0),
        ("start = 2024-03-01T05:01:39", 99.0),
        ("start = 2024-03-01T06:01:39+01:00", 99.0),
        ("center = 99.0", 99.0 - 199 / 2000),
        ("center = 2024-03-01T05:01:39Z", 99.0 - 199 / 2000),
    ],
)
def test_pulses_begin_or_are_centred_at_seconds_or_dates(table, t):
    scenario = loads(TEXT.replace("duration = 0.2", f"n_pulses = 200\n{table}"))
    assert scenario.build_track().times[0] == pytest.approx(t, abs=1e-6)
    assert loads(scenario.dumps()).tables == scenario.tables


def test_an_orbit_of_a_file_lies_beside_the_scenario(tmp_path, monkeypatch):
    t, names = 10.0 * np.arange(30, 42) - 250, ("X", "Y", "Z", "VX", "VY", "VZ")
    states = ""
    for seconds, row in zip(t, np.hstack([ORBIT.positions(t), ORBIT.velocities(t)]), strict=True):
        values = "".join(f"<{k}>{v:.9f}</{k}>" for k, v in zip(names, row, strict=True))
        date = np.datetime64("2024-03-01T05:00:00") + np.timedelta64(int(seconds), "s")
        states += f"<OSV><UTC>UTC={date}</UTC>{values}</OSV>"
    (tmp_path / "o.EOF").write_text(f"<Earth_Explorer_File>{states}</Earth_Explorer_File>")
    text = TEXT[: TEXT.index("[orbit.kepler]")] + '[orbit]\nfile = "o.EOF"\n\n' + TEXT[TEXT.index("[trajectory") :]
    (tmp_path / "s.toml").write_text(text)
    monkeypatch.chdir("/")
    scenario = load(tmp_path / "s.toml")
    assert scenario.build_orbit().epoch == np.datetime64("2024-03-01T05:00:50")
    middle = scenario.build_track().positions[100]
    assert np.linalg.norm(middle - loads(TEXT).build_track().positions[100]) < 1e-2
    assert "right of the track" in scenario.describe_orbit() and "2024-03-01 05:01:39.9" in scenario.describe_orbit()


@pytest.mark.parametrize("kind", ["kepler", "states", "tle"])
def test_orbits_of_python_go_to_files_and_back(kind):
    if kind == "tle":
        pytest.importorskip("sgp4", reason="no sgp4: pip install sarcl[orbits]")
        orbit = sarcl.Orbit.tle(
            "1 00005U 58002B   00179.78495062  .00000023  00000-0  28098-4 0  4753",
            "2 00005  34.2682 348.7242 1859667 331.7664  19.3264 10.82419157413667",
        )
    elif kind == "states":
        t = np.arange(0.0, 101, 10)
        orbit = sarcl.Orbit.states(t, ORBIT.positions(t), ORBIT.velocities(t), "2024-03-01T05:00:00.5")
    else:
        orbit = sarcl.Orbit.kepler(7.17e6, 0.001, 1.72, 0.3, 0.4, 0.5, j2=True)
    scenario = Scenario(orbit=orbit)
    again = loads(scenario.dumps()).build_orbit()
    assert (again.epoch, again.span) == (orbit.epoch, orbit.span)
    assert np.array_equal(again.positions([10.0, 33.3]), orbit.positions([10.0, 33.3]))


def test_the_track_of_an_orbit_stays_one_in_a_file():
    track = ORBIT.trajectory(start=99.9, prf=1000.0, n_pulses=8, attitude="yaw", look=0.5)
    again = loads(Scenario(trajectory=track).dumps()).build_track()
    assert not again.stop_and_go
    for name in ("times", "positions", "velocities", "accelerations", "attitude"):
        assert np.array_equal(getattr(again, name), getattr(track, name))


def test_range_doppler_takes_side_and_height_from_the_place():
    scenario = loads(TEXT + "\n[range_doppler]\n")
    raw = scenario.simulate()
    forecast = scenario.plan_focus(raw)
    image = scenario.focus(raw)
    assert forecast.method == "range-Doppler" and forecast.predicted_error == image.report.predicted_error
    wanted = sarcl.range_doppler(raw, side="right", heights=250.0)
    assert np.array_equal(image.data, wanted.data)
    assert np.array_equal(image.grid.positions, wanted.grid.positions)
    assert scenario.has_image and not scenario.needs_grid
    assert "side right" in scenario.describe_image() and "heights 250" in scenario.describe_image()
    with pytest.raises(ValueError, match="grid of its own"):
        scenario.focus(raw, sarcl.ImageGrid.plane(shape=3, spacing=1))


def test_polar_format_and_backproject_focus_on_a_plane_of_the_place(tmp_path):
    text = TEXT + "\n[grid.plane]\nshape = [24, 24]\nspacing = [2, 2]\ncenter = [30, 20, 5]\n"
    polar, oracle = loads(text + "[polar_format]\ntolerance = 1e-3\n"), loads(text)
    grid = polar.build_grid()
    assert np.abs(grid.center - (ORIGIN + np.array([30.0, 20, 5]) @ AXES)).max() < 1e-8
    assert np.allclose(grid.normal, AXES[2]) and np.allclose(grid.x_axis, AXES[0])
    raw = polar.simulate()
    image, exact = polar.focus(raw, out=tmp_path / "p.h5"), oracle.focus(raw)
    neglected = float(image.report.plan["plane-wave phase error"].split()[0])
    assert np.linalg.norm(image.data - exact.data) <= (neglected + 3e-3) * np.linalg.norm(exact.data)
    assert np.array_equal(sarcl.read(tmp_path / "p.h5").data, image.data)
    forecast = polar.plan_focus(raw)
    assert forecast.method == "polar format" and forecast.predicted_error == image.report.predicted_error


@pytest.fixture
def dem(tmp_path):
    """A file of heights above a geoid, 0.01 degrees to each side of the place, without data in a corner."""
    rasterio = pytest.importorskip("rasterio", reason="no rasterio: pip install sarcl[maps]")
    z = np.full((21, 21), 230.0, "f4")
    z[:3, :3] = -9999
    with rasterio.open(
        tmp_path / "dem.tif", "w", driver="GTiff", height=21, width=21, count=1, dtype="float32", nodata=-9999,
        crs="EPSG:4326", transform=rasterio.Affine(0.001, 0, PLACE[0] - 0.0105, 0, -0.001, PLACE[1] + 0.0105),
    ) as file:  # fmt: skip
        file.write(z, 1)
    return tmp_path / "dem.tif"


def test_scene_grid_and_pixels_lie_on_one_elevation_model(dem):
    above = 'file = "dem.tif"\nheights = "EGM96"\ngeoid = 20.0\n'
    text = TEXT[: TEXT.index("[[scene")].replace("height = 250", 'height = 230\nheights = "EGM96"\ngeoid = 20')
    ground = f'[[scene.from_dem]]\n{above}material = "dry soil"\n[[scene.box]]\nsize = [9, 9, 9]\non = [0, 0]\n'
    (dem.parent / "s.toml").write_text(text + ground + f"[grid.on_terrain]\nspacing = 50\n{above}")
    scenario = load(dem.parent / "s.toml")
    assert scenario.build_place().height == 250.0
    scene, grid = scenario.build_scene(), scenario.build_grid()
    heights = sarcl.wgs84.geodetic(scene.triangles.reshape(-1, 3))[2]
    assert heights.min() == pytest.approx(250, abs=0.2) and heights.max() == pytest.approx(259, abs=0.2)
    assert grid.empty is not None and 0 < grid.empty.mean() < 0.1
    assert sarcl.wgs84.geodetic(grid.listed[~grid.empty])[2] == pytest.approx(250, abs=0.01)
    assert np.linalg.norm(np.nanmean(grid.listed, axis=(0, 1)) - ORIGIN) < 100
    (dem.parent / "r.toml").write_text(
        TEXT + f"[range_doppler]\nspacing = [2e-3, 4.0]\n[range_doppler.heights]\n{above}"
    )
    scenario = load(dem.parent / "r.toml")
    image = scenario.focus(scenario.simulate())
    assert sarcl.wgs84.geodetic(image.grid.positions)[2] == pytest.approx(250, abs=0.01)


def test_spectral_echo_makes_the_echoes_that_its_section_describes():
    text = """
[waveform.chirp]
center = 9.6e9
bandwidth = 60e6
duration = 1e-6
[trajectory.line]
start = [-4e3, -10, 3e3]
velocity = [0, 100, 0]
prf = 200
n_pulses = 40
[[scene.points]]
positions = [[0, 0, 0], [5, 3, 0]]
[spectral_echo]
tolerance = 1e-2
range_window = [-40, 40]
"""
    scenario = loads(text)
    raw, forecast = scenario.simulate(), scenario.plan()
    assert raw.report.plan["method"] == forecast.plan["method"] and "spectral" in str(raw.report.plan["method"])
    assert (raw.n_rows, raw.n_samples) == (forecast.n_rows, forecast.n_samples)
    assert forecast.predicted_error == raw.report.predicted_error <= 1e-2
    saras = loads(text + 'variant = "saras"\ntolerance = 0.2\n'.replace("tolerance = 0.2\n", ""))
    assert saras.spectral_echo["variant"] == "saras"


def test_pointing_is_local_to_the_place():
    scenario = loads(TEXT + "\n[pointing.spotlight]\npoint = [30, 20, 5]\n")
    track = scenario.build_track()
    target = ORIGIN + np.array([30.0, 20, 5]) @ AXES
    toward = target - track.positions
    assert np.allclose(track.attitude[:, :, 0], toward / np.linalg.norm(toward, axis=1)[:, None])
    up = sarcl.wgs84.up(*sarcl.wgs84.geodetic(track.positions)[:2])
    assert np.abs((track.attitude[:, :, 1] * up).sum(axis=1)).max() < 1e-9  # azimuth is level
    assert not track.stop_and_go


WRONG = [
    ("prf = 1000", "prff = 1000", r"f\.toml:15: \[trajectory\.orbit\] unknown key 'prff'; did you mean 'prf'"),
    ("duration = 0.2", "", r"\[trajectory\.orbit\] the length of the track is n_pulses or duration"),
    ("duration = 0.2", "duration = 0.2\nstart = 1\ncenter = 2", r"\[trajectory\.orbit\] .*start or center"),
    ("duration = 0.2", 'duration = 0.2\nstart = "noon"', r"\[trajectory\.orbit\] date 'noon'"),
    ("duration = 0.2", "duration = 0.2\nstart = true", r"f\.toml:17: .*start is true, wanted"),
    ("latitude = 6.74", "latitude = 96.74", r"f\.toml:20: \[place\] latitude is 96\.74; give degrees"),
    ("latitude = 6.74", "latitude = -60", r"\[place\] .*is never seen"),
    ("height = 250", 'height = 250\nheights = "EGM96"', r"f\.toml:21: \[place\] .*give the undulation as geoid"),
    ("height = 250", "height = 250\ngeoid = 3", r"\[place\] .*count the undulation twice"),
    ("height = 250", "hight = 250", r"\[place\] unknown key 'hight'; did you mean 'height'"),
    ("[orbit.kepler]", "[orbit.keppler]", r"\[orbit\] unknown table 'keppler'; did you mean 'kepler'"),
    ("eccentricity = 0.001", "eccentricity = 1.2", r"f\.toml:9: \[orbit\.kepler\] eccentricity is 1\.2"),
    ("[echo]", "[spectral_echo]\n[echo]", r"\[spectral_echo\] \[echo\] makes the echoes too; keep one"),
    ("[echo]", "[backproject]\n[range_doppler]\n[echo]", r"\[range_doppler\] \[backproject\] makes the image too"),
    ("[echo]", "[grid.plane]\nshape = 3\nspacing = 1\n[range_doppler]\n[echo]", r"\[grid\] range_doppler makes a grid"),
    ("[echo]", "[range_doppler.heights]\nfle = 'x'\n[echo]", r"\[range_doppler\.heights\] unknown key 'fle'"),
    ("[echo]", "[[scene.from_dem]]\nfile = 'x.tif'\nframe = 'ecef'\n[echo]", r"frame is 'ecef', but \[place\] is"),
]  # fmt: skip


@pytest.mark.parametrize(("old", "new", "said"), WRONG, ids=[said for *_, said in WRONG])
def test_mistakes_name_their_line(old, new, said):
    assert TEXT.count(old) == 1
    with pytest.raises(ValueError, match=said):
        loads(TEXT.replace(old, new), name="f.toml").simulate()


def test_an_orbit_that_no_pulses_use_is_refused():
    text = TEXT.replace(
        "[trajectory.orbit]\nprf = 1000\nduration = 0.2", "[trajectory.circle]\nradius=1\nheight=1\nn_pulses=3"
    )
    with pytest.raises(ValueError, match=r"\[orbit\] has no pulses: \[trajectory\.circle\] describes another track"):
        loads(text).build_track()
    with pytest.raises(ValueError, match=r"\[trajectory\.circle\] is a track in local coordinates"):
        loads(text[: text.index("[orbit")] + text[text.index("[trajectory") :]).build_track()
    with pytest.raises(ValueError, match=r"there is no orbit; add a \[orbit\.kepler\] table"):
        loads(TEXT[: TEXT.index("[orbit")] + TEXT[TEXT.index("[trajectory") :]).build_track()
