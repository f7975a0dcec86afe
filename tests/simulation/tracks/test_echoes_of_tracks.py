"""Echoes of a list of tracks are those of one call for each track, to the bit, in memory and in a folder."""

from __future__ import annotations

import json
import logging
import os
import signal
import subprocess
import sys
import threading
import time

import numpy as np
import pytest
from helpers.array_cases import line
from helpers.cases import quick_of

import sarcl
from sarcl import shapes
from sarcl.base.errors import ToleranceMissed
from sarcl.simulation import echo_check

CHIRP = sarcl.Waveform.chirp(center=9.6e9, bandwidth=200e6, duration=1e-6)
TRACKS = [
    sarcl.Trajectory.circle(radius=5e3, height=3e3, start=start, arc=0.02, n_pulses=n)
    for start, n in ((0.0, 6), (1.0, 9), (2.5, 6))
]
RECEIVERS = [
    sarcl.Trajectory.circle(radius=4e3, height=3e3, start=0.3, arc=0.02, n_pulses=len(track)) for track in TRACKS
]
AXIS = np.linspace(-1.5, 1.5, 5)
BOX = shapes.box((0.7, 0.4, 0.5))


def rough(seed=3):
    heights = np.random.default_rng(seed).normal(0, 0.1, (len(AXIS), len(AXIS)))
    return sarcl.Scene.from_heights(AXIS, AXIS, heights, material="dry soil", roughness=0.02, point_roughness=0.02)


def points(seed=1, n=40):
    random = np.random.default_rng(seed)
    return sarcl.Scene.points(random.uniform(-5, 5, (n, 3)), random.standard_normal(n) + 1j * random.standard_normal(n))


def orbits():
    orbit = sarcl.Orbit.kepler(semi_major_axis=6871e3, eccentricity=0.001, inclination=1.7)
    tracks = [orbit.trajectory(start=start, prf=200.0, n_pulses=n) for start, n in ((0.0, 8), (0.5, 10))]
    ground = sarcl.wgs84.geodetic(tracks[0].positions[0])
    place = sarcl.wgs84.ecef(float(ground[0]), float(ground[1]) + 0.03, 0.0)
    return sarcl.Scene.points([place, place + np.array([3.0, -2.0, 1.0])], [1.0, 0.5j]), tracks


TASKS = {
    "points": (points(), TRACKS, {}),
    "rough terrain": (rough(), TRACKS, {"seed": 5}),
    "mixed": (rough() + BOX + points(), TRACKS, {"polarization": "all"}),
    "bistatic": (BOX + points(), TRACKS, {"receiver": RECEIVERS, "polarization": ("HH", "HV")}),
    "array": (points(), TRACKS, {"array": line(3, step=0.0), "receive": "all"}),
    "tuple": (BOX, tuple(TRACKS), {"reference": (0, 0, 0), "range_window": (-20, 20)}),
}


def of_single_calls(scene, tracks, options):
    receivers = options.get("receiver") or [None] * len(tracks)
    return [
        sarcl.echo(scene, CHIRP, track, **(options | {"receiver": receiver}))
        for track, receiver in zip(tracks, receivers, strict=True)
    ]


def assert_equal(ones, others):
    assert len(ones) == len(others)
    for one, other in zip(ones, others, strict=True):
        assert np.array_equal(one.samples[:], other.samples[:])
        for name in ("frequency", "tx", "rx", "reference_range", "time", "polarization"):
            a, b = getattr(one, name), getattr(other, name)
            assert (a is None) == (b is None) and (a is None or np.array_equal(a, b)), name
        assert one.report.predicted_error == other.report.predicted_error
        assert dict(one.report.plan) == dict(other.report.plan)


@pytest.mark.filterwarnings("ignore:point_roughness moves posts")
@pytest.mark.filterwarnings("ignore:bistatic angles reach")
@pytest.mark.parametrize("task", quick_of(set(TASKS) - {"rough terrain"}, TASKS))  # "mixed" has that terrain too
def test_a_list_has_the_bits_of_single_calls(task):
    scene, tracks, options = TASKS[task]
    options = {"tolerance": 1e-2, "check": False} | options
    alone = of_single_calls(scene, tracks, options)
    assert_equal(sarcl.echo(scene, CHIRP, tracks, **options), alone)
    # in another order, and after a call with another band and polarisation
    other = sarcl.Waveform.chirp(center=5e9, bandwidth=50e6, duration=1e-6)
    sarcl.echo(scene, other, tracks[0], polarization="VV", tolerance=1e-2)
    back = options | ({"receiver": options["receiver"][::-1]} if "receiver" in options else {})
    assert_equal(sarcl.echo(scene, CHIRP, tracks[::-1], **back), alone[::-1])


def test_tracks_of_an_orbit():
    scene, tracks = orbits()
    options = {"tolerance": 1e-2, "check": False}
    assert_equal(sarcl.echo(scene, CHIRP, tracks, **options), of_single_calls(scene, tracks, options))


