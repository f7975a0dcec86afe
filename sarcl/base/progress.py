"""A progress bar for verbs: `echo(..., progress=Bar())`.

Verbs call progress(stage, done, total), with done = 0 when a stage starts and done = total when it ends.
"""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Callable
from typing import Any, TextIO

DELAY = 1.0  # s; shorter stages draw nothing
PERIOD = 0.1  # s between drawings
WIDTH = 24


class Bar:
    """Draws the running stage on stderr, with rate and time left, once it has lasted a second.

    stream  where to draw, default sys.stderr; nothing is drawn unless it is a terminal
    clock   seconds, default time.monotonic

    The line is wiped when a stage ends and when the `with` block ends, however it ends. Drawing happens in
    the caller's thread and never raises: a lost terminal must not cost a result.
    """

    def __init__(self, stream: TextIO | None = None, clock: Callable[[], float] = time.monotonic) -> None:
        self.stream = sys.stderr if stream is None else stream
        self.clock = clock
        self.stage: str | None = None
        self.start = self.drawn = 0.0
        self.visible = False
        try:
            self.on = self.stream.isatty() and os.environ.get("TERM") != "dumb"
        except (AttributeError, ValueError):  # no stderr (pythonw), or a closed one
            self.on = False

    def __enter__(self) -> Bar:
        return self

    def __exit__(self, *exc: Any) -> None:
        self.wipe()

    def __call__(self, stage: str, done: int, total: int) -> None:
        """One report of a verb."""
        if not self.on:
            return
        now = self.clock()
        if stage != self.stage or done <= 0:
            self.wipe()
            self.stage, self.start, self.drawn = stage, now, now
        if done >= total:
            self.wipe()
            self.stage = None
        elif now - self.start >= DELAY and now - self.drawn >= PERIOD and done > 0:
            self.drawn = now
            self._write("\r" + line(stage, done, total, now - self.start)[: self._columns() - 1] + "\x1b[K")
            self.visible = True

    def wipe(self) -> None:
        """Leave the terminal's line empty."""
        if self.visible:
            self._write("\r\x1b[K")
            self.visible = False

    def _columns(self) -> int:
        try:
            # some terminals do not know their width and say 0
            return max(os.get_terminal_size(self.stream.fileno()).columns or 80, 2)
        except (OSError, ValueError, AttributeError):
            return 80

    def _write(self, text: str) -> None:
        try:
            self.stream.write(text)
            self.stream.flush()
        except (OSError, ValueError):
            self.on = False


def line(stage: str, done: int, total: int, seconds: float) -> str:
    """The text of a bar: "backproject  ######------  50%  1.2 k/s  8 s left"."""
    part = min(done / total, 1.0)
    full = int(part * WIDTH)
    rate = done / seconds
    left = (total - done) / rate
    bar = "#" * full + "-" * (WIDTH - full)
    return f"{stage}  {bar} {100 * part:3.0f}%  {rate_text(rate)}  {time_text(left)} left"


def rate_text(rate: float) -> str:
    """A rate in steps a second, or a minute where it is slow: "850/s", "1.2 k/s", "7.5/min"."""
    if rate < 0.5:
        return f"{60 * rate:.3g}/min"
    for unit in ("", " k", " M"):
        if rate < 999.5:
            return f"{rate:.3g}{unit}/s"
        rate /= 1000
    return f"{rate:.4g} G/s"


def time_text(seconds: float) -> str:
    """A duration as a person says it: "8 s", "3 min 20 s", "2 h 05 min"."""
    whole = round(seconds)
    if whole < 60:
        return f"{whole} s"
    if whole < 3600:
        return f"{whole // 60} min {whole % 60:02d} s"
    return f"{whole // 3600} h {whole % 3600 // 60:02d} min"
