"""Spectral echoes in blocks: pieces, devices, clusters and killed runs give the bits of one undisturbed run."""

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
from sarcl import pointing, shapes
from sarcl.blocks import checkpoint
from sarcl.cli import parser
from sarcl.opencl.choose_device import open_device
from sarcl.opencl.device_list import devices
from sarcl.opencl.failures import DeviceFailed

CHIRP = sarcl.Waveform.chirp(center=9.6e9, bandwidth=150e6, duration=2e-6)
TRACK = sarcl.Trajectory.line(start=(0, -60, 6e3), velocity=(0, 100, 0), prf=250, n_pulses=300)
RANDOM = np.random.default_rng(0)
PLACES = RANDOM.uniform(-0.5, 0.5, (80, 3)) * (100, 100, 10) + (8e3, 0, 0)
POINTS = sarcl.Scene.points(PLACES, RANDOM.normal(size=80) + 1j * RANDOM.normal(size=80))
PLATE = sarcl.Scene.facets(shapes.plate((2.0, 2.0)).triangles + np.array([8e3, 0, 0]))
BOX = sarcl.Scene.facets(shapes.box((0.6, 0.5, 0.4)).triangles + np.array([8e3, 0, 0]))
BEAM = sarcl.Antenna.gaussian(width=(0.01, 0.2))
STRIP = pointing.stripmap(TRACK, look=float(np.arctan2(8e3, 6e3)))

CASES = {
    "points": (POINTS, TRACK, {}),
    "both": (POINTS + PLATE, TRACK, {"polarization": ("HH", "VV")}),
    "pulse by pulse": (BOX + PLATE, TRACK, {"polarization": ("HH", "HV", "VV")}),
    "little memory": (POINTS, TRACK, {"max_bytes": 3e6, "polarization": "all"}),
    "saras": (POINTS, TRACK, {"variant": "saras", "tolerance": 0.1}),
}


def echo(scene=POINTS, track=TRACK, **options):
    return sarcl.spectral_echo(scene, CHIRP, track, **{"check": False, **options})


def of(case, **options):
    scene, track, own = CASES[case]
    return echo(scene, track, **own, **options)


@pytest.fixture(scope="module")
def whole():
    """Echoes of every case in one go, each computed when it is first asked for."""
    done = {}

    def get(case):
        if case not in done:
            done[case] = of(case)
        return done[case]

    return get


def same(one, two):
    told = [{k: v for k, v in raw.report.plan.items() if k != "from files"} for raw in (one, two)]
    assert told[0] == told[1] and one.report.error_terms == two.report.error_terms
    assert one.report.contributions_done == two.report.contributions_done
    return np.array_equal(one.samples[:], two.samples[:])


@pytest.mark.parametrize("case", quick_of(["points", "pulse by pulse"], CASES))
def test_pieces_in_any_order_have_the_bits_of_one_run(case, whole, tmp_path):
    numbers = (2, 5) if case == "points" else (3,)
    for n in numbers:
        order = random.Random(n).sample(range(1, n + 1), n)
        pieces = [of(case, out=tmp_path / f"{n}.h5", tile=(i, n)) for i in order]
        assert pieces[:-1] == [None] * (n - 1) and same(pieces[-1], whole(case))
        assert "from files" in pieces[-1].report.plan
    assert names(tmp_path) == [f"{n}.h5" for n in numbers]


def test_a_piece_of_finished_echoes_does_nothing(tmp_path):
    for i in (1, 2):
        raw = echo(out=tmp_path / "a.h5", tile=(i, 2))

    def fail(*_):
        raise AssertionError("work began")

    assert same(echo(out=tmp_path / "a.h5", tile=(1, 2), progress=fail), raw) and names(tmp_path) == ["a.h5"]


def test_a_run_that_was_stopped_goes_on(whole, tmp_path, monkeypatch):
    begin_earlier(2.0, monkeypatch.setattr)
    observe(lambda engine, *block: engine.fill(*block), monkeypatch.setattr, least=0.0)

    def stop(stage, done, total):
        if stage == "spectra" and done > 0.6 * total:
            raise Stopped

    with pytest.raises(Stopped):
        of("points", out=tmp_path / "a.h5", progress=stop)
    assert names(tmp_path) == []
    with pytest.raises(Stopped):
        of("points", out=tmp_path / "a.h5", resume=True, progress=stop)
    assert tiles(tmp_path) and not (tmp_path / "a.h5").exists()
    raw = of("points", out=tmp_path / "a.h5")
    assert same(raw, whole("points")) and "from files" in raw.report.plan and names(tmp_path) == ["a.h5"]


