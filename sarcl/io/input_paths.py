"""Input files: they must be regular files that can be read. Loads nothing that takes time."""

from __future__ import annotations

import os
import stat
from pathlib import Path


def check(path: Path, what: str = "", folder: str = "give the name of a file in it") -> None:
    """Refuse what is no regular file, by its name after `what`: a pipe would make its reader wait for a writer.

    folder  what to do where the path is a folder
    FileNotFoundError, IsADirectoryError; ValueError for pipes and devices.
    """
    shown = f"{what} {str(path)!r}".strip()
    try:
        mode = os.stat(path).st_mode
    except (FileNotFoundError, NotADirectoryError):
        if not path.is_absolute() and _is_deleted_here():
            raise FileNotFoundError(
                f"{shown} cannot be found: the current folder has been deleted; change to another (os.chdir), or give "
                "a path that begins with /"
            ) from None
        raise FileNotFoundError(f"{shown} does not exist; check the name and the folder") from None
    except OSError as exc:
        raise PermissionError(f"{shown} cannot be read: {exc.strerror}; check the name and its permissions") from None
    except ValueError:  # a null byte
        raise FileNotFoundError(f"{shown} is no name of a file; check the name") from None
    if stat.S_ISDIR(mode):
        raise IsADirectoryError(f"{shown} is a folder; {folder}")
    if not stat.S_ISREG(mode):
        kind = "a pipe" if stat.S_ISFIFO(mode) else "a socket" if stat.S_ISSOCK(mode) else "a device"
        raise ValueError(f"{shown} is {kind}, wanted a regular file, which is read in any order: copy it to one first")


def _is_deleted_here() -> bool:
    """Whether the current folder has been deleted."""
    try:
        os.getcwd()
    except FileNotFoundError:
        return True
    return False


def contents(path: Path, what: str = "") -> bytes:
    """All bytes of a file, after `check`; PermissionError names a file that cannot be read."""
    check(path, what)
    return _read(path, what, -1)


def head(path: Path, folder: str) -> bytes:
    """The first 32 bytes of a file, after `check`."""
    check(path, folder=folder)
    return _read(path, "", 32)


def _read(path: Path, what: str, n_bytes: int) -> bytes:
    try:
        with open(path, "rb") as file:
            return file.read(n_bytes)
    except OSError as exc:
        shown = f"{what} {str(path)!r}".strip()
        raise PermissionError(f"{shown} cannot be read: {exc.strerror}; check its permissions and its disk") from None
