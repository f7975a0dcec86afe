"""Two processes, or two threads, on one output file: one wins, the other is told, and what is there is whole."""

from __future__ import annotations

import subprocess
import sys
import threading
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from helpers.cases import SCENARIO, noise_on, straight

import sarcl
from sarcl.io import output_paths

RAW = noise_on(straight(16), n_samples=32)
GRID = sarcl.ImageGrid.plane(shape=(24, 24), spacing=0.1)
CHIRP = sarcl.Waveform.chirp(center=9e9, bandwidth=1e8, duration=1e-6)
TRACK = sarcl.Trajectory.line(start=(0, -5, 1e3), velocity=(0, 10, 0), prf=16.0, n_pulses=16)
POINT = sarcl.Scene.points([[0, 0, 0]])
TOLD = r"cannot write '.*': another run is writing it; wait for that one or choose another name"


def echoes(path, wait):
    return sarcl.echo(POINT, CHIRP, TRACK, out=path, progress=wait)


def spectral(path, wait):
    track = sarcl.Trajectory.line(start=(-700, 0, 700), velocity=(0, 1, 0), prf=100.0, n_pulses=16)
    return sarcl.spectral_echo(POINT, CHIRP, track, out=path, progress=wait)


def image(path, wait):
    return sarcl.backproject(RAW, GRID, out=path, progress=wait)


def image_with_tiles(path, wait):
    return sarcl.backproject(RAW, GRID, out=path, progress=wait, resume=True)


@pytest.mark.parametrize("make", [echoes, spectral, image, image_with_tiles])
def test_of_two_threads_one_wins_and_the_other_is_told(tmp_path, make):
    path, begun, told = tmp_path / "a.h5", threading.Event(), threading.Event()

    def first(*_):
        begun.set()
        told.wait(60)

    with ThreadPoolExecutor(1) as pool:
        winner = pool.submit(make, path, first)
        assert begun.wait(60)
        try:
            with pytest.raises(FileExistsError, match=TOLD):
                make(path, lambda *_: None)
        finally:
            told.set()
        made = winner.result(120)
    wanted = make(None, lambda *_: None) if make is not image_with_tiles else image(None, lambda *_: None)
    for name in ("samples", "data"):
        if hasattr(wanted, name):
            assert np.array_equal(getattr(sarcl.read(path), name)[...], getattr(wanted, name))
            assert np.array_equal(getattr(made, name)[...], getattr(wanted, name))
    assert [p.name for p in tmp_path.iterdir()] == ["a.h5"]


@pytest.mark.parametrize("name", ["a.h5", "a.png"])
def test_of_two_threads_that_save_one_image_one_is_told(tmp_path, monkeypatch, name):
    made, path, begun, told = sarcl.backproject(RAW, GRID), tmp_path / name, threading.Event(), threading.Event()
    commit = output_paths.Part.commit

    def late(part):
        begun.set()
        assert told.wait(60)
        commit(part)

    monkeypatch.setattr(output_paths.Part, "commit", late)
    with ThreadPoolExecutor(1) as pool:
        winner = pool.submit(made.save, path)
        assert begun.wait(60)
        try:
            with pytest.raises(FileExistsError, match=TOLD):
                made.save(path)
        finally:
            told.set()
        winner.result(60)
    assert [p.name for p in tmp_path.iterdir()] == [name]
    if name == "a.h5":
        assert np.array_equal(sarcl.read(path).data, made.data)


def test_many_threads_at_once_leave_one_whole_file(tmp_path):
    made = [
        sarcl.Image(np.full((64, 64), i, np.complex64), sarcl.ImageGrid.plane(shape=64, spacing=1)) for i in range(8)
    ]

    def save(one):
        try:
            one.save(tmp_path / "a.h5")
        except FileExistsError:
            return 0
        return 1

    with ThreadPoolExecutor(8) as pool:
        assert sum(pool.map(save, made)) >= 1
    found = np.asarray(sarcl.read(tmp_path / "a.h5").data)
    assert (found == found[0, 0]).all() and [p.name for p in tmp_path.iterdir()] == ["a.h5"]


def test_who_asks_for_no_tiles_does_not_delete_those_of_the_run_that_is_making_the_image(tmp_path):
    path = tmp_path / "a.h5"

    def second(stage, done, total):
        if not done:
            kept = sorted(p.name for p in (tmp_path / "a.h5.parts").iterdir())
            with pytest.raises(FileExistsError, match=TOLD):
                sarcl.backproject(RAW, GRID, out=path, resume=False)
            assert sorted(p.name for p in (tmp_path / "a.h5.parts").iterdir()) == kept

    sarcl.backproject(RAW, GRID, out=path, resume=True, progress=second)
    assert np.array_equal(sarcl.read(path).data, sarcl.backproject(RAW, GRID).data)


# Processes: the first is stopped where it has begun its file, so that both are at work

WORK = {
    "echo": "sarcl.echo(POINT, CHIRP, TRACK, out='a.h5')",
    "backproject": "sarcl.backproject(RAW, GRID, out='a.h5')",
    "simulate": "main(['simulate', 's.toml', '-o', 'a.h5'])",
}
PROCESS = """
import sys
import numpy as np
import sarcl
from sarcl.cli.parser import main
from sarcl.io import output_paths

import numpy as np
y = np.linspace(-30, 30, 16)
tx = np.stack([0 * y - 700, y, 0 * y + 714], axis=1)
RAW = sarcl.PhaseHistory(
    np.ones((16, 32), np.complex64), frequency=9e9, frequency_step=1e6, tx=tx,
    reference_range=np.linalg.norm(tx, axis=1),
)
GRID = sarcl.ImageGrid.plane(shape=(24, 24), spacing=0.1)
CHIRP = sarcl.Waveform.chirp(center=9e9, bandwidth=1e8, duration=1e-6)
TRACK = sarcl.Trajectory.line(start=(0, -5, 1e3), velocity=(0, 10, 0), prf=16.0, n_pulses=16)
POINT = sarcl.Scene.points([[0, 0, 0]])
put = output_paths.Part.commit

def commit(part):
    print("begun", flush=True)
    sys.stdin.readline()
    put(part)

output_paths.Part.commit = commit
"""


@pytest.mark.slow
@pytest.mark.parametrize("verb", WORK)
def test_of_two_processes_one_wins_and_the_other_is_told(tmp_path, verb):
    (tmp_path / "s.toml").write_text(SCENARIO)
    command = [sys.executable, "-c", PROCESS + WORK[verb]]
    first = subprocess.Popen(command, cwd=tmp_path, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    assert first.stdin is not None and first.stdout is not None
    while "begun" not in (line := first.stdout.readline()):
        assert line or first.poll() is None, "the first process ended early"
    second = subprocess.run(command, cwd=tmp_path, input="\n", capture_output=True, text=True, timeout=300)
    assert "another run is writing it; wait for that one or choose another name" in second.stderr
    first.communicate("\n", timeout=300)
    assert first.returncode == 0
    assert "a.h5" in {p.name for p in tmp_path.iterdir()} and not list(tmp_path.glob(".sarcl*"))
    found = sarcl.read(tmp_path / "a.h5")
    assert np.abs(np.asarray(found.samples[...] if verb != "backproject" else found.data[...])).max() > 0
