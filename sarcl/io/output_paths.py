"""Output files: checked before the computation starts, and written completely or not at all."""

from __future__ import annotations

import errno
import os
import shutil
import stat
import tempfile
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

from ..base.text import size_text
from ..base.types import PathLike
from . import _part
from ._part import Part

FILES = (__file__, _part.__file__)  # whose functions begin and finish files, and must not be interrupted by signals
LEAST_ROOM = 2**16  # bytes that must be free for a file whose size is not known: none is smaller than a disk's blocks
# endings of folders beside an unfinished result: of finished tiles of images and echoes, and of full-wave runs
TILES, ANCHORS = ".parts", ".anchors"
FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)


def check_writable(path: PathLike, n_bytes: int = 0) -> Path:
    """The file that `path` names, links followed, after a check that n_bytes can be written there.

    FileNotFoundError when the folder is missing, NotADirectoryError when the folder is a file,
    IsADirectoryError when `path` is a folder, PermissionError when nothing can be created there or `path` is
    write-protected or a device, OSError when the disk is too full. Nothing that exists is touched.
    """
    target = place(path)
    folder, shown = target.parent, str(path)
    if not os.path.lexists(folder):
        raise FileNotFoundError(f"cannot write {shown!r}: there is no folder {str(folder)!r}; create it")
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
        Part(target).remove()
    except OSError as exc:
        if exc.errno in FULL:
            raise no_room(path, exc, n_bytes) from None
        raise PermissionError(
            f"cannot write {shown!r}: {exc.strerror} in folder {str(folder)!r}; choose a folder you may write to"
        ) from None
    if max(n_bytes, LEAST_ROOM) > shutil.disk_usage(folder).free:
        raise no_room(path, None, n_bytes)
    return target


def place(path: PathLike) -> Path:
    """The file that `path` names, links followed; FileNotFoundError where the current folder has been deleted."""
    try:
        return Path(os.path.realpath(os.fspath(path)))
    except FileNotFoundError:
        raise FileNotFoundError(
            f"cannot write {str(path)!r}: the current folder has been deleted; change to another (os.chdir), or give a "
            "path that begins with /"
        ) from None


def tile_folder(path: PathLike) -> Path | None:
    """The folder of finished tiles beside a result; None where there is none."""
    folders = (Path(f"{os.path.realpath(path)}{ending}") for ending in (TILES, ANCHORS))
    return next((folder for folder in folders if folder.is_dir()), None)


def no_room(path: PathLike, cause: OSError | None, n_bytes: float = 0, what: str = "it", more: str = "") -> OSError:
    """The error of a full disk: the file, why, what it needs and what is free, and a remedy; more  said after that."""
    why = f"{cause.strerror}; " if cause is not None and cause.strerror else ""
    folder = next(each for each in place(path).parents if each.exists())  # it may have been deleted meanwhile
    free = size_text(shutil.disk_usage(folder).free)
    needs = f"needs {size_text(n_bytes)}, its disk has {free} free" if n_bytes else f"is on a disk with {free} free"
    remedy = "make room there or choose another disk"
    if cause is not None and cause.errno == errno.EFBIG:
        remedy = "raise the limit on files' sizes (ulimit -f)"
    number = errno.ENOSPC if cause is None else cause.errno
    error = OSError(f"cannot write {str(path)!r}: {why}{what} {needs}; {remedy}{more}")
    error.errno = number
    return error


def check_room(needs: Mapping[PathLike, float]) -> None:
    """OSError where the disks have no room for all of some files: their paths, and about the bytes that each needs.

    For files that are written after the work, so that a full disk is told before it.
    """
    wanted: dict[int, float] = {}
    for path, n_bytes in needs.items():
        folder = place(path).parent
        disk = os.stat(folder).st_dev
        what = "it" if disk not in wanted else "it, with the outputs before it,"
        wanted[disk] = wanted.get(disk, 0.0) + n_bytes
        if wanted[disk] > shutil.disk_usage(folder).free:
            raise no_room(path, None, wanted[disk], what)


@contextmanager
def atomic(path: PathLike, n_bytes: int = 0, alone: bool = False) -> Iterator[Path]:
    """Yield a new, empty file beside `path`; on success it is moved to `path`, on any exception it is removed.

    alone  FileExistsError while another run writes a file for `path`; else the last one stays, whole
    A process that has the old file open continues to read its content. Raises what `check_writable` raises.
    """
    part = begin(path, n_bytes, alone)
    try:
        yield part.path
        part.commit()
    except BaseException as exc:  # Ctrl-C too
        part.remove()
        if isinstance(exc, OSError) and exc.errno in FULL:
            raise no_room(path, exc, n_bytes) from None
        raise


def begin(path: PathLike, n_bytes: int = 0, alone: bool = False) -> Part:
    """A new, empty file beside `path`, to be committed or removed: `atomic` in steps.

    alone  FileExistsError while another run writes a file for `path`. Raises what `check_writable` raises.
    """
    return Part.begun(check_writable(path, n_bytes), path, alone)


def put_in_place(target: Path, write_to: Callable[[Path], object]) -> None:
    """Write a new file or folder beside `target`, and move it there when it is whole; what stood there is removed.

    On any exception, Ctrl-C too, what stood there stands there again. OSError where the disk is full.
    """
    with tempfile.TemporaryDirectory(prefix=f".{target.name}-", dir=target.parent) as name:
        new, old = Path(name) / "new", Path(name) / "old"
        try:
            write_to(new)
            if target.is_dir():
                target.rename(old)
            new.rename(target)
        except BaseException as exc:
            if old.exists():
                old.rename(target)
            if isinstance(exc, OSError) and exc.errno in FULL:
                raise no_room(target, exc) from None
            raise
