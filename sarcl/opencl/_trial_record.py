"""Devices that passed their trial, on disk: a small file in the user's cache folder.

The file only saves time. One that is missing, damaged, a link or another user's is taken for empty, and one that cannot
be written is not written.
"""

from __future__ import annotations

import contextlib
import functools
import json
import os
import stat
from pathlib import Path

LARGEST = 2**16  # bytes of a file that is read: an entry has about 200


def find(key: str) -> bool | None:
    """Whether the device of `key` computes in float64; None when its trial is not recorded."""
    return _record().get(key)


def keep(key: str, fp64: bool) -> None:
    """Record that the device of `key` passed its trial, and whether it computes in float64."""
    import tempfile

    _record()[key] = fp64
    with contextlib.suppress(OSError):
        path = _path()
        path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
        descriptor, part = tempfile.mkstemp(dir=path.parent)
        try:
            with open(descriptor, "w") as file:
                json.dump(_record(), file, indent=1)
            os.replace(part, path)
        except BaseException:
            os.unlink(part)
            raise


def clear() -> None:
    """Forget every trial, here and on disk."""
    _record().clear()
    with contextlib.suppress(OSError):
        _path().unlink()


def _path() -> Path:
    """The file, in XDG_CACHE_HOME where that is set; OSError where the user has no home folder."""
    import platformdirs

    path = Path(platformdirs.user_cache_dir("sarcl", appauthor=False)) / "devices.json"
    if not path.is_absolute():
        raise OSError(f"{path} would lie in the current folder")
    return path


@functools.cache
def _record() -> dict[str, bool]:
    """The entries of the file, read once per process."""
    try:
        entries = json.loads(_text(_path()))
    except (OSError, ValueError, RecursionError):
        return {}
    if not isinstance(entries, dict) or not all(isinstance(fp64, bool) for fp64 in entries.values()):
        return {}
    return entries


def _text(path: Path) -> bytes:
    """Contents of a regular file of this user; OSError for anything else."""
    descriptor = os.open(path, os.O_RDONLY | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0))
    with open(descriptor, "rb") as file:
        found = os.fstat(descriptor)
        if not stat.S_ISREG(found.st_mode) or (hasattr(os, "getuid") and found.st_uid != os.getuid()):
            raise OSError(f"{path} is no file of this user")
        return file.read(LARGEST)
