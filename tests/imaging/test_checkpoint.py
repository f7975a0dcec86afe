"""Large images: pieces, killed runs and damaged tiles give the same bits as one undisturbed run, or an error."""

from __future__ import annotations

import contextlib
import errno
import io
import json
import logging
import os
import random
import signal
import subprocess
import sys
import time
from dataclasses import dataclass, fields, replace
from pathlib import Path

import numpy as np
import pytest
from helpers.block_runs import Stopped, begin_earlier, names, tiles
from helpers.cases import noise_history

import sarcl
from sarcl.blocks import tile_files
from sarcl.blocks.bands import BandBuffer
from sarcl.blocks.tile_files import mark
from sarcl.cli import parser
from sarcl.imaging.engine import Skipped
from sarcl.io import output_paths

GRID = sarcl.ImageGrid.plane(center=(1, 2, 0), shape=(700, 301), spacing=(0.03, 0.02))
LISTED = sarcl.ImageGrid.points(np.random.default_rng(0).uniform(-4, 4, (3, 100_000, 3)))
SMALL = 1e6  # max_bytes: some 30 000 pixels at once


@pytest.fixture(scope="module")
def raw():
    return noise_history(n_samples=16)


@pytest.fixture(scope="module")
def whole(raw):
    """GRID focused in one go."""
    return sarcl.backproject(raw, GRID)


def stop_after(pairs):
    """A progress function that ends the run once so many pairs are done."""

    def progress(stage, done, total):
        if done >= pairs:
            raise Stopped

    return progress


def half_done(raw, path, **options):
    """Leave the tiles of half an image behind."""
    with pytest.raises(Stopped):
        sarcl.backproject(
            raw,
            GRID,
            out=path,
            resume=True,
            max_bytes=SMALL,
            progress=stop_after(raw.n_rows * GRID.size / 2),
            **options,
        )


# ---- pieces


@pytest.mark.parametrize("n", [1, 2, 3, 20])
def test_any_number_of_pieces_in_any_order_gives_the_same_bits(raw, whole, tmp_path, n):
    order = random.Random(n).sample(range(1, n + 1), n)
    made = [sarcl.backproject(raw, GRID, out=tmp_path / "image.h5", tile=(i, n)) for i in order]
    if n <= bands(raw):  # with more pieces than bands some are empty, and may run after all others
        assert made[:-1] == [None] * (n - 1)
    assert np.array_equal(made[-1].data[...], whole.data)
    assert names(tmp_path) == ["image.h5"]
    a, b = made[-1].report, whole.report
    assert a.contributions_done == b.contributions_done and a.contributions_skipped == b.contributions_skipped
    assert np.array_equal(made[-1].gain, whole.gain) and made[-1].frequency == whole.frequency


def test_pieces_may_be_numbered_from_zero(raw, whole, tmp_path):
    made = [sarcl.backproject(raw, GRID, out=tmp_path / "image.h5", tile=(i, 3)) for i in range(3)]
    assert np.array_equal(made[-1].data[...], whole.data)


def test_pieces_on_every_device_and_of_listed_points(device, tmp_path):
    raw = noise_history(n_rows=5)
    wanted = sarcl.backproject(raw, LISTED, device=device, max_bytes=50e6)
    for i in (2, 1):
        made = sarcl.backproject(raw, LISTED, out=tmp_path / "image.h5", tile=(i, 2), device=device)
    assert np.array_equal(made.data[...], wanted.data)


