"""Echoes in blocks of pulses: pieces, devices, clusters and killed runs give the bits of one undisturbed run."""

from __future__ import annotations

import os
import random
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest
from helpers.block_runs import Stopped, begin_earlier, names, observe, observe_devices, tiles
from helpers.cases import quick_of
from helpers.devices import as_gpu

import sarcl
from sarcl import shapes
from sarcl.blocks import checkpoint
from sarcl.cli import parser
from sarcl.io import output_paths
from sarcl.opencl.choose_device import open_device
from sarcl.opencl.device_list import devices
from sarcl.opencl.failures import DeviceFailed

CHIRP = sarcl.Waveform.chirp(center=9.6e9, bandwidth=200e6, duration=5e-8)
TRACK = sarcl.Trajectory.circle(radius=5e3, height=3e3, arc=0.02, n_pulses=200)
RANDOM = np.random.default_rng(0)
POINTS = sarcl.Scene.points(RANDOM.uniform(-9, 9, (300, 3)), RANDOM.standard_normal(300))
BOX = shapes.box((2.0, 1.0, 1.5))
ROUGH = sarcl.Scene.from_heights(
    np.linspace(-9, 9, 13), np.linspace(-9, 9, 13), np.zeros((13, 13)), material="dry soil", roughness=0.01
)
FDA = sarcl.AntennaArray.linear(5, spacing=0.015, frequency_step=20e6, axis=(0, 1, 0))
BEYOND = sarcl.Trajectory(TRACK.times, TRACK.positions + np.array([0.0, 40.0, 5.0]), TRACK.velocities)
ORBIT = sarcl.Orbit.kepler(6.88e6, 0.001, 1.7, span=(-200, 400))

WIDE = {"range_window": (-3000, 3000)}
CASES = {
    "points": (POINTS, {}),
    "by levels": (POINTS, {"method": "factorized"}),
    "facets": (BOX, {"polarization": "all"}),
    "partly lit": (BOX + shapes.plate((9.0, 9.0)), {}),
    "rough": (ROUGH, {"tolerance": 1e-2}),
    "both": (POINTS + BOX, {"polarization": ("HH", "VV"), "receiver": BEYOND}),
    "array": (POINTS + BOX, {"array": FDA, "range_window": (-40, 40)}),
    "between": (POINTS, {"array": FDA, "channels": "separated", "receive": "all", "range_window": (-40, 40)}),
    "separate": (POINTS, {"array": FDA, "skip": {"range window"}, "range_window": (-40, 40)}),
}


def echo(scene=POINTS, track=TRACK, **options):
    return sarcl.echo(scene, CHIRP, track, **{"check": False, **options})


@pytest.fixture(scope="module")
def whole():
    """Echoes of POINTS in one go."""
    return echo()


@pytest.fixture(scope="module")
def whole_wide():
    """The same with WIDE range profiles, of which 64 pulses are worth a file."""
    return echo(**WIDE)


def same(one, two):
    return np.array_equal(one.samples[:], two.samples[:])


def stop_after(share):
    """A progress function that ends the run once such a share of the echoes is done."""

    def progress(stage, done, total):
        if stage == "echo" and done >= share * total > 0:
            raise Stopped

    return progress


def half_done(path, scene=POINTS, **options):
    """Leave the tiles of some echoes behind."""
    echo(scene, out=path, tile=(1, 2), **options)
    assert tiles(path.parent)


# ---- pieces


@pytest.mark.parametrize("case", quick_of(["points", "partly lit", "rough", "between"], CASES))
def test_pieces_in_any_order_have_the_bits_of_one_run(case, tmp_path):
    scene, options = CASES[case]
    one, numbers = echo(scene, **options), (2, 5) if case == "points" else (3,)
    for n in numbers:
        order = random.Random(n).sample(range(1, n + 1), n)
        pieces = [echo(scene, out=tmp_path / f"{n}.h5", tile=(i, n), **options) for i in order]
        assert pieces[:-1] == [None] * (n - 1) and same(pieces[-1], one)
        assert pieces[-1].report.contributions_done == one.report.contributions_done
        assert pieces[-1].report.contributions_skipped == one.report.contributions_skipped
        assert pieces[-1].report.error_terms == one.report.error_terms
        plan = dict(pieces[-1].report.plan)
        assert plan.pop("from files") == "200 of 200 pulses" and plan == dict(one.report.plan)
    assert names(tmp_path) == [f"{n}.h5" for n in numbers]


