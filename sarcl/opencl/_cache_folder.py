"""A cache folder that can be written: PoCL shows no device without one, and pyopencl builds no kernel."""

from __future__ import annotations

import functools
import logging
import os
import shutil
import sqlite3
import stat
import tempfile
from contextlib import closing, suppress
from pathlib import Path

log = logging.getLogger(__name__)


@functools.cache
def prepare() -> str:
    """Make XDG_CACHE_HOME of this process a folder that can be written and used, before any OpenCL driver is loaded.

    Returns what is wrong where no folder can be written, for messages; else "".
    """
    why = _writable()
    _drop_damaged()
    return why


def _drop_damaged() -> None:
    """Remove pyopencl's database of generated code where it is damaged: no kernel could be launched."""
    import platformdirs

    for path in Path(platformdirs.user_cache_dir("pytools", "pytools")).glob("pdict-*pyopencl*.sqlite"):
        try:
            with closing(sqlite3.connect(f"{path.absolute().as_uri()}?mode=ro", uri=True)) as database:
                if database.execute("PRAGMA quick_check").fetchone() == ("ok",):
                    continue
        except sqlite3.OperationalError:  # in use, or not to be read
            continue
        except sqlite3.DatabaseError:  # no database at all
            pass
        log.warning("%s is damaged and made anew", path)
        with suppress(OSError):
            path.unlink()


def drop_empty_programs() -> None:
    """Remove programs without contents from PoCL's cache, which a process leaves that ends while it builds them: PoCL
    takes them for built, and every later process would find no kernels in them."""
    import platformdirs

    folder = Path(os.environ.get("POCL_CACHE_DIR") or Path(platformdirs.user_cache_dir(), "pocl"))
    for path in list(folder.rglob("program.bc")):
        with suppress(OSError):
            if not path.stat().st_size:
                shutil.rmtree(path.parent)


def _writable() -> str:
    """Make XDG_CACHE_HOME a folder that can be written; what is wrong where there is none.

    Where the user's own can be written, nothing changes. Else a folder of this user's in the folder of temporary files
    is taken, and the log warns of it.
    """
    own, why = unwritable()
    if not why:
        return ""
    try:
        other = _temporary()
    except OSError as exc:
        return (
            f"the cache folder {own!r} cannot be written ({why}), nor can {tempfile.gettempdir()!r} ({exc.strerror}), "
            "and without one PoCL shows no device: set XDG_CACHE_HOME to a folder that you may write to"
        )
    log.warning(
        "the cache folder %r cannot be written (%s): kernels are kept in %s, which a restart may clear; set "
        "XDG_CACHE_HOME to a folder that you may write to",
        own,
        why,
        other,
    )
    os.environ["XDG_CACHE_HOME"] = other
    if "POCL_CACHE_DIR" in os.environ:
        os.environ["POCL_CACHE_DIR"] = os.path.join(other, "pocl")
    return ""


def unwritable() -> tuple[str, str]:
    """The folder of this user's caches that cannot be written, and why; empty texts where both can."""
    import platformdirs

    for folder in filter(None, (os.environ.get("POCL_CACHE_DIR"), platformdirs.user_cache_dir())):
        if why := _trouble(Path(folder)):
            return folder, why
    return "", ""


def _trouble(folder: Path) -> str:
    """Why nothing can be written in a folder, which is made where it is missing; "" where it can."""
    try:
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder) as file:
            file.write(bytes(4096))
            file.flush()
    except OSError as exc:
        return exc.strerror or str(exc)
    return ""


def _temporary() -> str:
    """This user's folder of that name, if nobody else can write in it, else a new one: binaries are run from it."""
    if hasattr(os, "getuid"):
        path = Path(tempfile.gettempdir()) / f"sarcl-cache-{os.getuid()}"
        try:
            path.mkdir(mode=0o700)
        except FileExistsError:
            pass
        status = os.lstat(path)
        if stat.S_ISDIR(status.st_mode) and status.st_uid == os.getuid() and not stat.S_IMODE(status.st_mode) & 0o077:
            return str(path)
    return tempfile.mkdtemp(prefix="sarcl-cache-")
