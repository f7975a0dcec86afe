"""Results of devices' trials, on disk: a small file in the user's cache folder.

The file only saves time. One that is missing, damaged, a link or another user's is taken for empty, and one that cannot
be written is not written.
"""

from __future__ import annotations

import contextlib
import functools
import json
import os
import stat
from dataclasses import asdict
from pathlib import Path

from ._trial import Outcome

LARGEST = 2**16  # bytes of a file that is read: an entry has about 400


def find(key: str) -> Outcome | None:
    """What the trial of the device of `key` found; None when it is not recorded."""
    return _record().get(key)


def keep(key: str, outcome: Outcome) -> None:
    """Record what the trial of the device of `key` found."""
    import tempfile

    _record()[key] = outcome
    with contextlib.suppress(OSError):
        path = _path()
        path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
        descriptor, part = tempfile.mkstemp(dir=path.parent)
        try:
            with open(descriptor, "w") as file:
                json.dump({name: asdict(outcome) for name, outcome in _record().items()}, file, indent=1)
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
def _record() -> dict[str, Outcome]:
    """The entries of the file, read once per process."""
    try:
        entries = json.loads(_text(_path()))
    except (OSError, ValueError, RecursionError):
        return {}
    if not isinstance(entries, dict) or not all(map(_is_outcome, entries.values())):
        return {}
    return {name: Outcome(**entry) for name, entry in entries.items()}


def _is_outcome(entry: object) -> bool:
    """Whether an entry of the file has the fields of an Outcome, each of its type."""
    passed = asdict(Outcome())
    return isinstance(entry, dict) and {k: type(v) for k, v in entry.items()} == {k: type(v) for k, v in passed.items()}


def _text(path: Path) -> bytes:
    """Contents of a regular file of this user; OSError for anything else."""
    descriptor = os.open(path, os.O_RDONLY | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0))
    with open(descriptor, "rb") as file:
        status = os.fstat(descriptor)
        if not stat.S_ISREG(status.st_mode) or (hasattr(os, "getuid") and status.st_uid != os.getuid()):
            raise OSError(f"{path} is no file of this user")
        return file.read(LARGEST)
