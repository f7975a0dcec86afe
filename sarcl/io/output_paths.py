"""Output files: checked before the computation starts, and written completely or not at all."""

from __future__ import annotations

import os
import secrets
import shutil
import stat
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any


def check_writable(path: Any, n_bytes: int = 0) -> Path:
    """The file that `path` names, links followed, after a check that n_bytes can be written there.

    FileNotFoundError when the folder is missing, NotADirectoryError when the folder is a file,
    IsADirectoryError when `path` is a folder, PermissionError when nothing can be created there or `path` is
    write-protected or a device, OSError when the disk is too full. Nothing that exists is touched.
    """
    target = Path(os.path.realpath(os.fspath(path)))
    folder, shown = target.parent, str(path)
    if not os.path.lexists(folder):
        raise FileNotFoundError(
            f"cannot write {shown!r}: there is no folder {str(folder)!r}; create it or choose another"
        )
    if not folder.is_dir():
        raise NotADirectoryError(f"cannot write {shown!r}: {str(folder)!r} is a file, not a folder; choose another")
    try:
        mode = target.stat().st_mode
    except FileNotFoundError:
        pass
    except OSError as exc:
        raise PermissionError(f"cannot write {shown!r}: {exc.strerror}; choose another name or folder") from None
    else:
        if stat.S_ISDIR(mode):
            raise IsADirectoryError(f"cannot write {shown!r}: it is a folder; give the name of a file in it")
        if not stat.S_ISREG(mode):
            raise PermissionError(f"cannot write {shown!r}: it is a device or a pipe; give the name of a file")
        if not os.access(target, os.W_OK):
            raise PermissionError(f"cannot write {shown!r}: it is write-protected; chmod u+w it or choose another name")
    # Asking for permission is not enough: root has all of them, even on /proc or a read-only disk. So try.
    try:
        _create_beside(target).unlink()
    except OSError as exc:
        raise PermissionError(
            f"cannot write {shown!r}: {exc.strerror} in folder {str(folder)!r}; choose a folder you may write to"
        ) from None
    free = shutil.disk_usage(folder).free
    if n_bytes > free:
        raise OSError(
            f"cannot write {shown!r}: it needs {n_bytes / 1e9:.2f} GB, "
            f"its disk has {free / 1e9:.2f} GB free; make room or choose another disk"
        )
    return target


@contextmanager
def atomic(path: Any, n_bytes: int = 0) -> Iterator[Path]:
    """Yield a new, empty file beside `path`; on success it is moved to `path`, on any exception it is removed.

    A process that has the old file open continues to read its content. Raises what `check_writable` raises.
    """
    part = begin(path, n_bytes)
    try:
        yield part
        commit(part, path)
    except BaseException:  # Ctrl-C too
        part.unlink(missing_ok=True)
        raise


def begin(path: Any, n_bytes: int = 0) -> Path:
    """A new, empty file beside `path`, to be given to `commit` or unlinked: `atomic` in two steps."""
    return _create_beside(check_writable(path, n_bytes))


def commit(part: Path, path: Any) -> None:
    """Make the finished file `part` the file `path`, with the permissions `path` had."""
    target = Path(os.path.realpath(os.fspath(path)))
    if target.exists():
        shutil.copymode(target, part)
    os.replace(part, target)


def claim(path: Any, n_bytes: int = 0) -> tuple[Path, int]:
    """The one work file of `path` and a descriptor that holds its lock: commit or unlink the one, then close the other.

    Its name follows from `path`, so that a later run takes over the file that a killed run left.
    FileExistsError while another run holds it; else raises what `check_writable` does.
    """
    target = check_writable(path, n_bytes)
    part = target.parent / f".sarcl-{target.name}.part"
    while True:
        lock = os.open(part, os.O_RDWR | os.O_CREAT, 0o666)
        try:
            _lock(lock, path)
            # between opening and locking, the run before may have put this file in its place or removed it
            if os.path.exists(part) and os.path.samestat(os.fstat(lock), os.stat(part)):
                return part, lock
        except BaseException:
            os.close(lock)
            raise
        os.close(lock)


def _lock(descriptor: int, path: Any) -> None:
    """Lock a file without waiting; without effect where the system or the disk has no locks."""
    try:
        import fcntl
    except ImportError:
        return
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        raise FileExistsError(
            f"cannot write {str(path)!r}: another run is writing it; wait for that one or choose another name"
        ) from None
    except OSError:
        pass


def _create_beside(target: Path) -> Path:
    """An empty file of a new, hidden name beside `target`, with the permissions any new file gets."""
    while True:
        part = target.parent / f".sarcl-{secrets.token_hex(6)}.part"
        try:
            os.close(os.open(part, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o666))
        except FileExistsError:
            continue
        return part
