"""One run of a command: its lines, its bar, the files it has finished, and Ctrl-C that is not lost."""

from __future__ import annotations

import signal
import sys
from typing import Any

from .progress import Bar


class Job:
    """Used as `with Job(kept) as job`; kept gets the names of finished files.

    Ctrl-C raises KeyboardInterrupt at once, as ever. Python drops it where it arrives in a destructor or in
    a C library's callback; then the next report of progress, or the next file, raises it again.
    """

    def __init__(self, kept: list[str]) -> None:
        self.kept = kept
        self.bar = Bar()
        self.interrupted = False
        self._before: Any = None
        self._hook = sys.unraisablehook

    def __enter__(self) -> Job:
        # not where Ctrl-C is ignored (nohup, background jobs of a shell), nor in a program that handles it
        if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
            try:
                self._before = signal.signal(signal.SIGINT, self._interrupt)
            except ValueError:  # not the main thread, where no signal arrives
                return self
            sys.unraisablehook = self._unraisable
        return self

    def __exit__(self, *exc: Any) -> None:
        self.bar.wipe()
        if self._before is not None:
            signal.signal(signal.SIGINT, self._before)
            sys.unraisablehook = self._hook

    def check(self) -> None:
        """Raise KeyboardInterrupt where Ctrl-C was pressed."""
        if self.interrupted:
            raise KeyboardInterrupt

    def progress(self, stage: str, done: int, total: int) -> None:
        """What verbs call: the bar, and a place to stop."""
        self.check()
        self.bar(stage, done, total)

    def say(self, text: str) -> None:
        """Print a line, the bar out of its way."""
        self.check()
        self.bar.wipe()
        print(text, flush=True)

    def finished(self, path: Any) -> None:
        """A file is complete."""
        self.kept.append(str(path))

    def _interrupt(self, *_: Any) -> None:
        self.interrupted = True
        raise KeyboardInterrupt

    def _unraisable(self, unraisable: Any) -> None:
        if not isinstance(unraisable.exc_value, KeyboardInterrupt):
            self._hook(unraisable)
