"""A cache folder that cannot be written: another is taken and named, and the true cause is told where there is none."""

import os
import stat
import subprocess
import sys

import pytest

from sarcl.opencl import _cache_folder
from sarcl.opencl.choose_device import open_device

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="cache folders of Linux")


def devices(tmp_path, **environment):
    """`sarcl devices` with other folders."""
    left = {k: v for k, v in os.environ.items() if k not in ("XDG_CACHE_HOME", "POCL_CACHE_DIR", "TMPDIR")}
    return subprocess.run(
        [sys.executable, "-m", "sarcl", "devices"],
        env={**left, **environment}, capture_output=True, text=True, timeout=120,
    )  # fmt: skip


def test_without_a_cache_folder_a_temporary_one_is_taken_and_said(tmp_path):
    (tmp_path / "file").touch()
    (tmp_path / "tmp").mkdir()
    done = devices(tmp_path, HOME=str(tmp_path / "file" / "home"), TMPDIR=str(tmp_path / "tmp"))
    assert done.returncode == 0, done.stderr
    assert "file/home/.cache' cannot be written (Not a directory): kernels are kept in" in done.stderr
    assert "set XDG_CACHE_HOME to a folder" in done.stderr
    (made,) = (tmp_path / "tmp").iterdir()
    assert stat.S_IMODE(made.stat().st_mode) == 0o700 and any(made.iterdir())


def test_a_cache_folder_that_can_be_written_stays(monkeypatch, tmp_path):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.delenv("POCL_CACHE_DIR", raising=False)
    assert _cache_folder.prepare.__wrapped__() == ""
    assert os.environ["XDG_CACHE_HOME"] == str(tmp_path / "cache")


def test_without_any_folder_the_cause_is_told_and_not_to_install_pocl(monkeypatch, tmp_path):
    (tmp_path / "file").touch()
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "file" / "cache"))
    monkeypatch.setattr(_cache_folder.tempfile, "gettempdir", lambda: str(tmp_path / "file"))
    said = _cache_folder.prepare.__wrapped__()
    assert "cannot be written (Not a directory), nor can" in said and "set XDG_CACHE_HOME" in said
    monkeypatch.setattr("sarcl.opencl.choose_device.listed", tuple)
    monkeypatch.setattr("sarcl.opencl.choose_device.devices", tuple)
    monkeypatch.setattr(_cache_folder, "prepare", lambda: said)
    with pytest.raises(RuntimeError) as caught:
        open_device()
    assert said in str(caught.value) and "apt-get" not in str(caught.value)


@pytest.mark.parametrize("how", ["open to others", "a link"])
def test_a_folder_in_which_others_may_write_is_not_taken(monkeypatch, tmp_path, how):
    monkeypatch.setattr(_cache_folder.tempfile, "tempdir", str(tmp_path))
    known = tmp_path / f"sarcl-cache-{os.getuid()}"
    if how == "a link":
        (tmp_path / "elsewhere").mkdir(mode=0o700)
        known.symlink_to("elsewhere")
    else:
        known.mkdir()
        known.chmod(0o777)
    found = _cache_folder._temporary()
    assert found != str(known) and stat.S_IMODE(os.stat(found).st_mode) == 0o700


BEAM = (
    "import sarcl; array = sarcl.AntennaArray.linear(3, spacing=0.01); "
    "print(sarcl.beam(array, 1e10, times=[0.0], positions=[[9, 0, 0]]))"
)


def computed(folder):
    """A field that a new process computes with its caches in `folder`, as text, and what it says beside that."""
    left = {k: v for k, v in os.environ.items() if k != "POCL_CACHE_DIR"}
    done = subprocess.run(
        [sys.executable, "-c", BEAM], env={**left, "XDG_CACHE_HOME": str(folder)}, capture_output=True, text=True,
        timeout=120,
    )  # fmt: skip
    return done.stdout, done.stderr


@pytest.mark.slow
def test_damaged_caches_of_pyopencl_and_sarcl_are_written_again(tmp_path):
    wanted, _ = computed(tmp_path)
    folders = [tmp_path / name for name in ("sarcl", "pyopencl", "pytools")]
    files = [p for folder in folders for p in folder.rglob("*") if p.is_file()]
    assert "devices.json" in {p.name for p in files} and any(p.suffix == ".sqlite" for p in files)
    whole = {path: path.read_bytes() for path in files}
    for damaged in (lambda b: b"", lambda b: os.urandom(300), lambda b: b[: len(b) // 2]):
        for path in files:
            path.write_bytes(damaged(whole[path]))
        assert computed(tmp_path)[0] == wanted != ""


@pytest.mark.slow
def test_empty_programs_in_the_cache_of_pocl_are_named_with_the_remedy(tmp_path):
    computed(tmp_path)
    files = [p for p in (tmp_path / "pocl").rglob("program.bc")]
    if not files:
        pytest.skip("not PoCL")
    for path in (tmp_path / "pocl").rglob("*"):
        if path.is_file():
            path.write_bytes(b"")
    (tmp_path / "sarcl" / "devices.json").unlink()
    out, said = computed(tmp_path)
    assert (
        not out
        and "built a program without kernels: its cache of built programs" in said
        and "delete that folder" in said
    )


@pytest.mark.slow
@pytest.mark.skipif(hasattr(os, "getuid") and os.getuid() == 0, reason="root may write anywhere")
def test_caches_that_can_only_be_read_are_replaced_by_a_temporary_one(tmp_path):
    wanted, _ = computed(tmp_path)
    for path in (tmp_path, *tmp_path.rglob("*")):
        path.chmod(0o555 if path.is_dir() else 0o444)
    try:
        out, said = computed(tmp_path)
    finally:
        for path in (tmp_path, *tmp_path.rglob("*")):
            path.chmod(0o755)
    assert out == wanted and "cannot be written" in said and "set XDG_CACHE_HOME" in said