def test_the_samples_of_a_pulse_do_not_depend_on_memory_for_samples(tmp_path):
    # a block of samples in a file is a quarter of max_bytes, and the device has the same memory
    for case in ("points", "array", "between"):
        scene, options = CASES[case]
        one = echo(scene, max_bytes=2e6, **options)
        assert same(echo(scene, max_bytes=2e6, out=tmp_path / f"{case}.h5", **options), one)


@pytest.mark.parametrize("options", [{}, {"array": FDA}], ids=["one antenna", "array"])
def test_orbits_are_computed_in_pieces_too(options, tmp_path):
    start = 100.0
    track = ORBIT.trajectory(start=start, prf=1700.0, n_pulses=90)
    place = sarcl.Scene.points(ORBIT.geolocate(start + 0.026, 7.2e5, side="right")[None] + np.eye(3))
    options = {"range_window": (-30, 30), **options}
    one = echo(place, track, **options)
    for i in (1, 2, 3):
        pieces = echo(place, track, out=tmp_path / "a.h5", tile=(i, 3), **options)
    assert same(pieces, one) and one.report.plan["receiver"] == "at the echo's arrival"


def test_a_piece_of_finished_echoes_does_nothing(tmp_path):
    for i in (1, 2):
        echo(out=tmp_path / "a.h5", tile=(i, 2))
    before = (tmp_path / "a.h5").stat()

    def fail(*_):
        raise AssertionError("work began")

    again = echo(out=tmp_path / "a.h5", tile=(1, 2), progress=fail)
    assert again.n_rows == 200 and os.path.samestat(before, (tmp_path / "a.h5").stat())
    assert names(tmp_path) == ["a.h5"]


def test_the_plain_call_completes_what_pieces_began(whole, tmp_path):
    echo(out=tmp_path / "a.h5", tile=(2, 3))
    raw = echo(out=tmp_path / "a.h5")
    assert same(raw, whole) and raw.report.plan["from files"] == "64 of 200 pulses"
    assert names(tmp_path) == ["a.h5"]


def test_a_piece_that_finds_another_run_at_its_file_leaves_its_tiles(whole, tmp_path):
    path = tmp_path / "a.h5"
    echo(out=path, tile=(1, 2))
    part = output_paths.begin(path, alone=True)
    try:
        assert echo(out=path, tile=(2, 2)) is None
    finally:
        part.remove()
    assert same(echo(out=path), whole)


# ---- resuming


def test_a_run_that_was_stopped_goes_on(whole_wide, tmp_path):
    path = tmp_path / "a.h5"
    with pytest.raises(Stopped):
        echo(out=path, resume=True, progress=stop_after(0.6), **WIDE)
    assert tiles(tmp_path) and not path.exists()
    calls = []
    raw = echo(out=path, progress=lambda *a: calls.append(a), **WIDE)
    assert same(raw, whole_wide) and "from files" in raw.report.plan
    assert calls[-1][1] == calls[-1][2] < 300 * 200
    assert names(tmp_path) == ["a.h5"]


def test_a_progress_function_that_raises_leaves_nothing_of_a_short_run(tmp_path):
    with pytest.raises(Stopped):
        echo(out=tmp_path / "a.h5", progress=stop_after(0.1))
    assert names(tmp_path) == []


def test_a_long_run_keeps_its_tiles_when_it_fails(whole_wide, tmp_path, monkeypatch):
    begin_earlier(100.0, monkeypatch.setattr)
    with pytest.raises(Stopped):
        echo(out=tmp_path / "a.h5", progress=stop_after(0.6), **WIDE)
    assert tiles(tmp_path)
    assert same(echo(out=tmp_path / "a.h5", **WIDE), whole_wide) and names(tmp_path) == ["a.h5"]