def test_a_full_disk_for_tiles_is_a_warning_and_the_echoes_are_made(whole, tmp_path, monkeypatch, caplog):
    begin_earlier(2.0, monkeypatch.setattr)

    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(checkpoint.TileStore, "save", full)
    assert same(of("points", out=tmp_path / "a.h5"), whole("points")) and "cannot be kept" in caplog.text
    with pytest.raises(OSError, match="No space left"):
        echo(out=tmp_path / "b.h5", tile=(1, 2))


OTHER = {
    "scene": ({"scene": POINTS + PLATE}, "other scene"),
    "track": ({"track": sarcl.Trajectory(TRACK.times, TRACK.positions + 1.0)}, "other track"),
    "tolerance": ({"tolerance": 1e-3}, r"tolerance was 0\.01, is 0\.001"),
    "variant": ({"variant": "saras", "tolerance": 0.01}, "variant was exact, is saras"),
    "polarization": ({"polarization": "VV"}, "polarization was HH, is VV"),
    "ripple": ({"ripple": True}, "other options"),
    "skip": ({"skip": {"range window"}}, "skip was .*, is range window"),
}


@pytest.mark.parametrize("name", OTHER)
def test_tiles_of_other_echoes_are_refused_with_what_differs(tmp_path, name):
    options, message = OTHER[name]
    assert echo(out=tmp_path / "a.h5", tile=(1, 2)) is None
    for more in ({}, {"tile": (2, 2)}):
        with pytest.raises(ValueError, match=f"another job: .*{message}.*--no-resume"):
            echo(out=tmp_path / "a.h5", **options, **more)
    assert names(tmp_path) == ["a.h5.parts"]


TESTS = str(Path(__file__).parents[2])
SCRIPT = """
import sys
sys.path.append(sys.argv[2])
import numpy as np
import sarcl
from helpers.block_runs import begin_earlier, observe
begin_earlier(2.0)
observe(lambda engine, *block: engine.fill(*block), least=0.0)
random = np.random.default_rng(1)
places = random.uniform(-0.5, 0.5, (4000, 3)) * (100, 60, 10) + (8e3, 0, 0)
scene = sarcl.Scene.points(places, random.standard_normal(4000))
chirp = sarcl.Waveform.chirp(center=9.6e9, bandwidth=150e6, duration=2e-6)
track = sarcl.Trajectory.line(start=(0, -200, 6e3), velocity=(0, 100, 0), prf=450, n_pulses=1800)
sarcl.spectral_echo(scene, chirp, track, polarization=("HH", "VV"), tolerance=1e-3, check=False, out=sys.argv[1])
"""


@pytest.mark.skipif(os.name != "posix", reason="needs SIGKILL")
@pytest.mark.slow
def test_killed_runs_lose_no_tile_and_end_with_the_same_bits(tmp_path):
    (tmp_path / "killed").mkdir()
    path, hit = tmp_path / "killed" / "a.h5", 0
    for number in range(4):
        before = len(tiles(path.parent))
        process = subprocess.Popen([sys.executable, "-c", SCRIPT, str(path), TESTS])
        while process.poll() is None and len(tiles(path.parent)) < before + 1 + number:
            time.sleep(0.001)
        process.kill()
        hit += process.wait() == -signal.SIGKILL
        assert len(tiles(path.parent)) > before or path.exists()
    for name in ("killed/a.h5", "b.h5"):
        subprocess.run([sys.executable, "-c", SCRIPT, str(tmp_path / name), TESTS], check=True)
    assert hit >= 3 and names(tmp_path / "killed") == ["a.h5"]
    assert same(sarcl.read(path), sarcl.read(tmp_path / "b.h5"))


# ---- several devices


@pytest.mark.parametrize("case", CASES)
def test_two_devices_of_a_kind_make_the_bits_of_one(case, pair, whole, monkeypatch):
    one = whole(case)
    taken = observe_devices(monkeypatch)
    both = of(case, device=pair)
    assert len(taken) == 2 and same(both, one)
    assert both.report.device == f"{pair[0].info.name} + {pair[1].info.name}"


