"""Echoes formed from finished anchors, in files beside the output: a run that was killed continues from them.

OUT.anchors/ holds a file for each anchor and polarisation that is sent. A file gets its name when it is complete. Its
name and its head hold the fingerprint of the task, and its end a checksum: a file where one does not match is not used.
"""

from __future__ import annotations

import json
import logging
import os
import secrets
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np

from ...base.errors import warn
from ...base.fingerprint import as_bytes, checker
from ...base.text import size_text
from ...io import output_paths
from ..runs import RunEnd

log = logging.getLogger(__name__)

MAGIC = b"sarcl anchor 1\n"
DIGEST = 32  # bytes of the checksum
HEAD = 4  # bytes of the head's length


class AnchorFiles:
    """The files of one task; the folder is made with the first of them.

    out   the file of the samples;  mark  the fingerprint of the task, 32 hexadecimal digits
    """

    def __init__(self, out: Any, mark: str) -> None:
        self.folder = Path(f"{output_paths.place(out)}.anchors")
        self.mark = mark
        if others := [p for p in self.folder.glob("*.anchor") if not p.name.startswith(mark)]:
            log.warning(
                "%s holds %d finished anchors of another task, which are not used; delete the folder where that task "
                "will not be continued",
                self.folder,
                len(others),
            )

    def load(self, pulse: int, sent: str, shape: tuple[int, ...]) -> tuple[np.ndarray, RunEnd] | None:
        """Echoes of `shape`, and how the runs ended; None where there is no such file, or a damaged one."""
        path = self._path(pulse, sent)
        try:
            whole = path.read_bytes()
        except FileNotFoundError:
            return None
        start = len(MAGIC) + HEAD
        size = int.from_bytes(whole[len(MAGIC) : start], "little")
        text, values, digest = whole[start : start + size], whole[start + size : -DIGEST], whole[-DIGEST:]
        sound = whole.startswith(MAGIC) and checker(whole[:-DIGEST]).digest() == digest
        head = json.loads(text) if sound else {}
        if head.get("mark") != self.mark or len(values) != 8 * int(np.prod(shape)):
            log.warning("%s is damaged: this anchor is computed again", path)
            return None
        return np.frombuffer(values, np.complex64).reshape(shape), RunEnd(head["steps"], head["left"])

    def keep(self, pulse: int, sent: str, echoes: np.ndarray, ended: RunEnd) -> None:
        """Write the echoes of an anchor, complex64, completely or not at all; a warning where there is no room."""
        text = json.dumps({"mark": self.mark, "steps": ended.steps, "left": ended.left}).encode()
        temporary = self.folder / f".{self.mark}-{secrets.token_hex(8)}.tmp"
        parts: tuple[Any, ...] = (
            MAGIC,
            len(text).to_bytes(HEAD, "little"),
            text,
            as_bytes(echoes.astype(np.complex64, copy=False)),
        )
        try:
            self.folder.mkdir(exist_ok=True)
            with open(temporary, "wb") as file:
                for part in parts:
                    file.write(part)
                file.write(checker(*parts).digest())
            os.replace(temporary, self._path(pulse, sent))
        except OSError as error:  # the echoes are in memory: the task goes on
            self._remove(temporary)
            warn(
                f"the echoes of an anchor, {size_text(echoes.nbytes)}, could not be kept in {self.folder} "
                f"({error.strerror or error}): the task goes on, but once killed it computes this anchor again; make "
                "room there"
            )
        except BaseException:
            self._remove(temporary)
            raise

    def _remove(self, path: Path) -> None:
        with suppress(OSError):
            path.unlink()

    def clear(self) -> None:
        """Remove the files of this task, and the folder where nothing is left in it."""
        for pattern in (f"{self.mark}-*.anchor", f".{self.mark}-*.tmp"):  # a kill leaves a file that is half written
            for path in self.folder.glob(pattern):
                path.unlink(missing_ok=True)
        try:
            self.folder.rmdir()
        except OSError:  # not there, or files of other tasks are
            pass

    def _path(self, pulse: int, sent: str) -> Path:
        return self.folder / f"{self.mark}-{sent}-{pulse:06d}.anchor"