def test_a_full_disk_for_tiles_is_a_warning_and_the_echoes_are_made(whole, tmp_path, monkeypatch, caplog):
    begin_earlier(2.0, monkeypatch.setattr)

    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(checkpoint.TileStore, "save", full)
    assert same(echo(out=tmp_path / "a.h5"), whole) and "cannot be kept" in caplog.text
    with pytest.raises(OSError, match="No space left"):
        echo(out=tmp_path / "b.h5", tile=(1, 2))


OTHER = {
    "scene": ({"scene": POINTS + BOX}, "other scene"),
    "track": ({"track": BEYOND}, "other track"),
    "tolerance": ({"tolerance": 1e-4}, r"tolerance was 0\.001, is 0\.0001"),
    "method": ({"method": "direct"}, "method was auto, is direct"),
    "polarization": ({"polarization": "VV"}, "polarization was HH, is VV"),
    "receiver": ({"receiver": BEYOND, "range_window": (-30, 30)}, "other options"),
    "antenna": ({"antenna": sarcl.Antenna.isotropic(), "radar": sarcl.Radar(power=1.0)}, "other options"),
    "seed": ({"seed": 3}, "seed was 0, is 3"),
    "skip": ({"skip": {"range window"}}, "skip was .*, is range window"),
}


@pytest.mark.parametrize("name", OTHER)
def test_tiles_of_other_echoes_are_refused_with_what_differs(tmp_path, name):
    options, message = OTHER[name]
    half_done(tmp_path / "a.h5")
    for more in ({}, {"tile": (2, 2)}):
        with pytest.raises(ValueError, match=f"another job: .*{message}.*--no-resume"):
            echo(out=tmp_path / "a.h5", **options, **more)
    assert names(tmp_path) == ["a.h5.parts"]
    fresh = echo(out=tmp_path / "a.h5", resume=False, **options)
    assert same(fresh, echo(**options)) and names(tmp_path) == ["a.h5"]


TESTS = str(Path(__file__).parents[1])
SCRIPT = """
import sys
sys.path.append(sys.argv[2])
import numpy as np
import sarcl
from helpers.block_runs import begin_earlier, observe
begin_earlier(2.0)
observe(lambda engine, *block: engine.fill(*block), least=64.0)
random = np.random.default_rng(1)
scene = sarcl.Scene.points(random.uniform(-9, 9, (4000, 3)), random.standard_normal(4000))
chirp = sarcl.Waveform.chirp(center=9.6e9, bandwidth=200e6, duration=5e-8)
track = sarcl.Trajectory.circle(radius=5e3, height=3e3, arc=0.1, n_pulses=6400)
options = {"check": False, "method": "direct", "range_window": (-200, 200)}
sarcl.echo(scene, chirp, track, out=sys.argv[1], **options)
"""


def killed_runs(path, kills):
    """Runs that are killed, each when some more tiles are there than before, and one that is not: how many were hit."""
    rng, hit = random.Random(0), 0
    for _ in range(kills):
        before = len(tiles(path.parent))
        process = subprocess.Popen([sys.executable, "-c", SCRIPT, str(path), TESTS], stdout=subprocess.DEVNULL)
        more = before + rng.randint(1, 3)
        while process.poll() is None and len(tiles(path.parent)) < more:
            time.sleep(0.001)
        time.sleep(rng.uniform(0, 0.01))
        process.kill()
        hit += process.wait() == -signal.SIGKILL
        assert len(tiles(path.parent)) >= before or path.exists()  # no finished tile is lost
    subprocess.run([sys.executable, "-c", SCRIPT, str(path), TESTS], check=True, stdout=subprocess.DEVNULL)
    return hit


@pytest.mark.skipif(os.name != "posix", reason="needs SIGKILL")
@pytest.mark.parametrize("kills", [3, pytest.param(20, marks=pytest.mark.slow)])
def test_killed_runs_lose_no_tile_and_end_with_the_same_bits(tmp_path, kills):
    (tmp_path / "killed").mkdir()
    hit = killed_runs(tmp_path / "killed" / "a.h5", kills)
    assert hit >= min(kills, 3) and names(tmp_path / "killed") == ["a.h5"]
    killed_runs(tmp_path / "b.h5", 0)
    assert same(sarcl.read(tmp_path / "killed" / "a.h5"), sarcl.read(tmp_path / "b.h5"))