def test_devices_of_two_kinds_agree_to_rounding(whole, monkeypatch):
    working = [info.index for info in devices() if info.works]
    first = open_device(working[0])
    other = open_device(working[1]) if len(working) > 1 else first.without_fp64()
    one = whole("points").samples[:]
    for second in (other, as_gpu(first)):
        with monkeypatch.context() as during:
            taken = observe_devices(during)
            both = of("points", device=[first, second]).samples[:]
        assert len(taken) == 2 and np.linalg.norm(both - one) <= 1e-6 * np.linalg.norm(one)


def test_the_spectra_of_a_device_that_is_lost_are_computed_by_the_other(pair, whole, monkeypatch, caplog):
    lost = set()

    def failing(engine, *block):
        if not lost or engine in lost:
            lost.add(engine)
            engine.fill(*block)  # what it has written is not added to
            raise DeviceFailed("kernel spread failed: DEVICE_NOT_AVAILABLE")
        return engine.fill(*block)

    observe(failing, monkeypatch.setattr)
    assert same(of("both", device=pair), whole("both")) and "the other devices go on without it" in caplog.text


def test_progress_of_several_devices_is_reported_by_the_callers_thread(pair):
    calls = []
    of("both", device=pair, progress=lambda *a: calls.append((threading.current_thread(), *a)))
    assert {call[0] for call in calls} == {threading.main_thread()}
    done = [call[2] for call in calls if call[1] == "spectra"]
    assert done == sorted(done) and calls[-1][1] == "echo" and calls[-1][2] == calls[-1][3]


def test_forecasts_take_the_same_options_and_run_with_them(pair, whole, tmp_path):
    forecast = sarcl.plan(sarcl.spectral_echo, POINTS, CHIRP, TRACK, device=pair, out=tmp_path / "a.h5", check=False)
    assert same(forecast.run(), whole("points"))
    piece = sarcl.plan(sarcl.spectral_echo, POINTS, CHIRP, TRACK, tile=(1, 2), out=tmp_path / "b.h5", check=False)
    assert piece.run() is None and tiles(tmp_path)


BAD = {
    "tile without a file": ({"tile": (1, 2)}, ValueError, r'tile is \(1, 2\) but out is no path; give out="raw.h5"'),
    "tile and no resume": ({"tile": (1, 2), "resume": False, "out": "a.h5"}, ValueError, "do not go together"),
    "no device": ({"device": []}, ValueError, "device is an empty list"),
}


@pytest.mark.parametrize("name", BAD)
def test_bad_options_say_what_was_wanted(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    options, kind, message = BAD[name]
    with pytest.raises(kind, match=message):
        echo(**options)
    assert names(tmp_path) == []


SCENARIO = """
[waveform.chirp]
center = 9.6e9
bandwidth = 150e6
duration = 2e-6
[trajectory.line]
start = [0, -20, 6e3]
velocity = [0, 100, 0]
prf = 250
n_pulses = 100
[[scene.points]]
positions = [[8003.0, 2.0, 0.0], [7996.0, 0.0, 0.0]]
[spectral_echo]
"""


def test_pieces_on_the_command_line(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "s.toml").write_text(SCENARIO)
    assert parser.main(["simulate", "s.toml", "-o", "whole.h5", "--device", "all"]) == 0
    assert parser.main(["simulate", "s.toml", "-o", "a.h5", "--tile", "1/2"]) == 0
    assert "tiles wait in a.h5.parts" in capsys.readouterr().out
    assert parser.main(["simulate", "s.toml", "-o", "a.h5", "--tile", "2/2"]) == 0
    assert same(sarcl.read(tmp_path / "a.h5"), sarcl.read(tmp_path / "whole.h5"))


# ---- dask


@pytest.mark.parametrize("case", CASES)
def test_workers_of_a_cluster_make_the_bits_of_one_device(case, client, whole):
    raw = of(case, cluster=client)
    assert same(raw, whole(case)) and raw.report.device == whole(case).report.device


def test_a_worker_that_is_killed_is_replaced(client, whole):
    victims = list(client.run(os.getpid).values())[:1]

    def kill(stage, done, total):
        if stage == "spectra" and done and victims:
            os.kill(victims.pop(), signal.SIGKILL)

    assert same(of("both", cluster=client, progress=kill), whole("both")) and not victims