@pytest.mark.filterwarnings("ignore:point_roughness moves posts")
def test_two_threads_and_two_radars_on_one_scene():
    scene = rough() + BOX
    waves = CHIRP, sarcl.Waveform.chirp(center=1.3e9, bandwidth=60e6, duration=1e-6)
    options = {"tolerance": 1e-2, "check": False}
    wanted = [[sarcl.echo(rough() + BOX, wave, track, **options) for track in TRACKS[:2]] for wave in waves]
    results: dict[int, list[sarcl.PhaseHistory]] = {}

    def work(i):
        results[i] = sarcl.echo(scene, waves[i], TRACKS[:2], **options)

    threads = [threading.Thread(target=work, args=(i,)) for i in range(2)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    for i in range(2):
        assert_equal(results[i], wanted[i])


def test_the_forecast_of_a_list():
    forecast = sarcl.plan(sarcl.echo, BOX, CHIRP, TRACKS, tolerance=1e-2, polarization=("HH", "VV"))
    assert forecast.n_rows == 2 * sum(map(len, TRACKS)) and forecast.predicted_error <= 1e-2
    assert forecast.plan["tracks"] == 3 and forecast.seconds > 0
    assert_equal(forecast.run(), of_single_calls(BOX, TRACKS, {"tolerance": 1e-2, "polarization": ("HH", "VV")}))
    many = sarcl.plan(sarcl.echo, points(), CHIRP, TRACKS[:1] * 20, tolerance=1e-2)
    assert many.predicted_error == 1e-2 and many.n_rows == 20 * 6 and not many.error_terms


def test_a_folder_has_a_file_for_each_track_and_finished_files_are_kept(tmp_path):
    folder, scene, options = tmp_path / "chips", BOX + points(), {"tolerance": 1e-2}
    alone = of_single_calls(scene, TRACKS, options)
    assert_equal(sarcl.echo(scene, CHIRP, TRACKS, out=folder, **options), alone)
    names = [f"track_{i:04d}.h5" for i in range(3)]
    assert sorted(path.name for path in folder.iterdir()) == ["job.json", *names]
    assert_equal([sarcl.read(folder / name) for name in names], alone)
    (folder / names[1]).unlink()
    (folder / names[2]).write_bytes(b"cut off")
    before = (folder / names[0]).stat().st_mtime_ns
    assert_equal(sarcl.echo(scene, CHIRP, TRACKS, out=folder, max_bytes=1e9, **options), alone)
    assert (folder / names[0]).stat().st_mtime_ns == before
    assert_equal(sarcl.echo(scene, CHIRP, [*TRACKS, TRACKS[0]], out=folder, **options), [*alone, alone[0]])


def test_a_damaged_file_is_named_in_the_log(tmp_path, caplog):
    sarcl.echo(points(), CHIRP, TRACKS[:1], out=tmp_path / "a")
    (tmp_path / "a" / "track_0000.h5").write_bytes(b"")
    with caplog.at_level(logging.WARNING):
        sarcl.echo(points(), CHIRP, TRACKS[:1], out=tmp_path / "a")
    assert "track_0000.h5 is computed again" in caplog.text


CHANGES = {
    "other options": ({"tolerance": 1e-3}, "another options"),
    "another seed": ({"seed": 1}, "another options"),
    "another scene": ({"scene": BOX}, "another scene"),
    "another waveform": ({"waveform": sarcl.Waveform.tone(center=9.6e9, duration=1e-8)}, "another waveform"),
    "other tracks": ({"track": TRACKS[::-1]}, "track_0000.h5, the echoes of another track"),
    "receivers": ({"receiver": RECEIVERS}, "track_0000.h5, the echoes of another track"),
}


@pytest.mark.parametrize("change", CHANGES)
def test_a_folder_of_another_job_is_refused_by_name(tmp_path, change):
    other, words = CHANGES[change]
    job = {"scene": points(), "waveform": CHIRP, "track": TRACKS, "tolerance": 1e-2, "out": tmp_path / "job"}
    sarcl.echo(**job)
    stamps = {path: path.stat().st_mtime_ns for path in (tmp_path / "job").iterdir()}
    with pytest.raises(ValueError, match=words) as refused:
        sarcl.echo(**job | other)
    assert str(tmp_path / "job") in str(refused.value)
    assert stamps == {path: path.stat().st_mtime_ns for path in (tmp_path / "job").iterdir()}


def test_what_stands_in_the_way_of_a_folder_is_named(tmp_path):
    def echo(out):
        return sarcl.echo(points(), CHIRP, TRACKS[:2], out=out, tolerance=1e-2)

    (tmp_path / "file").write_text("text")
    with pytest.raises(NotADirectoryError, match="file', a file"):
        echo(tmp_path / "file")
    with pytest.raises(FileNotFoundError, match="there is no folder"):
        echo(tmp_path / "a" / "b")
    (tmp_path / "c").mkdir()
    (tmp_path / "c" / "track_0001.h5").write_text("mine")
    with pytest.raises(ValueError, match=r"track_0001\.h5, which this job did not write"):
        echo(tmp_path / "c")
    (tmp_path / "d").mkdir()
    (tmp_path / "d" / "job.json").write_text("{}")
    with pytest.raises(ValueError, match=r"job\.json, which is damaged"):
        echo(tmp_path / "d")
    assert (tmp_path / "c" / "track_0001.h5").read_text() == "mine"


RUN = """
import sys
import numpy as np
import sarcl
chirp = sarcl.Waveform.chirp(center=9.6e9, bandwidth=200e6, duration=1e-6)
random = np.random.default_rng(2)
scene = sarcl.Scene.points(random.uniform(-5, 5, (40, 3)), random.standard_normal(40))
tracks = [sarcl.Trajectory.circle(radius=5e3, height=3e3, start=0.01 * i, arc=0.02, n_pulses=12) for i in range(400)]
for raw in sarcl.echo(scene, chirp, tracks[: int(sys.argv[2])], out=sys.argv[1], tolerance=1e-2):
    print(raw.n_rows)
"""


@pytest.mark.skipif(os.name == "nt", reason="signals of POSIX")
def test_a_killed_run_is_continued(tmp_path):
    folder, command = tmp_path / "job", [sys.executable, "-c", RUN, str(tmp_path / "job")]
    run = subprocess.Popen([*command, "400"], stdout=subprocess.DEVNULL)
    until = time.time() + 60
    while time.time() < until and len(list(folder.glob("track_*.h5"))) < 3:
        time.sleep(0.01)
    run.send_signal(signal.SIGKILL)
    run.wait()
    stamps = {path: path.stat().st_mtime_ns for path in folder.glob("track_*.h5")}
    assert 3 <= len(stamps) < 400
    n = len(stamps) + 2
    done = subprocess.run([*command, str(n)], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["12"] * n
    assert all(path.stat().st_mtime_ns == stamp for path, stamp in stamps.items())
    assert len(json.loads((folder / "job.json").read_text())["tracks"]) == 400


@pytest.mark.parametrize(
    ("track", "options", "error", "words"),
    [
        ([], {}, ValueError, "track is an empty list"),
        ([TRACKS[0], None], {}, TypeError, r"track\[1\] is a NoneType; wanted a sarcl.Trajectory"),
        ([TRACKS], {}, TypeError, r"track\[0\] is a list"),
        (TRACKS, {"receiver": RECEIVERS[0]}, TypeError, "receiver is a Trajectory, and track is a list of 3"),
        (TRACKS, {"receiver": RECEIVERS[:2]}, ValueError, "receiver is a list of 2 tracks, and track of 3"),
        (TRACKS, {"receiver": [*RECEIVERS[:2], 1]}, TypeError, r"receiver\[2\] is a int"),
        (TRACKS, {"receiver": RECEIVERS[1:] + RECEIVERS[:1]}, ValueError, "receiver has 9 positions but track has 6"),
        (TRACKS[0], {"receiver": RECEIVERS}, TypeError, "receiver is a list"),
        (TRACKS, {"out": 3}, TypeError, "out is a int"),
    ],
)
def test_wrong_lists_are_refused_by_name(track, options, error, words):
    with pytest.raises(error, match=words):
        sarcl.echo(points(), CHIRP, track, **options)
    if "out" not in options:
        with pytest.raises(error, match=words):
            sarcl.plan(sarcl.echo, points(), CHIRP, track, **options).run()


def test_other_verbs_take_one_track():
    with pytest.raises(TypeError, match="track is a list"):
        sarcl.spectral_echo(points(), CHIRP, TRACKS)


def test_an_error_names_the_track_that_it_is_of_and_keeps_the_echoes_before():
    away = sarcl.Trajectory.circle(radius=5e3, height=-3e3, arc=0.02, n_pulses=12)
    with pytest.raises(ValueError) as refused:
        sarcl.echo(rough(), CHIRP, [TRACKS[0], away])
    assert refused.value.__notes__ == ["track[1], of a list of 2; `raws` has the echoes of those before it"]
    (kept,) = refused.value.raws
    assert (np.asarray(kept.samples) == np.asarray(sarcl.echo(rough(), CHIRP, TRACKS[0]).samples)).all()


def test_missed_tolerances_are_told_when_all_tracks_are_finished(monkeypatch):
    exact = echo_check.exact

    def wrong(scene, antennas, *rest):
        values, powers = exact(scene, antennas, *rest)
        return values * (1.5 if len(antennas) == 9 else 1.0), powers

    monkeypatch.setattr(echo_check, "exact", wrong)
    with pytest.raises(ToleranceMissed) as missed:
        sarcl.echo(points(), CHIRP, TRACKS, tolerance=1e-2, check=True)
    monkeypatch.undo()
    assert_equal(missed.value.raws, of_single_calls(points(), TRACKS, {"tolerance": 1e-2, "check": True}))