# ---- several devices


@pytest.mark.parametrize("case", quick_of(["by levels", "facets", "array"], CASES))
def test_two_devices_of_a_kind_make_the_bits_of_one(case, pair, monkeypatch):
    scene, options = CASES[case]
    one = echo(scene, **options)
    taken = observe_devices(monkeypatch)
    both = echo(scene, device=pair, **options)
    assert {engine.scene.request.device for engine in taken} == set(pair) and same(both, one)
    runs = sorted(run for part in taken.values() for run in part)
    assert [a for a, _ in runs] == [0, *(b for _, b in runs[:-1])] and runs[-1][1] == 200
    assert both.report.plan == one.report.plan and both.report.error_terms == one.report.error_terms
    assert both.report.contributions_done == one.report.contributions_done
    assert both.report.device == f"{pair[0].info.name} + {pair[1].info.name}"


@pytest.mark.slow
def test_devices_of_two_kinds_agree_to_rounding(monkeypatch):
    working = [info.index for info in devices() if info.works]
    first = open_device(working[0])
    other = open_device(working[1]) if len(working) > 1 else first.without_fp64()
    for second in (other, as_gpu(first)):
        with monkeypatch.context() as during:
            taken = observe_devices(during)
            both = echo(POINTS + BOX, device=[first, second])
        assert len(taken) == 2
        one = echo(POINTS + BOX, device=first)
        assert np.linalg.norm(both.samples - one.samples) <= 1e-6 * np.linalg.norm(one.samples)


def test_the_pulses_of_a_device_that_is_lost_are_computed_by_the_other(pair, whole, monkeypatch, caplog, tmp_path):
    lost = {pair[1]}

    def failing(engine, *block):
        if engine.scene.request.device in lost:
            raise DeviceFailed("kernel spread failed: DEVICE_NOT_AVAILABLE")
        time.sleep(0.05)
        return engine.fill(*block)

    observe(failing, monkeypatch.setattr)
    assert same(echo(device=pair), whole) and "the other devices go on without it" in caplog.text
    lost.add(pair[0])
    with pytest.raises(DeviceFailed, match="DEVICE_NOT_AVAILABLE"):
        echo(device=pair)


def test_progress_of_several_devices_is_reported_by_the_callers_thread(pair):
    calls = []
    echo(device=pair, progress=lambda *a: calls.append((threading.current_thread(), *a)))
    assert {c[0] for c in calls} == {threading.main_thread()}
    done = [c[2] for c in calls if c[1] == "echo"]
    assert done == sorted(set(done)) and done[-1] == calls[-1][3] == 300 * 200
    assert not [t.name for t in threading.enumerate() if "sarcl" in t.name]


def test_forecasts_take_the_same_options_and_run_with_them(pair, whole, tmp_path):
    forecast = sarcl.plan(sarcl.echo, POINTS, CHIRP, TRACK, device=pair, out=tmp_path / "a.h5", check=False)
    assert same(forecast.run(), whole)
    piece = sarcl.plan(sarcl.echo, POINTS, CHIRP, TRACK, tile=(1, 2), out=tmp_path / "b.h5", check=False)
    assert piece.run() is None and tiles(tmp_path)


# ---- options

BAD = {
    "tile without a file": ({"tile": (1, 2)}, ValueError, r'tile is \(1, 2\) but out is no path; give out="raw.h5"'),
    "resume without a file": ({"resume": True}, ValueError, "resume is True but out is no"),
    "tile and no resume": ({"tile": (1, 2), "resume": False, "out": "a.h5"}, ValueError, "do not go together"),
    "tile beyond": ({"tile": (5, 3), "out": "a.h5"}, ValueError, r"tile is \(5, 3\); pieces of 3 are numbered 1 to 3"),
    "half a tile": ({"tile": 1, "out": "a.h5"}, ValueError, r"tile is 1; wanted \(i, n\)"),
    "resume a word": ({"resume": "yes", "out": "a.h5"}, TypeError, "resume is a str"),
    "no device": ({"device": []}, ValueError, "device is an empty list"),
    "no cluster": ({"cluster": "tcp://here"}, TypeError, "cluster is a str; wanted a dask"),
}


