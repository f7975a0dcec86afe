"""Files that are being written: each lies beside its target, under a random name, locked while its process lives."""

from __future__ import annotations

import logging
import os
import platform
import re
import secrets
import shutil
import stat
import time
import zlib
from pathlib import Path

from ..base.types import PathLike

log = logging.getLogger(__name__)

# names of this version, with machine and target, and those of earlier ones
NAME = re.compile(r"\.sarcl-(?:(?P<host>[0-9a-f]{8})-(?P<target>[0-9a-f]{8})-[0-9a-f]{12}|.+)\.part", re.DOTALL)
OLD = 86400.0  # s: files of other machines, whose locks may not be seen here, are left alone until they are this old
TRIES = 8  # of two runs that begin at the same moment, both may see the other and begin again


class Part:
    """An empty file beside `target` with the permissions any new file gets; path  its name.

    It is made with O_EXCL and O_NOFOLLOW under a name that nobody knows before, so that no link is written through.
    `commit` moves it to `target`, `remove` removes it; after one of them nothing happens any more.
    """

    def __init__(self, target: Path) -> None:
        self.target = target
        while True:
            self.path = target.parent / f".sarcl-{_host()}-{_tag(target)}-{secrets.token_hex(6)}.part"
            flags = os.O_RDWR | os.O_CREAT | os.O_EXCL | getattr(os, "O_NOFOLLOW", 0)
            try:
                self._lock: int | None = os.open(self.path, flags, 0o666)
            except FileExistsError:
                continue
            if _try_lock(self._lock) is not False and _is_file_at(self._lock, self.path):
                return
            os.close(self._lock)  # another process took it for a leftover before it was locked

    @classmethod
    def begun(cls, target: Path, shown: PathLike, alone: bool) -> Part:
        """A new file, after the removal of files beside it that no living process owns.

        alone  FileExistsError, which names `shown`, while another process has a file for the same target
        """
        for _ in range(TRIES):
            part = cls(target)
            try:
                others = _clean(target, part.path)
            except BaseException:
                part.remove()
                raise
            if not (alone and others):
                return part
            part.remove()
            time.sleep(0.05 * float(secrets.randbelow(1000)) / 1000)
        raise FileExistsError(
            f"cannot write {str(shown)!r}: another run is writing it; wait for that one or choose another name"
        )

    def commit(self) -> None:
        """Make this file `target`, with the permissions that `target` had."""
        if self._lock is not None:
            self.restore()
            if self.target.exists():
                shutil.copymode(self.target, self.path)
            if os.name == "nt":  # where files that are open cannot be moved
                self._unlock()
            os.replace(self.path, self.target)
            self._unlock()

    def restore(self) -> None:
        """Write anew what this file, still open here, holds, where its folder or its name was deleted meanwhile."""
        if self._lock is None or _is_file_at(self._lock, self.path):
            return
        self.target.parent.mkdir(parents=True, exist_ok=True)
        log.warning("%s was deleted while %s was written in it; it is made again", self.target.parent, self.target.name)
        part = Part(self.target)
        try:
            with open(os.dup(self._lock), "rb") as source, open(part.path, "wb") as file:
                source.seek(0)
                shutil.copyfileobj(source, file)
        except BaseException:
            part.remove()
            raise
        os.close(self._lock)
        self.path, self._lock = part.path, part._lock

    def remove(self) -> None:
        """Remove this file."""
        if self._lock is not None:
            if os.name == "nt":
                self._unlock()
            self.path.unlink(missing_ok=True)
            self._unlock()

    def _unlock(self) -> None:
        if self._lock is not None:
            os.close(self._lock)
            self._lock = None


def _host() -> str:
    """Eight hexadecimal digits for this machine: locks of other machines may not be seen here."""
    return f"{zlib.crc32(platform.node().encode()):08x}"


def _tag(target: Path) -> str:
    """Eight hexadecimal digits for the name of a target."""
    return f"{zlib.crc32(os.fsencode(target.name)):08x}"


def _try_lock(descriptor: int) -> bool | None:
    """True where the file is locked now, without waiting; False where another has it; None without locks here."""
    try:
        import fcntl
    except ImportError:
        return None
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    except OSError:
        return None
    return True


def _is_file_at(descriptor: int, path: Path) -> bool:
    """Whether `path` still names the open file."""
    try:
        return os.path.samestat(os.fstat(descriptor), os.lstat(path))
    except FileNotFoundError:
        return False


def _clean(target: Path, own: Path) -> bool:
    """Remove this user's files beside `target` that no living process owns; whether others write `target` now."""
    others = False
    for path in target.parent.glob(".sarcl-*.part"):
        match = NAME.fullmatch(path.name)
        if match is None or path == own:
            continue
        try:
            descriptor = os.open(path, os.O_RDWR | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0))
        except OSError:  # a link, or of another user, or gone
            continue
        try:
            status = os.fstat(descriptor)
            mine = stat.S_ISREG(status.st_mode) and (not hasattr(os, "getuid") or status.st_uid == os.getuid())
            free = _try_lock(descriptor)
            if free is False:
                others |= match["target"] == _tag(target)
            elif free and mine and (match["host"] == _host() or time.time() - status.st_mtime > OLD):
                if _is_file_at(descriptor, path):
                    path.unlink()
                    log.info("removed %s, which a killed run left", path)
        except OSError as exc:
            log.debug("%s stays: %s", path, exc)
        finally:
            os.close(descriptor)
    return others
