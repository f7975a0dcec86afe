"""Full-wave echoes run by run: pieces, devices, clusters and killed calls give the bits of one undisturbed call."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from helpers.block_runs import Stopped, begin_earlier, names, tiles
from helpers.cases import quick_of
from helpers.devices import as_gpu

import sarcl
from sarcl import Material, shapes
from sarcl.blocks import checkpoint
from sarcl.cli import parser
from sarcl.fullwave import runs
from sarcl.opencl.choose_device import open_device
from sarcl.opencl.device_list import devices
from sarcl.opencl.failures import DeviceFailed

BOX = shapes.box((0.2, 0.3, 0.1))
CHIRP = sarcl.Waveform.chirp(center=1.25e9, bandwidth=500e6, duration=2e-8)


def around(*degrees, height=0.0):
    angle = np.deg2rad(degrees)
    return sarcl.Trajectory(None, np.stack([40 * np.cos(angle), 40 * np.sin(angle), height + 0 * angle], 1))


ARC = around(*np.linspace(20, 40, 9))
MIRRORED = around(-30, 0, 30, height=9.0)
LOSSY = replace(BOX, materials=(Material(name="wet", eps_r=1.5 - 0.1j),))
CASES = {
    "auto": (BOX, ARC, {"polarization": "VV", "tolerance": 0.1}),
    "all": (BOX, ARC, {"polarization": "all", "anchors": [0, 6], "check": True, "model_error": True, "tolerance": 0.2}),
    "mirrored": (BOX, MIRRORED, {"anchors": [0, 1, 2], "polarization": ("VV", "HV")}),
    "lossy": (LOSSY, ARC, {"anchors": 2, "model_error": True}),
    "parts": (BOX, ARC, {"anchors": 2, "max_bytes": 7.8e6}),
}


def echo(scene=BOX, track=ARC, **options):
    return sarcl.fullwave_echo(scene, CHIRP, track, **{"cells": 8, "model_error": False, **options})


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
    """Whether samples and numbers of the reports are those of the same runs."""
    told = [{k: v for k, v in raw.report.plan.items() if k not in ("run_seconds", "from files")} for raw in (one, two)]
    assert told[0] == told[1] and one.report.error_terms == two.report.error_terms
    assert (one.report.measured_error, one.report.model_error) == (two.report.measured_error, two.report.model_error)
    assert one.report.contributions_done == two.report.contributions_done
    return np.array_equal(one.samples[:], two.samples[:])


def stop_after(n_runs):
    """A progress function that ends the call once so many runs have begun to be reported as done."""
    seen = []

    def progress(stage, done, total):
        if stage == "full-wave runs" and done and done not in seen:
            seen.append(done)
            if len(seen) > n_runs:
                raise Stopped

    return progress


# ---- pieces


@pytest.mark.parametrize("case", quick_of(["all", "parts"], CASES))
def test_pieces_in_any_order_have_the_bits_of_one_call(case, whole, tmp_path):
    order = (2, 1) if case != "all" else (3, 1, 4, 2)
    pieces = [of(case, out=tmp_path / "a.h5", tile=(i, len(order))) for i in order]
    assert pieces[:-1] == [None] * (len(order) - 1) and same(pieces[-1], whole(case))
    assert "from files" in pieces[-1].report.plan and names(tmp_path) == ["a.h5"]


def test_a_piece_of_finished_echoes_does_nothing(tmp_path):
    for i in (1, 2):
        raw = of("mirrored", out=tmp_path / "a.h5", tile=(i, 2))

    def fail(*_):
        raise AssertionError("work began")

    assert same(of("mirrored", out=tmp_path / "a.h5", tile=(1, 2), progress=fail), raw)


def test_the_plain_call_completes_what_pieces_began(whole, tmp_path):
    assert of("all", out=tmp_path / "a.h5", tile=(1, 3)) is None
    # of 8: two anchors, a check and an error of the grid, sent as H and as V
    assert len(tiles(tmp_path, "anchors")) == 2
    raw = of("all", out=tmp_path / "a.h5")
    assert same(raw, whole("all")) and raw.report.plan["from files"] == "2 runs"
    assert names(tmp_path) == ["a.h5"]


def test_the_error_of_the_grid_is_compared_at_the_pulse_of_the_anchor_too():
    # of 40 pulses 32 are compared, and pulse 17, which is not among these
    options = {"track": around(*np.linspace(20, 30, 40)), "model_error": True, "tolerance": 0.3}
    raw = echo(anchors=[17], **options)
    assert raw.report.plan["anchors"] == [17] and 0 < raw.report.model_error < 1


# ---- resuming


def test_a_call_that_was_stopped_goes_on(whole, tmp_path, monkeypatch):
    begin_earlier(2.0, monkeypatch.setattr)
    with pytest.raises(Stopped):
        of("mirrored", out=tmp_path / "a.h5", resume=True, progress=stop_after(12))
    n = len(tiles(tmp_path, "anchors"))
    assert 0 < n < 3 and not (tmp_path / "a.h5").exists()
    raw = of("mirrored", out=tmp_path / "a.h5")
    assert raw.report.plan["from files"] == f"{n} runs" and same(raw, whole("mirrored"))
    assert names(tmp_path) == ["a.h5"]


def test_what_ends_a_short_call_leaves_nothing_and_a_long_one_keeps_its_runs(tmp_path, monkeypatch):
    begin_earlier(2.0, monkeypatch.setattr)
    with pytest.raises(Stopped):
        of("mirrored", out=tmp_path / "a.h5", progress=stop_after(12))
    assert names(tmp_path) == []
    begin_earlier(100.0, monkeypatch.setattr)
    with pytest.raises(Stopped):
        of("mirrored", out=tmp_path / "a.h5", progress=stop_after(12))
    assert tiles(tmp_path, "anchors")


def test_damaged_files_of_runs_are_computed_again(whole, tmp_path, caplog):
    of("mirrored", out=tmp_path / "a.h5", tile=(1, 2))
    (file,) = tiles(tmp_path, "anchors")
    damaged = bytearray(file.read_bytes())
    damaged[-100] ^= 1
    file.write_bytes(damaged)
    raw = of("mirrored", out=tmp_path / "a.h5")
    assert "its tiles are made again" in caplog.text and same(raw, whole("mirrored"))


def test_a_full_disk_for_runs_is_a_warning_and_the_echoes_are_made(whole, tmp_path, monkeypatch, caplog):
    begin_earlier(2.0, monkeypatch.setattr)

    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(checkpoint.TileStore, "save", full)
    assert same(of("mirrored", out=tmp_path / "a.h5"), whole("mirrored")) and "cannot be kept" in caplog.text
    with pytest.raises(OSError, match="No space left"):
        of("mirrored", out=tmp_path / "b.h5", tile=(1, 2))


OTHER = {
    "scene": ({"scene": shapes.box((0.2, 0.3, 0.11))}, "other scene"),
    "track": ({"track": around(-30, 0, 31, height=9.0)}, "other track"),
    "cells": ({"cells": 8.5}, r"cells was 8 in 1 parts of the band, is 8\.5"),
    "vertical": ({"vertical": (0, 1, 1)}, "other options"),
    "tolerance": ({"tolerance": 1e-2}, r"tolerance was 0\.03, is 0\.01"),
    "polarization": ({"polarization": "VV"}, "polarization was HH, is VV"),
    "anchors": ({"anchors": 2}, r"other anchors"),
}


@pytest.mark.parametrize("name", quick_of(["scene", "tolerance"], OTHER))
def test_runs_of_other_echoes_are_refused_with_what_differs(tmp_path, name):
    options, message = OTHER[name]
    given = {"track": MIRRORED, "anchors": [0, 1], "out": tmp_path / "a.h5"}
    assert echo(**given, tile=(1, 2)) is None
    for more in ({}, {"tile": (2, 2)}):
        with pytest.raises(ValueError, match=f"another job: .*{message}.*--no-resume"):
            echo(**given | options, **more)
    assert names(tmp_path) == ["a.h5.anchors"]
    assert same(echo(**given | options, resume=False), echo(**given | options | {"out": None}))


TESTS = str(Path(__file__).parents[1])
KILLED = """
import sys
sys.path.append(sys.argv[2])
import numpy as np, sarcl
from helpers.block_runs import begin_earlier
begin_earlier(2.0)
box, chirp = sarcl.shapes.box((0.2, 0.3, 0.1)), sarcl.Waveform.chirp(center=1.25e9, bandwidth=500e6, duration=2e-8)
angle = np.deg2rad(np.linspace(20, 75, 12))
track = sarcl.Trajectory(None, np.stack([40 * np.cos(angle), 40 * np.sin(angle), 0 * angle], 1))
sarcl.fullwave_echo(box, chirp, track, polarization="all", cells=8, tolerance=0.05, check=True, out=sys.argv[1])
"""


@pytest.mark.skipif(os.name != "posix", reason="needs SIGKILL")
@pytest.mark.slow
def test_killed_calls_lose_the_run_in_progress_alone_and_end_with_the_same_bits(tmp_path):
    (tmp_path / "killed").mkdir()
    path, hit = tmp_path / "killed" / "a.h5", 0
    for number in range(4):
        before = len(tiles(path.parent, "anchors"))
        process = subprocess.Popen([sys.executable, "-c", KILLED, str(path), TESTS])
        while process.poll() is None and len(tiles(path.parent, "anchors")) < before + 1 + number % 2:
            time.sleep(0.001)
        time.sleep(0.02 * number)
        process.kill()
        hit += process.wait() == -signal.SIGKILL
        assert len(tiles(path.parent, "anchors")) > before or path.exists()
    for name in ("killed/a.h5", "b.h5"):
        subprocess.run([sys.executable, "-c", KILLED, str(tmp_path / name), TESTS], check=True)
    assert hit >= 3 and names(tmp_path) == ["b.h5", "killed"] and names(tmp_path / "killed") == ["a.h5"]
    assert same(sarcl.read(path), sarcl.read(tmp_path / "b.h5"))


# ---- several devices


@pytest.mark.parametrize("case", quick_of(["auto", "mirrored"], CASES))
def test_two_devices_of_a_kind_make_the_bits_of_one(case, pair, whole):
    both = of(case, device=pair)
    assert same(both, whole(case)) and both.report.device == f"{pair[0].info.name} + {pair[1].info.name}"


def test_both_devices_compute_runs_and_one_that_is_lost_is_left_out(pair, whole, monkeypatch, caplog):
    run, users, lost, begun = runs.run, set(), set(), threading.Barrier(2, timeout=60)

    def counted(device, *args, **options):
        if device in lost:
            raise DeviceFailed("kernel advance failed: DEVICE_NOT_AVAILABLE")
        if device not in users:
            users.add(device)
            begun.wait()
        return run(device, *args, **options)

    monkeypatch.setattr(runs, "run", counted)
    assert same(of("mirrored", device=pair), whole("mirrored")) and users == set(pair)
    lost.add(pair[1])
    assert same(of("mirrored", device=pair), whole("mirrored")) and "the other devices go on without it" in caplog.text
    lost.add(pair[0])
    with pytest.raises(DeviceFailed, match="DEVICE_NOT_AVAILABLE"):
        of("mirrored", device=pair)


def test_devices_of_two_kinds_agree_to_rounding(whole):
    working = [info.index for info in devices() if info.works]
    first = open_device(working[0])
    other = open_device(working[1]) if len(working) > 1 else first.without_fp64()
    one = whole("mirrored").samples[:]
    for second in (other, as_gpu(first)):
        both = of("mirrored", device=[first, second]).samples[:]
        assert np.linalg.norm(both - one) <= 1e-6 * np.linalg.norm(one)


def test_progress_of_several_devices_is_reported_by_the_callers_thread(pair):
    calls = []
    of("auto", device=pair, progress=lambda *a: calls.append((threading.current_thread(), *a)))
    assert {call[0] for call in calls} == {threading.main_thread()}
    done = [call[2] for call in calls if call[1] == "full-wave runs"]
    assert done == sorted(done) and done[-1] == calls[-1][3]


def test_forecasts_take_the_same_options_and_run_with_them(pair, whole, tmp_path):
    scene, track, own = CASES["mirrored"]
    options = {"cells": 8, "model_error": False, **own}
    assert same(sarcl.plan(sarcl.fullwave_echo, scene, CHIRP, track, device=pair, **options).run(), whole("mirrored"))
    piece = sarcl.plan(
        sarcl.fullwave_echo, scene, CHIRP, track, tile=(1, 2), out=tmp_path / "b.h5", **options
    )  # fmt: skip
    assert piece.run() is None and tiles(tmp_path, "anchors")


# ---- options and the command line

BAD = {
    "tile without a file": ({"tile": (1, 2)}, ValueError, r'tile is \(1, 2\) but out is no path; give out="raw.h5"'),
    "tile and no resume": ({"tile": (1, 2), "resume": False, "out": "a.h5"}, ValueError, "do not go together"),
    "tile beyond": ({"tile": (5, 3), "out": "a.h5"}, ValueError, r"tile is \(5, 3\); pieces of 3 are numbered 1 to 3"),
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
center = 1.25e9
bandwidth = 500e6
duration = 2e-8
[trajectory.circle]
radius = 40
height = 15
arc = 0.1
n_pulses = 3
[[scene.box]]
size = [0.2, 0.3, 0.1]
[fullwave_echo]
cells = 8
anchors = [0, 2]
model_error = false
"""


def test_pieces_on_the_command_line(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "s.toml").write_text(SCENARIO)
    assert parser.main(["simulate", "s.toml", "-o", "whole.h5", "--device", "all"]) == 0
    assert parser.main(["simulate", "s.toml", "-o", "a.h5", "--tile", "1/2"]) == 0
    assert "tiles wait in a.h5.anchors" in capsys.readouterr().out
    assert parser.main(["simulate", "s.toml", "-o", "a.h5", "--tile", "2/2", "--tolerance", "1e-2"]) == 2
    assert "tolerance was 0.03, is 0.01" in capsys.readouterr().err
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
        if stage == "full-wave runs" and done and victims:
            os.kill(victims.pop(), signal.SIGKILL)

    assert same(of("all", cluster=client, progress=kill), whole("all")) and not victims