@pytest.mark.parametrize("name", BAD)
def test_bad_options_say_what_was_wanted(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    options, kind, message = BAD[name]
    if "cluster" in options:
        pytest.importorskip("distributed")
    with pytest.raises(kind, match=message):
        echo(**options)
    assert names(tmp_path) == []


def test_a_second_run_to_the_same_file_is_refused_and_does_no_harm(whole, tmp_path):
    def second(stage, done, total):
        if stage == "echo" and not done:
            with pytest.raises(FileExistsError, match="another run is writing it"):
                echo(out=tmp_path / "a.h5")

    assert same(echo(out=tmp_path / "a.h5", progress=second), whole) and names(tmp_path) == ["a.h5"]


SCENARIO = """
[waveform.chirp]
center = 9.6e9
bandwidth = 200e6
duration = 5e-8
[trajectory.circle]
radius = 5e3
height = 3e3
arc = 0.02
n_pulses = 100
[[scene.points]]
positions = [[3.0, 2.0, 0.0], [-4.0, 0.0, 0.0]]
"""


def simulate(folder, *argv):
    here = Path.cwd()
    os.chdir(folder)
    try:
        return parser.main(["simulate", *argv])
    finally:
        os.chdir(here)


def test_pieces_on_the_command_line(tmp_path, capsys):
    (tmp_path / "s.toml").write_text(SCENARIO)
    (tmp_path / "n.toml").write_text(SCENARIO + "[noise]\nvariance = 0.1\n")
    assert simulate(tmp_path, "s.toml", "-o", "whole.h5", "--device", "all") == 0
    assert simulate(tmp_path, "s.toml", "-o", "a.h5", "--tile", "1/2") == 0
    assert "tiles wait in a.h5.parts" in capsys.readouterr().out
    assert simulate(tmp_path, "s.toml", "-o", "a.h5", "--tile", "2/2", "--tolerance", "1e-2") == 2
    assert "tolerance was 0.001, is 0.01" in capsys.readouterr().err
    assert simulate(tmp_path, "s.toml", "-o", "a.h5", "--tile", "2/2") == 0
    assert same(sarcl.read(tmp_path / "a.h5"), sarcl.read(tmp_path / "whole.h5"))
    assert simulate(tmp_path, "n.toml", "-o", "b.h5", "--tile", "1/2") == 2
    assert "leave [noise] out" in capsys.readouterr().err


# ---- dask


@pytest.mark.parametrize("case", CASES)
def test_workers_of_a_cluster_make_the_bits_of_one_device(case, client):
    scene, options = CASES[case]
    one = echo(scene, **options)
    for _ in range(2):
        raw = echo(scene, cluster=client, **options)
        assert same(raw, one) and raw.report.device == one.report.device
        assert raw.report.plan == one.report.plan and raw.report.error_terms == one.report.error_terms
        assert raw.report.contributions_skipped == one.report.contributions_skipped


def test_a_cluster_keeps_finished_tiles_as_one_device_does(client, whole_wide, tmp_path):
    with pytest.raises(Stopped):
        echo(cluster=client, out=tmp_path / "a.h5", resume=True, progress=stop_after(0.4), **WIDE)
    assert tiles(tmp_path)
    raw = echo(cluster=client, out=tmp_path / "a.h5", **WIDE)
    assert "from files" in raw.report.plan and same(raw, whole_wide) and names(tmp_path) == ["a.h5"]


def test_a_worker_that_is_killed_is_replaced(client, whole):
    victims = list(client.run(os.getpid).values())[:1]

    def kill(stage, done, total):
        if stage == "echo" and done and victims:
            os.kill(victims.pop(), signal.SIGKILL)

    assert same(echo(cluster=client, progress=kill), whole) and not victims