def test_pieces_share_all_bands_and_none_twice():
    for bands in (1, 2, 7, 100):
        for n in (1, 2, 3, 8, 99, 101):
            shares = [tile_files.share(bands, i, n) for i in range(1, n + 1)]
            assert [b for a, c in shares for b in range(a, c)] == list(range(bands))
            assert tile_files.share(bands, 0, n) == shares[-1]
            whole = [tile_files.share(bands, i, n, unit=4) for i in range(1, n + 1)]
            assert [b for a, c in whole for b in range(a, c)] == list(range(bands))
            assert n > -(-bands // 4) or all(a % 4 == 0 for a, _ in whole)


def test_gaps_are_what_runs_leave():
    rng = random.Random(0)
    for _ in range(300):
        runs = sorted((a, a + rng.randint(1, 6)) for a in (rng.randint(0, 30) for _ in range(rng.randint(0, 5))))
        first = rng.randint(0, 20)
        last = first + rng.randint(0, 20)
        held = {b for a, c in runs for b in range(a, c)}
        left = [b for a, c in tile_files.gaps(runs, first, last) for b in range(a, c)]
        assert left == [b for b in range(first, last) if b not in held]


def test_pieces_of_different_memory_make_one_image(raw, whole, tmp_path):
    for i, max_bytes in ((1, None), (2, SMALL), (3, 4e6)):
        made = sarcl.backproject(raw, GRID, out=tmp_path / "image.h5", tile=(i, 3), max_bytes=max_bytes)
    assert np.array_equal(made.data[...], whole.data)


def test_a_piece_of_a_finished_image_does_nothing(raw, tmp_path):
    for i in (1, 2):
        sarcl.backproject(raw, GRID, out=tmp_path / "image.h5", tile=(i, 2))
    before = (tmp_path / "image.h5").stat()

    def fail(*_):
        raise AssertionError("work began")

    again = sarcl.backproject(raw, GRID, out=tmp_path / "image.h5", tile=(1, 2), progress=fail)
    assert again.data.shape == GRID.shape
    assert os.path.samestat(before, (tmp_path / "image.h5").stat()) and names(tmp_path) == ["image.h5"]


def test_the_plain_call_completes_what_pieces_began(raw, whole, tmp_path):
    sarcl.backproject(raw, GRID, out=tmp_path / "image.h5", tile=(2, 3))
    image = sarcl.backproject(raw, GRID, out=tmp_path / "image.h5")
    assert np.array_equal(image.data[...], whole.data)
    n = bands(raw)
    first, last = tile_files.share(n, 2, 3, planned(raw).unit)
    assert image.report.plan["from files"] == f"{last - first} of {n} bands"
    assert names(tmp_path) == ["image.h5"]


# ---- resuming


def test_a_run_that_was_stopped_goes_on_and_makes_no_tile_twice(raw, whole, tmp_path):
    path = tmp_path / "image.h5"
    half_done(raw, path)
    tiling, runs = planned(raw).tiling, found(raw, path)
    left = GRID.size - sum(tiling.count(*run) for run in runs)
    assert 0.3 * GRID.size < left < 0.7 * GRID.size and not path.exists()
    calls = []
    image = sarcl.backproject(raw, GRID, out=path, progress=lambda *a: calls.append(a))
    assert calls[-1][1:] == (raw.n_rows * left, raw.n_rows * left)
    assert np.array_equal(image.data[...], whole.data)
    assert image.report.contributions_done == whole.report.contributions_done
    assert names(tmp_path) == ["image.h5"]


def planned(raw):
    """How GRID is focused."""
    return sarcl.backproject.planned(raw, GRID).chosen


def bands(raw):
    """How many bands GRID has."""
    return planned(raw).tiling.n_bands


def found(raw, path):
    """Runs of bands in the files beside an image, read and checked."""
    job = sarcl.backproject.planned(raw, GRID).job
    files = tile_files.TileStore(tile_files.folder_of(path, job), job)
    return [run for run, _, _ in files.found(0, bands(raw))]


def test_tile_files_name_why_pairs_were_skipped(raw, tmp_path):
    tiling, skipped = planned(raw).tiling, Skipped(window=2**70, beam=3)
    files = tile_files.TileStore(tmp_path / "image.h5.parts", sarcl.backproject.planned(raw, GRID).job)
    files.save(0, 1, [np.zeros((tiling.count(0, 1) // 301, 301), np.complex64)], skipped)
    (path,) = tiles(tmp_path)
    assert b'"tally": {"window": 1180591620717411303424, "beam": 3}' in path.read_bytes()
    assert [(run, n) for run, _, n in files.found(0, tiling.n_bands)] == [((0, 1), skipped)]


def test_a_short_run_that_fails_leaves_nothing_unless_asked(raw, tmp_path):
    with pytest.raises(Stopped):
        sarcl.backproject(raw, GRID, out=tmp_path / "image.h5", max_bytes=SMALL, progress=stop_after(1))
    assert names(tmp_path) == []


def test_an_interrupted_run_keeps_what_is_worth_it(raw, whole, tmp_path, monkeypatch, caplog):
    begin_earlier(2.0, monkeypatch.setattr)
    options = {"out": tmp_path / "image.h5", "max_bytes": SMALL, "progress": stop_after(raw.n_rows * GRID.size / 2)}
    with pytest.raises(Stopped):
        sarcl.backproject(raw, GRID, **options)
    assert names(tmp_path) == []  # less than a minute of work
    begin_earlier(100.0, monkeypatch.setattr)
    with pytest.raises(Stopped):
        sarcl.backproject(raw, GRID, **options)
    assert len(tiles(tmp_path)) >= 3 and "the same call continues" in caplog.text
    image = sarcl.backproject(raw, GRID, out=tmp_path / "image.h5")
    assert np.array_equal(image.data[...], whole.data) and names(tmp_path) == ["image.h5"]


def test_a_failure_never_removes_tiles_that_were_there_before(raw, tmp_path):
    half_done(raw, tmp_path / "image.h5")
    before = tiles(tmp_path)
    with pytest.raises(Stopped):
        sarcl.backproject(raw, GRID, out=tmp_path / "image.h5", max_bytes=SMALL, progress=stop_after(1))
    assert set(before) <= set(tiles(tmp_path))


def test_no_resume_starts_anew_and_keeps_nothing(raw, whole, tmp_path):
    half_done(raw, tmp_path / "image.h5")
    calls = []
    image = sarcl.backproject(
        raw, GRID, out=tmp_path / "image.h5", resume=False, progress=lambda *a: calls.append((a, len(tiles(tmp_path))))
    )
    assert calls[0] == (("backproject", 0, raw.n_rows * GRID.size), 0) and calls[-1][1] == 0
    assert np.array_equal(image.data[...], whole.data) and "from files" not in image.report.plan


def test_a_full_disk_costs_the_files_but_not_the_image(raw, whole, tmp_path, monkeypatch, caplog):
    def full(*_):
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(tile_files.TileStore, "save", full)
    begin_earlier(2.0, monkeypatch.setattr)
    image = sarcl.backproject(raw, GRID, out=tmp_path / "image.h5", max_bytes=SMALL)
    assert np.array_equal(image.data[...], whole.data)
    assert caplog.text.count("finished tiles cannot be kept") == 1 and "No space left" in caplog.text
    with pytest.raises(OSError, match="No space left"):
        sarcl.backproject(raw, GRID, out=tmp_path / "other.h5", tile=(1, 2))


LIMITED = """
import resource, sys
resource.setrlimit(resource.RLIMIT_FSIZE, (18_000_000,) * 2)
from sarcl.cli.parser import main
sys.exit(main(sys.argv[1:]))
"""


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="needs RLIMIT_FSIZE")
@pytest.mark.parametrize("flag", ["--resume", "--no-resume"])
def test_no_room_for_the_image_is_said_in_one_line_and_the_same_call_goes_on(raw, tmp_path, flag):
    raw.save(tmp_path / "raw.h5")
    large = sarcl.ImageGrid.plane(center=(1, 2, 0), shape=(1600, 1500), spacing=(0.01, 0.01))  # 19.2 MB
    grid = ["--center", 1, 2, 0, "--shape", 1600, 1500, "--spacing", 0.01, 0.01, "--max-bytes", "8e6"]
    argv = list(map(str, ["raw.h5", "-o", "image.h5", *grid, flag]))
    assert focus(*argv, folder=tmp_path)[0] == 0  # kernels' binaries are files too: here they are made
    (tmp_path / "image.h5").rename(tmp_path / "wanted.h5")
    done = subprocess.run(
        [sys.executable, "-c", LIMITED, "focus", *argv], cwd=tmp_path, capture_output=True, text=True, timeout=120
    )
    assert done.returncode == 2
    said = [line for line in done.stderr.splitlines() if "error" in line]
    assert len(said) == 1 and "Traceback" not in done.stderr and "ref count" not in done.stderr
    assert "cannot write 'image.h5': File too large; the image needs 19.2 MB" in said[0]
    assert "give the same call again" in said[0]
    kept = flag == "--resume"
    assert names(tmp_path) == [*(["image.h5.parts"] if kept else []), "raw.h5", "wanted.h5"]
    assert bool(tiles(tmp_path)) == kept
    image = sarcl.backproject(raw, large, out=tmp_path / "image.h5", max_bytes=8e6)
    assert ("from files" in image.report.plan) == kept
    assert np.array_equal(image.data[...], sarcl.read(tmp_path / "wanted.h5").data[...])


def test_what_was_wrong_is_not_hidden_by_a_file_that_cannot_be_closed(raw, tmp_path, monkeypatch):
    import h5py

    class Broken(h5py.File):
        def close(self):
            super().close()
            raise RuntimeError("Can't decrement id ref count")

    monkeypatch.setattr(h5py, "File", Broken)
    with pytest.raises(Stopped):
        sarcl.backproject(raw, GRID, out=tmp_path / "image.h5", progress=stop_after(1))
    assert names(tmp_path) == []


# ---- killed at any moment

SCRIPT = """
import sys
sys.path.insert(0, {tests!r})
import os, signal, random
from helpers.cases import noise_history
import sarcl
from helpers.block_runs import begin_earlier
begin_earlier(2.0)
left = {calls}
def deadly(call):
    def wrapped(*args, **options):
        global left
        left -= 1
        if left == 0 and {before}: os.kill(os.getpid(), signal.SIGKILL)
        result = call(*args, **options)
        if left == 0: os.kill(os.getpid(), signal.SIGKILL)
        return result
    return wrapped
grid = sarcl.ImageGrid.plane(center=(1, 2, 0), shape=(700, 301), spacing=(0.03, 0.02))
raw = noise_history(n_samples=16)
for name in ("replace", "link", "unlink", "rmdir", "mkdir", "open", "close"):
    setattr(os, name, deadly(getattr(os, name)))
sarcl.backproject(raw, grid, out={path!r}, max_bytes=1e6)
"""


def deadly_run(path, calls, before):
    """Focus in a process that kills itself at its `calls`-th change of a file: its exit status."""
    code = SCRIPT.format(tests=str(Path(__file__).parents[1]), calls=calls, before=before, path=str(path))
    return subprocess.run([sys.executable, "-c", code], timeout=120, capture_output=True).returncode


@pytest.mark.skipif(os.name != "posix", reason="needs SIGKILL")
def test_a_run_killed_between_any_two_changes_of_files_goes_on(raw, whole, tmp_path):
    path = tmp_path / "image.h5"
    killed, seen = 0, 0
    for calls in range(3, 500, 12):  # each run gets a little further than the one before
        status = deadly_run(path, calls, killed % 2 == 0)
        if status == 0:
            break
        assert status == -signal.SIGKILL
        killed += 1
        now = len(tiles(tmp_path))
        assert now >= seen or path.exists()  # no finished tile is lost
        seen = now
    assert status == 0 and killed >= 3
    assert np.array_equal(sarcl.read(path).data[...], whole.data)
    assert names(tmp_path) == ["image.h5"]


@pytest.fixture(scope="module")
def big(tmp_path_factory):
    """Echoes in a file, the options of an image of some seconds, and that image."""
    folder = tmp_path_factory.mktemp("big")
    raw = noise_history(n_rows=256, n_samples=128)
    raw.save(folder / "raw.h5")
    options = ["--center", "0", "0", "0", "--shape", "1500", "1500", "--spacing", "0.01", "0.01"]
    grid = sarcl.ImageGrid.plane(center=(0, 0, 0), shape=(1500, 1500), spacing=(0.01, 0.01))
    image = sarcl.backproject(sarcl.read(folder / "raw.h5"), grid)
    return [sys.executable, "-m", "sarcl", "focus", str(folder / "raw.h5"), *options], image


def start(command, folder, *more):
    return subprocess.Popen([*command, "-o", "a.h5", "--max-bytes", "4M", *more], cwd=folder, stdout=subprocess.DEVNULL)


def kill_at(processes, folder, n_tiles, rng):
    """SIGKILL to processes, one after another, from the moment that n_tiles files are there: how many it hit."""
    while len(tiles(folder)) < n_tiles and any(p.poll() is None for p in processes):
        time.sleep(0.001)
    killed = 0
    for process in rng.sample(processes, len(processes)):
        time.sleep(rng.uniform(0, 0.02))
        process.kill()
        killed += process.wait() == -signal.SIGKILL
    return killed


@pytest.mark.slow
@pytest.mark.skipif(os.name != "posix", reason="needs SIGKILL")
def test_a_command_killed_at_random_moments_ends_with_the_same_image(big, tmp_path):
    command, whole = big
    rng, killed = random.Random(0), 0
    while not (tmp_path / "a.h5").exists():
        kept = len(tiles(tmp_path))
        # few tiles at a time, so that there are many moments at which to kill
        killed += kill_at([start(command, tmp_path, "--resume")], tmp_path, kept + rng.randint(1, 6), rng)
        assert len(tiles(tmp_path)) > kept or (tmp_path / "a.h5").exists()
    assert killed >= 2
    subprocess.run([*command, "-o", "a.h5"], cwd=tmp_path, check=True, capture_output=True)
    assert np.array_equal(sarcl.read(tmp_path / "a.h5").data[...], whole.data)
    assert names(tmp_path) == ["a.h5"]


@pytest.mark.slow
@pytest.mark.skipif(os.name != "posix", reason="needs SIGKILL")
def test_an_array_of_jobs_run_at_once_and_killed_at_random_ends_with_the_same_image(big, tmp_path):
    command, whole = big
    rng, n, killed = random.Random(0), 3, 0

    def started():
        return [start(command, tmp_path, "--tile", f"{i}/{n}") for i in range(1, n + 1)]

    for _ in range(2):
        killed += kill_at(started(), tmp_path, len(tiles(tmp_path)) + rng.randint(2, 6), rng)
    assert killed >= n
    for process in started():
        assert process.wait(300) == 0
    assert np.array_equal(sarcl.read(tmp_path / "a.h5").data[...], whole.data)
    for process in started():  # again, as array jobs may be
        assert process.wait(300) == 0
    assert names(tmp_path) == ["a.h5"]


# ---- damaged and foreign tiles


def flip(path, at):
    data = bytearray(path.read_bytes())
    data[at] ^= 1 << at % 8
    path.write_bytes(data)


@pytest.mark.parametrize(
    "damage", ["payload", "head", "checksum", "truncated", "longer", "empty", "renamed", "swapped"]
)
def test_a_damaged_tile_is_noticed_and_made_again(raw, whole, tmp_path, caplog, damage):
    path = tmp_path / "image.h5"
    half_done(raw, path)
    bad, other = tiles(tmp_path)[:2]
    if damage == "truncated":
        bad.write_bytes(bad.read_bytes()[:-100])
    elif damage == "longer":
        bad.write_bytes(bad.read_bytes() + b"0")
    elif damage == "empty":
        bad.write_bytes(b"")
    elif damage == "renamed":
        os.replace(bad, other)
        bad = other
    elif damage == "swapped":
        one, two = bad.read_bytes(), other.read_bytes()
        bad.write_bytes(two)
        other.write_bytes(one)
    else:
        flip(bad, {"payload": 5000, "head": 30, "checksum": -7}[damage])
    image = sarcl.backproject(raw, GRID, out=path)
    assert bad.name in caplog.text and "made again" in caplog.text
    assert np.array_equal(image.data[...], whole.data)
    assert names(tmp_path) == ["image.h5"]


def test_no_single_bit_of_a_tile_can_flip_unnoticed(raw, tmp_path):
    path = tmp_path / "image.h5"
    half_done(raw, path)
    every = found(raw, path)
    file = tiles(tmp_path)[0]
    good = file.read_bytes()
    rng = random.Random(0)
    for at in [0, 13, 14, 21, 22, len(good) - 1, *(rng.randrange(len(good)) for _ in range(16))]:
        file.write_bytes(good)
        flip(file, at)
        assert found(raw, path) == every[1:], f"byte {at}"
        assert not file.exists()
    file.write_bytes(good)
    assert found(raw, path) == every


def test_a_piece_makes_its_own_damaged_tiles_again_and_the_last_those_of_the_others(raw, whole, tmp_path):
    path = tmp_path / "image.h5"
    for i in (1, 2):
        sarcl.backproject(raw, GRID, out=path, tile=(i, 3))
    for file in tiles(tmp_path):
        flip(file, 1000)
    assert sarcl.backproject(raw, GRID, out=path, tile=(1, 3)) is None
    image = sarcl.backproject(raw, GRID, out=path, tile=(3, 3))
    assert np.array_equal(image.data[...], whole.data)


def changed(raw):
    samples = np.array(raw.samples)
    samples[7, 5] += 1e-6
    return {"raw": replace(raw, samples=samples)}


OTHER = {
    "data": (changed, "other samples"),
    "track": (lambda raw: {"raw": replace(raw, tx=raw.tx + 1e-6)}, "other antennas"),
    "grid": (lambda raw: {"grid": replace(GRID, center=np.array([1.0, 2, 1e-6]))}, "other grid"),
    "tolerance": (lambda raw: {"tolerance": 1e-4}, r"tolerance was 0\.001, is 0\.0001"),
    "window": (lambda raw: {"window": "hamming"}, "other weights"),
    "weights": (lambda raw: {"weights": np.linspace(1, 2, 40)}, "other weights"),
    "wrap": (lambda raw: {"wrap": True}, "wrap was False, is True"),
    "skip": (lambda raw: {"skip": {"zero weight"}}, "skip was .*range window.*, is zero weight"),
}


@pytest.mark.parametrize("name", OTHER)
def test_tiles_of_another_job_are_refused_with_what_differs(raw, tmp_path, name):
    path = tmp_path / "image.h5"
    half_done(raw, path)
    before = {p: p.read_bytes() for p in (tmp_path / "image.h5.parts").iterdir()}
    change, message = OTHER[name]
    for more in ({}, {"tile": (1, 2)}):
        options = {"raw": raw, "grid": GRID, "out": path, **change(raw), **more}
        with pytest.raises(ValueError, match=f"another job: .*{message}.*--no-resume"):
            sarcl.backproject(**options)
    assert {p: p.read_bytes() for p in (tmp_path / "image.h5.parts").iterdir()} == before
    assert names(tmp_path) == ["image.h5.parts"]
    options.pop("tile")
    fresh, wanted = (sarcl.backproject(**{**options, **last}) for last in ({"resume": False}, {"out": None}))
    assert np.array_equal(fresh.data[...], wanted.data)


def test_every_field_of_a_task_has_its_part_in_the_fingerprint(raw):
    """Also fields that are added later: none may be forgotten."""
    plan = sarcl.backproject.planned(raw, GRID)
    task = plan.task

    def mark_of(task):
        return mark(replace(plan, task=task).job.describe())

    @dataclass(frozen=True, eq=False)
    class More(type(task)):
        more: object = None

    known = {f.name: getattr(task, f.name) for f in fields(task)}
    option = {"a": (1, 2.5, "b"), "c": np.arange(3)}
    kinds = [None, 1, 1.5, "x", {"a", "b"}, {"a", "c"}, option, {**option, "c": np.arange(4)}, raw.frequency, GRID]
    marks = [mark_of(More(**known, more=value)) for value in kinds]
    assert len({*marks, mark_of(task)}) == len(kinds) + 1
    assert marks == [mark_of(More(**known, more=value)) for value in kinds]
    with pytest.raises(TypeError, match="results computed with a function among the options"):
        mark_of(More(**known, more=lambda x: x))


def test_a_foreign_tile_among_ones_own_is_not_used(raw, whole, tmp_path, caplog):
    for folder, options in (("a", {}), ("b", {"window": "hamming"})):
        (tmp_path / folder).mkdir()
        half_done(raw, tmp_path / folder / "image.h5", **options)
    own, foreign = (tiles(tmp_path / folder)[0] for folder in "ab")
    assert own.name == foreign.name
    own.write_bytes(foreign.read_bytes())
    image = sarcl.backproject(raw, GRID, out=tmp_path / "a" / "image.h5")
    assert "belongs to another job" in caplog.text
    assert np.array_equal(image.data[...], whole.data)


def test_a_damaged_job_file_is_written_anew_and_the_tiles_that_fit_are_used(raw, whole, tmp_path, caplog):
    half_done(raw, tmp_path / "image.h5")
    said = tmp_path / "image.h5.parts" / "job.json"
    assert json.loads(said.read_text())["tolerance"] == 1e-3
    for damage in ("", "[]", "{}", '{"fingerprint": '):
        said.write_text(damage)
        assert len(found(raw, tmp_path / "image.h5")) >= 3 and "damaged" in caplog.text
        assert json.loads(said.read_text())["tolerance"] == 1e-3
        caplog.clear()
    image = sarcl.backproject(raw, GRID, out=tmp_path / "image.h5")
    assert np.array_equal(image.data[...], whole.data)


def test_files_that_are_not_sarcls_stay(raw, tmp_path, caplog):
    half_done(raw, tmp_path / "image.h5")
    (tmp_path / "image.h5.parts" / "notes.txt").write_text("mine")
    sarcl.backproject(raw, GRID, out=tmp_path / "image.h5")
    assert names(tmp_path / "image.h5.parts") == ["notes.txt"] and "not from sarcl and is not removed" in caplog.text


def test_a_file_in_the_folders_place_is_named(raw, tmp_path):
    (tmp_path / "image.h5.parts").write_text("mine")
    with pytest.raises(NotADirectoryError, match=r"image\.h5\.parts' is a file"):
        sarcl.backproject(raw, GRID, out=tmp_path / "image.h5", tile=(1, 2))


# ---- one run at a time


def test_a_second_run_to_the_same_image_is_refused_and_does_no_harm(raw, whole, tmp_path):
    path = tmp_path / "image.h5"

    def second(stage, done, total):
        if not done:
            with pytest.raises(FileExistsError, match="another run is writing it"):
                sarcl.backproject(raw, GRID, out=path)

    image = sarcl.backproject(raw, GRID, out=path, progress=second)
    assert np.array_equal(image.data[...], whole.data) and names(tmp_path) == ["image.h5"]


def test_a_piece_that_finds_another_run_at_its_image_leaves_its_tiles(raw, tmp_path):
    path = tmp_path / "image.h5"
    sarcl.backproject(raw, GRID, out=path, tile=(1, 2))
    part = output_paths.begin(path, alone=True)
    try:
        assert sarcl.backproject(raw, GRID, out=path, tile=(2, 2)) is None
    finally:
        part.remove()
    calls = []
    sarcl.backproject(raw, GRID, out=path, progress=lambda *a: calls.append(a))
    assert calls in ([], [("backproject", 0, 0)])


def test_the_work_file_of_a_killed_run_is_removed(raw, tmp_path):
    part = output_paths.begin(tmp_path / "image.h5", alone=True)
    part.path.write_bytes(b"half an image")
    part._unlock()  # as the end of a process does
    sarcl.backproject(raw, GRID, out=tmp_path / "image.h5")
    assert names(tmp_path) == ["image.h5"]


# ---- options and memory

BAD = {
    "tile without a file": ({"tile": (1, 2)}, r'tile is \(1, 2\) but out is no path; give out="image.h5"'),
    "resume without a file": ({"resume": True, "out": np.empty(GRID.shape, complex)}, "resume is True but out is no"),
    "tile and no resume": ({"tile": (1, 2), "resume": False, "out": "a.h5"}, "do not go together"),
    "half a tile": ({"tile": 1, "out": "a.h5"}, r"tile is 1; wanted \(i, n\)"),
    "tile beyond": ({"tile": (5, 4), "out": "a.h5"}, r"tile is \(5, 4\); pieces of 4 are numbered 1 to 4"),
    "tile of none": ({"tile": (0, 0), "out": "a.h5"}, r"tile\[1\] is 0"),
    "tile not whole": ({"tile": (1.5, 4), "out": "a.h5"}, r"tile\[0\] must be a whole number"),
    "max_bytes nan": ({"max_bytes": np.nan}, "max_bytes is nan"),
    "max_bytes negative": ({"max_bytes": -1e9}, "max_bytes is -1e"),
    "max_bytes zero": ({"max_bytes": 0}, "max_bytes is 0"),
    "a picture": ({"out": "a.png"}, r"out is 'a\.png'; images are made in HDF5 files: give a name that ends in \.h5"),
    "no ending": ({"out": "a", "resume": True}, "out is 'a'; images are made in HDF5 files"),
    "read-only array": ({"out": np.broadcast_to(np.zeros(1, complex), GRID.shape)}, "out is a read-only array"),
}


@pytest.mark.parametrize("name", BAD)
def test_bad_options_say_what_was_wanted(raw, tmp_path, monkeypatch, name):
    monkeypatch.chdir(tmp_path)
    options, message = BAD[name]
    with pytest.raises(ValueError, match=message):
        sarcl.backproject(raw, GRID, **options)
    assert names(tmp_path) == []


@pytest.mark.parametrize("out", [5, [1], b"a.h5", {"a": 1}], ids=str)
def test_out_is_an_array_or_a_path(raw, tmp_path, monkeypatch, out):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(
        TypeError, match=r"out is .* \(\w+\); wanted None, a complex array of the grid's shape, or a path"
    ):
        sarcl.backproject(raw, GRID, out=out)
    assert names(tmp_path) == []


def test_a_dataset_open_for_reading_is_refused_before_the_work(raw, tmp_path):
    import h5py

    with h5py.File(tmp_path / "a.h5", "w") as file:
        file.create_dataset("image", GRID.shape, np.complex64)

    def fail(*_):
        raise AssertionError("work began")

    with h5py.File(tmp_path / "a.h5", "r") as file, pytest.raises(ValueError, match="open for reading"):
        sarcl.backproject(raw, GRID, out=file["image"], progress=fail)


def test_resume_is_yes_no_or_nothing(raw, tmp_path):
    with pytest.raises(TypeError, match="resume is a str"):
        sarcl.backproject(raw, GRID, out=tmp_path / "a.h5", resume="yes")


def test_memory_too_small_for_one_row_names_what_would_do():
    raw = noise_history(n_rows=2, n_samples=40_000)
    with pytest.raises(MemoryError, match=r"max_bytes is 1 MB but .* give max_bytes=") as e:
        sarcl.backproject(raw, GRID, max_bytes=1e6)
    enough = float(str(e.value).rpartition("max_bytes=")[2].split()[0])
    assert sarcl.backproject(raw, GRID, max_bytes=enough * 1.05).data.shape == GRID.shape


@pytest.mark.costly
@pytest.mark.parametrize(
    "grid", [sarcl.ImageGrid.plane(shape=(40, 5000), spacing=0.002), LISTED], ids=["wide", "listed"]
)
def test_a_band_larger_than_memory_is_made_in_parts(device, grid, tmp_path):
    raw = noise_history(n_rows=70, n_samples=8)
    wanted = sarcl.backproject(raw, grid, device=device)
    calls = []
    # 80 000 pixels a band and more; 1 MB holds 30 000
    parts = sarcl.backproject(
        raw, grid, max_bytes=1e6, device=device, out=tmp_path / "a.h5", progress=lambda *a: calls.append(a)
    )
    assert np.array_equal(parts.data[...], wanted.data)
    assert parts.report.contributions_skipped == wanted.report.contributions_skipped
    done = [c[1] for c in calls]
    assert done == sorted(set(done)) and len(done) > 5 and done[-1] == calls[-1][2] == 70 * grid.size


def test_a_strip_takes_what_the_whole_image_would(raw):
    """Each band written into a BandBuffer of its own is what stands there in the image."""
    tiling, rng = planned(raw).tiling, np.random.default_rng(0)
    image = np.zeros(GRID.shape, np.complex64)
    for first, last in ((0, 2), (2, 3), (3, tiling.n_bands)):
        values = rng.standard_normal(tiling.pixels(first, last)).astype(np.complex64)
        strip = BandBuffer(tiling, first, last, np.complex64)
        for flat in (strip, image):
            tiling.place(values, (first, last), 0, tiling.bands(first, last)[1], flat)
        assert np.array_equal(strip.values, image[tiling.extent(first, last)])


# ---- command line


def focus(*argv, folder):
    """`sarcl focus` in this process: exit status, and all that it printed."""
    said = io.StringIO()
    with contextlib.chdir(folder), contextlib.redirect_stdout(said), contextlib.redirect_stderr(said):
        try:
            status = parser.main(["focus", *map(str, argv)])
        except SystemExit as end:  # argparse refuses by itself
            status = end.code
    return status, said.getvalue()


def test_tiles_on_the_command_line(raw, tmp_path):
    raw.save(tmp_path / "raw.h5")
    grid = ["--shape", 100, 90, "--spacing", 0.05, 0.05, "--center", 0, 0, 0]
    assert focus("raw.h5", "-o", "whole.h5", *grid, folder=tmp_path)[0] == 0
    status, said = focus("raw.h5", "-o", "a.h5", "-o", "a.png", *grid, "--tile", "1/2", folder=tmp_path)
    assert status == 0 and "tiles wait in a.h5.parts" in said
    status, said = focus("raw.h5", "-o", "a.h5", *grid, "--tile", "2/2", "--tolerance", "1e-2", folder=tmp_path)
    assert status == 2 and "tolerance was 0.001, is 0.01" in said
    status, said = focus("raw.h5", "-o", "a.h5", "-o", "a.png", *grid, "--tile", "2/2", folder=tmp_path)
    assert status == 0 and "wrote a.h5" in said and "wrote a.png" in said
    assert names(tmp_path) == ["a.h5", "a.png", "raw.h5", "whole.h5"]
    assert np.array_equal(*(sarcl.read(tmp_path / f).data[...] for f in ("a.h5", "whole.h5")))


@pytest.mark.parametrize("text", ["5/4", "1", "a/b", "1/0", "-1/3", "1/2/3"])
def test_invalid_pieces_are_refused(text, tmp_path):
    status, said = focus("raw.h5", "--tile", text, folder=tmp_path)
    assert status == 2 and ("is not a piece; give I/N" in said or "expected one argument" in said)


def test_pieces_need_a_file_to_come_together(raw, tmp_path):
    raw.save(tmp_path / "raw.h5")
    for flags in (["--tile", "1/2"], ["--resume"]):
        status, said = focus("raw.h5", *flags, folder=tmp_path)
        assert status == 2 and "give -o IMAGE.h5" in said


@pytest.fixture(autouse=True)
def warnings_of_sarcl(caplog):
    caplog.set_level(logging.WARNING, "sarcl")
