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
