"""The current folder, or that of an output, deleted while running: errors say so, and what is computed is written."""

import logging
import os
import shutil
import subprocess
import sys

import numpy as np
import pytest
from helpers.cases import noise_on, straight

import sarcl
from sarcl.io import output_paths
from sarcl.opencl import programs

RAW = noise_on(straight(16), n_samples=32)
GRID = sarcl.ImageGrid.plane(shape=(64, 64), spacing=0.1)
CHIRP = sarcl.Waveform.chirp(center=9e9, bandwidth=1e8, duration=1e-6)
TRACK = sarcl.Trajectory.line(start=(0, -5, 1e3), velocity=(0, 10, 0), prf=16.0, n_pulses=16)
VERBS = {
    "backproject": lambda **k: sarcl.backproject(RAW, GRID, **k),
    "backproject, tiles kept": lambda **k: sarcl.backproject(RAW, GRID, resume=True if "out" in k else None, **k),
    "echo": lambda **k: sarcl.echo(sarcl.Scene.points([[0, 0, 0]]), CHIRP, TRACK, **k),
}
GONE = """
import os, sys, sarcl
os.mkdir(sys.argv[1]); os.chdir(sys.argv[1]); os.rmdir(sys.argv[1])
track = sarcl.Trajectory.line(start=(0, 0, 0), velocity=(1, 0, 0), prf=1.0, n_pulses=3)
raw = sarcl.PhaseHistory([[1j], [1], [1]], frequency=1e9, frequency_step=1e6, tx=track.positions, reference_range=0)
for call in (
    lambda: raw.save("a.h5"), lambda: raw.save("b/a.h5"), lambda: sarcl.read("a.h5"), lambda: sarcl.Orbit.read("a.EOF"),
    lambda: sarcl.Scene.from_mesh("a.stl"), lambda: sarcl.scenario.load("a.toml"),
):
    try:
        call()
    except FileNotFoundError as exc:
        print(exc)
raw.save(sys.argv[2])
"""


@pytest.mark.skipif(os.name == "nt", reason="Windows keeps folders that are in use")
def test_names_of_files_in_a_current_folder_that_is_gone_say_so(tmp_path):
    kept, script = tmp_path / "kept.h5", tmp_path / "script.py"
    script.write_text(GONE)
    # these Pythons import NumPy in a deleted folder only into scripts: github.com/python/cpython/issues/130932
    code = [str(script)] if (3, 13) <= sys.version_info < (3, 13, 3) else ["-c", GONE]
    done = subprocess.run(
        [sys.executable, *code, str(tmp_path / "gone"), str(kept)], capture_output=True, text=True, check=True
    )
    said = done.stdout.splitlines()
    assert len(said) == 6 and kept.exists(), done
    for line, name in zip(said, ("a.h5", "b/a.h5", "a.h5", "a.EOF", "a.stl", "a.toml"), strict=True):
        assert f"'{name}'" in line and "the current folder has been deleted; change to another (os.chdir)" in line


@pytest.mark.skipif(os.name == "nt", reason="Windows keeps folders that are in use")
@pytest.mark.parametrize("verb", VERBS)
def test_what_is_computed_is_written_though_its_folder_is_deleted_meanwhile(verb, tmp_path, caplog):
    folder, calls = tmp_path / "out", []

    def progress(*_):
        calls.append(folder.exists())
        if len(calls) == 2:
            shutil.rmtree(folder)

    folder.mkdir()
    wanted = VERBS[verb]()
    with caplog.at_level(logging.WARNING, "sarcl"):
        made = VERBS[verb](out=folder / "a.h5", progress=progress)
    assert calls[1] and "was deleted while a.h5 was written in it; it is made again" in caplog.text
    for each in (made, sarcl.read(folder / "a.h5")):
        got, want = (np.asarray(getattr(one, "samples", getattr(one, "data", None))) for one in (each, wanted))
        np.testing.assert_array_equal(got, want)
    assert [path.name for path in folder.iterdir()] == ["a.h5"]


@pytest.mark.skipif(os.name == "nt", reason="Windows keeps folders that are in use")
@pytest.mark.parametrize("what", ["folder", "name"])
def test_a_file_that_is_deleted_before_it_is_committed_is_written_anew(tmp_path, what):
    folder = tmp_path / "out"
    folder.mkdir()
    with output_paths.atomic(folder / "a.txt") as part:
        part.write_text("kept")
        shutil.rmtree(folder) if what == "folder" else part.unlink()
    assert (folder / "a.txt").read_text() == "kept" and [path.name for path in folder.iterdir()] == ["a.txt"]


def test_a_limit_on_files_that_would_end_pocl_is_told_before_it_builds(monkeypatch):
    resource = pytest.importorskip("resource")
    monkeypatch.setattr(resource, "getrlimit", lambda which: (51200, resource.RLIM_INFINITY))
    with pytest.raises(OSError, match=r"kernels cannot be built: files may have 51\.2 kB .*\(ulimit -f\).*raise the"):
        programs.check_file_limit()
    monkeypatch.setattr(resource, "getrlimit", lambda which: (resource.RLIM_INFINITY,) * 2)
    programs.check_file_limit()
