"""A progress bar for verbs, drawn by tqdm: `echo(..., progress=Bar())`.

Verbs call progress(stage, done, total), with done = 0 when a stage starts and done = total when it ends.
"""

from __future__ import annotations

import os
import sys
import time
from typing import TYPE_CHECKING, NoReturn, TextIO

if TYPE_CHECKING:
    from tqdm import tqdm

DELAY = 1.0  # s; a shorter stage draws nothing, and tqdm is not imported for it
FORMAT = "{desc} {percentage:3.0f}% |{bar:24}| {rate_fmt}, {remaining} left"


class Bar:
    """Shows the running stage with its rate and the time left, once the stage has lasted a second.

    A line on stderr where that is a terminal, a widget in a notebook, nothing elsewhere. The line is removed when the
    stage ends and when the `with` block ends, however it ends. A lost terminal does not stop the work.

    stream  where the line is drawn if it is a terminal; None: sys.stderr

    >>> raw = sarcl.echo(scene, chirp, track, progress=sarcl.progress.Bar())
    """

    def __init__(self, stream: TextIO | None = None) -> None:
        if stream is not None and not hasattr(stream, "write"):
            raise TypeError(f"stream is a {type(stream).__name__}; give an open text file, such as sys.stderr, or None")
        self._stream = stream
        self._stage: str | None = None
        self._start = 0.0
        self._line: tqdm[NoReturn] | None = None

    def __enter__(self) -> Bar:
        return self

    def __exit__(self, *exc: object) -> None:
        self.wipe()

    def __call__(self, stage: str, done: int, total: int) -> None:
        """One report of a verb."""
        if stage != self._stage or done <= 0:
            self.wipe()
            self._stage, self._start = stage, time.monotonic()
        if done >= total:
            self.wipe()
            self._stage = None
        elif self._line is not None:
            self._line.update(done - self._line.n)
        elif done > 0 and time.monotonic() - self._start >= DELAY:
            self._line = _line(stage, done, total, self._stream)

    def wipe(self) -> None:
        """Remove the line; the next report of a stage that still runs draws it again."""
        if self._line is not None:
            self._line.close()
            self._line = None


def _line(stage: str, done: int, total: int, stream: TextIO | None) -> tqdm[NoReturn]:
    from tqdm.auto import tqdm

    stream = sys.stderr if stream is None else stream
    quiet = stream is None or stream.closed or os.environ.get("TERM") == "dumb"
    width = {"ncols": 80} if not quiet and _columns(stream) == 0 else {"dynamic_ncols": True}
    return tqdm(
        desc=stage, initial=done, total=total, file=stream, disable=True if quiet else None, leave=False, miniters=1,
        unit="", unit_scale=True, bar_format=FORMAT, **width,
    )  # fmt: skip


def _columns(stream: TextIO) -> int | None:
    """Width of the terminal, 0 where it does not know its own, for which tqdm would draw nothing; None: no terminal."""
    try:
        return os.get_terminal_size(stream.fileno()).columns
    except (OSError, AttributeError):
        return None
